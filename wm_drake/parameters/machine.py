"""Parameters of a machine: one frozen tree of numbers in SI units."""

import math
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from wm_drake.errors import nearest_names
from wm_drake.parameters import units as u
from wm_drake.parameters.cabinet import Cabinet
from wm_drake.parameters.damper_laws import DamperType
from wm_drake.parameters.drive import AnyDrive, Drive, MotorDrive
from wm_drake.parameters.element_kinds import AnyElement, DrumElement
from wm_drake.parameters.elements import (
    Bushing,
    BushingType,
    Damper,
    Frozen,
    Spring,
    SpringType,
    TelescopicDamper,
)
from wm_drake.parameters.inertia import InertiaMatrix
from wm_drake.parameters.sections import SECTIONS
from wm_drake.parameters.spin import Load, SpinProfile, Unbalance
from wm_drake.parameters.types import Name

OUTPUT_PERIOD = 5e-3
"""Default time between samples of a record, as in the measurements of [B]. [s]"""

DEFAULT_STEP = 2.5e-3
"""Default step size; the output period is an integer multiple of it. [s]

With a tenth of this step size, peaks with gasket change by less than 0.05 % in the compiled engine
and by less than 0.1 % in the Drake engine (tested).
"""


Integrator = Literal["auto", "multistep", "midpoint", "runge_kutta"]
"""Integrator of the compiled engine: one derivative a step (the midpoint rule is for telescopic
dampers), or the Runge-Kutta scheme with four; "auto" takes the first where it suits the machine.
See docs/theory/integrator.md."""


class BodyOverride(Frozen):
    """Mass properties that replace those of the SDF.

    If only the mass is given, the inertia is scaled with it.

    Attributes:
        mass: Mass of the body.
        centre_of_mass: Its position in the body's frame.
        inertia: Inertia about the centre of mass.
    """

    mass: Annotated[u.Mass, Field(gt=0.0)] | None = None
    centre_of_mass: u.Position | None = None
    inertia: InertiaMatrix | None = None


class FrameOverride(Frozen):
    """A frame of the SDF at another position, or a new frame.

    Attributes:
        position: Position in the frame that the SDF attaches it to, or in the link frame of
            `attached_to`.
        attached_to: Link of the SDF to which a new frame is fixed; None for a frame of the SDF.
        angles: Roll, pitch and yaw of a new frame in its link; None for zero. [rad]
    """

    position: u.Position
    attached_to: Name | None = None
    angles: u.Angles | None = None

    @model_validator(mode="after")
    def _angles_are_of_a_new_frame(self) -> "FrameOverride":
        if self.angles is not None and len(self.angles) != 3:
            raise ValueError(f"angles: needs roll, pitch and yaw, has {len(self.angles)} values")
        if self.angles is not None and self.attached_to is None:
            raise ValueError("angles: only a new frame has them; name its link in attached_to")
        return self


class Sensor(Frozen):
    """A sensor of the displacement of one point of the tub along one world axis.

    Attributes:
        frame: Frame of the tub whose origin is the point.
        axis: Axis of W.
    """

    frame: str
    axis: Literal["x", "y", "z"]


class Clearance(Frozen):
    """Data for the clearance: the tub point nearest to the detergent box ([B] section 4).

    Attributes:
        detergent_frame: Frame of the tub whose origin is that point.
    """

    detergent_frame: str


class Accelerometer(Frozen):
    """A vibration sensor at one point of the tub ([A] section 4.1).

    It has three axes, which are parallel to those of W at rest.

    Attributes:
        frame: Frame of the tub at whose origin the sensor is fixed.
    """

    frame: str


class UnbalancePlace(Frozen):
    """Position of an unbalance mass in the drum.

    Attributes:
        radius: Distance from the drum axis.
        y: Coordinate in D, along the drum axis.
    """

    radius: Annotated[u.Length, Field(gt=0.0)]
    y: u.Length


class UnbalancePlanes(Frozen):
    """The two positions of unbalance masses in [A] section 4.1.

    Attributes:
        front, rear: The positions.
    """

    front: UnbalancePlace
    rear: UnbalancePlace


