"""Branches of a bushing of rubber, beside its springs and dashpots; each acts along one axis.

The displacements of the six axes are those of `bushing_force`: position in the ground-side frame G,
then rotation vector. The own states are the stretches of the branches in use, in the order of the
axes, friction before the Maxwell element of each.
"""

from collections import namedtuple
from dataclasses import dataclass, field, replace

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import numbers, whole_number
from wm_drake.compiler.packed import ARRAY, LAYOUT, PackedLayout
from wm_drake.compiler.vectors import (
    add,
    compose,
    cross,
    dot,
    moment_from_rotation_vector,
    rotate,
    rotate_back,
    rotation_vector,
    rotation_vector_coefficient,
    rotation_vector_rate,
    scale,
    subtract,
)
from wm_drake.compiler.vectors import transpose as transposed
from wm_drake.elements.bushing import (
    BUSHING,
    BUSHING_FRAMES,
    WRENCH_OUTPUTS,
    SixComponentBushingParameters,
    packed_bushing_law,
    read_bushing,
    six_component_bushing_wrench,
)
from wm_drake.elements.kind import ElementKind, Ends
from wm_drake.elements.motion import tub_motion, write_generalized_force
from wm_drake.elements.strut import wrench_at_origin
from wm_drake.laws.rubber import dahl_rate, maxwell_rate
from wm_drake.parameters.elements import Bushing, RubberBushingType
from wm_drake.parameters.rubber import DAHL_FIELDS, MAXWELL_FIELDS, RubberBranches
from wm_drake.parameters.types import FloatArray

RUBBER = PackedLayout(
    "RubberNumbers",
    cross=ARRAY(15),
    dahl_state=ARRAY(6),
    dahl_force=ARRAY(6),
    dahl_displacement=ARRAY(6),
    maxwell_state=ARRAY(6),
    maxwell_stiffness=ARRAY(6),
    maxwell_damping=ARRAY(6),
)
"""Cross-stiffnesses in the order of `CROSS_FIELDS`; of each axis the index of the stretch among the
own states, -1 for a branch that is not in use, and the numbers of the branch."""
RUBBER_BUSHING = PackedLayout(
    "RubberBushingNumbers", bushing=LAYOUT(BUSHING), rubber=LAYOUT(RUBBER)
)
"""Packed numbers of a bushing of rubber: the bushing, then its branches."""
read_rubber, read_rubber_bushing = RUBBER.read, RUBBER_BUSHING.read

AXIS_COUNT = 6
FRICTION, MAXWELL = "friction", "Maxwell branch"
"""Kinds of own states."""
MOST_STATES = 2 * AXIS_COUNT
"""Most states of the branches of one bushing."""

Branches = namedtuple("Branches", ("at", "states", "count"))
"""Bushings of rubber in packed numbers and states: index of each one's numbers, and index of its
first stretch (arrays of whole numbers); number of all stretches. A machine without such bushings
has None in its place."""

RubberMotion = namedtuple("RubberMotion", ("arm", "ground", "moved", "rate", "coefficient"))
"""From To to the tub-side point, in W [m]; rotation of G in W; displacement of the six axes
[m, rad] and its rate [m/s, rad/s]; coefficient of the rotation vector."""


def packed_branches(bushing: RubberBranches) -> FloatArray | None:
    """Return the numbers of `RUBBER`; None for a bushing that uses no branch."""
    if not bushing.branches_in_use:
        return None
    dahl = np.array([[getattr(bushing, name) for name in pair] for pair in DAHL_FIELDS])
    maxwell = np.array([[getattr(bushing, name) for name in pair] for pair in MAXWELL_FIELDS])
    in_use = np.stack([dahl[:, 0] > 0.0, maxwell[:, 0] > 0.0], axis=1)
    index = np.where(in_use, np.cumsum(in_use).reshape(in_use.shape) - 1, -1)
    unused = np.where(in_use, 0.0, 1.0)  # the laws divide by these numbers
    return RUBBER.pack(
        cross=bushing.cross,
        dahl_state=index[:, 0],
        dahl_force=dahl[:, 0],
        dahl_displacement=dahl[:, 1] + unused[:, 0] * (dahl[:, 1] == 0.0),
        maxwell_state=index[:, 1],
        maxwell_stiffness=maxwell[:, 0],
        maxwell_damping=maxwell[:, 1] + unused[:, 1],
    )


def branch_structure(packed: FloatArray) -> list[int]:
    """Return which branches are in use: the index of each state, -1 for none. (12)"""
    named = RUBBER.unpack(packed)
    return [int(index) for index in (*named.dahl_state, *named.maxwell_state)]


def branch_kinds(packed: FloatArray) -> list[str]:
    """Return the kind of each state of packed branches, `FRICTION` or `MAXWELL`."""
    kinds = [FRICTION] * AXIS_COUNT + [MAXWELL] * AXIS_COUNT
    in_use = [pair for pair in zip(branch_structure(packed), kinds, strict=True) if pair[0] >= 0]
    return [kind for _, kind in sorted(in_use)]


