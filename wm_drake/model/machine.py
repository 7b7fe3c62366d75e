"""The machine: SDF bodies and force systems as one Drake diagram, and the Contexts in which its numbers are set."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from wm_drake.elements.bushing import SixComponentBushingParameters
from wm_drake.elements.friction_damper import FrictionDamperParameters
from wm_drake.elements.spring import SpringStrutParameters
from wm_drake.elements.telescopic_damper import TelescopicDamperParameters
from wm_drake.errors import input_error, nearest_names
from wm_drake.model.bodies import add_bodies, add_load, set_bodies
from wm_drake.model.equilibrium import generalized_force, preloaded, put_to_rest
from wm_drake.model.frame_poses import (
    FramePoses,
    placed_bearing,
    placed_bushings,
    placed_dampers,
    placed_springs,
    placed_telescopes,
)
from wm_drake.model.state_layout import StateLayout, state_layout_of
from wm_drake.model.whirl import max_bearing_eigenvalue
from wm_drake.model.wiring import Link, connect
from wm_drake.parameters import Load, MachineParameters, Sensor
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.drum_bearing import DrumBearing
from wm_drake.systems.friction_damper import FrictionDamper
from wm_drake.systems.six_component_bushing import SixComponentBushing
from wm_drake.systems.speed_source import SpeedSource
from wm_drake.systems.spring_strut import SpringStrut
from wm_drake.systems.telescopic_damper import TelescopicDamper

OUTPUT_PERIOD = 5e-3
"""Time between samples of a record, as the measurements of [B]. [s]"""


class _Elements(NamedTuple):
    """Elements in their places, by name."""

    springs: dict[str, SpringStrutParameters]
    dampers: dict[str, FrictionDamperParameters]
    bushings: dict[str, SixComponentBushingParameters]
    telescopes: dict[str, TelescopicDamperParameters]


@dataclass(frozen=True)
class Setup:
    """A machine set up in a Context: numbers chosen, preloads solved, at rest at its rest pose.

    Attributes:
        machine: The built machine.
        parameters: The numbers in force.
        context: Root Context of the diagram.
        springs, dampers, bushings, telescopes: The elements in their places, by name.
        bearing: That of the drum, if it gives: between what carries the drum and the tub, which is its ground side.
        sensor_points: By sensor name, the point in T. [m]
        detergent_point: Tub point nearest the detergent box, in T. [m]
        accelerometer_points: By name of the vibration sensor, the point in T. [m]
        rest_pose: Equilibrium of the empty machine: roll, pitch, yaw, x, y, z. [rad, m]
        residual: What remains there of moment about To and force on the tub, in W. [N m, N]
        tube_rest: (telescopic dampers, 7) angles and position of each outer tube and extension of the damper there. [rad, m]
        carrier_rest: Angles and position there of what carries the drum in its bearing, if that gives; else empty. [rad, m]
        bearing_rate: Fastest motion of the empty drum in its bearing; 0 if that does not give. [rad/s]
    """

    machine: "Machine"
    parameters: MachineParameters
    context: Context
    springs: dict[str, SpringStrutParameters]
    dampers: dict[str, FrictionDamperParameters]
    bushings: dict[str, SixComponentBushingParameters]
    telescopes: dict[str, TelescopicDamperParameters]
    bearing: SixComponentBushingParameters | None
    sensor_points: dict[str, FloatArray]
    detergent_point: FloatArray
    accelerometer_points: dict[str, FloatArray]
    rest_pose: FloatArray
    residual: FloatArray
    tube_rest: FloatArray
    carrier_rest: FloatArray
    bearing_rate: float

    @property
    def plant_context(self) -> Context:
        """The plant's part of the Context."""
        return self.machine.plant.GetMyContextFromRoot(self.context)

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Sensors by name."""
        return self.parameters.sensors


@dataclass(frozen=True)
class Machine:
    """A built machine: diagram, plant and handles to every system in it. Numbers live in a Context: see `set_up`.

    `blank` is a Context in which nothing is set; `places` remembers where frames are.
    """

    parameters: MachineParameters
    diagram: Diagram
    plant: MultibodyPlant
    state_layout: StateLayout
    source: SpeedSource
    springs: dict[str, SpringStrut]
    dampers: dict[str, FrictionDamper]
    bushings: dict[str, SixComponentBushing]
    telescopes: dict[str, TelescopicDamper]
    bearing: DrumBearing | None
    blank: Context
    places: list[FramePoses] = field(default_factory=list, repr=False, compare=False)

    def set_up(
        self,
        load: Load | None = None,
        *,
        parameters: MachineParameters | None = None,
        gasket: bool = True,
        dampers: bool = True,
        context: Context | None = None,
    ) -> Setup:
        """A Context at the rest pose, with these numbers.

        Setting numbers in a Context of one built machine gives, bit for bit, what a machine built from them gives.

        Args:
            load: Point masses in the drum; None for the empty machine. Preloads and rest pose are those of the empty machine.
            parameters: Numbers to use; those it was built from if None. Same elements, same laws, tables of the same length.
            gasket, dampers: False takes them out of the machine.
            context: A Context of an earlier Setup to use again, which is over then; a fresh one if None.

        Raises:
            InputError: other elements than were built, names unknown to the SDF, or no static equilibrium.
        """
        parameters = parameters or self.parameters
        _check_same_elements(self.parameters, parameters)
        context = self.set_up_bodies(None, parameters, context)
        plant_context = self.plant.GetMyContextFromRoot(context)
        places = self._places(plant_context, parameters)
        bearing = placed_bearing(self.plant, parameters)
        self._set(context, self._bearings, {"bearing": bearing})
        elements = self._put_in(context, places, parameters)
        if not gasket:
            self._take_gasket_out(context, elements)
        if not dampers:
            self._take_friction_out(context, elements)
        residual = put_to_rest(self.plant, plant_context, self.state_layout)
        fastest = (
            max_bearing_eigenvalue(self.plant, plant_context, self.state_layout, bearing)
            if bearing
            else 0.0
        )
        self._hang_in(plant_context, parameters, load)
        positions = self.plant.GetPositions(plant_context)
        points = {
            name: places("tub", sensor.frame)[0] for name, sensor in parameters.sensors.items()
        }
        detergent_point = places("tub", parameters.clearance.detergent_frame)[0]
        vibrations = {
            name: places("tub", frame)[0]
            for name, frame in parameters.accelerometer_frames().items()
        }
        whole = self.state_layout
        rest = positions[whole.tub], residual, positions[whole.tubes], positions[whole.carrier]
        return Setup(
            self,
            parameters,
            context,
            *elements,
            bearing,
            points,
            detergent_point,
            vibrations,
            *rest,
            fastest,
        )

    def _put_in(
        self, context: Context, places: FramePoses, parameters: MachineParameters
    ) -> _Elements:
        """Elements in their places, their numbers in the Context; springs with the preload that the empty machine needs."""
        bushings, dampers = placed_bushings(places, parameters), placed_dampers(places, parameters)
        telescopes = placed_telescopes(self.plant, places, parameters)
        unloaded = placed_springs(places, parameters)
        for systems, placed in (
            (self.bushings, bushings),
            (self.dampers, dampers),
            (self.telescopes, telescopes),
            (self.springs, unloaded),
        ):
            self._set(context, systems, placed)
        springs = preloaded(
            self.plant, self.plant.GetMyContextFromRoot(context), self.state_layout, unloaded
        )
        self._set(context, self.springs, springs)
        return _Elements(springs, dampers, bushings, telescopes)

    def _take_gasket_out(self, context: Context, elements: _Elements) -> None:
        """Of a machine that has one."""
        if "gasket" in elements.bushings:
            elements.bushings["gasket"] = replace(elements.bushings["gasket"], engaged=0.0)
            self._set(context, self.bushings, elements.bushings)

    def _take_friction_out(self, context: Context, elements: _Elements) -> None:
        """Dampers; of telescopic ones, their laws and the friction in their bushings."""
        for name, damper in elements.dampers.items():
            elements.dampers[name] = replace(damper, engaged=0.0)
        for name, telescope in elements.telescopes.items():
            elements.telescopes[name] = telescope.without_friction()
        self._set(context, self.dampers, elements.dampers)
        self._set(context, self.telescopes, elements.telescopes)

    def set_up_bodies(
        self, load: Load | None, parameters: MachineParameters, context: Context | None = None
    ) -> Context:
        """A Context, fresh or used again, in which bodies, frames and load are set and nothing else; raises as `set_up`."""
        if context is None:
            context = self.diagram.CreateDefaultContext()
        else:
            context.SetTimeStateAndParametersFrom(self.blank)
        plant_context = self.plant.GetMyContextFromRoot(context)
        set_bodies(self.plant, plant_context, parameters)
        self._hang_in(plant_context, parameters, load)
        return context

    def _hang_in(
        self, plant_context: Context, parameters: MachineParameters, load: Load | None
    ) -> None:
        """The load, and with it what the drum is out of balance by itself; neither in the empty machine."""
        if load is not None:
            add_load(self.plant, plant_context, load)
            add_load(
                self.plant,
                plant_context,
                Load(unbalances=(parameters.imperfections.residual_imbalance,)),
            )

    def _places(self, plant_context: Context, parameters: MachineParameters) -> FramePoses:
        """Where frames are; remembered from the last set-up, if that had the same overrides."""
        if not self.places or self.places[0].frames != parameters.frames:
            self.places[:] = [FramePoses(self.plant, parameters.frames, plant_context)]
        self.places[0].context = plant_context
        return self.places[0]

    def _set(self, context: Context, systems: dict[str, Any], placed: dict[str, Any]) -> None:
        for name, system in systems.items():
            system.set_parameters(system.GetMyContextFromRoot(context), placed[name].packed())

    @contextmanager
    def held(self, context: Context) -> Iterator[None]:
        """For a run: all elements keep the parameters of this Context at hand, which makes it a fifth faster."""
        tables = (self.springs, self.dampers, self.bushings, self.telescopes, self._bearings)
        elements = [element for table in tables for element in table.values()]
        try:
            for element in elements:
                element.hold(element.GetMyContextFromRoot(context))
            yield
        finally:
            for element in elements:
                element.release()

    @property
    def _bearings(self) -> dict[str, DrumBearing]:
        return {"bearing": self.bearing} if self.bearing else {}

    def elastic_and_gravity_force(self, context: Context) -> FloatArray:
        """Moment about To and force on the tub in W at the Context's pose: all elements and gravity. [N m, N]"""
        return generalized_force(self.plant, self.plant.GetMyContextFromRoot(context))[
            self.state_layout.tub
        ]


