"""Rigid-body mechanics of the compiled engine: a floating tub and a drum that turns in it.

The rotation of the drum is prescribed, or a motor turns it (`wm_drake.engines.compiled.drum`).

Own derivation; the tests compare it with the Drake plant. All vectors are in the tub frame T, all
moments about a point O of the drum axis:

    M a_O + w' x S + w x (w x S_t) + b x s_d + w_D x (w_D x s_d)          = F
    S x a_O + I w' + w x (I_t w) + J_d b + w_D x (J_d w_D)                = tau
    w_D = w + rate a,    b = acceleration a + rate (w x a),    S = S_t + s_d,    I = I_t + J_d

M: total mass; S_t, s_d: first moments of tub group and drum about O; I_t, J_d: their inertias about
O; a: unit vector of the axis, along the drum's rotation against the tub. The drum quantities follow
the drum angle exactly: for a body that turns about a fixed axis they contain the first and second
harmonic of the angle and no other.

The packed numbers of the bodies are those of `BODIES`, from index 0.

The order of the states is that of `wm_drake.elements.state_map`.
"""

from collections import namedtuple

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import anywhere, sine_cosine
from wm_drake.compiler.matrices import about_centre, inverse, plus, times
from wm_drake.compiler.packed import LAYOUT, SCALAR, SYMMETRIC, VECTOR, PackedLayout
from wm_drake.compiler.vectors import add, cross, dot, rotate, rotate_back, scale, subtract
from wm_drake.elements.bearing import drum_bearing_forces
from wm_drake.elements.friction_damper import (
    friction_damper_line,
    friction_damper_tension,
    friction_damper_wrench,
)
from wm_drake.elements.motion import (
    TREE_STATE,
    motion_from_sines,
    read_body_state,
    read_tree_state,
    rpy_rates,
    write_body_state,
    write_tree_state,
)
from wm_drake.elements.motor import read_motor
from wm_drake.elements.mount import add_others, torque_on_drum
from wm_drake.elements.rubber import bushing_wrench
from wm_drake.elements.spring import spring_strut_wrench
from wm_drake.elements.state_map import RATES_SIZE
from wm_drake.elements.water import write_water_rates
from wm_drake.engines.compiled.bearing import (
    carrier_motion,
    read_tub_and_bearing,
    tub_accelerations,
)
from wm_drake.engines.compiled.cabinet import seen_from_cabinet, with_cabinet, write_seen_sample
from wm_drake.engines.compiled.drum import motor_torque_and_rates, with_free_drum
from wm_drake.engines.compiled.rubber import write_branches
from wm_drake.engines.compiled.tubes import add_telescopic_dampers

FIRST_HARMONIC = PackedLayout("FirstHarmonic", mean=SCALAR, cosine=SCALAR, sine=SCALAR)
"""Parts of a function of the drum angle."""
SECOND_HARMONIC = PackedLayout(
    "SecondHarmonic",
    mean=SCALAR,
    cosine=SCALAR,
    sine=SCALAR,
    double_cosine=SCALAR,
    double_sine=SCALAR,
)
"""Parts of a function of the drum angle and of the double drum angle."""
BODIES = PackedLayout(
    "BodiesNumbers",
    gravity=VECTOR,
    inverse_mass=SCALAR,
    axis=VECTOR,
    origin=VECTOR,
    tub_moment=VECTOR,
    tub_inertia=SYMMETRIC,
    drum_moment_x=LAYOUT(FIRST_HARMONIC),
    drum_moment_y=LAYOUT(FIRST_HARMONIC),
    drum_moment_z=LAYOUT(FIRST_HARMONIC),
    drum_inertia_xx=LAYOUT(SECOND_HARMONIC),
    drum_inertia_yy=LAYOUT(SECOND_HARMONIC),
    drum_inertia_zz=LAYOUT(SECOND_HARMONIC),
    drum_inertia_xy=LAYOUT(SECOND_HARMONIC),
    drum_inertia_xz=LAYOUT(SECOND_HARMONIC),
    drum_inertia_yz=LAYOUT(SECOND_HARMONIC),
    joint_damping=SCALAR,
)
"""Packed bodies: gravity in W [m/s^2]; 1/M [1/kg]; a; position of O from To [m]; S_t [kg m]; I_t
[kg m^2]; s_d [kg m]; J_d [kg m^2]; damping of the drum joint [N m s/rad]."""
BODIES_SIZE = BODIES.fixed_size
STATE_SIZE = TREE_STATE.fixed_size
"""Size of the part of the state that belongs to tub and drum."""
DRUM_ANGLE, DRUM_RATE = TREE_STATE.offsets["joint_position"], TREE_STATE.offsets["joint_rate"]
"""Indices of the drum's angle and rate in the state."""
RATES = PackedLayout("Rates", angular_acceleration=VECTOR, acceleration=VECTOR)
"""Accelerations of a body in a sample: angular, and of its origin, in W. [rad/s^2, m/s^2]"""
assert RATES.fixed_size == RATES_SIZE

