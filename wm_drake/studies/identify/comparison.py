"""Rival laws of one component: fitted to the same tests, judged on tests that no fit has seen."""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import t as student

from wm_drake.errors import InputError, Problem
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import Quantity
from wm_drake.rigs.measured import MeasuredMotion
from wm_drake.studies.fitting.assessment import correlation_time, evaluated
from wm_drake.studies.fitting.fit import Fit, TestError
from wm_drake.studies.fitting.left_out import left_out_errors
from wm_drake.studies.fitting.methods import identify, refined
from wm_drake.studies.fitting.problem import FitProblem, Progress
from wm_drake.studies.identify.judgement import LACK, Judgement, judge
from wm_drake.studies.identify.models import ComponentModel
from wm_drake.studies.identify.problem import computed_forces, fit_problem
from wm_drake.studies.rig.quantities import loop_quantities

MANY = 12
"""Tests from which on a search begins with a part of them."""

FEWEST_LEFT_OUT = 3
"""Tests from which on each is predicted from the others; with fewer, the information criterion
decides."""

CHANCE = 0.05
"""Probability that a law that is as good as another one seems worse."""

STRONG = 6.0
"""Difference of the information criterion that is strong evidence (Kass and Raftery 1995)."""


@dataclass(frozen=True, eq=False)
class FittedLaw:
    """A law with its fit to the tests, and the judgement of the fit."""

    model: ComponentModel
    fit: Fit
    judgement: Judgement

    @property
    def law(self) -> str:
        """Name of the law."""
        return self.model.law


@dataclass(frozen=True, eq=False)
class LawResult(FittedLaw):
    """One of the rival laws.

    Attributes:
        left_out: RMSE of each test, predicted from the others (m,); NaN with less than
            `FEWEST_LEFT_OUT` tests. [N; N m]
        criterion: Bayesian information criterion with the number of independent samples; smaller is
            better, only differences count.
        prediction: The law at the fitted numbers on tests that no fit has seen; None without.
    """

    left_out: FloatArray
    criterion: float
    prediction: FittedLaw | None

    @property
    def left_out_rmse(self) -> float:
        """RMSE over all samples of all tests, each predicted from the others. [N; N m]"""
        return _pooled(self.left_out, self.fit)

    @property
    def undetermined(self) -> list[str]:
        """Names of the unknowns that the tests do not determine."""
        return [e.name for e in self.fit.estimates if not e.determined]


