"""The machine in Drake: add it to a diagram, build it alone, set its numbers in a Context."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, InputPort, OutputPort

from wm_drake.errors import input_error, nearest_names
from wm_drake.model.bodies import add_bodies, add_load, set_bodies
from wm_drake.model.equilibrium import preloaded, put_to_rest
from wm_drake.model.frame_poses import FramePoses
from wm_drake.model.placed_elements import AppliedForce, PlacedElements, placed_elements
from wm_drake.model.same_elements import check_same_elements
from wm_drake.model.setup import Setup, TubPoints, measured_points
from wm_drake.model.state_layout import StateLayout, state_layout_of
from wm_drake.model.visualization import add_visualizer
from wm_drake.model.wiring import Link, Wiring
from wm_drake.parameters import Load, MachineParameters, SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.drum_bearing import DrumBearing
from wm_drake.systems.friction_damper import FrictionDamper
from wm_drake.systems.sensors import Sensors
from wm_drake.systems.six_component_bushing import SixComponentBushing
from wm_drake.systems.speed_source import MotorTorque, SpeedSource
from wm_drake.systems.spin_profile_source import SpinProfileSource
from wm_drake.systems.spring_strut import SpringStrut
from wm_drake.systems.telescopic_damper import TelescopicDamper
from wm_drake.systems.tub_force import TubForce

OUTPUT_PERIOD = 5e-3
"""Time between samples of a record, as in the measurements of [B]. [s]"""


@dataclass(frozen=True)
class MachineSystems:
    """The systems of a machine in a diagram, and the ports that other systems may connect to.

    The numbers in force are in a Context of the diagram, see `set_up`.

    Attributes:
        parameters: The numbers it was built from.
        plant: The bodies.
        state_layout: Indices in the state of the plant.
        spin_profile, speed_source, sensors: Systems that drive the drum and measure the tub.
        springs, dampers, bushings, telescopes: Element systems by name.
        bearing: System of the compliant bearing; None for a rigid one.
        inputs: By name. "drum_acceleration" (1) [rad/s^2] replaces the acceleration of the spin
            profile if a value is connected or fixed. "tub_force" (6) is moment about To and force
            on the tub in W [N m, N], zero if nothing is connected.
        outputs: By name: "state" of the plant; "displacement" of the sensors,
            "detergent_displacement", "drum_speed"; "motor_torque"; and for each element its own
            outputs, such as "spring_left_force", "damper_left_force", "gasket_force" and
            "gasket_moment".
    """

    parameters: MachineParameters
    plant: MultibodyPlant
    state_layout: StateLayout
    spin_profile: SpinProfileSource
    speed_source: SpeedSource
    sensors: Sensors
    springs: dict[str, SpringStrut]
    dampers: dict[str, FrictionDamper]
    bushings: dict[str, SixComponentBushing]
    telescopes: dict[str, TelescopicDamper]
    bearing: DrumBearing | None
    inputs: dict[str, InputPort]
    outputs: dict[str, OutputPort]
    _poses: list[FramePoses] = field(default_factory=list, repr=False, compare=False, kw_only=True)

    def set_up(
        self,
        load: Load | str | None = None,
        *,
        context: Context,
        parameters: MachineParameters | None = None,
        profile: SpinProfile | None = None,
        gasket: bool = True,
        dampers: bool = True,
    ) -> Setup:
        """Set numbers and load in a Context, at the rest pose and the first speed of the profile.

        A built machine with these numbers set in a Context computes bit for bit the same as a
        machine built from them. A default Context has the bodies of the SDF and is not at rest:
        call this first.

        Args:
            load: Point masses in the drum, or the name of one of the machine's loads; None for the
                empty machine. Preloads and rest pose are always those of the empty machine.
            context: Root Context of the diagram; what belongs to the machine is overwritten in it.
            parameters: Numbers to use; those it was built from if None. They must have the same
                elements, the same laws and tables of the same length.
            profile: Spin profile to follow; that of the parameters if None.
            gasket, dampers: False disengages them.

        Raises:
            InputError: the elements are not those that were built, a name is not in the SDF, or
                there is no equilibrium.
        """
        parameters = parameters or self.parameters
        check_same_elements(self.parameters, parameters)
        load = self._load(load, parameters)
        context = self.set_up_bodies(None, parameters, context)
        plant_context = self.plant.GetMyContextFromRoot(context)
        poses = self._frame_poses(plant_context, parameters)
        unloaded = placed_elements(self.plant, poses, parameters)
        layout = self.state_layout
        elements = preloaded(self.plant, plant_context, layout, unloaded)
        elements = elements if gasket else elements.without_gasket()
        elements = elements if dampers else elements.without_dampers()
        residual = put_to_rest(self.plant, plant_context, layout, elements)
        self._add_load(plant_context, parameters, load)
        q = self.plant.GetPositions(plant_context)
        points = _tub_points(poses, parameters)
        profile = profile or parameters.profile
        self._set_systems(context, elements, measured_points(parameters, points, q[layout.tub]))
        self.set_profile(context, profile)
        rest = q[layout.tub], residual, q[layout.tubes], q[layout.carrier]
        return Setup(self, parameters, context, elements, points, *rest)

    def set_up_bodies(
        self, load: Load | None, parameters: MachineParameters, context: Context
    ) -> Context:
        """Set bodies, frames and load in a Context and return it; all positions are zero, as drawn.

        Raises:
            InputError: a name is not in the SDF.
        """
        plant_context = self.plant.GetMyContextFromRoot(context)
        self.plant.SetDefaultContext(plant_context)
        set_bodies(self.plant, plant_context, parameters)
        self._add_load(plant_context, parameters, load)
        return context

    def set_profile(self, context: Context, profile: SpinProfile) -> None:
        """Set the spin profile in a root Context, and the drum speed to its first speed."""
        self.spin_profile.set_profile(self.spin_profile.GetMyContextFromRoot(context), profile)
        plant_context = self.plant.GetMyContextFromRoot(context)
        velocities = self.plant.GetVelocities(plant_context)
        velocities[self.state_layout.drum] = profile.speed[0]
        self.plant.SetVelocities(plant_context, velocities)

    def set_drum_acceleration(self, context: Context, acceleration: float) -> None:
        """Fix the drum's acceleration in a root Context, in place of the spin profile. [rad/s^2]

        The port "drum_acceleration" must not be connected.
        """
        self.inputs["drum_acceleration"].FixValue(
            self.speed_source.GetMyContextFromRoot(context), [acceleration]
        )

    def elastic_and_gravity_force(self, setup: Setup) -> FloatArray:
        """Return the moment about To and the force of all elements and gravity on the tub, in W.

        Args:
            setup: Machine at the pose of its Context.

        Returns:
            (6,) [N m, N]
        """
        context = setup.plant_context
        applied = AppliedForce(setup.elements, self.state_layout)
        force = applied(self.plant.GetPositionsAndVelocities(context))
        force += self.plant.CalcGravityGeneralizedForces(context)
        return np.asarray(force[self.state_layout.tub])

    def _load(self, load: Load | str | None, parameters: MachineParameters) -> Load | None:
        """Return a load that may be given by its name."""
        if not isinstance(load, str):
            return load
        if load not in parameters.loads:
            raise input_error(
                f"no load '{load}' in machine '{parameters.name}'"
                f"{nearest_names(load, parameters.loads)}",
                key="loads",
            )
        return parameters.loads[load]

    def _add_load(
        self, plant_context: Context, parameters: MachineParameters, load: Load | None
    ) -> None:
        """Add a load and the drum's residual imbalance to the drum; add neither without a load."""
        if load is not None:
            add_load(self.plant, plant_context, load)
            imbalance = parameters.imperfections.residual_imbalance
            add_load(self.plant, plant_context, Load(unbalances=(imbalance,)))

    def _frame_poses(self, plant_context: Context, parameters: MachineParameters) -> FramePoses:
        """Return the frame poses; those of the last set-up if its overrides were the same."""
        if not self._poses or self._poses[0].frames != parameters.frames:
            self._poses[:] = [FramePoses(self.plant, parameters.frames, plant_context)]
        self._poses[0].context = plant_context
        return self._poses[0]

    def _set_systems(self, context: Context, elements: PlacedElements, points: FloatArray) -> None:
        """Set the parameters of elements and sensors in a root Context, and relax the sponges."""
        pairs: list[tuple[Mapping[str, Any], Mapping[str, Any]]] = [
            (self.springs, elements.springs),
            (self.dampers, elements.dampers),
            (self.bushings, elements.bushings),
            (self.telescopes, elements.telescopes),
        ]
        if self.bearing:
            pairs.append(({"": self.bearing}, {"": elements.bearing}))
        for systems, placed in pairs:
            for name, system in systems.items():
                own = system.GetMyContextFromRoot(context)
                system.set_parameters(own, placed[name].packed())
                if system.state_size:
                    own.SetContinuousState(np.zeros(system.state_size))
        self.sensors.set_points(self.sensors.GetMyContextFromRoot(context), points)


