"""Problem of a fit: unknown numbers, and residuals that a search makes small.

No problem depends on an engine: its model is any function of the unknowns. It is evaluated at many
points at once, so that it can run them side by side. An unknown may have a prior, an expected value
with its standard deviation, whose distance counts beside the residuals of the measurements.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit


class ModelValues(NamedTuple):
    """What a model computes at points; NaN where it fails.

    Attributes:
        values: Computed values (k, n), those of all measurements in a row.
        smooth: Smooth substitutes of them (k, n) for derivatives, with the same derivatives except
            at kinks; None for values without kinks.
        known: Residuals (k, m) of what is known beside the priors, in standard deviations.
        wished: Residuals (k, w) of what is wished. They cost, and make nothing more certain.
    """

    values: FloatArray
    smooth: FloatArray | None = None
    known: FloatArray | None = None
    wished: FloatArray | None = None


EvaluatePoints: TypeAlias = Callable[[FloatArray], "FloatArray | ModelValues"]
"""Points (k, p), in SI -> computed values (k, n), or more of them."""

Errors: TypeAlias = Literal["alike", "correlated", "each", "known"]
"""Errors of the values of a measurement: alike, with one variance for all such measurements;
correlated (samples over time); each of a size of its own, such as a part of the value; or known:
normal with the deviation `scale`."""

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
        prior: Expected value and its standard deviation; None if nothing is known. [SI] An unknown
            with a prior is not logarithmic.
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
        if self.logarithmic and self.prior is not None:
            raise input_error("a logarithmic search has no normal prior", key=self.name)
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
        near: Distance from a bound, as a part of the range, within which an unknown has hit it.
        difference: Step of the central differences of the assessment, as a part of the range; None
            for those of the search.
        most: Evaluations of the rows at most, without those of derivatives.
    """

    steps: tuple[float, ...]
    side: float
    inside: float
    cost: float
    point: float
    gradient: float
    near: float
    difference: float | None
    most: int = 60


SMOOTH = Descent((1e-5,), 0.5, 1e-4, 1e-9, 1e-9, 1e-14, 1e-3, 1e-3)
"""Descent where the residuals are smooth."""

