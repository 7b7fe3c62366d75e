"""The rotor rig of Rodrigues et al. (2010) against the equations of the paper, solved by hand."""

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.parameters import SpinProfile

SPEEDS_RPM = np.arange(900.0, 4600.0, 900.0)
STAIRS = {
    "stairs_to": "4500 rpm",
    "stair": "900 rpm",
    "rate": "3000 rpm/s",
    "settle": "4 s",
    "measure": "0.25 s",
}


def radii(rpm: float) -> np.ndarray:
    """Return the largest radial displacements of both bearing housings of the rig. [m]

    Equations (1) of the paper: q = (X, phi_Y, Y, -phi_X), M q'' + (C + W G) q' + K q =
    W^2 (f e^{iWt}), f = (M e e^{i beta}, chi (J_t - J_p)), with the supports of Table 3 doubled.
    """
    mass, j_t, j_p, lengths = 1.28, 1.38e-2, 1.24e-3, (0.11, -0.15)
    speed = rpm * np.pi / 30.0
    arms = np.array([[1.0, length] for length in lengths])
    stiffness = np.zeros((4, 4))
    stiffness[:2, :2], stiffness[2:, 2:] = 21500.0 * arms.T @ arms, 15800.0 * arms.T @ arms
    damping = 2.5e-4 * stiffness
    damping[1, 3] += speed * j_p
    damping[3, 1] -= speed * j_p
    inertia = np.diag([mass, j_t, mass, j_t])
    unbalance = np.array([37.2e-6 * np.exp(1j * np.deg2rad(224.0)), 6.8e-5 * (j_t - j_p)])
    force = speed**2 * np.concatenate([unbalance, -1j * unbalance])
    q = np.linalg.solve(stiffness + 1j * speed * damping - speed**2 * inertia, force)
    turn = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 721))
    x, y = (np.outer(arms @ part, turn).real for part in (q[:2], q[2:]))
    return np.asarray(np.hypot(x, y).max(axis=1))


@pytest.fixture(scope="module")
def machine():
    return wm.build_machine(wm.load_machine("rodrigues_2010"))


def test_steady_radii_are_those_of_the_paper_s_equations(machine):
    profile = SpinProfile.model_validate({"steps": [STAIRS]})
    assert [region.name for region in profile.regions] == [f"up_{rpm:g}" for rpm in SPEEDS_RPM]
    record = wm.simulate(machine, wm.Case("", machine.parameters.loads["washers_3"], profile))
    ours = wm.measure(record, measures=["radial displacements"]).region_radius.values
    # carrier, axial supports, finite tilt and 0.5 ms between samples change the radii by this much
    np.testing.assert_allclose(ours, [radii(rpm) for rpm in SPEEDS_RPM], rtol=6e-3)


def test_critical_speeds_are_those_that_the_paper_computed(machine):
    speeds = wm.modes(machine, "washers_3").critical_speeds * 30.0 / np.pi
    computed = [1457.5, 1700.0, 1917.5, 2280.0]
    np.testing.assert_allclose(np.sort(speeds)[:4], computed, rtol=5e-3)
