"""Designs of experiments: make one of a kind, or read it from a CSV file."""

import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wm_drake.errors import (
    InputNotice,
    Problem,
    check_known,
    input_error,
    problems_at,
    shortened,
)
from wm_drake.parameters.recorded.signal import split_title
from wm_drake.parameters.recorded.text import TextRow, check_width, table_rows
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import plain_number
from wm_drake.studies.doe.coding import LEVELS, MODELS, Levels, columns, efficiency, level_matrix
from wm_drake.studies.doe.exchange import d_optimal_levels
from wm_drake.studies.doe.orthogonal import orthogonal_levels
from wm_drake.studies.doe.polynomial import largest_polynomial

DESIGNS = ("d-optimal", "orthogonal", "full")
"""Kinds of designs that can be made; other designs are read from a file."""

TRIAL = "trial"
"""Name of the CSV column with the numbers of the trials, which start at 1."""


@dataclass(frozen=True)
class Design:
    """A design of experiments: the trials to run.

    Attributes:
        kind: One of `DESIGNS`, or the name of the file it was read from.
        factors: Names of the factors, one for each column of `levels`.
        levels: One row per trial; each value is -1, 0 or 1.
        model: Model that the design is made for, key of `MODELS`.
        seed: Seed of a random design; None for others.
    """

    kind: str
    factors: tuple[str, ...]
    levels: Levels
    model: str
    seed: int | None = None

    @property
    def trials(self) -> int:
        """Number of trials."""
        return len(self.levels)

    @property
    def combinations(self) -> int:
        """Number of all level combinations."""
        return len(LEVELS) ** len(self.factors)

    @property
    def is_complete(self) -> bool:
        """Whether it has all level combinations, so that nothing is left to predict."""
        return self.trials == self.combinations

    @property
    def coefficients(self) -> int:
        """Number of coefficients of the model."""
        return columns(len(self.factors), self.model)

    @property
    def residual_df(self) -> int:
        """Number of trials beyond the coefficients of the model."""
        return self.trials - self.coefficients

    def efficiency(self, model: str | None = None) -> float:
        """Return the D-efficiency for a model; for the design's own model if None. [%]"""
        return efficiency(self.levels, model or self.model)


def make_design(
    kind: str,
    factors: tuple[str, ...],
    *,
    trials: int | None = None,
    model: str = "main+2fi",
    seed: int = 0,
) -> Design:
    """Make a design of a kind.

    Args:
        kind: One of `DESIGNS`.
        trials: Number of trials; the default is 1000 (d-optimal), 729 (orthogonal) or all (full).
        model: Model to estimate, key of `MODELS`.
        seed: Seed of a D-optimal design.

    Example:
        >>> import wm_drake as wm
        >>> design = wm.make_design("d-optimal", ("a", "b", "c"), trials=12, model="main")
        >>> design.levels.shape, design.coefficients, design.efficiency() > 90.0
        ((12, 3), 7, True)
    """
    check_known(kind, DESIGNS, f"no design '{kind}'", key="design")
    check_known(model, MODELS, f"no model '{model}'", key="model")
    count, everything = len(factors), 3 ** len(factors)
    if kind == "full" and trials not in (None, everything):
        raise input_error(
            f"the full factorial of {count} factors has {everything} trials, not {trials}",
            key="trials",
        )
    if kind == "full":
        _check_size(everything)
        return Design(kind, factors, level_matrix(count), model)
    if kind == "orthogonal":
        return Design(
            kind, factors, orthogonal_levels(count, 729 if trials is None else trials), model
        )
    if trials is None:
        trials = min(1000, everything)
    least = columns(count, model)
    if trials < least:
        raise input_error(
            f"{trials} trials cannot determine the {least} coefficients of {model} with {count} "
            f"factors; allowed are {least} to {everything}",
            key="trials",
        )
    if trials > everything:
        raise input_error(
            f"{count} factors have only {everything} different trials, and a repeated run has the "
            f"same result; allowed are {least} to {everything}",
            key="trials",
        )
    _check_size(trials)
    if trials == everything:
        return Design(kind, factors, level_matrix(count), model, seed)
    return Design(kind, factors, d_optimal_levels(count, trials, model, seed), model, seed)


LARGEST_DESIGN = 3**11
"""Largest number of trials of a design; running them takes some hours."""


def _check_size(trials: int) -> None:
    if trials > LARGEST_DESIGN:
        raise input_error(
            f"{trials} trials are too many; allowed are up to {LARGEST_DESIGN}", key="trials"
        )


