"""Machine, load and profile files in YAML, profiles also in CSV.

Every message names the file, the line and the key path.
"""

import io
import re
import warnings
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.composer import Composer, ComposerError
from ruamel.yaml.error import ReusedAnchorWarning, YAMLError
from ruamel.yaml.events import AliasEvent, ScalarEvent
from ruamel.yaml.resolver import VersionedResolver

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters.csv_files import finite_numbers, read_csv
from wm_drake.parameters.keys import is_index, quantities, source_of
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.spin import Load, SpinProfile
from wm_drake.parameters.text_files import DATA, ShippedFiles, check_regular, is_file, read_text

MACHINES_FOLDER = DATA / "machines"
CYCLES_FOLDER = DATA / "cycles"
_MACHINES = ShippedFiles("machine", MACHINES_FOLDER)
_PROFILES = ShippedFiles("profile", CYCLES_FOLDER, "profile_*", prefix="profile_")
Model = TypeVar("Model", bound=BaseModel)

LARGEST_YAML = 1 << 20
"""Largest size of a YAML file. [byte]"""

DEEPEST, MOST_VALUES = 40, 20_000
"""Largest depth of a YAML file, and its largest number of keys and values with aliases resolved."""

LONGEST_CHAIN = 20
"""Largest number of machine files that extend each other."""

OF_MEASURED_MACHINE = ("measured", "published")
"""Keys with files about the machine that was measured; a machine that extends it has none."""


def shipped_machines() -> dict[str, Path]:
    """Return the machine files that the package contains, by name."""
    return _MACHINES.listed()


def load_machine(name_or_path: str | Path = "reference") -> MachineParameters:
    """Read a machine file.

    A file with ``extends: NAME_OR_PATH`` contains only the changes to another machine. The measured
    amplitudes of that machine are not inherited, because they belong to its numbers.

    Args:
        name_or_path: Name of a shipped machine or path of a YAML file.

    Raises:
        InputError: the file is missing or wrong, with one problem for each error.

    Example:
        >>> import wm_drake as wm
        >>> parameters = wm.load_machine("reference")
        >>> sorted(parameters.loads)
        ['back', 'counter', 'front', 'middle']
    """
    path = machine_path(name_or_path)
    plain, sources = _without_sources(_extended(path, ()))
    plain = _with_absolute_paths(plain, path)
    return _validated(MachineParameters, {**plain, "sources": sources}, path)


def machine_path(name_or_path: str | Path) -> Path:
    """Return the path of a machine file, given the name of a shipped machine or a path."""
    return _MACHINES.path(name_or_path)


def load_load(path: Path) -> Load:
    """Read a load file: ``unbalances: [{mass, radius, y, phase}, ...]`` as in a machine file.

    Raises:
        InputError: the file is missing or wrong, with one problem for each error.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> import wm_drake as wm
        >>> path = Path(tempfile.mkdtemp()) / "towel.yaml"
        >>> text = "unbalances: [{mass: 0.8 kg, radius: 240 mm, y: -50 mm}]"
        >>> _ = path.write_text(text)
        >>> wm.load_load(path).unbalances[0].mass
        0.8
    """
    tree = read_yaml(path)
    return _validated(Load, _without_sources(tree)[0], path)


