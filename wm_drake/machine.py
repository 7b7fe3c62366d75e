"""The machine: SDF bodies and force systems as one Drake diagram, and the Contexts in which its numbers are set."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder, Demultiplexer, LogVectorOutput, MatrixGain, Multiplexer, VectorLogSink
from scipy.optimize import root

from wm_drake.bodies import add_bodies, add_load, set_bodies
from wm_drake.errors import InputError, Problem, input_error, nearest_names
from wm_drake.parameters import FrameOverride, Load, MachineParameters, Sensor, packed_stiffness
from wm_drake.parameters.elements import FloatArray
from wm_drake.systems.element import GENERALIZED_FORCE_SIZE
from wm_drake.systems.friction_damper import FrictionDamper, FrictionDamperParameters, packed_damper_law
from wm_drake.systems.six_component_bushing import SixComponentBushing, SixComponentBushingParameters, packed_bushing_law
from wm_drake.systems.speed_source import SpeedSource
from wm_drake.systems.spring_strut import SpringStrut, SpringStrutParameters
from wm_drake.systems.telescopic_damper import TelescopicDamper, TelescopicDamperParameters

OUTPUT_PERIOD = 5e-3
"""Time between samples of a record, as the measurements of [B]. [s]"""

EQUILIBRIUM_TOLERANCE = 1e-9
"""Largest force [N] or moment [N m] that may remain at the rest pose."""

TUBES_TOLERANCE = 1e-6
"""The same on the tubes of a damper: what is left turns them about their axis, by 1e-6 rad/s, where friction alone holds."""

SHORTEST_STRUT = 1e-3
"""Springs and dampers shorter than this when drawn have no direction to speak of. [m]"""

_FARTHEST_REST_POSITION = 0.02
_FARTHEST_REST_ANGLE = np.deg2rad(3.0)


@dataclass(frozen=True)
class Setup:
    """A machine set up in a Context: numbers chosen, preloads solved, at rest at its rest pose.

    Attributes:
        machine: The built machine.
        parameters: The numbers in force.
        context: Root Context of the diagram.
        springs, dampers, bushings, telescopes: The elements in their places, by name.
        sensor_points: By sensor name, the point in T. [m]
        detergent_point: Tub point nearest the detergent box, in T. [m]
        accelerometer_points: By name of the vibration sensor, the point in T. [m]
        rest_pose: Equilibrium of the empty machine: roll, pitch, yaw, x, y, z. [rad, m]
        residual: What remains there of moment about To and force on the tub, in W. [N m, N]
        tube_rest: (telescopic dampers, 7) angles and position of each outer tube and extension of the damper there. [rad, m]
    """

    machine: "Machine"
    parameters: MachineParameters
    context: Context
    springs: dict[str, SpringStrutParameters]
    dampers: dict[str, FrictionDamperParameters]
    bushings: dict[str, SixComponentBushingParameters]
    telescopes: dict[str, TelescopicDamperParameters]
    sensor_points: dict[str, FloatArray]
    detergent_point: FloatArray
    accelerometer_points: dict[str, FloatArray]
    rest_pose: FloatArray
    residual: FloatArray
    tube_rest: FloatArray

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
    source: SpeedSource
    springs: dict[str, SpringStrut]
    dampers: dict[str, FrictionDamper]
    bushings: dict[str, SixComponentBushing]
    telescopes: dict[str, TelescopicDamper]
    logs: dict[str, VectorLogSink]
    blank: Context
    places: "list[_Places]" = field(default_factory=list, repr=False, compare=False)

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
        bushings, placed_dampers = _placed_bushings(places, parameters), _placed_dampers(places, parameters)
        telescopes = _placed_telescopes(self.plant, places, parameters)
        self._set(context, self.bushings, bushings)
        self._set(context, self.dampers, placed_dampers)
        self._set(context, self.telescopes, telescopes)
        springs = self._preloaded_springs(context, parameters)
        self._set(context, self.springs, springs)
        if not gasket and "gasket" in bushings:
            bushings["gasket"] = replace(bushings["gasket"], engaged=0.0)
            self._set(context, self.bushings, bushings)
        if not dampers:
            placed_dampers = {name: replace(damper, engaged=0.0) for name, damper in placed_dampers.items()}
            self._set(context, self.dampers, placed_dampers)
            telescopes = {name: telescope.without_friction() for name, telescope in telescopes.items()}
            self._set(context, self.telescopes, telescopes)
        rest_pose, residual = self._rest_pose(context)
        tube_rest = self.plant.GetPositions(plant_context)[7:].reshape(-1, 7)
        self._hang_in(plant_context, parameters, load)
        self.plant.SetPositions(plant_context, np.concatenate([rest_pose, [0.0], tube_rest.ravel()]))
        points = {name: places("tub", sensor.frame)[0] for name, sensor in parameters.sensors.items()}
        detergent_point = places("tub", parameters.clearance.detergent_frame)[0]
        vibrations = {name: places("tub", frame)[0] for name, frame in parameters.accelerometer_frames().items()}
        elements = springs, placed_dampers, bushings, telescopes
        rest = rest_pose, residual, tube_rest
        return Setup(self, parameters, context, *elements, points, detergent_point, vibrations, *rest)

    def set_up_bodies(self, load: Load | None, parameters: MachineParameters, context: Context | None = None) -> Context:
        """A Context, fresh or used again, in which bodies, frames and load are set and nothing else; raises as `set_up`."""
        if context is None:
            context = self.diagram.CreateDefaultContext()
        else:
            context.SetTimeStateAndParametersFrom(self.blank)
        plant_context = self.plant.GetMyContextFromRoot(context)
        set_bodies(self.plant, plant_context, parameters)
        self._hang_in(plant_context, parameters, load)
        return context

    def _hang_in(self, plant_context: Context, parameters: MachineParameters, load: Load | None) -> None:
        """The load, and with it what the drum is out of balance by itself; neither in the empty machine."""
        if load is not None:
            add_load(self.plant, plant_context, load)
            add_load(self.plant, plant_context, Load(unbalances=(parameters.imperfections.residual_imbalance,)))

    def _places(self, plant_context: Context, parameters: MachineParameters) -> "_Places":
        """Where frames are; remembered from the last set-up, if that had the same overrides."""
        if not self.places or self.places[0].frames != parameters.frames:
            self.places[:] = [_Places(self.plant, parameters.frames, plant_context)]
        self.places[0].context = plant_context
        return self.places[0]

    def _set(self, context: Context, systems: dict[str, Any], placed: dict[str, Any]) -> None:
        for name, system in systems.items():
            system.set_parameters(system.GetMyContextFromRoot(context), placed[name].packed())

    def handles(self, context: Context) -> list[Any]:
        """Handles of all elements' Contexts; holding them through a run makes it a tenth faster."""
        elements = [*self.springs.values(), *self.dampers.values(), *self.bushings.values(), *self.telescopes.values()]
        return [element.handles(element.GetMyContextFromRoot(context)) for element in elements]

    def tree_states(self) -> list[np.ndarray]:
        """Indices in the plant's state of the 14 numbers of tub and drum, then of each telescopic damper's tubes."""
        q, v = np.arange(7), self.plant.num_positions() + np.arange(7)
        return [np.concatenate([q + 7 * tree, v + 7 * tree]) for tree in range(1 + len(self.telescopes))]

    def elastic_and_gravity_force(self, context: Context) -> FloatArray:
        """Moment about To and force on the tub in W at the Context's pose: all elements and gravity. [N m, N]"""
        return self._generalized_force(context)[:6]

    def _generalized_force(self, context: Context) -> FloatArray:
        plant_context = self.plant.GetMyContextFromRoot(context)
        elements = self.plant.get_applied_generalized_force_input_port().Eval(plant_context)
        return np.asarray(elements + self.plant.CalcGravityGeneralizedForces(plant_context))

    def _balance(self, context: Context, begin: int) -> None:
        """Moves coordinates of the plant from number `begin` on, the drum's apart, to where no force is left on them.

        Newton's method; a tube that may spin freely stays as it is, by least squares.

        Raises:
            InputError: it finds no such place nearby.
        """
        plant_context = self.plant.GetMyContextFromRoot(context)
        chosen = [k for k in range(begin, self.plant.num_positions()) if k != 6]

        def forces(q: FloatArray) -> FloatArray:
            if not np.all(np.abs(q) < 1.0):
                return np.full(len(chosen), np.inf)
            self.plant.SetPositions(plant_context, q)
            return self._generalized_force(context)[chosen]

        q = self.plant.GetPositions(plant_context)
        steps = 1e-6 * np.eye(len(q))[chosen]
        remains = forces(q)
        for number in range(100):
            if not 0.1 * EQUILIBRIUM_TOLERANCE < np.max(np.abs(remains)) < np.inf:
                break
            if number % 10 == 0:  # springs are nearly linear: one stiffness serves for several steps
                stiffness = np.linalg.pinv(np.column_stack([(forces(q + step) - remains) / 1e-6 for step in steps]), rcond=1e-9)
            q[chosen] -= stiffness @ remains
            remains = forces(q)
        if not np.max(np.abs(remains[7 - begin - (begin < 7) :])) <= TUBES_TOLERANCE:
            raise input_error(
                "their bushings cannot hold the tubes near where they are drawn: nothing resists a turn about the damper's "
                "axis, say, of a tube whose centre of mass is beside it",
                key="telescopic_dampers",
            )

    def _preloaded_springs(self, context: Context, parameters: MachineParameters) -> dict[str, SpringStrutParameters]:
        """Springs with the preloads that balance the empty machine when T coincides with W, as well as they can."""
        plant_context = self.plant.GetMyContextFromRoot(context)
        if self.telescopes:
            self._balance(context, begin=7)  # their weight hangs on the tub
        unloaded = _placed_springs(self._places(plant_context, parameters), parameters)
        self._set(context, self.springs, unloaded)
        hooks = np.stack([spring.p_ToA_T for spring in unloaded.values()])
        lines = np.stack([spring.p_WH for spring in unloaded.values()]) - hooks
        pulls = lines / np.linalg.norm(lines, axis=1, keepdims=True)
        wrenches = np.column_stack([np.cross(hooks, pulls), pulls]).T
        solution = np.linalg.lstsq(wrenches, -self.elastic_and_gravity_force(context), rcond=None)[0]
        preloads = dict(zip(unloaded, map(float, solution), strict=True))
        slack = [name for name, preload in preloads.items() if preload <= 0.0 and parameters.gravity > 0.0]
        if slack:
            raise InputError(
                Problem("", f"springs.{name}", f"would be pushed, not pulled, at rest (preload {preloads[name]:.1f} N); "
                        "move its hooks or the centre of mass")
                for name in slack
            )  # fmt: skip
        return {name: replace(spring, preload=preloads[name]) for name, spring in unloaded.items()}

    def _rest_pose(self, context: Context) -> tuple[FloatArray, FloatArray]:
        """Equilibrium of the machine in the Context near T = W, where springs alone may not quite balance it."""
        plant_context = self.plant.GetMyContextFromRoot(context)

        def residual(pose: FloatArray) -> FloatArray:
            if not np.all(np.abs(pose) < 10.0):  # a step of the root solver into nowhere, which Drake would abort on
                return np.full(6, 1e9)
            self.plant.SetPositions(plant_context, np.concatenate([pose, [0.0], tubes]))
            return self.elastic_and_gravity_force(context)

        pose = np.zeros(6)
        if self.telescopes:
            self._balance(context, begin=0)
            pose = self.plant.GetPositions(plant_context)[:6]
        tubes = self.plant.GetPositions(plant_context)[7:]
        remains = residual(pose)
        if not np.all(np.isfinite(remains)):
            raise input_error("forces at rest are not finite numbers; some mass, stiffness or distance is out of all bounds")
        if np.max(np.abs(remains)) > EQUILIBRIUM_TOLERANCE and not self.telescopes:
            pose = np.asarray(root(residual, pose, tol=1e-12).x)
            remains = residual(pose)
        far = np.max(np.abs(pose[:3])) > _FARTHEST_REST_ANGLE or np.max(np.abs(pose[3:])) > _FARTHEST_REST_POSITION
        if not np.max(np.abs(remains)) <= EQUILIBRIUM_TOLERANCE or far:
            self.plant.SetPositions(plant_context, np.zeros(self.plant.num_positions()))
            m_x, m_y, m_z, f_x, f_y, f_z = self.elastic_and_gravity_force(context)
            raise input_error(
                "the springs cannot hold the empty machine near its drawn pose: there remain force "
                f"({f_x:.3g}, {f_y:.3g}, {f_z:.3g}) N and moment ({m_x:.3g}, {m_y:.3g}, {m_z:.3g}) N m; "
                "move hooks or masses so that they balance"
            )
        return pose, remains


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
    context = plant.CreateDefaultContext()
    set_bodies(plant, context, parameters)  # reports unknown names before anything is placed by them
    places = _Places(plant, parameters.frames, context)
    springs = {name: SpringStrut(placed.packed()) for name, placed in _placed_springs(places, parameters).items()}
    dampers = {
        name: FrictionDamper(placed.packed(), int(placed.has_sponge))
        for name, placed in _placed_dampers(places, parameters).items()
    }
    bushings = {name: SixComponentBushing(placed.packed()) for name, placed in _placed_bushings(places, parameters).items()}
    source = builder.AddNamedSystem("speed_source", SpeedSource())
    telescopes = {
        name: TelescopicDamper(placed.packed(), int(placed.has_sponge))
        for name, placed in _placed_telescopes(plant, places, parameters).items()
    }
    elements = {"spring": springs, "damper": dampers, "bushing": bushings}
    labels = [(_label(kind, name), system) for kind, systems in elements.items() for name, system in systems.items()]
    if telescopes:
        _connect_with_tubes(builder, plant, labels, telescopes)
    else:
        _connect(builder, plant, labels)
    builder.Connect(source.get_output_port(), plant.get_actuation_input_port())
    logged = {"bodies": plant.get_state_output_port(), "acceleration": plant.get_generalized_acceleration_output_port()}
    with_state = {name: damper for name, damper in (dampers | telescopes).items() if damper.state_size}
    logged |= {name: damper.GetOutputPort("state") for name, damper in with_state.items()}
    sinks = {name: LogVectorOutput(port, builder, publish_period=OUTPUT_PERIOD) for name, port in logged.items()}
    for name, sink in sinks.items():
        sink.set_name(f"log_{name}")
    diagram = builder.Build()
    diagram.set_name(parameters.name)
    context = diagram.CreateDefaultContext()
    return Machine(parameters, diagram, plant, source, springs, dampers, bushings, telescopes, sinks, context)


