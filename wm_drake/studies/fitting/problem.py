"""Problem of a fit: unknown numbers, and residuals that a search makes small.

No problem depends on an engine: its model is any function of the unknowns. It is evaluated at many
points at once, so that it can run them side by side; `point_by_point` makes it from a function of
one point. Searches, intervals and profiles use the interface `CostProblem` only.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple, TypeAlias

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit

EvaluatePoints: TypeAlias = Callable[[FloatArray], FloatArray]
"""Points (k, p), in SI -> computed values (k, n), those of all measurements in a row.

A row of NaN means that the model fails at the point."""

Progress: TypeAlias = Callable[[float, float], None]
"""Function that is called with the fraction done and the least cost so far."""

FAILED = 1e3
"""Residual of a point where the model fails, in largest measured values: worse than any other."""


PURE_NUMBER = Unit("dimensionless", "dimensionless")


@dataclass(frozen=True)
class Unknown:
    """An unknown number.

    Attributes:
        name: Name for users; a key path where it is a number of a machine.
        lower, upper: Bounds of the search. [SI]
        unit: Unit in SI and as people read it; a pure number by default.
        start: A first guess; the middle of the bounds if None. [SI]
        logarithmic: Searched by its logarithm: for numbers of unknown order of magnitude.
        prior: Expected value and its standard deviation; None if nothing is known. [SI]
    """

    name: str
    lower: float
    upper: float
    unit: Unit = PURE_NUMBER
    start: float | None = None
    logarithmic: bool = False
    prior: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Check bounds and start.

        Raises:
            InputError: The bounds are no range, or the start is outside of them.
        """
        if not (np.isfinite(self.lower) and np.isfinite(self.upper) and self.lower < self.upper):
            raise input_error(
                f"bounds {self._shown(self.lower)} to {self._shown(self.upper)} are not a range",
                key=self.name,
            )
        if self.logarithmic and self.lower <= 0.0:
            raise input_error("a logarithmic search needs a lower bound > 0", key=self.name)
        if self.start is not None and not self.lower <= self.start <= self.upper:
            allowed = f"{self._shown(self.lower)} to {self._shown(self.upper)}"
            raise input_error(
                f"start {self._shown(self.start)} is outside the bounds {allowed}", key=self.name
            )

    def _shown(self, value: float) -> str:
        return (
            f"{self.unit.from_si(value):.6g} {self.unit.shown}"
            if np.isfinite(value)
            else str(value)
        )


class Residuals(NamedTuple):
    """Residuals (k, n) at points, and a smooth substitute of them (k, n) for their derivatives.

    Both have the same derivatives except at kinks of the residuals. They are one array where the
    residuals have no kinks.
    """

    exact: FloatArray
    smooth: FloatArray


@dataclass(frozen=True)
class Descent:
    """How finely least squares go down in a problem.

    Attributes:
        steps: Step sizes of the finite differences, in coordinates. Where a search with one of them
            stops, it goes on with the next, until none reduces the cost.
        side: Differences are forward up to this part of the range below the upper bound, backward
            above, where the step itself is not longer.
        inside: Distance of a first point from the bounds, as a part of the range.
        cost, point, gradient: Tolerances by which scipy ends a search.
    """

    steps: tuple[float, ...]
    side: float
    inside: float
    cost: float
    point: float
    gradient: float


SMOOTH = Descent((1e-5,), 0.5, 1e-4, 1e-9, 1e-9, 1e-14)
"""Descent where the residuals are smooth."""

KINKED = Descent((0.1, 0.3, 0.03), 0.0, 1e-6, 1e-3, 1e-4, 1e-6)
"""Descent where the residuals have kinks, such as amplitudes (largest values). Coarse differences
of the smooth residuals pass a kink at which fine ones would stop. The steps are in standard
deviations of the prior; the first one is larger than the noise of amplitudes that comes from
sampling."""