def build_machine(parameters: MachineParameters) -> Machine:
    """Builds the diagram of a machine.

    Build once and reuse: a Drake diagram with Python systems is never freed. Everything numeric can be changed afterwards in
    a Context (`Machine.set_up`).

    Raises:
        InputError: SDF or machine file at fault.
    """
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("bodies", MultibodyPlant(time_step=0.0))
    add_bodies(plant, parameters)
    state_layout = state_layout_of(plant, parameters)
    context = plant.CreateDefaultContext()
    set_bodies(
        plant, context, parameters
    )  # reports unknown names before anything is placed by them
    places = FramePoses(plant, parameters.frames, context)
    springs = {
        name: SpringStrut(placed.packed())
        for name, placed in placed_springs(places, parameters).items()
    }
    dampers = {
        name: FrictionDamper(placed.packed(), int(placed.has_sponge))
        for name, placed in placed_dampers(places, parameters).items()
    }
    bushings = {
        name: SixComponentBushing(placed.packed())
        for name, placed in placed_bushings(places, parameters).items()
    }
    source = builder.AddNamedSystem("speed_source", SpeedSource())
    telescopes = {
        name: TelescopicDamper(placed.packed(), int(placed.has_sponge))
        for name, placed in placed_telescopes(plant, places, parameters).items()
    }
    elements = {"spring": springs, "damper": dampers, "bushing": bushings}
    labels = [
        (_label(kind, name), system)
        for kind, systems in elements.items()
        for name, system in systems.items()
    ]
    links = [
        Link(f"damper_{name}", name, system, 1 + index)
        for index, (name, system) in enumerate(telescopes.items())
    ]
    placed = placed_bearing(plant, parameters)
    bearing = DrumBearing(placed.packed()) if placed else None
    if bearing:
        links.append(Link("drum_bearing", "drum_bearing", bearing, len(state_layout.trees) - 1))
    connect(builder, plant, state_layout, labels, links)
    builder.Connect(source.get_output_port(), plant.get_actuation_input_port())
    diagram = builder.Build()
    diagram.set_name(parameters.name)
    context = diagram.CreateDefaultContext()
    return Machine(
        parameters,
        diagram,
        plant,
        state_layout,
        source,
        springs,
        dampers,
        bushings,
        telescopes,
        bearing,
        context,
    )


