"""Schema of the description of a machine: which keys it has, their types, units and meaning.

The models are the one home of the format; `description_schema` returns them as JSON schema.
"""

from typing import Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

VERSION = "wm_drake machine description 3"
"""Name and version of the format. In version 2 springs could not go slack; version 1 had no key
`format`."""

Vector: TypeAlias = tuple[float, float, float]
Rotation: TypeAlias = tuple[Vector, Vector, Vector]


class _Part(BaseModel):
    """Part of a description; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", strict=False)


class ForceCurve(_Part):
    """Table of a force: monotone cubic (PCHIP) between points, straight beyond the ends."""

    displacement: tuple[float, ...] = Field(description="Rising. [m]")
    force: tuple[float, ...] = Field(description="[N]")


class TorqueCurve(_Part):
    """Table of a torque: monotone cubic (PCHIP) between points, straight beyond the ends."""

    angle: tuple[float, ...] = Field(description="Rising. [rad]")
    torque: tuple[float, ...] = Field(description="[N m]")


class Pose(_Part):
    """Pose of a frame in W: R = Rz(yaw) Ry(pitch) Rx(roll), then the position of its origin."""

    roll: float = Field(description="[rad]")
    pitch: float = Field(description="[rad]")
    yaw: float = Field(description="[rad]")
    x: float = Field(description="[m]")
    y: float = Field(description="[m]")
    z: float = Field(description="[m]")


class Inertia(_Part):
    """Elements of the inertia matrix about the centre of mass; xy is the element, -sum(m x y)."""

    xx: float = Field(description="[kg m^2]")
    yy: float = Field(description="[kg m^2]")
    zz: float = Field(description="[kg m^2]")
    xy: float = Field(description="[kg m^2]")
    xz: float = Field(description="[kg m^2]")
    yz: float = Field(description="[kg m^2]")


class Body(_Part):
    """A rigid body without load, at the rest pose and drum angle 0."""

    turns_with: str = Field(description="Body that it moves with: tub, drum, or its own name.")
    mass: float = Field(description="[kg]")
    centre_of_mass_T: Vector = Field(description="[m]")
    inertia_about_centre_T: Inertia


class DrumJoint(_Part):
    """The joint by which the drum turns in the tub, or in the carrier of a compliant bearing."""

    name: str
    axis_T: Vector = Field(description="Unit vector; the drum angle is right-handed about it.")
    through_T: Vector = Field(description="A point of the axis. [m]")
    start_angle: float = Field(description="Drum angle at time 0, where D coincides with T. [rad]")


class DrumBearing(_Part):
    """A compliant bearing: six linear components between tub and drum carrier."""

    model_config = ConfigDict(extra="allow")
    point_T: Vector = Field(description="[m]")
    rotation_T: Rotation = Field(description="Its y axis is the drum axis.")


class Motor(_Part):
    """A motor with belt and speed controller: friction at the drum, the rest at its shaft."""

    belt_ratio: float = Field(description="Speed of the motor over speed of the drum.")
    rotor_inertia_kgm2: float = Field(
        description="About the motor's axis. The inertias of tub and drum contain its coupling."
    )
    reflected_inertia_kgm2: float = Field(
        description="Acts on the joint of the drum alone, beside the inertia of the drum."
    )
    torque_limit: dict[str, Any] = Field(
        description="torque [N m] and power [W], or speed [rad/s] and torque [N m] of a table."
    )
    controller: dict[str, float | None] = Field(
        description="proportional_gain [N m s/rad], integral_gain [N m/rad], tracking_time [s] of "
        "the anti-windup, sample_time [s]; None if not given."
    )
    bearing_friction: dict[str, float] = Field(
        description="friction_torque [N m], full_friction_rate [rad/s], damping [N m s/rad]."
    )


class PointMass(_Part):
    """A point mass that is fixed to the drum at (radius sin(phase), y, radius cos(phase)) in D."""

    mass: float = Field(description="[kg]")
    radius: float = Field(description="[m]")
    y: float = Field(description="[m]")
    phase: float = Field(description="[rad]")


class Load(_Part):
    """Point masses in the drum."""

    unbalances: tuple[PointMass, ...]


class Imperfections(_Part):
    """Imperfections beside the bearing.

    Attributes:
        residual_imbalance: It is added to every load, but not to the empty machine.
        phase_error: It is added to the phase of the rear mass of spin-cycle cases that have a front
            mass too, and to nothing else.
    """

    residual_imbalance: PointMass
    phase_error: float = Field(description="[rad]")


class Strut(_Part):
    """Line from the housing end to the tub end.

    Drawn means that T coincides with W. The rest pose may differ slightly from it.
    """

    tub_point_T: Vector = Field(description="[m]")
    housing_point_W: Vector = Field(description="[m]")
    length_at_rest: float = Field(description="[m]")
    direction_at_rest_W: Vector


class Spring(Strut):
    """A spring: h = preload + F(length - length_at_preload), F = k x or a table.

    The tension is h from `taut_from` on, 0 where h <= 0, and between them w s^2 (2 - s) with w =
    taut_from and s = h / w. A tension-compression spring has the tension h everywhere.
    """

    action: Literal["tension-only", "tension-compression"]
    stiffness: float | ForceCurve = Field(description="[N/m]")
    length_at_preload: float = Field(description="Length as drawn. [m]")
    preload: float = Field(description="Tension as drawn. [N]")
    tension_at_rest: float = Field(description="[N]")
    taut_from: float | None = Field(description="None for tension-compression. [N]")
    free_length: float | None = Field(
        description="Length at which h is 0; None if there is none. [m]"
    )


class EndBushing(_Part):
    """Bending resistance at both ends of a strut (`wm_drake.laws.strut.bending_moment`)."""

    stiffness: float = Field(description="[N m/rad]")
    damping: float = Field(description="[N m s/rad]")
    friction_torque: float = Field(description="[N m]")
    full_friction_rate: float = Field(description="[rad/s]")


class Damper(Strut):
    """A friction damper on a massless strut; the other keys are the numbers of its law, in SI."""

    model_config = ConfigDict(extra="allow")
    law: str = Field(description="Name of the law, key of `laws`.")
    end_bushing: EndBushing
    neutral_direction: Vector = Field(
        description="Direction as drawn. Both end bushings are neutral when the strut has this "
        "direction in W (housing end) and in T (tub end)."
    )


class BushingLaw(_Part):
    """Numbers of a six-component bushing (`wm_drake.laws.bushing.bushing_force`), per axis."""

    stiffness_x: float | ForceCurve = Field(description="[N/m]")
    stiffness_y: float | ForceCurve = Field(description="[N/m]")
    stiffness_z: float | ForceCurve = Field(description="[N/m]")
    rotational_stiffness_x: float | TorqueCurve = Field(description="[N m/rad]")
    rotational_stiffness_y: float | TorqueCurve = Field(description="[N m/rad]")
    rotational_stiffness_z: float | TorqueCurve = Field(description="[N m/rad]")
    damping_x: float = Field(description="[N s/m]")
    damping_y: float = Field(description="[N s/m]")
    damping_z: float = Field(description="[N s/m]")
    rotational_damping_x: float = Field(description="[N m s/rad]")
    rotational_damping_y: float = Field(description="[N m s/rad]")
    rotational_damping_z: float = Field(description="[N m s/rad]")
    friction_torque_x: float = Field(description="[N m]")
    friction_torque_y: float = Field(description="[N m]")
    friction_torque_z: float = Field(description="[N m]")
    full_friction_rate_x: float = Field(description="[rad/s]")
    full_friction_rate_y: float = Field(description="[rad/s]")
    full_friction_rate_z: float = Field(description="[rad/s]")


class Bushing(BushingLaw):
    """A bushing between tub and housing; its law holds along the axes of the housing-side frame."""

    tub_point_T: Vector = Field(description="[m]")
    tub_rotation_T: Rotation
    housing_point_W: Vector = Field(description="[m]")
    housing_rotation_W: Rotation
    rubber: dict[str, float] | None = Field(
        None,
        description="Friction, Maxwell branches and cross-stiffness by key of the machine file, as "
        "far as they are not 0; in SI (N, m, N m, rad, s). Their stretches are 0 at the start of a "
        "run. None or absent without them.",
    )


class TelescopicDamper(_Part):
    """Two tubes as bodies, each on a bushing; the other keys are the numbers of the law along them.

    O is the link frame of the outer tube, which coincides with T as drawn.
    """

    model_config = ConfigDict(extra="allow")
    law: str = Field(description="Name of the law, key of `laws`.")
    outer_tube: str
    inner_tube: str
    axis_outer_tube: Vector = Field(description="Direction of extension, in O.")
    tub_point_T: Vector = Field(description="Tub bushing, on the tub. [m]")
    outer_point_outer_tube: Vector = Field(description="Tub bushing, on the outer tube. [m]")
    inner_point_outer_tube: Vector = Field(
        description="Housing bushing, on the inner tube, in O at extension 0. [m]"
    )
    housing_point_W: Vector = Field(description="Housing bushing, on the housing. [m]")
    tub_bushing: BushingLaw
    housing_bushing: BushingLaw
    tub_bushing_on_tub_rotation_T: Rotation
    tub_bushing_law_rotation_outer_tube: Rotation = Field(
        description="Frame, in O, along whose axes the law of the tub bushing holds."
    )
    housing_bushing_on_inner_tube_rotation_outer_tube: Rotation
    housing_bushing_law_rotation_W: Rotation = Field(
        description="Frame, in W, along whose axes the law of the housing bushing holds."
    )
    outer_tube_rest_pose: Pose
    extension_at_rest: float = Field(description="[m]")


class Sensor(_Part):
    """A sensor of the displacement of a point of the tub from its rest position, along one axis."""

    point_T: Vector = Field(description="[m]")
    axis_W: Literal["x", "y", "z"]


class Accelerometer(_Part):
    """A vibration sensor at a point of the tub, along all axes of W."""

    point_T: Vector = Field(description="[m]")


class Region(_Part):
    """Named interval of a spin profile."""

    name: str
    begin: float = Field(description="[s]")
    end: float = Field(description="[s]")


class Profile(_Part):
    """Drum speed over time; it is linear between the points."""

    time: tuple[float, ...] = Field(description="[s]")
    speed: tuple[float, ...] = Field(description="[rad/s]")
    regions: tuple[Region, ...] = ()


class Foot(_Part):
    """A foot of the cabinet on the floor."""

    x: float = Field(description="In W. [m]")
    y: float = Field(description="In W. [m]")


class FootType(_Part):
    """The pads of the feet of a cabinet that moves."""

    vertical_stiffness: float = Field(description="[N/m]")
    vertical_damping: float = Field(description="[N s/m]")
    horizontal_stiffness: float = Field(description="[N/m]")
    horizontal_damping: float = Field(description="[N s/m]")


class Cabinet(_Part):
    """The rigid cabinet on four feet; it has no influence on the motion unless it moves."""

    mass: float = Field(description="Of all that does not hang on the mounts. [kg]")
    centre_of_mass_W: Vector = Field(description="[m]")
    floor_z_W: float = Field(description="Height of the floor. [m]")
    friction: float = Field(description="Coefficient of Coulomb friction of the feet.")
    feet: dict[str, Foot]
    moves: bool = Field(description="Whether it moves on its feet; else the housing is fixed.")
    inertia_kgm2: Inertia | None = Field(description="None for a fixed cabinet. [kg m^2]")
    foot_type: FootType | None = Field(description="None for a fixed cabinet.")


class Residual(_Part):
    """What remains of moment about To and force on the tub at the rest pose."""

    moment_Nm: Vector
    force_N: Vector


class Numerics(_Part):
    """Numbers of the integration and of the signal processing."""

    integrator: str
    step_s: float
    output_period_s: float
    displacement_filter: str
    displacement_band_hz: tuple[float, float]
    rms_filter: str
    rms_high_pass_hz: float


class Description(_Part):
    """A machine in SI units, complete enough to rebuild it in another program.

    The suffix of a key is the frame of a point or direction: W housing, T tub, D drum.
    """

    machine: str
    units: str
    format: str = Field(description=f"'{VERSION}'")
    conventions: dict[str, str] = Field(description="Conventions by subject, as sentences.")
    laws: dict[str, str] = Field(description="Equation numbers of the laws in use, by name.")
    gravity_W: Vector = Field(description="[m/s^2]")
    bodies: dict[str, Body]
    oscillating_mass_kg: float
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
    detergent_point_T: Vector = Field(description="[m]")
    cabinet: Cabinet | None
    loads: dict[str, Load]
    profile: Profile
    numerics: Numerics
    rest_pose: Pose
    sag_at_rest: float = Field(
        description="By how much the centre of mass of tub and drum is below its drawn place. [m]"
    )
    equilibrium_residual: Residual
    natural_frequencies_hz: list[float]
    mode_damping_ratios: list[float]


def description_schema() -> dict[str, Any]:
    """Return the JSON schema of what `describe` returns and `machine show --json` prints."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **Description.model_json_schema(),
    }
