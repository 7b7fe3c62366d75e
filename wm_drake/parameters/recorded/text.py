"""Channels in tables of text: CSV with commas, semicolons, tabs or blanks."""

import csv
import re
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from wm_drake.errors import InputNotice, Problem, input_error, shortened
from wm_drake.parameters.recorded.signal import Signal, split_title
from wm_drake.parameters.text_files import check_regular, read_any_text
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import comma_hint, is_unit, plain_number, plain_unit

MOST_COLUMNS = 1000
"""Largest number of columns of a table."""

MISSING = ("", "nan", "na", "n/a", "#n/a", "null")
"""Cells without a sample, in small letters."""

_CLOCK = re.compile(
    r"(?:(?P<date>\d{4}[-/]\d\d?[-/]\d\d?|\d\d?\.\d\d?\.\d{4}|\d\d?/\d\d?/\d{4})[T ]\s*)?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d\d)(?::(?P<second>\d\d(?:[.,]\d+)?))?"
    r"\s*(?P<half>[AaPp][Mm])?\s*(?P<zone>Z|[+-]\d\d:?\d\d)?"
)
_MINUTES = re.compile(r"(\d{1,3}):(\d\d[.,]\d+)")
DAY = 86400.0
"""[s]"""


@dataclass(frozen=True)
class TextRow:
    """Cells of a row of a table, and the line of the file in which it ends."""

    line: int
    cells: list[str]


def text_signals(path: Path) -> Iterator[Signal]:
    """Yield the columns of a table as signals.

    The first line that is not empty and begins with no # has the names. A row of units may follow.
    Columns without a number are left out; one with numbers and other words has a fault.

    Raises:
        InputError: it is no table, or a row has other columns than the header.
    """
    rows = table_rows(path)
    if not rows:
        raise input_error(
            "is empty; a recording has a line of names, such as time [s], displacement [mm], "
            "force [N], and rows of numbers",
            where=str(path),
        )
    head, body = rows[0], rows[1:]
    if len(head.cells) > MOST_COLUMNS:
        raise input_error(
            f"has {len(head.cells)} columns; allowed are up to {MOST_COLUMNS}",
            where=f"{path}:{head.line}",
        )
    if sum(_is_number(cell) for cell in head.cells) * 2 > len(head.cells):
        raise input_error(
            "has numbers where the names of the columns belong; write a line such as "
            "'time [s],displacement [mm],force [N]' above them",
            where=f"{path}:{head.line}",
        )
    units = [""] * len(head.cells)
    if body and _are_units(body[0].cells):
        units, body = body[0].cells, body[1:]
    width = len(head.cells)
    for row in body:
        check_width(path, row, head.cells)
    lines = np.array([row.line for row in body], dtype=int)
    for place, title in enumerate(head.cells):
        column = [row.cells[place] if place < len(row.cells) else "" for row in body]
        unit = units[place] if place < min(len(units), width) else ""
        signal = _column(title, column, lines)
        if signal is not None:
            yield _with_unit(signal, unit.strip("[]() "))


def _with_unit(signal: Signal, below: str) -> Signal:
    """Return a column with the unit of the row below its header, which must not contradict it."""
    if plain_unit(signal.unit) and plain_unit(below) not in ("", plain_unit(signal.unit)):
        fault = f"is in {signal.unit} by its header, in {below} by the row of units below"
        return replace(signal, fault=fault)
    return replace(signal, unit=signal.unit or below)


def table_rows(path: Path) -> list[TextRow]:
    """Return the rows of a table but lines without content and those that begin with #.

    Raises:
        InputError: it is no table, or a workbook that cannot be read.
    """
    if path.suffix.lower() in (".xlsx", ".xlsm"):
        return _sheet_rows(path)
    kept = [
        (at, line)
        for at, line in enumerate(read_any_text(path).splitlines(), 1)
        if line.strip(' \t,;"') and not line.lstrip(' \t"').startswith("#")
    ]
    if not kept:
        return []
    delimiter = ""
    if re.fullmatch(r'"?sep=(.)"?\s*', kept[0][1], re.IGNORECASE):  # first line of spreadsheets
        delimiter = kept.pop(0)[1].strip().strip('"')[4]
    texts = [line for _, line in kept]
    if not delimiter:
        delimiter = max(",;\t", key=texts[0].count) if kept else ","
        if not any(sign in texts[0] for sign in ",;\t") and _has_blanks(texts):
            return [TextRow(at, line.split()) for at, line in kept]
    reader = csv.reader(texts, delimiter=delimiter)
    try:
        return [
            TextRow(kept[reader.line_num - 1][0], [cell.strip() for cell in cells])
            for cells in reader
        ]
    except csv.Error as error:  # such as a field of more than 128 kB
        where = f"{path}:{kept[min(reader.line_num, len(kept)) - 1][0]}"
        raise input_error(f"cannot be read as CSV ({error})", where=where) from None