read_first_harmonic, read_second_harmonic = FIRST_HARMONIC.read, SECOND_HARMONIC.read
read_bodies, read_rates, write_rates_of = BODIES.read, RATES.read, RATES.write

Elements = namedtuple("Elements", "mounts begins tubes bearing motor cabinet water inner")
"""Indices at which the parts of a machine begin in the packed numbers.

mounts: `Mounts`; begins: `Begins`, indices in the state; tubes: array of indices of the bodies of
telescopic dampers (`TUBES`), None if there are none; bearing: index of the drum's bearing, None if
it is rigid; motor: index of the motor, None if the speed of the drum is prescribed; cabinet: index
of the cabinet, None if it is fixed; water: `Water`, None for a load that stays; inner:
`InnerVelocities` of elements, None without any.
"""

MassProperties = namedtuple(
    "MassProperties", ("drum_moment", "drum_inertia", "moment", "inverse_inertia")
)
"""s_d, J_d, S and the inverse of the inertia about the common centre of mass, at a drum angle."""


@law
def first_harmonic(c, s, p, at):
    """Return a function of the drum angle, whose parts begin at `at`; c, s: cosine and sine."""
    part = read_first_harmonic(p, at)
    return part.mean + part.cosine * c + part.sine * s


@law
def second_harmonic(c, s, p, at):
    """Return a function of drum angle and double drum angle; arguments as `first_harmonic`."""
    part = read_second_harmonic(p, at)
    first = part.mean + part.cosine * c + part.sine * s
    return first + part.double_cosine * (c * c - s * s) + part.double_sine * (2.0 * c * s)


@law
def mass_properties(p, c, s):
    """Return the `MassProperties` at a drum angle of cosine c and sine s."""
    bodies = read_bodies(p, 0)
    drum = (
        first_harmonic(c, s, *bodies.drum_moment_x),
        first_harmonic(c, s, *bodies.drum_moment_y),
        first_harmonic(c, s, *bodies.drum_moment_z),
    )
    j = (
        second_harmonic(c, s, *bodies.drum_inertia_xx),
        second_harmonic(c, s, *bodies.drum_inertia_yy),
        second_harmonic(c, s, *bodies.drum_inertia_zz),
        second_harmonic(c, s, *bodies.drum_inertia_xy),
        second_harmonic(c, s, *bodies.drum_inertia_xz),
        second_harmonic(c, s, *bodies.drum_inertia_yz),
    )
    t, q = bodies.tub_inertia, bodies.inverse_mass
    m = add(bodies.tub_moment, drum)
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
    bodies = read_bodies(p, 0)
    a, o, q = bodies.axis, bodies.origin, bodies.inverse_mass
    applied = rotate_back(motion.rotation, (wrench[3], wrench[4], wrench[5]))
    moment = rotate_back(motion.rotation, (wrench[0], wrench[1], wrench[2]))
    apart = anywhere((abs(o[0]) > 0.0) | (abs(o[1]) > 0.0) | (abs(o[2]) > 0.0))
    if apart:
        moment = subtract(moment, cross(o, applied))
    w = rotate_back(motion.rotation, motion.angular_velocity)
    w_drum, b = drum_motion(w, rate, acceleration, a)
    drum_flow = add(cross(b, masses.drum_moment), cross(w_drum, cross(w_drum, masses.drum_moment)))
    force = subtract(applied, add(cross(w, cross(w, bodies.tub_moment)), drum_flow))
    gyration = add(times(masses.drum_inertia, b), cross(w_drum, times(masses.drum_inertia, w_drum)))
    moment = subtract(moment, add(cross(w, times(bodies.tub_inertia, w)), gyration))
    # gravity accelerates all bodies equally: it has no moment and is added at the end
    w_rate = times(masses.inverse_inertia, subtract(moment, scale(q, cross(masses.moment, force))))
    a_O = scale(q, subtract(force, cross(w_rate, masses.moment)))
    a_To = a_O
    if apart:
        a_To = subtract(a_O, add(cross(w_rate, o), cross(w, cross(w, o))))
    return rotate(motion.rotation, w_rate), add(rotate(motion.rotation, a_To), bodies.gravity)


