"""Rigid-body mechanics of the compiled engine: a floating tub and a drum with prescribed rotation.

Own derivation; the tests compare it with the Drake plant. All vectors are in the tub frame T, all
moments about a point O of the drum axis:

    M a_O + w' x S + w x (w x S_t) + b x s_d + w_D x (w_D x s_d)          = F
    S x a_O + I w' + w x (I_t w) + J_d b + w_D x (J_d w_D)                = tau
    w_D = w + rate a,    b = acceleration a + rate (w x a),    S = S_t + s_d,    I = I_t + J_d

M: total mass; S_t, s_d: first moments of tub group and drum about O; I_t, J_d: their inertias about
O; a: unit vector of the axis, along the drum's rotation against the tub. The drum quantities follow
the drum angle exactly: for a body that turns about a fixed axis they contain the first and second
harmonic of the angle and no other.

Packed numbers of the bodies, from index 0 (`wm_drake.engines.compiled.packing`): gravity vector in
W [m/s^2]; 1/M [1/kg]; a; position of O from To [m]; S_t [kg m]; I_t as xx, yy, zz, xy, xz, yz
[kg m^2]; s_d, three times its mean, cosine and sine part; J_d, six times its mean, cosine, sine,
double cosine and double sine part; damping of the drum joint [N m s/rad].

State: that of the plant (tub and drum); the deformation of each strut damper; the states of
telescopic dampers (`wm_drake.engines.compiled.tubes`); the state of the drum's carrier
(`wm_drake.engines.compiled.bearing`).
"""

from collections import namedtuple

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import anywhere, sine_cosine
from wm_drake.compiler.matrices import about_centre, inverse, plus, six, three, times
from wm_drake.compiler.vectors import add, cross, dot, rotate, rotate_back, scale, subtract
from wm_drake.elements.bearing import drum_bearing_forces
from wm_drake.elements.bushing import six_component_bushing_wrench
from wm_drake.elements.friction_damper import (
    friction_damper_line,
    friction_damper_tension,
    friction_damper_wrench,
)
from wm_drake.elements.motion import PLANT_STATE_SIZE, motion_from_sines, rpy_rates
from wm_drake.elements.spring import spring_strut_wrench
from wm_drake.engines.compiled.bearing import (
    TUB_SIZE,
    carrier_motion,
    carrier_size,
    tub_accelerations,
)
from wm_drake.engines.compiled.tubes import (
    TUBES_STATE_SIZE,
    add_telescopic_dampers,
    telescopic_damper_count,
)

GRAVITY, INVERSE_MASS, AXIS, ORIGIN = 0, 3, 4, 7
TUB_MOMENT, TUB_INERTIA, DRUM_MOMENT, DRUM_INERTIA = 10, 13, 19, 28
JOINT_DAMPING, BODIES_SIZE = 58, 59
STATE_SIZE = PLANT_STATE_SIZE
"""Size of the part of the state that belongs to tub and drum."""
DRUM_ANGLE, DRUM_RATE = 6, 13
"""Indices of the drum's angle and rate in the state."""
RATES_SIZE = 6
"""Accelerations of a body in a sample."""

Elements = namedtuple(
    "Elements", ("springs", "dampers", "bushings", "telescopes", "bearing", "tubes")
)
"""Indices at which the parts of a machine begin.

springs, dampers, bushings: arrays of indices of the elements in the packed numbers; telescopes: the
same for telescopic dampers, None if there are none; bearing: index of the drum's bearing in the
packed numbers, None if the bearing is rigid; tubes: index of the telescopic dampers in the state.
"""

MassProperties = namedtuple(
    "MassProperties", ("drum_moment", "drum_inertia", "moment", "inverse_inertia")
)
"""s_d, J_d, S and the inverse of the inertia about the common centre of mass, at a drum angle."""


@law
def first_harmonic(p, at, c, s):
    """Return the mean + cosine part c + sine part s."""
    return p[at] + p[at + 1] * c + p[at + 2] * s


@law
def second_harmonic(p, at, c, s):
    """Return the first harmonic plus the cosine and sine part of the double angle."""
    return first_harmonic(p, at, c, s) + p[at + 3] * (c * c - s * s) + p[at + 4] * (2.0 * c * s)


