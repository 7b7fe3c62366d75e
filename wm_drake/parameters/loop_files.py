"""Measured loops: CSV files of time, displacement (or angle) and force (or moment)."""

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wm_drake.errors import InputError, Problem, input_error, shortened
from wm_drake.parameters.csv_files import with_distinct_times
from wm_drake.parameters.lab_files import Channel, chosen, is_lab_file, read_channels
from wm_drake.parameters.text_files import read_text
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import LARGEST_NUMBER, Unit, comma_hint, factor_of, plain_number

FEWEST = 20
"""Smallest number of samples of a loop."""

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


SMALLEST_RANGE = 1e-12
"""Smallest range of a displacement and of a force: below it, a signal is constant. [m; rad; N]"""


@dataclass(frozen=True, eq=False)
class MeasuredLoop:
    """A force-displacement loop that was recorded on a bench, in SI units.

    Attributes:
        name: Name of the file, without the suffix.
        path: Path of the file, for messages.
        time: (n,) strictly increasing. [s]
        displacement: (n,) displacement or angle of the driven end. [m; rad]
        force: (n,) force or moment on the component at the driven end. [N; N m]
        rotates: Whether displacement and force are an angle and a moment.
    """

    name: str
    path: str
    time: FloatArray
    displacement: FloatArray
    force: FloatArray
    rotates: bool


def read_loop(
    path: Path, units: tuple[str, str, str] | None = None, channels: Mapping[str, str] | None = None
) -> MeasuredLoop:
    """Read a measured loop.

    The first line that is not a comment (#) names the columns, in any order: ``time [s],
    displacement [mm], force [N]`` or ``time_s,displacement_mm,force_N``; for rotations ``angle``
    and ``moment``. Other columns are ignored. In MDF4, TDMS, UFF 58 and MAT files the channels have
    such names, or `channels` names them; units are those of the file. Samples with equal time
    stamps are averaged.

    Args:
        path: CSV file with commas, semicolons or tabs, or file of `wm_drake.parameters.lab_files`.
        units: Units of time, displacement and force if the header has none.
        channels: Name in the file of ``time``, ``displacement`` or ``angle``, ``force`` or
            ``moment``.

    Raises:
        InputError: columns or units are wrong, a value is not a finite number, the time
            falls, a signal is constant, or there are too few samples. The message names file and
            line.
    """
    if is_lab_file(path):
        return _lab_loop(path, units, channels or {})
    rows = list(_rows(path))
    if not rows:
        raise input_error("is empty; needs the columns time, displacement, force", where=str(path))
    line, head = rows[0]
    head = _renamed(head, channels or {}, f"{path}:{line}")
    columns = _columns(head, units, f"{path}:{line}")
    table: FloatArray = np.array(
        [_numbers(cells, len(head), columns, f"{path}:{at}") for at, cells in rows[1:]]
    ).reshape(-1, 3)
    return _checked_loop(path, table, [at for at, _ in rows[1:]], columns)


class _Column(NamedTuple):
    """Column of time, displacement or force.

    Attributes:
        place: Its place in the file.
        head: Its cell of the header.
        unit: SI unit and display unit; those of an angle or a moment in a rotation.
        factor: Factor that converts it to SI units.
    """

    place: int
    head: str
    unit: Unit
    factor: float


def _checked_loop(
    path: Path, table: FloatArray, lines: Sequence[int], columns: Sequence[_Column]
) -> MeasuredLoop:
    """Return a loop from a table of time, displacement and force; check time and signals.

    Args:
        table: In the units of the file (n, 3).
        lines: Line, or number of the sample, of each row.
        columns: From `_columns`.
    """
    factors = [column.factor for column in columns]
    not_rising = np.flatnonzero(np.diff(table[:, 0]) < 0.0)
    if len(not_rising):
        at = int(not_rising[0]) + 1
        raise input_error(
            f"time falls: {table[at, 0]:g} after {table[at - 1, 0]:g}",
            where=f"{path}:{lines[at]}",
            key=columns[0].head,
        )
    table = with_distinct_times(table, str(path))
    if len(table) < FEWEST:
        raise input_error(
            f"has {len(table)} samples; a loop needs at least {FEWEST}", where=str(path)
        )
    size = float(np.max(np.abs(table * factors)))
    if size > LARGEST_NUMBER:
        message = f"has a number of size {size:g}; allowed are sizes up to {LARGEST_NUMBER:g} in SI"
        raise input_error(message, where=str(path))
    for column in (1, 2):
        if np.ptp(table[:, column]) * factors[column] < SMALLEST_RANGE:
            message = f"is constant ({table[0, column]:g} on lines {lines[0]} to {lines[-1]})"
            raise input_error(message, where=f"{path}:{lines[0]}", key=columns[column].head)
    time, displacement, force = (table * factors).T
    rotates = columns[1].unit == _ANGLE
    return MeasuredLoop(path.stem, str(path), time, displacement, force, rotates)


