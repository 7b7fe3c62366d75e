"""Description of a machine in SI units, complete enough to rebuild it in another program.

Each type declares keys, units and meaning, from which pydantic writes the JSON schema. The suffix
of a key is the frame of a point or direction: W housing, T tub, D drum.
"""

from typing import Any, Literal

import numpy as np
from pydantic import Field

from wm_drake.elements.kind import element_kind
from wm_drake.elements.spin_profile import drum_motion
from wm_drake.elements.state_map import BEARING_WORDS
from wm_drake.engines.compiled.step_check import fastest_motions
from wm_drake.model.bodies import DRUM, drawn_frame, drawn_pose, oscillating_bodies
from wm_drake.model.build import AnyMachine, machine_of
from wm_drake.model.machine import Machine, Setup
from wm_drake.model.sdf_names import tubes_of
from wm_drake.model.state_layout import CARRIER
from wm_drake.parameters import DAMPER_LAWS, InertiaMatrix, Load, MachineParameters, SpinProfile
from wm_drake.parameters import units as u
from wm_drake.parameters.cabinet import Cabinet
from wm_drake.parameters.drive import MotorDrive
from wm_drake.parameters.element_kinds import ELEMENT_KINDS
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.file_keys import DocumentedSchema
from wm_drake.parameters.machine import Imperfections
from wm_drake.parameters.sections import SECTIONS
from wm_drake.simulation.band import (
    FILTER_ORDER,
    HIGH_PASS_HZ,
    PADDING_PERIODS,
    RMS_FILTER_ORDER,
    pass_band,
)
from wm_drake.studies.machine_show.elements import (
    Bushing,
    Damper,
    Open,
    OtherElement,
    Pose,
    Rotation,
    Spring,
    TelescopicDamper,
    Vector,
    described_elements,
    described_type,
)
from wm_drake.studies.modes.linearisation import MODES, Linearisation

VERSION = "wm_drake machine description 4"
"""Name and version of the format. In version 3 cabinet and motor had keys other than those of
the machine file, and rubber a group of its own; in version 2 springs could not go slack; version 1
had no key `format`."""

CONVENTIONS = {
    "frames": "W housing, T tub, D drum; x right, y to the rear, z up. As drawn, all coincide.",
    "rest pose": "Equilibrium of the empty machine. Displacements count from it.",
    "drum angle": "Right-handed about drum_joint.axis_T, measured from T. The speed is its rate.",
    "phase": "A mass at phase 0 is on +z of D, at phase 90 deg on +x: the sense of rotation "
    "about +y.",
    "start of a run": "Tub at the rest pose without velocity, drum at drum_joint.start_angle with "
    "the first speed of the profile, sponges undeformed.",
    "loads": "Point masses are added to mass, centre and inertia of the drum. The empty machine "
    "has none.",
    "drum motion": "Prescribed by the profile, or turned by the motor, whose controller wants the "
    "speed of the profile; the motor torque reacts on the tub.",
    "tables": "PCHIP (Fritsch and Carlson 1980, as in scipy) between points; beyond the ends "
    "straight, with the slope at the end.",
    "rotation vector": "Axis times angle of the rotation of the tub-side frame in the law frame "
    "of a bushing. Torques do work on the rates of its components.",
    "bushing forces": "On the tub side at its point; the reaction on the other side acts at the "
    "same point of space.",
    "end bushings": "Neutral as drawn. The moment is proportional to the angle between strut and "
    "neutral direction; spin about the strut is free; the couple on the strut is balanced by "
    "transverse forces at its ends.",
}
"""Conventions that a rebuilt machine needs, by subject."""


class Body(Frozen):
    """A rigid body without load, at the rest pose and drum angle 0."""

    turns_with: str = Field(description="Body that it moves with: tub, drum, or its own name.")
    mass: u.Mass
    centre_of_mass_T: u.Position
    inertia_about_centre_T: InertiaMatrix


class DrumJoint(Frozen):
    """The joint by which the drum turns in the tub, or in the carrier of a compliant bearing."""

    name: str
    axis_T: Vector = Field(description="Unit vector; the drum angle is right-handed about it.")
    through_T: u.Position = Field(description="A point of the axis.")
    start_angle: u.Angle = Field(description="Drum angle at time 0, where D coincides with T.")


BEARING_KEYS = tuple(
    f"{kind}_{axis}"
    for kind in ("stiffness", "rotational_stiffness", "damping", "rotational_damping")
    for axis in "xyz"
)
"""Keys of the components of a compliant bearing, those of a bushing."""


