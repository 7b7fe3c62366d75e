"""Add a machine to a diagram, or build a diagram of it alone."""

from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TypeAlias, TypeVar

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from wm_drake.elements.cabinet import FEET, SLIP_SIZE
from wm_drake.elements.motor import DRUM_FRICTION, packed_controller, packed_friction, packed_limit
from wm_drake.elements.water import packed_water
from wm_drake.errors import input_error
from wm_drake.model.drawn_machine import DrawnMachine, RestingMachine
from wm_drake.model.machine import Machine, MachineSystems, MotorSystems
from wm_drake.model.placed_elements import Parts, PlacedElements, initial_state
from wm_drake.model.plant_copy import plant_at
from wm_drake.model.visualization import add_visualizer
from wm_drake.model.wiring import Link, Wiring
from wm_drake.parameters import Load, MachineParameters, MotorDrive, load_machine
from wm_drake.parameters.drive import motor_of
from wm_drake.systems.cabinet import Cabinet
from wm_drake.systems.element_system import ElementSystem, element_system
from wm_drake.systems.motor import Belt, Motor, SpeedController
from wm_drake.systems.sensors import DRUM_OUTPUTS, Sensors
from wm_drake.systems.speed_source import MotorTorque, SpeedSource
from wm_drake.systems.spin_profile_source import SpinProfileSource
from wm_drake.systems.tub_force import TubForce
from wm_drake.systems.water import Water


class Loads(Enum):
    """A load that is named by its place in the machine file."""

    FIRST = "the first load of the machine"


AnyMachine: TypeAlias = Machine | MachineParameters | str | Path
"""A built machine, parameters, the name of a shipped machine, or a machine file."""


def add_washing_machine(
    builder: DiagramBuilder,
    parameters: MachineParameters | str | Path,
    *,
    load: Load | str | Loads | None = Loads.FIRST,
    gasket: bool = True,
    name: str = "",
) -> MachineSystems:
    """Add a washing machine to a diagram.

    Connect your own systems to the ports of the result and build the diagram. In its default
    Context the machine is at rest with its load; `set_up` changes numbers and load in a Context.
    A default Context has no velocities: with a spin profile that starts above 0 rpm a Simulator
    refuses it, and `set_up` is needed.

    Args:
        builder: Any DiagramBuilder.
        parameters: The machine, the name of a shipped one, or a machine file.
        load: Point masses in the drum, or the name of one of the machine's loads, by default the
            first; None for the empty machine.
        gasket: False disengages it.
        name: Prefix of the names of its systems, for several machines in one diagram.

    Raises:
        InputError: the SDF or the machine file has an error, there is no such load, or there is no
            equilibrium.

    Example:
        >>> import wm_drake as wm
        >>> from pydrake.systems.framework import DiagramBuilder
        >>> builder = DiagramBuilder()
        >>> washer = wm.add_washing_machine(builder, wm.load_machine("reference"))
        >>> sorted(washer.inputs)
        ['drum_acceleration', 'tub_force']
    """
    if not isinstance(parameters, MachineParameters):
        parameters = load_machine(parameters)
    if load is Loads.FIRST:
        load = next(iter(parameters.loads.values()), None)
    drawn, prefix = DrawnMachine(parameters), f"{name}_" if name else ""
    resting = drawn.at_rest(load, parameters, Parts(gasket))
    assert resting.bodies is not None  # they are asked for
    plant = builder.AddNamedSystem(f"{prefix}bodies", plant_at(drawn.plant, resting.bodies))
    wiring = Wiring(builder, plant, drawn.state_layout, prefix)
    by_label, on_tub, links = _element_systems(resting.elements, parameters.profile.speed[0])
    drive = motor_of(parameters.drive)
    friction = element_system(DRUM_FRICTION, packed_friction(drive)) if drive else None
    tub_force, sensors = TubForce(), Sensors(resting.measured_points)
    others = [("tub_force", tub_force), *([("drum_friction", friction)] if friction else [])]
    mounting = _connect_elements(wiring, resting, on_tub, others, links)
    builder.Connect(mounting.seen, wiring.add("sensors", sensors).GetInputPort("plant_state"))
    profile = wiring.add("spin_profile", SpinProfileSource(parameters.profile))
    if drive and friction:
        driven = _add_motor(wiring, drive, profile, sensors, friction)
    else:
        driven = _add_speed_source(wiring, profile, sensors)
    water = _add_water(wiring, resting, sensors)
    return MachineSystems(
        parameters=parameters,
        plant=plant,
        drawn=drawn,
        spin_profile=profile,
        speed_source=driven.source,
        motor=driven.motor,
        sensors=sensors,
        **_by_kind(resting.elements, by_label),
        cabinet=mounting.cabinet,
        feet=mounting.feet,
        water=water,
        inputs=Inputs(driven.inputs, tub_force=tub_force.GetInputPort("tub_force")),
        outputs=Outputs(
            {
                "state": plant.get_state_output_port(),
                **_sensed(sensors),
                **driven.outputs,
                **({"water_left": water.GetOutputPort("left")} if water else {}),
                **mounting.outputs(),
                **_element_outputs(by_label),
            }
        ),
    )


