"""Time derivatives of the state at many states of a machine, and their slopes, in one pass.

Linearisation and harmonic balance stand on these: they evaluate the same compiled right-hand side
that runs integrate, so that no law is written twice. A slope is a difference quotient. Eight moved
states are evaluated side by side.
"""

import numpy as np

from wm_drake.compiler.chosen import call
from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import in_each_lane, sine_cosine
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.elements.friction_damper import (
    friction_damper_line,
    friction_damper_tension,
    friction_damper_wrench,
)
from wm_drake.elements.motion import motion_at, read_tree_state, tub_motion
from wm_drake.elements.rubber import bushing_wrench
from wm_drake.elements.spring import spring_strut_wrench
from wm_drake.elements.state_map import SLIP, VELOCITIES
from wm_drake.elements.telescopic_damper import (
    TUBES_STATE_SIZE,
    read_tubes_state,
    telescopic_damper_forces,
)
from wm_drake.engines.compiled.mechanics import (
    DRUM_ANGLE,
    DRUM_RATE,
    mass_properties,
    state_derivative,
)
from wm_drake.engines.compiled.packing import initial_state, pack
from wm_drake.model.machine import Setup, with_prescribed_speed
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray

POSITION_STEP, VELOCITY_STEP = 2.0**-28, 2.0**-23
"""Steps of the differences, about 4e-9 and 1e-7. [m or rad, m/s or rad/s]

Tables bend at their points, where the error grows with the step of a position, while rounding grows
the other way: at this step both are about 1e-7 of a slope. The step of a velocity is a tenth of the
regularisation velocity of the papers' friction, so that the slope at rest is that of a friction
damper that sticks."""