class DrumBearing(Open):
    """A compliant bearing between tub and drum carrier; the other keys are its six components."""

    point_T: u.Position
    rotation_T: Rotation = Field(description="Its y axis is the drum axis.")
    sag_of_Do_at_rest_W: Vector = Field(description="Of the origin of D against T. [m]")
    fastest_motion_hz: float


class Motor(MotorDrive):
    """A motor with belt and speed controller; the inertias of tub and drum contain its rotor."""

    reflected_inertia_kgm2: u.Inertia = Field(
        description="Acts on the joint of the drum alone, in addition to the inertia of the drum."
    )


class Accelerometer(Frozen):
    """A vibration sensor at a point of the tub, along all axes of W."""

    point_T: u.Position


class Sensor(Accelerometer):
    """A sensor of the displacement of a point of the tub from its rest position, along one axis."""

    axis_W: Literal["x", "y", "z"]


class Residual(Frozen):
    """What remains of moment about To and force on the tub at the rest pose."""

    moment_Nm: Vector
    force_N: Vector


class Numerics(Frozen):
    """Numbers of the integration and of the signal processing."""

    integrator: str
    step_s: u.Duration
    output_period_s: u.Duration
    displacement_filter: str
    displacement_band_hz: tuple[float, float]
    rms_filter: str
    rms_high_pass_hz: float


class Description(Frozen):
    """A machine in SI units, complete enough to rebuild it in another program.

    The suffix of a key is the frame of a point or direction: W housing, T tub, D drum.
    """

    machine: str
    units: str = "SI: m, kg, s, rad, N; x right, y to the rear, z up"
    format: str = Field(VERSION, description=f"'{VERSION}'")
    conventions: dict[str, str] = Field(
        CONVENTIONS, description="Conventions by subject, as sentences."
    )
    laws: dict[str, str] = Field(description="Equation numbers of the laws in use, by name.")
    gravity_W: Vector = Field(description="[m/s^2]")
    bodies: dict[str, Body]
    oscillating_mass_kg: u.Mass
    drum_joint: DrumJoint
    drum_bearing: DrumBearing | None
    motor: Motor | None
    imperfections: Imperfections
    springs: dict[str, Spring]
    dampers: dict[str, Damper]
    bushings: dict[str, Bushing]
    telescopic_dampers: dict[str, TelescopicDamper]
    sensors: dict[str, Sensor]
    accelerometers: dict[str, Accelerometer]
    detergent_point_T: u.Position
    cabinet: Cabinet | None
    loads: dict[str, Load]
    profile: SpinProfile
    numerics: Numerics
    rest_pose: Pose
    sag_at_rest: u.Length = Field(
        description="By how much the centre of mass of tub and drum is below its drawn place."
    )
    equilibrium_residual: Residual
    natural_frequencies_hz: list[float]
    mode_damping_ratios: list[float]
    elements: dict[str, OtherElement] = Field(description="Elements of the section `elements`.")


def description_schema() -> dict[str, Any]:
    """Return the JSON schema of what `describe` returns and `machine show --json` prints."""
    schema = Description.model_json_schema(mode="serialization", schema_generator=DocumentedSchema)
    kinds = {
        name: described_type(element_kind(name), kind.parameters).model_json_schema(
            mode="serialization", schema_generator=DocumentedSchema
        )
        for name, kind in ELEMENT_KINDS.items()
    }
    schema["$defs"]["OtherElement"]["anyOf"] = [{"$ref": f"#/$defs/{name}"} for name in kinds]
    schema["$defs"] |= kinds
    return {"$schema": DocumentedSchema.schema_dialect, **schema}


def describe(machine: AnyMachine) -> dict[str, Any]:
    """Return the description of a machine at rest, in SI units (m, kg, s, rad, N).

    The frames are W (housing), T (tub) and D (drum); in the SDF all three coincide. The suffix of a
    key is the frame in which a point or direction is given. Inertias are about the centre of mass;
    products of inertia are elements of the matrix. `wm-drake machine schema description` has all
    keys with their meaning.

    Example:
        >>> import wm_drake as wm
        >>> description = wm.describe(wm.build_machine(wm.load_machine("reference")))
        >>> description["machine"], description["gravity_W"]
        ('reference', [0.0, 0.0, -9.81])
    """
    return description_of(machine_of(machine)).model_dump(mode="json")