@dataclass(frozen=True)
class RubberBushingParameters(SixComponentBushingParameters):
    """A bushing of rubber in its place.

    Attributes:
        packed_rubber: Numbers of `RUBBER`.
    """

    packed_rubber: FloatArray = field(default_factory=lambda: np.zeros(RUBBER.fixed_size))

    @property
    def kind(self) -> ElementKind:
        """Return the kind of the element."""
        return SIX_COMPONENT_BUSHING_OF_RUBBER

    @property
    def structure(self) -> list[int]:
        """Numbers of points of its six tables, and which branches are in use."""
        return [*super().structure, *branch_structure(self.packed_rubber)]

    @property
    def state_size(self) -> int:
        """Number of own states, one for each branch in use."""
        return len(self.state_kinds)

    @property
    def state_kinds(self) -> list[str]:
        """Kind of each own state, `FRICTION` or `MAXWELL`."""
        return branch_kinds(self.packed_rubber)

    def without_friction(self) -> "RubberBushingParameters":
        """Return the bushing without friction; the states of its friction stay, without force."""
        frictionless = RUBBER.replaced(self.packed_rubber, dahl_force=np.zeros(AXIS_COUNT))
        plain = super().without_friction()
        return replace(self, packed_law=plain.packed_law, packed_rubber=frictionless)

    def packed(self) -> FloatArray:
        """Return the numbers of `RUBBER_BUSHING`."""
        return RUBBER_BUSHING.pack(bushing=super().packed(), rubber=self.packed_rubber)


def placed_bushing(ends: Ends, bushing: RubberBushingType) -> SixComponentBushingParameters:
    """Return a bushing in its place, with branches only if it uses one."""
    place = (*ends, packed_bushing_law(bushing))
    branches = packed_branches(bushing)
    if branches is None:
        return SixComponentBushingParameters(*place)
    return RubberBushingParameters(*place, packed_rubber=branches)


@law
def rubber_motion(motion, p, at):
    """Return the `RubberMotion` of a bushing between tub and housing.

    Args:
        motion: `TubMotion`.
        p, at: Array that holds the numbers of `BUSHING`, and where they begin.
    """
    bushing = read_bushing(p, at)
    ground = bushing.ground_side_rotation
    arm = rotate(motion.rotation, bushing.tub_side_point)
    displaced = subtract(add(motion.position, arm), bushing.ground_side_point)
    velocity = add(motion.velocity, cross(motion.angular_velocity, arm))
    relative = compose(transposed(ground), compose(motion.rotation, bushing.tub_side_rotation))
    d, d_rate = rotate_back(ground, displaced), rotate_back(ground, velocity)
    r, w = rotation_vector(relative), rotate_back(ground, motion.angular_velocity)
    coefficient = rotation_vector_coefficient(dot(r, r))
    r_rate = rotation_vector_rate(r, w, coefficient)
    return RubberMotion(
        arm,
        ground,
        (d[0], d[1], d[2], r[0], r[1], r[2]),
        (d_rate[0], d_rate[1], d_rate[2], r_rate[0], r_rate[1], r_rate[2]),
        coefficient,
    )


@law
def branch_force(x, first, axis, rubber):
    """Return the force of the branches of an axis on the tub side. [N or N m]

    Args:
        x, first: State, and index in it of the first stretch of the bushing.
        axis: Number of the axis.
        rubber: Named numbers of `RUBBER`.
    """
    force = 0.0 * rubber.dahl_force[axis]
    at = whole_number(rubber.dahl_state[axis])
    if at >= 0:
        stiffness = rubber.dahl_force[axis] / rubber.dahl_displacement[axis]
        force = force - stiffness * x[first + at]
    at = whole_number(rubber.maxwell_state[axis])
    if at >= 0:
        force = force - rubber.maxwell_stiffness[axis] * x[first + at]
    return force


@law
def rubber_forces(moved, x, first, rubber):
    """Return the forces of the six axes on the tub side: branches and cross-stiffness. [N, N m]

    The torques do work on the rates of the rotation vector, as those of `bushing_force` do.

    Args:
        moved: Displacement of the six axes. [m, rad]
        x, first: State, and index in it of the first stretch of the bushing.
        rubber: Named numbers of `RUBBER`.
    """
    a, b, c, d, e, f = moved
    k = rubber.cross
    return (
        branch_force(x, first, 0, rubber) - (k[0] * b + k[1] * c + k[2] * d + k[3] * e + k[4] * f),
        branch_force(x, first, 1, rubber) - (k[0] * a + k[5] * c + k[6] * d + k[7] * e + k[8] * f),
        branch_force(x, first, 2, rubber)
        - (k[1] * a + k[5] * b + k[9] * d + k[10] * e + k[11] * f),
        branch_force(x, first, 3, rubber)
        - (k[2] * a + k[6] * b + k[9] * c + k[12] * e + k[13] * f),
        branch_force(x, first, 4, rubber)
        - (k[3] * a + k[7] * b + k[10] * c + k[12] * d + k[14] * f),
        branch_force(x, first, 5, rubber)
        - (k[4] * a + k[8] * b + k[11] * c + k[13] * d + k[14] * e),
    )