class SlopedDerivative:
    """The time derivative of the state of a machine as it is set up, and its slopes.

    The order of a state is that of `layout.states`. Free are all its numbers but
    angle and rate of the drum, which are prescribed, also in a machine with a motor, and the slips
    of the feet of a cabinet that moves: the feet stick.

    Attributes:
        layout: Indices of the parts of the machine in packed numbers and states.
        packed: Packed numbers of the machine.
        rest: State of rest, with a drum that stands still.
        free: Indices of the free numbers.
        is_velocity: Whether a free number is a velocity. (free,)
    """

    def __init__(self, setup: Setup) -> None:
        """Pack a machine.

        Raises:
            InputError: the machine has something that the compiled engine does not represent.
        """
        setup = with_prescribed_speed(setup)
        self.packed, self.layout = pack(setup)
        self.rest = initial_state(setup, SpinProfile(time=(0.0, 1.0), speed=(0.0, 0.0)))
        every, slips = np.arange(len(self.rest)), self.layout.states.indices(SLIP)
        self.free = np.setdiff1d(every, (DRUM_ANGLE, DRUM_RATE, *slips))
        velocities = np.isin(every, self.layout.states.indices(*VELOCITIES))
        self.is_velocity = velocities[self.free]
        self._steps = np.where(velocities, VELOCITY_STEP, POSITION_STEP)
        self._steps[DRUM_RATE] = POSITION_STEP

    def __call__(self, states: FloatArray) -> FloatArray:
        """Return the time derivatives (n, size) at states (n, size)."""
        return self._evaluate(states, np.zeros(0, dtype=np.int64), np.zeros(0))[0]

    def with_slopes(
        self, states: FloatArray, *, drum_rate: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Return the time derivatives of the free numbers, and their slopes by forward differences.

        Args:
            states: (n, size), the drum's angle and rate among them.
            drum_rate: Whether the last slope is that by the drum's rate.

        Returns:
            (n, free), and (n, k, free) with the slope by each free number k.
        """
        columns = np.append(self.free, DRUM_RATE) if drum_rate else self.free
        steps = self._steps[columns]
        rates, moved = self._evaluate(states, columns, steps)
        moved -= rates[:, None, :]
        moved /= steps[:, None]
        return rates[:, self.free], moved[:, :, self.free]

    def jacobian(self, states: FloatArray) -> FloatArray:
        """Return the Jacobian of the free numbers by central differences. (n, free, free)"""
        steps = self._steps[self.free]
        columns, both = np.tile(self.free, 2), np.concatenate([steps, -steps])
        moved = self._evaluate(states, columns, both)[1][:, :, self.free]
        half = len(self.free)
        slopes = (moved[:, :half] - moved[:, half:]) / (2.0 * steps[:, None])
        return np.ascontiguousarray(slopes.transpose(0, 2, 1))

    def wrench_slopes(self, state: FloatArray) -> FloatArray:
        """Return the slopes of the wrench of each element on the tub at a state.

        The elements are springs, strut dampers, bushings and telescopic dampers, in this order.

        Returns:
            (elements, 6, free) moment about To and force, in W, by each free number. [N m, N]
        """
        mounts = self.layout.mounts
        count = len(mounts.springs) + len(mounts.dampers) + len(mounts.bushings)
        count += 0 if mounts.telescopes is None else len(mounts.telescopes)
        count += len(self.layout.kinds)
        steps = self._steps[self.free]
        columns, both = np.tile(self.free, 2), np.concatenate([steps, -steps])
        idle = -len(columns) % WIDTH
        columns, both = np.pad(columns, (0, idle)), np.pad(both, (0, idle))
        wrenches = np.empty((len(columns), count, 6))
        states = np.tile(state, (len(columns), 1))
        tub_wrenches_at(states, columns, both, self.packed, mounts, wrenches)
        half = len(self.free)
        slopes = (wrenches[:half] - wrenches[half : 2 * half]) / (2.0 * steps[:, None, None])
        return np.ascontiguousarray(slopes.transpose(1, 2, 0))

    def _evaluate(
        self, states: FloatArray, columns: FloatArray, steps: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        states = np.ascontiguousarray(states)
        rates = np.empty_like(states)
        moved = np.empty((len(states), len(columns), states.shape[1]))
        derivatives_at(states, columns, steps, self.packed, self.layout.elements, rates, moved)
        return rates, moved


@long_running
def derivatives_at(states, columns, steps, p, elements, rates, moved):
    """Evaluate the time derivative at states, and at each of them moved in each of some numbers.

    Args:
        states: (n, size); angle and rate of the drum are read from them.
        columns, steps: Index and size of each move. (k,)
        p: Packed numbers.
        elements: `Elements`.
        rates: Time derivatives at the states, written. (n, size)
        moved: Time derivatives at the moved states, written. (n, k, size)
    """
    align_stack()
    count, size, moves = len(states), states.shape[1], len(columns)
    x_numbers, dx_numbers = np.empty(size * WIDTH), np.empty(size * WIDTH)
    p_numbers = in_each_lane(p)
    x, dx, numbers = lane_array(x_numbers), lane_array(dx_numbers), lane_array(p_numbers)
    inputs_numbers = np.empty(max(elements.begins.inputs, 1) * WIDTH)
    inputs = lane_array(inputs_numbers)
    total = count * (moves + 1)
    for begin in range(0, total, WIDTH):
        for lane in range(WIDTH):
            at = min(begin + lane, total - 1)
            row, move = at // (moves + 1), at % (moves + 1)
            for k in range(size):
                x_numbers[k * WIDTH + lane] = states[row, k]
            if move > 0:
                x_numbers[columns[move - 1] * WIDTH + lane] += steps[move - 1]
        sine, cosine = sine_cosine(x[DRUM_ANGLE])
        masses = mass_properties(numbers, cosine, sine)
        state_derivative(x, dx, inputs, masses, x[DRUM_RATE], 0.0 * x[0], numbers, elements)
        for lane in range(min(WIDTH, total - begin)):
            at = begin + lane
            row, move = at // (moves + 1), at % (moves + 1)
            if move == 0:
                for k in range(size):
                    rates[row, k] = dx_numbers[k * WIDTH + lane]
            else:
                for k in range(size):
                    moved[row, move - 1, k] = dx_numbers[k * WIDTH + lane]
    keep(p_numbers)
    keep(inputs_numbers)


@long_running
def tub_wrenches_at(states, columns, steps, p, mounts, wrenches):
    """Evaluate the wrench of each element on the tub, at states that are moved in one number each.

    The elements are springs, strut dampers, bushings, telescopic dampers and others, in this order.

    Args:
        states: (n, size), n a multiple of `WIDTH`.
        columns, steps: Index and size of the move of each state. (n,)
        p: Packed numbers.
        mounts: `Mounts`.
        wrenches: Moment about To and force on the tub, in W, written. (n, elements, 6) [N m, N]
    """
    align_stack()
    size = states.shape[1]
    x_numbers, p_numbers, out = (
        np.empty(size * WIDTH),
        in_each_lane(p),
        np.empty(6 * wrenches.shape[1] * WIDTH),
    )
    x, numbers, answer = lane_array(x_numbers), lane_array(p_numbers), lane_array(out)
    for begin in range(0, len(states), WIDTH):
        for lane in range(WIDTH):
            for k in range(size):
                x_numbers[k * WIDTH + lane] = states[begin + lane, k]
            x_numbers[columns[begin + lane] * WIDTH + lane] += steps[begin + lane]
        motion = tub_motion(x)
        at_row = 0
        for at in mounts.springs:
            wrench, _ = spring_strut_wrench(motion, numbers, at)
            write_six(answer, at_row, wrench)
            at_row += 6
        for i in range(len(mounts.dampers)):
            at = mounts.dampers[i]
            arm, line = friction_damper_line(motion, numbers, at)
            tension, _ = friction_damper_tension(line[1], x[mounts.sponge_states + i], numbers, at)
            write_six(
                answer, at_row, friction_damper_wrench(motion, arm, line, tension, numbers, at)
            )
            at_row += 6
        for at in mounts.bushings:
            wrench, _ = bushing_wrench(motion, numbers, at, x, mounts.branches)
            write_six(answer, at_row, wrench)
            at_row += 6
        _write_telescopes(x, motion, numbers, mounts, mounts.telescopes, answer, at_row)
        at_row = 6 * (wrenches.shape[1] - other_count(mounts.others))
        _write_others(x, motion, numbers, mounts.others, answer, at_row)
        for k in range(6 * wrenches.shape[1]):
            for lane in range(WIDTH):
                wrenches[begin + lane, k // 6, k % 6] = out[k * WIDTH + lane]
    keep(p_numbers)


@law
def _write_telescopes(x, motion, p, mounts, telescopes, answer, at_row):
    """Write the wrench of each telescopic damper on the tub (six numbers, W). [N m, N]

    Args:
        x: State.
        motion: `TubMotion` of the tub.
        p, mounts: Packed numbers, and the `Mounts` in them.
        telescopes: A field of these, None without such dampers: it is an argument of its own so
            that None compiles to nothing.
        answer, at_row: Array that is written, and index of the first number.
    """
    if telescopes is not None:
        for i in range(len(telescopes)):
            damper_state = read_tubes_state(x, mounts.tube_states + TUBES_STATE_SIZE * i)
            state = read_tree_state(*damper_state.tubes)
            on_tub, _, _, _, _, _, _ = telescopic_damper_forces(
                motion,
                motion_at(*damper_state.tubes),
                state.joint_position,
                state.joint_rate,
                damper_state.deformation,
                p,
                telescopes[i],
            )
            write_six(answer, at_row + 6 * i, on_tub)


@law
def other_count(others):
    """Return the number of elements of other packages; `others` is None without any."""
    if others is None:
        return 0
    return len(others.at)


@law
def _write_others(x, motion, p, others, answer, at_row):
    """Write the wrench of each element of another package on the tub (six numbers, W)."""
    if others is not None:
        for i in range(len(others.at)):
            wrench = call(others.wrench, i, x, None, motion, p, others.at[i], others.states[i])
            write_six(answer, at_row + 6 * i, wrench)


@law
def write_six(array, at, six):
    """Write six numbers into an array from an index."""
    for k in range(6):
        array[at + k] = six[k]
