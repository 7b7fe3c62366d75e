"""Schema of the description of a machine: which keys it has, their types, units and meaning.

Parts that a machine file has too are those of `wm_drake.parameters`, in SI.
"""

from typing import Any, Literal, TypeAlias

from pydantic import ConfigDict, Field

from wm_drake.parameters import BushingType, InertiaMatrix, Load, SpinProfile, Unbalance
from wm_drake.parameters import units as u
from wm_drake.parameters.cabinet import Foot, FootType
from wm_drake.parameters.drive import (
    BearingFriction,
    SpeedController,
    TorqueLimit,
    TorqueLimitTable,
)
from wm_drake.parameters.elements import EndBushing, Frozen, Stiffness
from wm_drake.parameters.file_keys import DocumentedSchema

VERSION = "wm_drake machine description 3"
"""Name and version of the format. In version 2 springs could not go slack; version 1 had no key
`format`."""

Vector: TypeAlias = tuple[float, float, float]
Rotation: TypeAlias = tuple[Vector, Vector, Vector]


class Pose(Frozen):
    """Pose of a frame in W: R = Rz(yaw) Ry(pitch) Rx(roll), then the position of its origin."""

    roll: u.Angle
    pitch: u.Angle
    yaw: u.Angle
    x: u.Length
    y: u.Length
    z: u.Length


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


class DrumBearing(Frozen):
    """A compliant bearing: six linear components between tub and drum carrier."""

    model_config = ConfigDict(extra="allow")
    point_T: u.Position
    rotation_T: Rotation = Field(description="Its y axis is the drum axis.")


class Motor(Frozen):
    """A motor with belt and speed controller: friction at the drum, the rest at its shaft."""

    belt_ratio: u.Ratio = Field(description="Speed of the motor over speed of the drum.")
    rotor_inertia_kgm2: u.Inertia = Field(
        description="About the motor's axis. The inertias of tub and drum contain its coupling."
    )
    reflected_inertia_kgm2: u.Inertia = Field(
        description="Acts on the joint of the drum alone, in addition to the inertia of the drum."
    )
    torque_limit: TorqueLimit | TorqueLimitTable
    controller: SpeedController
    bearing_friction: BearingFriction
    torque_constant_NmA: u.TorqueConstant | None = Field(
        description="Torque at the motor's shaft per current; null if it is not known."
    )


class Imperfections(Frozen):
    """Imperfections other than the bearing.

    Attributes:
        residual_imbalance: It is added to every load, but not to the empty machine.
        phase_error: It is added to the phase of the rear mass of spin-cycle cases that have a front
            mass too, and to nothing else.
    """

    residual_imbalance: Unbalance
    phase_error: u.Angle


class Strut(Frozen):
    """Line from the housing end to the tub end.

    Drawn means that T coincides with W. The rest pose may differ slightly from it.
    """

    tub_point_T: u.Position
    housing_point_W: u.Position
    length_at_rest: u.Length
    direction_at_rest_W: Vector


class Spring(Strut):
    """A spring: h = preload + F(length - length_at_preload), F = k x or a table.

    The tension is h from `taut_from` on, 0 where h <= 0, and between them w s^2 (2 - s) with w =
    taut_from and s = h / w. A tension-compression spring has the tension h everywhere.
    """

    action: Literal["tension-only", "tension-compression"]
    stiffness: Stiffness
    length_at_preload: u.Length = Field(description="Length as drawn.")
    preload: u.Force = Field(description="Tension as drawn.")
    tension_at_rest: u.Force
    taut_from: u.Force | None = Field(description="None for tension-compression.")
    free_length: u.Length | None = Field(
        description="Length at which h is 0; None if there is none."
    )


class Damper(Strut):
    """A friction damper on a massless strut; the other keys are the numbers of its law, in SI."""

    model_config = ConfigDict(extra="allow")
    law: str = Field(description="Name of the law, key of `laws`.")
    end_bushing: EndBushing
    neutral_direction: Vector = Field(
        description="Direction as drawn. Both end bushings are neutral when the strut has this "
        "direction in W (housing end) and in T (tub end)."
    )