def _label(kind: str, name: str) -> str:
    return "gasket" if (kind, name) == ("bushing", "gasket") else f"{kind}_{name}"


def _check_same_elements(built: MachineParameters, wanted: MachineParameters) -> None:
    """Refuses numbers for another machine than the built one."""
    for key in ("model", "gravity"):
        if getattr(wanted, key) != getattr(built, key):
            raise input_error(
                f"{getattr(wanted, key)} is not the built machine's {getattr(built, key)}; build a new one",
                key=key,
            )
    for table in ("springs", "dampers", "all_bushings", "telescopic_dampers"):
        names = [set(t() if callable(t := getattr(p, table)) else t) for p in (built, wanted)]
        if names[0] != names[1]:
            other = sorted(names[0] ^ names[1])[0]
            raise input_error(
                f"'{other}' is not in both machines{nearest_names(other, names[0])}; build a new machine",
                key=table.removeprefix("all_"),
            )
    if (wanted.imperfections.bearing is None) != (built.imperfections.bearing is None):
        given, other = (
            ("gives", "does not") if wanted.imperfections.bearing else ("does not give", "does")
        )
        raise input_error(
            f"{given}; that of the built machine {other}: build a new one",
            key="imperfections.bearing",
        )
    for table in ("dampers", "telescopic_dampers"):
        for name, damper in getattr(wanted, table).items():
            built_damper = getattr(built, table)[name]
            law, built_law = (
                wanted.damper_types[damper.type].law,
                built.damper_types[built_damper.type].law,
            )
            if law != built_law:
                raise input_error(
                    f"law '{law}' is not the built machine's '{built_law}'; build a new machine",
                    key=f"{table}.{name}",
                )
            if getattr(damper, "joint", "") != getattr(built_damper, "joint", ""):
                raise input_error(
                    "is not the built machine's; build a new one", key=f"{table}.{name}.joint"
                )