@law
def motor_torque(motion, w_rate, v_rate, masses, rate, acceleration, p):
    """Return the torque of the motor on the drum from the drum's balance of moments. [N m]

    Args:
        motion: `TubMotion` of the tub, or of the drum's carrier in a compliant bearing.
        w_rate, v_rate: Its accelerations, as `accelerations` returns them.
        masses, rate, acceleration, p: See `accelerations`.
    """
    bodies = read_bodies(p, 0)
    a, o = bodies.axis, bodies.origin
    w, w_rate = (
        rotate_back(motion.rotation, motion.angular_velocity),
        rotate_back(motion.rotation, w_rate),
    )
    w_drum, b = drum_motion(w, rate, acceleration, a)
    a_To = rotate_back(motion.rotation, subtract(v_rate, bodies.gravity))
    a_O = add(a_To, add(cross(w_rate, o), cross(w, cross(w, o))))
    turning = times(masses.drum_inertia, add(b, w_rate))
    on_drum = add(
        add(turning, cross(w_drum, times(masses.drum_inertia, w_drum))),
        cross(masses.drum_moment, a_O),
    )
    return dot(a, on_drum) + bodies.joint_damping * rate


@law
def drum_motion(w, rate, acceleration, a):
    """Return the angular velocity w_D and the angular acceleration term b of the drum, in T."""
    return add(w, scale(rate, a)), add(scale(acceleration, a), scale(rate, cross(w, a)))


@law
def state_derivative(x, dx, inputs, masses, rate, acceleration, p, elements):
    """Write the time derivative of the state into `dx`.

    Args:
        x, dx: State and its derivative; a prescribed drum's angle and rate in x are not read.
        inputs: Elongation rate of each strut damper, then the rates of the six axes of each
            bushing of rubber, then the wrench of the mounts on a cabinet that moves, written. The
            deformation of a sponge, the stretches of branches and the cabinet depend on the other
            parts through these numbers only. [m/s, rad/s, N m, N]
        masses, rate, acceleration, p: See `accelerations`. With a motor, the prescribed rate is the
            one that the controller wants, and the other two are not used.
        elements: `Elements`.
    """
    motor, reference = elements.motor, rate
    mounts, begins = elements.mounts, elements.begins
    masses, rate = drum_now(x, masses, rate, p, motor)
    angles = read_tree_state(x, 0).angles
    roll, pitch, yaw = sine_cosine(angles[0]), sine_cosine(angles[1]), sine_cosine(angles[2])
    in_world = motion_from_sines(x, 0, roll, pitch, yaw)
    cabinet, first = elements.cabinet, begins.cabinet
    motion = seen_from_cabinet(x, in_world, cabinet, first)
    zero = 0.0 * angles[0]
    total = (zero, zero, zero, zero, zero, zero)
    for at in mounts.springs:
        wrench, _ = spring_strut_wrench(motion, p, at)
        total = plus(total, wrench)
    for at in mounts.bushings:
        wrench, _ = bushing_wrench(motion, p, at, x, mounts.branches)
        total = plus(total, wrench)
    write_branches(x, dx, inputs, begins.stretch_inputs, motion, p, mounts.branches)
    for i in range(len(mounts.dampers)):
        at, k = mounts.dampers[i], begins.sponges + i
        arm, line = friction_damper_line(motion, p, at)
        inputs[i] = line[1]
        tension, dx[k] = friction_damper_tension(line[1], x[k], p, at)
        total = plus(total, friction_damper_wrench(motion, arm, line, tension, p, at))
    gravity = read_bodies(p, 0).gravity
    total = add_telescopic_dampers(x, dx, motion, gravity, p, elements.tubes, mounts, total)
    total = add_others(x, dx, motion, p, mounts.others, total)
    write_water_rates(x, dx, rate, p, elements.water, begins.water)
    wrench_input = begins.wrench_input
    total = with_cabinet(x, dx, inputs, wrench_input, in_world, total, gravity, p, cabinet, first)
    bodies = in_world, masses, rate, acceleration, total, p
    w_rate, v_rate = tub_and_carrier_accelerations(x, dx, *bodies, elements.bearing, begins.carrier)
    w_rate, v_rate, acceleration = turned_by_motor(
        x, dx, in_world, masses, (w_rate, v_rate, acceleration), reference, p, motor,
        begins.motor, mounts.others
    )  # fmt: skip
    write_tree_state(
        dx,
        0,
        angles=rpy_rates(in_world.angular_velocity, pitch, yaw),
        position=in_world.velocity,
        joint_position=zero + rate,
        angular_velocity=w_rate,
        velocity=v_rate,
        joint_rate=zero + acceleration,
    )


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
    numbers, gravity = read_tub_and_bearing(p, bearing), read_bodies(p, 0).gravity
    carrier, angle_rates = carrier_motion(x, first)
    on_tub, on_carrier, _ = drum_bearing_forces(motion, carrier, *numbers.bearing)
    w_rate, v_rate = accelerations(carrier, masses, rate, acceleration, on_carrier, p)
    write_body_state(dx, first, angle_rates, carrier.velocity, w_rate, v_rate)
    return tub_accelerations(motion, plus(total, on_tub), gravity, *numbers.tub)


