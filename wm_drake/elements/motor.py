"""Drive with a motor: packed numbers of controller, torque limit, belt and bearing friction."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import numbers, where
from wm_drake.compiler.packed import LAYOUT, SCALAR, PackedLayout
from wm_drake.elements.kind import ElementKind, Output
from wm_drake.elements.layouts import packed_torque_limit
from wm_drake.elements.motion import read_tree_state, write_generalized_force
from wm_drake.laws.motor import (
    drum_friction,
    integral_rate,
    limited,
    speed_controller,
    torque_limit,
)
from wm_drake.laws.table import CURVE
from wm_drake.parameters.drive import BearingFriction, MotorDrive, TorqueLimit
from wm_drake.parameters.types import FloatArray

CONTROLLER = PackedLayout(
    "SpeedControllerNumbers",
    belt_ratio=SCALAR,
    proportional_gain=SCALAR,
    integral_gain=SCALAR,
    tracking_rate=SCALAR,
)
"""Belt ratio, gains [N m s/rad, N m/rad] and inverse time constant of the anti-windup [1/s]."""
TORQUE_LIMIT = PackedLayout("TorqueLimitNumbers", torque=SCALAR, base_speed=SCALAR, table=CURVE)
"""Torque [N m] and speed from which it falls [rad/s]; or a table [rad/s, N m]."""
BEARING_FRICTION = PackedLayout(
    "BearingFrictionNumbers", friction_torque=SCALAR, full_friction_rate=SCALAR, damping=SCALAR
)
"""Dry friction [N m], drum speed at which it is full [rad/s], viscous friction [N m s/rad]."""
MOTOR = PackedLayout(
    "MotorNumbers",
    reflected_inertia=SCALAR,
    sample_time=SCALAR,
    controller=LAYOUT(CONTROLLER),
    friction=LAYOUT(BEARING_FRICTION),
    limit=LAYOUT(TORQUE_LIMIT),
)
"""All numbers of a drive with a motor: part of the rotor's inertia that acts on the drum's joint
alone [kg m^2], sample time of the controller, 0 if it is continuous [s], and the parts."""
MOTOR_STATE = PackedLayout("MotorState", integral=SCALAR, demand=SCALAR)
"""Integral part of the controller [N m], and the demand that a sampled controller holds [N m]."""
MOTOR_STATE_SIZE = MOTOR_STATE.fixed_size

read_controller, read_torque_limit = CONTROLLER.read, TORQUE_LIMIT.read
read_bearing_friction, read_motor = BEARING_FRICTION.read, MOTOR.read
read_motor_state, write_motor_state = MOTOR_STATE.read, MOTOR_STATE.write


def packed_controller(drive: MotorDrive) -> FloatArray:
    """Return the numbers of `CONTROLLER`."""
    return CONTROLLER.pack(
        belt_ratio=drive.belt_ratio,
        proportional_gain=drive.controller.proportional_gain,
        integral_gain=drive.controller.integral_gain,
        tracking_rate=drive.controller.tracking_rate,
    )


def packed_limit(drive: MotorDrive) -> FloatArray:
    """Return the numbers of `TORQUE_LIMIT`."""
    limit = drive.torque_limit
    table = packed_torque_limit(limit)
    if not isinstance(limit, TorqueLimit):
        return TORQUE_LIMIT.pack(torque=0.0, base_speed=float("inf"), table=table)
    base = float("inf") if limit.power is None else limit.power / limit.torque
    return TORQUE_LIMIT.pack(torque=limit.torque, base_speed=base, table=table)


def packed_friction(drive: MotorDrive) -> FloatArray:
    """Return the numbers of `BEARING_FRICTION`."""
    return BEARING_FRICTION.pack(**drive.bearing_friction.model_dump())


def packed_motor(drive: MotorDrive) -> FloatArray:
    """Return the numbers of `MOTOR`."""
    return MOTOR.pack(
        reflected_inertia=drive.reflected_inertia,
        sample_time=drive.controller.sample_time or 0.0,
        controller=packed_controller(drive),
        friction=packed_friction(drive),
        limit=packed_limit(drive),
    )


def motor_structure(drive: MotorDrive) -> list[int]:
    """Return the number of points of the torque table, 0 without one."""
    return TORQUE_LIMIT.structure(packed_limit(drive))


@law
def motor_response(state, rate, reference, p, at):
    """Return what the motor does at a speed of the drum.

    Args:
        state: Numbers of `MOTOR_STATE`, by name.
        rate, reference: Speed of the drum, and the one that is wanted. [rad/s]
        p, at: Array that holds the numbers of `MOTOR`, and where they begin.

    Returns:
        Torque of the motor on the drum [N m] and rate of the integral part [N m/s], which is 0 for
        a sampled controller.
    """
    motor = read_motor(p, at)
    n = read_controller(*motor.controller).belt_ratio
    limit = torque_limit(n * rate, read_torque_limit(*motor.limit))
    demand, growth = controller_response(state.integral, rate, reference, limit, *motor.controller)
    is_sampled = motor.sample_time > 0.0
    torque = limited(where(is_sampled, state.demand, demand), limit)
    return n * torque, where(is_sampled, 0.0 * growth, growth)


@law
def controller_response(integral, rate, reference, limit, p, at):
    """Return the demand of the controller [N m] and the rate of its integral part [N m/s].

    Args:
        integral: Torque of the integral part. [N m]
        rate, reference: See `motor_response`.
        limit: Largest torque of the motor now. [N m]
        p, at: Array that holds the numbers of `CONTROLLER`, and where they begin.
    """
    controller = read_controller(p, at)
    error = controller.belt_ratio * (reference - rate)
    demand = speed_controller(error, integral, controller)
    return demand, integral_rate(error, demand, limited(demand, limit), controller)


@law
def sampled_state(state, rate, reference, p, at):
    """Return integral part and demand of a sampled controller after a sample. [N m]

        I_(k+1) = I_k + T_s I'(e_k),    the demand K_p e_k + I_k is held

    Args:
        state, rate, reference, p, at: See `motor_response`.
    """
    motor = read_motor(p, at)
    n = read_controller(*motor.controller).belt_ratio
    limit = torque_limit(n * rate, read_torque_limit(*motor.limit))
    demand, growth = controller_response(state.integral, rate, reference, limit, *motor.controller)
    return state.integral + motor.sample_time * growth, demand


@law
def evaluate_controller(inputs, p, outputs):
    """Write demand and rate of the integral part into `outputs`.

    Args:
        inputs: Integral part [N m], speed of the drum, wanted speed [rad/s], torque limit [N m].
        p: Numbers of `CONTROLLER`.
        outputs: (2,), written. [N m, N m/s]
    """
    x = numbers(inputs)
    outputs[0], outputs[1] = controller_response(x[0], x[1], x[2], x[3], numbers(p), 0)


@law
def evaluate_motor(inputs, p, outputs):
    """Write torque and torque limit of the motor into `outputs`.

    Args:
        inputs: Demand [N m] and speed of the motor [rad/s].
        p: Numbers of `TORQUE_LIMIT`.
        outputs: (2,), written. [N m]
    """
    x = numbers(inputs)
    limit = torque_limit(x[1], read_torque_limit(numbers(p), 0))
    outputs[0], outputs[1] = limited(x[0], limit), limit


@law
def evaluate_drum_friction(x, state, p, generalized_force, force, rate):
    """Write the friction torque of the drum's bearing; arguments as in `ElementSystem`."""
    torque = drum_friction(
        read_tree_state(numbers(x), 0).joint_rate, read_bearing_friction(numbers(p), 0)
    )
    zero = 0.0 * torque
    write_generalized_force(generalized_force, 0, (zero, zero, zero, zero, zero, zero), torque)
    force[0] = torque


DRUM_FRICTION = ElementKind(
    name="drum_friction",
    parameters=BearingFriction,
    layout=BEARING_FRICTION,
    outputs=(Output("torque", "N m", "torque on the drum"),),
    words="friction of the drum's bearing and seal",
    picture="points",
    on_plant=evaluate_drum_friction,
)