@dataclass(frozen=True)
class Machine(MachineSystems):
    """A machine as a diagram of its own. The named ports are exported: inputs and outputs.

    Attributes:
        diagram: The diagram.
    """

    diagram: Diagram

    def set_up(
        self,
        load: Load | str | None = None,
        *,
        context: Context | None = None,
        parameters: MachineParameters | None = None,
        profile: SpinProfile | None = None,
        gasket: bool = True,
        dampers: bool = True,
    ) -> Setup:
        """Set numbers and load in a Context, at rest; a fresh Context at time 0 if None is given.

        See `MachineSystems.set_up`.
        """
        return super().set_up(
            load,
            context=context or self.diagram.CreateDefaultContext(),
            parameters=parameters,
            profile=profile,
            gasket=gasket,
            dampers=dampers,
        )

    def set_up_bodies(
        self, load: Load | None, parameters: MachineParameters, context: Context | None = None
    ) -> Context:
        """Set bodies, frames and load in a Context, a fresh one if None; see `MachineSystems`."""
        context = context or self.diagram.CreateDefaultContext()
        return super().set_up_bodies(load, parameters, context)

    def set_drum_acceleration(self, context: Context, acceleration: float) -> None:
        """Fix the drum's acceleration in a root Context; see `MachineSystems`. [rad/s^2]"""
        self.diagram.GetInputPort("drum_acceleration").FixValue(context, [acceleration])


