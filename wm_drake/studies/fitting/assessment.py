"""Assessment of a fit: bounds that were hit, covariance, intervals, error of left-out tests."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from wm_drake.parameters.types import FloatArray, IndexArray
from wm_drake.studies.fitting.fit import Direction, Estimate, Fit, SearchLog, TestError
from wm_drake.studies.fitting.problem import FitProblem, rmse
from wm_drake.studies.fitting.profile import Profile
from wm_drake.studies.fitting.search import Search, descended

CONFIDENCE = 0.95

AT_BOUND = 1e-3
"""An unknown this near a bound, in ranges, has hit it."""

DIFFERENCE = 1e-3
"""Step of the central differences, in ranges."""

FLAT_SIDE = 0.1
"""Effect of a step to one side by that of a step to the other, below which that side is flat."""

SAME = 1e-9
"""Singular value, by the largest, of effects of unknowns below which they are the same."""

RESOLUTION = 1e-4
"""Errors below this part of the measured values cannot be separated from those of integration."""

WIDEST = 0.25
"""Standard deviation, in ranges, from which on the 95 % interval is as wide as the bounds."""

TAKES_PART = 0.3
"""Component of a unit direction from which on an unknown is named with it."""

SEEN = 1e-10
"""Smallest eigenvalue, by the largest, of the information in the other tests about a direction that
is searched anew without a test. In other directions the fit to all tests is kept."""

FAR = 0.05
"""Change of an unknown, in ranges, above which one step is not trusted and the fit is repeated."""

MOST_STEPS = 20
"""Most steps of a search without one test."""


def assess(problem: FitProblem, point: FloatArray, log: SearchLog) -> Fit:
    """Return the fit at the point (p,) where a search ended, in coordinates.

    The covariance is the sandwich of generalised least squares: each test has its own variance,
    larger by the correlation of its samples where they follow each other. So a densely sampled test
    does not count for more than it contains. Values with errors of different size have a variance
    each (`Measurement.heteroscedastic`). An interval that would leave the bounds ends by its
    profile (`wm_drake.studies.fitting.profile`).

    Args:
        point: Where the search ended.
        log: Course of the search; the evaluations of the assessment are added to it.
    """
    residuals = problem.residuals(point[None])[0]
    jacobian, evaluated = central_differences(problem, point, residuals)
    bound = _bounds_hit(point, _spread(problem, residuals, jacobian))
    free = np.flatnonzero(bound == 0)
    spread = _spread(problem, residuals, jacobian[:, free])
    p = len(problem.unknowns)
    slope = _slopes(problem, point)[free]
    covariance = np.full((p, p), np.nan)
    covariance[np.ix_(free, free)] = spread.covariance * np.outer(slope, slope)
    computed, baselines = _computed(problem, point)
    return Fit(
        problem=problem,
        log=replace(log, evaluations=log.evaluations + evaluated + 2),
        estimates=_estimates(problem, point, bound, spread),
        rmse=float(rmse(residuals)),
        tests=_test_errors(problem, residuals),
        computed=computed,
        baselines=baselines,
        covariance=covariance,
        condition=spread.condition,
        undetermined=spread.undetermined([problem.unknowns[k].name for k in free]),
    )


def evaluated(problem: FitProblem) -> Fit:
    """Return the fit of a problem without unknowns: its errors only."""
    nowhere = np.zeros(0)
    residuals = problem.residuals(nowhere[None])[0]
    computed, baselines = _computed(problem, nowhere)
    note = "all numbers are given: nothing was searched"
    return Fit(
        problem=problem,
        log=SearchLog("evaluation", evaluations=2, notes=(note,)),
        estimates=(),
        rmse=float(rmse(residuals)),
        tests=_test_errors(problem, residuals),
        computed=computed,
        baselines=baselines,
        covariance=np.zeros((0, 0)),
        condition=1.0,
        undetermined=(),
    )


def _bounds_hit(point: FloatArray, spread: "_Spread") -> IndexArray:
    """Return which unknowns are at their lower (-1) or upper (1) bound; 0 for undetermined ones.

    Args:
        point: Where the search ended (p,), in coordinates.
        spread: Spread of all unknowns. What it does not determine is at a bound by chance: the
            search may end anywhere in a flat valley.
    """
    bound = np.where(point < AT_BOUND, -1, np.where(point > 1.0 - AT_BOUND, 1, 0))
    return np.where(spread.resolved_deviation > WIDEST, 0, bound)


def central_differences(
    problem: FitProblem, point: FloatArray, residuals: FloatArray
) -> tuple[FloatArray, int]:
    """Return the derivatives of the residuals by the unknowns, in unit coordinates.

    They are one-sided at a bound. They are also one-sided at a corner, where a step to one side has
    nearly no effect that the other unknowns cannot take back: the friction force of a damper that
    just does not slip is such a corner. The data do not limit the unknown to that side, and a mean
    of both sides would claim that they do.
    The step to that side is long, because a short one shows the errors of integration instead.

    Args:
        point: In unit coordinates (p,).
        residuals: Residuals at the point (n,).

    Returns:
        Derivatives (n, p), and how many points were evaluated.
    """
    steps = DIFFERENCE * np.eye(len(point))
    sides = np.clip(np.concatenate([point + steps, point - steps]), 0.0, 1.0)
    above, below = np.split(problem.residuals(sides), 2)
    width = np.diag(sides[: len(point)] - sides[len(point) :])
    slopes = (above - below) / width[:, None]
    flat = _flat_sides(point, residuals, above, below)
    corners = np.flatnonzero(flat)
    if len(corners):
        far = point + WIDEST * np.diag(flat)[corners]
        far = np.clip(far, 0.0, 1.0)
        length = np.sum(far - point, axis=1)
        slopes[corners] = (problem.residuals(far) - residuals) / length[:, None]
    return np.asarray(slopes.T), len(sides) + len(corners)


def _flat_sides(
    point: FloatArray, residuals: FloatArray, above: FloatArray, below: FloatArray
) -> FloatArray:
    """Return for each unknown the side, 1 or -1, where a step has nearly no effect; 0 if none.

    Of an effect only that part counts which no change of the other unknowns has.
    """
    side = np.zeros(len(point))
    for k in range(len(point)):
        others = np.delete(above - below, k, axis=0)
        steps = np.stack([above[k], below[k]]) - residuals
        remainder = steps - steps @ np.linalg.pinv(others, rcond=SAME) @ others
        upwards, downwards = np.linalg.norm(remainder, axis=1)
        side[k] = float(upwards < FLAT_SIDE * downwards) - float(downwards < FLAT_SIDE * upwards)
    at_bound = (point < DIFFERENCE) | (point > 1.0 - DIFFERENCE)
    return np.where(at_bound, 0.0, side)


class _Spread:
    """Spread of the free unknowns in unit coordinates, from the singular values of the Jacobian."""

    def __init__(self, jacobian: FloatArray, variance: FloatArray, resolution: FloatArray) -> None:
        _, self.singular, rows = np.linalg.svd(jacobian, full_matrices=False)
        self.directions = rows
        smallest = 1e-12 * max(float(self.singular.max(initial=0.0)), 1e-300)
        self._inverse = np.array([0.0 if s <= smallest else 1.0 / s for s in self.singular])
        rotated = jacobian @ rows.T
        self.covariance = rows.T @ self._sandwich(rotated, variance) @ rows
        self.inverse = rows.T @ np.diag(np.square(self._inverse)) @ rows
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
        """Quotient of the largest and the smallest singular value."""
        if not len(self.singular):
            return 1.0
        return float(self.singular[0] / self.singular[-1]) if self.singular[-1] > 0.0 else np.inf

    def undetermined(self, names: list[str]) -> tuple[Direction, ...]:
        """Return the directions along which the data do not determine the unknowns."""
        undetermined = []
        for row, deviation in zip(self.directions, self.deviations, strict=True):
            if deviation > WIDEST:
                taking = np.flatnonzero(np.abs(row) > TAKES_PART)
                parts = row[taking] / row[taking][np.argmax(np.abs(row[taking]))]
                undetermined.append(
                    Direction(
                        tuple(names[k] for k in taking), tuple(map(float, parts)), float(deviation)
                    )
                )
        return tuple(undetermined)


def _spread(problem: FitProblem, residuals: FloatArray, jacobian: FloatArray) -> _Spread:
    """Return the spread of the unknowns whose derivatives are given."""
    variance = _variances(problem, residuals, jacobian)
    return _Spread(jacobian, variance, np.maximum(variance, _resolution(problem) ** 2))


def _estimates(
    problem: FitProblem, point: FloatArray, bound: IndexArray, spread: _Spread
) -> tuple[Estimate, ...]:
    """Return the estimate of each unknown; `bound` is 0 for those whose `spread` is known."""
    free = np.flatnonzero(bound == 0)
    resolved, wide = np.zeros((2, len(point)))
    resolved[free] = spread.resolved_deviation
    wide[free] = np.sqrt(np.diag(spread.covariance))
    quantile = float(
        student.ppf(0.5 + 0.5 * CONFIDENCE, max(_degrees_of_freedom(problem, len(free)), 1))
    )
    with np.errstate(over="ignore", invalid="ignore"):
        lower, upper = (problem.points_at(point + sign * quantile * wide) for sign in (-1.0, 1.0))
    values, estimates = problem.points_at(point), []
    for k, unknown in enumerate(problem.unknowns):
        determined = bool(resolved[k] <= WIDEST)
        claims = determined and bound[k] == 0
        interval = (np.nan, np.nan)
        if claims:
            place = int(np.flatnonzero(free == k)[0])
            reach = quantile * wide[k]
            ends = point[k] - reach, point[k] + reach
            rise = reach**2 / spread.inverse[place, place]
            profile = Profile(problem, point, k, free)
            interval = (
                profile.end(-1, rise) if ends[0] < 0.0 else float(lower[k]),
                profile.end(1, rise) if ends[1] > 1.0 else float(upper[k]),
            )
        at_bound = {-1: "lower", 0: "", 1: "upper"}[int(bound[k])]
        estimates.append(Estimate(unknown.name, float(values[k]), *interval, determined, at_bound))
    return tuple(estimates)


def _slopes(problem: FitProblem, point: FloatArray) -> FloatArray:
    """Return the derivative of the SI value of each unknown by its unit coordinate."""
    values = problem.points_at(point)
    return np.array(
        [
            value * np.log(u.upper / u.lower) if u.logarithmic else u.upper - u.lower
            for u, value in zip(problem.unknowns, values, strict=True)
        ]
    )


def _degrees_of_freedom(problem: FitProblem, free: int) -> int:
    return sum(len(m.values) - m.basis.shape[1] for m in problem.measurements) - free


def _variances(problem: FitProblem, residuals: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Return the variance of each scaled residual (n,).

    Samples of one test have a variance of their own; its degrees of freedom are less by its
    baseline and by its share of the unknowns (its leverages). Of heteroscedastic values each has
    the square of its residual over 1 - leverage: HC3 of MacKinnon and White, Journal of
    Econometrics 29 (1985) 305-325. Other values share one variance.
    """
    leverage = np.sum(np.square(np.linalg.svd(jacobian, full_matrices=False)[0]), axis=1)
    pooled = float(np.sum(np.square(residuals))) / max(
        _degrees_of_freedom(problem, jacobian.shape[1]), 1e-12
    )
    parts = []
    for where, m in zip(problem.slices, problem.measurements, strict=True):
        series = residuals[where]
        variance = np.full(len(series), pooled)
        if m.correlated:
            freedom = max(len(series) - m.basis.shape[1] - float(np.sum(leverage[where])), 1e-12)
            variance[:] = float(np.sum(np.square(series))) / freedom * correlation_time(series)
        elif m.heteroscedastic:
            variance = np.square(series / np.maximum(1.0 - leverage[where], 1e-6))
        parts.append(variance)
    return np.concatenate(parts)


