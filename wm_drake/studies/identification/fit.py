"""What an identification found, and how well the data determine it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import t as student

from wm_drake.parameters.elements import FloatArray
from wm_drake.studies.identification.problem import Problem, rmse

CONFIDENCE = 0.95

AT_BOUND = 1e-3
"""An unknown this near a bound, in ranges, has hit it."""

DIFFERENCE = 1e-3
"""Step of the central differences, in ranges."""

RESOLUTION = 1e-4
"""Errors below this part of the measured values are not told from errors of model and integration."""

WIDEST = 0.25
"""Standard deviation, in ranges, from which the 95 % interval says no more than the bounds did."""

TAKES_PART = 0.3
"""Component of a unit direction from which an unknown is named with it."""


@dataclass(frozen=True)
class TestError:
    """Error of one test, as in [A] Tables 2, 4, 5, 7. `rmse` in the test's unit, `normalised` by its largest measured value."""

    __test__ = False  # not one of pytest's

    name: str
    rmse: float
    normalised: float


@dataclass(frozen=True)
class Estimate:
    """One unknown, found.

    Attributes:
        name: Of the unknown.
        value: Where the search ended. [SI]
        lower, upper: 95 % interval; NaN where there is none: at a bound, or not determined. [SI]
        determined: Whether the data say more about it than its bounds did.
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
        deviation: Standard deviation along it, in ranges; infinite if the data do not see it at all.
    """

    names: tuple[str, ...]
    parts: tuple[float, ...]
    deviation: float


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of an identification; the same for every method.

    Attributes:
        problem: What was asked.
        method, seed: How it was searched.
        estimates: One for each unknown.
        rmse: Over all values of all tests, scaled as the problem says.
        tests: Error of each test.
        computed: Best values of the model (n,), baselines included: beside the measured ones.
        baselines: Amounts of each test's baseline columns.
        covariance: Of the unknowns (p, p); NaN in rows of those at a bound. [SI]
        condition: Of the scaled Jacobian: 1 if all directions are seen alike, large if one is hardly seen.
        undetermined: Directions the data do not determine.
        evaluations: Points the model was asked for.
        history: Least RMSE after each round of the search.
        notes: What a reader should know of the search.
    """

    problem: Problem
    method: str
    seed: int
    estimates: tuple[Estimate, ...]
    rmse: float
    tests: tuple[TestError, ...]
    computed: FloatArray
    baselines: tuple[FloatArray, ...]
    covariance: FloatArray
    condition: float
    undetermined: tuple[Direction, ...]
    evaluations: int
    history: tuple[float, ...]
    notes: tuple[str, ...]

    def without_intervals(self, reason: str) -> "Fit":
        """The same, claiming no interval of any unknown."""
        bare = tuple(replace(estimate, lower=np.nan, upper=np.nan) for estimate in self.estimates)
        return replace(self, estimates=bare, covariance=np.full_like(self.covariance, np.nan), notes=(*self.notes, reason))

    @property
    def values(self) -> FloatArray:
        """Where the search ended (p,). [SI]"""
        return np.array([estimate.value for estimate in self.estimates])

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of an unknown."""
        return next(estimate for estimate in self.estimates if estimate.name == name)

    def test_curves(self) -> Iterator[tuple[str, FloatArray, FloatArray]]:
        """Name, measured and computed values of each test."""
        for where, measurement in zip(self.problem.slices, self.problem.measurements, strict=True):
            yield measurement.name, measurement.values, self.computed[where]

    def as_dict(self) -> dict[str, Any]:
        """For JSON, in SI: numbers that are not finite become null, as does the value of an unknown not determined."""
        return {
            "method": self.method,
            "seed": self.seed,
            "rmse": self.rmse,
            "unknowns": {
                e.name: {
                    "value": e.value if e.determined else None,
                    "interval_95": None if np.isnan(e.lower) else [e.lower, e.upper],
                    "unit": u.unit.si,
                    "determined": e.determined,
                    "at_bound": e.at_bound or None,
                }
                for e, u in zip(self.estimates, self.problem.unknowns, strict=True)
            },
            "tests": [{"name": t.name, "rmse": t.rmse, "rmse_normalised": t.normalised} for t in self.tests],
            "condition": self.condition if np.isfinite(self.condition) else None,
            "undetermined": [{"unknowns": list(d.names), "parts": list(d.parts)} for d in self.undetermined],
            "evaluations": self.evaluations,
            "notes": list(self.notes),
        }