def _renamed(head: list[str], channels: Mapping[str, str], place: str) -> list[str]:
    """Return a header in which the columns that the user names have the words of this module."""
    columns = list(head)
    plain = [re.split(r"\s*[\[(]", cell)[0].strip() for cell in head]
    for word, name in channels.items():
        if name not in plain:
            raise input_error(f"no column '{name}' among '{', '.join(head)}'", where=place)
        index = plain.index(name)
        columns[index] = word + head[index].strip()[len(name) :]
    return columns


def _lab_loop(
    path: Path, units: tuple[str, str, str] | None, channels: Mapping[str, str]
) -> MeasuredLoop:
    """Return the loop of a file with named channels; a force sampled otherwise is interpolated."""
    signals = _picked(path, channels)
    moved = next((c.time for c in signals.values() if c.time is not None), None)
    if moved is not None and not any(_is_time(word) for word in signals):
        signals = {"time": Channel("time", "s", moved, None), **signals}
    head = [f"{word} [{c.unit}]" if c.unit else word for word, c in signals.items()]
    clock = next((c.values for word, c in signals.items() if _is_time(word)), None)
    table = [
        c.values if clock is None or c.time is None else np.interp(clock, c.time, c.values)
        for c in signals.values()
    ]
    columns = _columns(head, units, str(path))
    if len({len(values) for values in table}) > 1:
        raise input_error("its channels have different numbers of samples", where=str(path))
    samples = np.stack([table[column.place] for column in columns], axis=1)
    if len(samples) < FEWEST:
        message = f"has {len(samples)} samples; a loop needs at least {FEWEST}"
        raise input_error(message, where=str(path))
    if not np.isfinite(samples).all():
        raise input_error("has a sample that is not a finite number", where=str(path))
    return _checked_loop(path, samples, range(1, len(samples) + 1), columns)


def _picked(path: Path, channels: Mapping[str, str]) -> dict[str, Channel]:
    """Return the channels of time, displacement and force by the words of a header."""
    available = read_channels(path)
    signals: dict[str, Channel] = {}
    for column, words in _COLUMNS.items():
        named = {word: name for word, name in channels.items() if word in words}
        if named:
            signals |= {word: chosen(available, name, path) for word, name in named.items()}
            continue
        fitting = [c for c in available if (m := _HEAD.match(c.name)) and m[1].lower() in words]
        if len(fitting) > 1:
            names = ", ".join(f"'{c.name}'" for c in fitting)
            raise input_error(
                f"has several channels of {column}: {names}; choose one by --channels",
                where=str(path),
            )
        if not fitting and column != "time":
            names = shortened(", ".join(c.name for c in available), 120)
            raise input_error(
                f"has no channel of {column}; its channels are {names}; choose one by --channels",
                where=str(path),
            )
        signals |= {c.name: c for c in fitting}
    return signals


def _is_time(word: str) -> bool:
    match = _HEAD.match(word)
    return bool(match and match[1].lower() in _COLUMNS["time"])


