"""The machine in a Drake diagram: its systems and ports, and the numbers set in a Context."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, InputPort, OutputPort

from wm_drake.elements.bearing import DrumBearingParameters
from wm_drake.elements.bushing import SixComponentBushingParameters
from wm_drake.elements.friction_damper import FrictionDamperParameters
from wm_drake.elements.motor import packed_controller, packed_friction, packed_limit
from wm_drake.elements.spring import SpringStrutParameters
from wm_drake.elements.telescopic_damper import TelescopicDamperParameters
from wm_drake.elements.water import packed_water
from wm_drake.errors import input_error
from wm_drake.model.bodies import set_drum
from wm_drake.model.drawn_machine import DrawnMachine, RestingMachine, SetUpCache
from wm_drake.model.placed_elements import Parts, PlacedElements
from wm_drake.model.plant_copy import copy_numbers
from wm_drake.model.state_layout import StateLayout
from wm_drake.parameters import Drive, Load, MachineParameters, MotorDrive, Sensor, SpinProfile
from wm_drake.parameters.drive import motor_of
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.cabinet import Cabinet
from wm_drake.systems.element_system import ElementSystem
from wm_drake.systems.motor import Belt, Motor, SpeedController
from wm_drake.systems.sensors import Sensors
from wm_drake.systems.speed_source import SpeedSource
from wm_drake.systems.spin_profile_source import SpinProfileSource
from wm_drake.systems.water import Water


@dataclass(frozen=True, repr=False, kw_only=True)
class Setup(RestingMachine):
    """A machine at rest, set up in a Context.

    Attributes:
        machine: The machine in its diagram.
        context: Root Context of the diagram.
    """

    machine: "MachineSystems"
    context: Context

    def __repr__(self) -> str:
        """Return the machine and its rest position in one line."""
        x, y, z = (f"{1e3 * value:.3g}" for value in self.rest_pose[3:6])
        return f"<Setup of {self.parameters!r}; rest position of the tub ({x}, {y}, {z}) mm>"

    @property
    def plant_context(self) -> Context:
        """Return the plant's part of the Context."""
        return self.machine.plant.GetMyContextFromRoot(self.context)

    def follow_water(self, ahead: float = 0.0) -> None:
        """Set the masses of a load that dries in the Context, from the water that is left in it.

        Drake has masses as parameters of a Context. A simulation calls this from time to time, such
        as at each sample. The engines do so.

        Args:
            ahead: Time for which to look ahead; half the time until the next call makes the error
                of the masses of second order in that time. [s]

        Raises:
            InputError: the load has more wet masses than any load of the built machine.
        """
        water, wet = self.machine.water, len(self.load.wet) if self.load else 0
        if not wet:
            return
        if water is None or wet > water.count:
            raise input_error(
                f"this load has {wet} masses with water; those of the built machine have at most "
                f"{water.count if water else 0}: add the load to those of the machine, and build "
                "it again, or use the compiled engine",
                key="loads",
            )
        assert self.load is not None
        assert self.drum is not None  # the systems have been set
        context = water.GetMyContextFromRoot(self.context)
        left = context.get_continuous_state_vector().CopyToVector()
        if ahead:
            left = left + ahead * water.EvalTimeDerivatives(context).CopyToVector()
        masses = self.load.masses(left[: len(self.load.wet)])
        imbalance = self.parameters.imperfections.residual_imbalance
        loads = self.load.with_masses(masses), Load(unbalances=(imbalance,))
        set_drum(self.machine.plant, self.plant_context, self.drum, loads)

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Return the displacement sensors by name."""
        return self.parameters.sensors

    @property
    def springs(self) -> dict[str, SpringStrutParameters]:
        """Return the placed springs by name."""
        return self.elements.springs

    @property
    def dampers(self) -> dict[str, FrictionDamperParameters]:
        """Return the placed friction dampers by name."""
        return self.elements.dampers

    @property
    def bushings(self) -> dict[str, SixComponentBushingParameters]:
        """Return the placed bushings by name, the gasket among them."""
        return self.elements.bushings

    @property
    def telescopes(self) -> dict[str, TelescopicDamperParameters]:
        """Return the placed telescopic dampers by name."""
        return self.elements.telescopes

    @property
    def bearing(self) -> DrumBearingParameters | None:
        """Return the compliant bearing between drum carrier and tub; None if it is rigid."""
        return self.elements.bearing

    @property
    def motor(self) -> MotorDrive | None:
        """Return the drive with a motor; None if the speed of the drum is prescribed."""
        return motor_of(self.parameters.drive)

    @property
    def sensor_points(self) -> dict[str, FloatArray]:
        """Return the points of the displacement sensors in T. [m]"""
        return self.points.sensors

    @property
    def detergent_point(self) -> FloatArray:
        """Return the point of the tub nearest the detergent box, in T. [m]"""
        return self.points.detergent

    @property
    def accelerometer_points(self) -> dict[str, FloatArray]:
        """Return the points of the vibration sensors in T. [m]"""
        return self.points.accelerometers


def with_prescribed_speed(setup: Setup) -> Setup:
    """Return a setup whose parameters have a prescribed speed in place of a motor."""
    if setup.motor is None:
        return setup
    drive = Drive(joint=setup.motor.joint)
    return replace(setup, parameters=setup.parameters.model_copy(update={"drive": drive}))


@dataclass(frozen=True)
class MotorSystems:
    """The systems of a drive with a motor."""

    controller: SpeedController
    motor: Motor
    belt: Belt
    friction: ElementSystem

    def set_drive(self, context: Context, drive: MotorDrive) -> None:
        """Set the numbers of a drive in a root Context, and its state before a run."""
        numbers = (
            (self.controller, packed_controller(drive)),
            (self.motor, packed_limit(drive)),
            (self.belt, np.array([drive.belt_ratio])),
            (self.friction, packed_friction(drive)),
        )
        for system, packed in numbers:
            system.set_parameters(system.GetMyContextFromRoot(context), packed)
        self.controller.reset(self.controller.GetMyContextFromRoot(context))


@dataclass(frozen=True, repr=False)
class MachineSystems:
    """The systems of a machine in a diagram, and the ports that other systems may connect to.

    The numbers in force are in a Context of the diagram, see `set_up`.

    Attributes:
        parameters: The numbers it was built from.
        plant: The bodies.
        drawn: The bodies as the SDF draws them, on which set-ups are solved.
        spin_profile, sensors: Systems of the spin profile and of what is measured.
        speed_source: System that prescribes the speed of the drum; None with a motor.
        motor: Systems of a drive with a motor; None if the speed is prescribed.
        springs, dampers, bushings, others, telescopes: Element systems by name; others are those
            of the section `elements` of a machine file.
        bearing: System of the compliant bearing; None for a rigid one.
        cabinet, feet: Systems of a cabinet that moves; None if it is fixed.
        water: System of the water in the laundry; None if no load of the machine is wet.
        inputs: By name. "drum_acceleration" (1) [rad/s^2] replaces the acceleration of the spin
            profile if a value is connected or fixed; with a motor, "drum_speed_reference" (1)
            [rad/s] replaces its speed, and "drum_torque" (1) [N m] the torque on the drum in place
            of controller and motor. "tub_force" (6) is moment about To and force on the tub in W
            [N m, N], zero if nothing is connected.
        outputs: By name: "state" of the plant; "displacement" of the sensors,
            "detergent_displacement", "drum_speed", "drum_angle", both as "drum_motion";
            "motor_torque"; and for each element its own
            outputs, such as "spring_left_force", "damper_left_force", "gasket_force" and
            "gasket_moment"; of a cabinet that moves "feet_floor_force".
    """

    parameters: MachineParameters
    plant: MultibodyPlant
    drawn: DrawnMachine
    spin_profile: SpinProfileSource
    speed_source: SpeedSource | None
    motor: MotorSystems | None
    sensors: Sensors
    springs: dict[str, ElementSystem]
    dampers: dict[str, ElementSystem]
    bushings: dict[str, ElementSystem]
    others: dict[str, ElementSystem]
    telescopes: dict[str, ElementSystem]
    bearing: ElementSystem | None
    cabinet: Cabinet | None
    feet: ElementSystem | None
    water: Water | None
    inputs: dict[str, InputPort]
    outputs: dict[str, OutputPort]

    def __repr__(self) -> str:
        """Return the machine and the number of its ports in one line."""
        ports = f"{len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"<{type(self).__name__} of {self.parameters!r}; {ports}>"

    def set_up(
        self,
        load: Load | str | None = None,
        *,
        context: Context | None = None,
        parameters: MachineParameters | None = None,
        profile: SpinProfile | None = None,
        gasket: bool = True,
        dampers: bool = True,
        friction: bool = True,
        systems: bool = True,
    ) -> Setup:
        """Set numbers and load in a Context, at the rest pose and the first speed of the profile.

        A built machine with these numbers set in a Context computes bit for bit the same as a
        machine built from them, whose default Context has them already.

        Args:
            load: Point masses in the drum, or the name of one of the machine's loads; None for the
                empty machine. Preloads and rest pose are always those of the empty machine.
            context: Root Context of the diagram; what belongs to the machine is overwritten in it.
                A new one at time 0 if None, of a machine with a diagram of its own.
            parameters: Numbers to use; those it was built from if None. They must have the same
                elements, the same laws and tables of the same length.
            profile: Spin profile to follow; that of the parameters if None.
            gasket: False disengages it.
            dampers: False takes their laws and their friction out; their bushings stay.
            friction: False takes the dry friction out of all elements, as for a small motion on top
                of steady sliding.
            systems: False for the compiled engine, which reads the `Setup`: it may leave the
                Context as it is.

        Raises:
            InputError: the elements are not those that were built, a name is not in the SDF, or
                there is no equilibrium.
        """
        parameters, context = parameters or self.parameters, context or self.new_context()
        parts = Parts(gasket, dampers, friction)
        resting = self.drawn.at_rest(load, parameters, parts, bodies=systems)
        setup = Setup(machine=self, context=context, **vars(resting))
        if resting.bodies is not None:
            self._set(setup, resting.bodies)
            self.set_profile(context, profile or parameters.profile, resting.elements)
        return setup

    @property
    def state_layout(self) -> StateLayout:
        """Return the indices in the state of the plant."""
        return self.drawn.state_layout

    @property
    def cache(self) -> SetUpCache:
        """Return the values that set-ups and runs share."""
        return self.drawn.cache

    def new_context(self) -> Context:
        """Return a new root Context at time 0; only a machine with a diagram of its own has one."""
        raise input_error("is that of the diagram that contains the machine", key="context")

    def set_profile(self, context: Context, profile: SpinProfile, elements: PlacedElements) -> None:
        """Set the spin profile in a root Context, and drum and elements to its first speed."""
        self.spin_profile.set_profile(self.spin_profile.GetMyContextFromRoot(context), profile)
        plant_context = self.plant.GetMyContextFromRoot(context)
        velocities = self.plant.GetVelocities(plant_context)
        velocities[self.state_layout.drum] = profile.speed[0]
        self.plant.SetVelocities(plant_context, velocities)
        for name, system in self.others.items():
            if system.state_size:
                initial = elements.others[name].initial(profile.speed[0])
                system.GetMyContextFromRoot(context).SetContinuousState(initial)

    def set_drum_acceleration(self, context: Context, acceleration: float) -> None:
        """Fix the drum's acceleration in a root Context, in place of the spin profile. [rad/s^2]

        The port "drum_acceleration" must not be connected.

        Raises:
            InputError: a motor turns the drum.
        """
        if self.speed_source is None:
            raise input_error("a motor turns the drum; its acceleration follows", key="drive.kind")
        self.inputs["drum_acceleration"].FixValue(
            self.speed_source.GetMyContextFromRoot(context), [acceleration]
        )

    def _set(self, setup: Setup, bodies: Context) -> None:
        """Set the numbers of a setup in its Context.

        Args:
            bodies: Context of `DrawnMachine.plant`.
        """
        context, parameters = setup.context, setup.parameters
        copy_numbers(self.drawn.plant, bodies, self.plant, setup.plant_context)
        if self.water is not None:
            packed = packed_water(setup.load) if setup.load else []
            self.water.set_load(self.water.GetMyContextFromRoot(context), packed)
        self._set_systems(context, setup.elements, setup.measured_points)
        if drive := motor_of(parameters.drive):
            assert self.motor  # the parameters have been checked
            self.motor.set_drive(context, drive)
        if self.feet is not None and setup.cabinet is not None:
            part = self.feet.GetMyContextFromRoot(context)
            self.feet.set_parameters(part, setup.cabinet.packed())
            part.SetContinuousState(np.zeros(self.feet.state_size))

    def _set_systems(self, context: Context, elements: PlacedElements, points: FloatArray) -> None:
        """Set the parameters of elements and sensors in a root Context, and relax the sponges."""
        pairs: list[tuple[Mapping[str, Any], Mapping[str, Any]]] = [
            (self.springs, elements.springs),
            (self.dampers, elements.dampers),
            (self.bushings, elements.bushings),
            (self.telescopes, elements.telescopes),
            (self.others, elements.others),
        ]
        if self.bearing:
            pairs.append(({"": self.bearing}, {"": elements.bearing}))
        for systems, placed in pairs:
            for name, system in systems.items():
                part = system.GetMyContextFromRoot(context)
                system.set_parameters(part, placed[name].packed())
                if system.state_size:
                    part.SetContinuousState(np.zeros(system.state_size))
        self.sensors.set_points(self.sensors.GetMyContextFromRoot(context), points)


@dataclass(frozen=True, repr=False)
class Machine(MachineSystems):
    """A machine as a diagram of its own. The named ports are exported: inputs and outputs."""

    diagram: Diagram

    def new_context(self) -> Context:
        """Return a new root Context at time 0."""
        return self.diagram.CreateDefaultContext()

    def set_drum_acceleration(self, context: Context, acceleration: float) -> None:
        """Fix the drum's acceleration in a root Context; see `MachineSystems`. [rad/s^2]"""
        if self.speed_source is None:
            super().set_drum_acceleration(context, acceleration)
        self.diagram.GetInputPort("drum_acceleration").FixValue(context, [acceleration])