class Bushing(BushingType):
    """A bushing between tub and housing; its law holds along the axes of the housing-side frame."""

    model_config = ConfigDict(json_schema_extra=lambda schema: schema["required"].remove("rubber"))
    tub_point_T: u.Position
    tub_rotation_T: Rotation
    housing_point_W: u.Position
    housing_rotation_W: Rotation
    rubber: dict[str, float] | None = Field(
        None,
        description="Friction, Maxwell branches and cross-stiffness by key of the machine file, as "
        "far as they are not 0; in SI (N, m, N m, rad, s). Their stretches are 0 at the start of a "
        "run. None or absent without them.",
    )


class TelescopicDamper(Frozen):
    """Two tubes as bodies, each on a bushing; the other keys are the numbers of the law along them.

    O is the link frame of the outer tube, which coincides with T as drawn.
    """

    model_config = ConfigDict(extra="allow")
    law: str = Field(description="Name of the law, key of `laws`.")
    outer_tube: str
    inner_tube: str
    axis_outer_tube: Vector = Field(description="Direction of extension, in O.")
    tub_point_T: u.Position = Field(description="Tub bushing, on the tub.")
    outer_point_outer_tube: u.Position = Field(description="Tub bushing, on the outer tube.")
    inner_point_outer_tube: u.Position = Field(
        description="Housing bushing, on the inner tube, in O at extension 0."
    )
    housing_point_W: u.Position = Field(description="Housing bushing, on the housing.")
    tub_bushing: BushingType
    housing_bushing: BushingType
    tub_bushing_on_tub_rotation_T: Rotation
    tub_bushing_law_rotation_outer_tube: Rotation = Field(
        description="Frame, in O, along whose axes the law of the tub bushing holds."
    )
    housing_bushing_on_inner_tube_rotation_outer_tube: Rotation
    housing_bushing_law_rotation_W: Rotation = Field(
        description="Frame, in W, along whose axes the law of the housing bushing holds."
    )
    outer_tube_rest_pose: Pose
    extension_at_rest: u.Length


class OtherElement(Frozen):
    """An element of a kind of another package; the other keys are its parameters, in SI."""

    model_config = ConfigDict(extra="allow")
    kind: str = Field(description="Name of the kind in machine files.")
    law: str = Field(description="What it is, in words.")
    tub_point_T: u.Position
    tub_rotation_T: Rotation
    housing_point_W: u.Position
    housing_rotation_W: Rotation


class ElementOnDrum(Frozen):
    """An element on the drum, such as a ring of balls; the other keys are its parameters, in SI."""

    model_config = ConfigDict(extra="allow")
    kind: str = Field(description="Name of the kind in machine files.")
    law: str = Field(description="What it is, in words.")
    tub_point_T: u.Position = Field(description="Point of the drum axis.")
    tub_rotation_T: Rotation = Field(
        description="Its y axis is the drum axis, its z axis points to the top of the drum."
    )
    gravity_W: Vector = Field(description="[m/s^2]")


class Sensor(Frozen):
    """A sensor of the displacement of a point of the tub from its rest position, along one axis."""

    point_T: u.Position
    axis_W: Literal["x", "y", "z"]


class Accelerometer(Frozen):
    """A vibration sensor at a point of the tub, along all axes of W."""

    point_T: u.Position


class Cabinet(Frozen):
    """The rigid cabinet on four feet; it has no influence on the motion unless it moves."""

    mass: u.Mass = Field(description="Of all that does not hang on the mounts.")
    centre_of_mass_W: u.Position
    floor_z_W: u.Length = Field(description="Height of the floor.")
    friction: u.Ratio = Field(description="Coefficient of Coulomb friction of the feet.")
    feet: dict[str, Foot]
    moves: bool = Field(description="Whether it moves on its feet; else the housing is fixed.")
    inertia_kgm2: InertiaMatrix | None = Field(description="None for a fixed cabinet.")
    foot_type: FootType | None = Field(description="None for a fixed cabinet.")


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

    # a key with a default may be absent
    model_config = ConfigDict(json_schema_serialization_defaults_required=False)

    machine: str
    units: str
    format: str = Field(description=f"'{VERSION}'")
    conventions: dict[str, str] = Field(description="Conventions by subject, as sentences.")
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
    elements: dict[str, OtherElement | ElementOnDrum] | None = Field(
        None, description="Elements of kinds of other packages; absent without any."
    )


def description_schema() -> dict[str, Any]:
    """Return the JSON schema of what `describe` returns and `machine show --json` prints."""
    schema = Description.model_json_schema(mode="serialization", schema_generator=DocumentedSchema)
    return {"$schema": DocumentedSchema.schema_dialect, **schema}