def _connect(builder: DiagramBuilder, plant: MultibodyPlant, elements: list[tuple[str, Any]]) -> None:
    """Elements, by name, see the plant's state and add their forces to one sum."""
    total = builder.AddNamedSystem("total_force", Adder(len(elements), GENERALIZED_FORCE_SIZE))
    for index, (label, system) in enumerate(elements):
        builder.AddNamedSystem(label, system)
        builder.Connect(plant.get_state_output_port(), system.GetInputPort("plant_state"))
        builder.Connect(system.GetOutputPort("generalized_force"), total.get_input_port(index))
    builder.Connect(total.get_output_port(), plant.get_applied_generalized_force_input_port())


def _connect_with_tubes(
    builder: DiagramBuilder, plant: MultibodyPlant, elements: list[tuple[str, Any]], telescopes: dict[str, TelescopicDamper]
) -> None:
    """The same where tubes are bodies: elements see their part of the state, tubes get forces of their own."""
    size, count = GENERALIZED_FORCE_SIZE, len(telescopes)
    total = builder.AddNamedSystem("total_force", Adder(len(elements) + count, size))
    all_forces = builder.AddNamedSystem("all_forces", Multiplexer([size] * (1 + count)))
    states = np.eye(plant.num_multibody_states())
    trees = [np.concatenate([7 * k + np.arange(7), plant.num_positions() + 7 * k + np.arange(7)]) for k in range(1 + count)]
    of_tub = builder.AddNamedSystem("state_of_tub", MatrixGain(states[trees[0]]))
    builder.Connect(plant.get_state_output_port(), of_tub.get_input_port())
    for index, (label, system) in enumerate(elements):
        builder.AddNamedSystem(label, system)
        builder.Connect(of_tub.get_output_port(), system.GetInputPort("plant_state"))
        builder.Connect(system.GetOutputPort("generalized_force"), total.get_input_port(index))
    for index, (name, system) in enumerate(telescopes.items()):
        builder.AddNamedSystem(f"damper_{name}", system)
        chosen = np.concatenate([trees[0], trees[1 + index]])
        state = builder.AddNamedSystem(f"state_of_{name}", MatrixGain(states[chosen]))
        split = builder.AddNamedSystem(f"forces_of_{name}", Demultiplexer([size, size]))
        builder.Connect(plant.get_state_output_port(), state.get_input_port())
        builder.Connect(state.get_output_port(), system.GetInputPort("plant_state"))
        builder.Connect(system.GetOutputPort("generalized_force"), split.get_input_port())
        builder.Connect(split.get_output_port(0), total.get_input_port(len(elements) + index))
        builder.Connect(split.get_output_port(1), all_forces.get_input_port(1 + index))
    builder.Connect(total.get_output_port(), all_forces.get_input_port(0))
    builder.Connect(all_forces.get_output_port(), plant.get_applied_generalized_force_input_port())


