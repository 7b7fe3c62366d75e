"""Measured loops: CSV files of time, displacement (or angle) and force (or moment), with units in the header or beside it."""

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit, convert

FEWEST = 20
"""Samples of a loop."""

_TIME, _LENGTH, _ANGLE, _FORCE, _TORQUE = (
    Unit("s", "s"),
    Unit("m", "mm"),
    Unit("rad", "deg"),
    Unit("N", "N"),
    Unit("N*m", "N*mm"),
)
_COLUMNS = {
    "time": {"time": _TIME, "t": _TIME},
    "displacement": {"displacement": _LENGTH, "d": _LENGTH, "x": _LENGTH, "angle": _ANGLE},
    "force": {"force": _FORCE, "f": _FORCE, "moment": _TORQUE, "torque": _TORQUE, "m": _TORQUE},
}
_HEAD = re.compile(r"\s*([A-Za-z]+)\s*(?:[\[(]([^\])]*)[\])]|[_ ](.+))?\s*$")
_SHORTHAND = {"Nm": "N*m", "Nmm": "N*mm", "-": None, "": None}


@dataclass(frozen=True, eq=False)
class MeasuredLoop:
    """What a bench recorded, in SI.

    Attributes:
        name: Of the file, without its ending.
        path: Of the file, for messages.
        time: Rising (n,). [s]
        displacement: Of the driven end (n,). [m; rad]
        force: On the component there (n,). [N; N m]
        rotates: Whether they are angle and moment.
    """

    name: str
    path: str
    time: FloatArray
    displacement: FloatArray
    force: FloatArray
    rotates: bool


def read_loop(path: Path, units: tuple[str, str, str] | None = None) -> MeasuredLoop:
    """Reads a loop.

    The first line that is no comment (#) names the columns, in any order: ``time [s], displacement [mm], force [N]`` or
    ``time_s,displacement_mm,force_N``; ``angle`` and ``moment`` for rotations. Other columns are left alone.

    Args:
        path: CSV with commas, semicolons or tabs.
        units: Of time, displacement and force, where the header has none.

    Raises:
        InputError: with file and line: columns, units, a value that is no finite number, time that does not rise, a signal
            that does not change, too few samples.
    """
    rows = list(_rows(path))
    if not rows:
        raise input_error("is empty; needs the columns time, displacement, force", where=str(path))
    line, head = rows[0]
    where, factors, rotates = _columns(head, units, f"{path}:{line}")
    table = np.array(
        [_numbers(cells, head, where, f"{path}:{at}") for at, cells in rows[1:]]
    ).reshape(-1, 3)
    if len(table) < FEWEST:
        raise input_error(
            f"has {len(table)} samples; a loop needs at least {FEWEST}", where=str(path)
        )
    lines = [at for at, _ in rows[1:]]
    stuck = np.flatnonzero(np.diff(table[:, 0]) <= 0.0)
    if len(stuck):
        at = int(stuck[0]) + 1
        raise input_error(
            f"time does not rise: {table[at, 0]:g} after {table[at - 1, 0]:g}",
            where=f"{path}:{lines[at]}",
            key=head[where[0]],
        )
    for column in (1, 2):
        if np.ptp(table[:, column]) == 0.0:
            message = f"is constant ({table[0, column]:g} on lines {lines[0]} to {lines[-1]})"
            raise input_error(message, where=f"{path}:{lines[0]}", key=head[where[column]])
    time, displacement, force = (table * factors).T
    return MeasuredLoop(path.stem, str(path), time, displacement, force, rotates)


def read_loops(paths: list[Path], units: tuple[str, str, str] | None = None) -> list[MeasuredLoop]:
    """Reads several loops of one kind; files of one name are told apart by their folders.

    Raises:
        InputError: all problems of all files; or some files hold angles and others displacements.
    """
    loops: list[MeasuredLoop] = []
    problems: list[Problem] = []
    for path in paths:
        try:
            loops.append(read_loop(path, units))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    for loop in loops:
        if loop.rotates != loops[0].rotates:
            kinds = ("angles and moments", "displacements and forces")
            first, other = kinds if loops[0].rotates else kinds[::-1]
            raise input_error(
                f"holds {other}, {loops[0].path} {first}; a fit takes one kind", where=loop.path
            )
    return loops


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line that is neither empty nor a comment."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise input_error(error.strerror or "cannot be read", where=str(path)) from None
    except UnicodeDecodeError:
        raise input_error("is not text in UTF-8", where=str(path)) from None
    kept = [
        (at, line)
        for at, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if kept:
        delimiter = max(",;\t", key=kept[0][1].count)
        for (at, _), cells in zip(
            kept, csv.reader((line for _, line in kept), delimiter=delimiter), strict=False
        ):
            yield at, [cell.strip() for cell in cells]


def _columns(
    head: list[str], units: tuple[str, str, str] | None, place: str
) -> tuple[tuple[int, int, int], tuple[float, float, float], bool]:
    """Indices of time, displacement and force, the factors that turn them into SI, and whether they are of a rotation."""
    found: dict[str, tuple[int, Unit, str | None]] = {}
    for index, cell in enumerate(head):
        match = _HEAD.match(cell)
        word = match[1].lower() if match else ""
        for column, names in _COLUMNS.items():
            if word in names:
                if column in found:
                    raise input_error(f"'{cell}' is a second column of {column}", where=place)
                assert match is not None
                found[column] = (index, names[word], (match[2] or match[3] or "").strip() or None)
    missing = [column for column in _COLUMNS if column not in found]
    if missing:
        raise input_error(
            f"no column {', '.join(missing)} among '{', '.join(head)}'; needs time, displacement (or angle), force (or moment)",
            where=place,
        )
    rotates = found["displacement"][1] == _ANGLE
    if rotates != (found["force"][1] == _TORQUE):
        raise input_error(
            "mixes a rotation with a translation: angle goes with moment, displacement with force",
            where=place,
        )
    factors = [
        _factor(head[found[column][0]], column, found[column][1], (found[column][2], given), place)
        for given, column in zip(units or (None,) * 3, _COLUMNS, strict=True)
    ]
    return (
        (found["time"][0], found["displacement"][0], found["force"][0]),
        (factors[0], factors[1], factors[2]),
        rotates,
    )


def _factor(
    head: str, column: str, unit: Unit, given: tuple[str | None, str | None], place: str
) -> float:
    """That turns a column into SI, by the unit in its header or on the command line."""
    own, asked = given
    if own and asked and own != asked:
        raise input_error(
            f"is in {own} by the header, in {asked} by --units", where=place, key=head
        )
    text = own or asked
    if not text:
        message = f"has no unit; write '{column} [{unit.shown}]' in the header or use --units"
        raise input_error(message, where=place, key=head)
    try:
        return convert(1.0, _SHORTHAND.get(text, text), unit)
    except ValueError as error:
        raise input_error(str(error), where=place, key=head) from None


def _numbers(
    cells: list[str], head: list[str], where: tuple[int, int, int], place: str
) -> list[float]:
    if len(cells) != len(head):
        raise input_error(f"has {len(cells)} values, the header {len(head)} columns", where=place)
    values = []
    for index in where:
        try:
            value = float(cells[index])
        except ValueError:
            raise input_error(
                f"'{cells[index]}' is not a number", where=place, key=head[index]
            ) from None
        if not np.isfinite(value):
            raise input_error(
                f"'{cells[index]}' is not a finite number", where=place, key=head[index]
            )
        values.append(value)
    return values
