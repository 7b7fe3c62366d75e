"""Screening: a design is run, and the variance of each response is divided among factors and their interactions.

Knows nothing of machines: `evaluate` gives the responses of trials.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import pandas as pd

from wm_drake.errors import input_error
from wm_drake.studies.doe import Design, efficiency
from wm_drake.studies.doe.anova import AnovaTable, Term, anova

LEADING_MAIN_PERCENT = 10.0
"""Main effects that contribute more are listed ([B] Table 5)."""

LEADING_INTERACTION_PERCENT = 5.0
"""Interactions that contribute more are listed ([B] Table 5)."""

Label: TypeAlias = tuple[str, str]
"""Load and response."""


@dataclass(frozen=True)
class Responses:
    """What trials gave.

    Attributes:
        values: By load: a trial a row, a response a column; NaN where a run gave none.
        units: Unit of each response, by its name.
        failed: By (trial from 0, load), why a run failed.
    """

    values: dict[str, pd.DataFrame]
    units: dict[str, str]
    failed: dict[tuple[int, str], str]


Evaluate: TypeAlias = Callable[[Design], Responses]


@dataclass(frozen=True)
class Screening:
    """A design that was run, and what came of it.

    Attributes:
        design: What was run.
        responses: What that gave.
        tables: Analysis of variance by label, over the trials whose runs of that load did not fail.
    """

    design: Design
    responses: Responses
    tables: dict[Label, AnovaTable]

    @property
    def loads(self) -> list[str]:
        """Loads, in the order they were run."""
        return list(self.responses.values)

    @property
    def names(self) -> list[str]:
        """Responses, in their order."""
        return list(self.responses.units)


def run_screening(design: Design, evaluate: Evaluate) -> Screening:
    """Runs a design and analyses its responses.

    Raises:
        InputError: so many runs failed that the rest does not determine the effects.
    """
    return analyse(design, evaluate(design))


def analyse(design: Design, responses: Responses) -> Screening:
    """Analyses responses of a design."""
    levels = pd.DataFrame(design.levels, columns=list(design.factors))
    tables: dict[Label, AnovaTable] = {}
    for load, values in responses.values.items():
        good = np.isfinite(values.to_numpy()).all(axis=1)
        if not good.all() and efficiency(design.levels[good], design.model) == 0.0:
            message = f"{np.sum(~good)} of {len(good)} runs failed; the others do not determine the effects of {design.model}"
            raise input_error(message, where=f"load {load}")
        found = anova(levels[good], values[good], interactions=design.model != "main")
        tables |= {(load, name): table for name, table in found.items()}
    return Screening(design, responses, tables)


def leading_terms(table: AnovaTable) -> list[Term]:
    """The terms above the thresholds of [B] Table 5, largest first."""
    least = {1: LEADING_MAIN_PERCENT, 2: LEADING_INTERACTION_PERCENT}
    found = [term for term in table.terms if term.percent > least[len(term.factors)]]
    return sorted(found, key=lambda term: -term.percent)


def main_effects(table: AnovaTable) -> list[Term]:
    """Main effects, largest first."""
    return sorted(
        (term for term in table.terms if len(term.factors) == 1), key=lambda term: -term.percent
    )


def contributions(screening: Screening) -> pd.DataFrame:
    """Contribution of each term: a term a row, a label a column. [%]"""
    return pd.DataFrame({label: table.percents() for label, table in screening.tables.items()})


def mean_at(
    screening: Screening, label: Label, factors: Sequence[str]
) -> dict[tuple[int, ...], float]:
    """Model's mean response at each level combination of one or two factors, over all levels of the others."""
    table = screening.tables[label]
    order = [name for name in screening.design.factors if name in factors]
    parts = {
        term.factors: term.effects for term in table.terms if set(term.factors) <= set(factors)
    }
    combinations = np.indices((3,) * len(order)).reshape(len(order), -1).T - 1
    means = {}
    for combination in combinations:
        level = dict(zip(order, map(int, combination), strict=True))
        deviation = sum(
            effects[tuple(level[name] for name in names)] for names, effects in parts.items()
        )
        means[tuple(level[name] for name in factors)] = table.constant + deviation
    return means
