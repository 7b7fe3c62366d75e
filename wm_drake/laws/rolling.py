"""Rolling resistance of a ball that may park: friction with a bristle, and Coulomb's beyond."""

from wm_drake.compiler.compilation import law


@law
def rolling_resistance(normal_force, velocity, bristle, coefficient, full_velocity):
    """Return the rolling resistance of a ball on its race.

        f = -mu N (v_t z + v) / (v_t + |v|)      own blend of Dahl (1968) and Coulomb

    A ball that creeps, |v| << v_t, hangs on a bristle: f = -mu N z, z between -1 and 1, so that a
    smaller force than mu N parks it. A ball that rolls fast, |v| >> v_t, meets -mu N sgn(v). With N
    constant the element gives back at most what the bristle stores, mu N x_c z^2 / 2.

    That rolling friction stops balls beside their places is stated for balancers of optical disk
    drives (abstract, ASME TRIB2004, p. 795) and in Efficiency Improvement of an Automatic Ball
    Balancer, Journal of Vibration and Acoustics 134 (2012) 021012 (abstract).

    Args:
        normal_force: N, >= 0. [N]
        velocity: v of the ball against the race. [m/s]
        bristle: z, state of `rolling_bristle_rate`.
        coefficient: mu, rolling resistance over normal force, >= 0.
        full_velocity: v_t, > 0. [m/s]

    Returns:
        Force on the ball along the race. [N]
    """
    share = (full_velocity * bristle + velocity) / (full_velocity + abs(velocity))
    return -coefficient * normal_force * share


@law
def rolling_bristle_rate(velocity, bristle, distance, full_velocity):
    """Return the rate of the bristle of `rolling_resistance`.

        z' = (v - |v| z) v_t / (x_c (v_t + |v|))      Dahl (1968), exponent 1, for |v| << v_t

    The rate stays below v_t / x_c, so that a fast ball needs no short step.

    Args:
        velocity, bristle, full_velocity: As for `rolling_resistance`.
        distance: x_c, way after which the resistance is 63 % of its full value, > 0. [m]
    """
    share = full_velocity / (distance * (full_velocity + abs(velocity)))
    return share * (velocity - abs(velocity) * bristle)
