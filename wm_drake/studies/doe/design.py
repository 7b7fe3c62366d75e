"""A design: its trials with names of factors; made by kind, written and read as CSV."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters.csv_files import read_csv
from wm_drake.studies.doe.coding import LEVELS, MODELS, Levels, columns, efficiency, level_matrix
from wm_drake.studies.doe.exchange import d_optimal_levels
from wm_drake.studies.doe.orthogonal import orthogonal_levels

DESIGNS = ("d-optimal", "orthogonal", "full")
"""Kinds of design that can be made; any other comes from a file."""

TRIAL = "trial"
"""Column of a CSV file that numbers the trials, from 1."""


@dataclass(frozen=True)
class Design:
    """Trials to run.

    Attributes:
        kind: One of `DESIGNS`, or where it was read from.
        factors: Names, one a column of `levels`.
        levels: A trial a row, each -1, 0 or 1.
        model: The model it is meant for, key of `MODELS`.
        seed: Of a seeded kind; None for others.
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

    def efficiency(self, model: str | None = None) -> float:
        """D-efficiency against the exact bound, for its own model or another. [%]"""
        return efficiency(self.levels, model or self.model)

    def frame(self) -> pd.DataFrame:
        """As a table: trial, then a column per factor."""
        table = pd.DataFrame(self.levels, columns=list(self.factors))
        table.insert(0, TRIAL, np.arange(1, self.trials + 1))
        return table


def make_design(
    kind: str,
    factors: tuple[str, ...],
    *,
    trials: int | None = None,
    model: str = "main+2fi",
    seed: int = 0,
) -> Design:
    """A design of a kind.

    Args:
        kind: One of `DESIGNS`.
        factors: Names.
        trials: As many trials; by default 1000 (d-optimal), 729 (orthogonal), all (full).
        model: What is to be estimated, key of `MODELS`.
        seed: Of a D-optimal design.

    Raises:
        InputError: unknown kind or model, or a number of trials that it cannot have.
    """
    if kind not in DESIGNS:
        raise input_error(f"no design '{kind}'{nearest_names(kind, DESIGNS)}", key="design")
    if model not in MODELS:
        raise input_error(f"no model '{model}'{nearest_names(model, MODELS)}", key="model")
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
    wanted = min(1000, everything) if trials is None else trials
    least = columns(count, model)
    if wanted < least:
        message = f"{wanted} trials cannot determine the {least} coefficients of {model} with {count} factors"
        raise input_error(f"{message}; allowed are {least} to {everything}", key="trials")
    if wanted > everything:
        message = f"{count} factors have {everything} different trials, and a repeated run would tell nothing new"
        raise input_error(f"{message}; allowed are {least} to {everything}", key="trials")
    _check_size(wanted)
    if wanted == everything:
        return Design(kind, factors, level_matrix(count), model, seed)
    return Design(kind, factors, d_optimal_levels(count, wanted, model, seed), model, seed)


LARGEST_DESIGN = 3**11
"""Trials of a design at most: some hours of runs."""


def _check_size(trials: int) -> None:
    if trials > LARGEST_DESIGN:
        raise input_error(
            f"{trials} trials are too many; allowed are {LARGEST_DESIGN}", key="trials"
        )


def write_design(design: Design, path: Path) -> None:
    """Writes a design as CSV: trial, then a column of levels per factor."""
    design.frame().to_csv(path, index=False)


def read_design(path: Path, factors: tuple[str, ...], model: str = "main+2fi") -> Design:
    """Reads a design of the user's own: CSV with a column per factor in any order, each value -1, 0 or 1; `trial` may be there.

    Raises:
        InputError: other columns, other levels, a repeated trial, or too few trials to determine the model.
    """
    named = list(_header(path))
    wanted = [name for name in named if name != TRIAL]
    if sorted(wanted) != sorted(factors):
        raise input_error(
            f"needs the columns {','.join(factors)} (and may have {TRIAL}), has {','.join(named)}",
            where=str(path),
        )
    table = read_csv(path, named)[list(factors)]
    numbers = table.apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    bad = np.argwhere(~np.isin(numbers, LEVELS))
    if len(bad):
        row, column = bad[0]
        value = table.iloc[row, column]
        raise input_error(
            f"row {row + 1}: '{value}' is no level; allowed are -1, 0 and 1",
            where=str(path),
            key=factors[column],
        )
    levels = numbers.astype(np.int8)
    _, first, counts = np.unique(levels, axis=0, return_index=True, return_counts=True)
    if len(first) < len(levels):
        row = int(first[np.argmax(counts)]) + 1
        raise input_error(
            f"row {row} is there more than once; a repeated run would tell nothing new",
            where=str(path),
        )
    design = Design(path.name, factors, levels, model)
    if design.efficiency() == 0.0:
        need = columns(len(factors), model)
        message = (
            f"these {design.trials} trials do not determine the {need} coefficients of {model}"
        )
        raise input_error(f"{message}; add others, or take the model main", where=str(path))
    return design


def _header(path: Path) -> pd.Index:
    try:
        return pd.read_csv(path, comment="#", skipinitialspace=True, nrows=0).columns
    except (OSError, ValueError) as error:
        raise input_error(
            f"cannot be read as CSV ({' '.join(str(error).split())})", where=str(path)
        ) from None