@law
def mass_properties(p, c, s):
    """Return the `MassProperties` at a drum angle of cosine c and sine s."""
    at = DRUM_MOMENT
    drum = (
        first_harmonic(p, at, c, s),
        first_harmonic(p, at + 3, c, s),
        first_harmonic(p, at + 6, c, s),
    )
    at = DRUM_INERTIA
    j = (
        second_harmonic(p, at, c, s),
        second_harmonic(p, at + 5, c, s),
        second_harmonic(p, at + 10, c, s),
        second_harmonic(p, at + 15, c, s),
        second_harmonic(p, at + 20, c, s),
        second_harmonic(p, at + 25, c, s),
    )
    t = six(p, TUB_INERTIA)
    m = add(three(p, TUB_MOMENT), drum)
    q = p[INVERSE_MASS]
    both = (t[0] + j[0], t[1] + j[1], t[2] + j[2], t[3] + j[3], t[4] + j[4], t[5] + j[5])
    return MassProperties(drum, j, m, inverse(about_centre(both, m, q)))


@law
def accelerations(motion, masses, rate, acceleration, wrench, p):
    """Return the accelerations of the tub under a wrench.

    Args:
        motion: `TubMotion`.
        masses: `MassProperties` at the drum angle.
        rate, acceleration: Rate of the drum against the tub and its derivative. [rad/s, rad/s^2]
        wrench: Moment about To and force of all elements on the tub, in W, without gravity.
            [N m, N]
        p: Packed numbers of the bodies.

    Returns:
        Angular acceleration of the tub and acceleration of To, in W. [rad/s^2, m/s^2]
    """
    a, o, tub_moment = three(p, AXIS), three(p, ORIGIN), three(p, TUB_MOMENT)
    q = p[INVERSE_MASS]
    applied = rotate_back(motion.rotation, (wrench[3], wrench[4], wrench[5]))
    moment = rotate_back(motion.rotation, (wrench[0], wrench[1], wrench[2]))
    apart = anywhere((abs(o[0]) > 0.0) | (abs(o[1]) > 0.0) | (abs(o[2]) > 0.0))
    if apart:
        moment = subtract(moment, cross(o, applied))
    w = rotate_back(motion.rotation, motion.angular_velocity)
    w_drum, b = drum_motion(w, rate, acceleration, a)
    drum_flow = add(cross(b, masses.drum_moment), cross(w_drum, cross(w_drum, masses.drum_moment)))
    force = subtract(applied, add(cross(w, cross(w, tub_moment)), drum_flow))
    gyration = add(times(masses.drum_inertia, b), cross(w_drum, times(masses.drum_inertia, w_drum)))
    moment = subtract(moment, add(cross(w, times(six(p, TUB_INERTIA), w)), gyration))
    # gravity accelerates all bodies equally: it has no moment and is added at the end
    w_rate = times(masses.inverse_inertia, subtract(moment, scale(q, cross(masses.moment, force))))
    a_O = scale(q, subtract(force, cross(w_rate, masses.moment)))
    a_To = a_O
    if apart:
        a_To = subtract(a_O, add(cross(w_rate, o), cross(w, cross(w, o))))
    return rotate(motion.rotation, w_rate), add(rotate(motion.rotation, a_To), three(p, GRAVITY))


@law
def motor_torque(motion, w_rate, v_rate, masses, rate, acceleration, p):
    """Return the torque of the motor on the drum from the drum's balance of moments. [N m]

    Args:
        motion: `TubMotion` of the tub, or of the drum's carrier in a compliant bearing.
        w_rate, v_rate: Its accelerations, as `accelerations` returns them.
        masses, rate, acceleration, p: See `accelerations`.
    """
    a, o = three(p, AXIS), three(p, ORIGIN)
    w, w_rate = (
        rotate_back(motion.rotation, motion.angular_velocity),
        rotate_back(motion.rotation, w_rate),
    )
    w_drum, b = drum_motion(w, rate, acceleration, a)
    a_To = rotate_back(motion.rotation, subtract(v_rate, three(p, GRAVITY)))
    a_O = add(a_To, add(cross(w_rate, o), cross(w, cross(w, o))))
    turning = times(masses.drum_inertia, add(b, w_rate))
    on_drum = add(
        add(turning, cross(w_drum, times(masses.drum_inertia, w_drum))),
        cross(masses.drum_moment, a_O),
    )
    return dot(a, on_drum) + p[JOINT_DAMPING] * rate


@law
def drum_motion(w, rate, acceleration, a):
    """Return the angular velocity w_D and the angular acceleration term b of the drum, in T."""
    return add(w, scale(rate, a)), add(scale(acceleration, a), scale(rate, cross(w, a)))


