"""Iterated response surfaces, the method of [A] section 3.

Each round has designed points, a quadratic surface, a move and a new region. The region is not a
box along the unknowns: its axes follow the valley of the last surface, with lengths along which the
surface bends alike. In a narrow valley across the unknowns a box would soon be as small as the
valley is narrow, and would need as many rounds as the valley is long in such steps.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.fitting.problem import Progress
from wm_drake.studies.fitting.search import Optimum, Search, silent, underway
from wm_drake.studies.fitting.starts import scattered

WIDEST = 0.5
"""Longest half axis of a region, in ranges; all half axes of the first region."""

SMALLEST = 1e-6
"""A search ends if no half axis is longer, in ranges."""

FLAT = 1e-2
"""A search also ends if no point of the region is worse by more than this part of the cost of one
standard error, which is the mean square error per value. The region is then a tenth of a standard
error to either side, and its centre is nearer still."""

STRETCH = 3.0
"""Largest factor by which an axis is stretched or shortened against the others in a round."""

USUAL_ROUNDS = 20

SLENDEREST = 1e3
"""Largest quotient of the longest and the shortest axis."""


def response_surface(
    search: Search,
    *,
    seed: int = 0,
    screened: int = 32,
    rounds: int = 80,
    progress: Progress = silent,
) -> Optimum:
    """Search by iterated response surfaces.

    In each round the model is evaluated at designed points of a region, a quadratic surface is
    fitted to the mean square error, and the region moves to the least point of the surface, checked
    by the model, or to the best designed point. It grows where the surface predicted a move to its
    rim, and shrinks where it stays.

    Args:
        screened: Points (a power of two) that are evaluated beside the problem's start; the best is
            the first centre.
        rounds: Rounds at most.
        progress: Called after every round.
    """
    design = surface_design(len(search.problem.unknowns))
    region = _first_region(search, seed, screened)
    done, ended = 0, False
    while done < rounds and not ended:
        done += 1
        region, ended = _round(search, region, design)
        search.round_done()
        progress(underway(done, USUAL_ROUNDS), search.least)
    note = f"{done} rounds, last region {2.0 * region.longest:.2g} of the ranges"
    return Optimum(region.centre, float(np.sqrt(region.value)), search.evaluations, note, ended)


@dataclass(frozen=True, eq=False)
class SurfaceRegion:
    """Region where a surface is fitted: centre + axes x, each |x| <= 1, within the ranges.

    Attributes:
        centre: In unit coordinates (p,).
        value: Mean square error at the centre.
        axes: Half axes as columns (p, p), perpendicular to each other.
    """

    centre: FloatArray
    value: float
    axes: FloatArray

    @property
    def longest(self) -> float:
        """Length of the longest half axis, in ranges."""
        return float(np.max(np.linalg.norm(self.axes, axis=0)))

    def designed(self, design: FloatArray) -> FloatArray:
        """Return the points (k, p) of a design (k, p) along the axes, all within the ranges.

        A point beyond them goes half as far to the other side instead, if that is less beyond:
        points that are moved back to a bound lie on it together and determine little of the
        surface. Most searches take fewer rounds then.
        """
        ahead, back = self.centre + design @ self.axes.T, self.centre - 0.5 * design @ self.axes.T
        beyond = [
            np.sum(np.abs(points - np.clip(points, 0.0, 1.0)), axis=1) for points in (ahead, back)
        ]
        return np.clip(np.where((beyond[1] < beyond[0])[:, None], back, ahead), 0.0, 1.0)

    def points(self, places: FloatArray) -> FloatArray:
        """Return points (k, p) at places along the axes, moved back into the ranges."""
        return np.clip(self.centre + places @ self.axes.T, 0.0, 1.0)

    def places(self, points: FloatArray) -> FloatArray:
        """Return the places of points, the inverse of `points`."""
        return np.asarray(np.linalg.solve(self.axes, (points - self.centre).T).T)

    def moved(self, centre: FloatArray, value: float) -> "SurfaceRegion":
        """Return the region about another centre."""
        return SurfaceRegion(centre, value, self.axes)

    def reshaped(self, hessian: FloatArray, factor: float) -> "SurfaceRegion":
        """Return a region larger by a factor, with axes along which a surface bends more alike.

        Args:
            hessian: Hessian of the surface (p, p), by places.
            factor: Factor of its size.
        """
        bends, directions = np.linalg.eigh(hessian)
        bend = np.abs(bends) + 1e-12 * np.max(np.abs(bends)) + 1e-300
        stretch = np.clip(np.sqrt(np.exp(np.mean(np.log(bend))) / bend), 1.0 / STRETCH, STRETCH)
        perpendicular, lengths, _ = np.linalg.svd(factor * (self.axes @ directions) * stretch)
        lengths = np.minimum(lengths, WIDEST)
        return SurfaceRegion(
            self.centre, self.value, perpendicular * np.maximum(lengths, lengths.max() / SLENDEREST)
        )


def _first_region(search: Search, seed: int, screened: int) -> SurfaceRegion:
    """Return the whole ranges, about the best of the problem's start and scattered points."""
    p = len(search.problem.unknowns)
    begins = np.concatenate([search.problem.start[None], scattered(search, screened, seed)])
    values = np.square(search.costs(begins))
    search.round_done()
    best = int(np.argmin(values))
    return SurfaceRegion(begins[best], float(values[best]), WIDEST * np.eye(p))


