"""Symmetric 3x3 matrices as six numbers (xx, yy, zz, xy, xz, yz), vectors, linear equations."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sqrt

SWEEPS = 12
"""Sweeps of Jacobi's rotations; six suffice for six equations."""

NEGLIGIBLE = 1e-6
"""Singular value over the largest one below which forces count as dependent on others."""


@law
def three(p, at):
    """Return three numbers as a vector."""
    return (p[at], p[at + 1], p[at + 2])


@law
def six(p, at):
    """Return six numbers as a symmetric matrix: xx, yy, zz, xy, xz, yz."""
    return (p[at], p[at + 1], p[at + 2], p[at + 3], p[at + 4], p[at + 5])


@law
def times(i, a):
    """Return the product of a symmetric matrix and a vector."""
    return (
        i[0] * a[0] + i[3] * a[1] + i[4] * a[2],
        i[3] * a[0] + i[1] * a[1] + i[5] * a[2],
        i[4] * a[0] + i[5] * a[1] + i[2] * a[2],
    )


@law
def inverse(i):
    """Return the inverse of a symmetric matrix."""
    xx, yy, zz = i[1] * i[2] - i[5] * i[5], i[0] * i[2] - i[4] * i[4], i[0] * i[1] - i[3] * i[3]
    xy, xz, yz = i[4] * i[5] - i[3] * i[2], i[3] * i[5] - i[4] * i[1], i[3] * i[4] - i[5] * i[0]
    s = 1.0 / (i[0] * xx + i[3] * xy + i[4] * xz)
    return (s * xx, s * yy, s * zz, s * xy, s * xz, s * yz)


@law
def less_square(i, a, c):
    """Return i - c a a^T."""
    return (
        i[0] - c * a[0] * a[0],
        i[1] - c * a[1] * a[1],
        i[2] - c * a[2] * a[2],
        i[3] - c * a[0] * a[1],
        i[4] - c * a[0] * a[2],
        i[5] - c * a[1] * a[2],
    )


@law
def about_centre(i, m, q):
    """Return the inertia about the centre of mass.

    Args:
        i: Inertia about another point.
        m: First moment about that point.
        q: 1/M, the inverse of the mass.
    """
    return (
        i[0] - q * (m[1] * m[1] + m[2] * m[2]),
        i[1] - q * (m[0] * m[0] + m[2] * m[2]),
        i[2] - q * (m[0] * m[0] + m[1] * m[1]),
        i[3] + q * m[0] * m[1],
        i[4] + q * m[0] * m[2],
        i[5] + q * m[1] * m[2],
    )


@law
def plus(a, b):
    """Return the sum of two wrenches."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])


@law
def scaled(s, a):
    """Return a wrench times a number."""
    return (s * a[0], s * a[1], s * a[2], s * a[3], s * a[4], s * a[5])


@law
def solve(a, b, n):
    """Solve n linear equations by elimination with pivots; return whether there is a solution.

    Args:
        a: Coefficients by rows, overwritten.
        b: Right side; the solution is written into it.
    """
    for i in range(n):
        pivot = i
        for k in range(i + 1, n):
            if abs(a[n * k + i]) > abs(a[n * pivot + i]):
                pivot = k
        if not abs(a[n * pivot + i]) > 0.0:
            return False
        for j in range(n):
            a[n * i + j], a[n * pivot + j] = a[n * pivot + j], a[n * i + j]
        b[i], b[pivot] = b[pivot], b[i]
        for k in range(i + 1, n):
            factor = a[n * k + i] / a[n * i + i]
            for j in range(i, n):
                a[n * k + j] = a[n * k + j] - factor * a[n * i + j]
            b[k] = b[k] - factor * b[i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] = b[i] - a[n * i + j] * b[j]
        b[i] = b[i] / a[n * i + i]
    return True


@law
def solve_least(a, b, n, axes):
    """Solve n linear equations as well as possible, with the smallest solution that does.

    Args:
        a: Coefficients by rows, symmetric, without negative eigenvalues; overwritten.
        b: Right side; the solution is written into it.
        axes: (n n,) to work in.
    """
    diagonalise(a, axes, n)
    largest = 0.0
    for k in range(n):
        largest = max(largest, a[n * k + k])
    for k in range(n):
        along = 0.0
        for i in range(n):
            along = along + axes[n * i + k] * b[i]
        known = a[n * k + k] > NEGLIGIBLE * NEGLIGIBLE * largest
        a[n * k + k] = along / a[n * k + k] if known else 0.0
    for i in range(n):
        b[i] = 0.0
        for k in range(n):
            b[i] = b[i] + axes[n * i + k] * a[n * k + k]


@law
def diagonalise(a, axes, n):
    """Turn a symmetric matrix into its eigenvalues, by Jacobi's rotations.

    Args:
        a: (n n,) by rows; the eigenvalues are written on its diagonal.
        axes: (n n,) eigenvectors, one in each column, written.
    """
    for k in range(n * n):
        axes[k] = 1.0 if k % (n + 1) == 0 else 0.0
    for _ in range(SWEEPS):
        for i in range(n - 1):
            for j in range(i + 1, n):
                if a[n * i + j] != 0.0:
                    ratio = (a[n * j + j] - a[n * i + i]) / (2.0 * a[n * i + j])
                    size = abs(ratio) + sqrt(1.0 + ratio * ratio)
                    tangent = (1.0 if ratio >= 0.0 else -1.0) / size
                    cosine = 1.0 / sqrt(1.0 + tangent * tangent)
                    for k in range(n):
                        turn(a, n * k + i, n * k + j, cosine, tangent * cosine)
                        turn(axes, n * k + i, n * k + j, cosine, tangent * cosine)
                    for k in range(n):
                        turn(a, n * i + k, n * j + k, cosine, tangent * cosine)


@law
def turn(a, i, j, cosine, sine):
    """Turn the numbers i and j of an array by an angle."""
    first, second = a[i], a[j]
    a[i] = cosine * first - sine * second
    a[j] = sine * first + cosine * second