OF_PROGRAMS = {
    *(TRIAL, "run", "order", "std", "stdorder", "runorder", "pttype", "centerpt", "block"),
    *("blocks", "pattern", "type"),
}
"""Columns that programs for designs add, in small letters and without signs; they are ignored."""

_EMPTY = ("", ".", "*")
"""Cells without a value, as of a response that is not measured yet, in Excel, JMP and Minitab."""

_DECIMAL_COMMA = re.compile(r"^([+-]?\d+),(?=\d+(?:\D|$))")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(?!\d)")

WORDS = {
    **dict.fromkeys(("low", "-"), -1.0),
    **dict.fromkeys(("mid", "middle", "centre", "center", "medium"), 0.0),
    **dict.fromkeys(("high", "+"), 1.0),
}
"""Levels in words."""


def read_design(path: Path, factors: tuple[str, ...], model: str = "main+2fi") -> Design:
    """Read a design with the levels -1, 0 and 1, or low, mid and high, as `read_levels` does.

    Args:
        model: Model to estimate, key of `MODELS`.

    Raises:
        InputError: the file has other columns or other levels, or the trials do not determine the
            model.
    """
    return design_of(path.name, factors, read_levels(path, factors), model)


def has_three_levels(levels: FloatArray) -> bool:
    """Return whether all levels are -1, 0 or 1."""
    return bool(np.isin(levels, LEVELS).all())


def design_of(kind: str, factors: tuple[str, ...], levels: FloatArray, model: str) -> Design:
    """Return a design with levels -1, 0 and 1 of a file.

    Raises:
        InputError: the trials do not determine the model.
    """
    whole: Levels = np.array(levels, dtype=np.int8).reshape(levels.shape[0], levels.shape[1])
    design = Design(kind, factors, whole, model)
    if design.efficiency() == 0.0:
        needed = columns(len(factors), model)
        is_enough = model != "main" and efficiency(design.levels, "main") > 0.0
        smaller = "main" if is_enough else largest_polynomial(factors, levels)
        hint = "add other trials" + (f", or use --model {smaller}" if smaller else "")
        raise input_error(
            f"these {design.trials} trials do not determine the {needed} coefficients of {model}; "
            f"{hint}",
            where=kind,
        )
    return design


LARGEST_LEVEL = 4.0
"""Largest level without a unit: the star points of a rotatable central composite design of eight
factors. A larger number is a value whose unit is missing."""


def read_levels(
    path: Path,
    factors: tuple[str, ...],
    level_of: Callable[[str, str], float] | None = None,
) -> FloatArray:
    """Read the levels of a table as spreadsheets and programs for designs write it.

    The file has one column per factor, in any order, with levels: numbers, or low, mid and high; or
    with values: with a unit in each cell, or in the head, such as `K_Lx [N/mm]`. Columns of
    `OF_PROGRAMS`, those that are empty or without a name, and those with the name of a factor and
    more beside its own column, such as `C_L_Ns_per_mm`, are ignored. A trial that is repeated runs
    once.

    Args:
        level_of: Function of a factor and a value as text that returns its level; without it only
            the levels -1, 0 and 1 are allowed.

    Returns:
        (trials, factors)

    Raises:
        InputError: the file has other columns, or a cell is neither a level nor a value.
    """
    head, *rows = table_rows(path) or [TextRow(1, [])]
    rows = _with_plain_numbers(rows)
    places = _factor_columns(path, head.cells, rows, factors)
    for row in rows:
        check_width(path, row, head.cells)
    levels = np.zeros((len(rows), len(factors)))
    for number, row in enumerate(rows):
        for column, (place, unit) in enumerate(places):
            cell = row.cells[place] if place < len(row.cells) else ""
            where = f"{path}:{row.line}"
            levels[number, column] = _level_or_value(cell, unit, where, factors[column], level_of)
    for (place, unit), factor, used in zip(places, factors, levels.T, strict=True):
        is_coded = not unit and np.isfinite([_level(row.cells[place]) for row in rows]).all()
        if is_coded and len(rows) and used.min() >= 0.0 and not has_three_levels(used):
            raise input_error(
                f"has numbers from {used.min():g} to {used.max():g}, none below 0; levels are "
                "from -1 to 1, and values need a unit, in the cell or in the head",
                where=str(path),
                key=factor,
            )
    return _without_repeats(path, levels)


