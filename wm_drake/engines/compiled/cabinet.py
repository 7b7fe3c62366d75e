"""A cabinet that moves on its feet, as a further rigid body of the compiled engine.

The laws of all mounts are evaluated with the motion of the tub seen from the cabinet, in its frame
C; the wrench on the tub is turned back to W, and the opposite one acts on the cabinet. For a fixed
cabinet, whose index is None, all of this is compiled away.

State: a `BODY_STATE` of C, then the slips of the feet. Packed numbers: those of `TUB` for the
cabinet without its mounts, then those of the feet.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import where
from wm_drake.compiler.matrices import plus, six
from wm_drake.elements.cabinet import (
    SLIP_SIZE,
    feet_on_floor,
    motion_in,
    rates_in,
    rpy_of,
    wrenches_of_mounts,
)
from wm_drake.elements.motion import (
    BODY_STATE_SIZE,
    motion_at,
    read_body_state,
    read_tree_state,
    write_body_state,
    write_tree_state,
)
from wm_drake.engines.compiled.bearing import TUB, carrier_motion, tub_accelerations
from wm_drake.engines.trajectory import LARGEST_TILT

FEET_BEGIN = TUB.fixed_size
"""Index of the feet in the packed numbers of a cabinet."""
SLIPS_BEGIN = BODY_STATE_SIZE
"""Index of the slips in the state of a cabinet."""
CABINET_STATE_SIZE = SLIPS_BEGIN + SLIP_SIZE
"""State of a cabinet."""


@law
def seen_from_cabinet(x, motion, cabinet, first):
    """Return the motion of the tub seen from the cabinet; from W if it is fixed.

    Args:
        x: State.
        motion: `TubMotion` of the tub in W.
        cabinet: Index of the cabinet in the packed numbers; None for a fixed one.
        first: Index in the state where the cabinet begins.
    """
    if cabinet is None:
        return motion
    moving, _ = carrier_motion(x, first)
    return motion_in(moving, motion)


@law
def with_cabinet(x, dx, inputs, first_input, motion, total, gravity, p, cabinet, first):
    """Return the wrench of the mounts on the tub in W; write the derivative of the cabinet's state.

    Args:
        x, dx: State and its derivative.
        inputs, first_input: Inputs of internal parts, and index in them of the wrench of the
            mounts on the cabinet, written: moment about the origin of C and force, in W. [N m, N]
        motion: `TubMotion` of the tub in W.
        total: Moment about To and force of all mounts on the tub, in C. [N m, N]
        gravity: Acceleration in W. [m/s^2]
        p: Packed numbers.
        cabinet, first: As for `seen_from_cabinet`.
    """
    if cabinet is None:
        return total
    moving, angle_rates = carrier_motion(x, first)
    on_tub, on_cabinet = wrenches_of_mounts(moving, motion, total)
    for k in range(6):
        inputs[first_input + k] = on_cabinet[k]
    write_cabinet_rates(x, dx, moving, angle_rates, on_cabinet, gravity, p, cabinet, first)
    return on_tub


@law
def write_cabinet_rates(x, dx, moving, angle_rates, on_cabinet, gravity, p, cabinet, first):
    """Write the derivative of the cabinet's state under a wrench of its mounts.

    Args:
        x, dx: State and its derivative.
        moving, angle_rates: From `carrier_motion`.
        on_cabinet: Moment about the origin of C and force of the mounts, in W. [N m, N]
        gravity, p, cabinet, first: As for `with_cabinet`.
    """
    feet = feet_on_floor(x, dx, first + SLIPS_BEGIN, moving, p, cabinet + FEET_BEGIN)
    w_rate, v_rate = tub_accelerations(moving, plus(on_cabinet, feet), gravity, p, cabinet)
    write_body_state(dx, first, angle_rates, moving.velocity, w_rate, v_rate)


@law
def cabinet_after_step(x, rate, stage, total, middle, end, h, gravity, p, cabinet, first):
    """Advance the cabinet by a Runge-Kutta step of it alone, under a known wrench of its mounts.

    Args:
        x, rate: State at the start of the step, of which the cabinet is advanced, and its
            derivative there; the part of the cabinet is overwritten.
        stage, total: Arrays to work in.
        middle, end: Wrench of the mounts on the cabinet in the middle and at the end of the step.
            [N m, N]
        h: Length of the step. [s]
        gravity, p, cabinet, first: As for `with_cabinet`.
    """
    last = first + CABINET_STATE_SIZE
    for k in range(first, last):
        total[k] = x[k] + h / 6.0 * rate[k]
        stage[k] = x[k] + 0.5 * h * rate[k]
    for number in range(1, 4):
        wrench = end if number == 3 else middle
        moving, angle_rates = carrier_motion(stage, first)
        write_cabinet_rates(stage, rate, moving, angle_rates, wrench, gravity, p, cabinet, first)
        weight = h / 6.0 if number == 3 else h / 3.0
        ahead = h if number == 2 else 0.5 * h
        for k in range(first, last):
            total[k] = total[k] + weight * rate[k]
            stage[k] = x[k] + ahead * rate[k]
    for k in range(first, last):
        x[k] = total[k]


@law
def write_cabinet_jacobian(
    x, rate, inputs, first_input, difference, gravity, p, cabinet, first, jacobian
):
    """Write the Jacobian of the cabinet under a constant wrench of its mounts, by rows.

    Args:
        x: State.
        rate: Array to work in.
        inputs, first_input: As for `with_cabinet`, the wrench.
        difference: Half of the central difference.
        gravity, p, cabinet, first: As for `with_cabinet`; nothing is done for a fixed one.
        jacobian: (`CABINET_STATE_SIZE`, `CABINET_STATE_SIZE`), written. [1/s]
    """
    if cabinet is None:
        return
    wrench = six(inputs, first_input)
    for column in range(CABINET_STATE_SIZE):
        at_rest = x[first + column]
        for row in range(CABINET_STATE_SIZE):
            jacobian[row * CABINET_STATE_SIZE + column] = 0.0 * at_rest
        for side in (-1.0, 1.0):
            x[first + column] = at_rest + side * difference
            moving, angle_rates = carrier_motion(x, first)
            write_cabinet_rates(x, rate, moving, angle_rates, wrench, gravity, p, cabinet, first)
            for row in range(CABINET_STATE_SIZE):
                k = row * CABINET_STATE_SIZE + column
                jacobian[k] = jacobian[k] + side * rate[first + row] / (2.0 * difference)
        x[first + column] = at_rest


@law
def write_seen_sample(history, at, x, dx, cabinet, first, rates):
    """Replace the tub in a sample by what is seen from the cabinet; write the cabinet's `RATES`.

    Args:
        history, at: Samples, and index where this one begins.
        x, dx: State and its derivative.
        cabinet, first: As for `seen_from_cabinet`; nothing is done for a fixed one.
        rates: Layouts' indices of the accelerations of the tub and of the cabinet in the samples.
    """
    if cabinet is not None:
        moving, _ = carrier_motion(x, first)
        body, rate = motion_at(x, 0), read_tree_state(dx, 0)
        moved = read_body_state(dx, first)
        seen = motion_in(moving, body)
        turned, shifted = rates_in(
            moving,
            moved.angular_velocity,
            moved.velocity,
            body,
            rate.angular_velocity,
            rate.velocity,
        )
        angles = read_body_state(x, first).angles
        stands = (abs(angles[0]) < LARGEST_TILT) & (abs(angles[1]) < LARGEST_TILT)
        drum, (roll, pitch, yaw) = read_tree_state(x, 0), rpy_of(seen.rotation)
        write_tree_state(
            history,
            at,
            angles=(where(stands, roll, 0.0 * roll / 0.0), pitch, yaw),
            position=seen.position,
            joint_position=drum.joint_position,
            angular_velocity=seen.angular_velocity,
            velocity=seen.velocity,
            joint_rate=drum.joint_rate,
        )
        for k in range(3):
            history[rates[0] + k] = turned[k]
            history[rates[0] + 3 + k] = shifted[k]
            history[rates[1] + k] = moved.angular_velocity[k]
            history[rates[1] + 3 + k] = moved.velocity[k]
