"""Machine, load and profile files: YAML (profiles also CSV) in, YAML out. Every message names file, line and key path."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import YAMLError
from ruamel.yaml.resolver import VersionedResolver

from wm_drake.errors import InputError, input_error, nearest_names
from wm_drake.parameters.csv_files import read_csv
from wm_drake.parameters.keys import quantities, source_of
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.spin import Load, SpinProfile

MACHINES_FOLDER = Path(__file__).parents[1] / "data" / "machines"
CYCLES_FOLDER = Path(__file__).parents[1] / "data" / "cycles"
Model = TypeVar("Model", bound=BaseModel)


def shipped_machines() -> dict[str, Path]:
    """Machine files that come with the package, by name."""
    return {path.stem: path for path in sorted(MACHINES_FOLDER.glob("*.yaml"))}


def load_machine(name_or_path: str | Path = "reference") -> MachineParameters:
    """Reads a machine file.

    Args:
        name_or_path: Name of a shipped machine, or path of a YAML file. ``extends: NAME_OR_PATH`` in a file starts from
            another machine and changes what the file names.

    Raises:
        InputError: with one problem per fault.
    """
    path = machine_path(name_or_path)
    plain, sources = _without_sources(_extended(path, ()))
    plain = _with_absolute_paths(plain, path)
    return _validated(MachineParameters, {**plain, "sources": sources}, path)


def machine_path(name_or_path: str | Path) -> Path:
    """The file of a shipped machine's name or of a path."""
    shipped = shipped_machines()
    if str(name_or_path) in shipped:
        return shipped[str(name_or_path)]
    path = Path(name_or_path)
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "no such file"
        raise input_error(
            f"{what}, and no shipped machine of that name{nearest_names(str(name_or_path), shipped)}",
            where=str(path),
        )
    return path


def load_load(path: Path) -> Load:
    """Reads a load file: ``unbalances: [{mass, radius, y, phase}, ...]``, written as in a machine file."""
    tree = read_yaml(path)
    return _validated(Load, _without_sources(tree)[0], path)