def _with_plain_numbers(rows: Sequence[TextRow]) -> list[TextRow]:
    """Return rows with plain minus signs, and points for commas that cannot separate thousands."""
    signs = str.maketrans(dict.fromkeys("\N{MINUS SIGN}\N{EN DASH}", "-"))
    plain = [[cell.translate(signs) for cell in row.cells] for row in rows]
    cells = [cell for row in plain for cell in row if _DECIMAL_COMMA.match(cell)]
    if not all(map(_THOUSANDS.match, cells)):
        plain = [[_DECIMAL_COMMA.sub(r"\1.", cell) for cell in row] for row in plain]
    return [replace(row, cells=cells) for row, cells in zip(rows, plain, strict=True)]


def _level_or_value(
    cell: str, unit: str, where: str, factor: str, level_of: Callable[[str, str], float] | None
) -> float:
    """Return the level of a cell, which has a level, or a value with a unit here or in its head."""
    level = _level(cell)
    if not unit and (level in LEVELS or (level_of and abs(level) <= LARGEST_LEVEL)):
        return level
    if level_of is not None and re.match(r"[+-]?\.?\d", cell) and (unit or np.isnan(level)):
        with problems_at(where, factor):
            return level_of(factor, f"{cell} {unit}".strip())
    allowed = "-1, 0 and 1, or low, mid and high"
    if level_of:
        allowed = (
            f"low, mid, high, numbers up to {LARGEST_LEVEL:g}, and values with a unit, in the cell "
            f"or the head, such as '{factor} [%]'"
        )
    message = f"'{shortened(cell, 40)}' is not a level; allowed are {allowed}"
    raise input_error(message, where=where, key=factor)


def _level(cell: str) -> float:
    """Return the level of a cell, with a comma or a point; NaN if it is none."""
    text = cell.lower().replace(",", ".")
    try:
        return WORDS[text] if text in WORDS else plain_number(text)
    except ValueError:
        return np.nan


def _factor_columns(
    path: Path, head: Sequence[str], rows: Sequence[TextRow], factors: Sequence[str]
) -> list[tuple[int, str]]:
    """Return the column of each factor, and the unit in its head.

    Raises:
        InputError: a factor has none or several, or a column is neither of a factor nor known.
    """
    by_name, others = dict[str, list[tuple[int, str]]](), list[str]()
    of_unit = dict[str, list[tuple[int, str]]]()
    plain = {factor.casefold(): factor for factor in factors}
    more = tuple(f"{factor}{end}" for factor in factors for end in ("_", " "))
    for place, title in enumerate(head):
        name, short = title.strip(), re.sub(r"[\W_]", "", title).lower()
        factor = name if name in factors else plain.get(name.casefold(), "")
        before, unit = split_title(name)
        if factor:
            by_name.setdefault(factor, []).append((place, ""))
        elif unit and plain.get(before.casefold()):
            of_unit.setdefault(plain[before.casefold()], []).append((place, unit))
        elif not name or short in OF_PROGRAMS or name.startswith(more):
            continue
        elif any(cell not in _EMPTY for row in rows for cell in row.cells[place : place + 1]):
            others.append(name)
    by_name = {**of_unit, **by_name}
    lacking = [factor for factor in factors if factor not in by_name]
    if others or lacking or any(len(places) > 1 for places in by_name.values()):
        message = f"needs the columns {','.join(factors)} (and may have {TRIAL})"
        message += f", has {','.join(map(str.strip, head))}"
        unread = [title for title in head for name in lacking if title.startswith(f"{name} ")]
        if unread:
            message += f"; '{unread[0]}' has no known unit: write one such as N*s/mm, or none"
        elif not by_name:
            message += "; the first line must have the names: begin remarks above it with #"
        elif others:
            what = "rename or remove" if lacking else "remove"
            message += f"; {what} {', '.join(others)}: no factor, and no column of a known program"
        raise input_error(message, where=str(path))
    return [by_name[factor][0] for factor in factors]


def _without_repeats(path: Path, levels: FloatArray) -> FloatArray:
    """Return trials without those that are repeated, such as centre points, with a notice."""
    _, first = np.unique(levels, axis=0, return_index=True)
    left_out = len(levels) - len(first)
    if left_out:
        message = f"{left_out} repeated trials run once: a repeated run has the same result"
        warnings.warn(str(Problem(str(path), "", message)), InputNotice, stacklevel=3)
    return levels[np.sort(first)]
