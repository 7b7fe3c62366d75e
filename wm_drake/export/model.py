"""The numbers and variables of an exported machine: what its compiled functions work on."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal

import numpy as np

from wm_drake.elements.bushing import AXES
from wm_drake.elements.cabinet import FEET_COUNT
from wm_drake.elements.mount import WRENCH_SIZE
from wm_drake.elements.state_map import DRIVE, PLACES
from wm_drake.engines.compiled.mechanics import BODIES_SIZE
from wm_drake.engines.compiled.packing import DrawnBodies, initial_state, pack
from wm_drake.engines.compiled.step_check import check_step
from wm_drake.errors import input_error
from wm_drake.export.arrangement import drum_parts, entries_of, joined, pair_parts, places_of
from wm_drake.export.kernel import NODE_SIZE, UNBALANCE_SIZE, Constants, Counts, Places, Plan
from wm_drake.export.tunable import Tunable, tunables
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Setup
from wm_drake.model.scene import Scene
from wm_drake.parameters import Drive, MachineParameters, MotorDrive, SpinProfile
from wm_drake.parameters.drive import SpeedController, TorqueLimit, motor_of
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import notice_jumping_friction
from wm_drake.simulation.mounts import mount_names

InputKind = Literal["speed", "torque"]
FEWEST_UNBALANCES = 2
"""Unbalances of an FMU, if the load has fewer: the others have no mass."""
TIME_CONSTANT = 0.01
"""Time constant with which model exchange follows the speed input. [s]"""
HOLD_TIME = 1e-2
"""Sample time of the controller whose place the torque input takes. [s] It has no effect."""
LARGEST_DRUM_TORQUE = 1e4
"""Limit of the torque on the drum of a machine without a motor. [N m]"""


@dataclass(frozen=True)
class FmuVariable:
    """A variable of an FMU.

    Attributes:
        index: Its index in the array of an instance, which is its value reference.
        start: Value before a run; None for one that is computed.
        minimum, maximum: Bounds; None without one.
        nominal: Usual size.
        derivative: Index of the state whose derivative it is; -1 for others.
        causality, variability: As the standard has them.
    """

    name: str
    index: int
    unit: str = ""
    words: str = ""
    start: float | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    derivative: int = -1
    causality: Literal["input", "output", "parameter", "local"] = "local"
    variability: Literal["continuous", "tunable"] = "continuous"


_input = partial(FmuVariable, causality="input")
_output = partial(FmuVariable, causality="output")
_tunable = partial(FmuVariable, causality="parameter", variability="tunable")


@dataclass(frozen=True)
class ExportedModel:
    """A machine, ready to be compiled.

    Attributes:
        plan: What its functions are compiled for.
        numbers: Array of an instance before a run.
        states: Indices of the continuous states in the array.
        step: Largest step of the integrator. [s]
    """

    setup: Setup
    plan: Any
    numbers: FloatArray
    constants: FloatArray
    variables: tuple[FmuVariable, ...] = field(repr=False)
    states: tuple[int, ...]
    step: float
    load: str


def exported_model(
    parameters: MachineParameters,
    load: str,
    *,
    input_kind: InputKind = "speed",
    step: float | None = None,
    gasket: bool = True,
) -> ExportedModel:
    """Return a machine with a load, ready to be compiled.

    Args:
        input_kind: "speed" for a prescribed speed of the drum, "torque" for a drum that turns as a
            torque makes it.
        step: Largest step of the integrator; that of the machine if None. [s]
        gasket: False takes the gasket out.

    Raises:
        InputError: the machine cannot be set up, the compiled engine does not represent it, or the
            step is too long for it.
    """
    notice_jumping_friction(parameters)
    parameters = parameters.model_copy(update={"drive": _drive(parameters, input_kind)})
    machine = build_machine(parameters)
    machine.set_up(load, gasket=gasket)  # an unknown load is an error
    # point masses are inputs; unbalance without mass stays in the packed numbers
    setup = machine.set_up(
        parameters.loads[load].model_copy(update={"unbalances": ()}), gasket=gasket
    )
    step = parameters.step if step is None else step
    if not 0.0 < step <= parameters.step * 4.0:
        raise input_error(
            f"{step:g} s; it must be above 0 and at most {4.0 * parameters.step:g} s", where="step"
        )
    check_step(setup, step)
    tuned = tunables(machine, gasket)
    return _Contents(setup, load, tuned, input_kind).model(step)


def _drive(parameters: MachineParameters, input_kind: InputKind) -> Drive | MotorDrive:
    """Return the drive of the FMU: prescribed, or a motor that holds the torque it is given.

    The demand of a sampled controller is held from sample to sample. The FMU writes its input there
    and takes no sample.
    """
    joint, motor = parameters.drive.joint, motor_of(parameters.drive)
    if input_kind == "speed":
        return Drive(joint=joint)
    idle = SpeedController(proportional_gain=1.0, sample_time=HOLD_TIME)
    if motor:
        return motor.model_copy(update={"controller": idle})
    return MotorDrive(
        kind="motor",
        joint=joint,
        belt_ratio=1.0,
        rotor_inertia=0.0,
        torque_limit=TorqueLimit(torque=LARGEST_DRUM_TORQUE),
        controller=idle,
    )


class _Contents:
    """The parts of an exported model, one after the other."""

    def __init__(
        self, setup: Setup, load: str, tuned: Sequence[Tunable], input_kind: InputKind
    ) -> None:
        self.setup, self.load, self.tuned, self.input_kind = setup, load, tuned, input_kind
        self.packed, self.layout = pack(setup)
        self.states = self.layout.states
        unbalances = list(setup.parameters.loads[load].unbalances)
        self.unbalances = [(u.mass, u.phase, u.y, u.radius) for u in unbalances]
        while len(self.unbalances) < FEWEST_UNBALANCES:
            self.unbalances.append((0.0, 0.0, 0.0, _usual_radius(setup.parameters, load)))
        self.mounts = mount_names(setup.parameters)
        self.pairs, _ = pair_parts(Scene(setup.parameters), setup.rest_pose)
        self.currents = _currents(setup)
        self.count = Counts(
            packed=len(self.packed),
            parameters=len(tuned),
            entries=sum(len(t.rows) for t in tuned),
            unbalances=len(self.unbalances),
            points=len(setup.measured_points),
            mounts=len(self.mounts),
            feet=FEET_COUNT if setup.cabinet else 0,
            pairs=len(self.pairs),
            currents=len(self.currents),
        )

    def model(self, step: float) -> ExportedModel:
        """Return the model."""
        of, constants = joined(Constants, self._constants())
        at = self._places()
        numbers = self._numbers(at)
        plan = Plan(
            at, of, self.count, self.layout.elements, self.layout.gasket, self.input_kind == "speed"
        )
        driven = set(self.states.indices(kinds=[DRIVE]).tolist())
        free = tuple(at.state + k for k in range(self.states.size) if k not in driven)
        return ExportedModel(
            self.setup,
            plan,
            numbers,
            constants,
            tuple(self._variables(at, numbers)),
            free,
            step,
            self.load,
        )

    def _constants(self) -> dict[str, Any]:
        """Return the parts of the constants."""
        setup = self.setup
        bodies = DrawnBodies(setup.machine.plant, setup.plant_context, setup.parameters.drive.joint)
        return {
            "packed": self.packed,
            "start": [t.value for t in self.tuned],
            "entries": entries_of((BODIES_SIZE + t.rows, t.slopes) for t in self.tuned),
            **drum_parts(bodies),
            "points": setup.measured_points,
            "pairs": self.pairs,
            "current": self.currents,
        }

    def _places(self) -> Any:
        """Return the `Places`."""
        count, begins = self.count, self.states.begins
        sizes = {
            "speed": 1,
            "acceleration": 1,
            "torque": 1,
            "time_constant": 1,
            "unbalances": UNBALANCE_SIZE * count.unbalances,
            "parameters": count.parameters,
            "displacements": count.points,
            "accelerations": count.points,
            "drum": 4,
            "current": count.currents,
            "gasket": 6,
            "mounts": 3 * count.mounts,
            "cabinet": 6,
            "feet": 3 * count.feet,
            "gap": 1,
            "own": sum(element.kind.output_size for element in self.setup.elements.others.values()),
            "state": begins.size,
            "rate": begins.size,
            "in_force": 1,
            "turned": 1,
            "packed": count.packed,
            "inputs": max(begins.inputs, 1),
            "stage": begins.size,
            "total": begins.size,
            "nodes": 3 * NODE_SIZE,
            "sample": begins.size + begins.rates,
            "wrenches": WRENCH_SIZE * count.mounts,
        }
        return places_of(Places, sizes, first=1)  # the first number is the time

    def _numbers(self, at: Any) -> FloatArray:
        """Return the numbers of an instance before a run."""
        numbers = np.zeros(at.size)
        standing = SpinProfile(time=(0.0, 1.0), speed=(0.0, 0.0))
        begin = self.setup.parameters.profile.speed[0]
        numbers[at.speed] = begin
        numbers[at.time_constant] = TIME_CONSTANT
        numbers[at.unbalances : at.parameters] = np.ravel(self.unbalances)
        numbers[at.parameters : at.displacements] = [t.value for t in self.tuned]
        numbers[at.state : at.rate] = initial_state(self.setup, standing)
        return numbers

    def _variables(self, at: Any, numbers: FloatArray) -> list[FmuVariable]:
        """Return all variables, in the order of the array."""
        return [
            *self._inputs(at, numbers),
            *self._parameters(at),
            *self._outputs(at),
            *self._states(at, numbers),
        ]

    def _inputs(self, at: Any, numbers: FloatArray) -> list[FmuVariable]:
        if self.input_kind == "speed":
            variables = _speed_inputs(at, float(numbers[at.speed]))
        else:
            at_motor = motor_of(self.setup.parameters.drive)
            where = "the motor's shaft" if at_motor and at_motor.rotor_inertia else "the drum"
            variables = [_input("motor_torque_demand", at.torque, "N*m", f"torque at {where}", 0.0)]
        for k, (mass, phase, y, radius) in enumerate(self.unbalances):
            begin, name = at.unbalances + UNBALANCE_SIZE * k, f"unbalance[{k + 1}]"
            of_mass = "mass of a point mass in the drum"
            around = "its angle from the top, positive as the drum turns"
            along = "its position along the drum axis, to the rear, from mid-depth"
            away = "its distance from the drum axis"
            variables += [
                _input(f"{name}.mass", begin, "kg", of_mass, mass, 0.0, 20.0, nominal=1.0),
                _input(f"{name}.phase", begin + 1, "rad", around, phase),
                _input(f"{name}.y", begin + 2, "m", along, y, nominal=0.1),
                _tunable(f"{name}.radius", begin + 3, "m", away, radius, 0.0, 1.0),
            ]
        return variables

    def _parameters(self, at: Any) -> list[FmuVariable]:
        return [
            _tunable(
                structured(t.key), at.parameters + k, t.unit.si,
                f"{t.key} of the machine file", t.value, t.minimum, t.maximum,
            )
            for k, t in enumerate(self.tuned)
        ]  # fmt: skip

    def _outputs(self, at: Any) -> list[FmuVariable]:
        variables: list[FmuVariable] = []

        def add(names: Sequence[str], begin: int, unit: str, words: str) -> None:
            variables.extend(_output(name, begin + k, unit, words) for k, name in enumerate(names))

        points = [*self.setup.sensors, *(f"detergent_{axis}" for axis in AXES)]
        add(
            [f"displacement.{name}" for name in points],
            at.displacements,
            "m",
            "displacement from rest at a sensor, or of the point nearest the detergent box",
        )
        add(
            [f"acceleration.{name}" for name in points],
            at.accelerations,
            "m/s^2",
            "acceleration there, along the same axis, without gravity",
        )
        add(["drum_angle"], at.drum, "rad", "angle of the drum against the tub")
        add(["drum_rate"], at.drum + 1, "rad/s", "speed of the drum against the tub")
        add(["drum_rate_of_change"], at.drum + 2, "rad/s^2", "acceleration of the drum")
        add(["drum_torque"], at.drum + 3, "N*m", "torque of the motor on the drum")
        if self.count.currents:
            add(
                ["drive_current"],
                at.current,
                "A",
                "current of the motor, with the sign of its torque",
            )
        if self.layout.gasket >= 0:
            words = "of the gasket on the housing"
            add([f"gasket_force.{a}" for a in AXES], at.gasket, "N", f"force {words}")
            add([f"gasket_moment.{a}" for a in AXES], at.gasket + 3, "N*m", f"moment {words}")
        mounts = [f"mount_force.{structured(m)}.{axis}" for m in self.mounts for axis in AXES]
        add(mounts, at.mounts, "N", "force of a mount on the cabinet")
        words = "of all mounts on the cabinet, without its weight"
        add([f"cabinet_force.{a}" for a in AXES], at.cabinet, "N", f"force {words}")
        add([f"cabinet_moment.{a}" for a in AXES], at.cabinet + 3, "N*m", f"moment {words}")
        if self.setup.parameters.cabinet and self.setup.cabinet:
            feet = [
                f"floor_force.{c}.{a}" for c in self.setup.parameters.cabinet.corners for a in AXES
            ]
            add(feet, at.feet, "N", "force of the floor on a foot, in W")
        if self.count.pairs:
            add(["gap"], at.gap, "m", "smallest distance of tub group and housing (lower bound)")
        first = at.own
        for label, element in self.setup.elements.others.items():
            for output in element.kind.outputs:
                name = structured(f"elements.{label}.{output.name}")
                several = [f"{name}[{k}]" for k in range(1, output.size + 1)]
                unit = output.unit.replace(" ", "*")
                add(several if output.size > 1 else [name], first, unit, output.words)
                first += output.size
        return variables

    def _states(self, at: Any, numbers: FloatArray) -> list[FmuVariable]:
        variables: list[FmuVariable] = []
        driven = set(self.states.indices(kinds=[DRIVE]).tolist())
        roles = self.states.kinds()
        words = self.states.words()
        free = [k for k in range(self.states.size) if k not in driven]
        for number, k in enumerate(free, start=1):
            name, about = f"state[{number}]", f"{roles[k][1]} of {words[k]}"
            place, rate = at.state + k, at.rate + k
            start = float(numbers[place])
            nominal = 1.0 if roles[k][1] not in PLACES else 0.1
            variables += [
                FmuVariable(name, place, words=about, start=start, nominal=nominal),
                FmuVariable(f"der({name})", rate, words=f"rate: {about}", derivative=place),
            ]
        return variables


def _speed_inputs(at: Any, speed: float) -> list[FmuVariable]:
    """Return the inputs of a machine whose drum follows a speed."""
    of_speed = "speed of the drum against the tub"
    of_rate = (
        "rate of drum_speed; 0 if it is not known: the drum then follows drum_speed a step later"
    )
    of_time = "model exchange: time constant with which the drum follows drum_speed"
    return [
        _input("drum_speed", at.speed, "rad/s", of_speed, speed, nominal=40.0),
        _input("drum_acceleration", at.acceleration, "rad/s^2", of_rate, 0.0),
        _tunable("drum_time_constant", at.time_constant, "s", of_time, TIME_CONSTANT, 1e-4, 1.0),
    ]


def _currents(setup: Setup) -> list[float]:
    """Return the current per torque on the drum, one number; none if it is not known. [A/(N m)]"""
    factor = setup.motor.current_per_drum_torque if setup.motor else None
    return [] if factor is None else [factor]


def _usual_radius(parameters: MachineParameters, load: str) -> float:
    """Return the radius of the first point mass of a load, else of any load, else zero. [m]"""
    loads = [parameters.loads[load], *parameters.loads.values()]
    return next((u.radius for one in loads for u in one.unbalances), 0.0)


def structured(key: str) -> str:
    """Return a key path as a name of the standard: names that are no identifiers are quoted."""
    return ".".join(
        part if part.isidentifier() and part.isascii() else f"'{part}'" for part in key.split(".")
    )