def read_mapping(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """A YAML file as plain text values, and the sources of its numbers by key path."""
    return _without_sources(read_yaml(path))


def read_model(model: type[Model], path: Path) -> Model:
    """Reads a YAML file of any other kind, as the model says.

    Raises:
        InputError: with one problem per fault, its line and key path.
    """
    return _validated(model, read_yaml(path), path)


def shipped_profiles() -> dict[str, Path]:
    """Spin profiles that come with the package, by name."""
    return {
        path.stem: path
        for path in sorted(CYCLES_FOLDER.iterdir())
        if path.stem.startswith("profile_")
    }


def load_profile(name_or_path: str | Path) -> SpinProfile:
    """Reads a spin profile: YAML as in a machine file, or CSV (# begins a comment).

    Args:
        name_or_path: Name of a shipped profile, or a file. CSV has the columns time_s and speed_rpm, and perhaps region: the
            name of the region that a row begins or goes on; empty outside of all.

    Raises:
        InputError: with one problem per fault.
    """
    shipped = shipped_profiles()
    path = shipped.get(f"profile_{name_or_path}", Path(name_or_path))
    if not path.is_file():
        known = [name.removeprefix("profile_") for name in shipped]
        raise input_error(
            f"no such file, and no shipped profile of that name{nearest_names(str(path), known)}",
            where=str(path),
        )
    if path.suffix.lower() != ".csv":
        tree = read_yaml(path)
        return _validated(SpinProfile, _without_sources(tree)[0], path)
    table = read_csv(path, ["time_s", "speed_rpm"], optional="region")
    if table.empty:
        raise input_error("is empty: a profile needs at least two points", where=str(path))
    numbers = table[["time_s", "speed_rpm"]].apply(pd.to_numeric, errors="coerce")
    finite = np.isfinite(numbers.to_numpy(dtype=float)).all(axis=1)
    if not finite.all():
        row = int(np.flatnonzero(~finite)[0])
        raise input_error(
            f"row {row + 1} of the data is not two finite numbers: {table.iloc[row].tolist()}",
            where=str(path),
        )
    text = {"time": ("time_s", "s"), "speed": ("speed_rpm", "rpm")}
    fields: dict[str, Any] = {
        key: f"({', '.join(map(repr, numbers[name].tolist()))}) {unit}"
        for key, (name, unit) in text.items()
    }
    if "region" in table:
        fields["regions"] = _regions(
            numbers["time_s"].tolist(), table["region"].fillna("").astype(str).tolist()
        )
    return _validated(SpinProfile, fields, path)


def _regions(times: list[float], names: list[str]) -> list[dict[str, str]]:
    """Stretches of equal name between the rows of a profile."""
    regions: list[dict[str, str]] = []
    for begin, end, name, before in zip(times, times[1:], names, ["", *names], strict=False):
        name = name.strip()
        if name and name == before.strip():
            regions[-1]["end"] = f"{end!r} s"
        elif name:
            regions.append({"name": name, "begin": f"{begin!r} s", "end": f"{end!r} s"})
    return regions


def machine_yaml(parameters: MachineParameters) -> str:
    """The machine as the text of a machine file, in engineers' units, each number with its source if it has one."""
    tree = parameters.model_dump(mode="json", exclude={"sources"}, exclude_unset=True)
    for key, value, unit in list(quantities(parameters)):
        *parents, name = key.split(".")
        node: Any = tree
        for part in parents:
            node = node[int(part)] if isinstance(node, list) else node.get(part)
            if node is None:
                break  # a default that was not set
        if node is None or name not in node:
            continue
        source = source_of(parameters, key)
        node[name] = {"value": unit.text(value), "source": source} if source else unit.text(value)
    text = _TextStream()
    _yaml().dump(tree, text)
    return text.text


def machine_file_with(path: Path, parameters: MachineParameters, keys: Iterable[str]) -> str:
    """A machine file as it is written, with comments and order, but some numbers and their sources those of `parameters`.

    Args:
        path: The file; the keys stand in it, not in one it extends.
        parameters: Whose numbers and sources to write.
        keys: Key paths of the numbers.
    """
    tree = read_yaml(path)
    known = {key: (value, unit) for key, value, unit in quantities(parameters)}
    for key in keys:
        value, unit = known[key]
        *parents, name = key.split(".")
        node: Any = tree
        for part in parents:
            node = node[int(part)] if isinstance(node, list) else node[part]
        if isinstance(value, tuple):  # of a table, which has one source
            node[name], node["source"] = unit.text(value), source_of(parameters, key)
            continue
        if not isinstance(node[name], CommentedMap):
            node[name] = CommentedMap()
            node[name].fa.set_flow_style()
        node[name]["value"], node[name]["source"] = unit.text(value), source_of(parameters, key)
    text = _TextStream()
    _yaml().dump(tree, text)
    return text.text


class _TextStream:
    text = ""

    def write(self, part: str | bytes) -> None:
        self.text += part if isinstance(part, str) else part.decode()


class _TextResolver(VersionedResolver):
    """Reads every plain scalar as text, null apart: numbers need units anyway, and no date or huge integer can trip it."""

    @property
    def versioned_resolver(self) -> dict[str, list[tuple[Any, Any]]]:
        null = "tag:yaml.org,2002:null"
        kept = {
            first: [pair for pair in pairs if str(pair[0]) == null]
            for first, pairs in super().versioned_resolver.items()
        }
        return {first: pairs for first, pairs in kept.items() if pairs}


def _yaml() -> YAML:
    yaml = YAML(typ="rt")
    yaml.Resolver = _TextResolver
    yaml.width = 4096
    return yaml


def read_yaml(path: Path) -> CommentedMap:
    """The mapping in a YAML file; every plain scalar is text.

    Raises:
        InputError: not there, not YAML, not a mapping.
    """
    try:
        tree = _yaml().load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise input_error(error.strerror or "cannot be read", where=str(path)) from None
    except UnicodeDecodeError:
        raise input_error("is not text in UTF-8", where=str(path)) from None
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{path}:{mark.line + 1}" if mark else str(path)
        raise input_error(
            f"is not YAML: {' '.join(str(getattr(error, 'problem', None) or error).split())}",
            where=where,
        ) from None
    if not isinstance(tree, CommentedMap):
        raise input_error(
            "is empty; allowed is a mapping of keys to values"
            if tree is None
            else "is not a mapping",
            where=str(path),
        )
    return tree


def _extended(path: Path, seen: tuple[Path, ...]) -> CommentedMap:
    tree = read_yaml(path)
    if "extends" not in tree:
        return tree
    base_path = _base_path(tree, path)
    del tree["extends"]
    if base_path.resolve() in (*seen, path.resolve()):
        raise input_error("extends itself", where=str(path), key="extends")
    base_tree = _extended(base_path, (*seen, path.resolve()))
    for key in ("model", "measured"):  # paths are meant relative to the file that names them
        if key in base_tree:
            base_tree[key] = _with_absolute_paths({key: base_tree[key]}, base_path)[key]
    _merge(base_tree, tree)
    return base_tree


def _merge(base: CommentedMap, changes: Mapping[str, Any]) -> None:
    """Puts `changes` over `base`, mapping by mapping; null removes an entry. A number replaces its old source too."""
    for key, value in changes.items():
        old = base.get(key)
        if value is None:
            base.pop(key, None)
        elif isinstance(old, CommentedMap) and isinstance(value, Mapping) and not _is_whole(value):
            _merge(old, value)
        else:
            base[key] = value


def _is_whole(value: Mapping[str, Any]) -> bool:
    """Whether a mapping is one value (a number with source, a table, a profile), to be replaced and not merged."""
    return any(key in value for key in ("value", "force", "torque", "steps", "time"))


def _without_sources(node: Any, key: str = "") -> tuple[Any, dict[str, str]]:
    """The tree without its ``source`` texts and ``{value, source}`` wrappers, and the sources by key path."""
    sources: dict[str, str] = {}
    if isinstance(node, Mapping):
        if "source" in node:
            sources[key] = str(node["source"])
        if "value" in node and set(node) <= {"value", "source"}:
            return node["value"], sources
        plain = {}
        for name, child in node.items():
            if name == "source":
                continue
            plain[str(name)], below = _without_sources(child, f"{key}.{name}" if key else str(name))
            sources |= below
        return plain, sources
    if isinstance(node, list):
        items = []
        for index, child in enumerate(node):
            item, below = _without_sources(child, f"{key}.{index}")
            items.append(item)
            sources |= below
        return items, sources
    return node, sources


def _with_absolute_paths(tree: dict[str, Any], path: Path) -> dict[str, Any]:
    """File names in a machine file are relative to it; the shipped SDF models go by their bare name."""
    changed = dict(tree)
    model = tree.get("model")
    if isinstance(model, str) and (path.parent / model).is_file():
        changed["model"] = str((path.parent / model).resolve())
    if isinstance(tree.get("measured"), list):
        changed["measured"] = [
            str((path.parent / str(name)).resolve()) for name in tree["measured"]
        ]
    return changed


def _validated(model: type[Model], plain: Any, path: Path) -> Model:
    try:
        return model.model_validate(plain, context={"units_required": True})
    except ValidationError as error:
        raise InputError(
            replace(p, where=_place(path, p.key)) for p in problems_of(error, model)
        ) from None


def located(error: InputError, path: Path) -> InputError:
    """The same problems, that showed when the machine was built, with the file the user gave and its line if it has one."""
    tree = read_yaml(path)
    problems = []
    for problem in error.problems:
        depth, line = _line_of(tree, problem.key)
        problems.append(
            replace(problem, where=problem.where or (f"{path}:{line}" if depth else str(path)))
        )
    return InputError(problems)


def _place(path: Path, key: str) -> str:
    """file:line of a key path, in the file of the chain that holds most of it."""
    best_depth, best = 0, str(path)
    while path.suffix.lower() != ".csv":
        tree = read_yaml(path)
        depth, line = _line_of(tree, key)
        if depth > best_depth:
            best_depth, best = depth, f"{path}:{line}"
        if "extends" not in tree:
            break
        path = _base_path(tree, path)
    return best


def _line_of(tree: CommentedMap, key: str) -> tuple[int, int]:
    """How many parts of a key path a file holds, and the line of the last of them."""
    node: Any = tree
    depth, line = 0, 1
    for part in key.split("."):
        if isinstance(node, CommentedMap) and part in node:
            line = node.lc.key(part)[0] + 1 if part in (node.lc.data or {}) else line
            node = node[part]
        elif isinstance(node, CommentedSeq) and part.isdigit() and int(part) < len(node):
            line = node.lc.item(int(part))[0] + 1
            node = node[int(part)]
        else:
            break
        depth += 1
    return depth, line


def _base_path(tree: CommentedMap, path: Path) -> Path:
    named = str(tree["extends"])
    return machine_path(named if named in shipped_machines() else path.parent / named)
