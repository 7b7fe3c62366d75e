"""Mechanics of a drum that a motor turns: its rotation is a degree of freedom.

Own derivation; the tests compare it with the Drake plant. The accelerations of the tub are affine
in the acceleration of the drum against it, and so is the torque T_needed that the drum's balance of
moments needs. With d the difference from an acceleration for which both are known:

    w' = w'_0 - d R I_c^-1 g,    a_O = a_O0 - d R (h + w_1 x S) / M,    T_needed = T_0 + d J
    h = a x s_d,    g = J_d a - S x h / M,    w_1 = -I_c^-1 g
    J = a . J_d a - h . h / M - g . I_c^-1 g

with the symbols of `wm_drake.engines.compiled.mechanics`; I_c: inertia about the common centre of
mass. J is the inertia of the drum about its axis, with a tub that gives way. The part J_r of the
rotor's inertia that acts on the joint alone adds to it (`wm_drake.model.rotor`):

    d = (T_motor + T_friction - T_0 - J_r acceleration_0) / (J + J_r)

The state of the drive is a `MOTOR_STATE`, its numbers are those of `MOTOR`.
"""

import numpy as np

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import in_each_lane, lanes_to_rows, rows_to_lanes
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.compiler.matrices import times
from wm_drake.compiler.vectors import add, cross, dot, rotate, scale, subtract
from wm_drake.elements.motion import read_tree_state
from wm_drake.elements.motor import (
    motor_response,
    read_bearing_friction,
    read_motor,
    read_motor_state,
    sampled_state,
    write_motor_state,
)
from wm_drake.laws.motor import drum_friction


@law
def motor_torque_and_rates(x, dx, reference, p, motor, first):
    """Return the torque of motor and friction on the drum; write the rates of the drive's state.

    Args:
        x, dx: State and its derivative.
        reference: Speed of the drum that is wanted. [rad/s]
        p: Packed numbers.
        motor, first: Indices in them and in the state where the drive begins.
    """
    state, rate = read_motor_state(x, first), read_tree_state(x, 0).joint_rate
    torque, growth = motor_response(state, rate, reference, p, motor)
    write_motor_state(dx, first, growth, 0.0 * growth)
    friction = read_bearing_friction(*read_motor(p, motor).friction)
    return torque + drum_friction(rate, friction)


@law
def with_free_drum(motion, masses, bodies, w_rate, v_rate, acceleration, missing, reflected):
    """Return the accelerations of the tub and of the drum under the torques on the drum.

    Args:
        motion: `TubMotion`.
        masses, bodies: `MassProperties` at the drum angle, and numbers of `BODIES` by name.
        w_rate, v_rate: Angular acceleration of the tub and acceleration of To, in W, at an
            acceleration of the drum. [rad/s^2, m/s^2]
        acceleration: This acceleration of the drum. [rad/s^2]
        missing: Torque of motor and friction less the torque that it needs. [N m]
        reflected: Inertia J_r. [kg m^2]
    """
    a, q = bodies.axis, bodies.inverse_mass
    h = cross(a, masses.drum_moment)
    turned = times(masses.drum_inertia, a)
    g = subtract(turned, scale(q, cross(masses.moment, h)))
    w_1 = scale(-1.0, times(masses.inverse_inertia, g))
    inertia = dot(a, turned) - q * dot(h, h) + dot(g, w_1)
    d = (missing - reflected * acceleration) / (inertia + reflected)
    a_1 = scale(-q, add(h, cross(w_1, masses.moment)))
    of_To = subtract(a_1, cross(w_1, bodies.origin))
    return (
        add(w_rate, scale(d, rotate(motion.rotation, w_1))),
        add(v_rate, scale(d, rotate(motion.rotation, of_To))),
        acceleration + d,
    )


@law
def sample_controller(x, reference, is_sample, p, motor, first):
    """Let a sampled controller take a sample.

    Args:
        x: State, changed.
        reference: Speed of the drum that is wanted. [rad/s]
        is_sample: Whether now is the time of a sample.
        p, motor, first: See `motor_torque_and_rates`; nothing is done if `motor` is None.
    """
    if motor is None:
        return
    if is_sample:
        state, rate = read_motor_state(x, first), read_tree_state(x, 0).joint_rate
        integral, demand = sampled_state(state, rate, reference, p, motor)
        write_motor_state(x, first, integral, demand)


@long_running
def motor_torque_history(states, reference, p, motor, first, torque):
    """Evaluate the torque of a motor on the drum at samples.

    Args:
        states: (n, size)
        reference: Speed of the drum that is wanted. (n, 1) [rad/s]
        p, motor, first: See `motor_torque_and_rates`.
        torque: (n, 1), written. [N m]
    """
    align_stack()
    x_numbers, reference_numbers = np.empty(states.shape[1] * WIDTH), np.empty(WIDTH)
    numbers, p_numbers = np.empty(WIDTH), in_each_lane(p)
    x, target_speed = lane_array(x_numbers), lane_array(reference_numbers)
    answer, q = lane_array(numbers), lane_array(p_numbers)
    for begin in range(0, len(torque), WIDTH):
        rows_to_lanes(states, begin, x_numbers)
        rows_to_lanes(reference, begin, reference_numbers)
        state, rate = read_motor_state(x, first), read_tree_state(x, 0).joint_rate
        answer[0], _ = motor_response(state, rate, target_speed[0], q, motor)
        lanes_to_rows(numbers, begin, torque)
    keep(p_numbers)