def description_of(machine: Machine) -> Description:
    """Return the description of a machine at rest as an object."""
    setup = machine.set_up()
    modes = Linearisation(machine.set_up(dampers=False)).spectrum().first(MODES)
    parameters, bodies = setup.parameters, _bodies(setup)
    motor, elements = setup.motor, {name: described_elements(setup, name) for name in SECTIONS}
    return Description(
        machine=parameters.name,
        laws=_laws(parameters),
        gravity_W=(0.0, 0.0, -parameters.gravity),
        bodies=bodies,
        oscillating_mass_kg=oscillating_mass(setup),
        drum_joint=_drum_joint(setup),
        drum_bearing=_drum_bearing(setup),
        motor=None
        if motor is None
        else Motor(**dict(motor), reflected_inertia_kgm2=motor.reflected_inertia),
        imperfections=parameters.imperfections,
        sensors={
            name: Sensor(point_T=setup.sensor_points[name].tolist(), axis_W=sensor.axis)
            for name, sensor in parameters.sensors.items()
        },
        accelerometers={
            name: Accelerometer(point_T=point.tolist())
            for name, point in setup.accelerometer_points.items()
        },
        detergent_point_T=setup.detergent_point.tolist(),
        cabinet=parameters.cabinet,
        loads=parameters.loads,
        profile=parameters.profile,
        numerics=_numerics(parameters),
        rest_pose=Pose.of(setup.rest_pose),
        sag_at_rest=_sag(setup, bodies),
        equilibrium_residual=Residual(
            moment_Nm=setup.residual[:3].tolist(), force_N=setup.residual[3:].tolist()
        ),
        natural_frequencies_hz=modes.frequency_hz.tolist(),
        mode_damping_ratios=modes.damping_ratio.tolist(),
        **elements,
    )


def _laws(parameters: MachineParameters) -> dict[str, str]:
    """Return the equation numbers of the laws that a machine uses, by name of the law."""
    laws = {
        kind.law: f"{DAMPER_LAWS[kind.law].equations}; wm_drake.laws.damper."
        f"{DAMPER_LAWS[kind.law].response.__name__}"
        for kind in parameters.damper_types.values()
    }
    laws["spring"] = "Hooke's law; wm_drake.laws.spring.spring_tension"
    if parameters.all_bushings() or parameters.telescopic_dampers:
        laws["bushing"] = "[A] (7), (8), [B] Fig. 4; wm_drake.laws.bushing.bushing_force"
    if any(bushing.branches_in_use for bushing in parameters.all_bushings().values()):
        laws["rubber"] = (
            "friction F_max z / x_c with z' = v - |v| z / x_c (Dahl 1968; F_max dahl_force, x_c "
            "dahl_displacement), Maxwell spring k z with z' = v - k z / c, cross-stiffness K: "
            "F_i = -K_ij q_j over position and rotation vector; wm_drake.laws.rubber"
        )
    if parameters.dampers:
        laws["end_bushing"] = "[A] (7), [B] section 3; wm_drake.laws.strut.bending_moment"
    return laws


_RUNGE_KUTTA = "classical Runge-Kutta method of fourth order, fixed step"
_MULTISTEP = "explicit multistep method of fourth order, one derivative a step, fixed step"
_MIDPOINT = (
    "implicit midpoint rule with one Newton step and a constant Jacobian of each damper's tubes, "
    "one derivative a step, fixed step"
)
INTEGRATORS = {
    "auto": f"{_MULTISTEP}, where it suits the machine; with telescopic dampers {_MIDPOINT}; "
    f"else {_RUNGE_KUTTA}",
    "multistep": _MULTISTEP,
    "midpoint": _MIDPOINT,
    "runge_kutta": _RUNGE_KUTTA,
}
"""Description of each integrator of the compiled engine."""


def _numerics(parameters: MachineParameters) -> Numerics:
    period = parameters.profile.sample_period(parameters.output_period)
    band = pass_band(parameters.profile, period)
    both_ways = "forwards and backwards, so that no phase is shifted"
    return Numerics(
        integrator=INTEGRATORS[parameters.integrator],
        step_s=parameters.step,
        output_period_s=period,
        displacement_filter=f"Butterworth band-pass of order {FILTER_ORDER}, {both_ways}; ends "
        f"mirrored over {PADDING_PERIODS / band[0]:g} s",
        displacement_band_hz=band,
        rms_filter=f"Butterworth high-pass of order {RMS_FILTER_ORDER}, {both_ways}",
        rms_high_pass_hz=HIGH_PASS_HZ,
    )


def oscillating_mass(setup: Setup) -> float:
    """Return the mass of the tub, all bodies welded to it, the drum and its load. [kg]"""
    bodies = oscillating_bodies(setup.machine.plant)
    return float(sum(body.get_mass(setup.plant_context) for body in bodies))