@dataclass(frozen=True, eq=False)
class LawComparison:
    """Rival laws on the same tests.

    Attributes:
        results: One for each law, in the order of the command.
        motions: The tests that were fitted.
        validation: Tests that no fit has seen; may be empty.
    """

    results: tuple[LawResult, ...]
    motions: tuple[MeasuredMotion, ...]
    validation: tuple[MeasuredMotion, ...]

    @property
    def by_left_out(self) -> bool:
        """Whether cross-validation decides, and not the information criterion."""
        return len(self.motions) >= FEWEST_LEFT_OUT

    @property
    def order(self) -> list[LawResult]:
        """Laws from the best to the worst by the deciding measure."""
        return sorted(self.results, key=self._score)

    @property
    def as_good(self) -> list[LawResult]:
        """Laws that the data do not tell apart from the best one, which is the first."""
        best, *others = self.order
        return [best, *(other for other in others if not self._is_worse(other, best))]

    @property
    def supported(self) -> LawResult:
        """Law that the data support: of those as good as the best, the one with fewest unknowns."""
        return min(self.as_good, key=lambda r: (len(r.model.unknowns), self._score(r)))

    @property
    def sentences(self) -> tuple[str, ...]:
        """What the data say about the laws, in words."""
        return (*self._verdict(), *self._blind(), *self._remarks())

    def _score(self, result: LawResult) -> float:
        return result.left_out_rmse if self.by_left_out else result.criterion

    def _is_worse(self, other: LawResult, best: LawResult) -> bool:
        """Return whether a law is worse than the best one by more than chance.

        By a paired t test of the logarithms of the errors of the left-out tests, or by a strong
        difference of the information criterion.
        """
        if not self.by_left_out:
            return other.criterion - best.criterion > STRONG
        floor = 1e-12 * max(best.fit.problem.measurements[0].largest, 1e-300)
        ratio = np.log(np.maximum(other.left_out, floor) / np.maximum(best.left_out, floor))
        error = float(np.std(ratio, ddof=1)) / np.sqrt(len(ratio))
        limit = float(student.isf(CHANCE, len(ratio) - 1))
        return float(np.mean(ratio)) > limit * error

    def _verdict(self) -> list[str]:
        best = self.order[0]
        if len(self.results) == 1:
            return list(best.judgement.sentences[:1])
        alike = [r.law for r in self.as_good if r is not self.supported]
        if self.by_left_out:
            how = "each test predicted from all the others, RMSE " + ", ".join(
                f"{r.law} {self.load.text(r.left_out_rmse)}" for r in self.order
            )
        else:
            how = (
                f"Bayesian information criterion from {len(self.motions)} "
                f"test{'s' if len(self.motions) > 1 else ''}, above the best: "
                + ", ".join(f"{r.law} {r.criterion - best.criterion:.3g}" for r in self.order)
            )
        sentences = [f"The data support the law {self.supported.law} ({how})."]
        if alike:
            sentences.append(
                f"They do not tell it apart from {', '.join(alike)}; it has the fewest unknown "
                "numbers of these."
            )
        if self.supported.judgement.verdict != "good":
            sentences.append(
                f"{self.supported.law}: {self.supported.judgement.sentences[0][0].lower()}"
                f"{self.supported.judgement.sentences[0][1:]}"
            )
        return sentences

    def _blind(self) -> list[str]:
        if not self.validation:
            return []
        blind = [r.prediction for r in self.results if r.prediction]
        ranked = sorted(blind, key=lambda seen: seen.fit.rmse)
        texts = [
            f"{seen.law} {self.load.text(seen.fit.rmse)}, "
            f"lack of fit {LACK.text(seen.judgement.missed)}"
            for seen in ranked
        ]
        count = len(self.validation)
        sentences = [
            f"Blind prediction of {count} test{'s' if count > 1 else ''} that no fit has seen, "
            f"RMSE: {'; '.join(texts)}."
        ]
        if len(ranked) > 1 and ranked[0].law not in [r.law for r in self.as_good]:
            sentences.append(
                f"There {ranked[0].law} is best, not {self.supported.law}: the tests of the fit do "
                "not hold what those of the prediction show."
            )
        return sentences

    def _remarks(self) -> list[str]:
        return [
            f"{r.law}: the data do not determine {', '.join(r.undetermined)}; its errors hold for "
            "any value within the bounds on the fitted tests, for the value where the search ended "
            "on others."
            for r in self.results
            if r.undetermined
        ]

    @property
    def load(self) -> Quantity:
        """Force or moment of the tests, with significant digits."""
        load = loop_quantities(self.motions[0].loop.rotates)["load"]
        return Quantity(load.words, load.unit, form="{:.3g}".format)

    @property
    def tested(self) -> "Iterator[TestedLoop]":
        """Fitted tests, then blind ones, each with its index and the fit of each law."""
        blind = {r.law: r.prediction.fit for r in self.results if r.prediction}
        groups = (
            ("fitted", self.motions, {r.law: r.fit for r in self.results}),
            ("blind", self.validation, blind),
        )
        for kind, motions, fits in groups:
            for index, measured in enumerate(motions):
                yield TestedLoop(measured, kind, index, fits)


@dataclass(frozen=True)
class TestedLoop:
    """A measured loop beside those of the laws.

    Attributes:
        kind: "fitted" or "blind".
        index: Its number among the tests of its kind.
        fits: Fit, or blind evaluation, of all tests of its kind, by law.
    """

    __test__ = False  # not one of pytest's

    measured: MeasuredMotion
    kind: str
    index: int
    fits: Mapping[str, Fit]

    def errors(self) -> dict[str, TestError]:
        """Return the error of this loop by law."""
        return {law: fit.tests[self.index] for law, fit in self.fits.items()}

    def forces(self) -> dict[str, FloatArray]:
        """Return the computed force at each sample by law. [N; N m]"""
        return {law: fit.computed[fit.problem.slices[self.index]] for law, fit in self.fits.items()}


@dataclass(frozen=True)
class SplitTests:
    """Tests to fit, and tests to predict, which no fit sees."""

    fitted: tuple[MeasuredMotion, ...]
    predicted: tuple[MeasuredMotion, ...] = ()


