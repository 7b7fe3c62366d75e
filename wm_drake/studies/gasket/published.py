"""Published results of a gasket study beside those of a screening."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product

from wm_drake.parameters import PublishedResults, PublishedTerm
from wm_drake.parameters.published import CONSTANT, INTERACTIONS, MAIN, OF_RESPONSE, RANGE
from wm_drake.studies.doe.anova import Combination, Term
from wm_drake.studies.gasket.screening import Label, Screening

FAR = 30.0
"""Difference above which a result is named in the summary: of a mean, in percent of the published
one; of a contribution, in points of percent."""

LEVELS = (-1, 0, 1)


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