@law
def state_derivative(x, dx, masses, rate, acceleration, p, elements):
    """Write the time derivative of the state into `dx`.

    Args:
        x, dx: State and its derivative; the drum's angle and rate in x are not read.
        masses, rate, acceleration, p: See `accelerations`.
        elements: `Elements`.
    """
    roll, pitch, yaw = sine_cosine(x[0]), sine_cosine(x[1]), sine_cosine(x[2])
    motion = motion_from_sines(x, 0, roll, pitch, yaw)
    zero = 0.0 * x[0]
    total = (zero, zero, zero, zero, zero, zero)
    for at in elements.springs:
        wrench, _ = spring_strut_wrench(motion, p, at)
        total = plus(total, wrench)
    for at in elements.bushings:
        wrench, _ = six_component_bushing_wrench(motion, p, at)
        total = plus(total, wrench)
    for i in range(len(elements.dampers)):
        at, k = elements.dampers[i], STATE_SIZE + i
        arm, line = friction_damper_line(motion, p, at)
        tension, dx[k] = friction_damper_tension(line[1], x[k], p, at)
        total = plus(total, friction_damper_wrench(motion, arm, line, tension, p, at))
    total = add_telescopic_dampers(
        x, dx, motion, three(p, GRAVITY), p, elements.telescopes, elements.tubes, total
    )
    bodies = motion, masses, rate, acceleration, total, p
    w_rate, v_rate = tub_and_carrier_accelerations(
        x, dx, *bodies, elements.bearing, carrier_begin(elements)
    )
    dx[0], dx[1], dx[2] = rpy_rates(motion.angular_velocity, pitch, yaw)
    dx[3], dx[4], dx[5] = motion.velocity
    dx[6] = zero + rate
    dx[7], dx[8], dx[9] = w_rate
    dx[10], dx[11], dx[12] = v_rate
    dx[13] = zero + acceleration


@law
def tub_and_carrier_accelerations(
    x, dx, motion, masses, rate, acceleration, total, p, bearing, first
):
    """Return the accelerations of the tub; write the derivative of the carrier's state, if any.

    With a rigid bearing the drum turns in the tub. With a compliant bearing it turns in a massless
    carrier, and the packed bodies are carrier and drum.

    Args:
        x, dx: State and its derivative.
        motion, masses, rate, acceleration: See `accelerations`.
        total: Moment about To and force on the tub, in W, of all elements but the bearing, without
            gravity. [N m, N]
        p: Packed numbers.
        bearing: Index in them where the bearing begins; None for a rigid one. It is an argument of
            its own, so that the function is compiled without the branch that is not taken.
        first: Index in the state where the carrier begins.
    """
    if bearing is None:
        return accelerations(motion, masses, rate, acceleration, total, p)
    carrier = carrier_motion(x, dx, first)
    on_tub, on_carrier, _ = drum_bearing_forces(motion, carrier, p, bearing + TUB_SIZE)
    w_rate, v_rate = accelerations(carrier, masses, rate, acceleration, on_carrier, p)
    dx[first + 6], dx[first + 7], dx[first + 8] = w_rate
    dx[first + 9], dx[first + 10], dx[first + 11] = v_rate
    return tub_accelerations(motion, plus(total, on_tub), three(p, GRAVITY), p, bearing)


@law
def state_size(elements):
    """Return the size of the state of a machine with these elements."""
    return carrier_begin(elements) + carrier_size(elements.bearing)


@law
def rates_size(elements):
    """Return the number of accelerations in a sample."""
    return RATES_SIZE if elements.bearing is None else 2 * RATES_SIZE


@law
def write_rates(history, at, dx, elements):
    """Write the accelerations of the tub into a sample, and those of the carrier behind them.

    Each is the angular acceleration and the acceleration of the origin, in W. [rad/s^2, m/s^2]
    """
    for k in range(RATES_SIZE):
        history[at + k] = dx[7 + k]
    if elements.bearing is not None:
        first = carrier_begin(elements) + 6
        for k in range(RATES_SIZE):
            history[at + RATES_SIZE + k] = dx[first + k]


@law
def carrier_begin(elements):
    """Return the index in the state where the drum's carrier begins, if there is one."""
    return elements.tubes + TUBES_STATE_SIZE * telescopic_damper_count(elements.telescopes)
