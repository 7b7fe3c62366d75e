"""`Setup` -> flat numbers and indices for the compiled engine, all read from the built machine."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint, SpatialInertia
from pydrake.systems.framework import Context

from wm_drake.compiler.matrices import about_centre, inverse
from wm_drake.elements.kind import ElementKind
from wm_drake.elements.motion import POSE
from wm_drake.elements.motor import motor_structure, packed_motor
from wm_drake.elements.mount import Mounts, mounts_at
from wm_drake.elements.state_map import CARRIER as CARRIER_STATES
from wm_drake.elements.state_map import ELEMENT, PLACES, TUBES, StateMap
from wm_drake.elements.water import Water
from wm_drake.engines.compiled.bearing import TUB, TUB_AND_BEARING
from wm_drake.engines.compiled.local_error import LEVER, InnerVelocities
from wm_drake.engines.compiled.mechanics import (
    BODIES,
    BODIES_SIZE,
    DRUM_RATE,
    FIRST_HARMONIC,
    SECOND_HARMONIC,
    Elements,
)
from wm_drake.engines.compiled.tubes import TUBES as TUBES_NUMBERS
from wm_drake.errors import InputError, input_error
from wm_drake.model.bodies import DRUM, axis_pose, drawn_frame, drawn_pose, moved_to, with_load
from wm_drake.model.machine import Setup
from wm_drake.model.state_layout import CABINET, CARRIER
from wm_drake.parameters import Load, SpinProfile
from wm_drake.parameters.types import FloatArray


@dataclass(frozen=True)
class Layout:
    """Indices of a machine's parts in its packed numbers. Machines that run side by side share it.

    Attributes:
        springs, dampers, bushings, telescopes: Index of each element.
        rubber: Index of each bushing of rubber.
        tubes: Index of the bodies of each telescopic damper.
        bearing: Index of the drum's compliant bearing, -1 for a rigid one.
        motor: Index of the motor, -1 if the speed of the drum is prescribed.
        cabinet: Index of the cabinet, -1 for a fixed one.
        gasket: Index of the gasket, -1 without one.
        control_period: Time between two samples of a sampled controller, else 0. [s]
        structure: Number of each damper's law and number of points of every table, in order.
        states: Order of the states.
        others, kinds: Index and kind of each element of another package.
        water: Indices of the wet masses of a load, as the fields of `Water`; None if it stays.
    """

    springs: tuple[int, ...]
    dampers: tuple[int, ...]
    bushings: tuple[int, ...]
    telescopes: tuple[int, ...]
    rubber: tuple[int, ...]
    tubes: tuple[int, ...]
    bearing: int
    motor: int
    cabinet: int
    gasket: int
    control_period: float
    structure: tuple[int, ...]
    states: StateMap
    others: tuple[int, ...] = ()
    kinds: tuple[ElementKind, ...] = ()
    water: tuple[tuple[int, ...], tuple[int, ...], int] | None = None

    @property
    def balls(self) -> list[list[int]]:
        """Return the index in the state of the place of each ball in T, for each ring."""
        begins = self.states.begins_of(ELEMENT).tolist()
        each = zip(self.kinds, begins, strict=True)
        return [[begin + k for k in kind.balls] for kind, begin in each if kind.ring]

    @functools.cached_property
    def mounts(self) -> Mounts:
        """Return the indices of the mounts in the form that compiled functions use."""
        return mounts_at(vars(self), self.rubber, self.kinds, self.states)

    @functools.cached_property
    def elements(self) -> Elements:
        """Return the indices in the form that compiled functions use.

        Without telescopic dampers, a compliant bearing, a motor or wet masses their index is None,
        and the functions are compiled without them.
        """
        tubes = np.array(self.tubes, dtype=np.int64) if self.tubes else None
        bearing, motor, cabinet = (
            at if at >= 0 else None for at in (self.bearing, self.motor, self.cabinet)
        )
        water = None
        if self.water is not None:
            draining, masses, dry = self.water
            water = Water(np.array(draining), np.array(masses), dry)
        return Elements(
            self.mounts, self.states.begins, tubes, bearing, motor, cabinet, water, self._inner
        )

    @property
    def _inner(self) -> InnerVelocities | None:
        """Return the velocities among the states of elements; None without any."""
        levers = {"m/s": 1.0, "rad/s": LEVER}
        begin = self.states.begins.elements
        units = [state.unit for kind in self.kinds for state in kind.states]
        velocities = [(begin + k, levers[u]) for k, u in enumerate(units) if u in levers]
        if not velocities:
            return None
        return InnerVelocities(*map(np.array, zip(*velocities, strict=True)))


def pack(setup: Setup) -> tuple[FloatArray, Layout]:
    """Return the packed numbers of a machine as it is set up, and their layout.

    The bodies come first (`BODIES`), then the elements.

    Raises:
        InputError: the machine has something that the compiled engine does not represent.
    """
    elements, layout = pack_elements(setup)
    return np.concatenate([drawn_bodies(setup).packed(), elements]), layout


def drawn_bodies(setup: Setup) -> "DrawnBodies":
    """Return the bodies of a machine as it is set up, with its load."""
    drive = setup.parameters.drive
    return DrawnBodies(setup.machine.plant, setup.plant_context, drive.joint)


def pack_elements(setup: Setup) -> tuple[FloatArray, Layout]:
    """Return the packed numbers behind the bodies, which no load changes, and the layout of all."""
    on_tub, begins = setup.elements.packed_on_tub(BODIES_SIZE)
    indices: dict[str, Any] = dict(begins)
    parts, structure = [on_tub], list(setup.elements.structure_on_tub)
    size = BODIES_SIZE + len(on_tub)

    def add(packed: FloatArray, points: Sequence[int] = ()) -> int:
        """Append packed numbers with their structure; return their index."""
        nonlocal size
        begin, size = size, size + len(packed)
        parts.append(packed)
        structure.extend(points)
        return begin

    tubes, telescopes = list[int](), list[int]()
    for name, telescope in setup.telescopes.items():
        tubes.append(add(pack_tubes(setup, name)))
        telescopes.append(add(telescope.packed(), telescope.structure))
    bearing, motor, cabinet, control_period = -1, -1, -1, 0.0
    if setup.bearing:
        tub, bushing = pack_rigid(setup, "tub"), setup.bearing.packed()
        bearing = add(TUB_AND_BEARING.pack(tub=tub, bearing=bushing), setup.bearing.structure)
    if drive := setup.motor:
        motor = add(packed_motor(drive), motor_structure(drive))
        control_period = drive.controller.sample_time or 0.0
    if setup.cabinet:
        cabinet = add(np.concatenate([pack_rigid(setup, CABINET), setup.cabinet.packed()]))
    return np.concatenate(parts), _shared(
        Layout(
            **indices,
            telescopes=tuple(telescopes),
            rubber=setup.elements.rubber_begins(indices),
            tubes=tuple(tubes),
            bearing=bearing,
            motor=motor,
            cabinet=cabinet,
            gasket=dict(zip(setup.bushings, indices["bushings"], strict=True)).get("gasket", -1),
            control_period=control_period,
            structure=tuple(structure),
            states=state_map(setup),
            kinds=tuple(element.kind for element in setup.elements.others.values()),
        )
    )


@functools.lru_cache(maxsize=64)
def _shared(layout: Layout) -> Layout:
    """Return the first layout that equals this one, whose indices exist already."""
    return layout


def state_map(setup: Setup) -> StateMap:
    """Return the order of the states of a machine as it is set up."""
    return setup.elements.states(drive=bool(setup.motor), cabinet=bool(setup.cabinet))


def initial_state(setup: Setup, profile: SpinProfile) -> FloatArray:
    """Return the state at the start of a run.

    The machine is at rest at the rest pose, the drum at its first speed; sponges and branches of
    rubber are relaxed, a motor is without torque.
    """
    states = state_map(setup)
    x: FloatArray = np.zeros(states.size)
    x[: POSE.fixed_size] = setup.rest_pose
    x[DRUM_RATE] = profile.speed[0]
    if setup.telescopes:
        x[states.indices(*PLACES, kinds=[TUBES])] = setup.tube_rest.ravel()
    if setup.bearing:
        x[states.indices(*PLACES, kinds=[CARRIER_STATES])] = setup.carrier_rest
    if setup.elements.others:
        x[states.span(ELEMENT)] = setup.elements.initial_of_others(profile.speed[0])
    return x


def pack_tubes(setup: Setup, name: str) -> FloatArray:
    """Return the packed bodies of a telescopic damper (`engines.compiled.tubes.TUBES`).

    Raises:
        InputError: the joint has something that the compiled engine does not represent.
    """
    plant, context = setup.machine.plant, setup.plant_context
    joint = plant.GetJointByName(setup.parameters.telescopic_dampers[name].joint)
    if np.any(joint.GetDampingVector(context)):
        raise _not_represented(
            f"joint '{joint.name()}' has damping of its own", f"telescopic_dampers.{name}.joint"
        )
    outer_inertia, inner_inertia = (
        plant.CalcSpatialInertia(
            context,
            drawn_frame(plant, body),
            [part.index() for part in plant.GetBodiesWeldedTo(body)],
        )
        for body in (joint.parent_body(), joint.child_body())
    )
    # inertia of the inner tube in the frame of the outer one, at extension 0
    frames = joint.frame_on_parent(), joint.frame_on_child()
    X_OI = drawn_pose(plant, frames[0]) @ frames[1].GetFixedPoseInBodyFrame().inverse()
    inner_inertia = inner_inertia.ReExpress(X_OI.rotation()).Shift(-X_OI.translation())
    m, s = inner_inertia.get_mass(), _moment(inner_inertia)
    a = setup.telescopes[name].axis
    along = np.dot(a, s)
    first_order = 2.0 * along * np.eye(3) - np.outer(a, s) - np.outer(s, a)
    second_order = m * (np.eye(3) - np.outer(a, a))
    both = _matrix(outer_inertia) + _matrix(inner_inertia)
    mass = outer_inertia.get_mass() + m
    return TUBES_NUMBERS.pack(
        inverse_mass=1.0 / mass,
        inner_mass=m,
        axis=a,
        moment=_moment(outer_inertia) + s,
        inner_moment=s,
        inertia=_six(both),
        inertia_slope=_six(first_order),
        inertia_curvature=_six(second_order),
    )


def pack_rigid(setup: Setup, name: str) -> FloatArray:
    """Return the packed tub without the drum, or another body, with all that is welded to it."""
    plant, context = setup.machine.plant, setup.plant_context
    body = plant.GetBodyByName(name)
    group = [other.index() for other in plant.GetBodiesWeldedTo(body)]
    inertia = plant.CalcSpatialInertia(context, drawn_frame(plant, body), group)
    q, moment, six = 1.0 / inertia.get_mass(), _moment(inertia), _six(_matrix(inertia))
    central = about_centre(tuple(six), tuple(moment), q)
    return TUB.pack(inverse_mass=q, moment=moment, inertia=six, inverse_inertia=inverse(central))


class DrawnBodies:
    """The bodies of a plant Context at the drawn pose, to which loads are added.

    With a compliant bearing these are the carrier and the drum, without the tub. They are computed
    at the drawn pose, so that the last bits do not depend on the pose of the Context, which stays.
    """

    def __init__(self, plant: MultibodyPlant, context: Context, drive: str) -> None:
        """Read the bodies.

        Args:
            plant: The plant.
            context: Its Context.
            drive: Name of the joint that the drive turns.

        Raises:
            InputError: the plant has something that the compiled engine does not represent.
        """
        positions = plant.GetPositions(context)
        plant.SetPositions(context, np.zeros(len(positions)))
        try:
            self._read(plant, context, drum_joint(plant, drive))
        finally:
            plant.SetPositions(context, positions)

    def _read(self, plant: MultibodyPlant, context: Context, joint: RevoluteJoint) -> None:
        tub = plant.GetBodyByName(CARRIER if plant.HasBodyNamed(CARRIER) else "tub")
        frame = drawn_frame(plant, tub)  # T
        X_TF = plant.CalcRelativeTransform(context, frame, joint.frame_on_parent())
        axis, origin = X_TF.rotation() @ joint.revolute_axis(), X_TF.translation()
        drum = plant.GetBodyByName(DRUM)
        groups = (
            [part.index() for part in plant.GetBodiesWeldedTo(body) if part.index() != drum.index()]
            for body in (tub, joint.child_body())
        )
        of_tub, self._welded_to_drum = (
            plant.CalcSpatialInertia(context, frame, group).Shift(origin)
            if group
            else SpatialInertia.Zero()
            for group in groups
        )
        X_BD = axis_pose(plant)
        self._drum = moved_to(drum.CalcSpatialInertiaInBodyFrame(context), X_BD)
        X_TD = plant.CalcRelativeTransform(context, frame, drum.body_frame()) @ X_BD
        self._R_TD = X_TD.rotation()
        self._p_DoO_T = np.asarray(origin - X_TD.translation())
        self._tub_mass = of_tub.get_mass()
        self._harmonics = _harmonics_operator(tuple(axis), joint.get_angle(context))
        self._numbers = BODIES.pack(
            gravity=plant.gravity_field().gravity_vector(),
            inverse_mass=0.0,
            axis=axis,
            origin=origin,
            tub_moment=_moment(of_tub),
            tub_inertia=_six(_matrix(of_tub)),
            **_drum_harmonics(np.zeros(3), np.zeros((3, 3)), axis, 0.0),
            joint_damping=joint.GetDampingVector(context),
        )

    @property
    def of_point_masses(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what the packed numbers of point masses in the drum follow from.

        Returns:
            Matrix from first moment and inertia about O, in T, to the packed harmonics (k, 9);
            rotation of D in T (3, 3); O from Do in T (3,) [m].
        """
        return self._harmonics, self._R_TD.matrix(), self._p_DoO_T

    def packed(self, *loads: Load) -> FloatArray:
        """Return the packed bodies (`BODIES`) with loads in the drum."""
        drum = self._drum
        for load in loads:
            drum = with_load(drum, load)
        in_tub = drum.ReExpress(self._R_TD).Shift(self._p_DoO_T)
        mass = in_tub.get_mass() + self._welded_to_drum.get_mass()
        moment = _moment(in_tub) + _moment(self._welded_to_drum)
        six = _six(_matrix(in_tub)) + _six(_matrix(self._welded_to_drum))
        numbers = self._numbers.copy()
        numbers[BODIES.offsets["inverse_mass"]] = 1.0 / (self._tub_mass + mass)
        begin, end = BODIES.offsets["drum_moment_x"], BODIES.offsets["joint_damping"]
        numbers[begin:end] = self._harmonics @ np.concatenate([moment, six])
        return numbers


