"""The ways to search: iterated response surfaces as in [A], least squares from many starts, evolution with polish.

All take the same problem, ask the model for many points at once, repeat from their seed, and give the same `Fit`.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy import optimize
from scipy.stats import qmc

from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters.elements import FloatArray
from wm_drake.studies.identification.fit import Fit, assess
from wm_drake.studies.identification.problem import Problem, Progress, rmse

STEP = 1e-5
"""Of one-sided differences during a search, in ranges."""

SAME_END = 1e-3
"""Searches whose RMSE differ by less than this part came to the same end."""

ENDED = 1e-4
"""A search by response surfaces has come to an end if its last region is at most this part of the ranges to either side."""

AGREEING = 2
"""Searches from different starts that came to the same least end: no more are made."""


def silent(fraction: float, least: float) -> None:
    """Progress that nobody looks at."""


@dataclass
class _Count:
    """The problem, with a count of what it is asked and the best point so far."""

    problem: Problem
    evaluations: int = 0
    best: FloatArray | None = None
    least: float = np.inf
    history: list[float] = field(default_factory=list)

    def residuals(self, points: FloatArray) -> FloatArray:
        found = self.problem.residuals(points)
        self.evaluations += len(points)
        errors = rmse(found)
        index = int(np.argmin(errors))
        if errors[index] < self.least:
            self.least, self.best = float(errors[index]), points[index].copy()
        return found

    def errors(self, points: FloatArray) -> FloatArray:
        return rmse(self.residuals(points))

    def fit(self, point: FloatArray, method: str, seed: int, notes: tuple[str, ...] = ()) -> Fit:
        rounds = (*self.history, self.least)
        return assess(self.problem, point, method=method, seed=seed, evaluations=self.evaluations, history=rounds, notes=notes)


def least_squares(
    problem: Problem,
    *,
    seed: int = 0,
    starts: int = 4,
    screened: int = 32,
    progress: Progress = silent,
) -> Fit:
    """Trust-region least squares from the problem's start and the best of many scattered points, until two agree.

    Args:
        problem: What to find.
        seed: Of the scattered points.
        starts: Searches at most.
        screened: Points that are looked at (a power of two), of which the best become starts.
        progress: Told after every step.
    """
    count = _Count(problem)
    p = len(problem.unknowns)
    scattered = _scattered(p, screened, seed)
    order = np.argsort(count.errors(scattered), kind="stable")
    begins = [problem.start, *scattered[order[: starts - 1]]]
    count.history.append(count.least)
    ends: list[tuple[FloatArray, float]] = []
    for index, begin in enumerate(begins):
        if _agreeing(problem, ends) >= AGREEING:
            break

        def step_done(fraction: float, index: int = index) -> None:
            progress((index + fraction) / len(begins), count.least)

        ends.append(_descend(count, begin, step_done))
        count.history.append(count.least)
    note = f"{_agreeing(problem, ends)} of {len(ends)} starts came to the same least RMSE"
    progress(1.0, count.least)
    return count.fit(min(ends, key=lambda end: end[1])[0], "least-squares", seed, (note,))


def _agreeing(problem: Problem, ends: list[tuple[FloatArray, float]]) -> int:
    """How many searches came to the least RMSE of all."""
    if not ends:
        return 0
    errors = np.array([error for _, error in ends])
    floor = 1e-9 * float(rmse(np.concatenate([m.values / m.scale for m in problem.measurements])))
    return int(np.sum(errors <= (1.0 + SAME_END) * errors.min() + floor))


def _scattered(p: int, number: int, seed: int) -> FloatArray:
    return np.asarray(qmc.Sobol(p, rng=np.random.default_rng(seed)).random(number))


def _descend(count: _Count, begin: FloatArray, step_done: Callable[[float], None], most: int = 60) -> tuple[FloatArray, float]:
    """One search by scipy's trust-region reflective method; gives where it ended and its RMSE."""
    steps = 0
    last: tuple[FloatArray, FloatArray] = (np.full(len(begin), np.nan), np.empty(0))

    def residuals(z: FloatArray) -> FloatArray:
        nonlocal last
        last = (z.copy(), np.asarray(count.residuals(z[None])[0]))
        return last[1]

    def jacobian(z: FloatArray) -> FloatArray:
        nonlocal steps
        steps += 1
        step_done(min(1.0, steps / 25))
        here = last[1] if np.array_equal(z, last[0]) else count.residuals(z[None])[0]
        sign = np.where(z > 0.5, -1.0, 1.0)
        found = count.residuals(z + np.diag(STEP * sign))
        return np.asarray(((found - here) / (STEP * sign)[:, None]).T)

    inside = np.clip(begin, 1e-4, 1.0 - 1e-4)
    end = optimize.least_squares(
        residuals, inside, jacobian, bounds=(0.0, 1.0), x_scale=1.0, ftol=1e-9, xtol=1e-9, gtol=1e-14, max_nfev=most
    )
    return end.x, float(rmse(end.fun))


