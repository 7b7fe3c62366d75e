"""Problem of an identification: unknown numbers, measurements, and a model that computes them.

It depends on no engine: the model is any function of the unknowns. It is evaluated at many points
at once, so that it can run them side by side; `point_by_point` makes it from a function of one
point.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit

Evaluate: TypeAlias = Callable[[FloatArray], FloatArray]
"""Points (k, p), in SI -> computed values (k, n), those of all measurements in a row.

A row of NaN means that the model fails at the point."""

Progress: TypeAlias = Callable[[float, float], None]
"""Function that is called with the fraction done and the least RMSE so far."""

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
    """

    name: str
    lower: float
    upper: float
    unit: Unit = PURE_NUMBER
    start: float | None = None
    logarithmic: bool = False

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


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measured values of one test.

    Attributes:
        name: Name of the test.
        values: Measured values (n,). [any unit, the model's]
        baseline: Columns (n, q) that the instrument may have added in unknown amounts, such as an
            offset or a drift; the best amount of each is taken out of every residual. None for an
            instrument without such errors.
        scale: Expected error, by which residuals are divided before tests are put together.
        correlated: Whether errors of neighbouring values are correlated (samples over time), which
            widens the intervals.
    """

    name: str
    values: FloatArray
    baseline: FloatArray | None = None
    scale: float = 1.0
    correlated: bool = False

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

    The distance is the root mean square error over all values of all tests, [A] Eq. (1) = [C] Eq.
    (5).
    """

    unknowns: tuple[Unknown, ...]
    measurements: tuple[Measurement, ...]
    evaluate: Evaluate

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
    def start(self) -> FloatArray:
        """First guess in unit coordinates (p,)."""
        known = [u.start is not None for u in self.unknowns]
        guess = self.to_unit(
            np.array([u.lower if u.start is None else u.start for u in self.unknowns])
        )
        return np.where(known, guess, 0.5)

    def to_unit(self, points: FloatArray) -> FloatArray:
        """Return coordinates from 0 at the lower to 1 at the upper bound, of SI values (..., p)."""
        lower, upper = self._ends
        return np.asarray((self._straight(points) - lower) / (upper - lower))

    def from_unit(self, coordinates: FloatArray) -> FloatArray:
        """Return the SI values of unit coordinates, the inverse of `to_unit`."""
        lower, upper = self._ends
        straight = lower + np.asarray(coordinates) * (upper - lower)
        return np.where(
            self._logarithmic, np.exp(np.where(self._logarithmic, straight, 0.0)), straight
        )

    def residuals(self, coordinates: FloatArray) -> FloatArray:
        """Return scaled residuals (k, n) at points in unit coordinates (k, p), always finite."""
        computed = self.evaluate(self.from_unit(coordinates))
        parts = []
        for where, m in zip(self.slices, self.measurements, strict=True):
            plain = m.residuals(computed[:, where])
            failed = FAILED * (m.largest or 1.0)
            parts.append(np.where(np.isfinite(plain), plain, failed) / m.scale)
        return np.concatenate(parts, axis=1)

    @cached_property
    def _logarithmic(self) -> np.ndarray:
        return np.array([u.logarithmic for u in self.unknowns], dtype=bool)

    @cached_property
    def _ends(self) -> tuple[FloatArray, FloatArray]:
        lower, upper = (
            np.array([getattr(u, side) for u in self.unknowns]) for side in ("lower", "upper")
        )
        return self._straight(lower), self._straight(upper)

    def _straight(self, points: FloatArray) -> FloatArray:
        safe = np.where(self._logarithmic, points, 1.0)
        return np.where(self._logarithmic, np.log(safe), points)


def point_by_point(model: Callable[[FloatArray], Sequence[FloatArray]]) -> Evaluate:
    """Return a model of many points from one of a point (p,): an array per measurement."""
    return lambda points: np.array([np.concatenate(model(point)) for point in points])


def rmse(residuals: FloatArray) -> FloatArray:
    """Return the root mean square over the last axis; [A] Eq. (1), [C] Eq. (5)."""
    return np.asarray(np.sqrt(np.mean(np.square(residuals), axis=-1)))