def _sheet_rows(path: Path) -> list[TextRow]:
    """Return the rows with cells of the first sheet of a workbook that has any."""
    check_regular(path)
    where, way_out = str(path), "save the sheet as CSV (UTF-8)"
    try:
        from openpyxl import load_workbook
    except ImportError:
        message = f"is a workbook: pip install 'wm-drake[excel]', or {way_out}"
        raise input_error(message, where=where) from None
    try:
        book = load_workbook(path, read_only=True, data_only=True)
        tables = [(sheet.title, _filled_rows(sheet)) for sheet in book.worksheets]
        begun = [(title, row, rows) for title, rows in tables if (row := next(rows, None))]
        filled = [row for _, first, rows in begun[:1] for row in (first, *rows)]
    except Exception as error:  # whatever its XML contains
        reason = shortened(str(error), 100) or type(error).__name__
        raise input_error(
            f"is no workbook that can be read ({reason}); {way_out}", where=where
        ) from None
    if len(begun) > 1:
        first, *others = (f"'{title}'" for title, *_ in begun)
        message = f"sheet {first} is read, not {', '.join(others)}; move another one to the front"
        warnings.warn(str(Problem(where, "", message)), InputNotice, stacklevel=2)
    return filled


def _filled_rows(sheet: Any) -> Iterator[TextRow]:
    """Yield the rows of a sheet that have cells and do not begin with #."""
    for number, values in enumerate(sheet.iter_rows(values_only=True), 1):
        cells = ["" if value is None else str(value).strip() for value in values]
        if any(cells) and not next(filter(None, cells)).startswith("#"):
            yield TextRow(number, cells)


def _has_blanks(lines: Sequence[str]) -> bool:
    """Return whether blanks separate as many names as numbers."""
    return len(lines) > 1 and 1 < len(lines[0].split()) == len(lines[1].split())


def check_width(path: Path, row: TextRow, head: Sequence[str]) -> None:
    """Check that a row has the columns of the header; empty ones at an end may lack."""
    named = len(head) if head[-1] else len(head) - 1
    filled = row.cells if len(row.cells) <= len(head) else row.cells[: len(head)]
    surplus = any(row.cells[len(filled) :])
    if len(row.cells) < named or surplus:
        hint = "; the decimal sign is a point" if surplus else ""
        if not any(_is_number(cell) for cell in row.cells):
            hint = "; the first line must have the names: begin remarks above it with #"
        raise input_error(
            f"has {len(row.cells)} values but the header has {len(head)} columns{hint}",
            where=f"{path}:{row.line}",
        )


def _are_units(cells: Sequence[str]) -> bool:
    """Return whether a row under the header has units: no numbers, and mostly known ones."""
    texts = [cell.strip("[]() ") for cell in cells if cell.strip()]
    if not texts or any(_is_number(cell) or _stamp(cell) is not None for cell in cells):
        return False
    return 2 * sum(is_unit(text) or not plain_unit(text) for text in texts) > len(texts)


def _is_number(cell: str) -> bool:
    """Return whether a cell is a finite or infinite number."""
    if cell.lower() in MISSING:
        return False
    try:
        plain_number(cell)
    except ValueError:
        return False
    return True