def build_machine(
    parameters: MachineParameters | str | Path,
    *,
    load: Load | str | Loads | None = Loads.FIRST,
    gasket: bool = True,
    meshcat: Meshcat | None = None,
) -> Machine:
    """Build the diagram of a machine alone, with its named ports exported.

    In its default Context the machine is at rest with its load, so that a plain Simulator runs it.
    Build once and reuse: every number can be changed afterwards in a Context (`Machine.set_up`).

    Args:
        parameters: The machine, the name of a shipped one, or a machine file.
        load, gasket: As in `add_washing_machine`.
        meshcat: Shows the moving machine if given; the shapes cannot touch the dynamics.

    Raises:
        InputError: as `add_washing_machine`.

    Example:
        >>> import wm_drake as wm
        >>> from pydrake.systems.analysis import Simulator
        >>> machine = wm.build_machine("reference", load="counter")
        >>> status = Simulator(machine.diagram).AdvanceTo(0.1)
        >>> sorted(machine.springs)
        ['left', 'rear', 'right']
    """
    builder = DiagramBuilder()
    systems = add_washing_machine(builder, parameters, load=load, gasket=gasket)
    if meshcat is not None:
        add_visualizer(builder, systems, meshcat)
    for name, port in systems.inputs.items():
        builder.ExportInput(port, name)
    for name, port in systems.outputs.items():
        builder.ExportOutput(port, name)
    diagram = builder.Build()
    diagram.set_name(systems.parameters.name)
    return Machine(**vars(systems), diagram=diagram)


def machine_of(machine: AnyMachine) -> Machine:
    """Return a machine that may be given by its parameters, name or file, built."""
    return machine if isinstance(machine, Machine) else build_machine(machine)


def _element_systems(
    placed: PlacedElements, drum_rate: float
) -> tuple[dict[str, ElementSystem], list[tuple[str, Any]], list[Link]]:
    """Return the systems of all elements by label, those on the tub, and those of tubes.

    Args:
        drum_rate: Rate of the drum at the start. [rad/s]
    """
    by_label, on_tub, links = dict[str, ElementSystem](), list[tuple[str, Any]](), list[Link]()
    for label, element, kind, tree in placed.by_tree():
        initial = initial_state(element, drum_rate)
        system = by_label[label] = element_system(kind, element.packed(), initial)
        if tree:
            links.append(Link(label, system, tree))
        else:
            on_tub.append((label, system))
    return by_label, on_tub, links


