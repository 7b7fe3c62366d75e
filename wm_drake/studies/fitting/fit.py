"""Result of an identification."""

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.problem import FitProblem, Unknown

FitVerdict: TypeAlias = Literal["good", "fair", "poor"]

DETERMINED, UNDETERMINED = 0.5, 0.9
"""Limits of the part of an unknown's prior deviation that remains. Below the first, the data
determine the unknown. Above the second, only the prior does."""

GOOD, FAIR = 0.05, 0.15
"""Largest lack of fit of a good and of a fair fit, as a part of the measured values."""


def verdict_of(missed: float) -> FitVerdict:
    """Return the verdict on a model that misses a part of the measured values."""
    if missed <= GOOD:
        return "good"
    return "fair" if missed <= FAIR else "poor"


@dataclass(frozen=True)
class TestError:
    """Error of one test, as in [A] Tables 2, 4, 5, 7.

    Attributes:
        rmse: In the unit of the test.
        normalised: RMSE by the largest measured value.
    """

    __test__ = False  # not one of pytest's

    name: str
    rmse: float
    normalised: float


@dataclass(frozen=True)
class Estimate:
    """Estimate of one unknown.

    Attributes:
        value: Where the search ended. [SI]
        lower, upper: 95 % confidence interval within the bounds; NaN if the value is at a bound or
            not determined. [SI]
        determined: Whether the data or its prior limit it more than its bounds do.
        at_bound: "lower" or "upper" if it hit one, else "".
    """

    name: str
    value: float
    lower: float
    upper: float
    determined: bool
    at_bound: str


@dataclass(frozen=True)
class Direction:
    """A change of the unknowns together that the data do not see.

    Attributes:
        names: The unknowns that take part.
        parts: How far each moves, in its range (log range if searched so), largest 1.
        deviation: Standard deviation along it, in ranges; infinite if the data do not see it.
    """

    names: tuple[str, ...]
    parts: tuple[float, ...]
    deviation: float


@dataclass(frozen=True)
class SearchLog:
    """Course of a search.

    Attributes:
        evaluations: Points at which the model was evaluated.
        history: Least cost after each round.
        notes: Remarks on the search, for the reader.
    """

    method: str
    seed: int = 0
    evaluations: int = 0
    history: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Linearized:
    """Rows of a problem, linear in the coordinates about the point where a search ended.

    Attributes:
        point: Coordinates (p,).
        slopes: Derivatives (m, p) of the rows without those of what is wished: of `count` residuals
            of the measurements first.
        count: Number n of measured values.
    """

    point: FloatArray
    slopes: FloatArray
    count: int

    def covariance(self, scatter: float = 1.0) -> FloatArray:
        """Return the covariance (p, p) of the coordinates for residuals of one known deviation.

        Args:
            scatter: Standard deviation of the residuals of the measurements.
        """
        slopes = self.slopes.copy()
        slopes[: self.count] /= scatter
        return np.asarray(np.linalg.inv(slopes.T @ slopes))

    def directions(self) -> FloatArray:
        """Return the singular values of the slopes of the measurements, in falling order.

        With priors, each one is the ratio of prior deviation to deviation by the data along a
        principal direction. The number of values above 1 is the number of directions that the data
        determine.
        """
        return np.asarray(np.linalg.svd(self.slopes[: self.count], compute_uv=False))


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of an identification; the same for every method.

    Attributes:
        log: Course of the search.
        estimates: One for each unknown.
        rmse: Over all values of all tests, scaled as in the problem.
        tests: Error of each test.
        computed: Best values of the model (n,), baselines included, to compare with the measured.
        baselines: Amounts of each test's baseline columns.
        covariance: Covariance of the unknowns (p, p); NaN in rows of those at a bound. [SI]
        condition: Condition of the scaled Jacobian: 1 if the data see all directions alike, large
            if they hardly see one.
        undetermined: Directions that the data do not determine.
        linear: The problem about the end of the search.
    """

    problem: FitProblem
    log: SearchLog
    estimates: tuple[Estimate, ...]
    rmse: float
    tests: tuple[TestError, ...]
    computed: FloatArray
    baselines: tuple[FloatArray, ...]
    covariance: FloatArray
    condition: float
    undetermined: tuple[Direction, ...]
    linear: Linearized

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Return the unknowns."""
        return self.problem.unknowns

    def without_intervals(self, reason: str) -> "Fit":
        """Return the fit without intervals and covariance, with the reason as a note."""
        bare = tuple(replace(estimate, lower=np.nan, upper=np.nan) for estimate in self.estimates)
        return replace(
            self,
            estimates=bare,
            covariance=np.full_like(self.covariance, np.nan),
            log=replace(self.log, notes=(*self.log.notes, reason)),
        )

    @property
    def values(self) -> FloatArray:
        """Return the values where the search ended (p,). [SI]"""
        return np.array([estimate.value for estimate in self.estimates])

    @property
    def remaining(self) -> FloatArray:
        """Return the part of each prior deviation that remains (p,); NaN without a prior."""
        priors = [np.nan if u.prior is None else u.prior[1] for u in self.unknowns]
        return np.asarray(np.sqrt(np.diag(self.covariance)) / priors)

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of an unknown."""
        return next(estimate for estimate in self.estimates if estimate.name == name)
