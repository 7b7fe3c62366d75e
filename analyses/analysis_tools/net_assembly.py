"""Linear parts of many machines at once, from their free quantities.

To build a machine takes tens of milliseconds. Here mass, stiffness and damping follow in closed
form from the numbers that a parameter map sets, for hundreds of machines together:

    M = sum over bodies of mass and inertia about To
    K = sum over springs of B' (k e e' + T / L (1 - e e')) B, less what their tension T and the
        weight turn with the tub, + end bushings of the dampers

with the displacement of a hook B q. Own derivation; the tests compare it with the slope of the
compiled right-hand side of built machines.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis_tools.steady_model import mass_matrix, unbalance
from analysis_tools.steady_motion import Tub
from wm_drake.engines.compiled.slopes import SlopedDerivative
from wm_drake.model.machine import Machine
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.types import ComplexArray, FloatArray
from wm_drake.studies.calibrate.parameter_map import ParameterMap

WEIGHTS = "upper_counterweight", "front_counterweight_left", "front_counterweight_right"
BODIES = ("tub", "drum", "motor", *WEIGHTS)
SPRINGS = ("left", "right", "rear")
DAMPERS = ("left", "right_rear", "right_front")
KINDS = ("stiffness", "rotational_stiffness")
GASKET = tuple(f"gasket.{kind}_{axis}" for kind in KINDS for axis in "xyz")
DAMPING = tuple(key.replace("stiffness", "damping") for key in GASKET)
"""Keys of the gasket along and about x, y, z."""


@dataclass(frozen=True)
class Assembled:
    """Machines without gasket, which is given apart. The first axis is that of machines.

    Attributes:
        mass: Without load. (n, 6, 6)
        stiffness, damping, gyroscopic: (n, 6, 6)
        dampers: Elongations by the coordinates. (n, d, 6)
        ends: Angles of end bushings by the coordinates. (n, e, 3, 6)
        springs: Elongations by the coordinates. (n, s, 6)
        preload, spring_stiffness: (n, s) [N, N/m]
        rest: Wrench that remains on the tub as drawn. (n, 6) [N m, N]
        gasket: Displacement and rotation of the gasket by the coordinates. (n, 6, 6)
        gasket_stiffness, gasket_damping: (n, 6) [N/m, N m/rad, N s/m, N m s/rad]
        loads: Mean mass matrices (n, 6, 6) and generalized forces (n, speed, 6) of each load.
        numbers: All numbers by key path. [SI]
    """

    mass: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    gyroscopic: FloatArray
    dampers: FloatArray
    ends: FloatArray
    springs: FloatArray
    preload: FloatArray
    spring_stiffness: FloatArray
    rest: FloatArray
    gasket: FloatArray
    gasket_stiffness: FloatArray
    gasket_damping: FloatArray
    loads: dict[str, tuple[FloatArray, ComplexArray]]
    numbers: dict[str, FloatArray]

    def tub(self, machine: int, added: FloatArray) -> Tub:
        """Return a machine with added masses of loads (load, 6, 6)."""
        return Tub(
            self.mass[machine] + added,
            self.stiffness[machine],
            self.damping[machine],
            self.gyroscopic[machine],
            self.dampers[machine],
            self.ends[machine],
        )


def crossed(vectors: FloatArray) -> FloatArray:
    """Return the matrices of cross products with vectors (..., 3) from the left. (..., 3, 3)"""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = ((zero, -z, y), (z, zero, -x), (-y, x, zero))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def moved(points: FloatArray) -> FloatArray:
    """Return displacements of points of the tub (..., 3) by the coordinates. (..., 3, 6)"""
    same = np.broadcast_to(np.eye(3), (*points.shape, 3))
    return np.concatenate([-crossed(points), same], axis=-1)


def turned(points: FloatArray, forces: FloatArray) -> FloatArray:
    """Return moments by rotation of forces that keep their direction, at points of the tub.

    (r x s) x f = (s f' - (s . f) 1) r
    """
    along = np.sum(points * forces, axis=-1)[..., None, None]
    return points[..., :, None] * forces[..., None, :] - along * np.eye(3)


def squared(maps: FloatArray, middle: FloatArray) -> FloatArray:
    """Return B' D B. (..., 6, 6)"""
    return np.swapaxes(maps, -1, -2) @ middle @ maps


class Assembly:
    """Assembles the machines of a parameter map."""

    def __init__(self, machine: Machine, parameter_map: ParameterMap) -> None:
        """Read what the map leaves as it is from the built machine."""
        self.map = parameter_map
        self.base: dict[str, Any] = {key: value for key, value, _ in quantities(parameter_map.base)}
        setup = machine.set_up(parameters=parameter_map.base, gasket=False)
        self.gravity = float(parameter_map.base.gravity)
        whole = mass_matrix(SlopedDerivative(setup).packed)
        self._other_mass = np.zeros((6, 6))  # inertia that no key names
        self._other_mass = (
            whole - self._mass(self.numbers(parameter_map.expected[None] * np.nan))[0]
        )
        self._cubic = [self._part_of_cubic(key) for key in GASKET]

    def numbers(self, points: FloatArray) -> dict[str, FloatArray]:
        """Return all numbers of machines (machine, quantity) by key: (machine, size).

        The base machine is that of a point of NaN.
        """
        count = len(points)
        found = {}
        for key, value in self.base.items():
            if isinstance(value, (int, float, tuple)) and not isinstance(value, bool):
                row = np.atleast_1d(np.asarray(value, dtype=float))
                found[key] = np.tile(row, (count, 1))
        if np.isnan(points).all():
            return found
        for free in self.map.varying.sums:
            values = free.constant + points @ free.factors
            if free.component is None:
                found[free.key] = values
            else:
                found[free.key][:, free.component] = values[:, 0]
        return found

    def __call__(self, points: FloatArray) -> Assembled:
        """Return machines at points (machine, quantity)."""
        numbers = self.numbers(points)
        mass = self._mass(numbers)
        hooks, lines, lengths = _struts(numbers, "spring", SPRINGS)
        total, moment = mass[:, 5, 5], mass[:, :3, 3:]
        centre = np.stack([moment[:, 2, 1], moment[:, 0, 2], moment[:, 1, 0]], -1) / total[:, None]
        weight = np.zeros((len(points), 3))
        weight[:, 2] = -self.gravity * total
        as_drawn = np.hstack([np.cross(centre, weight), weight])
        along = np.einsum("nsi,nsij->nsj", lines, moved(hooks))
        pulls = -np.swapaxes(along, 1, 2)
        preload = np.einsum("nsj,nj->ns", np.linalg.pinv(pulls), -as_drawn)
        rest = as_drawn + np.einsum("njs,ns->nj", pulls, preload)
        rate = numbers["spring_types.suspension.stiffness"]
        stiffness = np.zeros((len(points), 6, 6))
        stiffness[:, :3, :3] = -turned(centre, weight)
        stiffness[:, :3, :3] -= turned(hooks, -preload[..., None] * lines).sum(axis=1)
        square = lines[..., :, None] * lines[..., None, :]
        tension = (preload / lengths)[..., None, None]
        of_hook = rate[:, :, None, None] * square + tension * (np.eye(3) - square)
        stiffness += squared(moved(hooks), of_hook).sum(axis=1)
        dampers, ends = _damper_maps(numbers)
        bushings = squared(ends, np.eye(3)).sum(axis=1)
        end = "damper_types.friction.end_bushing"
        gasket = np.zeros((len(points), 6, 6))
        gasket[:, :3] = moved(numbers["frames.gasket_tub.position"])
        gasket[:, 3:, :3] = np.eye(3)
        gyroscopic = np.zeros((len(points), 6, 6))
        spin = numbers["bodies.drum.inertia.yy"][:, 0]
        gyroscopic[:, 0, 2], gyroscopic[:, 2, 0] = -spin, spin
        return Assembled(
            mass,
            stiffness + numbers[f"{end}.stiffness"][:, :, None] * bushings,
            numbers[f"{end}.damping"][:, :, None] * bushings,
            gyroscopic,
            dampers,
            ends,
            along,
            preload,
            np.broadcast_to(rate, preload.shape),
            rest,
            gasket,
            np.stack([self._nominal(numbers, k) for k in range(6)], axis=-1),
            np.hstack([numbers[key] for key in DAMPING]),
            {name: self._load(numbers, name) for name in self.map.base.loads},
            numbers,
        )

    def _load(self, numbers: dict[str, FloatArray], name: str) -> tuple[FloatArray, ComplexArray]:
        """Return mean mass matrices (n, 6, 6) and generalized forces (n, speed, 6) of a load."""
        parts = []
        for k, of in enumerate(self.map.base.loads[name].unbalances):
            radius, y = (numbers[f"loads.{name}.unbalances.{k}.{f}"][:, 0] for f in ("radius", "y"))
            parts.append(unbalance(of, radius, y, self.gravity))
        masses, forces = zip(*parts, strict=True)
        return sum(masses[1:], masses[0]), sum(forces[1:], forces[0])

    def _mass(self, numbers: dict[str, FloatArray]) -> FloatArray:
        """Return the mass matrices of tub and drum about To. (n, 6, 6)"""
        count = len(numbers["bodies.tub.mass"])
        mass = np.tile(self._other_mass, (count, 1, 1))
        for name in BODIES:
            key = f"bodies.{name}"
            m = numbers[f"{key}.mass"][:, :, None]
            c = crossed(numbers[f"{key}.centre_of_mass"])
            inertia = np.zeros((count, 3, 3))
            for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
                moment = numbers.get(f"{key}.inertia.{'xyz'[i]}{'xyz'[j]}", np.zeros((count, 1)))
                inertia[:, i, j] = inertia[:, j, i] = moment[:, 0]
            mass[:, :3, :3] += inertia - m * (c @ c)
            mass[:, :3, 3:] += m * c
            mass[:, 3:, :3] -= m * c
            mass[:, 3:, 3:] += m * np.eye(3)
        return mass

    def _nominal(self, numbers: dict[str, FloatArray], axis: int) -> FloatArray:
        """Return the nominal stiffness of the gasket along or about an axis. (n,)"""
        x, cubic = self._cubic[axis]
        key, ordinate = GASKET[axis], ("torque" if axis > 2 else "force")
        linear, third = np.linalg.lstsq(
            np.stack([x, x**3], axis=1), numbers[f"{key}.{ordinate}"].T, rcond=None
        )[0]
        return np.asarray(linear + cubic * third)

    def _part_of_cubic(self, key: str) -> tuple[FloatArray, float]:
        """Return the abscissas of a curve, and its nominal stiffness by that of its third power."""
        table = getattr(self.map.base.gasket, key.partition(".")[2])
        x = np.array(table.curve[0])
        ordinate = "torque" if "rotational" in key else "force"
        cubed = table.model_copy(update={ordinate: tuple((x**3).tolist())})
        return x, cubed.nominal_stiffness


def _struts(
    numbers: dict[str, FloatArray], kind: str, names: tuple[str, ...]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points on the tub (n, s, 3), directions to them (n, s, 3) and lengths (n, s)."""
    tub, housing = (
        np.stack([numbers[f"frames.{kind}_{name}_{end}.position"] for name in names], axis=1)
        for end in ("tub", "housing")
    )
    length = np.linalg.norm(tub - housing, axis=-1)
    return tub, (tub - housing) / length[..., None], length


def _damper_maps(numbers: dict[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return elongations (n, d, 6) and angles of the ends (n, 2 d, 3, 6) by the coordinates."""
    points, lines, lengths = _struts(numbers, "damper", DAMPERS)
    maps = moved(points)
    against_housing = crossed(lines) @ maps / lengths[..., None, None]
    across = np.eye(3) - lines[..., :, None] * lines[..., None, :]
    against_tub = against_housing.copy()
    against_tub[..., :3] -= across
    ends = np.concatenate([against_housing, against_tub], axis=1)
    return np.einsum("nsi,nsij->nsj", lines, maps), ends
