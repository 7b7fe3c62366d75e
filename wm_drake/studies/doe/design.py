"""Designs of experiments: make one of a kind, or read it from a CSV file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from wm_drake.errors import check_known, input_error
from wm_drake.parameters.csv_files import read_csv, read_header
from wm_drake.studies.doe.coding import LEVELS, MODELS, Levels, columns, efficiency, level_matrix
from wm_drake.studies.doe.exchange import d_optimal_levels
from wm_drake.studies.doe.orthogonal import orthogonal_levels

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

    def frame(self) -> pd.DataFrame:
        """Return the design as a table: number of the trial, then one column per factor."""
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


def read_design(path: Path, factors: tuple[str, ...], model: str = "main+2fi") -> Design:
    """Read a design from a CSV file.

    The file has one column per factor, in any order, with the levels -1, 0 and 1. A column `trial`
    is optional. Columns with the name of a factor and more, such as `C_L_Ns_per_mm` for its values,
    are for the reader and are ignored.

    Args:
        model: Model to estimate, key of `MODELS`.

    Raises:
        InputError: the file has other columns, other levels or a repeated trial, or the trials do
            not determine the model.
    """
    named = list(read_header(path))
    more = tuple(f"{factor}{end}" for factor in factors for end in ("_", " "))
    read = {TRIAL, *(name for name in named if name.startswith(more))} - set(factors)
    factor_columns = [name for name in named if name not in read]
    if sorted(factor_columns) != sorted(factors):
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
            f"row {row + 1}: '{value}' is not a level; allowed are -1, 0 and 1",
            where=str(path),
            key=factors[column],
        )
    levels = numbers.astype(np.int8)
    _, first, counts = np.unique(levels, axis=0, return_index=True, return_counts=True)
    if len(first) < len(levels):
        row = int(first[np.argmax(counts)]) + 1
        raise input_error(
            f"row {row} occurs more than once; rows must differ, as a repeated run has the same "
            "result",
            where=str(path),
        )
    design = Design(path.name, factors, levels, model)
    if design.efficiency() == 0.0:
        needed = columns(len(factors), model)
        raise input_error(
            f"these {design.trials} trials do not determine the {needed} coefficients of {model}; "
            "add other trials, or use the model main",
            where=str(path),
        )
    return design