def _column(title: str, cells: list[str], lines: np.ndarray) -> Signal | None:
    """Return a column as a signal; None if it is empty, or has words.

    A column that says that each of its values is missing is a signal without any.
    """
    name, unit = split_title(title)
    signal = Signal(name, np.empty(0), unit, title=title, lines=lines)
    values = _numbers(cells)
    if values is not None:
        return replace(signal, values=values) if any(cells) else None
    first = next((cell for cell in cells if cell.lower() not in MISSING), "")
    if _stamp(first) is not None or _MINUTES.fullmatch(first):
        return _stamped(signal, cells)
    wrong = next(k for k, cell in enumerate(cells) if not _fits(cell))
    if not any(_is_number(cell) or comma_hint(cell) for cell in cells):
        return None
    fault = f"'{shortened(cells[wrong], 40)}' is not a number{comma_hint(cells[wrong])}"
    return replace(
        signal, values=np.full(len(cells), np.nan), fault=fault, fault_line=int(lines[wrong])
    )


def _fits(cell: str) -> bool:
    return cell.lower() in MISSING or _is_number(cell)


def _numbers(cells: list[str]) -> FloatArray | None:
    """Return cells as numbers, NaN where they are empty; None if a cell is no number."""
    joined = "".join(cells)
    filled = [cell or "nan" for cell in cells]
    if joined.isascii() and "_" not in joined:  # else Python would read 1_0 and digits of others
        try:
            return np.array(filled, dtype=str).astype(float)
        except ValueError:
            pass
    if not all(_fits(cell) for cell in cells):
        return None
    return np.array([np.nan if c.lower() in MISSING else plain_number(c) for c in cells])


def _stamped(signal: Signal, cells: list[str]) -> Signal:
    """Return a column of times of day, with or without dates, as seconds after the first one."""
    empty = replace(signal, values=np.full(len(cells), np.nan))
    times, dates = np.full(len(cells), np.nan), [""] * len(cells)
    assert signal.lines is not None
    for place, cell in enumerate(cells):
        if cell.lower() in MISSING:
            continue
        stamp = _stamp(cell)
        if stamp is None:
            fault = f"'{shortened(cell, 40)}' is not a time; write it as 2026-05-31 12:30:00.000"
            return replace(empty, fault=fault, fault_line=int(signal.lines[place]))
        times[place], dates[place] = stamp
    days = {text: _day(text) for text in dict.fromkeys(dates) if text}
    if len(days) > 1 and None in days.values():
        fault = f"dates such as '{next(iter(days))}' can be read in two ways; write 2026-05-31"
        return replace(empty, fault=fault)
    place = int(np.flatnonzero(np.isfinite(times))[0])
    first, start = times[place], None
    if days:
        numbers = np.array([days.get(text) or 0 for text in dates])
        times += DAY * (numbers - numbers[place])
        if None not in days.values():
            start = int(numbers[place] * DAY) * 10**9 + round(1e9 * first)
    else:  # midnight
        fallen = np.nan_to_num(np.diff(times, prepend=times[:1])) < -0.5 * DAY
        times += DAY * np.cumsum(fallen)
    return replace(signal, values=times - first, unit="s", start=start)


def _stamp(cell: str) -> tuple[float, str] | None:
    """Return the time of day [s] and the text of the date of a cell; None if it has none."""
    short = _MINUTES.fullmatch(cell)
    if short:
        return 60.0 * int(short[1]) + float(short[2].replace(",", ".")), ""
    match = _CLOCK.fullmatch(cell)
    if match is None or not (match["second"] or match["date"] or match["half"]):
        return None
    hour = int(match["hour"])
    if match["half"]:
        hour = hour % 12 + (12 if match["half"].lower() == "pm" else 0)
    seconds = float((match["second"] or "0").replace(",", "."))
    zone = match["zone"] or "Z"
    shift = 0.0
    if zone != "Z":
        digits = zone[1:].replace(":", "")
        shift = (1 if zone[0] == "+" else -1) * (3600.0 * int(digits[:2]) + 60.0 * int(digits[2:]))
    return 3600.0 * hour + 60.0 * int(match["minute"]) + seconds - shift, match["date"] or ""


def _day(text: str) -> int | None:
    """Return the number of a day since 1970; None without a date, or if it can be read twofold."""
    parts = [int(part) for part in re.split(r"[-/.]", text) if part]
    if len(parts) != 3:
        return None
    if "." in text:
        parts = parts[::-1]
    if parts[0] < 1000:  # 03/04/2026
        return None
    try:
        return date(*parts).toordinal() - date(1970, 1, 1).toordinal()
    except ValueError:
        return None
