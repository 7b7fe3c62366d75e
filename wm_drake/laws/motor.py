"""Laws of a drive: torque limit of a motor over its speed, speed controller, bearing friction.

The motor turns n times as fast as the drum (belt ratio n). Torque and speed of motor and controller
are those of the motor's shaft, those of the bearing friction are the drum's. The current follows
its demand at once: a motor's electrical time constant is some milliseconds.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import where, whole_number
from wm_drake.laws.friction import havsin_friction
from wm_drake.laws.table import stiffness_force


@law
def torque_limit(speed, limit):
    """Return the largest torque of a motor at a speed: constant torque, then constant power.

        T_max = T_0 for |w| <= w_0,    T_0 w_0 / |w| = P / |w| beyond

    With a table, it is the monotone cubic through the points, constant beyond the last one.

    Args:
        speed: Speed of the motor [w]. [rad/s]
        limit: Named numbers: torque [T_0, N m]; base_speed [w_0, rad/s], infinite for constant
            torque; table, packed torque over speed (`CURVE`), a number if there is none.

    Returns:
        Torque, the same in both directions, for driving and for braking. [N m]
    """
    size = abs(speed)
    packed, at = limit.table
    if whole_number(packed[at]) > 0:
        return stiffness_force(size, packed, at)
    weak = size > limit.base_speed
    # one in place of speeds below the base speed: no quotient by zero
    return limit.torque * where(weak, limit.base_speed / where(weak, size, 1.0), 1.0)


@law
def limited(demand, limit):
    """Return a demanded torque, or the limit of the same sign if it is beyond. [N m]"""
    return where(demand > limit, limit, where(demand < -limit, -limit, demand))


@law
def speed_controller(error, integral, controller):
    """Return the torque that a PI controller demands. [N m]

        T_demand = K_p e + I

    Args:
        error: Speed that is wanted less speed of the motor [e]. [rad/s]
        integral: Torque of the integral part [I]. [N m]
        controller: Named numbers: proportional_gain [K_p, N m s/rad] among them.
    """
    return controller.proportional_gain * error + integral


@law
def integral_rate(error, demand, torque, controller):
    """Return the rate of the integral part of a PI controller, with anti-windup.

        I' = K_i e + (T - T_demand) / T_t      back-calculation, Astrom and Murray (2008),
                                               Feedback Systems, section 10.4

    Args:
        error: Speed that is wanted less speed of the motor [e]. [rad/s]
        demand: Torque that the controller demands [T_demand]. [N m]
        torque: Torque of the motor within its limit [T]. [N m]
        controller: Named numbers: integral_gain [K_i, N m/rad], tracking_rate [1/T_t, 1/s].

    Returns:
        [N m/s] Without the second part it would wind up while the torque is limited.
    """
    return controller.integral_gain * error + controller.tracking_rate * (torque - demand)


@law
def drum_friction(rate, friction):
    """Return the friction torque of the drum's bearing and seal on the drum: HAVSIN and a dashpot.

        T = HAVSIN(w) - c w

    Args:
        rate: Speed of the drum against the tub [w]. [rad/s]
        friction: Named numbers: friction_torque [N m], full_friction_rate [rad/s] (see
            `havsin_friction`), damping [c, N m s/rad].

    Returns:
        [N m] Its reaction acts on the tub.
    """
    dry = havsin_friction(rate, friction.full_friction_rate, friction.friction_torque)
    return dry - friction.damping * rate