KINKED = Descent((0.1, 0.3, 0.03), 0.0, 1e-6, 1e-3, 1e-4, 1e-6, 1e-2, None)
"""Descent where the residuals have kinks, such as amplitudes (largest values). Coarse differences
of the smooth residuals pass a kink at which fine ones would stop. The steps are in standard
deviations of the prior; the first one is larger than the noise of amplitudes that comes from
sampling."""


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measured values of one test.

    Attributes:
        values: Measured values (n,). [any unit, the model's]
        baseline: Columns (n, q) that the instrument may have added in unknown amounts, such as an
            offset or a drift; the best amount of each is taken out of every residual. None for an
            instrument without such errors.
        scale: Expected error, by which residuals are divided before tests are put together.
        errors: What the errors are like; it decides the intervals.
    """

    name: str
    values: FloatArray
    baseline: FloatArray | None = None
    scale: float = 1.0
    errors: Errors = "alike"

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
class FitProblem:
    """Problem of finding the unknowns with which the model is nearest to the measurements.

    Without unknowns the model is only evaluated.

    A search moves in coordinates. The coordinate of an unknown (or of its logarithm) goes from 0 at
    the lower to 1 at the upper bound. That of an unknown with a prior is its distance from the
    expected value in standard deviations. The cost is the root mean square of `rows`; without
    priors this is that of all residuals, [A] Eq. (1) = [C] Eq. (5). With them, it is least where
    the posterior density is largest if residuals are in standard deviations.
    """

    unknowns: tuple[Unknown, ...]
    measurements: tuple[Measurement, ...]
    evaluate: EvaluatePoints
    descent: Descent = SMOOTH

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

    @property
    def count(self) -> int:
        """Number n of measured values."""
        return self.slices[-1].stop

    def values(self, coordinates: FloatArray) -> ModelValues:
        """Return what the model computes at points (k, p)."""
        computed = self.evaluate(self.points_at(coordinates))
        return computed if isinstance(computed, ModelValues) else ModelValues(computed)

    def evaluated(self, coordinates: FloatArray) -> "Rows":
        """Return the rows at points (k, p)."""
        model = self.values(coordinates)
        others = [part for part in (model.wished, model.known) if part is not None]
        others.append(coordinates[:, self.has_prior])
        exact, smooth = (
            np.hstack([self._misfits(values), *others])
            for values in (model.values, model.values if model.smooth is None else model.smooth)
        )
        failed = np.ones(exact.shape[1])
        failed[: self.count] = np.concatenate(
            [np.full(len(m.values), (m.largest or 1.0) / m.scale) for m in self.measurements]
        )
        wished = 0 if model.wished is None else model.wished.shape[1]
        return Rows(np.where(np.isfinite(exact), exact, FAILED * failed), smooth, wished)

    def residuals(self, coordinates: FloatArray) -> FloatArray:
        """Return the scaled residuals (k, n) of the measurements at points (k, p), all finite."""
        return self.evaluated(coordinates).exact[:, : self.count]

    def costs_of(self, rows: FloatArray) -> FloatArray:
        """Return what a search makes small (k,), of rows (k, m)."""
        return rmse(rows)

    def restricted(self, free: Sequence[int] | np.ndarray, held: FloatArray) -> "FitProblem":
        """Return the problem of some unknowns with all others held.

        Args:
            free: Indices of the unknowns that are searched.
            held: Coordinates (p,), of which those of the other unknowns are used.
        """
        at = self.points_at(held)

        def evaluate(points: FloatArray) -> "FloatArray | ModelValues":
            full = np.tile(at, (len(points), 1))
            full[:, free] = points
            return self.evaluate(full)

        return replace(self, unknowns=tuple(self.unknowns[k] for k in free), evaluate=evaluate)

    @cached_property
    def has_prior(self) -> np.ndarray:
        """Return whether each unknown has a prior (p,)."""
        return np.array([u.prior is not None for u in self.unknowns], dtype=bool)

    @cached_property
    def lower(self) -> FloatArray:
        """Lower bounds (p,), in coordinates."""
        return self.coordinates_of(np.array([u.lower for u in self.unknowns]))

    @cached_property
    def upper(self) -> FloatArray:
        """Upper bounds (p,), in coordinates."""
        return self.coordinates_of(np.array([u.upper for u in self.unknowns]))

    @cached_property
    def ranges(self) -> FloatArray:
        """Distances of the bounds (p,), in coordinates."""
        return np.asarray(self.upper - self.lower)

    @property
    def start(self) -> FloatArray:
        """First guess (p,), in coordinates."""
        known = [u.start is not None for u in self.unknowns]
        guess = self.coordinates_of(
            np.array([u.lower if u.start is None else u.start for u in self.unknowns])
        )
        middle = np.where(self.has_prior, 0.0, 0.5 * (self.lower + self.upper))
        return np.where(known, guess, middle)

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

    def _misfits(self, computed: FloatArray) -> FloatArray:
        """Return the scaled residuals (k, n) of computed values."""
        return np.concatenate(
            [
                m.residuals(computed[:, where]) / m.scale
                for where, m in zip(self.slices, self.measurements, strict=True)
            ],
            axis=1,
        )

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


class Rows(NamedTuple):
    """Numbers whose squares count, at points: residuals, what is wished, what is known, priors.

    Attributes:
        exact: Rows (k, m); where the model fails, larger than any other.
        smooth: Smooth substitutes (k, m) for derivatives; NaN where the model fails.
        wished: Number of rows, behind those of the measurements, of what is wished.
    """

    exact: FloatArray
    smooth: FloatArray
    wished: int = 0


def rmse(residuals: FloatArray) -> FloatArray:
    """Return the root mean square over the last axis; [A] Eq. (1), [C] Eq. (5)."""
    return np.asarray(np.sqrt(np.mean(np.square(residuals), axis=-1)))
