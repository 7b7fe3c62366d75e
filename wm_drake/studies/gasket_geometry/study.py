"""The study: a design of drawings, finite elements of each, runs, surfaces, the best drawing."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.elements import ForceTable, TorqueTable
from wm_drake.parameters.gasket_drawing import GasketDrawing
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import plain_number
from wm_drake.solid.curves import MOTIONS, Gasket, Mesh
from wm_drake.solid.deformed import deformed
from wm_drake.studies.gasket_curves.study import GasketStiffness, stiffness_of
from wm_drake.studies.inputs import pairs_of

MEASURES = ("amplitudes", "gap", "extremes")
"""Measures of the runs."""

POINTS = 3
"""Points of a curve on each side, beside the one near rest."""

CANDIDATES = 4096
"""Drawings among which the best is chosen on the response surface."""

RESPONSES = {
    "radial_N_per_mm": "radial stiffness, N/mm",
    "axial_N_per_mm": "axial stiffness, N/mm",
    "twist_Nm_per_rad": "twist stiffness, N m/rad",
    "tilt_Nm_per_rad": "tilt stiffness, N m/rad",
    "smallest_gap_mm": "smallest gap, mm",
    "largest_amplitude_mm": "largest amplitude of a sensor, mm",
    "largest_gasket_force_N": "largest gasket force, N",
    "largest_stretch": "largest stretch of the rubber",
}
"""Responses of a drawing: words by names."""

GAP = "smallest_gap_mm"
"""Response that the best drawing makes largest."""


@dataclass(frozen=True)
class Computed:
    """What the curves of a drawing give: stiffness, and the largest stretch at their ends."""

    stiffness: GasketStiffness
    stretch: float


SPARE = 3
"""Runs beyond the number of coefficients that a surface of degree two needs."""


def basis(levels: FloatArray, degree: int) -> FloatArray:
    """Return polynomials that are orthogonal for even levels from -1 to 1. (n, terms)

    They are 1, x_i, and for degree two (3 x_i^2 - 1)/2 and x_i x_j.
    """
    count = levels.shape[1]
    columns = [np.ones(len(levels)), *levels.T]
    if degree == 2:
        columns += [0.5 * (3.0 * x * x - 1.0) for x in levels.T]
        columns += [levels[:, i] * levels[:, j] for i, j in itertools.combinations(range(count), 2)]
    return np.column_stack(columns)


@dataclass(frozen=True)
class Surface:
    """Response surface.

    Attributes:
        factors: Number of factors.
        degree: Degree: 1, or 2 if there are enough runs.
        coefficients: Of the columns of `basis`. (terms,)
    """

    factors: int
    degree: int
    coefficients: FloatArray

    def at(self, levels: FloatArray) -> FloatArray:
        """Return the response at levels. (n, factors) to (n,)"""
        return np.asarray(basis(levels, self.degree) @ self.coefficients)

    def contributions(self, sample: FloatArray) -> FloatArray:
        """Return the part of each factor in the variance, and that of all pairs. (factors + 1,)

        Args:
            sample: Levels over which the variance is taken. (n, factors)
        """
        count, terms = self.factors, basis(sample, self.degree) * self.coefficients
        main = terms[:, 1 : count + 1]
        if self.degree == 2:
            main = main + terms[:, count + 1 : 2 * count + 1]
        pairs = terms[:, 2 * count + 1 :].sum(axis=1) if self.degree == 2 else np.zeros(len(terms))
        parts = np.append(main.var(axis=0), pairs.var())
        total = float(parts.sum())
        return parts / total if total else parts


def fit(levels: FloatArray, response: FloatArray) -> Surface:
    """Return the least-squares surface of runs at levels (n, factors).

    The square of a factor with two levels is constant: it has the coefficient 0.
    """
    terms = basis(levels[:1], 2).shape[1]
    degree = 2 if len(levels) >= terms + SPARE else 1
    columns = basis(levels, degree)
    columns[:, 1:] *= np.ptp(columns[:, 1:], axis=0) > 1e-12
    coefficients = np.linalg.lstsq(columns, response, rcond=None)[0]
    return Surface(levels.shape[1], degree, np.asarray(coefficients))


def excess(responses: Mapping[str, FloatArray], limits: Mapping[str, float]) -> FloatArray:
    """Return by how much drawings exceed limits at most, in parts of the limit; 0 if not. (n,)"""
    parts = [responses[name] / limit - 1.0 for name, limit in limits.items()]
    return np.max([np.zeros_like(responses[GAP]), *parts], axis=0)


def ranked(responses: Mapping[str, FloatArray], limits: Mapping[str, float]) -> np.ndarray:
    """Return the numbers of drawings, best first: within the limits, then the largest gap. (n,)"""
    return np.lexsort((-responses[GAP], excess(responses, limits)))


def limits_of(entries: Sequence[str]) -> dict[str, float]:
    """Return limits by responses.

    Raises:
        InputError: a response is unknown, or a limit is not a number above 0.
    """
    limits = {}
    for name, text in pairs_of(entries, "--limit"):
        if name not in RESPONSES or name == GAP:
            allowed = ", ".join(response for response in RESPONSES if response != GAP)
            raise input_error(f"'{name}': allowed are {allowed}", where="--limit")
        try:
            limits[name] = plain_number(text)
        except ValueError:
            limits[name] = 0.0
        if not 0.0 < limits[name] < np.inf:
            raise input_error(f"'{name}={text}': allowed is a number above 0", where="--limit")
    return limits


def computed_curves(
    work: tuple[GasketDrawing, Mesh, Mapping[str, Sequence[float]]],
) -> dict[str, Any] | str:
    """Return tables, coupling and largest stretch of a drawing; the reason if a curve ends early.

    Args:
        work: Drawing, mesh, and ends of the motion by name.
    """
    drawing, mesh, values = work
    gasket, curves = Gasket(drawing, mesh), {}
    for motion in MOTIONS:
        curve = gasket.curve(motion, values[motion.name], lambda _: None)
        if curve.stopped:
            return curve.stopped
        curves[motion.name] = curve
    made = stiffness_of(curves)
    stretch = max(
        deformed(curve.ring, drawing.rubber, curve.points[end].u).stretch
        for curve in curves.values()
        for end in (0, -1)
    )
    tables = {name: np.array(table.curve) for name, table in made.tables.items()}
    return {**tables, "coupling": made.coupling, "stretch": stretch}


def _table(rotates: bool, curve: FloatArray) -> ForceTable | TorqueTable:
    """Return a table of its abscissas and ordinates. (2, n)"""
    x, y = map(tuple, curve.tolist())
    return TorqueTable(angle=x, torque=y) if rotates else ForceTable(displacement=x, force=y)
