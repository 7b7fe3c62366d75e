"""Balance of a drum with rings of balls or liquid: what remains of the unbalance of the load.

A load has first moments S = sum m r and S_y = sum m r y, r across the drum axis, in the frame D of
the drum. Both are those of two unbalances in planes at y_1 and y_2 (ISO 21940-11):

    U_1 = (S y_2 - S_y)/(y_2 - y_1),    U_2 = (S_y - S y_1)/(y_2 - y_1)

The planes are those of the foremost and the rearmost ring. One ring has one plane: U = S, and no
place of its balls cancels S_y. A ring is an element on the drum whose kind has the output `moment`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wm_drake.elements.kind import element_kind
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.element_kinds import DrumElement
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.records import Record


@dataclass(frozen=True)
class Balance:
    """Unbalance of load and rings in each plane, over the samples of a run.

    Attributes:
        planes: Positions of the planes along the drum axis. (p,) [m]
        rings: Name of the ring in each plane.
        time: (n,) [s]
        speed: Drum speed. (n,) [rad/s]
        angle: Angle of the drum. (n,) [rad]
        load: Unbalance of the load alone, x and z in D. (p, 2) [kg m]
        remaining: Unbalance of load and rings. (n, p, 2) [kg m]
        angles: Angle of each ball of a ring, or of the first moment of a ring without balls, from
            the top of the drum, by the name of the ring. (n, balls or 1) [rad]
    """

    planes: FloatArray
    rings: tuple[str, ...]
    time: FloatArray
    speed: FloatArray
    angle: FloatArray
    load: FloatArray
    remaining: FloatArray
    angles: Mapping[str, FloatArray]

    @property
    def load_size(self) -> FloatArray:
        """Return the size of the unbalance of the load alone. (p,) [kg m]"""
        return np.asarray(np.linalg.norm(self.load, axis=-1))

    @property
    def size(self) -> FloatArray:
        """Return the size of the unbalance of load and rings. (n, p) [kg m]"""
        return np.asarray(np.linalg.norm(self.remaining, axis=-1))

    @property
    def at_end(self) -> FloatArray:
        """Return the mean of `size` over the last turn of the drum. (p,) [kg m]"""
        last = np.abs(self.angle - self.angle[-1]) <= 2.0 * np.pi
        return np.asarray(self.size[last].mean(axis=0))

    @property
    def balanced_from(self) -> float:
        """Return the speed from which the rings make the sum over the planes smaller; else NaN.

        That is the drum speed at the last sample at which it is not smaller than that of the load
        alone. [rad/s]
        """
        worse = np.flatnonzero(self.size.sum(axis=1) >= self.load_size.sum())
        if not len(worse):
            return 0.0
        return float(self.speed[worse[-1]]) if worse[-1] < len(self.time) - 1 else float("nan")


def in_planes(static: FloatArray, with_y: FloatArray, planes: FloatArray) -> FloatArray:
    """Return the unbalance in each of one or two planes.

    Args:
        static, with_y: S and S_y of the module. (..., 2) [kg m, kg m^2]
        planes: Positions along the drum axis. (1,) or (2,) [m]

    Returns:
        (..., planes, 2) [kg m]
    """
    if len(planes) == 1:
        return static[..., None, :]
    first, second = planes
    parts = (static * second - with_y, with_y - static * first)
    return np.asarray(np.stack(parts, axis=-2) / (second - first))


def moments_of_load(case: Case, parameters: MachineParameters) -> tuple[FloatArray, FloatArray]:
    """Return S and S_y of a load and of the empty drum, x and z in D. (2,) each [kg m, kg m^2]"""
    static, with_y = np.zeros((2, 2))
    for mass in (*case.load.unbalances, parameters.imperfections.residual_imbalance):
        x, y, z = mass.position()
        static += mass.mass * np.array([x, z])
        with_y += mass.mass * y * np.array([x, z])
    if case.load.static is not None:
        x, _, z = case.load.static.vector()
        static += (x, z)
        with_y += case.load.static.y * np.array([x, z])
    if case.load.couple is not None:
        with_y += case.load.couple.products()
    return static, with_y


MOMENT, ANGLE = "moment", "angle"
"""Output of a kind of element on the drum that acts as an unbalance: first moment in D [kg m]; and
of a kind that consists of balls: angle of each from the top of the drum [rad]."""


def rings_of(parameters: MachineParameters) -> dict[str, DrumElement]:
    """Return the elements on the drum that act as an unbalance, such as rings of balls, by name."""
    return {
        name: element
        for name, element in parameters.elements.items()
        if isinstance(element, DrumElement) and MOMENT in element_kind(element.kind).output_parts
    }


def moment_of(record: Record, parameters: MachineParameters, ring: str) -> FloatArray:
    """Return the first moment of a ring over a run, x and z in D. (n, 2) [kg m]"""
    kind = parameters.elements[ring].kind
    return np.asarray(record[f"{kind}_{MOMENT}"].sel({kind: ring}).values[:, [0, 2]])


def angles_of(record: Record, parameters: MachineParameters, ring: str) -> FloatArray:
    """Return the angle of each ball of a ring, or of the first moment of one without balls.

    Returns:
        (n, balls or 1) [rad]
    """
    kind = parameters.elements[ring].kind
    if ANGLE not in element_kind(kind).output_parts:
        x, z = moment_of(record, parameters, ring).T
        return np.asarray(np.arctan2(x, z)[:, None])
    angles = record[f"{kind}_{ANGLE}"].sel({kind: ring}).values
    return np.asarray(angles[:, ~np.isnan(angles[0])])


def balance_of(case: Case, parameters: MachineParameters, record: Record) -> Balance | None:
    """Return the unbalance of load and rings over a run; None for a machine without rings.

    Args:
        parameters: The machine, unless the case has parameters of its own.
    """
    parameters = case.parameters or parameters
    rings = rings_of(parameters)
    if not rings or not record.sizes["time"]:
        return None
    order = sorted(rings, key=lambda name: rings[name].y)
    ends = order[:1] if rings[order[0]].y == rings[order[-1]].y else [order[0], order[-1]]
    planes = np.array([rings[name].y for name in ends])
    moments = np.stack([moment_of(record, parameters, name) for name in order], axis=1)
    positions = np.array([rings[name].y for name in order])
    static, with_y = moments_of_load(case, parameters)
    of_rings = moments.sum(axis=1), np.einsum("r,nrk->nk", positions, moments)
    return Balance(
        planes,
        tuple(ends),
        record.time.values,
        record.drum_speed.values,
        record.drum_angle.values,
        in_planes(static, with_y, planes),
        in_planes(static + of_rings[0], with_y + of_rings[1], planes),
        {name: angles_of(record, parameters, name) for name in rings},
    )