def assess(
    problem: Problem,
    point: FloatArray,
    *,
    method: str,
    seed: int,
    evaluations: int,
    history: tuple[float, ...],
    notes: tuple[str, ...] = (),
) -> Fit:
    """The fit at a point in unit coordinates (p,) where a search ended.

    Covariance by the sandwich of generalised least squares: each test errs by its own variance, larger by the correlation
    of its samples where they follow each other, so that tests sampled densely do not claim more than they know.
    """
    residuals = problem.residuals(point[None])[0]
    jacobian = central_differences(problem, point)
    bound = np.where(point < AT_BOUND, -1, np.where(point > 1.0 - AT_BOUND, 1, 0))
    unseen = WIDEST * np.linalg.norm(jacobian, axis=0) < float(rmse(_resolution(problem)))
    bound[unseen] = 0  # it came there by chance
    free = np.flatnonzero(bound == 0)
    jacobian = jacobian[:, free]
    variance = _variances(problem, residuals, jacobian)
    spread = _Spread(jacobian, variance, np.maximum(variance, _resolution(problem) ** 2))
    p = len(problem.unknowns)
    covariance, resolved = np.full((p, p), np.nan), np.zeros(p)
    slope = _slopes(problem, point)
    covariance[np.ix_(free, free)] = spread.covariance * np.outer(slope[free], slope[free])
    resolved[free] = spread.resolved_deviation
    wide = np.zeros(p)
    wide[free] = np.sqrt(np.diag(spread.covariance))
    quantile = float(student.ppf(0.5 + 0.5 * CONFIDENCE, max(_degrees_of_freedom(problem, len(free)), 1)))
    with np.errstate(over="ignore", invalid="ignore"):
        sides = [problem.from_unit(point + sign * quantile * wide) for sign in (-1.0, 1.0)]
    estimates = tuple(_estimate(problem, k, point, bound[k], resolved[k], (sides[0][k], sides[1][k])) for k in range(p))
    computed, baselines = _computed(problem, point)
    return Fit(
        problem=problem,
        method=method,
        seed=seed,
        estimates=estimates,
        rmse=float(rmse(residuals)),
        tests=_test_errors(problem, residuals),
        computed=computed,
        baselines=baselines,
        covariance=covariance,
        condition=spread.condition,
        undetermined=spread.undetermined([problem.unknowns[k].name for k in free]),
        evaluations=evaluations + 2 * p + 2,
        history=history,
        notes=notes,
    )


def central_differences(problem: Problem, point: FloatArray) -> FloatArray:
    """Derivatives of the residuals by the unknowns (n, p), in unit coordinates; one-sided at a bound."""
    steps = DIFFERENCE * np.eye(len(point))
    sides = np.clip(np.concatenate([point + steps, point - steps]), 0.0, 1.0)
    above, below = np.split(problem.residuals(sides), 2)
    width = np.diag(sides[: len(point)] - sides[len(point) :])
    return np.asarray(((above - below) / width[:, None]).T)


class _Spread:
    """What the singular values of the Jacobian say of the free unknowns, in unit coordinates."""

    def __init__(self, jacobian: FloatArray, variance: FloatArray, resolution: FloatArray) -> None:
        _, self.singular, rows = np.linalg.svd(jacobian, full_matrices=False)
        self.directions = rows
        smallest = 1e-12 * max(float(self.singular.max(initial=0.0)), 1e-300)
        self._inverse = np.array([0.0 if s <= smallest else 1.0 / s for s in self.singular])
        rotated = jacobian @ rows.T
        self.covariance = rows.T @ self._sandwich(rotated, variance) @ rows
        with np.errstate(divide="ignore"):
            seen = np.diag(self._sandwich(rotated, resolution))
        self.deviations = np.where(self._inverse > 0.0, np.sqrt(seen), np.inf)
        with np.errstate(invalid="ignore"):
            parts = np.where(np.abs(rows) > 1e-9, np.abs(rows) * self.deviations[:, None], 0.0)
        self.resolved_deviation = np.sqrt(np.sum(np.square(parts), axis=0))

    def _sandwich(self, rotated: FloatArray, variance: FloatArray) -> FloatArray:
        scaled = rotated * np.sqrt(variance)[:, None]
        return np.asarray((scaled.T @ scaled) * np.outer(self._inverse, self._inverse) ** 2)

    @property
    def condition(self) -> float:
        """Largest by smallest singular value."""
        if not len(self.singular):
            return 1.0
        return float(self.singular[0] / self.singular[-1]) if self.singular[-1] > 0.0 else np.inf

    def undetermined(self, names: list[str]) -> tuple[Direction, ...]:
        """The directions along which the data leave the unknowns where they like."""
        found = []
        for row, deviation in zip(self.directions, self.deviations, strict=True):
            if deviation > WIDEST:
                taking = np.flatnonzero(np.abs(row) > TAKES_PART)
                parts = row[taking] / row[taking][np.argmax(np.abs(row[taking]))]
                found.append(Direction(tuple(names[k] for k in taking), tuple(map(float, parts)), float(deviation)))
        return tuple(found)