def read_mapping(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the values of a YAML file as text, and the sources of its numbers by key path."""
    return _without_sources(read_yaml(path))


def read_model(model: type[Model], path: Path) -> Model:
    """Read a YAML file whose content a pydantic model describes."""
    return _validated(model, read_yaml(path), path)


def load_profile(name_or_path: str | Path) -> SpinProfile:
    """Read a spin profile from YAML, written as in a machine file, or from CSV.

    A CSV file has the columns time_s and speed_rpm. A third column, region, is optional: it has the
    name of the region that begins or continues in a row, and is empty outside of all regions.

    Args:
        name_or_path: Name of a shipped profile or path of a file.

    Raises:
        InputError: the file is missing or wrong, with one problem for each error.

    Example:
        >>> import wm_drake as wm
        >>> wm.load_profile("run_up").duration
        70.0
    """
    path = _PROFILES.path(name_or_path)
    if path.suffix.lower() != ".csv":
        tree = read_yaml(path)
        return _validated(SpinProfile, _without_sources(tree)[0], path)
    table = read_csv(path, ["time_s", "speed_rpm"], optional="region")
    if table.empty:
        raise input_error("is empty; a profile needs at least two points", where=str(path))
    numbers = finite_numbers(table[["time_s", "speed_rpm"]], path)
    fields: dict[str, Any] = {
        key: f"({', '.join(map(repr, column.tolist()))}) {unit}"
        for (key, unit), column in zip(
            {"time": "s", "speed": "rpm"}.items(), numbers.T, strict=True
        )
    }
    if "region" in table:
        fields["regions"] = _regions(numbers[:, 0].tolist(), table["region"].tolist())
    return _validated(SpinProfile, fields, path)


def _regions(times: list[float], names: list[str]) -> list[dict[str, str]]:
    """Return the regions of a profile: consecutive rows with the same name."""
    regions: list[dict[str, str]] = []
    for begin, end, name, before in zip(times, times[1:], names, ["", *names], strict=False):
        name = name.strip()
        if name and name == before.strip():
            regions[-1]["end"] = f"{end!r} s"
        elif name:
            regions.append({"name": name, "begin": f"{begin!r} s", "end": f"{end!r} s"})
    return regions


def machine_yaml(parameters: MachineParameters) -> str:
    """Return a machine as the text of a machine file, with display units and sources of numbers."""
    return yaml_text(machine_tree(parameters))


def machine_tree(parameters: MachineParameters) -> dict[str, Any]:
    """Return a machine as the tree of a machine file, with display units and sources of numbers."""
    tree = parameters.model_dump(mode="json", exclude={"sources"}, exclude_unset=True)
    for key, value, unit in list(quantities(parameters)):
        *parents, name = key.split(".")
        node: Any = tree
        for part in parents:
            node = node[int(part)] if isinstance(node, list) else node.get(part)
            if node is None:
                break  # a default that the file does not set
        if node is None or name not in node:
            continue
        source = source_of(parameters, key)
        node[name] = {"value": unit.text(value), "source": source} if source else unit.text(value)
    return tree


def yaml_text(tree: Mapping[str, Any]) -> str:
    """Return a tree of texts as the text of a YAML file."""
    stream = io.StringIO()
    _yaml().dump(tree, stream)
    return stream.getvalue()


def machine_changes(base: MachineParameters, changed: MachineParameters) -> dict[str, Any]:
    """Return the tree of a machine file that extends a machine and has only what differs.

    Name, text and measurements of the base are left out: they belong to its own file.
    """
    trees = [machine_tree(parameters) for parameters in (base, changed)]
    for tree in trees:
        for key in ("name", "about", *OF_MEASURED_MACHINE):
            tree.pop(key, None)
    return _changes(*trees)


def _changes(base: Mapping[str, Any], changed: Mapping[str, Any]) -> dict[str, Any]:
    """Return what `_merge` must merge into `base` to get `changed`."""
    changes: dict[str, Any] = dict.fromkeys(name for name in base if name not in changed)
    for name, value in changed.items():
        old = base.get(name)
        if isinstance(old, Mapping) and isinstance(value, Mapping) and not _is_whole(value):
            inner = _changes(old, value)
            if inner:
                changes[name] = inner
        elif old != value:
            changes[name] = value
    return changes


def extended_files(path: Path) -> list[Path]:
    """Return a machine file and all files that it extends, one after the other."""
    chain = [path]
    while len(chain) <= LONGEST_CHAIN and "extends" in (tree := read_yaml(chain[-1])):
        chain.append(_base_path(tree, chain[-1]))
    return chain


def machine_file_with(path: Path, parameters: MachineParameters, keys: Iterable[str]) -> str:
    """Return the text of a machine file with some numbers replaced.

    Comments, order and all other numbers stay as they are in the file.

    Args:
        path: The file. It must contain the keys itself; a file that it extends does not count.
        parameters: Machine with the new numbers and their sources.
        keys: Key paths of the numbers to replace.
    """
    tree = read_yaml(path)
    known = {key: (value, unit) for key, value, unit in quantities(parameters)}
    for key in keys:
        value, unit = known[key]
        *parents, name = key.split(".")
        node: Any = tree
        for part in parents:
            node = node[int(part)] if isinstance(node, list) else node[part]
        has_source = isinstance(node[name], CommentedMap)
        if isinstance(value, tuple) and not has_source:  # the columns of a table share one source
            node[name], node["source"] = unit.text(value), source_of(parameters, key)
            continue
        if not has_source:
            node[name] = CommentedMap()
            node[name].fa.set_flow_style()
        node[name]["value"], node[name]["source"] = unit.text(value), source_of(parameters, key)
    return yaml_text(tree)


class _TextResolver(VersionedResolver):
    """A YAML resolver that reads every plain scalar except null as text.

    Numbers need units, so they are parsed later. Dates and huge integers need no special treatment.
    """

    @cached_property
    def versioned_resolver(self) -> dict[str, list[tuple[Any, Any]]]:
        null = "tag:yaml.org,2002:null"
        kept = {
            first: [pair for pair in pairs if str(pair[0]) == null]
            for first, pairs in super().versioned_resolver.items()
        }
        return {first: pairs for first, pairs in kept.items() if pairs}


_SURROGATE = re.compile("[\ud800-\udfff]")
"""Half of a pair such as ``\\ud83d\\udca5``, which JSON writes for one character."""


class _BoundedComposer(Composer):
    """A composer of YAML nodes that bounds their depth and number.

    An alias counts as many values as it stands for. Thus a short text whose aliases stand for
    billions of values is refused before the values are made.
    """

    def __init__(self, loader: Any = None) -> None:
        super().__init__(loader)
        self._depth, self._values = 0, 0
        self._values_of: dict[str, int | None] = {}  # by anchor; None within the node itself

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Return the next node, after checking the bounds."""
        event = self.parser.peek_event()
        anchor = event.anchor
        if self.parser.check_event(AliasEvent):
            values = self._values_of.get(anchor, 0)
            if values is None:
                problem = f"alias '{anchor}' is inside the value that it stands for"
                raise ComposerError(None, None, problem, event.start_mark)
            self._count(values, event)
            return super().compose_node(parent, index)
        self._count(1, event)
        if self.parser.check_event(ScalarEvent) and _SURROGATE.search(event.value):
            problem = "has half a character; write the character itself"
            raise ComposerError(None, None, problem, event.start_mark)
        self._depth += 1
        if self._depth > DEEPEST:
            problem = f"is nested too deeply; allowed are {DEEPEST} levels"
            raise ComposerError(None, None, problem, event.start_mark)
        before = self._values
        if anchor is not None:
            self._values_of[anchor] = None
        node = super().compose_node(parent, index)
        if anchor is not None:
            self._values_of[anchor] = self._values - before + 1
        self._depth -= 1
        return node

    def _count(self, values: int, event: Any) -> None:
        self._values += values
        if self._values > MOST_VALUES:
            problem = f"has too many values with its aliases; allowed are {MOST_VALUES}"
            raise ComposerError(None, None, problem, event.start_mark)


def _yaml() -> YAML:
    yaml = YAML(typ="rt")
    yaml.Resolver = _TextResolver
    yaml.Composer = _BoundedComposer
    yaml.width = 4096
    return yaml


@lru_cache(maxsize=8)
def _tree_of(text: str) -> Any:
    """Return the content of a YAML text, parsed once: machines extend the same few files."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReusedAnchorWarning)
        return _yaml().load(text)


def read_yaml(path: Path) -> CommentedMap:
    """Return the mapping in a YAML file, with every plain scalar except null as text."""
    return yaml_of_text(read_text(path, largest=LARGEST_YAML), str(path))


def yaml_of_text(text: str, path: str) -> CommentedMap:
    """Return the mapping in a YAML text, with every plain scalar except null as text.

    Args:
        path: Path of its file, for messages.
    """
    try:
        tree = deepcopy(_tree_of(text))
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{path}:{mark.line + 1}" if mark and path else path
        raise input_error(
            f"is not YAML: {' '.join(str(getattr(error, 'problem', None) or error).split())}",
            where=where,
        ) from None
    if not isinstance(tree, CommentedMap):
        raise input_error(
            "is empty; allowed is a mapping of keys to values"
            if tree is None
            else "is not a mapping",
            where=path,
        )
    return tree


def _extended(path: Path, seen: tuple[Path, ...]) -> CommentedMap:
    tree = read_yaml(path)
    if "extends" not in tree:
        return tree
    base_path = _base_path(tree, path)
    del tree["extends"]
    seen = (*seen, path.resolve())
    if base_path.resolve() in seen:
        raise input_error("extends itself", where=str(path), key="extends")
    if len(seen) > LONGEST_CHAIN:
        message = f"more than {LONGEST_CHAIN} files extend each other; extend an earlier one"
        raise input_error(message, where=str(path), key="extends")
    base_tree = _extended(base_path, seen)
    for key in OF_MEASURED_MACHINE:  # another machine was measured
        base_tree.pop(key, None)
    if "model" in base_tree:  # paths are relative to the file that contains them
        base_tree["model"] = _with_absolute_paths({"model": base_tree["model"]}, base_path)["model"]
    _merge(base_tree, tree)
    return base_tree


def _merge(base: CommentedMap, changes: Mapping[str, Any]) -> None:
    """Change `base` in place: merge mappings, replace other values, remove entries that are null.

    A new number replaces the old number together with its source.
    """
    for key, value in changes.items():
        old = base.get(key)
        if value is None:
            base.pop(key, None)
        elif isinstance(old, CommentedMap) and isinstance(value, Mapping) and not _is_whole(value):
            _merge(old, value)
        else:
            base[key] = value


def _is_whole(value: Mapping[str, Any]) -> bool:
    """Return whether a mapping is replaced as a whole: a number with source, table or profile."""
    return any(key in value for key in ("value", "force", "torque", "steps", "time"))


def _without_sources(node: Any, key: str = "") -> tuple[Any, dict[str, str]]:
    """Return a tree of values without their sources, and the sources by key path.

    ``{value, source}`` mappings are replaced by their value.
    """
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
    """Return a machine's values with absolute file names.

    File names are relative to the machine file. The name of a shipped SDF model is not changed.
    """
    changed = dict(tree)
    model = tree.get("model")
    if isinstance(model, str) and is_file(path.parent / model):
        changed["model"] = _absolute(path.parent / model)
    for key in OF_MEASURED_MACHINE:
        if isinstance(tree.get(key), list):
            changed[key] = [_absolute(path.parent / str(name)) for name in tree[key]]
    return changed


def _absolute(path: Path) -> str:
    """Return the absolute path; a path that cannot exist stays as it is."""
    try:
        return str(path.resolve())
    except (OSError, ValueError, RuntimeError):  # too long, a null byte, a cycle of links
        return str(path)


def _validated(model: type[Model], plain: Any, path: Path) -> Model:
    try:
        return model.model_validate(plain, context={"units_required": True})
    except ValidationError as error:
        raise InputError(
            replace(p, where=_place(path, p.key)) for p in problems_of(error, model)
        ) from None


def check_tables(machine: MachineParameters) -> None:
    """Check that the tables of measured amplitudes and published results can be read as files.

    Raises:
        InputError: a file is missing, is not a regular file, or is too large. There is one problem
            per file, with the key path of its name in the machine file.
    """
    problems = []
    for key in OF_MEASURED_MACHINE:
        for number, name in enumerate(getattr(machine, key)):
            try:
                check_regular(Path(name))
            except InputError as error:
                message = f"file '{Path(name).name[:80]}': {error.problems[0].message}"
                problems.append(Problem("", f"{key}.{number}", message))
    if problems:
        raise InputError(problems)


def located(error: InputError, path: Path) -> InputError:
    """Return an error with the file and, where known, the line of each problem added.

    Args:
        error: Error that was found later, when the machine was built.
        path: The machine file of the user.
    """
    tree = read_yaml(path)
    problems = []
    for problem in error.problems:
        depth, line = _line_of(tree, problem.key)
        problems.append(
            replace(problem, where=problem.where or (f"{path}:{line}" if depth else str(path)))
        )
    return InputError(problems)


def _place(path: Path, key: str) -> str:
    """Return ``file:line`` of a key path.

    If a file extends others, the one that contains the most parts of the key path is named.
    """
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
    """Return how many parts of a key path a file contains, and the line of the last of them."""
    node: Any = tree
    parts = key.split(".")
    depth, line = 0, 1
    while depth < len(parts):
        if isinstance(node, CommentedMap):
            ends = range(len(parts), depth, -1)  # names in a vary file are key paths themselves
            names = {".".join(parts[depth:end]): end for end in ends}
            part = next((name for name in names if name in node), None)
            if part is None:
                break
            line = node.lc.key(part)[0] + 1 if part in (node.lc.data or {}) else line
            node, depth = node[part], names[part]
        elif isinstance(node, CommentedSeq) and is_index(index := parts[depth]):
            if int(index) >= len(node):
                break
            line = node.lc.item(int(index))[0] + 1
            node, depth = node[int(index)], depth + 1
        else:
            break
    return depth, line


def _base_path(tree: CommentedMap, path: Path) -> Path:
    named = tree["extends"]
    if not isinstance(named, str):
        message = "is not the name of a shipped machine or a file"
        raise input_error(message, where=str(path), key="extends")
    try:
        return machine_path(named if named in shipped_machines() else path.parent / named)
    except InputError as error:
        raise InputError(
            replace(p, where=str(path), key="extends", message=f"'{p.where}': {p.message}")
            for p in error.problems
        ) from None