def drum_joint(plant: MultibodyPlant, name: str) -> RevoluteJoint:
    """Return the joint that the drive turns.

    Raises:
        InputError: the plant has a joint that the compiled engine does not represent.
    """
    joint = plant.GetJointByName(name)
    if not isinstance(joint, RevoluteJoint):
        raise _not_represented(
            f"joint '{name}' is {joint.type_name()}, not revolute", "drive.joint"
        )
    tub = plant.GetBodiesWeldedTo(plant.GetBodyByName("tub"))
    if not plant.HasBodyNamed(CARRIER) and not any(
        body.index() == joint.parent_body().index() for body in tub
    ):
        raise _not_represented(
            f"joint '{name}' has the tub as its child, not as its parent", "drive.joint"
        )
    return joint


def _not_represented(what: str, key: str) -> InputError:
    """Return the error for a property of the machine that only the drake engine represents."""
    return input_error(
        f"the compiled engine does not represent this: {what}; use the drake engine", key=key
    )


def _moment(inertia: SpatialInertia) -> FloatArray:
    """Return the first moment about the reference point of an inertia. [kg m]"""
    return np.asarray(inertia.get_mass() * inertia.get_com())


def _matrix(inertia: SpatialInertia) -> FloatArray:
    """Return the rotational inertia about the reference point. (3, 3) [kg m^2]"""
    return np.array(inertia.CalcRotationalInertia().CopyToFullMatrix3())


