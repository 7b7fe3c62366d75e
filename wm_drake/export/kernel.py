"""Compiled functions of an FMU: rates and outputs of one machine, and steps of its integrator.

All numbers of an instance are in one array v of floats: what an importer sets and reads, then the
state, then arrays to work in (`Places`). What no importer changes is in a second array c
(`Constants`). The functions have no other memory, so that an FMU may have many instances. The laws
and the Runge-Kutta step are those of the compiled engine, compiled for single floats.
"""

import json
from collections import namedtuple
from typing import Any

import numpy as np
from numba import carray, cfunc, njit, types
from numba.extending import intrinsic

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.kept import kept
from wm_drake.compiler.lanes import NUMBER_ARRAY, TextCompiler
from wm_drake.compiler.vectors import add, cross, dot, rotate, rotate_back
from wm_drake.elements.cabinet import FEET_COUNT, foot_of
from wm_drake.elements.motion import BODY_STATE, TREE_STATE, motion_at, tub_motion
from wm_drake.elements.motor import motor_response, read_motor_state
from wm_drake.elements.mount import WRENCH_SIZE, torque_on_drum, write_mount_wrenches
from wm_drake.elements.rubber import bushing_wrench
from wm_drake.elements.sensor import POINT_SIZE, displacement_at, read_measured_point
from wm_drake.engines.compiled.bearing import carrier_motion
from wm_drake.engines.compiled.cabinet import FEET_BEGIN, SLIPS_BEGIN
from wm_drake.engines.compiled.integration import runge_kutta_step
from wm_drake.engines.compiled.mechanics import (
    BODIES,
    DRUM_ANGLE,
    DRUM_RATE,
    mass_properties,
    motor_torque,
    read_rates,
    state_derivative,
    write_sample,
)
from wm_drake.model.outline import lowest_point
from wm_drake.simulation.histories import write_outputs_of_others

HARMONICS_BEGIN, HARMONICS_END = BODIES.offsets["drum_moment_x"], BODIES.offsets["joint_damping"]
HARMONICS_SIZE = HARMONICS_END - HARMONICS_BEGIN
"""Part of the packed bodies that the unbalance changes."""
INVERSE_MASS = BODIES.offsets["inverse_mass"]
UNBALANCE_SIZE = 4
"""Numbers of an unbalance: mass, phase, y, radius. [kg, rad, m, m]"""
NODE_SIZE = 4
"""Motion of a prescribed drum at a node of a step: speed, cosine and sine of the angle, angle."""
SHAPE_SIZE = 15
PAIR_SIZE = 2 * SHAPE_SIZE + 5
"""Numbers of a pair of shapes: the two outlines, whether each is round, a unit vector."""
TREE_RATES = TREE_STATE.offsets["angular_velocity"]
BODY_RATES = BODY_STATE.offsets["angular_velocity"]
"""Where the accelerations of a body are in the derivative of its state."""
LARGEST_ANGLE = 2000.0 * np.pi
"""Angle of the drum beyond which it is taken off the state: 1000 turns. [rad]"""

Places = namedtuple(
    "Places",
    "speed acceleration torque time_constant unbalances parameters displacements "
    "accelerations drum current gasket mounts cabinet feet gap own state rate in_force turned "
    "packed inputs stage total nodes sample wrenches size",
)
"""Indices in the array of an instance.

speed, acceleration: inputs of a prescribed drum [rad/s, rad/s^2]; torque: input of a free drum
[N m]; time_constant: with which model exchange follows the speed [s]; unbalances: `UNBALANCE_SIZE`
each; parameters: numbers of the machine file; displacements, accelerations: of the sensors [m,
m/s^2]; drum: angle, speed, acceleration and torque [rad, rad/s, rad/s^2, N m]; current: of the
motor [A]; gasket: force and
moment on the housing [N, N m]; mounts: force of each on the cabinet; cabinet: force and moment of
all; feet: force of the floor on each [N]; gap: smallest distance [m]; own:
outputs of elements of other packages; state, rate: state of the
engine and its derivative; in_force: acceleration of a prescribed drum [rad/s^2]; turned: angle
taken off the drum's [rad]; the others are packed numbers and arrays to work in; size: of the array.
"""
Constants = namedtuple("Constants", "packed start entries harmonics drum points pairs current size")
"""Indices in the array of constants.

packed: packed numbers without unbalance; start: values of the parameters that belong to them;
entries: (row, parameter, slope) of each packed number that depends on a parameter;
harmonics: matrix of the drum's harmonics; drum: rotation of D in T by rows, then O from Do in T
[m]; points: measured points; pairs: shapes for the gap; current: per torque on the drum [A/(N m)].
"""
Counts = namedtuple(
    "Counts", "packed parameters entries unbalances points mounts feet pairs currents"
)
"""How many of each there are."""
Plan = namedtuple("Plan", ("at", "of", "count", "elements", "gasket", "follows_speed"))
"""What the functions are compiled for: `Places`, `Constants`, `Counts`, `Elements` of the engine,
index of the gasket in the packed numbers (-1 without one), whether the speed is prescribed."""