def _label(kind: str, name: str) -> str:
    return "gasket" if (kind, name) == ("bushing", "gasket") else f"{kind}_{name}"


def _check_same_elements(built: MachineParameters, wanted: MachineParameters) -> None:
    """Refuses numbers for another machine than the built one."""
    for key in ("model", "gravity"):
        if getattr(wanted, key) != getattr(built, key):
            raise input_error(
                f"{getattr(wanted, key)} is not the built machine's {getattr(built, key)}; build a new one", key=key
            )
    for table in ("springs", "dampers", "all_bushings", "telescopic_dampers"):
        names = [set(t() if callable(t := getattr(p, table)) else t) for p in (built, wanted)]
        if names[0] != names[1]:
            other = sorted(names[0] ^ names[1])[0]
            raise input_error(
                f"'{other}' is not in both machines{nearest_names(other, names[0])}; build a new machine",
                key=table.removeprefix("all_"),
            )
    for table in ("dampers", "telescopic_dampers"):
        for name, damper in getattr(wanted, table).items():
            built_damper = getattr(built, table)[name]
            law, built_law = wanted.damper_types[damper.type].law, built.damper_types[built_damper.type].law
            if law != built_law:
                raise input_error(
                    f"law '{law}' is not the built machine's '{built_law}'; build a new machine", key=f"{table}.{name}"
                )
            if getattr(damper, "joint", "") != getattr(built_damper, "joint", ""):
                raise input_error("is not the built machine's; build a new one", key=f"{table}.{name}.joint")


