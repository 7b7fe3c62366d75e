"""Screening: run a design and divide the variance of each response among factors and interactions.

It is independent of machines: the function `evaluate` returns the responses of the trials. `Words`
has the words for factors and responses.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
import pandas as pd

from wm_drake.errors import input_error
from wm_drake.parameters import FactorLevels
from wm_drake.report.formatting import significant
from wm_drake.studies.doe.anova import AnovaTable, Term, anova
from wm_drake.studies.doe.coding import efficiency
from wm_drake.studies.doe.design import Design

LEADING_MAIN_PERCENT = 10.0
"""Contribution above which a main effect is a leading term ([B] Table 5). [%]"""

LEADING_INTERACTION_PERCENT = 5.0
"""Contribution above which an interaction is a leading term ([B] Table 5). [%]"""

FEW_TRIALS = 1.5
"""Trials per coefficient below which a design cannot tell how well its model predicts.

With 129 coefficients, the leave-one-out error of the default study is three to four times that of
fresh trials at 150 trials, twice at 200, and a tenth more at 1000.
"""

LEAST_PREDICTED_R2 = 0.9
"""Predicted R2 below which the model of a response is called poor."""

Label: TypeAlias = tuple[str, str]
"""Name of a load and name of a response."""


Goal: TypeAlias = Literal["smaller", "larger", ""]
"""Which change of a response is an improvement; "" if neither is."""


@dataclass(frozen=True)
class Meaning:
    """Meaning of a response, for reading.

    Attributes:
        title: Name in words, without the symbol.
        about: What is measured of a run, as part of a sentence.
        kind: Quantity, such as displacement; responses of one kind share a unit and a figure.
        goal: Which change is an improvement.
    """

    title: str
    about: str = ""
    kind: str = ""
    goal: Goal = "smaller"


@dataclass(frozen=True)
class Responses:
    """Responses of the trials of a design.

    Attributes:
        values: By load: one row per trial, one column per response; NaN where a run failed.
        units: Unit of each response, by its name.
        failed: Reason of each failed run, by index of the trial (from 0) and load.
        meanings: Words for each response, by its name; a response may have none.
        touching: Smallest gap of each run in which the tub touches the housing, by index of the
            trial (from 0) and load. [mm] At most 0.
        slack: Names of the springs that go slack in a run, by index of the trial (from 0) and load.
    """

    values: dict[str, pd.DataFrame]
    units: dict[str, str]
    failed: dict[tuple[int, str], str]
    meanings: dict[str, Meaning] = field(default_factory=dict)
    touching: dict[tuple[int, str], float] = field(default_factory=dict)
    slack: dict[tuple[int, str], list[str]] = field(default_factory=dict)


Evaluate: TypeAlias = Callable[[Design], Responses]


@dataclass(frozen=True)
class Screening:
    """A design with its responses and their analysis of variance.

    Attributes:
        tables: Analysis of variance by label, without the trials whose run with this load failed.
    """

    design: Design
    responses: Responses
    tables: dict[Label, AnovaTable]

    @property
    def loads(self) -> list[str]:
        """Names of the loads, in the order of the runs."""
        return list(self.responses.values)

    @property
    def names(self) -> list[str]:
        """Names of the responses."""
        return list(self.responses.units)

    @property
    def is_complete(self) -> bool:
        """Whether the design has all level combinations, so that nothing is left to predict."""
        return self.design.trials == self.design.combinations

    @property
    def has_few_trials(self) -> bool:
        """Whether the trials are too few to judge the model."""
        enough = FEW_TRIALS * (self.design.trials - self.design.residual_df)
        return self.design.trials < enough and not self.is_complete

    def poor(self) -> dict[Label, float]:
        """Return the responses that the model predicts poorly, with their predicted R2."""
        if self.is_complete:
            return {}
        predicted = {label: table.predicted_r2 for label, table in self.tables.items()}
        return {label: r2 for label, r2 in predicted.items() if r2 < LEAST_PREDICTED_R2}


def run_screening(design: Design, evaluate: Evaluate) -> Screening:
    """Run a design and analyse its responses.

    Raises:
        InputError: the design has as many coefficients as trials, or so many runs failed that the
            others do not determine the effects.
    """
    check_degrees_of_freedom(design)
    return analyse(design, evaluate(design))


def check_degrees_of_freedom(design: Design) -> None:
    """Raise an InputError if a part of the grid has as many coefficients as trials.

    The model then meets all trials exactly, whatever they are, and nothing shows how wrong it is.
    The full factorial is allowed: it has no other trials.
    """
    if design.residual_df < 1 and design.trials < design.combinations:
        raise input_error(
            f"{design.trials} trials for {design.trials - design.residual_df} coefficients of "
            f"{design.model} leave no degree of freedom, so nothing shows how well the model fits; "
            "add trials, or use the model main",
            key="trials",
        )


def analyse(design: Design, responses: Responses) -> Screening:
    """Analyse the variance of the responses of a design.

    Raises:
        InputError: so many runs failed that the others do not determine the effects.
    """
    levels = pd.DataFrame(design.levels, columns=list(design.factors))
    tables: dict[Label, AnovaTable] = {}
    for load, values in responses.values.items():
        good = np.isfinite(values.to_numpy()).all(axis=1)
        if not good.all() and efficiency(design.levels[good], design.model) == 0.0:
            raise input_error(
                f"{np.sum(~good)} of {len(good)} runs failed; the others do not determine the "
                f"effects of {design.model}",
                where=f"load {load}",
            )
        by_response = anova(levels[good], values[good], interactions=design.model != "main")
        tables |= {(load, name): table for name, table in by_response.items()}
    return Screening(design, responses, tables)


def leading_terms(table: AnovaTable) -> list[Term]:
    """Return the terms above the thresholds of [B] Table 5, largest first."""
    least = {1: LEADING_MAIN_PERCENT, 2: LEADING_INTERACTION_PERCENT}
    leading = [term for term in table.terms if term.percent > least[len(term.factors)]]
    return sorted(leading, key=lambda term: -term.percent)


def main_effects(table: AnovaTable) -> list[Term]:
    """Return the main effects, largest first."""
    return sorted(
        (term for term in table.terms if len(term.factors) == 1), key=lambda term: -term.percent
    )


def contributions(screening: Screening) -> pd.DataFrame:
    """Return the contributions of the terms: one row per term, one column per label. [%]"""
    return pd.DataFrame({label: table.percents() for label, table in screening.tables.items()})


def mean_at(
    screening: Screening, label: Label, factors: Sequence[str]
) -> dict[tuple[int, ...], float]:
    """Return the mean response at each level combination of one or two factors.

    The mean is that of the fitted model over all levels of the other factors.

    Returns:
        Mean response by level combination, in the order of `factors`. [unit of the response]
    """
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


LEVELS = (-1, 0, 1)


class Words:
    """Names, physical values and units for reading."""

    def __init__(self, factors: Sequence[FactorLevels], meanings: Mapping[str, Meaning]) -> None:
        """Store the words."""
        self._factors = {factor.name: factor for factor in factors}
        self._meanings = meanings

    def factor(self, name: str) -> str:
        """Return a factor for reading, such as `linear damping C_L`."""
        about = self._factors[name].about if name in self._factors else ""
        return f"{about.split(',')[0]} {name}" if about else name

    def term(self, name: str) -> str:
        """Return a term for reading: its factors, joined by a multiplication sign."""
        return " × ".join(map(self.factor, name.split(":")))

    def unit(self, factor: str) -> str:
        """Return the unit of a factor's levels; "" if it has none."""
        return next(iter(self._factors[factor].units.values()), "")

    def number(self, factor: str, level: int) -> str:
        """Return the physical value of a level, without unit."""
        numbers = next(iter(self._factors[factor].numbers.values()))
        return significant(numbers[level + 1])

    def value(self, factor: str, level: int) -> str:
        """Return the physical value of a level with its unit."""
        return f"{self.number(factor, level)} {self.unit(factor)}".strip()

    def span(self, factor: str) -> str:
        """Return the lowest and the highest value of a factor with the unit."""
        return f"{self.number(factor, -1)} to {self.value(factor, 1)}"

    def axis(self, factor: str) -> str:
        """Return the label of an axis of a factor: name, symbol, unit."""
        return ", ".join(filter(None, (self.factor(factor), self.unit(factor))))

    def meaning(self, response: str) -> Meaning:
        """Return the meaning of a response; one without words has its name as title and kind."""
        return self._meanings.get(response) or Meaning(response, kind=response, goal="")

    def response(self, name: str) -> str:
        """Return a response for reading, such as `displacement x (Dx)`."""
        title = self.meaning(name).title
        is_in_name = title.replace(" ", "_") == name or name in title.split()
        return title if is_in_name else f"{title} ({name})"
