"""Screening: run a design and divide the variance of each response among factors and interactions.

It is independent of machines: the function `evaluate` returns the responses of the trials. `Words`
has the words for factors and responses.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Literal, TypeAlias

import numpy as np
import pandas as pd

from wm_drake.errors import input_error
from wm_drake.parameters import FactorLevels, PublishedResults, PublishedTerm
from wm_drake.parameters.published import CONSTANT, INTERACTIONS, MAIN, OF_RESPONSE, RANGE
from wm_drake.report.formatting import significant
from wm_drake.studies.doe.anova import AnovaTable, Combination, Term, anova
from wm_drake.studies.doe.coding import LEVELS, efficiency
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


Improvement: TypeAlias = Literal["smaller", "larger", ""]
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
    goal: Improvement = "smaller"


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


EvaluateFactors: TypeAlias = Callable[[Design], Responses]


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


def run_screening(design: Design, evaluate: EvaluateFactors) -> Screening:
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


FAR = 30.0
"""Difference above which a result is named in the summary: of a mean, in percent of the published
one; of a contribution, in points of percent."""


@dataclass(frozen=True)
class Published:
    """Published numbers that belong to a screening.

    Attributes:
        terms: Terms by label, as in `PublishedResults`. Empty if nothing is compared.
        source: Where they are from, for reading.
    """

    terms: Mapping[Label, Mapping[str, PublishedTerm]] = field(default_factory=dict)
    source: str = ""

    def __bool__(self) -> bool:
        """Return whether there is anything to compare with."""
        return bool(self.terms)

    @property
    def has_terms(self) -> bool:
        """Whether anything else than grand means was published."""
        return any(set(terms) - set(OF_RESPONSE) for terms in self.terms.values())

    def mean(self, label: Label) -> float | None:
        """Return the published grand mean of a response. [unit of the response]"""
        term = self.terms.get(label, {}).get(CONSTANT)
        return None if term is None else term.effects[0]

    def range(self, label: Label) -> tuple[float, ...]:
        """Return the published smallest and largest value; empty without. [unit of the response]"""
        term = self.terms.get(label, {}).get(RANGE)
        return () if term is None else term.effects

    def sums(self, label: Label) -> tuple[float | None, float | None]:
        """Return the published percentages of all main effects and of all interactions. [%]"""
        terms = self.terms.get(label, {})
        main, interactions = (
            terms[name].percent if name in terms else None for name in (MAIN, INTERACTIONS)
        )
        return main, interactions

    def mean_difference(self, screening: Screening, label: Label) -> float | None:
        """Return how much our grand mean is above the published one. [%]

        It is None if there is no published one, or if that is zero.
        """
        mean = self.mean(label)
        return 100.0 * (screening.tables[label].constant - mean) / mean if mean else None

    def percent(self, label: Label, term: Term) -> float | None:
        """Return the published contribution of a term. [%]"""
        published, _ = self._published_term(label, term.factors)
        return None if published is None else published.percent

    def effects(self, label: Label, term: Term) -> dict[Combination, float]:
        """Return the published effects of a term by level; empty without. [unit of the response]"""
        published, is_turned = self._published_term(label, term.factors)
        if published is None or not published.effects:
            return {}
        levels = product(LEVELS, repeat=len(term.factors))
        turned = (combination[::-1] if is_turned else combination for combination in levels)
        return dict(zip(turned, published.effects, strict=True))

    def sign_differs(self, label: Label, term: Term) -> bool:
        """Return whether the effect at the lowest levels has another sign than the published one.

        It is False if no effects were published, or if the published one is zero.
        """
        effects = self.effects(label, term)
        lowest = (LEVELS[0],) * len(term.factors)
        return bool(effects) and effects[lowest] * term.effects[lowest] < 0.0

    def compared_terms(self, screening: Screening) -> Iterator[tuple[Label, Term]]:
        """Yield the terms of a screening of which a contribution or effects were published."""
        for label, table in screening.tables.items():
            for term in table.terms:
                if self.percent(label, term) is not None or self.effects(label, term):
                    yield label, term

    def other_signs(self, screening: Screening) -> list[tuple[Label, str]]:
        """Return label and name of the terms whose effects have another sign."""
        terms = self.compared_terms(screening)
        return [(label, term.name) for label, term in terms if self.sign_differs(label, term)]

    def differences(self, screening: Screening) -> dict[tuple[Label, str], float]:
        """Return contribution less published contribution, by label and term. [points]"""
        return {
            (label, term.name): term.percent - published
            for label, term in self.compared_terms(screening)
            if (published := self.percent(label, term)) is not None
        }

    def leaders(self, screening: Screening) -> dict[Label, tuple[str, str]]:
        """Return our largest main effect and the published one of each response with any."""
        largest = {}
        for label, table in screening.tables.items():
            mains = [term for term in table.terms if len(term.factors) == 1]
            known = {term.name: self.percent(label, term) or 0.0 for term in mains}
            if any(known.values()):
                ours = max(mains, key=lambda term: term.percent).name
                largest[label] = (ours, max(known, key=lambda name: known[name]))
        return largest

    def _published_term(
        self, label: Label, factors: tuple[str, ...]
    ) -> tuple[PublishedTerm | None, bool]:
        """Return a published term, and whether its factors are in the reverse order."""
        terms = self.terms.get(label, {})
        straight, turned = ":".join(factors), ":".join(factors[::-1])
        return terms.get(straight, terms.get(turned)), straight not in terms

    def far_means(self, screening: Screening) -> dict[Label, float]:
        """Return the means that differ from the published ones by more than `FAR`. [%]"""
        differences = {label: self.mean_difference(screening, label) for label in screening.tables}
        return {label: d for label, d in differences.items() if d is not None and abs(d) > FAR}

    def far_contributions(self, screening: Screening) -> dict[tuple[Label, str], float]:
        """Return the contributions that differ by more than `FAR`, by label and term. [points]"""
        return {key: d for key, d in self.differences(screening).items() if abs(d) > FAR}


NOT_PUBLISHED = Published()
"""No published results."""


def published_for(
    results: PublishedResults, labels: Iterable[Label], source: str = ""
) -> Published:
    """Return those published results that belong to some loads and responses."""
    compared = set(labels)
    kept = {label: terms for label, terms in results.items() if label in compared}
    return Published(kept, source if kept else "")