class _Places:
    """Where frames are in a body's frame, under one set of overrides; each is asked of the plant once."""

    def __init__(self, plant: MultibodyPlant, frames: dict[str, FrameOverride], context: Context) -> None:
        self.frames, self.context, self._plant = frames, context, plant
        self._known: dict[tuple[str, str], tuple[FloatArray, FloatArray]] = {}

    def __call__(self, body: str, frame: str) -> tuple[FloatArray, FloatArray]:
        """Origin and rotation of a frame; the Context must have the overrides in it. [m]"""
        if (body, frame) not in self._known:
            carrier = self._plant.GetBodyByName(body).body_frame()
            pose = self._plant.CalcRelativeTransform(self.context, carrier, self._plant.GetFrameByName(frame))
            self._known[body, frame] = np.array(pose.translation()), np.array(pose.rotation().matrix())
        return self._known[body, frame]


def _ends(places: _Places, element: Any) -> tuple[FloatArray, FloatArray]:
    """Tub end in T and housing end in W of an element."""
    return places("tub", element.tub_frame)[0], places("world", element.housing_frame)[0]


def _strut_ends(places: _Places, element: Any, key: str) -> tuple[FloatArray, FloatArray]:
    """Ends of an element that acts along the line between them."""
    tub_end, housing_end = _ends(places, element)
    if not math.dist(tub_end, housing_end) > SHORTEST_STRUT:
        raise input_error(
            f"frames '{element.tub_frame}' and '{element.housing_frame}' are at the same place: it has no line", key=key
        )
    return tub_end, housing_end