@law
def rubber_wrench(motion, x, first, p, at):
    """Return the wrench of the branches of a bushing, as `six_component_bushing_wrench` does.

    Args:
        motion: `TubMotion`.
        x, first: State, and index in it of the first stretch of the bushing.
        p, at: Array that holds the numbers of `RUBBER_BUSHING`, and where they begin.
    """
    whole = read_rubber_bushing(p, at)
    at_point = rubber_motion(motion, *whole.bushing)
    q = rubber_forces(at_point.moved, x, first, read_rubber(*whole.rubber))
    engaged = read_bushing(*whole.bushing).engaged
    r = (at_point.moved[3], at_point.moved[4], at_point.moved[5])
    f = scale(engaged, (q[0], q[1], q[2]))
    m = moment_from_rotation_vector(r, (q[3], q[4], q[5]), at_point.coefficient)
    m = scale(engaged, m)
    wrench = wrench_at_origin(at_point.arm, rotate(at_point.ground, f), rotate(at_point.ground, m))
    return wrench, (-f[0], -f[1], -f[2], -m[0], -m[1], -m[2])


@law
def bushing_wrench(motion, p, at, x, branches):
    """Return the wrench of a bushing with its branches, if it has any.

    Args:
        motion, p, at: As for `six_component_bushing_wrench`.
        x: State.
        branches: `Branches`; None for a machine without bushings of rubber.

    Returns:
        As `six_component_bushing_wrench`.
    """
    wrench, on_housing = six_component_bushing_wrench(motion, p, at)
    return _with_branches(motion, p, at, x, branches, wrench, on_housing)


@law
def _with_branches(motion, p, at, x, branches, wrench, on_housing):
    """Add the branches of a bushing, an argument of its own so that None compiles to nothing."""
    if branches is None:
        return wrench, on_housing
    for j in range(len(branches.at)):
        if branches.at[j] == at:
            more, more_on_housing = rubber_wrench(motion, x, branches.states[j], p, at)
            wrench = _sum_of_six(wrench, more)
            on_housing = _sum_of_six(on_housing, more_on_housing)
    return wrench, on_housing


@law
def _sum_of_six(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])


@law
def write_branch_rates(x, dx, first, rate, rubber):
    """Write the time derivatives of the stretches of a bushing.

    Args:
        x, dx: State and its time derivative.
        first: Index in them of the first stretch of the bushing.
        rate: Rate of the displacement of the six axes. [m/s, rad/s]
        rubber: Named numbers of `RUBBER`.
    """
    for axis in range(AXIS_COUNT):
        at = whole_number(rubber.dahl_state[axis])
        if at >= 0:
            k = first + at
            dx[k] = dahl_rate(x[k], rate[axis], rubber.dahl_displacement[axis])
        at = whole_number(rubber.maxwell_state[axis])
        if at >= 0:
            k = first + at
            dx[k] = maxwell_rate(
                x[k], rate[axis], rubber.maxwell_stiffness[axis], rubber.maxwell_damping[axis]
            )


@law
def evaluate_rubber_bushing(x, state, p, generalized_force, force, rate):
    """Write the force of a bushing with branches, and the rates of their stretches.

    Arguments as in `ElementSystem`, numbers of `RUBBER_BUSHING`; the state has one number for each
    branch in use.
    """
    motion, q = tub_motion(numbers(x)), numbers(p)
    whole = read_rubber_bushing(q, 0)
    wrench, on_housing = six_component_bushing_wrench(motion, *whole.bushing)
    more, more_on_housing = rubber_wrench(motion, numbers(state), 0, q, 0)
    wrench = _sum_of_six(wrench, more)
    write_generalized_force(generalized_force, 0, wrench, 0.0 * wrench[0])
    for i in range(AXIS_COUNT):
        force[i] = on_housing[i] + more_on_housing[i]
    at_point = rubber_motion(motion, *whole.bushing)
    write_branch_rates(state, rate, 0, at_point.rate, read_rubber(*whole.rubber))


SIX_COMPONENT_BUSHING_OF_RUBBER = ElementKind(
    name="rubber_bushing",
    parameters=Bushing,
    layout=RUBBER_BUSHING,
    place=placed_bushing,
    outputs=WRENCH_OUTPUTS,
    words="six-component bushing of rubber, with a state for the stretch of each branch in use",
    described=BUSHING_FRAMES,
    picture="points",
    on_plant=evaluate_rubber_bushing,
)
