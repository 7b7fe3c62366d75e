"""Balance of a drum with rings of balls: what remains of the unbalance of load and balls.

A load has first moments S = sum m r and S_y = sum m r y, r across the drum axis, in the frame D of
the drum. Both are those of two unbalances in planes at y_1 and y_2 (ISO 21940-11):

    U_1 = (S y_2 - S_y)/(y_2 - y_1),    U_2 = (S_y - S y_1)/(y_2 - y_1)

The planes are those of the foremost and the rearmost ring. One ring has one plane: U = S, and no
place of its balls cancels S_y.
"""

from dataclasses import dataclass

import numpy as np

from wm_drake.elements.ball_ring import BallRing
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.records import Record


@dataclass(frozen=True)
class Balance:
    """Unbalance of load and balls in each plane, over the samples of a run.

    Attributes:
        planes: Positions of the planes along the drum axis. (p,) [m]
        rings: Name of the ring in each plane.
        time: (n,) [s]
        speed: Drum speed. (n,) [rad/s]
        angle: Angle of the drum. (n,) [rad]
        load: Unbalance of the load alone, x and z in D. (p, 2) [kg m]
        remaining: Unbalance of load and balls. (n, p, 2) [kg m]
    """

    planes: FloatArray
    rings: tuple[str, ...]
    time: FloatArray
    speed: FloatArray
    angle: FloatArray
    load: FloatArray
    remaining: FloatArray

    @property
    def load_size(self) -> FloatArray:
        """Return the size of the unbalance of the load alone. (p,) [kg m]"""
        return np.asarray(np.linalg.norm(self.load, axis=-1))

    @property
    def size(self) -> FloatArray:
        """Return the size of the unbalance of load and balls. (n, p) [kg m]"""
        return np.asarray(np.linalg.norm(self.remaining, axis=-1))

    @property
    def at_end(self) -> FloatArray:
        """Return the mean of `size` over the last turn of the drum. (p,) [kg m]"""
        last = np.abs(self.angle - self.angle[-1]) <= 2.0 * np.pi
        return np.asarray(self.size[last].mean(axis=0))

    @property
    def balanced_from(self) -> float:
        """Return the speed from which the balls make the sum over the planes smaller; else NaN.

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


def rings_of(parameters: MachineParameters) -> dict[str, BallRing]:
    """Return the rings of balls of a machine by name."""
    return {n: e for n, e in parameters.elements.items() if isinstance(e, BallRing)}


def balance_of(case: Case, parameters: MachineParameters, record: Record) -> Balance | None:
    """Return the unbalance of load and balls over a run; None for a machine without balls.

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
    moments = record.ball_ring_moment.sel(ball_ring=order).values[..., [0, 2]]
    positions = np.array([rings[name].y for name in order])
    static, with_y = moments_of_load(case, parameters)
    of_balls = moments.sum(axis=1), np.einsum("r,nrk->nk", positions, moments)
    return Balance(
        planes,
        tuple(ends),
        record.time.values,
        record.drum_speed.values,
        record.drum_angle.values,
        in_planes(static, with_y, planes),
        in_planes(static + of_balls[0], with_y + of_balls[1], planes),
    )