def read_loops(
    paths: list[Path],
    units: tuple[str, str, str] | None = None,
    channels: Mapping[str, str] | None = None,
) -> list[MeasuredLoop]:
    """Read several loops, either all of displacement and force or all of angle and moment.

    Args:
        units: Units of time, displacement and force if a header has none.
        channels: As for `read_loop`.

    Raises:
        InputError: a file is wrong (the error has all problems of all files), or some files contain
            angles and others displacements.
    """
    loops: list[MeasuredLoop] = []
    problems: list[Problem] = []
    for path in paths:
        try:
            loops.append(read_loop(path, units, channels))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    for loop in loops:
        if loop.rotates != loops[0].rotates:
            kinds = ("angles and moments", "displacements and forces")
            first, other = kinds if loops[0].rotates else kinds[::-1]
            raise input_error(
                f"holds {other}, {loops[0].path} {first}; all files of a fit must be of one kind",
                where=loop.path,
            )
    return loops


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield number and cells of each line that is neither empty nor a comment."""
    text = read_text(path)
    kept = [
        (at, line)
        for at, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if kept:
        delimiter = max(",;\t", key=kept[0][1].count)
        reader = csv.reader((line for _, line in kept), delimiter=delimiter)
        try:
            for (at, _), cells in zip(kept, reader, strict=False):
                yield at, [cell.strip() for cell in cells]
        except csv.Error as error:  # such as a field of more than 128 kB
            where = f"{path}:{kept[min(reader.line_num, len(kept)) - 1][0]}"
            raise input_error(f"cannot be read as CSV ({error})", where=where) from None


def _columns(head: list[str], units: tuple[str, str, str] | None, place: str) -> list[_Column]:
    """Return the columns time, displacement and force.

    Args:
        head: Cells of the header.
        units: Units of the three columns if the header has none.
        place: File and line, for messages.
    """
    columns: dict[str, tuple[int, Unit, str | None]] = {}
    for index, cell in enumerate(head):
        match = _HEAD.match(cell)
        word = match[1].lower() if match else ""
        for column, names in _COLUMNS.items():
            if word in names:
                if column in columns:
                    raise input_error(f"'{cell}' is a second column of {column}", where=place)
                assert match is not None
                columns[column] = (index, names[word], (match[2] or match[3] or "").strip() or None)
    missing = [column for column in _COLUMNS if column not in columns]
    if missing:
        among = shortened(", ".join(head), 150)
        raise input_error(
            f"no column {', '.join(missing)} among '{among}'; needs time, displacement (or angle), "
            "force (or moment)",
            where=place,
        )
    if (columns["displacement"][1] == _ANGLE) != (columns["force"][1] == _TORQUE):
        raise input_error(
            "mixes a rotation with a translation: angle goes with moment, displacement with force",
            where=place,
        )
    return [
        _Column(i, head[i], unit, _factor(head[i], column, unit, (in_header, given), place))
        for given, column in zip(units or (None,) * 3, _COLUMNS, strict=True)
        for i, unit, in_header in [columns[column]]
    ]


def _factor(
    head: str, column: str, unit: Unit, given: tuple[str | None, str | None], place: str
) -> float:
    """Return the factor that converts a column to SI units.

    Args:
        head: The column's cell of the header.
        column: Which column it is: time, displacement or force.
        unit: SI unit and display unit of the column.
        given: Unit in the header and unit on the command line; None for none.
        place: File and line, for messages.
    """
    in_header, in_option = given
    if in_header and in_option and in_header != in_option:
        raise input_error(
            f"is in {in_header} by the header, in {in_option} by --units; both must be the same",
            where=place,
            key=head,
        )
    text = in_header or in_option
    if not text:
        message = f"has no unit; write '{column} [{unit.shown}]' in the header or use --units"
        raise input_error(message, where=place, key=head)
    try:
        return factor_of(text, unit)
    except ValueError as error:
        raise input_error(str(error), where=place, key=head) from None


def _numbers(cells: list[str], width: int, columns: Sequence[_Column], place: str) -> list[float]:
    """Return the numbers of the columns in a row, which must have as many cells as the header."""
    if len(cells) != width:
        raise input_error(
            f"has {len(cells)} values but the header has {width} columns"
            f"{'; the decimal sign is a point' if len(cells) > width else ''}",
            where=place,
        )
    values = []
    for column in columns:
        cell = cells[column.place]
        try:
            value = plain_number(cell)
        except ValueError:
            raise input_error(
                f"'{cell}' is not a number{comma_hint(cell)}", where=place, key=column.head
            ) from None
        if not np.isfinite(value):
            raise input_error(f"'{cell}' is not a finite number", where=place, key=column.head)
        values.append(value)
    return values