def _placed_springs(places: _Places, parameters: MachineParameters) -> dict[str, SpringStrutParameters]:
    """Without preload yet."""
    return {
        name: SpringStrutParameters(
            *_strut_ends(places, spring, f"springs.{name}"),
            0.0,
            packed_stiffness(parameters.spring_types[spring.type].stiffness),
        )
        for name, spring in parameters.springs.items()
    }


def _placed_dampers(places: _Places, parameters: MachineParameters) -> dict[str, FrictionDamperParameters]:
    placed = {}
    for name, damper in parameters.dampers.items():
        kind = parameters.damper_types[damper.type]
        ends = _strut_ends(places, damper, f"dampers.{name}")
        placed[name] = FrictionDamperParameters(*ends, kind.end_bushing, packed_damper_law(kind))
    return placed


def _placed_bushings(places: _Places, parameters: MachineParameters) -> dict[str, SixComponentBushingParameters]:
    placed = {}
    for name, bushing in parameters.all_bushings().items():
        tub_point, housing_point = _ends(places, bushing)
        r_tub = places("tub", bushing.tub_frame)[1]
        r_housing = places("world", bushing.housing_frame)[1]
        placed[name] = SixComponentBushingParameters(tub_point, r_tub, housing_point, r_housing, packed_bushing_law(bushing))
    return placed


def _placed_telescopes(
    plant: MultibodyPlant, places: _Places, parameters: MachineParameters
) -> dict[str, TelescopicDamperParameters]:
    """To be asked for while all joints are at zero."""
    placed = {}
    for name, damper in parameters.telescopic_dampers.items():
        joint = plant.GetJointByName(damper.joint)
        outer = joint.parent_body().name()
        X_OF = joint.frame_on_parent().GetFixedPoseInBodyFrame()
        laws = [packed_bushing_law(parameters.bushing_types[kind]) for kind in (damper.tub_bushing, damper.housing_bushing)]
        ends = [
            (*places("tub", damper.tub_frame), *places(outer, damper.outer_frame)),
            (*places(outer, damper.inner_frame), *places("world", damper.housing_frame)),
        ]
        at_tub, at_housing = (SixComponentBushingParameters(*end, law) for end, law in zip(ends, laws, strict=True))
        axis, law = X_OF.rotation() @ joint.translation_axis(), packed_damper_law(parameters.damper_types[damper.type])
        placed[name] = TelescopicDamperParameters(axis, at_tub, at_housing, law)
    return placed
