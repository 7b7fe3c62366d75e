"""A step of the multistep integrator: one evaluation of the time derivative.

The state has smooth parts b (rigid bodies) and stiff internal parts z (deformations of sponges),
which depend on the motion through few inputs u (elongation rates of the struts, rates of rubber
bushings):

    b' = f(b, z),    z' = g(u(b), z)

A step from t to t + h knows f_j = f(t - j h) and u_j = u(t - j h) of steps of the same length:

    b(t + h) = b + h/120 (281 f_0 - 301 f_1 + 149 f_2 + 39 f_3 - 66 f_4 + 18 f_5)
    u(t + s h) = the parabola through u_0, u_1, u_2
    z(t + h): one step of the classical Runge-Kutta scheme for z' = g(u(t + s h), z)

The first line is the Adams-Bashforth formula of fourth order plus 0.2 times the fourth and -0.15
times the fifth backward difference of f: any such sum has order four. These two numbers were
scanned for error and stability: the error constant is 0.15 in place of 0.35, and the formula is
stable for h lambda from -0.38 to 0 and to 0.34 i, in place of -0.30 and 0.43 i.

The friction of a rubber bushing follows its path in closed form instead
(`wm_drake.laws.rubber.dahl_after_step`).

An internal part evaluates its own law only, a small part of f. With the decay of a sponge (320 1/s)
in the first line, 1.1 ms would be the longest stable step.
"""

from wm_drake.compiler.compilation import law
from wm_drake.elements.friction_damper import friction_damper_tension
from wm_drake.elements.rubber import AXIS_COUNT, read_rubber, read_rubber_bushing
from wm_drake.engines.compiled.cabinet import cabinet_after_step
from wm_drake.engines.compiled.mechanics import STATE_SIZE, read_bodies
from wm_drake.engines.compiled.rubber import branch_after_step

PAST_RATES, PAST_INPUTS = 6, 3
"""Numbers of steps, with the one at hand, whose rates and inputs a step uses."""
STEPS_BEFORE = 5
"""Number of steps of the same length and without a corner that must lie before a step."""


@law
def multistep_step(state, rate, past, stage, total, i, h, p, elements):
    """Advance the state by a step.

    Args:
        state, rate: State at the start of the step, advanced, and its time derivative there.
        past: `Past` with the values at the start of this step and of those before it.
        stage, total: Arrays to work in.
        i: Number of the step.
        h: Length of the step. [s]
        p, elements: See `state_derivative`.
    """
    mounts, begins = elements.mounts, elements.begins
    size, inputs = begins.size, begins.inputs
    for k in range(STATE_SIZE):
        state[k] = explicit_multistep(state[k], past.rates, i, k, size, h)
    for k in range(begins.tubes, begins.cabinet):
        state[k] = explicit_multistep(state[k], past.rates, i, k, size, h)
    for k in range(begins.elements, size):
        state[k] = explicit_multistep(state[k], past.rates, i, k, size, h)
    for d in range(len(mounts.dampers)):
        k, at = begins.sponges + d, mounts.dampers[d]
        middle, end = extrapolated(past.inputs, i, d, inputs)
        state[k] = sponge_after_step(state[k], rate[k], middle, end, h, p, at)
    branches_after_step(state, past.inputs, i, h, p, mounts.branches, begins.stretch_inputs, inputs)
    step_cabinet(
        state, rate, stage, total, past.inputs, i, begins.wrench_input, inputs, h, p,
        elements.cabinet, begins.cabinet
    )  # fmt: skip


@law
def step_cabinet(state, rate, stage, total, inputs, i, first_input, size, h, p, cabinet, first):
    """Advance a cabinet that moves by a step; nothing for a fixed one.

    Args:
        state, rate, stage, total, i, h, p: As for `multistep_step`; rate is overwritten.
        inputs, first_input, size: As `extrapolated_wrench` uses them.
        cabinet, first: Index of the cabinet in the packed numbers, None for a fixed one, and index
            in the state where it begins.
    """
    if cabinet is None:
        return
    middle, end = extrapolated_wrench(inputs, i, first_input, size)
    gravity = read_bodies(p, 0).gravity
    cabinet_after_step(state, rate, stage, total, middle, end, h, gravity, p, cabinet, first)