def _estimate(
    problem: Problem, k: int, point: FloatArray, bound: int, deviation: float, interval: tuple[float, float]
) -> Estimate:
    unknown = problem.unknowns[k]
    determined = bool(deviation <= WIDEST)
    lower, upper = interval if determined and bound == 0 else (np.nan, np.nan)
    at_bound = {-1: "lower", 0: "", 1: "upper"}[int(bound)]
    value = float(problem.from_unit(point)[k])
    return Estimate(unknown.name, value, float(lower), float(upper), determined, at_bound)


def _slopes(problem: Problem, point: FloatArray) -> FloatArray:
    """Derivative of the SI value of each unknown by its unit coordinate."""
    values = problem.from_unit(point)
    return np.array(
        [
            value * np.log(u.upper / u.lower) if u.logarithmic else u.upper - u.lower
            for u, value in zip(problem.unknowns, values, strict=True)
        ]
    )


def _degrees_of_freedom(problem: Problem, free: int) -> int:
    return sum(len(m.values) - m.basis.shape[1] for m in problem.measurements) - free


def _variances(problem: Problem, residuals: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Variance of each scaled residual (n,), with what estimating and correlation take from it.

    Samples of one test have a variance of their own, whose degrees of freedom are less what its baseline and its share of the
    unknowns (its leverages) take; values that are no samples have one together.
    """
    leverage = np.sum(np.square(np.linalg.svd(jacobian, full_matrices=False)[0]), axis=1)
    pooled = float(np.sum(np.square(residuals))) / max(_degrees_of_freedom(problem, jacobian.shape[1]), 1e-12)
    parts = []
    for where, m in zip(problem.slices, problem.measurements, strict=True):
        own = residuals[where]
        variance = pooled
        if m.correlated:
            freedom = max(len(own) - m.basis.shape[1] - float(np.sum(leverage[where])), 1e-12)
            variance = float(np.sum(np.square(own))) / freedom * correlation_time(own)
        parts.append(np.full(len(own), variance))
    return np.concatenate(parts)


def correlation_time(series: FloatArray) -> float:
    """How many samples say as much as one independent one: 1 + 2 sum of the autocorrelation up to its first zero."""
    power = float(np.mean(np.square(series)))
    if power == 0.0:
        return 1.0
    spectrum = np.fft.rfft(series, 2 * len(series))
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[: len(series)] / (len(series) * power)
    below = np.flatnonzero(correlation[1:] <= 2.0 / np.sqrt(len(series)))  # what white noise shows by chance
    end = 1 + int(below[0]) if len(below) else len(series)
    return max(1.0, 1.0 + 2.0 * float(np.sum(correlation[1:end])))


def _resolution(problem: Problem) -> FloatArray:
    parts = [np.full(len(m.values), RESOLUTION * float(rmse(m.values)) / m.scale) for m in problem.measurements]
    return np.concatenate(parts)


def _test_errors(problem: Problem, residuals: FloatArray) -> tuple[TestError, ...]:
    found = []
    for where, m in zip(problem.slices, problem.measurements, strict=True):
        error = float(rmse(residuals[where])) * m.scale
        found.append(TestError(m.name, error, error / m.largest if m.largest else float("nan")))
    return tuple(found)


def _computed(problem: Problem, point: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """Computed values with the best baselines added (n,), and the amounts of their columns."""
    computed = problem.evaluate(problem.from_unit(point)[None])[0].copy()
    amounts = []
    for where, m in zip(problem.slices, problem.measurements, strict=True):
        if m.baseline is None:
            amounts.append(np.zeros(0))
            continue
        amount = np.linalg.lstsq(m.baseline, m.values - computed[where], rcond=None)[0]
        computed[where] += m.baseline @ amount
        amounts.append(amount)
    return computed, tuple(amounts)
