"""One file that reproduces a study: `--archive` writes it, `wm-drake rerun` runs it again.

It is a zip file with `archive.json` (study, options, versions), the machines as `machine_N.json`
with their numbers in SI before `--set`, their SDF files, the input files of the options, the tables
of the result, and the ledger of its runs. Files that these files name are in it too, if they do so
relative to themselves.
"""

import io
import json
import os
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from wm_drake.errors import check_known, input_error, reason_of
from wm_drake.report.provenance import now, source_revision, version
from wm_drake.studies.result_folder import LEDGER
from wm_drake.written_files import write_files

if TYPE_CHECKING:
    from wm_drake.parameters import MachineParameters
    from wm_drake.studies.answer import Answer
    from wm_drake.studies.study import Study

FORMAT = "wm_drake archive 1"
ABOUT, TABLES, INPUTS = "archive.json", "tables/", "inputs/"
NOT_AGAIN = ("out", "overwrite", "figures", "archive", "resume", "cluster", "workers")
"""Options of the driver that belong to a place and not to the study."""

NAMING = (".yaml", ".yml", ".sdf", ".gltf")
"""Suffixes of files that may name others: what they extend, tables, meshes."""

_WORD = re.compile(r"[^\s\"'<>\[\]{},]+|\"[^\"\n]+\"|'[^'\n]+'")
"""What may be the name of a file in a text: a word, or a text in quotes."""

FILES_OF_MACHINE = ("model", "measured", "published")
"""Fields of a machine that are files."""

SAME = 1e-6
"""Difference of two numbers, relative to the largest of their column, up to which they count as the
same: tables have nine digits, and other processors round otherwise."""

TIMES = "wall_s"
"""Column with the time that a run took, which is another one each time."""


class Archived(NamedTuple):
    """Study in an archive.

    Attributes:
        study: Words of its command.
        command: Command line or Python call.
        machines: Machines before `--set`, by what their option names.
        options: Options of the study, without machines that the driver builds.
        chosen: Names of those that the user has set.
        run: Options of the driver, without those of `NOT_AGAIN`.
    """

    study: str
    command: str
    machines: "Mapping[str, MachineParameters]"
    options: Mapping[str, Any]
    chosen: Sequence[str]
    run: Mapping[str, Any]


def study_of(command: str, where: str) -> "Study":
    """Return a study by the words of its command.

    Raises:
        InputError: no study has this command.
    """
    from wm_drake.studies.compare.options import COMPARE
    from wm_drake.studies.identify.options import IDENTIFY
    from wm_drake.studies.orders.options import ORDERS
    from wm_drake.studies.rig.options import RIG
    from wm_drake.studies.study import STUDIES

    every = {s.command: s for s in (*STUDIES.values(), *RIG, *IDENTIFY, COMPARE, ORDERS)}
    check_known(command, list(every), f"no study '{command}'", where=where)
    return every[command]


def write_archive(
    path: Path, study: Archived, result: "Answer", ledger: Path | None, *, replace: bool
) -> None:
    """Write the archive of a study.

    Args:
        ledger: Closed ledger of its runs, if it has one.
        replace: Whether a file that exists is replaced.

    Raises:
        InputError: the file exists already or cannot be written.
    """
    content, names = dict[str, bytes](), dict[str, str]()
    options = _packed(study.options, content, names)
    machines = [_packed_machine(one, content, names) for one in study.machines.values()]
    about = {
        "format": FORMAT,
        "study": study.study,
        "command": study.command,
        "date": now(),
        "version": version(),
        "revision": source_revision(),
        "libraries": libraries(),
        "machines": list(study.machines),
        "options": options,
        "chosen": list(study.chosen),
        "files": names,
        "run": dict(study.run),
    }
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(ABOUT, json.dumps(about, indent=1))
        for number, one in enumerate(machines):
            archive.writestr(f"machine_{number}.json", json.dumps(one))
        for name, data in content.items():
            archive.writestr(name, data)
        for name, table in result.tables().items():
            archive.writestr(f"{TABLES}{name}.csv", _csv(table))
        if ledger is not None and ledger.exists():
            archive.write(ledger, LEDGER)
    write_files({path: whole.getvalue()}, replace=replace)


def libraries() -> dict[str, str]:
    """Return the versions of the libraries that compute."""
    from importlib.metadata import version as version_of

    return {name: version_of(name) for name in ("drake", "numpy", "scipy", "numba")}


def _packed_machine(
    parameters: "MachineParameters", content: dict[str, bytes], names: dict[str, str]
) -> dict[str, Any]:
    """Return a machine for JSON, and add its files to the content of an archive."""
    from wm_drake.model.bodies import sdf_path

    tree: dict[str, Any] = json.loads(parameters.model_dump_json())
    tree["model"] = str(sdf_path(parameters.model).resolve())
    return tree | _packed({name: tree[name] for name in FILES_OF_MACHINE}, content, names)


def _packed(
    values: Mapping[str, Any], content: dict[str, bytes], names: dict[str, str]
) -> dict[str, Any]:
    """Return values in which names of files are names in an archive.

    Args:
        content: Files of the archive, to which they are added.
        names: What the user called each of them, to which they are added.
    """

    def of(value: Any) -> Any:
        if isinstance(value, (list, tuple)):
            return [of(one) for one in value]
        text = str(value) if isinstance(value, (str, Path)) else ""
        before, _, after = text.partition("=")
        if _is_file(text) or (isinstance(value, Path) and value.is_dir()):
            name = _added(Path(text), f"{INPUTS}{len(content)}", content)
            names[name] = text
            return name
        return f"{before}={of(after)}" if _is_file(after) else text or value

    return {key: of(value) for key, value in values.items()}