def evolution(
    problem: Problem,
    *,
    seed: int = 0,
    population: int = 12,
    generations: int = 120,
    progress: Progress = silent,
) -> Fit:
    """Differential evolution over the whole range, then least squares from the best point.

    Args:
        problem: What to find.
        seed: Of the evolution.
        population: Members for each unknown.
        generations: At most.
        progress: Told after every generation.
    """
    count = _Count(problem)

    def generation_done(intermediate_result: optimize.OptimizeResult) -> None:
        count.history.append(count.least)
        progress(min(0.95, intermediate_result.nit / generations), count.least)

    optimize.differential_evolution(
        lambda points: count.errors(points.T),
        [(0.0, 1.0)] * len(problem.unknowns),
        popsize=population,
        maxiter=generations,
        tol=0.01,
        polish=False,
        updating="deferred",
        vectorized=True,
        x0=problem.start,
        callback=generation_done,
        rng=np.random.default_rng(seed),
    )
    before = count.least
    assert count.best is not None
    point, _ = _descend(count, count.best, lambda fraction: progress(0.95 + 0.05 * fraction, count.least))
    count.history.append(count.least)
    progress(1.0, count.least)
    note = (
        f"least squares from the best point lowered the RMSE by {100.0 * (1.0 - count.least / before) if before else 0.0:.3g} %"
    )
    return count.fit(point, "evolution", seed, (note,))


def response_surface(
    problem: Problem,
    *,
    seed: int = 0,
    screened: int = 32,
    rounds: int = 60,
    progress: Progress = silent,
) -> Fit:
    """Iterated response surfaces, the method of [A] section 3.

    In each round the model is evaluated at designed points of a region, a quadratic surface is fitted to the mean square
    error, and the region moves to the least point of the surface, checked by the model, or to the best designed point. It
    keeps its size while it moves, and shrinks where it stays; a search ends when the region is a millionth of the ranges.

    Args:
        problem: What to find.
        seed: Of the scattered points.
        screened: Points (a power of two) that are looked at beside the problem's start; the best is the first centre.
        rounds: At most.
        progress: Told after every round.
    """
    count = _Count(problem)
    p = len(problem.unknowns)
    design = surface_design(p)
    begins = np.concatenate([problem.start[None], _scattered(p, screened, seed)])
    errors = count.errors(begins)
    centre, half = begins[np.argmin(errors)], np.full(p, 0.5)
    centre_error = float(errors.min())
    count.history.append(count.least)
    done = 0
    while done < rounds and half.max() > 1e-6:
        done += 1
        points = np.clip(centre + half * design, 0.0, 1.0)
        values = np.square(count.errors(points))
        surface = QuadraticSurface((points - centre) / half, values, centre_error**2)
        least = surface.least_point(np.maximum(-1.0, -centre / half), np.minimum(1.0, (1.0 - centre) / half))
        target = np.clip(centre + half * least, 0.0, 1.0)
        target_error = float(count.errors(target[None])[0])
        best = int(np.argmin(values))
        if values[best] < target_error**2:
            target, target_error = points[best], float(np.sqrt(values[best]))
        half = half * _resize(centre, half, target, target_error < centre_error)
        if target_error < centre_error:
            centre, centre_error = target, target_error
        count.history.append(count.least)
        progress(done / rounds, count.least)
    progress(1.0, count.least)
    note = f"{done} rounds, last region {2.0 * half.max():.2g} of the ranges"
    fit = count.fit(centre, "response-surface", seed, (note,))
    if half.max() > ENDED:
        return fit.without_intervals("the search had not come to an end: no optimum, and no intervals are claimed")
    return fit


