"""Samples of the compiled integration -> `Trajectory`."""

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.compiler.elementary import in_each_lane, lanes_to_rows, rows_to_lanes, sine_cosine
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.elements.cabinet import motion_with, rates_with
from wm_drake.elements.motion import BODY_STATE_SIZE, POSE, tub_motion
from wm_drake.elements.mount import torque_on_drum
from wm_drake.elements.state_map import CARRIER, ELEMENT, RATES_SIZE, STRETCHES, TUB, WATER
from wm_drake.engines.cabinet_frame import seen_from_cabinet
from wm_drake.engines.compiled.bearing import carrier_motion
from wm_drake.engines.compiled.drum import motor_torque_history
from wm_drake.engines.compiled.mechanics import (
    DRUM_ANGLE,
    DRUM_RATE,
    STATE_SIZE,
    mass_properties,
    motor_torque,
    read_rates,
)
from wm_drake.engines.compiled.packing import Layout
from wm_drake.engines.compiled.water import hold_masses
from wm_drake.engines.schedule import Schedule
from wm_drake.engines.trajectory import Trajectory, cut_at_divergence
from wm_drake.parameters.types import FloatArray


def trajectory_of(
    samples: FloatArray, schedule: Schedule, p: FloatArray, layout: Layout
) -> Trajectory:
    """Return the motion up to the last good sample, with the motor's torque.

    Args:
        samples: (rows, size + `Begins.rates`) as `wm_drake.engines.compiled.integration`
            writes them; NaN behind the end of a run.
        schedule: The steps.
        p, layout: From `pack`.
    """
    states, rates = np.split(samples, [layout.states.size], axis=1)
    carrier, cabinet = layout.states.take(states, CARRIER), layout.states.cabinet(states)
    torque = torque_at_samples(samples, schedule, p, layout)
    if cabinet is not None and carrier.shape[1]:
        # samples have the carrier in W, and the tub seen from the cabinet
        in_world = cabinet[:, :BODY_STATE_SIZE], rates[:, -RATES_SIZE:]
        carrier, _ = seen_from_cabinet(*in_world, carrier, rates[:, RATES_SIZE : 2 * RATES_SIZE])
    trajectory = Trajectory(
        schedule.time,
        layout.states.take(states, TUB),
        layout.states.deformation(states),
        torque,
        rates[:, :RATES_SIZE],
        layout.states.tubes(states),
        carrier,
        layout.states.take(states, STRETCHES),
        cabinet=cabinet,
        element_states=layout.states.take(states, ELEMENT) if layout.kinds else None,
        water=layout.states.take(states, WATER) if layout.water else None,
    )
    return cut_at_divergence(trajectory)


def torque_at_samples(
    samples: FloatArray, schedule: Schedule, p: FloatArray, layout: Layout
) -> FloatArray:
    """Return the torque of the motor on the drum at all samples (n,). [N m]

    Args:
        samples, schedule, p, layout: See `trajectory_of`.
    """
    states, rates = np.split(samples, [layout.states.size], axis=1)
    if layout.motor >= 0:
        return torque_of_motor(states, schedule, p, layout)[:, 0]
    motion, carrier = layout.states.take(states, TUB), layout.states.take(states, CARRIER)
    begin = RATES_SIZE if carrier.shape[1] else 0
    cabinet, moving = layout.states.cabinet(states), None
    if cabinet is not None and not carrier.shape[1]:
        moving = np.hstack([cabinet[:, :BODY_STATE_SIZE], rates[:, -RATES_SIZE:]])
    torque: FloatArray = np.empty((len(samples), 1))
    torque_history(
        _motion_of_drum_and_carrier(motion, carrier),
        rates[:, begin : begin + RATES_SIZE],
        schedule.acceleration[schedule.row >= 0, None],
        np.ascontiguousarray(layout.states.take(states, WATER)),
        p,
        moving,
        layout.elements.water,
        torque,
    )
    if any(kind.on_drum for kind in layout.kinds):
        subtract_torque_of_elements(states, p, layout.mounts.others, torque)
    return torque[:, 0]


def torque_of_motor(
    states: FloatArray, schedule: Schedule, p: FloatArray, layout: Layout
) -> FloatArray:
    """Return the torque of a motor on the drum at samples (n, 1). [N m]

    Args:
        states: (n, size)
        schedule, p, layout: See `trajectory_of`.
    """
    torque = np.empty((len(states), 1))
    reference = schedule.drum[:-1:2][schedule.row >= 0, :1]
    motor_torque_history(
        np.ascontiguousarray(states),
        np.ascontiguousarray(reference),
        p,
        layout.motor,
        layout.states.begins.motor,
        torque,
    )
    return torque