@law
def extrapolated_wrench(inputs, i, first, size):
    """Return the wrench on the cabinet in the middle and at the end of step i; see `extrapolated`.

    Args:
        inputs, i, size: As for `extrapolated`.
        first: Number of the first of its six inputs.
    """
    m_x, n_x = extrapolated(inputs, i, first, size)
    m_y, n_y = extrapolated(inputs, i, first + 1, size)
    m_z, n_z = extrapolated(inputs, i, first + 2, size)
    f_x, g_x = extrapolated(inputs, i, first + 3, size)
    f_y, g_y = extrapolated(inputs, i, first + 4, size)
    f_z, g_z = extrapolated(inputs, i, first + 5, size)
    return (m_x, m_y, m_z, f_x, f_y, f_z), (n_x, n_y, n_z, g_x, g_y, g_z)


@law
def branches_after_step(state, inputs, i, h, p, branches, first, size):
    """Advance the stretches of rubber bushings by a step; nothing without them.

    Args:
        state: State, written.
        inputs: Inputs at the start of the last `PAST_INPUTS` steps, `remember`ed.
        i, h: Number of the step and its length. [s]
        p: Packed numbers.
        branches: `Branches`; None without bushings of rubber.
        first, size: Index of the first of their inputs, and number of all inputs.
    """
    if branches is None:
        return
    for j in range(len(branches.at)):
        rubber = read_rubber(*read_rubber_bushing(p, branches.at[j]).rubber)
        for axis in range(AXIS_COUNT):
            d = first + AXIS_COUNT * j + axis
            start = inputs[i % PAST_INPUTS * size + d]
            middle, end = extrapolated(inputs, i, d, size)
            branch_after_step(state, branches.states[j], axis, start, middle, end, h, rubber)


@law
def explicit_multistep(x, rates, i, k, size, h):
    """Return state k after step i, from the formula of the module.

    Args:
        x: State k at the start of the step.
        rates: Rates at the start of the last `PAST_RATES` steps, `remember`ed.
        i, k, size: Number of the step, index in the state, size of the state.
        h: Length of the step. [s]
    """
    f_0 = rates[i % PAST_RATES * size + k]
    f_1 = rates[(i - 1) % PAST_RATES * size + k]
    f_2 = rates[(i - 2) % PAST_RATES * size + k]
    f_3 = rates[(i - 3) % PAST_RATES * size + k]
    f_4 = rates[(i - 4) % PAST_RATES * size + k]
    f_5 = rates[(i - 5) % PAST_RATES * size + k]
    newer = 281.0 * f_0 - 301.0 * f_1 + 149.0 * f_2
    return x + h / 120.0 * (newer + (39.0 * f_3 - 66.0 * f_4 + 18.0 * f_5))


@law
def extrapolated(inputs, i, d, size):
    """Return input d in the middle and at the end of step i, from the parabola through the past.

    Args:
        inputs: Inputs at the start of the last `PAST_INPUTS` steps, `remember`ed.
        i, d, size: Number of the step, number of the input, number of inputs.
    """
    u = inputs[i % PAST_INPUTS * size + d]
    u1 = inputs[(i - 1) % PAST_INPUTS * size + d]
    u2 = inputs[(i - 2) % PAST_INPUTS * size + d]
    return 1.875 * u - 1.25 * u1 + 0.375 * u2, 3.0 * (u - u1) + u2


@law
def sponge_after_step(deformation, rate, middle, end, h, p, at):
    """Return the deformation of the sponge of a strut damper after a step.

    Args:
        deformation, rate: At the start of the step. [m, m/s]
        middle, end: Elongation rate in the middle and at the end of the step. [m/s]
        h: Length of the step. [s]
        p, at: Array that holds the numbers of `FRICTION_DAMPER`, and where they begin.
    """
    _, second = friction_damper_tension(middle, deformation + 0.5 * h * rate, p, at)
    _, third = friction_damper_tension(middle, deformation + 0.5 * h * second, p, at)
    _, fourth = friction_damper_tension(end, deformation + h * third, p, at)
    return deformation + h / 6.0 * ((rate + fourth) + 2.0 * (second + third))


@law
def remember(past, i, count, values, size):
    """Keep the values at the start of step i, in place of those of the step `count` before it."""
    for k in range(size):
        past[i % count * size + k] = values[k]