def _round(search: Search, region: SurfaceRegion, design: FloatArray) -> tuple[SurfaceRegion, bool]:
    """Return the region after a round, and whether the search ends."""
    points = region.designed(design)
    places, values = region.places(points), np.square(search.costs(points))
    surface = QuadraticSurface(places, values, region.value)
    least = surface.least_place(region)
    target = region.points(least)
    value = float(search.costs(target[None])[0]) ** 2
    foretold = region.value - value > 0.5 * -surface.rise(least) > 0.0
    best = int(np.argmin(values))
    if values[best] < value:
        target, value, least = points[best], float(values[best]), places[best]
    better = value < region.value
    factor = _resize(float(np.max(np.abs(least))), better, foretold)
    samples = sum(len(m.values) for m in search.problem.measurements)
    flat = float(np.max(values)) - region.value <= FLAT * region.value / samples
    after = (region.moved(target, value) if better else region).reshaped(surface.hessian, factor)
    return after, flat or after.longest <= SMALLEST


def _resize(moved: float, better: bool, foretold: bool) -> float:
    """Return the factor of a region from the move of its centre: larger near the rim."""
    if not better:
        return 0.5
    if moved > 0.9:
        return 2.0 if foretold else 1.0
    return 0.6 if moved > 0.5 else 0.4


def surface_design(p: int) -> FloatArray:
    """Return points for a quadratic surface of p variables in [-1, 1].

    They are both ends of each axis and a corner of each pair: with the centre, as many as the
    surface has coefficients. More points a round saved no rounds in trials.
    """
    points = [sign * np.eye(p)[k] for k in range(p) for sign in (-1.0, 1.0)]
    for number, (i, j) in enumerate(itertools.combinations(range(p), 2)):
        point = np.zeros(p)
        point[i], point[j] = (-1.0) ** number, (-1.0) ** (number + i + j)
        points.append(point)
    return np.array(points)


class QuadraticSurface:
    """Least-squares quadratic through values at places, exact at the centre."""

    def __init__(self, places: FloatArray, values: FloatArray, at_centre: float) -> None:
        """Fit the surface.

        Args:
            places: Places (k, p) about the centre.
            values: Values there (k,).
            at_centre: Value at the centre.
        """
        p = places.shape[1]
        self._pairs = list(itertools.combinations_with_replacement(range(p), 2))
        products = np.stack([places[:, i] * places[:, j] for i, j in self._pairs], axis=1)
        # low values matter most
        near = 1.0 / np.sqrt(1e-300 + np.abs(values) + 1e-3 * np.max(np.abs(values)))
        rows = np.concatenate([places, products], axis=1) * near[:, None]
        coefficients = np.linalg.lstsq(rows, (values - at_centre) * near, rcond=None)[0]
        self.gradient = coefficients[:p]
        self.hessian = np.zeros((p, p))
        for coefficient, (i, j) in zip(coefficients[p:], self._pairs, strict=True):
            self.hessian[i, j] += coefficient
            self.hessian[j, i] += coefficient

    def rise(self, place: FloatArray) -> float:
        """Return the rise of the surface from its centre to a place (p,)."""
        return float((self.gradient + 0.5 * self.hessian @ place) @ place)

    def least_place(self, region: SurfaceRegion) -> FloatArray:
        """Return the least place of a region, searched from its centre and two opposite corners."""
        size = max(
            float(np.max(np.abs(self.hessian))), float(np.max(np.abs(self.gradient))), 1e-300
        )
        within = optimize.LinearConstraint(region.axes, -region.centre, 1.0 - region.centre)
        ends = [
            optimize.minimize(
                lambda x: self.rise(x) / size,
                begin,
                jac=lambda x: (self.gradient + self.hessian @ x) / size,
                method="SLSQP",
                bounds=[(-1.0, 1.0)] * len(begin),
                constraints=within,
                options={"ftol": 1e-9},
            ).x
            for begin in region.places(
                region.points(np.array([[0.0], [-0.9], [0.9]]) * np.ones(len(self.gradient)))
            )
        ]
        return min(
            (np.clip(end, -1.0, 1.0) for end in ends if np.all(np.isfinite(end))), key=self.rise
        )