def add_washing_machine(
    builder: DiagramBuilder, parameters: MachineParameters, *, name: str = ""
) -> MachineSystems:
    """Add a washing machine to a diagram.

    Connect your own systems to the ports of the result, build the diagram, and call `set_up` with a
    Context of it.

    Args:
        builder: Any DiagramBuilder.
        parameters: The machine.
        name: Prefix of the names of its systems, for several machines in one diagram.

    Raises:
        InputError: the SDF or the machine file has an error.
    """
    prefix = f"{name}_" if name else ""
    plant = builder.AddNamedSystem(f"{prefix}bodies", MultibodyPlant(time_step=0.0))
    add_bodies(plant, parameters)
    layout = state_layout_of(plant, parameters)
    context = plant.CreateDefaultContext()
    set_bodies(plant, context, parameters)  # raises for unknown names, which placing would use
    poses = FramePoses(plant, parameters.frames, context)
    placed = placed_elements(plant, poses, parameters)
    points = measured_points(parameters, _tub_points(poses, parameters), np.zeros(6))
    wiring = Wiring(builder, plant, layout, prefix)
    springs = {key: SpringStrut(spring.packed()) for key, spring in placed.springs.items()}
    dampers = {
        key: FrictionDamper(damper.packed(), int(damper.has_sponge))
        for key, damper in placed.dampers.items()
    }
    bushings = {key: SixComponentBushing(bush.packed()) for key, bush in placed.bushings.items()}
    telescopes = {
        key: TelescopicDamper(telescope.packed(), int(telescope.has_sponge))
        for key, telescope in placed.telescopes.items()
    }
    bearing = DrumBearing(placed.bearing.packed()) if placed.bearing else None
    on_tub, links = _labelled(springs, dampers, bushings, telescopes, bearing)
    profile, source, torque = _add_drive(wiring, parameters)
    tub_force, sensors = TubForce(), Sensors(points)
    tub_state = wiring.tub_state()
    wiring.connect_elements(tub_state, [*on_tub, ("tub_force", tub_force)], links)
    builder.Connect(tub_state, wiring.add("sensors", sensors).GetInputPort("plant_state"))
    inputs = {"drum_acceleration": source.GetInputPort("drum_acceleration")}
    inputs["tub_force"] = tub_force.GetInputPort("tub_force")
    outputs = {"state": plant.get_state_output_port()}
    for port in ("displacement", "detergent_displacement", "drum_speed"):
        outputs[port] = sensors.GetOutputPort(port)
    outputs["motor_torque"] = torque.GetOutputPort("torque")
    for label, system in [*on_tub, *((link.label, link.system) for link in links)]:
        for port in _own_outputs(system):
            outputs[f"{label}_{port}"] = system.GetOutputPort(port)
    systems = springs, dampers, bushings, telescopes, bearing
    return MachineSystems(
        parameters, plant, layout, profile, source, sensors, *systems, inputs, outputs
    )


