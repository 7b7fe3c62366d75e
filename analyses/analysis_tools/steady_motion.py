"""Steady motion of a tub over the speed of its drum by equivalent linearisation, compiled.

The tub is linear about its state of rest but for friction. A friction damper under a harmonic
motion of amplitude X has the complex stiffness Z(X, w) of the fundamental of its force, and the
friction of the bushings at its ends a damping c(R) at a rate of amplitude R:

    (K - w^2 M + i w (C + w G + sum_e c(R_e) B_e' B_e) + sum_d Z(X_d, w) a_d a_d') q = f(w)

Own derivation; harmonic balance with one harmonic. X_d and R_e follow from q by iteration.
"""

from typing import NamedTuple

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.elements.damper_law import damper_response
from wm_drake.laws.friction import havsin_friction
from wm_drake.parameters.types import FloatArray

STEPS = 64
"""Steps of a period of a damper; the second period is the steady one."""

ITERATIONS = 3
"""Iterations of the amplitudes at a speed, which begin at those of the speed before."""

KEPT = 0.3
"""Part of an amplitude that is kept in an iteration, so that it settles."""


class Tub(NamedTuple):
    """Linear part of a machine. Coordinates are rotations and displacements of To. [rad, m]

    Attributes:
        mass: M with each load, mean over a revolution. (load, 6, 6)
        stiffness, damping, gyroscopic: K, C and G. (6, 6)
        dampers: Elongation of each damper by the coordinates, a. (d, 6)
        ends: Angle of each end bushing of the dampers by the coordinates, B. (e, 3, 6)
    """

    mass: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    gyroscopic: FloatArray
    dampers: FloatArray
    ends: FloatArray


class Friction(NamedTuple):
    """Tables of the dampers, which all have one law.

    Attributes:
        amplitude: Amplitudes of the elongation, in equal ratios. (a,) [m]
        speed: Angular frequencies. (s,) [rad/s]
        stiffness: Z. (a, s) complex [N/m]
        rate: Amplitudes of the rate of an end bushing, in equal ratios. (r,) [rad/s]
        damping: c. (r,) [N m s/rad]
    """

    amplitude: FloatArray
    speed: FloatArray
    stiffness: FloatArray
    rate: FloatArray
    damping: FloatArray


class Cases(NamedTuple):
    """Cases whose motions are computed.

    Attributes:
        load: Index of the load. (case,)
        stiffness, damping: What the gasket adds to K and C. (case, 6, 6)
        force: Generalized force of each load. (load, speed, 6) complex [N m, N]
        speed: Rising speeds of the drum. (speed,) [rad/s]
    """

    load: np.ndarray
    stiffness: FloatArray
    damping: FloatArray
    force: FloatArray
    speed: FloatArray


@long_running
def damper_stiffness(law, amplitude, speed, stiffness):
    """Write the complex stiffness of a damper under harmonic motions.

    The sponge is massless: its deformation is integrated by steps that are exact for a linear law,
    so that stiff ones need no shorter steps.

    Args:
        law: Packed law.
        amplitude, speed: Amplitudes (a,) and angular frequencies (s,). [m, rad/s]
        stiffness: Written. (a, s) complex [N/m]
    """
    moved = 1e-9
    for k in range(len(speed)):
        step = 2.0 * np.pi / speed[k] / STEPS
        for j in range(len(amplitude)):
            deformation, in_phase, ahead = 0.0, 0.0, 0.0
            for n in range(2 * STEPS):
                angle = 2.0 * np.pi * (n + 0.5) / STEPS
                rate = amplitude[j] * speed[k] * np.cos(angle)
                tension, change = damper_response(rate, deformation, law, 0)
                _, near = damper_response(rate, deformation + moved, law, 0)
                slope = step * (near - change) / moved
                half = np.expm1(0.5 * slope) / slope if abs(slope) > 1e-6 else 0.5
                whole = np.expm1(slope) / slope if abs(slope) > 1e-6 else 1.0
                middle = deformation + half * step * change
                tension, _ = damper_response(rate, middle, law, 0)
                deformation += whole * step * change
                if n >= STEPS:
                    in_phase += tension * np.sin(angle)
                    ahead += tension * np.cos(angle)
            scale = 2.0 / STEPS / amplitude[j]
            stiffness[j, k] = complex(scale * in_phase, scale * ahead)


@long_running
def bushing_damping(rate, full_rate, torque, damping):
    """Write the damping of smoothed friction under harmonic motions with rates of amplitudes (r,).

    Args:
        rate: Amplitudes of the rate. [rad/s]
        full_rate, torque: Rate from which on friction is full, and its torque. [rad/s, N m]
        damping: Written. (r,) [N m s/rad]
    """
    for j in range(len(rate)):
        damping[j] = 0.0
        for n in range(STEPS):
            c = np.cos(2.0 * np.pi * (n + 0.5) / STEPS)
            damping[j] -= 2.0 / STEPS * c * havsin_friction(c * rate[j], full_rate, torque)
        damping[j] /= rate[j]


