"""Force and moment of the rim at the tub over its displacement or angle.

The rim moves as a rigid body about its centre on the axis. By symmetry four motions give all six
curves: along the axis and about it on a wedge, across it and tilting on half a ring.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from wm_drake.parameters.elements import ForceTable, TorqueTable
from wm_drake.parameters.gasket_drawing import GasketDrawing
from wm_drake.parameters.types import FloatArray
from wm_drake.solid.equilibrium import NoEquilibriumError, Solved, Solver
from wm_drake.solid.mesh import Ring, half_ring, wedge

FIRST_STEP, SMALLEST_STEP = 1.0 / 16.0, 1.0 / 512.0
"""First and smallest step along a motion, in parts of the whole motion."""


@dataclass(frozen=True)
class RimMotion:
    """A motion of the rim.

    Attributes:
        component: Number of its displacement among x, y, z, about_x, about_y, about_z.
        is_mirrored: Whether the curve backwards is the curve forwards with the other sign.
    """

    name: str
    component: int
    is_mirrored: bool = True

    @property
    def rotates(self) -> bool:
        """Whether it is an angle."""
        return self.component >= 3

    def of_rim(self, ring: Ring, value: float) -> FloatArray:
        """Return the displacement of each node of the moved rim. (nodes, 3) [m]"""
        amount = np.zeros(6)
        amount[self.component] = value
        arms = ring.positions[ring.moved] - ring.centre
        return np.asarray(Rotation.from_rotvec(amount[3:]).apply(arms) - arms + amount[:3])


AXIAL, TWIST = RimMotion("axial", 1, is_mirrored=False), RimMotion("twist", 4)
RADIAL, TILT = RimMotion("radial", 0), RimMotion("tilt", 5)
MOTIONS = (AXIAL, RADIAL, TWIST, TILT)
"""Motions by which a ring is tested."""


@dataclass(frozen=True)
class CurvePoint:
    """A point of a curve.

    Attributes:
        value: Displacement or angle of the rim. [m or rad]
        wrench: Force on the rim along x, y, z that holds it there, and moment about its moved
            centre; 0 what vanishes by symmetry. (6,) [N, N m]
        energy: Strain energy of the whole ring. [J]
        u: Displacements of the nodes. (nodes, 3) [m]
    """

    value: float
    wrench: FloatArray
    energy: float
    u: FloatArray


@dataclass(frozen=True)
class Curve:
    """Force over displacement, or moment over angle.

    Attributes:
        ring: Mesh.
        points: Points in the order of their values; the middle one is at rest.
        stopped: Why the curve ends before the values asked for; "" if it does not.
    """

    motion: RimMotion
    ring: Ring
    points: tuple[CurvePoint, ...]
    stopped: str = ""

    @property
    def values(self) -> FloatArray:
        """Displacements or angles. (n,) [m or rad]"""
        return np.array([point.value for point in self.points])

    def wrench(self, component: int | None = None) -> FloatArray:
        """Return a component of the wrench, by default that of the motion. (n,) [N or N m]"""
        chosen = self.motion.component if component is None else component
        return np.array([point.wrench[chosen] for point in self.points])

    @property
    def table(self) -> ForceTable | TorqueTable:
        """Force over displacement or moment over angle, for a machine file.

        Where the force falls with the displacement, the table stays level: a table may not fall.
        """
        middle, force = len(self.points) // 2, self.wrench()
        rising = np.maximum.accumulate(force[middle:])
        falling = np.minimum.accumulate(force[middle::-1])[::-1]
        values = tuple(self.values.tolist())
        ordinates = (*falling[:-1].tolist(), *rising.tolist())
        if self.motion.rotates:
            return TorqueTable(angle=values, torque=ordinates)
        return ForceTable(displacement=values, force=ordinates)

    @property
    def falls(self) -> bool:
        """Whether the force falls somewhere while the displacement grows."""
        return bool(np.any(np.diff(self.wrench()) < 0.0))

    def slope_at_rest(self, component: int | None = None) -> float:
        """Return the slope at rest of a component of the wrench, by default that of the motion.

        It is the slope between the two points next to rest.
        """
        middle = len(self.points) // 2
        force = self.wrench(component)
        rise = float(force[middle + 1] - force[middle - 1])
        return rise / (self.points[middle + 1].value - self.points[middle - 1].value)

    def work(self) -> FloatArray:
        """Return the work of the rim from rest to each point. (n,) [J]"""
        from scipy.interpolate import CubicSpline  # 0.5 s to import

        integral = CubicSpline(self.values, self.wrench()).antiderivative()
        return np.asarray(integral(self.values) - integral(0.0))

    def work_error(self) -> float:
        """Return the largest difference of work and strain energy at an end, by the energy."""
        work = self.work()
        ends = [(work[at], self.points[at].energy) for at in (0, -1)]
        return max(abs(done - energy) / energy for done, energy in ends)


def curve(
    solver: Solver, motion: RimMotion, values: Sequence[float], progress: Callable[[float], None]
) -> Curve:
    """Return a curve through given values.

    Args:
        solver: Solver of a ring that has the symmetry of the motion.
        values: Rising values above 0. [m or rad]
        progress: Called with the finished fraction.
    """
    rest = CurvePoint(0.0, np.zeros(6), 0.0, solver.at_rest().u)
    forward, stopped = _follow(solver, motion, values, progress)
    if motion.is_mirrored:
        backward = [_mirrored(solver.ring, point) for point in forward]
    else:
        backward, also = _follow(solver, motion, [-value for value in values], progress)
        stopped = stopped or also
    return Curve(motion, solver.ring, (*backward[::-1], rest, *forward), stopped)


def _mirrored(ring: Ring, point: CurvePoint) -> CurvePoint:
    """Return the point at the opposite motion: its mirror image in a plane through the axis.

    Half a ring is mirrored in the plane x = 0, a wedge in its middle plane. Only the force along
    the axis keeps its sign.
    """
    signs = (-1.0, 1.0, 1.0) if ring.grid.shape[1] > 1 else (1.0, 1.0, -1.0)
    u = np.empty_like(point.u)
    u[ring.grid] = point.u[ring.grid[:, ::-1]] * signs
    wrench = np.where(np.arange(6) == AXIAL.component, 1.0, -1.0) * point.wrench
    return replace(point, value=-point.value, wrench=wrench, u=u)


def _follow(
    solver: Solver, motion: RimMotion, values: Sequence[float], progress: Callable[[float], None]
) -> tuple[list[CurvePoint], str]:
    """Return the points of a curve on one side, and why it ends early."""
    ring, reach = solver.ring, values[-1]
    last, at, points = solver.at_rest(), 0.0, list[CurvePoint]()
    slope, step = np.zeros_like(last.u), FIRST_STEP * reach
    for number, value in enumerate(values):
        while at != value:
            following = value if abs(value - at) <= 1.01 * abs(step) else at + step
            guess = replace(last, u=last.u + (following - at) * slope)
            try:
                reached = solver.solve(motion.of_rim(ring, following), guess)
            except NoEquilibriumError:
                step /= 2.0
                if abs(step) < SMALLEST_STEP * abs(reach):
                    unit, factor = ("rad", 1.0) if motion.rotates else ("mm", 1e3)
                    return points, (
                        f"{motion.name}: no equilibrium was found beyond {factor * at:.3g} {unit}"
                    )
                continue
            slope = (reached.u - last.u) / (following - at)
            last, at, step = reached, following, 1.5 * step
        wrench = _wrench(ring, motion, value, last)
        points.append(CurvePoint(value, wrench, last.energy, last.u))
        progress((number + 1) / len(values))
    return points, ""


def _wrench(ring: Ring, motion: RimMotion, value: float, solved: Solved) -> FloatArray:
    """Return force, and moment about the moved centre, that hold the rim. (6,) [N, N m]"""
    centre = ring.centre
    if not motion.rotates:
        centre[motion.component] += value
    arms = ring.positions[ring.moved] + solved.u[ring.moved] - centre
    forces = solved.forces[ring.moved]
    whole = np.concatenate([forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)])
    return np.where(ring.shown, ring.copies * whole, 0.0)


@dataclass(frozen=True)
class Mesh:
    """Sizes of the meshes.

    Attributes:
        meridian: Elements along the meridian of half the ring; a wedge has three times as many.
        around: Elements around half the ring.
    """

    meridian: int = 20
    around: int = 8


class Gasket:
    """Meshes of a gasket, and the curves on them."""

    def __init__(self, drawing: GasketDrawing, mesh: Mesh) -> None:
        """Mesh a drawing.

        Raises:
            InputError: the wall bends too sharply for its thickness.
        """
        rings = wedge(drawing, 3 * mesh.meridian), half_ring(drawing, mesh.meridian, mesh.around)
        self._about_axis, self._across = (
            Solver(ring, drawing.rubber, drawing.contact) for ring in rings
        )

    def curve(
        self, motion: RimMotion, values: Sequence[float], progress: Callable[[float], None]
    ) -> Curve:
        """Return the curve of a motion.

        Args:
            motion: One of `MOTIONS`.
            values: Rising displacements or angles above 0. [m or rad]
            progress: Called with the finished fraction.
        """
        solver = self._about_axis if motion in (AXIAL, TWIST) else self._across
        return curve(solver, motion, values, progress)
