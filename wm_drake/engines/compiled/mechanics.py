"""Rigid-body mechanics of the compiled engine: a tub that floats, with a drum turning in it as prescribed.

Own derivation; the Drake plant is its oracle (tests/kernel). All in the tub frame T, moments about a point O of the drum axis:

    M a_O + w' x S + w x (w x S_t) + b x s_d + w_D x (w_D x s_d)          = F
    S x a_O + I w' + w x (I_t w) + J_d b + w_D x (J_d w_D)                = tau
    w_D = w + rate a,    b = acceleration a + rate (w x a),    S = S_t + s_d,    I = I_t + J_d

M: total mass; S_t, s_d: first moments of tub group and drum about O; I_t, J_d: their inertias about O; a: unit vector of the
axis, along the drum's rotation against the tub. Drum quantities follow the drum angle exactly: those of a body that
turns about a fixed axis hold the angle's first and second harmonic and no other.

Packed numbers of the bodies, from index 0 (`wm_drake.engines.compiled.packing`): gravity vector in W [m/s^2]; 1/M [1/kg]; a; position of
O from To [m]; S_t [kg m]; I_t as xx, yy, zz, xy, xz, yz [kg m^2]; s_d, three times its mean, cosine and sine part; J_d, six
times its mean, cosine, sine, double cosine and double sine part; damping of the drum joint [N m s/rad].
"""

from collections import namedtuple

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import anywhere
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
from wm_drake.engines.compiled.side_by_side import (
    deformation_at,
    sines_of_angles,
    together,
    write_rate,
)
from wm_drake.engines.compiled.tubes import TUBES_STATE_SIZE, count_of, with_telescopes

GRAVITY, INVERSE_MASS, AXIS, ORIGIN = 0, 3, 4, 7
TUB_MOMENT, TUB_INERTIA, DRUM_MOMENT, DRUM_INERTIA = 10, 13, 19, 28
JOINT_DAMPING, BODIES_SIZE = 58, 59
LINE_SIZE = 13
"""Numbers kept of a damper between the rounds of `state_derivative`."""
STATE_SIZE = PLANT_STATE_SIZE
"""The state of tub and drum comes first; then deformations of the strut dampers, what `kernel.tubes` says, and
`kernel.bearing`."""
DRUM_RATE = 13
"""Where the state has it."""
RATES_SIZE = 6
"""Accelerations of a body that samples keep."""

Elements = namedtuple(
    "Elements", ("springs", "dampers", "deformations", "bushings", "telescopes", "bearing", "tubes")
)
"""Of a machine: indices where the packed numbers of each spring, damper, bushing and telescopic damper begin, arrays, the last
None without any; of the deformation of each damper in the state (array); where the bearing's numbers begin, None where the drum
turns in a perfect joint; where the states of the telescopic dampers' tubes begin in the state."""

MassProperties = namedtuple(
    "MassProperties", ("drum_moment", "drum_inertia", "moment", "inverse_inertia")
)
"""At one drum angle: s_d, J_d, S, and the inverse of the inertia about the common centre of mass."""


@law
def first_harmonic(p, at, c, s):
    """mean + cosine part c + sine part s."""
    return p[at] + p[at + 1] * c + p[at + 2] * s


@law
def second_harmonic(p, at, c, s):
    """The same with the parts of the double angle."""
    return first_harmonic(p, at, c, s) + p[at + 3] * (c * c - s * s) + p[at + 4] * (2.0 * c * s)


@law
def mass_properties(p, c, s):
    """Mass properties at a drum angle of cosine c and sine s."""
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
    """Accelerations of tub and torque of the motor under a wrench.

    Args:
        motion: `TubMotion`.
        masses: `MassProperties` at the drum angle.
        rate, acceleration: Of the drum against the tub. [rad/s, rad/s^2]
        wrench: Moment about To and force of all elements on the tub, in W, without gravity. [N m, N]
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
    # gravity accelerates all alike: it turns nothing, and comes in at the end
    w_rate = times(masses.inverse_inertia, subtract(moment, scale(q, cross(masses.moment, force))))
    a_O = scale(q, subtract(force, cross(w_rate, masses.moment)))
    a_To = a_O
    if apart:
        a_To = subtract(a_O, add(cross(w_rate, o), cross(w, cross(w, o))))
    return rotate(motion.rotation, w_rate), add(rotate(motion.rotation, a_To), three(p, GRAVITY))


@law
def motor_torque(motion, w_rate, v_rate, masses, rate, acceleration, p):
    """Torque of the motor on the drum: its balance of moments about the axis. [N m]

    Args:
        motion: `TubMotion` of the tub, or of the drum's carrier in a bearing that gives.
        w_rate, v_rate: What `accelerations` answers for it.
        masses, rate, acceleration, p: As there.
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
    """w_D and b of the drum; all in T."""
    return add(w, scale(rate, a)), add(scale(acceleration, a), scale(rate, cross(w, a)))