class Bearing(Frozen):
    """A compliant bearing between drum and tub.

    A machine without these parameters has a rigid bearing: a revolute joint. None of the numbers is
    published; every number in a machine file is an assumption of its author.

    Attributes:
        radial_stiffness: Stiffness perpendicular to the drum axis. [N/m]
        axial_stiffness: Stiffness along the drum axis. [N/m]
        tilting_stiffness: Stiffness against tilting of the drum axis. [N m/rad]
        torsional_stiffness: Stiffness about the drum axis, in the path of the motor's reaction
            torque to the tub; if None, the tilting stiffness is used. [N m/rad]
        radial_damping, axial_damping: Damping in the same directions. [N s/m]
        tilting_damping, torsional_damping: Damping of the rotations; if the torsional one is None,
            the tilting one is used. [N m s/rad]
        y: Position of the bearing along the axis of the drum's joint, from the joint's origin. [m]
        clearance: Radial clearance, beyond which shaft and bearing touch; 0 for none. Within it the
            radial stiffness, of seal and grease, is all that centres the shaft. [m]
        contact_stiffness: Radial stiffness of the contact, beside the radial stiffness. [N/m]
        contact_damping: Radial damping of the contact; full from a tenth of the clearance into it.
            [N s/m]
    """

    radial_stiffness: Annotated[u.LinearStiffness, Field(gt=0.0)]
    axial_stiffness: Annotated[u.LinearStiffness, Field(gt=0.0)]
    tilting_stiffness: Annotated[u.RotationalStiffness, Field(gt=0.0)]
    torsional_stiffness: Annotated[u.RotationalStiffness, Field(gt=0.0)] | None = None
    radial_damping: Annotated[u.LinearDamping, Field(ge=0.0)]
    axial_damping: Annotated[u.LinearDamping, Field(ge=0.0)]
    tilting_damping: Annotated[u.RotationalDamping, Field(ge=0.0)]
    torsional_damping: Annotated[u.RotationalDamping, Field(ge=0.0)] | None = None
    y: u.Length
    clearance: Annotated[u.Length, Field(ge=0.0)] = 0.0
    contact_stiffness: Annotated[u.LinearStiffness, Field(gt=0.0)] | None = None
    contact_damping: Annotated[u.LinearDamping, Field(ge=0.0)] = 0.0

    @model_validator(mode="after")
    def _contact_with_clearance(self) -> "Bearing":
        if self.clearance > 0.0 and self.contact_stiffness is None:
            raise ValueError(
                "a clearance needs the stiffness of the contact beyond it: add contact_stiffness, "
                "such as '20 kN/mm'"
            )
        if self.clearance == 0.0 and (self.contact_stiffness or self.contact_damping):
            raise ValueError(
                "contact_stiffness and contact_damping belong to a clearance above 0; add clearance"
            )
        return self

    def as_bushing(self) -> BushingType:
        """Return the bearing as a bushing in a frame whose y axis is the drum axis."""
        stiffness, damping = self.torsional_stiffness, self.torsional_damping
        return BushingType(
            stiffness_x=self.radial_stiffness,
            stiffness_y=self.axial_stiffness,
            stiffness_z=self.radial_stiffness,
            rotational_stiffness_x=self.tilting_stiffness,
            rotational_stiffness_y=self.tilting_stiffness if stiffness is None else stiffness,
            rotational_stiffness_z=self.tilting_stiffness,
            damping_x=self.radial_damping,
            damping_y=self.axial_damping,
            damping_z=self.radial_damping,
            rotational_damping_x=self.tilting_damping,
            rotational_damping_y=self.tilting_damping if damping is None else damping,
            rotational_damping_z=self.tilting_damping,
        )


class Imperfections(Frozen):
    """Imperfections that [A] section 4.2 names as causes of error. By default there are none.

    Attributes:
        residual_imbalance: Unbalance of the empty drum. It is added to the load in every run.
        phase_error: Angle by which the rear mass of a spin-cycle case leads more than its phase.
            Loads of the machine are not changed by it. [rad]
        bearing: Compliant bearing, in which the drum can whirl; None for a rigid bearing (a
            revolute joint).
    """

    residual_imbalance: Unbalance = Unbalance(mass=0.0, radius=0.0, y=0.0)
    phase_error: u.Angle = 0.0
    bearing: Bearing | None = None

    @model_validator(mode="after")
    def _imbalance_is_dry(self) -> "Imperfections":
        if self.residual_imbalance.water:
            raise ValueError("residual_imbalance.water: only masses of a load have water")
        return self