@law
def drum_now(x, masses, rate, p, motor):
    """Return `MassProperties` and rate of the drum: those given, or those of the state.

    Args:
        x: State.
        masses, rate: Those of a prescribed drum.
        p: Packed numbers.
        motor: Index in them where the motor begins; None for a prescribed drum.
    """
    if motor is None:
        return masses, rate
    sine, cosine = sine_cosine(x[DRUM_ANGLE])
    return mass_properties(p, cosine, sine), x[DRUM_RATE]


@law
def turned_by_motor(x, dx, motion, masses, rates, reference, p, motor, first, others):
    """Return the accelerations of tub and drum, and write the rates of the drive's state.

    Args:
        x, dx: State and its derivative.
        motion, masses: See `accelerations`.
        rates: Angular acceleration of the tub and acceleration of To, in W, at an acceleration of
            the drum, and this acceleration. It stays if there is no motor. [rad/s^2, m/s^2]
        reference: Speed of the drum that is wanted. [rad/s]
        p, motor, first: Packed numbers, and indices in them and in the state where the drive
            begins; None if the rotation of the drum is prescribed.
        others: `RegisteredLaws`, some of them on the drum; None without.
    """
    w_rate, v_rate, acceleration = rates
    if motor is None:
        return w_rate, v_rate, acceleration
    bodies, reflected = read_bodies(p, 0), read_motor(p, motor).reflected_inertia
    torque = motor_torque_and_rates(x, dx, reference, p, motor, first)
    torque = torque + torque_on_drum(x, motion, p, others)
    missing = torque - motor_torque(motion, w_rate, v_rate, masses, x[DRUM_RATE], acceleration, p)
    return with_free_drum(motion, masses, bodies, w_rate, v_rate, acceleration, missing, reflected)


@law
def follow_profile(x, angle, rate, motor):
    """Set angle and rate of a drum whose speed is prescribed; a motor turns it itself."""
    if motor is None:
        x[DRUM_ANGLE] = angle
        x[DRUM_RATE] = rate


@law
def target_speed(x, reference, motor):
    """Return the speed that the controller wants; without a motor it is the drum's own."""
    if motor is None:
        return x[DRUM_RATE]
    return reference


@law
def write_sample(history, number, x, dx, elements):
    """Write a sample: the state, then the `RATES` of tub, drum's carrier and cabinet, if any.

    The tub is that seen from the cabinet, so that displacements and forces follow from it alone.
    """
    begins = elements.begins
    size = begins.size
    at = number * (size + begins.rates)
    for k in range(size):
        history[at + k] = x[k]
    write_rates(history, at + size, dx, elements)
    rates = at + size, at + size + begins.rates - RATES_SIZE
    write_seen_sample(history, at, x, dx, elements.cabinet, begins.cabinet, rates)


@law
def write_rates(history, at, dx, elements):
    """Write the `RATES` of the tub into a sample, and those of the carrier behind them."""
    tub = read_tree_state(dx, 0)
    write_rates_of(history, at, tub.angular_velocity, tub.velocity)
    if elements.bearing is not None:
        carrier = read_body_state(dx, elements.begins.carrier)
        write_rates_of(history, at + RATES_SIZE, carrier.angular_velocity, carrier.velocity)