def _added(path: Path, place: str, content: dict[str, bytes]) -> str:
    """Add a file with those that it names, or a folder, to an archive; return its name there."""
    path, files = Path(os.path.normpath(path.absolute())), dict[Path, bytes]()
    for one in path.iterdir() if path.is_dir() else [path]:
        if one.is_file() and one.name != LEDGER and one.suffix != ".html":
            _find_with_others(one, files)
    root = os.path.commonpath([path.parent, *(one.parent for one in files)])
    content.update({f"{place}/{one.relative_to(root)}": data for one, data in files.items()})
    return f"{place}/{path.relative_to(root)}"


def _find_with_others(path: Path, files: dict[Path, bytes]) -> None:
    """Add a file and those that it names to files."""
    if path in files:
        return
    files[path] = path.read_bytes()
    if path.suffix.lower() in NAMING:
        text = files[path].decode(errors="replace")
        for word in _WORD.findall(text):
            other = Path(word.strip("\"'"))
            if not other.is_absolute() and _is_file(path.parent / other):
                _find_with_others(Path(os.path.normpath(path.parent / other)), files)


def _is_file(path: str | Path) -> bool:
    try:
        return bool(path) and Path(path).is_file()
    except (OSError, ValueError):
        return False


def read_archive(
    path: Path, folder: Path
) -> tuple[Archived, dict[str, Any], dict[str, pd.DataFrame]]:
    """Return the study of an archive, its `archive.json`, and the tables of its result by name.

    Args:
        folder: Empty folder, for the input files; it must stay until the study ends.

    Raises:
        InputError: the file is no archive.
    """
    from wm_drake.parameters import MachineParameters

    try:
        with zipfile.ZipFile(path) as archive:
            about = json.loads(archive.read(ABOUT))
            if about["format"] != FORMAT:
                raise KeyError
            names = {name for name in archive.namelist() if name.startswith(INPUTS)}
            archive.extractall(folder, names)
            texts = [archive.read(f"machine_{n}.json") for n in range(len(about["machines"]))]
            trees = [_unpacked(json.loads(text), folder, names) for text in texts]
            machines = [MachineParameters.model_validate(tree) for tree in trees]
            tables = {
                Path(name).stem: pd.read_csv(io.BytesIO(archive.read(name)))
                for name in archive.namelist()
                if name.startswith(TABLES)
            }
            study = Archived(
                about["study"],
                about["command"],
                dict(zip(about["machines"], machines, strict=True)),
                _unpacked(about["options"], folder, names),
                about["chosen"],
                about["run"],
            )
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
        if isinstance(error, OSError) and error.filename is None:  # a full disk
            raise
        reason = reason_of(error) if isinstance(error, OSError) else "is no archive of a study"
        raise input_error(reason, where=str(path)) from None
    return study, about, tables


def _unpacked(values: Mapping[str, Any], folder: Path, files: set[str]) -> dict[str, Any]:
    """Return values with the extracted files of an archive."""

    def of(value: Any) -> Any:
        if isinstance(value, list):
            return [of(one) for one in value]
        before, equals, place = str(value).rpartition("=")
        is_known = place in files or (place and any(f.startswith(f"{place}/") for f in files))
        return f"{before}{equals}{folder / place}" if is_known else value

    return {key: of(value) for key, value in values.items()}


def differences(
    before: Mapping[str, pd.DataFrame],
    after: Mapping[str, pd.DataFrame],
    names: Mapping[str, str],
) -> Iterator[str]:
    """Yield a line for each table that is not the same again: how much, and in which column.

    Args:
        names: What the user called the files that the second result names, by their paths.
    """
    for name in dict.fromkeys([*before, *after]):
        if name not in before or name not in after:
            yield f"{name}: is only in the {'new result' if name in after else 'archive'}"
            continue
        one, other = before[name], pd.read_csv(io.StringIO(_with_names(_csv(after[name]), names)))
        one, other = (table.drop(columns=TIMES, errors="ignore") for table in (one, other))
        if list(one.columns) != list(other.columns) or len(one) != len(other):
            yield f"{name}: has other columns or another number of rows"
            continue
        far = {column: _difference(one[column], other[column]) for column in one.columns}
        worst = max(far, key=lambda column: far[column], default="")
        if worst and far[worst] > SAME:
            yield f"{name}: column {worst} differs by {far[worst]:.2g} of its largest value"


def _with_names(text: str, names: Mapping[str, str]) -> str:
    for path, name in names.items():
        text = text.replace(path, name)
    return text


def _csv(table: pd.DataFrame) -> str:
    return str(table.to_csv(index=False, float_format="%.9g"))


def _difference(one: pd.Series, other: pd.Series) -> float:
    """Return the largest difference of two columns, as a share of the largest number."""
    if one.dtype.kind in "fiu" and other.dtype.kind in "fiu":
        a, b = one.to_numpy(dtype=float), other.to_numpy(dtype=float)
        if not np.array_equal(np.isfinite(a), np.isfinite(b)):
            return np.inf
        known = np.isfinite(a)
        largest = float(np.max(np.abs(a[known]), initial=0.0)) or 1.0
        return float(np.max(np.abs(a - b)[known], initial=0.0)) / largest
    return 0.0 if one.fillna("").astype(str).equals(other.fillna("").astype(str)) else np.inf