def _six(matrix: FloatArray) -> FloatArray:
    """Return the elements xx, yy, zz, xy, xz, yz of a symmetric matrix. (6,)"""
    return matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


@functools.lru_cache(maxsize=64)
def _harmonics_operator(axis: tuple[float, float, float], angle: float) -> FloatArray:
    """Return the matrix from first moment and inertia of the drum to its packed harmonics. (k, 9)

    Args:
        axis: Unit vector.
        angle: Drum angle at which moment (x, y, z) and inertia (xx, yy, zz, xy, xz, yz) are given.
    """
    columns = []
    for unit in np.eye(9):
        xx, yy, zz, xy, xz, yz = unit[3:]
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        parts = _drum_harmonics(unit[:3], matrix, np.array(axis), angle)
        columns.append(np.concatenate([parts[name] for name in BODIES.fields if name in parts]))
    return np.column_stack(columns)


def _drum_harmonics(
    moment: FloatArray, inertia: FloatArray, axis: FloatArray, angle: float
) -> dict[str, FloatArray]:
    """Return first moment and inertia of the drum as packed harmonics of the drum angle, by name.

    With R = A + B cos + C sin for a rotation about the axis they are R s and R J R^T; products of
    cosine and sine are written in the double angle.

    Args:
        moment, inertia: About a point of the axis, at `angle`. (3,) [kg m], (3, 3) [kg m^2]
        axis: Unit vector.
        angle: Drum angle. [rad]
    """
    along = np.outer(axis, axis)
    across = np.eye(3) - along
    turned = np.cross(axis, np.eye(3)).T  # axis x .
    back = along + across * np.cos(angle) - turned * np.sin(angle)
    s, j = back @ moment, back @ inertia @ back.T

    def product(left: FloatArray, right: FloatArray) -> FloatArray:
        return left @ j @ right.T

    cosine_squared, sine_squared = product(across, across), product(turned, turned)
    first = {"mean": along @ s, "cosine": across @ s, "sine": turned @ s}
    matrices = {
        "mean": product(along, along) + 0.5 * (cosine_squared + sine_squared),
        "cosine": product(along, across) + product(across, along),
        "sine": product(along, turned) + product(turned, along),
        "double_cosine": 0.5 * (cosine_squared - sine_squared),
        "double_sine": 0.5 * (product(across, turned) + product(turned, across)),
    }
    entries = {part: _six(matrix) for part, matrix in matrices.items()}
    moments = {
        f"drum_moment_{letter}": FIRST_HARMONIC.pack(**{part: v[k] for part, v in first.items()})
        for k, letter in enumerate("xyz")
    }
    inertias = {
        f"drum_inertia_{entry}": SECOND_HARMONIC.pack(**{part: v[k] for part, v in entries.items()})
        for k, entry in enumerate(("xx", "yy", "zz", "xy", "xz", "yz"))
    }
    return moments | inertias