class MachineParameters(Frozen):
    """A machine: the name of its SDF model and all other parameters, in SI units.

    Attributes:
        name: Name of the machine, on pages and in results.
        about: One sentence about the machine.
        model: SDF file with bodies, frames, joints and shapes: a shipped one, or a path from the
            folder of the machine file.
        gravity: Acceleration of free fall.
        step: Largest step of the integrator. A run that is not accurate with it has shorter ones.
        accuracy: Largest relative error of each measure of a run, by its steps. 0.5 % is small
            beside what a machine file does not know of a machine; with 100 % no run is repeated.
        output_period: Longest time between samples of a record, an integer multiple of the step.
            Measures of runs are computed from the samples. A fast profile halves it until a turn
            of the drum has 30 samples.
        integrator: `multistep` and `midpoint` (telescopic dampers) take one derivative a step,
            `runge_kutta` four; `auto` takes one of the first two where it suits the machine.
        drive: Prescribed speed of the drum, or a motor.
        bodies: Changes of the bodies of the SDF, by name.
        frames: Changes of frames of the SDF, and new frames, by name.
        spring_types, damper_types, bushing_types: Elements as bought, by name.
        springs, dampers, telescopic_dampers, bushings: Elements in their places, by name.
        gasket: The gasket; null for none.
        elements: Elements of kinds that other packages register, by name.
        sensors: Displacement sensors, by name.
        accelerometers: Vibration sensors, by name.
        clearance: The point whose distance to the detergent box counts; by default that of the
            first sensor.
        cabinet: The cabinet on its feet; null for no loads of the feet.
        unbalance_planes: Positions of the masses of a spin cycle.
        imperfections: Imperfections of the drum and its bearing.
        loads: The loads, by name.
        profile: Spin profile.
        measured: CSV files with measured amplitudes of this very machine.
        published: CSV files with published results of a gasket study of this very machine.
    """

    name: str
    about: str = ""
    model: str = "oscillating_group.sdf"
    gravity: Annotated[u.Acceleration, Field(ge=0.0)]
    step: Annotated[u.Duration, Field(gt=0.0)] = DEFAULT_STEP
    accuracy: Annotated[float, u.Share(), Field(gt=0.0, le=1.0)] = 0.005
    output_period: Annotated[u.Duration, Field(gt=0.0)] = OUTPUT_PERIOD
    integrator: Integrator = "auto"
    drive: AnyDrive = Drive()
    bodies: dict[Name, BodyOverride] = {}
    frames: dict[Name, FrameOverride] = {}
    spring_types: dict[Name, SpringType] = {}
    springs: dict[Name, Spring] = {}
    damper_types: dict[Name, DamperType] = {}
    dampers: dict[Name, Damper] = {}
    bushing_types: dict[Name, BushingType] = {}
    telescopic_dampers: dict[Name, TelescopicDamper] = {}
    gasket: Bushing | None = None
    bushings: dict[Name, Bushing] = {}
    elements: dict[Name, AnyElement] = {}
    sensors: dict[Name, Sensor]
    accelerometers: dict[Name, Accelerometer] = {}
    clearance: Clearance | None = None
    cabinet: Cabinet | None = None
    unbalance_planes: UnbalancePlanes | None = None
    imperfections: Imperfections = Imperfections()
    loads: dict[Name, Load]
    profile: SpinProfile
    measured: tuple[str, ...] = ()
    published: tuple[str, ...] = ()
    sources: dict[str, str] = Field(default={}, repr=False)

    @field_validator("springs", "dampers", "telescopic_dampers")
    @classmethod
    def _type_is_known(cls, places: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        for key, table in SECTIONS[info.field_name or ""].types.items():
            known = info.data.get(table)
            if known is None:  # the table itself is wrong, which is reported already
                continue
            for name, place in places.items():
                if getattr(place, key) not in known:
                    other = getattr(place, key)
                    raise ValueError(
                        f"{name}.{key}: '{other}' is not in {table}{nearest_names(other, known)}"
                    )
        return places

    @field_validator("springs")
    @classmethod
    def _preload_is_given_once(
        cls, springs: dict[str, Spring], info: ValidationInfo
    ) -> dict[str, Spring]:
        types = info.data.get("spring_types") or {}
        for name, spring in springs.items():
            kind = types.get(spring.type)
            if spring.preload is not None and kind and kind.free_length is not None:
                raise ValueError(
                    f"{name}.preload: type '{spring.type}' has a free_length, which decides the "
                    "preload; give only one of them"
                )
        return springs

    @field_validator("telescopic_dampers")
    @classmethod
    def _names_are_unique(cls, places: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        both = sorted(set(places) & set(info.data.get("dampers", ())))
        if both:
            raise ValueError(f"{both[0]}: is the name of a damper too; rename one of them")
        return places

    @field_validator("sensors", "loads")
    @classmethod
    def _not_empty(cls, table: dict[str, object]) -> dict[str, object]:
        if not table:
            raise ValueError("needs at least one entry")
        return table

    @model_validator(mode="after")
    def _gasket_is_not_a_bushing(self) -> "MachineParameters":
        if "gasket" in self.bushings:
            raise ValueError(
                "bushings: the name 'gasket' is reserved for the key 'gasket'; use another name"
            )
        return self

    @model_validator(mode="after")
    def _motor_has_a_rigid_bearing(self) -> "MachineParameters":
        if self.imperfections.bearing and isinstance(self.drive, MotorDrive):
            raise ValueError(
                "drive.kind: 'motor' needs a rigid bearing of the drum; remove "
                "imperfections.bearing, or use 'prescribed'"
            )
        return self

    @model_validator(mode="after")
    def _drum_turns_in_a_tub_in_a_fixed_cabinet(self) -> "MachineParameters":
        on_drum = [name for name, e in self.elements.items() if isinstance(e, DrumElement)]
        if on_drum and (self.imperfections.bearing or self.cabinet_moves):
            raise ValueError(
                f"elements.{on_drum[0]}: acts on the drum, which needs a rigid bearing and a fixed "
                "cabinet; remove imperfections.bearing, and leave cabinet.moves out"
            )
        return self

    @model_validator(mode="after")
    def _cabinet_can_move(self) -> "MachineParameters":
        if self.cabinet and self.cabinet.moves and self.telescopic_dampers:
            raise ValueError(
                "cabinet.moves: not possible with telescopic_dampers, whose tubes stand on a fixed "
                "housing; use dampers without tubes, or leave moves out"
            )
        if self.cabinet and self.cabinet.moves and not self.gravity > 0.0:
            raise ValueError("cabinet.moves: needs gravity above 0, which presses the feet down")
        return self

    @property
    def masses_on_drum(self) -> tuple[Unbalance, ...]:
        """Return the parts of elements that are masses on the axis of the drum, such as liquid."""
        on_drum = (e for e in self.elements.values() if isinstance(e, DrumElement))
        masses = ((e.mass_on_drum, e.y) for e in on_drum)
        return tuple(Unbalance(mass=mass, radius=0.0, y=y) for mass, y in masses if mass)

    def __repr__(self) -> str:
        """Return name, elements, loads and speed in one line; `model_dump()` has all numbers."""
        kinds = ("springs", "dampers", "telescopic_dampers", "bushings", "elements")
        counts = {kind.replace("_", " "): len(getattr(self, kind)) for kind in kinds}
        parts = [f"{count} {kind}" for kind, count in counts.items() if count]
        parts += [f"{'a' if self.gasket else 'no'} gasket", f"loads {', '.join(self.loads)}"]
        rpm = self.profile.highest_speed * 30.0 / math.pi
        speed = f"up to {rpm:.4g} rpm in {self.profile.duration:.4g} s"
        return f"<{type(self).__name__} '{self.name}': {', '.join(parts)}; {speed}>"

    __str__ = __repr__

    @property
    def cabinet_moves(self) -> bool:
        """Whether the cabinet moves on its feet; else the housing is fixed."""
        return self.cabinet is not None and self.cabinet.moves

    @property
    def clearance_frame(self) -> str:
        """Frame of the tub point whose distance to the detergent box counts.

        A machine without `clearance` has the point of its first sensor, as an assumption.
        """
        first = next(iter(self.sensors.values()))
        return self.clearance.detergent_frame if self.clearance else first.frame

    @property
    def most_wet(self) -> int:
        """Largest number of wet masses of a load."""
        return max(len(load.wet) for load in self.loads.values())

    def accelerometer_frames(self) -> dict[str, str]:
        """Return the frame of each vibration sensor, by name.

        If the machine file has none, the sensors S1 to S3 are placed at the first, third and fifth
        point that has displacement sensors.
        """
        if self.accelerometers:
            return {name: sensor.frame for name, sensor in self.accelerometers.items()}
        frames = list(dict.fromkeys(sensor.frame for sensor in self.sensors.values()))
        chosen = frames[::2][:3] if len(frames) > 3 else frames
        return {f"S{number}": frame for number, frame in enumerate(chosen, start=1)}

    def all_bushings(self) -> dict[str, Bushing]:
        """Return the six-component bushings by name, including the gasket as 'gasket'."""
        return SECTIONS["bushings"].elements(self)
