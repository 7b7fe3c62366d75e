"""Assessment of a fit: bounds that were hit, covariance, intervals."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from wm_drake.parameters.types import FloatArray, IndexArray
from wm_drake.studies.fitting.fit import (
    Direction,
    Estimate,
    Fit,
    Linearized,
    SearchLog,
    TestError,
)
from wm_drake.studies.fitting.problem import FitProblem, Rows, Unknown, rmse
from wm_drake.studies.fitting.profile import Profile
from wm_drake.studies.fitting.search import Search, smooth_slopes

CONFIDENCE = 0.95

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


def assess(problem: FitProblem, point: FloatArray, log: SearchLog) -> Fit:
    """Return the fit at the point (p,) where a search ended, in coordinates.

    The covariance is the sandwich of generalised least squares: each test has its own variance,
    larger by the correlation of its samples where they follow each other. So a densely sampled test
    does not count for more than it contains. Errors of known deviations keep theirs, as priors and
    what is known beside them do; with known ones alone, the covariance is that of the posterior
    (Laplace). An interval that would leave the bounds ends by its profile
    (`wm_drake.studies.fitting.profile`), that of an unknown with a prior at the bound.

    Args:
        point: Where the search ended.
        log: Course of the search; the evaluations of the assessment are added to it.
    """
    rows = problem.evaluated(point[None])
    residuals = rows.exact[0, : problem.count]
    jacobian, evaluated = _derivatives(problem, point, rows)
    jacobian = np.delete(jacobian, slice(problem.count, problem.count + rows.wished), axis=0)
    bound = _bounds_hit(problem, point, _spread(problem, residuals, jacobian))
    free = np.flatnonzero((bound == 0) | problem.has_prior)
    spread = _spread(problem, residuals, jacobian, free)
    p = len(problem.unknowns)
    slope = _slopes(problem, point)[free]
    covariance = np.full((p, p), np.nan)
    covariance[np.ix_(free, free)] = spread.covariance * np.outer(slope, slope)
    computed, baselines = _computed(problem, point)
    return Fit(
        problem=problem,
        log=replace(log, evaluations=log.evaluations + evaluated + 2),
        estimates=_estimates(problem, point, bound, spread, free),
        rmse=float(rmse(residuals)),
        tests=_test_errors(problem, residuals),
        computed=computed,
        baselines=baselines,
        covariance=covariance,
        condition=spread.condition,
        undetermined=spread.undetermined([problem.unknowns[k] for k in free]),
        linear=Linearized(point, jacobian, problem.count),
    )


def evaluated(problem: FitProblem) -> Fit:
    """Return the fit of a problem without unknowns: its errors only."""
    note = "all numbers are given: nothing was searched"
    return assess(problem, np.zeros(0), SearchLog("evaluation", notes=(note,)))


def _bounds_hit(problem: FitProblem, point: FloatArray, spread: "_Spread") -> IndexArray:
    """Return which unknowns are at their lower (-1) or upper (1) bound; 0 for undetermined ones.

    Args:
        point: Where the search ended (p,), in coordinates.
        spread: Spread of all unknowns. What it does not determine is at a bound by chance: the
            search may end anywhere in a flat valley.
    """
    place, near = (point - problem.lower) / problem.ranges, problem.descent.near
    bound = np.where(place < near, -1, np.where(place > 1.0 - near, 1, 0))
    by_chance = (spread.resolved_deviation > WIDEST) & ~problem.has_prior
    return np.where(by_chance, 0, bound)


def _derivatives(problem: FitProblem, point: FloatArray, rows: Rows) -> tuple[FloatArray, int]:
    """Return the derivatives (m, p) of the rows by the unknowns, and how many points it took.

    They are central differences, or those of the search where rows have kinks.

    Args:
        point: In coordinates (p,).
        rows: Rows there.
    """
    step = problem.descent.difference
    if not len(point):
        return np.zeros((rows.exact.shape[1], 0)), 0
    if step is None:
        steps = problem.descent.steps[0]
        return smooth_slopes(Search(problem), point, rows.smooth, steps), len(point)
    return central_differences(problem, point, rows.exact[0], step)


def central_differences(
    problem: FitProblem, point: FloatArray, rows: FloatArray, step: float = 1e-3
) -> tuple[FloatArray, int]:
    """Return the derivatives of the rows by the unknowns, in coordinates.

    They are one-sided at a bound. They are also one-sided at a corner, where a step to one side has
    nearly no effect that the other unknowns cannot take back: the friction force of a damper that
    just does not slip is such a corner. The data do not limit the unknown to that side, and a mean
    of both sides would claim that they do.
    The step to that side is long, because a short one shows the errors of integration instead.

    Args:
        point: In coordinates (p,).
        rows: Rows at the point (m,).
        step: As a part of the range.

    Returns:
        Derivatives (m, p), and how many points were evaluated.
    """
    p = len(point)
    steps = step * np.diag(problem.ranges)
    sides = np.concatenate([point + steps, point - steps])
    sides = np.clip(sides, problem.lower, problem.upper)
    above, below = problem.evaluated(sides).exact.reshape(2, p, -1)
    width = np.diag(sides[:p] - sides[p:])
    slopes = (above - below) / width[:, None]
    flat = _flat_sides(rows, above, below)
    at_bound = (point - problem.lower < step * problem.ranges) | (
        problem.upper - point < step * problem.ranges
    )
    flat = np.where(at_bound | problem.has_prior, 0.0, flat)
    corners = np.flatnonzero(flat)
    if len(corners):
        far = point + WIDEST * np.diag(flat * problem.ranges)[corners]
        far = np.clip(far, problem.lower, problem.upper)
        length = np.sum(far - point, axis=1)
        slopes[corners] = (problem.evaluated(far).exact - rows) / length[:, None]
    return np.asarray(slopes.T), len(sides) + len(corners)


def _flat_sides(rows: FloatArray, above: FloatArray, below: FloatArray) -> FloatArray:
    """Return for each unknown the side, 1 or -1, where a step has nearly no effect; 0 if none.

    Of an effect only that part counts which no change of the other unknowns has.
    """
    side = np.zeros(len(above))
    for k in range(len(above)):
        others = np.delete(above - below, k, axis=0)
        steps = np.stack([above[k], below[k]]) - rows
        remainder = steps - steps @ np.linalg.pinv(others, rcond=SAME) @ others
        upwards, downwards = np.linalg.norm(remainder, axis=1)
        side[k] = float(upwards < FLAT_SIDE * downwards) - float(downwards < FLAT_SIDE * upwards)
    return side


class _Spread:
    """Spread of the free unknowns in ranges, from the singular values of the Jacobian."""

    def __init__(
        self, jacobian: FloatArray, variance: FloatArray, resolution: FloatArray, freedom: float
    ) -> None:
        self.freedom = freedom
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

    def undetermined(self, unknowns: Sequence[Unknown]) -> tuple[Direction, ...]:
        """Return the directions along which neither data nor priors determine the unknowns."""
        undetermined = []
        for row, deviation in zip(self.directions, self.deviations, strict=True):
            if deviation > WIDEST:
                taking = np.flatnonzero(np.abs(row) > TAKES_PART).tolist()
                parts = row[taking] / row[taking][np.argmax(np.abs(row[taking]))]
                if all(unknowns[k].prior for k in taking):
                    continue
                names = tuple(unknowns[k].name for k in taking)
                undetermined.append(Direction(names, tuple(map(float, parts)), float(deviation)))
        return tuple(undetermined)


def _spread(
    problem: FitProblem,
    residuals: FloatArray,
    jacobian: FloatArray,
    free: IndexArray | slice = slice(None),
) -> _Spread:
    """Return the spread of the free unknowns; all by default.

    Args:
        residuals: Of the measurements (n,).
        jacobian: Derivatives (m, p) of all rows but those of what is wished, by coordinates.
        free: Indices of the unknowns whose spread is wanted.
    """
    by_range = (jacobian * problem.ranges)[:, free]
    leverages = _leverages(problem, by_range)
    variance = np.ones(len(jacobian))
    variance[: problem.count] = _variances(problem, residuals, leverages)
    resolution = np.zeros(len(jacobian))
    resolution[: problem.count] = _resolution(problem)
    freedom = _freedom(problem, leverages)
    return _Spread(by_range, variance, np.maximum(variance, resolution**2), freedom)


def _estimates(
    problem: FitProblem, point: FloatArray, bound: IndexArray, spread: _Spread, free: IndexArray
) -> tuple[Estimate, ...]:
    """Return the estimate of each unknown; those of `free` have a `spread`."""
    resolved, wide = np.zeros((2, len(point)))
    resolved[free] = spread.resolved_deviation
    wide[free] = np.sqrt(np.diag(spread.covariance)) * problem.ranges[free]
    determined = (resolved <= WIDEST) | problem.has_prior
    quantile = float(student.ppf(0.5 + 0.5 * CONFIDENCE, max(spread.freedom, 1.0)))
    with np.errstate(over="ignore", invalid="ignore"):
        lower, upper = (problem.points_at(point + sign * quantile * wide) for sign in (-1.0, 1.0))
    values, estimates = problem.points_at(point), []
    for k, unknown in enumerate(problem.unknowns):
        interval = (np.nan, np.nan)
        if unknown.prior is not None and bound[k] == 0:
            interval = max(float(lower[k]), unknown.lower), min(float(upper[k]), unknown.upper)
        elif determined[k] and bound[k] == 0:
            place = int(np.flatnonzero(free == k)[0])
            reach = quantile * wide[k]
            ends = point[k] - reach, point[k] + reach
            rise = (reach / problem.ranges[k]) ** 2 / spread.inverse[place, place]
            profile = Profile(problem, point, k, free)
            interval = (
                profile.end(-1, rise) if ends[0] < 0.0 else float(lower[k]),
                profile.end(1, rise) if ends[1] > 1.0 else float(upper[k]),
            )
        at_bound = {-1: "lower", 0: "", 1: "upper"}[int(bound[k])]
        known = bool(determined[k])
        estimates.append(Estimate(unknown.name, float(values[k]), *interval, known, at_bound))
    return tuple(estimates)


def _slopes(problem: FitProblem, point: FloatArray) -> FloatArray:
    """Return the derivative of the SI value of each unknown by its place in the range."""
    values = problem.points_at(point)
    return np.array(
        [
            value * np.log(u.upper / u.lower) if u.logarithmic else u.upper - u.lower
            for u, value in zip(problem.unknowns, values, strict=True)
        ]
    )


def _leverages(problem: FitProblem, jacobian: FloatArray) -> FloatArray:
    """Return the part of the unknowns that each measured value determines (n,)."""
    left = np.linalg.svd(jacobian, full_matrices=False)[0]
    return np.asarray(np.sum(np.square(left), axis=1)[: problem.count])


def _freedom(problem: FitProblem, leverages: FloatArray) -> float:
    """Return the degrees of freedom of the errors whose deviation is not known."""
    estimated = [
        len(m.values) - m.basis.shape[1] - float(np.sum(leverages[where]))
        for where, m in zip(problem.slices, problem.measurements, strict=True)
        if m.errors != "known"
    ]
    return sum(estimated) if estimated else np.inf


def _variances(problem: FitProblem, residuals: FloatArray, leverages: FloatArray) -> FloatArray:
    """Return the variance of each scaled residual (n,).

    Samples of one test have a variance of their own; its degrees of freedom are less by its
    baseline and by its share of the unknowns (its leverages). Of values with errors of their own,
    each has the square of its residual over 1 - leverage: HC3 of MacKinnon and White, Journal of
    Econometrics 29 (1985) 305-325. Other values share one variance.
    """
    alike = np.concatenate(
        [np.full(len(m.values), m.errors != "known") for m in problem.measurements]
    )
    freedom = max(_freedom(problem, leverages), 1e-12)
    pooled = float(np.sum(np.square(residuals[alike]))) / freedom
    parts = []
    for where, m in zip(problem.slices, problem.measurements, strict=True):
        series = residuals[where]
        variance = np.full(len(series), pooled)
        if m.errors == "known":
            variance[:] = 1.0
        elif m.errors == "correlated":
            freedom = max(len(series) - m.basis.shape[1] - float(np.sum(leverages[where])), 1e-12)
            variance[:] = float(np.sum(np.square(series))) / freedom * correlation_time(series)
        elif m.errors == "each":
            variance = np.square(series / np.maximum(1.0 - leverages[where], 1e-6))
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
    computed = problem.values(point[None]).values[0].copy()
    amounts = []
    for where, m in zip(problem.slices, problem.measurements, strict=True):
        if m.baseline is None:
            amounts.append(np.zeros(0))
            continue
        amount = np.linalg.lstsq(m.baseline, m.values - computed[where], rcond=None)[0]
        computed[where] += m.baseline @ amount
        amounts.append(amount)
    return computed, tuple(amounts)