def _by_kind(placed: PlacedElements, by_label: dict[str, ElementSystem]) -> dict[str, Any]:
    """Return the element systems by field of `MachineSystems`."""
    systems = iter(by_label.values())  # in the order of `by_tree`
    fields = ("springs", "dampers", "bushings", "others", "telescopes")
    by_field: dict[str, Any] = {
        field: {name: next(systems) for name in getattr(placed, field)} for field in fields
    }
    return by_field | {"bearing": next(systems, None)}


class Mounting(NamedTuple):
    """Where the tub is mounted.

    Attributes:
        seen: Port of the state of tub and drum seen from there.
        cabinet, feet: The cabinet and its feet if it moves, else None.
    """

    seen: OutputPort
    cabinet: Cabinet | None = None
    feet: ElementSystem | None = None

    def outputs(self) -> dict[str, OutputPort]:
        """Return the output ports of a cabinet that moves, by name."""
        if self.feet is None:
            return {}
        return {
            "tub_in_cabinet": self.seen,
            "feet_floor_force": self.feet.GetOutputPort("floor_force"),
        }


def _connect_elements(
    wiring: Wiring,
    resting: RestingMachine,
    on_tub: list[tuple[str, Any]],
    others: list[tuple[str, Any]],
    links: list[Link],
) -> Mounting:
    """Connect all elements to the plant, those on the tub by way of a cabinet if it moves.

    Args:
        on_tub, links: From `_element_systems`.
        others: Systems on tub and drum that no cabinet carries, by label.
    """
    tub_state = wiring.tub_state()
    if resting.cabinet is None:
        wiring.connect_elements(tub_state, [*on_tub, *others], links)
        return Mounting(tub_state)
    cabinet = Cabinet()
    feet = element_system(FEET, resting.cabinet.packed(), np.zeros(SLIP_SIZE))
    on_cabinet = Link("cabinet", cabinet, len(wiring.layout.trees) - 1)
    wiring.connect_elements(tub_state, others, [*links, on_cabinet])
    return Mounting(wiring.connect_cabinet(cabinet, on_tub, feet), cabinet, feet)


class Driven(NamedTuple):
    """Drive of a machine.

    Attributes:
        inputs, outputs: Its ports by name.
        source: The speed source, None with a motor.
        motor: The systems of the motor, None with a speed source.
    """

    inputs: dict[str, InputPort]
    outputs: dict[str, OutputPort]
    source: SpeedSource | None = None
    motor: MotorSystems | None = None


def _add_motor(
    wiring: Wiring,
    drive: MotorDrive,
    profile: SpinProfileSource,
    sensors: Sensors,
    friction: ElementSystem,
) -> Driven:
    """Add controller, motor and belt, and connect them to each other, the profile and the plant."""
    connect = wiring.builder.Connect
    sample_time = drive.controller.sample_time or 0.0
    controller = wiring.add(
        "speed_controller", SpeedController(packed_controller(drive), sample_time)
    )
    motor = wiring.add("motor", Motor(packed_limit(drive)))
    belt = wiring.add("belt", Belt(np.array([drive.belt_ratio])))
    connect(profile.GetOutputPort("speed"), controller.GetInputPort("profile_speed"))
    connect(controller.GetOutputPort("demand"), motor.GetInputPort("demand"))
    connect(motor.GetOutputPort("torque_limit"), controller.GetInputPort("torque_limit"))
    connect(motor.GetOutputPort("torque"), belt.GetInputPort("motor_torque"))
    connect(belt.GetOutputPort("motor_speed"), motor.GetInputPort("motor_speed"))
    torque = belt.GetOutputPort("drum_torque")
    connect(torque, wiring.plant.get_actuation_input_port())
    for system in (controller, belt):
        connect(sensors.GetOutputPort("drum_speed"), system.GetInputPort("drum_speed"))
    inputs = {
        "drum_speed_reference": controller.GetInputPort("speed_reference"),
        "drum_torque": belt.GetInputPort("given_torque"),
    }
    outputs = {
        "motor_torque": torque,
        "drum_friction_torque": friction.GetOutputPort("torque"),
    }
    return Driven(inputs, outputs, motor=MotorSystems(controller, motor, belt, friction))