def compare_laws(
    models: Mapping[str, ComponentModel],
    tests: SplitTests,
    method: str = "least-squares",
    *,
    seed: int = 0,
    progress: Callable[[str, float], None] = lambda law, fraction: None,
) -> LawComparison:
    """Fit rival laws to the same tests and predict others.

    Args:
        progress: Called with a law and the fraction done of its search.
    """
    fits = {
        law: fit_law(
            model,
            tests.fitted,
            method,
            seed=seed,
            progress=lambda fraction, least, law=law: progress(law, fraction),  # type: ignore[misc]
        )
        for law, model in models.items()
    }
    best = min(fits.values(), key=lambda fit: fit.rmse)
    independent = _independent_samples(best)
    results = tuple(_result(models[law], fit, tests, independent) for law, fit in fits.items())
    return LawComparison(results, tests.fitted, tests.predicted)


def fit_law(
    model: ComponentModel,
    motions: Sequence[MeasuredMotion],
    method: str,
    *,
    seed: int,
    progress: Progress,
) -> Fit:
    """Fit a law; from many tests, search with a part of them and then refine with all.

    Args:
        motions: Tests, sorted by their motion.
        method, seed, progress: As for `identify`.
    """
    problem = fit_problem(model, motions)
    stride = -(-len(motions) // MANY)
    if stride < 2 or not model.unknowns:
        return identify(problem, method, seed=seed, progress=progress)
    part = list(motions[::stride])
    first = identify(
        fit_problem(model, part),
        method,
        seed=seed,
        progress=lambda fraction, least: progress(0.8 * fraction, least),
    )
    note = (
        f"{first.log.notes[0]}; searched with {len(part)} of {len(motions)} tests, then refined by "
        "least squares with all"
    )
    fit = refined(problem, first, note)
    progress(1.0, fit.rmse)
    return fit


def _result(model: ComponentModel, fit: Fit, tests: SplitTests, independent: float) -> LawResult:
    motions = tests.fitted
    left_out: FloatArray = np.full(len(motions), np.nan)
    if len(motions) >= FEWEST_LEFT_OUT:
        left_out = left_out_errors(
            fit, lambda chosen: fit_problem(model, [motions[k] for k in chosen])
        )
    criterion = information_criterion(fit, independent)
    prediction = _prediction(model, fit, tests.predicted) if tests.predicted else None
    return LawResult(model, fit, judge(fit, motions), left_out, criterion, prediction)


def _prediction(model: ComponentModel, fit: Fit, motions: Sequence[MeasuredMotion]) -> FittedLaw:
    """Return the evaluation of tests at fitted numbers."""
    values = fit.values[None]
    seen = fit_problem(model, motions)
    blind = evaluated(
        FitProblem((), seen.measurements, lambda points: computed_forces(model, motions, values))
    )
    return FittedLaw(model, blind, judge(blind, motions))


def information_criterion(fit: Fit, independent: float) -> float:
    """Return the Bayesian information criterion N ln(mean square error) + k ln N.

    Args:
        fit: Fit of a law; its k unknowns and the variance of the error count.
        independent: Number N of independent samples.
    """
    floor = 1e-12 * max(m.largest for m in fit.problem.measurements)
    count = len(fit.estimates) + 1
    return float(
        2.0 * independent * np.log(max(fit.rmse, floor)) + count * np.log(max(independent, 2.0))
    )


def _independent_samples(fit: Fit) -> float:
    """Return how many independent samples the tests have, by the residuals of the best law."""
    residuals = np.concatenate([m.values for m in fit.problem.measurements]) - fit.computed
    return float(
        sum(len(residuals[w]) / correlation_time(residuals[w]) for w in fit.problem.slices)
    )


def _pooled(errors: FloatArray, fit: Fit) -> float:
    counts = np.array([len(m.values) for m in fit.problem.measurements])
    return float(np.sqrt(np.sum(counts * np.square(errors)) / np.sum(counts)))


def check_blind(files: Sequence[Path], validation: Sequence[Path]) -> None:
    """Check that no file is both fitted and predicted, under any name.

    Raises:
        InputError: One is.
    """
    seen = {_content(path): path for path in files}
    problems = [
        Problem(
            str(path),
            "",
            f"has the same content as {seen[_content(path)]}, which is fitted; a blind prediction "
            "needs files that no fit has seen",
        )
        for path in validation
        if _content(path) in seen
    ]
    if problems:
        raise InputError(problems)


def _content(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