def _resize(centre: FloatArray, half: FloatArray, target: FloatArray, better: bool) -> float:
    """Factor of the region: kept while the target is at its rim, less the nearer it is to the centre."""
    moved = float(np.max(np.abs(target - centre) / half))
    if not better:
        return 0.5
    return 1.0 if moved > 0.9 else 0.6 if moved > 0.5 else 0.4


def surface_design(p: int) -> FloatArray:
    """Points for a quadratic surface of p variables in [-1, 1]: both sides of each axis, four corners of each pair."""
    points = [sign * np.eye(p)[k] for k in range(p) for sign in (-1.0, 1.0)]
    for i, j in itertools.combinations(range(p), 2):
        for a, b in itertools.product((-1.0, 1.0), repeat=2):
            point = np.zeros(p)
            point[i], point[j] = a, b
            points.append(point)
    return np.array(points)


class QuadraticSurface:
    """Least-squares quadratic through values at points, exact at the centre."""

    def __init__(self, points: FloatArray, values: FloatArray, at_centre: float) -> None:
        """Points (k, p) about the centre, values (k,), the value at the centre."""
        p = points.shape[1]
        self._pairs = list(itertools.combinations_with_replacement(range(p), 2))
        products = np.stack([points[:, i] * points[:, j] for i, j in self._pairs], axis=1)
        near = 1.0 / np.sqrt(1e-12 + np.abs(values) + 1e-3 * np.max(np.abs(values)))  # low values matter most
        rows = np.concatenate([points, products], axis=1) * near[:, None]
        found = np.linalg.lstsq(rows, (values - at_centre) * near, rcond=None)[0]
        self.gradient = found[:p]
        self.hessian = np.zeros((p, p))
        for coefficient, (i, j) in zip(found[p:], self._pairs, strict=True):
            self.hessian[i, j] += coefficient
            self.hessian[j, i] += coefficient

    def least_point(self, lower: FloatArray, upper: FloatArray) -> FloatArray:
        """Where the surface is least between bounds (p,), searched from its centre and from the ends of its axes."""
        size = float(np.max(np.abs(self.hessian), initial=1e-300))

        def value(x: FloatArray) -> tuple[float, FloatArray]:
            bent = self.hessian @ x
            return float((self.gradient + 0.5 * bent) @ x) / size, (self.gradient + bent) / size

        # TNC: unlike L-BFGS-B it calls no threaded linear algebra, whose threads cost seconds on numbers this few
        begins = [np.zeros(len(lower)), 0.9 * lower, 0.9 * upper]
        ends = [
            optimize.minimize(value, x, jac=True, method="TNC", bounds=list(zip(lower, upper, strict=True))) for x in begins
        ]
        return np.asarray(min(ends, key=lambda end: end.fun).x)


METHODS: dict[str, Callable[..., Fit]] = {
    "response-surface": response_surface,
    "least-squares": least_squares,
    "evolution": evolution,
}


def identify(problem: Problem, method: str = "least-squares", *, seed: int = 0, progress: Progress = silent) -> Fit:
    """Searches by the method of a name.

    Raises:
        InputError: no such method.
    """
    if method not in METHODS:
        raise input_error(f"no method '{method}'{nearest_names(method, METHODS)}", where="--method")
    return METHODS[method](problem, seed=seed, progress=progress)