class CostProblem(ABC):
    """Problem of finding the unknowns with the least cost.

    A search moves in coordinates. The coordinate of an unknown (or of its logarithm) goes from 0 at
    the lower to 1 at the upper bound. That of an unknown with a prior is its distance from the
    expected value in standard deviations.
    """

    unknowns: tuple[Unknown, ...]
    descent: ClassVar[Descent] = SMOOTH

    @abstractmethod
    def evaluated(self, coordinates: FloatArray) -> Residuals:
        """Return the residuals at points (k, p)."""

    @abstractmethod
    def costs_of(self, rows: FloatArray) -> FloatArray:
        """Return what a search makes small (k,), of `rows` (k, m)."""

    def rows(self, residuals: FloatArray, coordinates: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return the numbers whose squares count (k, m), of residuals (k, n) at points (k, p)."""
        return residuals

    def costs(self, residuals: FloatArray, coordinates: FloatArray) -> FloatArray:
        """Return what a search makes small (k,), of residuals (k, n) at points (k, p)."""
        return self.costs_of(self.rows(residuals, coordinates))

    def residuals(self, coordinates: FloatArray) -> FloatArray:
        """Return the residuals (k, n) at points (k, p)."""
        return self.evaluated(coordinates).exact

    @cached_property
    def lower(self) -> FloatArray:
        """Lower bounds (p,)."""
        return self.coordinates_of(np.array([u.lower for u in self.unknowns]))

    @cached_property
    def upper(self) -> FloatArray:
        """Upper bounds (p,)."""
        return self.coordinates_of(np.array([u.upper for u in self.unknowns]))

    @property
    def start(self) -> FloatArray:
        """First guess (p,)."""
        known = [u.start is not None for u in self.unknowns]
        guess = self.coordinates_of(
            np.array([u.lower if u.start is None else u.start for u in self.unknowns])
        )
        return np.where(known, guess, 0.5 * (self.lower + self.upper))

    def coordinates_of(self, points: FloatArray) -> FloatArray:
        """Return the coordinates of points (..., p) in SI."""
        origin, size = self._frame
        return np.asarray((self._straight(points) - origin) / size)

    def points_at(self, coordinates: FloatArray) -> FloatArray:
        """Return the points in SI at coordinates (..., p), the inverse of `coordinates_of`."""
        origin, size = self._frame
        straight = origin + np.asarray(coordinates) * size
        return np.where(
            self._logarithmic, np.exp(np.where(self._logarithmic, straight, 0.0)), straight
        )

    def restricted(self, free: Sequence[int] | np.ndarray, held: FloatArray) -> "CostProblem":
        """Return the problem of some unknowns with all others held.

        Args:
            free: Indices of the unknowns that are searched.
            held: Coordinates (p,), of which those of the other unknowns are used.
        """
        return _Restricted(self, np.asarray(free, dtype=int), held)

    @cached_property
    def _logarithmic(self) -> np.ndarray:
        return np.array([u.logarithmic for u in self.unknowns], dtype=bool)

    @cached_property
    def _frame(self) -> tuple[FloatArray, FloatArray]:
        """Origin and unit of the coordinates."""
        lower, upper = (
            self._straight(np.array([getattr(u, side) for u in self.unknowns]))
            for side in ("lower", "upper")
        )
        pairs = [
            u.prior or (low, high - low)
            for u, low, high in zip(self.unknowns, lower, upper, strict=True)
        ]
        origin, size = np.array(pairs).reshape(-1, 2).T
        return origin, size

    def _straight(self, points: FloatArray) -> FloatArray:
        safe = np.where(self._logarithmic, points, 1.0)
        return np.where(self._logarithmic, np.log(safe), points)


@dataclass(frozen=True, eq=False)
class _Restricted(CostProblem):
    """Problem of some unknowns of another one; see `CostProblem.restricted`."""

    whole: CostProblem
    free: np.ndarray
    held: FloatArray

    @property
    def unknowns(self) -> tuple[Unknown, ...]:  # type: ignore[override]
        """Unknowns that are searched."""
        return tuple(self.whole.unknowns[k] for k in self.free)

    def evaluated(self, coordinates: FloatArray) -> Residuals:
        """Return the residuals at points (k, p)."""
        full = np.tile(self.held, (len(coordinates), 1))
        full[:, self.free] = coordinates
        return self.whole.evaluated(full)

    @property
    def descent(self) -> Descent:  # type: ignore[override]
        """Descent of the whole problem."""
        return self.whole.descent

    def rows(self, residuals: FloatArray, coordinates: FloatArray) -> FloatArray:
        """Return the rows of the whole problem, with the priors of the free unknowns only."""
        return self.whole.rows(residuals, coordinates)

    def costs_of(self, rows: FloatArray) -> FloatArray:
        """Return the costs of the whole problem."""
        return self.whole.costs_of(rows)


@dataclass(frozen=True, eq=False)
class PriorProblem(CostProblem):
    """Problem of residuals in standard deviations, and of unknowns that all have a prior.

    The cost is half the sum of the squares of residuals and coordinates: the negative logarithm of
    the posterior density but for a constant. It is infinite if a residual is NaN.
    """

    unknowns: tuple[Unknown, ...]
    evaluate: Callable[[FloatArray], Residuals]
    """Points (k, p), in SI -> residuals."""

    descent: ClassVar[Descent] = KINKED

    def evaluated(self, coordinates: FloatArray) -> Residuals:
        """Return the residuals of the data at points (k, p)."""
        return self.evaluate(self.points_at(coordinates))

    def rows(self, residuals: FloatArray, coordinates: FloatArray) -> FloatArray:
        """Return residuals, then coordinates: the distances from the expected values."""
        return np.hstack([residuals, coordinates])

    def costs_of(self, rows: FloatArray) -> FloatArray:
        """Return half the sums of squares (k,)."""
        costs = 0.5 * np.sum(np.square(rows), axis=1)
        return np.where(np.isfinite(costs), costs, np.inf)


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measured values of one test.

    Attributes:
        values: Measured values (n,). [any unit, the model's]
        baseline: Columns (n, q) that the instrument may have added in unknown amounts, such as an
            offset or a drift; the best amount of each is taken out of every residual. None for an
            instrument without such errors.
        scale: Expected error, by which residuals are divided before tests are put together.
        correlated: Whether errors of neighbouring values are correlated (samples over time), which
            widens the intervals.
        heteroscedastic: Whether each value has an error of its own size, for example a part of the
            value. Large values then do not count for more than their errors allow.
    """

    name: str
    values: FloatArray
    baseline: FloatArray | None = None
    scale: float = 1.0
    correlated: bool = False
    heteroscedastic: bool = False

    @property
    def largest(self) -> float:
        """Largest absolute measured value; [A] normalises by it."""
        return float(np.max(np.abs(self.values)))

    @cached_property
    def basis(self) -> FloatArray:
        """Orthonormal columns (n, q) of the baseline."""
        return (
            np.zeros((len(self.values), 0))
            if self.baseline is None
            else np.linalg.qr(self.baseline)[0]
        )

    def residuals(self, computed: FloatArray) -> FloatArray:
        """Return measured less computed values (k, n), less the best baseline."""
        plain = self.values - computed
        return np.asarray(plain - (plain @ self.basis) @ self.basis.T)


@dataclass(frozen=True, eq=False)
class FitProblem(CostProblem):
    """Problem of finding the unknowns with which the model is nearest to the measurements.

    Without unknowns the model is only evaluated.

    The cost is the root mean square error over all values of all tests, [A] Eq. (1) = [C] Eq. (5).
    """

    unknowns: tuple[Unknown, ...]
    measurements: tuple[Measurement, ...]
    evaluate: EvaluatePoints

    def __post_init__(self) -> None:
        """Check that there are data, and that unknowns have different names.

        Raises:
            InputError: There are none, or a name is there twice.
        """
        names = [unknown.name for unknown in self.unknowns]
        if not self.measurements:
            raise input_error("an identification needs at least one measurement")
        for name in names:
            if names.count(name) > 1:
                raise input_error("is unknown twice", key=name)

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Columns of each measurement in the values of the model."""
        ends = np.cumsum([len(m.values) for m in self.measurements])
        return tuple(
            slice(int(end) - len(m.values), int(end))
            for end, m in zip(ends, self.measurements, strict=True)
        )

    def evaluated(self, coordinates: FloatArray) -> Residuals:
        """Return scaled residuals (k, n) at points (k, p), always finite."""
        computed = self.evaluate(self.points_at(coordinates))
        parts = []
        for where, m in zip(self.slices, self.measurements, strict=True):
            plain = m.residuals(computed[:, where])
            failed = FAILED * (m.largest or 1.0)
            parts.append(np.where(np.isfinite(plain), plain, failed) / m.scale)
        residuals = np.concatenate(parts, axis=1)
        return Residuals(residuals, residuals)

    def costs_of(self, rows: FloatArray) -> FloatArray:
        """Return the root mean square errors (k,)."""
        return rmse(rows)


def point_by_point(model: Callable[[FloatArray], Sequence[FloatArray]]) -> EvaluatePoints:
    """Return a model of many points from one of a point (p,): an array per measurement."""
    return lambda points: np.array([np.concatenate(model(point)) for point in points])


def rmse(residuals: FloatArray) -> FloatArray:
    """Return the root mean square over the last axis; [A] Eq. (1), [C] Eq. (5)."""
    return np.asarray(np.sqrt(np.mean(np.square(residuals), axis=-1)))