@long_running
def place_in(grid, value):
    """Return index and weight of a value between points in equal ratios; the ends are held."""
    at = np.log(value / grid[0]) / np.log(grid[1] / grid[0])
    at = min(max(at, 0.0), len(grid) - 1.000001)
    index = int(at)
    return index, at - index


@long_running
def stiffness_in(friction, size, w):
    """Return the complex stiffness of a damper, between the points of its table. [N/m]"""
    row, along = place_in(friction.amplitude, size)
    column = max(1, min(np.searchsorted(friction.speed, w), len(friction.speed) - 1))
    low, high = friction.speed[column - 1], friction.speed[column]
    part = min(max((w - low) / (high - low), 0.0), 1.0)
    z = friction.stiffness
    below = (1.0 - along) * z[row, column - 1] + along * z[row + 1, column - 1]
    above = (1.0 - along) * z[row, column] + along * z[row + 1, column]
    return (1.0 - part) * below + part * above


@long_running
def steady_motions(tub, friction, cases, motions):
    """Write the complex amplitudes of the coordinates of all cases. (case, speed, 6) [rad, m]

    Args:
        tub, friction, cases: `Tub`, `Friction` and `Cases`.
        motions: Written; NaN where a system is singular.
    """
    sizes, rates = np.empty(len(tub.dampers)), np.empty(len(tub.ends))
    squares = np.empty((len(rates), 6, 6))
    for e in range(len(rates)):
        squares[e] = np.dot(tub.ends[e].T, tub.ends[e])
    matrix, q = np.empty((6, 6), dtype=np.complex128), np.empty(6, dtype=np.complex128)
    for case in range(len(cases.load)):
        sizes[:], rates[:] = 1e-3, 1e-2
        load = cases.load[case]
        for at in range(len(cases.speed)):
            w = cases.speed[at]
            for _ in range(ITERATIONS):
                write_linear_part(tub, cases, case, w, matrix)
                add_friction(tub.dampers, squares, friction, sizes, rates, w, matrix)
                for i in range(6):
                    q[i] = cases.force[load, at, i]
                solve_six(matrix, q)
                settle(tub, q, w, sizes, rates)
            motions[case, at] = q


@long_running
def write_linear_part(tub, cases, case, w, matrix):
    """Write K - w^2 M + i w (C + w G) with the gasket of a case."""
    mass = tub.mass[cases.load[case]]
    for i in range(6):
        for j in range(6):
            stiffness = tub.stiffness[i, j] + cases.stiffness[case, i, j] - w * w * mass[i, j]
            damping = tub.damping[i, j] + cases.damping[case, i, j] + w * tub.gyroscopic[i, j]
            matrix[i, j] = complex(stiffness, w * damping)


@long_running
def add_friction(dampers, squares, friction, sizes, rates, w, matrix):
    """Add dampers and end bushings with their amplitudes.

    Args:
        dampers: As in `Tub`.
        squares: B' B of each end bushing. (e, 6, 6)
        friction: `Friction`.
        sizes, rates: Amplitudes of elongations and of the rates of the bushings. [m, rad/s]
        w: Speed. [rad/s]
        matrix: Changed.
    """
    for d in range(len(sizes)):
        z, a = stiffness_in(friction, sizes[d], w), dampers[d]
        for i in range(6):
            for j in range(6):
                matrix[i, j] += z * a[i] * a[j]
    for e in range(len(rates)):
        row, along = place_in(friction.rate, rates[e])
        c = (1.0 - along) * friction.damping[row] + along * friction.damping[row + 1]
        for i in range(6):
            for j in range(6):
                matrix[i, j] += complex(0.0, w * c * squares[e, i, j])


@long_running
def settle(tub, q, w, sizes, rates):
    """Move the amplitudes of dampers and end bushings towards those of a motion q."""
    for d in range(len(sizes)):
        total = 0.0j
        for i in range(6):
            total += tub.dampers[d, i] * q[i]
        sizes[d] = KEPT * sizes[d] + (1.0 - KEPT) * max(abs(total), 1e-6)
    for e in range(len(rates)):
        square = 0.0
        for k in range(3):
            total = 0.0j
            for i in range(6):
                total += tub.ends[e, k, i] * q[i]
            square += abs(total) ** 2
        rates[e] = KEPT * rates[e] + (1.0 - KEPT) * max(w * np.sqrt(square), 1e-6)


@long_running
def solve_six(matrix, right):
    """Solve a complex system by elimination with pivots; matrix and right side are overwritten."""
    size = len(right)
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(k, size):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            right[k], right[best] = right[best], right[k]
        for i in range(k + 1, size):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, size):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]