def _sag(setup: Setup, bodies: dict[str, Body]) -> float:
    """Return by how much the centre of mass of tub and drum is below its place as drawn. [m]"""
    context, lost = setup.plant_context, 0.0
    for body in oscillating_bodies(setup.machine.plant):
        centre = body.EvalPoseInWorld(context) @ body.CalcCenterOfMassInBodyFrame(context)
        drawn = bodies[body.name()].centre_of_mass_T[2]
        lost += body.get_mass(context) * (drawn - float(centre[2]))
    return lost / oscillating_mass(setup)


def _bodies(setup: Setup) -> dict[str, Body]:
    """Return the bodies that move, and the tubes of telescopic dampers, by name."""
    plant, context = setup.machine.plant, setup.plant_context
    tub, described = drawn_frame(plant, plant.GetBodyByName("tub")), {}
    moving = oscillating_bodies(plant)
    of_drum = {part.name() for part in plant.GetBodiesWeldedTo(plant.GetBodyByName(DRUM))}
    groups = {part.name(): "drum" if part.name() in of_drum else "tub" for part in moving}
    # in a compliant bearing, describe the drum relative to its carrier, which is T in the SDF
    carrier = plant.GetBodyByName(CARRIER).body_frame() if setup.bearing else tub
    carriers = dict.fromkeys(of_drum, carrier)
    tubes = [
        body
        for damper in setup.parameters.telescopic_dampers.values()
        for body in tubes_of(plant, damper.joint)
    ]
    for part in [*moving, *tubes]:
        X_TB = plant.CalcRelativeTransform(
            context, carriers.get(part.name(), tub), part.body_frame()
        )
        M_B = part.CalcSpatialInertiaInBodyFrame(context)
        central = M_B.Shift(M_B.get_com()).CalcRotationalInertia().ReExpress(X_TB.rotation())
        matrix = central.CopyToFullMatrix3()
        inertia: dict[str, Any] = {
            key: float(matrix["xyz".index(key[0]), "xyz".index(key[1])])
            for key in InertiaMatrix.model_fields
        }
        described[part.name()] = Body(
            turns_with=groups.get(part.name(), part.name()),
            mass=M_B.get_mass(),
            centre_of_mass_T=(X_TB @ M_B.get_com()).tolist(),
            inertia_about_centre_T=InertiaMatrix.model_construct(**inertia),
        )
    return described


def _drum_joint(setup: Setup) -> DrumJoint:
    joint = setup.machine.plant.GetJointByName(setup.parameters.drive.joint)
    X_TF = drawn_pose(setup.machine.plant, joint.frame_on_parent())
    _, start_angle = drum_motion(setup.parameters.profile, np.zeros(1))
    return DrumJoint(
        name=setup.parameters.drive.joint,
        axis_T=(X_TF.rotation() @ joint.revolute_axis()).tolist(),
        through_T=X_TF.translation().tolist(),
        start_angle=float(start_angle[0]),
    )


def _drum_bearing(setup: Setup) -> DrumBearing | None:
    """Return a compliant bearing; None for a rigid one.

    Its components are along x, y and z of a frame whose y axis is the drum axis.
    """
    placed, bearing = setup.bearing, setup.parameters.imperfections.bearing
    if placed is None or bearing is None:
        return None
    numbers = dict(bearing.as_bushing())
    sag = setup.carrier_rest[3:] - setup.rest_pose[3:]
    return DrumBearing(
        point_T=placed.ground_side_point.tolist(),
        rotation_T=placed.ground_side_rotation.tolist(),
        **{key: numbers[key] for key in BEARING_KEYS},
        sag_of_Do_at_rest_W=sag.tolist(),
        fastest_motion_hz=fastest_motions(setup)[BEARING_WORDS].rate / (2.0 * np.pi),
    )


def as_text(description: dict[str, Any]) -> str:
    """Return a description as text for a terminal: one indented line for each number or list."""
    return "\n".join(_lines(description, ""))


def _lines(node: Any, indent: str) -> list[str]:
    lines = []
    for key, value in node.items():
        if isinstance(value, dict):
            lines += [f"{indent}{key}:", *_lines(value, indent + "  ")]
        else:
            lines.append(f"{indent}{key}: {_short(value)}")
    return lines


def _short(value: Any) -> str:
    if isinstance(value, list | tuple):
        return "(" + ", ".join(_short(item) for item in value) + ")"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_short(item)}" for key, item in value.items()) + "}"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
