"""States of the branches of rubber bushings in the compiled engine: rates, and fixed steps.

They depend on the motion through one input each, the rate of the displacement of an axis; the
bushing writes the six of them. The friction follows its path in closed form in every step, so that
no step is too long for it (`dahl_after_step`). With the Runge-Kutta scheme its stages carry the
path in place of the stretch. A Maxwell element is a state like any other there; the multistep
integrator takes a Runge-Kutta step of it alone, as of a sponge.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import whole_number
from wm_drake.elements.rubber import (
    AXIS_COUNT,
    read_rubber,
    read_rubber_bushing,
    rubber_motion,
    write_branch_rates,
)
from wm_drake.laws.rubber import dahl_after_path, dahl_after_step, maxwell_after_step


@law
def write_branches(x, dx, inputs, first_input, motion, p, branches):
    """Write the inputs of all branches and the time derivatives of their stretches.

    Args:
        x, dx: State and its time derivative.
        inputs, first_input: Inputs of internal states, and index in them of the first rate.
        motion: `TubMotion`.
        p: Packed numbers.
        branches: `Branches`; None without bushings of rubber.
    """
    if branches is None:
        return
    for j in range(len(branches.at)):
        whole = read_rubber_bushing(p, branches.at[j])
        rate = rubber_motion(motion, *whole.bushing).rate
        for axis in range(AXIS_COUNT):
            inputs[first_input + AXIS_COUNT * j + axis] = rate[axis]
        write_branch_rates(x, dx, branches.states[j], rate, read_rubber(*whole.rubber))


@law
def write_paths(rate, inputs, first_input, p, branches):
    """Write the rate of the path of each friction in place of the rate of its stretch.

    Args:
        rate: Time derivative of the state.
        inputs, first_input, p, branches: As for `write_branches`.
    """
    if branches is None:
        return
    for j in range(len(branches.at)):
        rubber = read_rubber(*read_rubber_bushing(p, branches.at[j]).rubber)
        for axis in range(AXIS_COUNT):
            at = whole_number(rubber.dahl_state[axis])
            if at >= 0:
                rate[branches.states[j] + at] = inputs[first_input + AXIS_COUNT * j + axis]


@law
def follow_paths(moved, state, p, branches, inputs, first_input, h):
    """Replace the path of each friction in a Runge-Kutta step by its stretch.

    Args:
        moved: State of a stage or at the end of the step; its number for a friction is that of
            `state` plus the path.
        state: State at the start of the step.
        p, branches: As for `write_branches`.
        inputs: Inputs at the end of the step; None at a stage, whose path has no reversal.
        first_input: As for `write_branches`.
        h: Length of the step. [s]
    """
    if branches is None:
        return
    for j in range(len(branches.at)):
        rubber = read_rubber(*read_rubber_bushing(p, branches.at[j]).rubber)
        for axis in range(AXIS_COUNT):
            at = whole_number(rubber.dahl_state[axis])
            if at >= 0:
                k = branches.states[j] + at
                rate_at = first_input + AXIS_COUNT * j + axis
                moved[k] = _stretch_after(
                    state[k],
                    moved[k] - state[k],
                    rubber.dahl_displacement[axis],
                    inputs,
                    rate_at,
                    h,
                )


@law
def _stretch_after(stretch, path, displacement, inputs, rate_at, h):
    """Return the stretch of a friction after a path, or after a step whose last input is known."""
    if inputs is None:
        return dahl_after_path(stretch, path, displacement)
    return dahl_after_step(stretch, path, inputs[rate_at], h, displacement)


@law
def branch_after_step(x, first, axis, start, middle, end, h, rubber):
    """Advance the stretches of an axis by a step whose input is known.

    Args:
        x, first: State, and index in it of the first stretch of the bushing.
        axis: Number of the axis.
        start, middle, end: Rate of its displacement in the step. [m/s or rad/s]
        h: Length of the step. [s]
        rubber: Named numbers of `RUBBER`.
    """
    at = whole_number(rubber.dahl_state[axis])
    if at >= 0:
        k, path = first + at, h / 6.0 * (start + 4.0 * middle + end)
        x[k] = dahl_after_step(x[k], path, end, h, rubber.dahl_displacement[axis])
    at = whole_number(rubber.maxwell_state[axis])
    if at >= 0:
        k, spring, dashpot = (
            first + at,
            rubber.maxwell_stiffness[axis],
            rubber.maxwell_damping[axis],
        )
        x[k] = maxwell_after_step(x[k], start, middle, end, h, spring, dashpot)