def correlation_time(series: FloatArray) -> float:
    """Return how many samples count as one independent one.

    It is 1 + 2 times the sum of the autocorrelation up to its first zero.
    """
    power = float(np.mean(np.square(series)))
    if power == 0.0:
        return 1.0
    spectrum = np.fft.rfft(series, 2 * len(series))
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[: len(series)] / (len(series) * power)
    # white noise shows a correlation of that size by chance
    below = np.flatnonzero(correlation[1:] <= 2.0 / np.sqrt(len(series)))
    end = 1 + int(below[0]) if len(below) else len(series)
    return max(1.0, 1.0 + 2.0 * float(np.sum(correlation[1:end])))


def _resolution(problem: FitProblem) -> FloatArray:
    parts = [
        np.full(len(m.values), RESOLUTION * float(rmse(m.values)) / m.scale)
        for m in problem.measurements
    ]
    return np.concatenate(parts)


def _test_errors(problem: FitProblem, residuals: FloatArray) -> tuple[TestError, ...]:
    errors = []
    for where, m in zip(problem.slices, problem.measurements, strict=True):
        error = float(rmse(residuals[where])) * m.scale
        errors.append(TestError(m.name, error, error / m.largest if m.largest else float("nan")))
    return tuple(errors)


def _computed(problem: FitProblem, point: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """Return computed values with the best baselines added (n,), and the baselines' amounts."""
    computed = problem.evaluate(problem.points_at(point)[None])[0].copy()
    amounts = []
    for where, m in zip(problem.slices, problem.measurements, strict=True):
        if m.baseline is None:
            amounts.append(np.zeros(0))
            continue
        amount = np.linalg.lstsq(m.baseline, m.values - computed[where], rcond=None)[0]
        computed[where] += m.baseline @ amount
        amounts.append(amount)
    return computed, tuple(amounts)


def left_out_errors(fit: Fit, part: Callable[[Sequence[int]], FitProblem]) -> FloatArray:
    """Return the RMSE of each test at the fit to all the other tests (m,).

    The fit without a test is one Gauss-Newton step away from the fit to all tests; for a model that
    is linear in its unknowns this is exact. A step that is long is replaced by a search by least
    squares. The error at its end is that of the model itself.

    Args:
        fit: Fit to all tests, at least two.
        part: Function of the indices of some tests that returns the problem with these tests only.
    """
    problem = fit.problem
    count = len(problem.measurements)
    if not problem.unknowns:
        return np.array([test.rmse for test in fit.tests])
    point = np.clip(problem.coordinates_of(fit.values), 0.0, 1.0)
    residuals = problem.residuals(point[None])[0]
    jacobian, _ = central_differences(problem, point, residuals)
    free = [k for k, estimate in enumerate(fit.estimates) if not estimate.at_bound]
    jacobian = jacobian[:, free]
    information, slope = jacobian.T @ jacobian, jacobian.T @ residuals
    errors = np.empty(count)
    for index, where in enumerate(problem.slices):
        rows = jacobian[where]
        inverse = np.linalg.pinv(information - rows.T @ rows, rcond=SEEN, hermitian=True)
        moved = point.copy()
        moved[free] -= inverse @ (slope - rows.T @ residuals[where])
        if np.max(np.abs(moved - point)) > FAR:
            rest = part([k for k in range(count) if k != index])
            moved = descended(Search(rest), point, MOST_STEPS).point
        left_out = part([index])
        error = rmse(left_out.residuals(np.clip(moved, 0.0, 1.0)[None])[0])
        errors[index] = float(error) * left_out.measurements[0].scale
    return errors
