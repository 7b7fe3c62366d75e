"""Vectors of three and rotations of nine scalars, as tuples.

Compiled, they stay in registers; interpreted, they take any kind of scalar.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import angle_of, anywhere, sine_cosine, sqrt, where


@law
def dot(a, b):
    """Return the scalar product of a and b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@law
def cross(a, b):
    """Return the vector product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@law
def add(a, b):
    """Return the sum a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@law
def subtract(a, b):
    """Return the difference a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@law
def scale(s, a):
    """Return the scalar s times the vector a."""
    return (s * a[0], s * a[1], s * a[2])


@law
def rotate(r, a):
    """Return R a, with R given by rows."""
    return (
        r[0] * a[0] + r[1] * a[1] + r[2] * a[2],
        r[3] * a[0] + r[4] * a[1] + r[5] * a[2],
        r[6] * a[0] + r[7] * a[1] + r[8] * a[2],
    )


@law
def rotate_back(r, a):
    """Return R^T a, with R given by rows."""
    return (
        r[0] * a[0] + r[3] * a[1] + r[6] * a[2],
        r[1] * a[0] + r[4] * a[1] + r[7] * a[2],
        r[2] * a[0] + r[5] * a[1] + r[8] * a[2],
    )


@law
def compose(a, b):
    """Return the rotation A B, by rows."""
    c0 = rotate(a, (b[0], b[3], b[6]))
    c1 = rotate(a, (b[1], b[4], b[7]))
    c2 = rotate(a, (b[2], b[5], b[8]))
    return (c0[0], c1[0], c2[0], c0[1], c1[1], c2[1], c0[2], c1[2], c2[2])


@law
def transpose(r):
    """Return R^T, by rows."""
    return (r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8])


@law
def rotation_from_rpy(roll, pitch, yaw):
    """Return the rotation R_WT of space-fixed roll, pitch, yaw. [rad]

    R = Rz(yaw) Ry(pitch) Rx(roll), the 3-2-1 Euler angles of [B].
    """
    return rotation_from_sines(sine_cosine(roll), sine_cosine(pitch), sine_cosine(yaw))


@law
def rotation_from_sines(roll, pitch, yaw):
    """Return the rotation of `rotation_from_rpy` from sine and cosine of each angle."""
    sr, cr = roll
    sp, cp = pitch
    sy, cy = yaw
    return (
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )


@law
def angle_over_sine(sine_squared, cosine):
    """Return theta / sin(theta) for 0 <= theta < pi, from sin^2 and cos; it is smooth at zero.

    The series of the arcsine is used up to sin^2 = 1e-2, where its next term is below 1e-17.
    """
    s = sine_squared
    # terms of even and of odd power apart: two short chains of operations instead of a long one
    y = s * s
    even = 1.0 + y * (3.0 / 40.0 + y * (35.0 / 1152.0 + y * (231.0 / 13312.0)))
    odd = 1.0 / 6.0 + y * (5.0 / 112.0 + y * (63.0 / 2816.0 + y * (143.0 / 10240.0)))
    ratio = even + s * odd
    large = (s >= 1e-2) | (cosine <= 0.0)
    if anywhere(large):
        sine = sqrt(s)
        ratio = where(large, angle_of(sine, cosine) / sine, ratio)
    return ratio


@law
def rotation_vector(r):
    """Return the rotation vector (axis times angle) of R, by rows, for angles below pi. [rad]"""
    sines = (0.5 * (r[7] - r[5]), 0.5 * (r[2] - r[6]), 0.5 * (r[3] - r[1]))
    cosine = 0.5 * (r[0] + r[4] + r[8] - 1.0)
    return scale(angle_over_sine(dot(sines, sines), cosine), sines)


@law
def rotation_vector_coefficient(angle_squared):
    """Return the coefficient of r x (r x .) in the rate of the rotation vector r.

        k = (1 - (theta/2) cot(theta/2)) / theta^2

    Below 0.1 rad its series 1/12 + theta^2/720 + ... is used, which is exact to 1e-13 there.
    """
    s = angle_squared
    coefficient = 1.0 / 12.0 + s * (1.0 / 720.0 + s * (1.0 / 30240.0 + s * (1.0 / 1209600.0)))
    large = s >= 1e-2
    if anywhere(large):
        half = 0.5 * sqrt(s)
        sine, cosine = sine_cosine(half)
        coefficient = where(large, (1.0 - half * cosine / sine) / s, coefficient)
    return coefficient


@law
def rotation_vector_rate(r, w, coefficient):
    """Return the rate of the rotation vector r of a frame with angular velocity w. [rad/s]

    Both are expressed in the fixed frame (Bortz equation); k is `rotation_vector_coefficient`:

        r' = w - (r x w)/2 + k r x (r x w)
    """
    rxw = cross(r, w)
    return add(add(w, scale(-0.5, rxw)), scale(coefficient, cross(r, rxw)))


@law
def moment_from_rotation_vector(r, tau, coefficient):
    """Return the moment m with m . w = tau . r' for every angular velocity w. [N m]

    It does on w the work that tau does on r'; the map is the transpose of `rotation_vector_rate`:

        m = tau + (r x tau)/2 + k r x (r x tau)
    """
    rxt = cross(r, tau)
    return add(add(tau, scale(0.5, rxt)), scale(coefficient, cross(r, rxt)))