def _add_speed_source(wiring: Wiring, profile: SpinProfileSource, sensors: Sensors) -> Driven:
    """Add speed source and motor torque, and connect them to the profile and the plant."""
    builder, plant = wiring.builder, wiring.plant
    source = wiring.add("speed_source", SpeedSource())
    size, drum = plant.num_velocities(), wiring.layout.drum
    torque = wiring.add("motor_torque", MotorTorque(size, drum))
    actuation = source.GetOutputPort("actuation")
    for quantity in ("acceleration", "speed"):
        port = source.GetInputPort(f"profile_{quantity}")
        builder.Connect(profile.GetOutputPort(quantity), port)
    builder.Connect(sensors.GetOutputPort("drum_speed"), source.GetInputPort("drum_speed"))
    builder.Connect(actuation, plant.get_actuation_input_port())
    builder.Connect(actuation, torque.GetInputPort("actuation"))
    builder.Connect(
        plant.get_generalized_acceleration_output_port(),
        torque.GetInputPort("generalized_acceleration"),
    )
    inputs = {"drum_acceleration": source.GetInputPort("drum_acceleration")}
    return Driven(inputs, {"motor_torque": torque.GetOutputPort("torque")}, source=source)


def _add_water(wiring: Wiring, resting: RestingMachine, sensors: Sensors) -> Water | None:
    """Add the water in the laundry, which leaves with the drum speed; None if no load is wet."""
    packed = packed_water(resting.load) if resting.load else []
    count = max(resting.parameters.most_wet, len(packed))
    if not count:
        return None
    water = wiring.add("water", Water(count, packed))
    speed = sensors.GetOutputPort("drum_speed")
    wiring.builder.Connect(speed, water.GetInputPort("drum_speed"))
    return water


def _sensed(sensors: Sensors) -> dict[str, OutputPort]:
    """Return the output ports of the sensors by name."""
    names = ("displacement", "detergent_displacement", *DRUM_OUTPUTS)
    return {name: sensors.GetOutputPort(name) for name in names}


def _element_outputs(by_label: dict[str, ElementSystem]) -> dict[str, OutputPort]:
    """Return the elements' own output ports, their names behind the label of the element."""
    return {
        f"{label}_{port.get_name()}": port
        for label, system in by_label.items()
        for port in map(system.get_output_port, range(system.num_output_ports()))
        if port.get_name() not in ("generalized_force", "state")
    }


Port = TypeVar("Port")

OF_OTHER_DRIVES = {
    "drum_acceleration": "it belongs to a drive that prescribes the speed",
    "drum_speed_reference": "it needs a drive with a motor, as in load_machine('motor')",
    "drum_torque": "it needs a drive with a motor, as in load_machine('motor')",
    "drum_friction_torque": "it needs a drive with a motor, as in load_machine('motor')",
    "tub_in_cabinet": "it needs a cabinet that moves",
    "feet_floor_force": "it needs a cabinet that moves",
    "water_left": "it needs a load with water",
}
"""Why a machine may lack a port."""


class Ports(dict[str, Port]):
    """Ports by name."""

    kind = "port"

    def __missing__(self, name: str) -> NoReturn:
        """Refuse a name that no port has.

        Raises:
            InputError: always; it lists the ports.
        """
        reason = f"; {OF_OTHER_DRIVES[name]}" if name in OF_OTHER_DRIVES else ""
        raise input_error(
            f"no {self.kind} '{name}'{reason}. The {self.kind}s are {', '.join(sorted(self))}"
        )


class Inputs(Ports[Port]):
    """Input ports by name."""

    kind = "input"


class Outputs(Ports[Port]):
    """Output ports by name."""

    kind = "output"
