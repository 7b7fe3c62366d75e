"""Stability of the balanced state of two balls: linear equations against runs of the machine.

A rigid rotor on isotropic supports, with static unbalance in the plane of the ring, no gravity. Own
derivation, in the frame that turns with the rotor at the speed W: rho = (displacement of C, tilt
phi_Y - i phi_X), complex, b = (1, z) for the plane of the ring, e_k = exp(i alpha_k) the balanced
places of the balls, d_k their small deviations:

    M (rho'' + 2 i W rho' - W^2 rho) + (C - i W G)(rho' + i W rho) + K rho
        = -b m R sum_k (i d_k'' - 2 W d_k' - i W^2 d_k) e_k
    m R^2 d_k'' + c d_k' = -m R Re(conj(i e_k) b.(rho'' + 2 i W rho' - W^2 rho))

M contains the balls, G = diag(0, J_p).
"""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import wm_drake as wm
from wm_drake.parameters import Load, MachineParameters, SpinProfile, load_machine

MASS, RADIUS, PLANE = 0.44e-3, 42.8e-3, -0.02
DAMPING = 0.1 * MASS * RADIUS**2 * 1700.0 * np.pi / 30.0
STIFFNESS, SUPPORT_DAMPING = 21500.0, 5.375  # Z of both supports of the rig, used for X too
PHASE, HALF = 2.0, np.arccos(0.5)  # unbalance of half the capacity
BALANCED = PHASE + np.pi + np.array([-HALF, HALF])
DEVIATION = np.array([0.002, -0.0026])


def parts(vector):
    """Return real and imaginary parts of complex coefficients as a column. (2,) -> (4,)"""
    return np.concatenate([vector.real, vector.imag])


def linear(rpm):
    """Return A of x' = A x with x = (Re rho, Im rho, d) and its rates. (12, 12)"""
    w, plane = rpm * np.pi / 30.0, np.array([1.0, PLANE])
    inertia = np.diag([1.28, 1.38e-2]) + 2.0 * MASS * np.outer(plane, plane)
    levers = np.array([[1.0, 1.0], [0.11, -0.15]])
    supports = levers @ levers.T
    c = SUPPORT_DAMPING * supports - 1j * w * np.diag([0.0, 1.24e-3])
    rotor = (inertia, 2j * w * inertia + c, STIFFNESS * supports + 1j * w * c - w**2 * inertia)
    ball, frame = (1j, -2.0 * w, -1j * w**2), (1.0, 2j * w, -(w**2))
    turns = np.exp(1j * (BALANCED - PHASE))
    blocks = []
    for matrix, of_ball, of_rotor in zip(rotor, ball, frame, strict=True):
        block = np.zeros((6, 6))
        block[:4, :4] = np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])
        for k, turn in enumerate(turns):
            block[:4, 4 + k] = MASS * RADIUS * parts(plane * of_ball * turn)
            block[4 + k, :4] = MASS * RADIUS * parts(np.conj(plane * of_rotor * np.conj(1j * turn)))
        blocks.append(block)
    second, first, zeroth = blocks
    second[4:, 4:] = MASS * RADIUS**2 * np.eye(2)
    first[4:, 4:] = DAMPING * np.eye(2)
    rates = -np.linalg.solve(second, np.hstack([zeroth, first]))
    return np.vstack([np.hstack([np.zeros((6, 6)), np.eye(6)]), rates])


def growth(rpm):
    """Return the largest growth rate of a deviation from the balanced state. [1/s]"""
    return np.linalg.eigvals(linear(rpm)).real.max()


def run(rpm, deviation):
    """Return times (n,) and ball angles (n, 2) of one second at a constant speed."""
    ring = {
        "kind": "ball_ring",
        "y": PLANE,
        "balls": 2,
        "ball_mass": MASS,
        "ball_diameter": 4.76e-3,
        "race_radius": RADIUS,
        "damping": DAMPING,
        "race_frequency": 3000.0 * np.pi,
        "start_angles": tuple(BALANCED + deviation),
    }
    tree = load_machine("rodrigues_2010").model_dump(exclude_unset=True)
    rig = MachineParameters.model_validate(tree | {"elements": {"abb": ring}, "gravity": 0.0})
    supports = {"stiffness_x": STIFFNESS, "damping_x": SUPPORT_DAMPING}
    keys = {f"bushings.support_{k}.{key}": value for k in (1, 2) for key, value in supports.items()}
    moment = 0.5 * 2.0 * MASS * RADIUS
    load = Load.model_validate({"static": {"moment": moment, "y": PLANE, "phase": PHASE}})
    profile = SpinProfile(time=(0.0, 1.0), speed=(rpm * np.pi / 30.0,) * 2)
    machine = wm.build_machine(wm.with_values(rig, keys))
    record = wm.simulate(machine, wm.Case("", load, profile), step=1e-4)
    return record.time.values, np.unwrap(record.ball_ring_angle.values[:, 0], axis=0)


@pytest.mark.parametrize(("rpm", "is_stable"), [(1750.0, False), (1850.0, True)])
def test_a_deviation_grows_below_the_limit_and_decays_above_as_the_linear_equations_say(
    rpm, is_stable
):
    (time, moved), (_, balanced) = run(rpm, DEVIATION), run(rpm, np.zeros(2))
    step, states = expm(linear(rpm) * (time[1] - time[0])), np.zeros((len(time), 12))
    states[0, 4:6] = DEVIATION
    for k in range(1, len(time)):
        states[k] = step @ states[k - 1]
    expected, found = states[:, 4:6], moved - balanced
    largest = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=0.04 * largest)
    last = np.abs(found[time > 0.8]).max()
    assert (last < np.abs(DEVIATION).max()) == is_stable == (growth(rpm) < 0.0)


def test_the_limit_lies_between_the_critical_speeds():
    limit = brentq(growth, 1750.0, 1850.0)
    assert limit == pytest.approx(1815.0, abs=1.0)  # as docs/theory/ball-ring.md says