POINTER = types.CPointer(types.float64)
OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract", "nsz"},
    "pipeline_class": TextCompiler,
}
"""Options of numba for a function that is a part of others, or that other programs run."""


def _emit_address(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.gep(args[0], [args[1]])


@intrinsic
def numbers_at(typing_context, pointer, index):
    """Return the numbers behind a pointer from an index on, as laws read them."""
    return NUMBER_ARRAY(pointer, types.intp), _emit_address


@intrinsic
def pointer_at(typing_context, pointer, index):
    """Return the pointer to a number behind a pointer."""
    return POINTER(pointer, types.intp), _emit_address


@njit(**OPTIONS)
def part(v, begin, count):
    """Return some of the numbers behind a pointer as an array."""
    return carray(pointer_at(v, begin), (count,))


@law
def add_point_mass(p, mass, q, c, frame):
    """Add a point mass to sums: mass, first moment and inertia about O, in T.

    Args:
        p: Sums (10,), changed. [kg, kg m, kg m^2]
        mass, q: The mass and its position in the frame of its body. [kg, m]
        c, frame: Constants, and index of rotation and position of that frame, as
            `Constants.drum`.
    """
    x = c[frame] * q[0] + c[frame + 1] * q[1] + c[frame + 2] * q[2] - c[frame + 9]
    y = c[frame + 3] * q[0] + c[frame + 4] * q[1] + c[frame + 5] * q[2] - c[frame + 10]
    z = c[frame + 6] * q[0] + c[frame + 7] * q[1] + c[frame + 8] * q[2] - c[frame + 11]
    p[0] = p[0] + mass
    p[1], p[2], p[3] = p[1] + mass * x, p[2] + mass * y, p[3] + mass * z
    p[4] = p[4] + mass * (y * y + z * z)
    p[5] = p[5] + mass * (x * x + z * z)
    p[6] = p[6] + mass * (x * x + y * y)
    p[7], p[8], p[9] = p[7] - mass * x * y, p[8] - mass * x * z, p[9] - mass * y * z


@law
def acceleration_of_point(motion, rates, points, at):
    """Return the acceleration of a measured point along its direction, without gravity. [m/s^2]

        a_Q = a_To + alpha x r + w x (w x r),   r = R p_Q

    Args:
        motion: `TubMotion`.
        rates: `RATES` of the tub by name.
        points, at: As for `displacement_at`.
    """
    point = read_measured_point(points, at)
    r, w = rotate(motion.rotation, point.p_ToM_T), motion.angular_velocity
    turning = add(cross(rates.angular_acceleration, r), cross(w, cross(w, r)))
    return dot(point.direction_W, add(rates.acceleration, turning))


def kernel_code(plan: Any) -> dict[str, str]:
    """Return LLVM's text of the functions of `kernel`, from the files of compiled code if kept."""

    def compiled() -> bytes:
        code = {symbol: function.inspect_llvm() for symbol, function in kernel(plan).items()}
        return json.dumps(code).encode()

    return dict(json.loads(kept(f"fmu {plan!r}", compiled)))


def kernel(plan: Any) -> dict[str, Any]:
    """Return the compiled functions of a machine, by the name of their symbol.

    `wm_evaluate` (v, c, mode) writes rates and outputs; mode 1: the acceleration of a prescribed
    drum is that of model exchange, 0: the one in force. `wm_step` (v, c, h, n) takes n steps of
    length h.
    """
    at, follows_speed = plan.at, plan.follows_speed
    prepare, set_drive, write_outputs = _preparation(plan), _drive(plan), _outputs(plan)
    write_rate = _rate(plan)
    step = _step(plan, write_rate)

    @cfunc(types.void(POINTER, POINTER, types.int64), **OPTIONS)
    def wm_evaluate(v, c, mode):
        prepare(v, c)
        if mode == 1 or not follows_speed:
            set_drive(v, numbers_at(v, at.time_constant)[0])
        write_rate(v)
        write_outputs(v, c)

    @cfunc(types.void(POINTER, POINTER, types.float64, types.int64), **OPTIONS)
    def wm_step(v, c, h, n):
        prepare(v, c)
        set_drive(v, h * n)
        for _ in range(n):
            step(v, h)

    return {"wm_evaluate": wm_evaluate, "wm_step": wm_step}


def _preparation(plan: Any) -> Any:
    """Return the function (v, c) that packs the numbers, with the parameters and the unbalance."""
    write_rows, add_load = row_writer(plan), load_adder(plan)

    @njit(**OPTIONS)
    def prepare(v, c):
        write_rows(v, c)
        add_load(v, c)

    return prepare


def row_writer(plan: Any) -> Any:
    """Return the function (v, c) that packs the numbers with the parameters, without unbalance."""
    at, of, count = plan.at, plan.of, plan.count

    @njit(**OPTIONS)
    def write_rows(v, c):
        numbers, constants, p = numbers_at(v, 0), numbers_at(c, 0), numbers_at(v, at.packed)
        for k in range(count.packed):
            p[k] = constants[of.packed + k]
        for k in range(count.entries):
            entry = of.entries + 3 * k
            row, parameter = int(constants[entry]), int(constants[entry + 1])
            change = numbers[at.parameters + parameter] - constants[of.start + parameter]
            p[row] = p[row] + constants[entry + 2] * change

    return write_rows


def load_adder(plan: Any) -> Any:
    """Return the function (v, c) that adds the unbalance to the packed numbers."""
    at, of, count = plan.at, plan.of, plan.count
    add_to_drum = drum_adder(plan)

    @njit(**OPTIONS)
    def add_load(v, c):
        numbers, constants, sums = numbers_at(v, 0), numbers_at(c, 0), numbers_at(v, at.total)
        for k in range(10):
            sums[k] = 0.0
        for k in range(count.unbalances):
            begin = at.unbalances + UNBALANCE_SIZE * k
            sine, cosine = sine_cosine(numbers[begin + 1])
            y, radius = numbers[begin + 2], numbers[begin + 3]
            place = (radius * sine, y, radius * cosine)
            add_point_mass(sums, numbers[begin], place, constants, of.drum)
        add_to_drum(v, c)

    return add_load


def drum_adder(plan: Any) -> Any:
    """Return the function (v, c) that adds the sums of masses at `at.total` to the packed drum."""
    at, of = plan.at, plan.of

    @njit(**OPTIONS)
    def add_to_drum(v, c):
        constants, sums, p = numbers_at(c, 0), numbers_at(v, at.total), numbers_at(v, at.packed)
        p[INVERSE_MASS] = p[INVERSE_MASS] / (1.0 + sums[0] * p[INVERSE_MASS])
        for k in range(HARMONICS_SIZE):
            value = p[HARMONICS_BEGIN + k]
            for i in range(9):
                value += constants[of.harmonics + 9 * k + i] * sums[1 + i]
            p[HARMONICS_BEGIN + k] = value

    return add_to_drum


def _rate(plan: Any) -> Any:
    """Return the function (v) that writes the time derivative of the state."""
    at, elements = plan.at, plan.elements

    @njit(**OPTIONS)
    def write_rate(v):
        p, x = numbers_at(v, at.packed), numbers_at(v, at.state)
        sine, cosine = sine_cosine(x[DRUM_ANGLE])
        masses = mass_properties(p, cosine, sine)
        state_derivative(
            x,
            numbers_at(v, at.rate),
            numbers_at(v, at.inputs),
            masses,
            x[DRUM_RATE],
            numbers_at(v, at.in_force)[0],
            p,
            elements,
        )

    return write_rate


def _drive(plan: Any) -> Any:
    """Return the function (v, time_constant) that sets what turns the drum from the inputs."""
    at, follows_speed, begins = plan.at, plan.follows_speed, plan.elements.begins

    @njit(**OPTIONS)
    def set_drive(v, time_constant):
        numbers, x = numbers_at(v, 0), numbers_at(v, at.state)
        if follows_speed:
            lag = (numbers[at.speed] - x[DRUM_RATE]) / time_constant
            numbers[at.in_force] = numbers[at.acceleration] + lag
        else:
            x[begins.motor + 1] = numbers[at.torque]

    return set_drive


def _step(plan: Any, write_rate: Any) -> Any:
    """Return the function (v, h) that takes a step of length h."""
    at, follows_speed, elements = plan.at, plan.follows_speed, plan.elements

    @njit(**OPTIONS)
    def write_node(v, k, speed, angle):
        numbers = numbers_at(v, at.nodes + NODE_SIZE * k)
        numbers[0], numbers[1], numbers[2] = speed, np.cos(angle), np.sin(angle)
        numbers[3] = angle

    @njit(**OPTIONS)
    def step(v, h):
        numbers, p = numbers_at(v, 0), numbers_at(v, at.packed)
        x, rate = numbers_at(v, at.state), numbers_at(v, at.rate)
        inputs = numbers_at(v, at.inputs)
        write_rate(v)
        a, speed, angle = numbers[at.in_force], x[DRUM_RATE], x[DRUM_ANGLE]
        if follows_speed:
            for k in range(3):
                t = 0.5 * k * h
                write_node(v, k, speed + a * t, angle + (speed + 0.5 * a * t) * t)
        nodes = carray(pointer_at(v, at.nodes), (3, NODE_SIZE))
        stage, total = numbers_at(v, at.stage), numbers_at(v, at.total)
        runge_kutta_step(x, rate, inputs, stage, total, nodes, 0, h, a, p, elements)
        if follows_speed:
            x[DRUM_RATE], x[DRUM_ANGLE] = nodes[2, 0], nodes[2, 3]
        if abs(x[DRUM_ANGLE]) > LARGEST_ANGLE:
            turned = LARGEST_ANGLE if x[DRUM_ANGLE] > 0.0 else -LARGEST_ANGLE
            x[DRUM_ANGLE] = x[DRUM_ANGLE] - turned
            numbers[at.turned] = numbers[at.turned] + turned

    return step


def _outputs(plan: Any) -> Any:
    """Return the function (v, c) that writes the outputs."""
    at, of, count, elements, gasket, _ = plan
    cabinet, size = elements.cabinet, elements.begins.size
    write_floor, write_drum = _floor(plan), _drum(plan)
    smallest_gap = _gap(plan)

    @njit(**OPTIONS)
    def write_outputs(v, c):
        numbers, constants = numbers_at(v, 0), numbers_at(c, 0)
        p, x, rate = numbers_at(v, at.packed), numbers_at(v, at.state), numbers_at(v, at.rate)
        sample = numbers_at(v, at.sample)
        write_sample(sample, 0, x, rate, elements)
        motion, rates = tub_motion(sample), read_rates(sample, size)
        for k in range(count.points):
            point = of.points + POINT_SIZE * k
            numbers[at.displacements + k] = displacement_at(motion, constants, point)
            numbers[at.accelerations + k] = acceleration_of_point(motion, rates, constants, point)
        if gasket >= 0:
            branches = elements.mounts.branches
            _, on_housing = bushing_wrench(motion, p, gasket, sample, branches)
            for k in range(6):
                numbers[at.gasket + k] = on_housing[k]
        wrenches = numbers_at(v, at.wrenches)
        write_mount_wrenches(sample, p, elements.mounts, wrenches)
        for k in range(6):
            numbers[at.cabinet + k] = 0.0
        for i in range(count.mounts):
            for k in range(3):
                force, moment = wrenches[WRENCH_SIZE * i + 3 + k], wrenches[WRENCH_SIZE * i + k]
                numbers[at.mounts + 3 * i + k] = force
                numbers[at.cabinet + k] = numbers[at.cabinet + k] + force
                numbers[at.cabinet + 3 + k] = numbers[at.cabinet + 3 + k] + moment
        write_floor(numbers, x, p, cabinet)
        write_drum(numbers, x, rate, p)
        write_outputs_of_others(x, motion, p, elements.mounts.others, numbers, at.own)
        if count.currents:
            numbers[at.current] = constants[of.current] * numbers[at.drum + 3]
        if count.pairs:
            numbers[at.gap] = smallest_gap(motion, constants)

    return write_outputs


def _floor(plan: Any) -> Any:
    """Return the function (numbers, x, p, cabinet) that writes the forces of the floor."""
    at, begins = plan.at, plan.elements.begins

    @njit(**OPTIONS)
    def write_floor(numbers, x, p, cabinet):
        if cabinet is not None:
            standing, _ = carrier_motion(x, begins.cabinet)
            for i in range(FEET_COUNT):
                first = begins.cabinet + SLIPS_BEGIN
                foot = foot_of(x, first, standing, p, cabinet + FEET_BEGIN, i)
                for k in range(3):
                    numbers[at.feet + 3 * i + k] = foot.force[k]

    return write_floor


def _drum(plan: Any) -> Any:
    """Return the function (numbers, x, rate, p) that writes motion and torque of the drum."""
    at, elements = plan.at, plan.elements
    begins, motor, bearing = elements.begins, elements.motor, elements.bearing

    @njit(**OPTIONS)
    def write_drum(numbers, x, rate, p):
        numbers[at.drum] = x[DRUM_ANGLE] + numbers[at.turned]
        numbers[at.drum + 1] = x[DRUM_RATE]
        numbers[at.drum + 2] = rate[DRUM_RATE]
        numbers[at.drum + 3] = drum_torque(x, rate, p, motor, bearing)

    @njit(**OPTIONS)
    def drum_torque(x, rate, p, motor, bearing):
        if motor is not None:
            state = read_motor_state(x, begins.motor)
            return motor_response(state, x[DRUM_RATE], x[DRUM_RATE], p, motor)[0]
        sine, cosine = sine_cosine(x[DRUM_ANGLE])
        masses = mass_properties(p, cosine, sine)
        motion, rates = turning_body(x, rate, bearing)
        turning = rates.angular_acceleration, rates.acceleration
        needed = motor_torque(motion, *turning, masses, x[DRUM_RATE], rate[DRUM_RATE], p)
        return needed - torque_on_drum(x, motion, p, elements.mounts.others)

    @njit(**OPTIONS)
    def turning_body(x, rate, bearing):
        if bearing is None:
            return motion_at(x, 0), read_rates(rate, TREE_RATES)
        motion, _ = carrier_motion(x, begins.carrier)
        return motion, read_rates(rate, begins.carrier + BODY_RATES)

    return write_drum


def _gap(plan: Any) -> Any:
    """Return the function (motion, c) that returns the smallest gap between tub and housing."""
    of, count = plan.of, plan.count

    @njit(**OPTIONS)
    def smallest_gap(motion, c):
        smallest = np.inf
        for i in range(count.pairs):
            pair = of.pairs + PAIR_SIZE * i
            d = (c[pair + PAIR_SIZE - 3], c[pair + PAIR_SIZE - 2], c[pair + PAIR_SIZE - 1])
            moving, fixed = numbers_at(c, pair), numbers_at(c, pair + SHAPE_SIZE)
            are_round = pair + 2 * SHAPE_SIZE
            bound = lowest_point(rotate_back(motion.rotation, d), moving, c[are_round] > 0.5)
            bound += lowest_point((-d[0], -d[1], -d[2]), fixed, c[are_round + 1] > 0.5)
            smallest = min(smallest, bound + dot(motion.position, d))
        return smallest

    return smallest_gap