@law
def state_derivative(x, dx, masses, rate, acceleration, p, struts, elements, scratch):
    """Writes the derivative of the state into `dx`.

    Args:
        x, dx: State and its derivative, laid out as `STATE_SIZE` says; x[6] and x[13] are not read.
        masses, rate, acceleration, p: As for `accelerations`.
        struts: Array that holds the packed numbers of springs and dampers: p itself, or what
            `wm_drake.engines.compiled.side_by_side` made of them.
        elements: `Elements`, springs and dampers in `struts`, all others in p.
        scratch: At least `LINE_SIZE` entries a damper to work in, of the kind of `struts`.
    """
    springs, dampers, deformations, bushings, telescopes, bearing, tubes = elements
    roll, pitch, yaw = sines_of_angles(x)
    motion = motion_from_sines(x, 0, roll, pitch, yaw)
    zero = 0.0 * x[0]
    total = (zero, zero, zero, zero, zero, zero)
    # dampers in rounds, the last behind all else: each is a long chain of roots and quotients, which the processor overlaps
    # with what stands between (a quarter of the time of one machine alone)
    for i in range(len(dampers)):
        write_line(scratch, LINE_SIZE * i, *friction_damper_line(motion, struts, dampers[i]))
    for i in range(len(dampers)):
        deformation = deformation_at(x, deformations[i], struts)
        tension, its_rate = friction_damper_tension(
            scratch[LINE_SIZE * i + 4], deformation, struts, dampers[i]
        )
        scratch[LINE_SIZE * i + 12] = tension
        write_rate(dx, deformations[i], its_rate)
    for at in springs:
        wrench, _ = spring_strut_wrench(motion, struts, at)
        total = plus(total, together(wrench, struts, at))
    for i in range(len(bushings)):
        wrench, _ = six_component_bushing_wrench(motion, p, bushings[i])
        total = plus(total, wrench)
    for i in range(len(dampers)):
        arm, line = read_line(scratch, LINE_SIZE * i)
        wrench = friction_damper_wrench(
            motion, arm, line, scratch[LINE_SIZE * i + 12], struts, dampers[i]
        )
        total = plus(total, together(wrench, struts, dampers[i]))
    gravity = three(p, GRAVITY)
    total = with_telescopes(x, dx, motion, gravity, p, telescopes, tubes, total)
    carrier = carrier_begin(elements)
    w_rate, v_rate = with_bearing(
        x, dx, motion, masses, rate, acceleration, total, p, bearing, carrier
    )
    dx[0], dx[1], dx[2] = rpy_rates(motion.angular_velocity, pitch, yaw)
    dx[3], dx[4], dx[5] = motion.velocity
    dx[6] = zero + rate
    dx[7], dx[8], dx[9] = w_rate
    dx[10], dx[11], dx[12] = v_rate
    dx[13] = zero + acceleration


@law
def with_bearing(x, dx, motion, masses, rate, acceleration, total, p, bearing, first):
    """As `accelerations`, of a drum in a bearing that gives if there is one; writes the derivative of its carrier's state.

    Args:
        x, dx: State and its derivative.
        motion, masses, rate, acceleration: As there. With a bearing the packed bodies are those of carrier and drum.
        total: Moment about To and force of all other elements on the tub, in W, without gravity. [N m, N]
        p: Packed numbers.
        bearing: Where those of the bearing begin (`wm_drake.engines.compiled.bearing`); None without.
        first: Where the state of the carrier begins.
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
    """How many numbers the state of a machine with these elements has."""
    return carrier_begin(elements) + carrier_size(elements.bearing)


@law
def rates_size(elements):
    """How many numbers of the derivative a sample keeps."""
    return RATES_SIZE if elements.bearing is None else 2 * RATES_SIZE


@law
def write_rates(history, at, dx, elements):
    """Keeps accelerations: angular one of the tub and that of To, in W [rad/s^2, m/s^2]; in a bearing, also the carrier's."""
    for k in range(RATES_SIZE):
        history[at + k] = dx[7 + k]
    if elements.bearing is not None:
        first = carrier_begin(elements) + 6
        for k in range(RATES_SIZE):
            history[at + RATES_SIZE + k] = dx[first + k]


@law
def carrier_begin(elements):
    """Where the state of the drum's carrier begins, if it has one."""
    return elements.tubes + TUBES_STATE_SIZE * count_of(elements.telescopes)


@law
def write_line(scratch, at, arm, line):
    """Keeps what `friction_damper_line` found, for the rounds to come."""
    length, rate, direction, v_A, inverse_length = line
    scratch[at], scratch[at + 1], scratch[at + 2] = arm
    scratch[at + 3], scratch[at + 4] = length, rate
    scratch[at + 5], scratch[at + 6], scratch[at + 7] = direction
    scratch[at + 8], scratch[at + 9], scratch[at + 10] = v_A
    scratch[at + 11] = inverse_length


@law
def read_line(scratch, at):
    """What `write_line` kept: the arm, and the line."""
    line = (
        scratch[at + 3],
        scratch[at + 4],
        three(scratch, at + 5),
        three(scratch, at + 8),
        scratch[at + 11],
    )
    return three(scratch, at), line