def _motion_of_drum_and_carrier(motion: FloatArray, carrier: FloatArray) -> FloatArray:
    """Return the motion of the drum and of the body that it turns in, in the layout of `motion`.

    This body is the drum carrier with a compliant bearing, else the tub.

    Args:
        motion: State of tub and drum. (n, 14)
        carrier: State of the drum carrier (n, 12); (n, 0) with a rigid bearing.
    """
    if not carrier.shape[1]:
        return motion
    pose, velocity = np.split(carrier, [POSE.fixed_size], axis=1)
    return np.column_stack([pose, motion[:, DRUM_ANGLE], velocity, motion[:, DRUM_RATE]])


@long_running
def subtract_torque_of_elements(states, p, others, torque):
    """Subtract the torque of elements on the drum, which the motor then need not give.

    Args:
        states: (n, size)
        p, others: Packed numbers, and the `RegisteredLaws` in them.
        torque: (n, 1), changed. [N m]
    """
    align_stack()
    x_numbers, numbers, p_numbers = (
        np.empty(states.shape[1] * WIDTH),
        np.empty(WIDTH),
        in_each_lane(p),
    )
    x, answer, q = lane_array(x_numbers), lane_array(numbers), lane_array(p_numbers)
    for begin in range(0, len(torque), WIDTH):
        rows_to_lanes(states, begin, x_numbers)
        answer[0] = torque_on_drum(x, tub_motion(x), q, others)
        for lane in range(min(WIDTH, len(torque) - begin)):
            torque[begin + lane, 0] -= numbers[lane]
    keep(p_numbers)


@long_running
def torque_history(motions, rates, acceleration, left, p, cabinet, water, torque):
    """Evaluate the torque of the motor on the drum at samples.

    Args:
        motions: (n, 14) motion of the body that the drum turns in, and of the drum, in the layout
            of the state of tub and drum.
        rates: (n, 6) angular acceleration and acceleration of the origin of that body, in W.
            [rad/s^2, m/s^2]
        acceleration: (n, 1) acceleration of the drum. [rad/s^2]
        left: (n, wet) share of water that is left in each wet mass.
        p: Packed numbers of the bodies.
        cabinet: (n, 18) motion and accelerations of the cabinet in W, if motions and rates are seen
            from it; None if they are in W.
        water: `Water`; None for a load that stays.
        torque: (n, 1), written. [N m]
    """
    align_stack()
    x_numbers, rates_numbers = np.empty(STATE_SIZE * WIDTH), np.empty(RATES_SIZE * WIDTH)
    drum_numbers, numbers, p_numbers = np.empty(WIDTH), np.empty(WIDTH), in_each_lane(p)
    x, dx, drum = lane_array(x_numbers), lane_array(rates_numbers), lane_array(drum_numbers)
    answer, q = lane_array(numbers), lane_array(p_numbers)
    cabinet_numbers = np.empty((BODY_STATE_SIZE + RATES_SIZE) * WIDTH)
    c = lane_array(cabinet_numbers)
    left_numbers = np.empty(max(left.shape[1], 1) * WIDTH)
    of_water = lane_array(left_numbers)
    for begin in range(0, len(torque), WIDTH):
        rows_to_lanes(motions, begin, x_numbers)
        rows_to_lanes(rates, begin, rates_numbers)
        rows_to_lanes(acceleration, begin, drum_numbers)
        rows_to_lanes(left, begin, left_numbers)
        hold_masses(q, of_water, 0, water)
        sine, cosine = sine_cosine(x[DRUM_ANGLE])
        masses, rate, motion = mass_properties(q, cosine, sine), read_rates(dx, 0), tub_motion(x)
        w_rate, v_rate = rate.angular_acceleration, rate.acceleration
        if cabinet is not None:
            rows_to_lanes(cabinet, begin, cabinet_numbers)
            (moving, _), moving_rates = carrier_motion(c, 0), read_rates(c, BODY_STATE_SIZE)
            w_rate, v_rate = rates_with(
                moving,
                moving_rates.angular_acceleration,
                moving_rates.acceleration,
                motion,
                w_rate,
                v_rate,
            )
            motion = motion_with(moving, motion)
        answer[0] = motor_torque(motion, w_rate, v_rate, masses, x[DRUM_RATE], drum[0], q)
        lanes_to_rows(numbers, begin, torque)
    keep(p_numbers)