def build_machine(parameters: MachineParameters, *, meshcat: Meshcat | None = None) -> Machine:
    """Build the diagram of a machine alone, with its named ports exported.

    Build once and reuse: a Drake diagram with Python systems is never freed. Every number can be
    changed afterwards in a Context (`Machine.set_up`).

    Args:
        parameters: The machine.
        meshcat: Shows the moving machine if given; the shapes cannot touch the dynamics.

    Raises:
        InputError: the SDF or the machine file has an error.
    """
    builder = DiagramBuilder()
    systems = add_washing_machine(builder, parameters)
    if meshcat is not None:
        add_visualizer(builder, parameters, systems.state_layout, systems.outputs["state"], meshcat)
    for name, port in systems.inputs.items():
        builder.ExportInput(port, name)
    for name, port in systems.outputs.items():
        builder.ExportOutput(port, name)
    diagram = builder.Build()
    diagram.set_name(parameters.name)
    values = {key: value for key, value in vars(systems).items() if key != "_poses"}
    return Machine(**values, diagram=diagram)


def _labelled(
    springs: Mapping[str, Any],
    dampers: Mapping[str, Any],
    bushings: Mapping[str, Any],
    telescopes: Mapping[str, Any],
    bearing: DrumBearing | None,
) -> tuple[list[tuple[str, Any]], list[Link]]:
    """Return the elements on the tub with their labels, and the links to other trees."""
    on_tub = [(f"spring_{name}", system) for name, system in springs.items()]
    on_tub += [(f"damper_{name}", system) for name, system in dampers.items()]
    on_tub += [
        ("gasket" if name == "gasket" else f"bushing_{name}", system)
        for name, system in bushings.items()
    ]
    links = [
        Link(f"damper_{name}", system, tree)
        for tree, (name, system) in enumerate(telescopes.items(), start=1)
    ]
    if bearing:
        links.append(Link("drum_bearing", bearing, 1 + len(telescopes)))
    return on_tub, links


def _add_drive(
    wiring: Wiring, parameters: MachineParameters
) -> tuple[SpinProfileSource, SpeedSource, MotorTorque]:
    """Add spin profile, speed source and motor torque, and connect them to the plant."""
    builder, plant = wiring.builder, wiring.plant
    profile = wiring.add("spin_profile", SpinProfileSource(parameters.profile))
    source = wiring.add("speed_source", SpeedSource())
    size, drum = plant.num_velocities(), wiring.layout.drum
    torque = wiring.add("motor_torque", MotorTorque(size, drum))
    actuation = source.GetOutputPort("actuation")
    builder.Connect(
        profile.GetOutputPort("acceleration"), source.GetInputPort("profile_acceleration")
    )
    builder.Connect(actuation, plant.get_actuation_input_port())
    builder.Connect(actuation, torque.GetInputPort("actuation"))
    builder.Connect(
        plant.get_generalized_acceleration_output_port(),
        torque.GetInputPort("generalized_acceleration"),
    )
    return profile, source, torque


def _own_outputs(system: Any) -> list[str]:
    """Return the names of the element's own output ports."""
    names = [system.get_output_port(i).get_name() for i in range(system.num_output_ports())]
    return [name for name in names if name not in ("generalized_force", "state")]


def _tub_points(poses: FramePoses, parameters: MachineParameters) -> TubPoints:
    """Return the measured points of the tub."""
    sensors = {name: poses("tub", sensor.frame)[0] for name, sensor in parameters.sensors.items()}
    detergent = poses("tub", parameters.clearance.detergent_frame)[0]
    frames = parameters.accelerometer_frames()
    accelerometers = {name: poses("tub", frame)[0] for name, frame in frames.items()}
    return TubPoints(sensors, detergent, accelerometers)
