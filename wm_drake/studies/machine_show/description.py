"""Description of a machine in SI units, complete enough to rebuild it elsewhere; its modes."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from wm_drake.compiler.compilation import generic
from wm_drake.compiler.vectors import rotation_from_rpy
from wm_drake.elements.spin_profile import drum_motion
from wm_drake.elements.state_map import BEARING_WORDS
from wm_drake.engines.compiled.step_check import fastest_motions
from wm_drake.model.bodies import oscillating_bodies
from wm_drake.model.build import AnyMachine, machine_of
from wm_drake.model.equilibrium import tensions_at
from wm_drake.model.machine import Setup
from wm_drake.model.sdf_names import tubes_of
from wm_drake.model.state_layout import CARRIER
from wm_drake.parameters import DAMPER_LAWS, BushingType, ForceTable, MachineParameters, TorqueTable
from wm_drake.parameters.rubber import RubberBranches
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.band import (
    FILTER_ORDER,
    HIGH_PASS_HZ,
    PADDING_PERIODS,
    RMS_FILTER_ORDER,
    pass_band,
)
from wm_drake.studies.machine_show.schema import VERSION
from wm_drake.studies.modes.linearisation import MODES, Linearisation
from wm_drake.studies.modes.shapes import shape_of

_BEARING_NUMBERS = [
    f"{kind}_{axis}"
    for kind in ("stiffness", "rotational_stiffness", "damping", "rotational_damping")
    for axis in "xyz"
]
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

PRODUCTS = ("xx", "yy", "zz", "xy", "xz", "yz")


def describe(machine: AnyMachine) -> dict[str, Any]:
    """Return the description of a machine at rest, in SI units (m, kg, s, rad, N).

    The frames are W (housing), T (tub) and D (drum); in the SDF all three coincide. The suffix of a
    key is the frame in which a point or direction is given. Inertias are about the centre of mass;
    products of inertia are elements of the matrix.

    Example:
        >>> import wm_drake as wm
        >>> description = wm.describe(wm.build_machine(wm.load_machine("reference")))
        >>> description["machine"], description["gravity_W"]
        ('reference', [0.0, 0.0, -9.81])
    """
    machine = machine_of(machine)
    setup, modes = machine.set_up(), natural_modes(machine)
    parameters, bodies = setup.parameters, _bodies(setup)
    described = {
        "machine": parameters.name,
        "units": "SI: m, kg, s, rad, N; x right, y to the rear, z up",
        "format": VERSION,
        "conventions": CONVENTIONS,
        "laws": _laws(parameters),
        "gravity_W": [0.0, 0.0, -parameters.gravity],
        "bodies": bodies,
        "oscillating_mass_kg": oscillating_mass(setup),
        "drum_joint": {"name": parameters.drive.joint, **_drum_axis(setup)},
        "drum_bearing": _drum_bearing(setup),
        "motor": _motor(setup),
        "imperfections": parameters.imperfections.model_dump(exclude={"bearing"}),
        "springs": {name: _spring(setup, name) for name in setup.springs},
        "dampers": {name: _damper(setup, name) for name in setup.dampers},
        "bushings": {name: _bushing(setup, name) for name in setup.bushings},
        "telescopic_dampers": {name: _telescope(setup, name) for name in setup.telescopes},
        "sensors": {
            name: {"point_T": setup.sensor_points[name].tolist(), "axis_W": sensor.axis}
            for name, sensor in parameters.sensors.items()
        },
        "accelerometers": {
            name: {"point_T": point.tolist()} for name, point in setup.accelerometer_points.items()
        },
        "detergent_point_T": setup.detergent_point.tolist(),
        "cabinet": _cabinet(parameters),
        "loads": {name: load.model_dump() for name, load in parameters.loads.items()},
        "profile": parameters.profile.model_dump(),
        "numerics": _numerics(parameters),
        "rest_pose": _pose(setup.rest_pose),
        "sag_at_rest": _sag(setup, bodies),
        "equilibrium_residual": {
            "moment_Nm": setup.residual[:3].tolist(),
            "force_N": setup.residual[3:].tolist(),
        },
        "natural_frequencies_hz": modes.frequency_hz.tolist(),
        "mode_damping_ratios": modes.damping_ratio.tolist(),
    }
    if setup.elements.others:
        described["elements"] = {name: _element(setup, name) for name in setup.elements.others}
    return described


def _element(setup: Setup, name: str) -> dict[str, Any]:
    """Return an element of another package: its kind, its parameters and its points."""
    placed, element = setup.elements.others[name], setup.parameters.elements[name]
    return element.model_dump(exclude={"tub_frame", "housing_frame"}) | {
        "law": placed.kind.words,
        **{
            f"{name}_{'T' if name.startswith('tub') else 'W'}": value.tolist()
            for name, value in placed.ends._asdict().items()
        },
    }


def _cabinet(parameters: MachineParameters) -> dict[str, Any] | None:
    """Return the cabinet and its feet; None for a machine without one."""
    cabinet = parameters.cabinet
    if cabinet is None:
        return None
    return {
        "mass": cabinet.mass,
        "centre_of_mass_W": list(cabinet.centre_of_mass),
        "floor_z_W": cabinet.floor,
        "friction": cabinet.friction,
        "feet": {name: foot.model_dump() for name, foot in cabinet.feet.items()},
        "moves": cabinet.moves,
        "inertia_kgm2": cabinet.inertia and cabinet.inertia.model_dump(),
        "foot_type": cabinet.foot_type and cabinet.foot_type.model_dump(),
    }


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


def _numerics(parameters: MachineParameters) -> dict[str, Any]:
    period = parameters.profile.sample_period(parameters.output_period)
    band = pass_band(parameters.profile, period)
    both_ways = "forwards and backwards, so that no phase is shifted"
    return {
        "integrator": INTEGRATORS[parameters.integrator],
        "step_s": parameters.step,
        "output_period_s": period,
        "displacement_filter": f"Butterworth band-pass of order {FILTER_ORDER}, {both_ways}; ends "
        f"mirrored over {PADDING_PERIODS / band[0]:g} s",
        "displacement_band_hz": list(band),
        "rms_filter": f"Butterworth high-pass of order {RMS_FILTER_ORDER}, {both_ways}",
        "rms_high_pass_hz": HIGH_PASS_HZ,
    }


def _pose(values: FloatArray) -> dict[str, float]:
    return dict(zip(("roll", "pitch", "yaw", "x", "y", "z"), values.tolist(), strict=True))


def oscillating_mass(setup: Setup) -> float:
    """Return the mass of the tub, all bodies welded to it, the drum and its load. [kg]"""
    bodies = oscillating_bodies(setup.machine.plant)
    return float(sum(body.get_mass(setup.plant_context) for body in bodies))


def _sag(setup: Setup, bodies: dict[str, Any]) -> float:
    """Return by how much the centre of mass of tub and drum is below its place as drawn. [m]"""
    context, lost = setup.plant_context, 0.0
    for body in oscillating_bodies(setup.machine.plant):
        centre = body.EvalPoseInWorld(context) @ body.CalcCenterOfMassInBodyFrame(context)
        drawn = bodies[body.name()]["centre_of_mass_T"][2]
        lost += body.get_mass(context) * (drawn - float(centre[2]))
    return lost / oscillating_mass(setup)


def _bodies(setup: Setup) -> dict[str, Any]:
    plant, context = setup.machine.plant, setup.plant_context
    tub = plant.GetBodyByName("tub").body_frame()
    described = {}
    moving = oscillating_bodies(setup.machine.plant)
    groups = {part.name(): "drum" if part.name() == "drum" else "tub" for part in moving}
    # in a compliant bearing, describe the drum relative to its carrier, which is T in the SDF
    carriers = {"drum": plant.GetBodyByName(CARRIER).body_frame()} if setup.bearing else {}
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
        described[part.name()] = {
            "turns_with": groups.get(part.name(), part.name()),
            "mass": M_B.get_mass(),
            "centre_of_mass_T": (X_TB @ M_B.get_com()).tolist(),
            "inertia_about_centre_T": {
                key: float(matrix["xyz".index(key[0]), "xyz".index(key[1])]) for key in PRODUCTS
            },
        }
    return described


def _drum_axis(setup: Setup) -> dict[str, Any]:
    joint = setup.machine.plant.GetJointByName(setup.parameters.drive.joint)
    X_TF = joint.frame_on_parent().CalcPoseInBodyFrame(setup.plant_context)
    axis = X_TF.rotation() @ joint.revolute_axis()
    _, start_angle = drum_motion(setup.parameters.profile, np.zeros(1))
    return {
        "axis_T": list(map(float, axis)),
        "through_T": list(map(float, X_TF.translation())),
        "start_angle": float(start_angle[0]),
    }


def _drum_bearing(setup: Setup) -> dict[str, Any] | None:
    """Return the position and the six components of a compliant bearing; None for a rigid bearing.

    The components are along x, y and z of a frame whose y axis is the drum axis.
    """
    placed, bearing = setup.bearing, setup.parameters.imperfections.bearing
    if placed is None or bearing is None:
        return None
    kind = bearing.as_bushing().model_dump(include=set(_BEARING_NUMBERS))
    sag = setup.carrier_rest[3:] - setup.rest_pose[3:]
    rate = {"fastest_motion_hz": fastest_motions(setup)[BEARING_WORDS].rate / (2.0 * np.pi)}
    return {
        "point_T": placed.ground_side_point.tolist(),
        "rotation_T": placed.ground_side_rotation.tolist(),
        **kind,
        "sag_of_Do_at_rest_W": sag.tolist(),
        **rate,
    }


def _motor(setup: Setup) -> dict[str, Any] | None:
    """Return the motor; None if the speed of the drum is prescribed."""
    drive = setup.motor
    if drive is None:
        return None
    return {
        "belt_ratio": drive.belt_ratio,
        "rotor_inertia_kgm2": drive.rotor_inertia,
        "reflected_inertia_kgm2": drive.reflected_inertia,
        "torque_limit": drive.torque_limit.model_dump(),
        "controller": drive.controller.model_dump(),
        "bearing_friction": drive.bearing_friction.model_dump(),
        "torque_constant_NmA": drive.torque_constant,
    }


def _line(setup: Setup, element: Any) -> dict[str, Any]:
    """Return ends, length and direction of a strut at the rest pose.

    The direction points from the housing end to the tub end.
    """
    rotation = np.reshape(generic(rotation_from_rpy)(*setup.rest_pose[:3]), (3, 3))
    line = setup.rest_pose[3:] + rotation @ element.p_ToA_T - element.p_WH
    length = float(np.linalg.norm(line))
    return {
        "tub_point_T": element.p_ToA_T.tolist(),
        "housing_point_W": element.p_WH.tolist(),
        "length_at_rest": length,
        "direction_at_rest_W": (line / length).tolist(),
    }


def _spring(setup: Setup, name: str) -> dict[str, Any]:
    placed = setup.springs[name]
    kind = setup.parameters.spring_types[setup.parameters.springs[name].type]
    return {
        **_line(setup, placed),
        "action": kind.action,
        "stiffness": _stiffness(kind.stiffness),
        "length_at_preload": placed.rest_length,
        "preload": placed.preload,
        "tension_at_rest": tensions_at(setup.elements, setup.rest_pose)[name],
        "taut_from": None if placed.pushes else placed.taut_from,
        "free_length": placed.free_length,
    }


def _damper(setup: Setup, name: str) -> dict[str, Any]:
    kind = setup.parameters.damper_types[setup.parameters.dampers[name].type]
    placed = setup.dampers[name]
    line = placed.p_ToA_T - placed.p_WH
    neutral = (line / np.linalg.norm(line)).tolist()
    return {**_line(setup, placed), "neutral_direction": neutral, **kind.model_dump()}


def _bushing(setup: Setup, name: str) -> dict[str, Any]:
    placed = setup.bushings[name]
    element = setup.parameters.all_bushings()[name]
    constants = {
        key: _stiffness(value) if isinstance(value, ForceTable | TorqueTable) else value
        for key, value in element
        if key in BushingType.model_fields
    }
    rubber = {key: value for key, value in element if key in RubberBranches.model_fields and value}
    if rubber:
        constants["rubber"] = rubber
    return {
        "tub_point_T": placed.tub_side_point.tolist(),
        "tub_rotation_T": placed.tub_side_rotation.tolist(),
        "housing_point_W": placed.ground_side_point.tolist(),
        "housing_rotation_W": placed.ground_side_rotation.tolist(),
        **constants,
    }


def _telescope(setup: Setup, name: str) -> dict[str, Any]:
    placed, damper = setup.telescopes[name], setup.parameters.telescopic_dampers[name]
    kind = setup.parameters.damper_types[damper.type]
    tubes = [body.name() for body in tubes_of(setup.machine.plant, damper.joint)]
    rest = setup.tube_rest[list(setup.telescopes).index(name)]
    return {
        "outer_tube": tubes[0],
        "inner_tube": tubes[1],
        "axis_outer_tube": placed.axis.tolist(),
        "tub_point_T": placed.tub_bushing.tub_side_point.tolist(),
        "outer_point_outer_tube": placed.tub_bushing.ground_side_point.tolist(),
        "inner_point_outer_tube": placed.housing_bushing.tub_side_point.tolist(),
        "housing_point_W": placed.housing_bushing.ground_side_point.tolist(),
        "tub_bushing": setup.parameters.bushing_types[damper.tub_bushing].model_dump(),
        "housing_bushing": setup.parameters.bushing_types[damper.housing_bushing].model_dump(),
        "tub_bushing_on_tub_rotation_T": placed.tub_bushing.tub_side_rotation.tolist(),
        "tub_bushing_law_rotation_outer_tube": placed.tub_bushing.ground_side_rotation.tolist(),
        "housing_bushing_on_inner_tube_rotation_outer_tube": (
            placed.housing_bushing.tub_side_rotation.tolist()
        ),
        "housing_bushing_law_rotation_W": placed.housing_bushing.ground_side_rotation.tolist(),
        "outer_tube_rest_pose": _pose(rest[:6]),
        "extension_at_rest": float(rest[6]),
        **kind.model_dump(exclude={"end_bushing"}),
    }


def _stiffness(value: Any) -> Any:
    return value.model_dump() if isinstance(value, ForceTable | TorqueTable) else value


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


@dataclass(frozen=True)
class Modes:
    """Natural modes in rising order of frequency.

    Attributes:
        frequency_hz: (n,) natural frequencies |lambda| / (2 pi). [Hz]
        damping_ratio: (n,) -Re(lambda) / |lambda|.
        shape: (n, 6) mode shapes: roll, pitch, yaw, x, y, z of T. Each is the real part at the
            phase of its largest component, scaled so that this component is 1 after angles are
            multiplied by 0.25 m. [rad, m]
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    shape: FloatArray


def natural_modes(
    machine: AnyMachine, parameters: MachineParameters | None = None, *, gasket: bool = True
) -> Modes:
    """Compute the natural modes of the empty machine about its rest pose, without friction.

    The drum stands still. Dampers lose their law and their friction, because friction at rest is
    neither a spring nor a dashpot; `wm_drake.studies.modes.study.modes` treats it. Their bushings
    and tubes stay. Overdamped motions are not included. Of
    the others, only the six slowest are included; damper tubes on their bushings and a drum in a
    compliant bearing have faster ones.

    Args:
        machine: A built machine, its parameters, or its name or file.
        parameters: Parameters to use; those of the built machine if None.
        gasket: False removes the gasket.

    Example:
        >>> import wm_drake as wm
        >>> modes = wm.natural_modes(wm.build_machine(wm.load_machine("reference")))
        >>> len(modes.frequency_hz)
        6
    """
    machine = machine_of(machine)
    setup = machine.set_up(parameters=parameters, gasket=gasket, dampers=False)
    spectrum = Linearisation(setup).spectrum().first(MODES)
    shapes = [shape_of(vector).real for vector in spectrum.right.T]
    return Modes(spectrum.frequency_hz, spectrum.damping_ratio, np.array(shapes))
