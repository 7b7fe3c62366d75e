"""The bearing of the drum as a system: springs along its axes, action and reaction, power, history, derivatives."""

import numpy as np
import pytest
from element_ports import own_outputs
from machine_with_bearing import BEARING
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from pydrake.math import RollPitchYaw, RotationMatrix
from scipy.spatial.transform import Rotation

from wm_drake.elements.bearing import (
    DRUM_BEARING,
    FORCE_SIZE,
    DrumBearingParameters,
    drum_bearing_history,
)
from wm_drake.elements.bushing import packed_bushing_law
from wm_drake.parameters import Bearing
from wm_drake.systems.element_system import element_system

POINT = np.array([0.02, 0.15, -0.01])  # m
R_TB = RotationMatrix(RollPitchYaw([0.2, 0.0, -0.1])).matrix()
LAW = packed_bushing_law(Bearing(**BEARING, torsional_stiffness=7e3).as_bushing())
PACKED = DrumBearingParameters(POINT, R_TB, POINT, R_TB, LAW).packed()


@pytest.fixture(scope="module")
def system():
    return element_system(DRUM_BEARING, PACKED)


def states(count, seed):
    """Draw a tub near rest and a carrier within 0.02 rad and 0.3 mm of it, with any rates."""
    rng = np.random.default_rng(seed)
    tub = rng.uniform(-1.0, 1.0, (count, 14)) * (
        [0.1] * 3 + [0.01] * 3 + [3.0] + [1.0] * 3 + [0.3] * 3 + [40.0]
    )
    apart = rng.uniform(-1.0, 1.0, (count, 14)) * (
        [0.02] * 3 + [3e-4] * 3 + [0.0] + [0.5] * 3 + [0.2] * 3 + [0.0]
    )
    return np.hstack([tub, tub + apart])


def answers(system, x):
    context = system.CreateDefaultContext()
    system.GetInputPort("plant_state").FixValue(context, x)
    force = system.GetOutputPort("generalized_force").Eval(context).copy()
    return [force, own_outputs(system, context)]


def test_it_is_a_spring_along_each_of_its_axes_and_about_them(system):
    x = np.zeros(28)
    for axis, stiffness in zip("xyz", (4e6, 6e6, 4e6), strict=True):
        direction = R_TB[:, "xyz".index(axis)]
        x[17:20] = 1e-4 * direction
        _, own = answers(system, x)
        expected = 1e-4 * np.eye(3)["xyz".index(axis)]
        np.testing.assert_allclose(own[:3], expected, atol=1e-15)
        np.testing.assert_allclose(own[6:9], stiffness * expected, atol=1e-6)
    x[17:20] = 0.0
    for index, stiffness in enumerate((5e4, 7e3, 5e4)):
        turned = Rotation.from_rotvec(1e-3 * R_TB[:, index])
        x[14:17] = turned.as_euler("xyz")
        x[17:20] = POINT - turned.apply(POINT)
        _, own = answers(system, x)
        np.testing.assert_allclose(own[:6], [0, 0, 0, *(1e-3 * np.eye(3)[index])], atol=1e-12)
        np.testing.assert_allclose(own[9:], stiffness * 1e-3 * np.eye(3)[index], atol=1e-6)


def test_action_is_reaction_and_power_is_what_is_stored_and_lost(system):
    bearing, kinds = (
        Bearing(**BEARING, torsional_stiffness=7e3),
        ("stiffness", "rotational_stiffness"),
    )
    stiffness = np.array(
        [getattr(bearing.as_bushing(), f"{kind}_{axis}") for kind in kinds for axis in "xyz"]
    )
    damping = np.array(
        [
            getattr(bearing.as_bushing(), f"{kind}_{axis}")
            for kind in ("damping", "rotational_damping")
            for axis in "xyz"
        ]
    )
    for x in states(10, seed=41):
        force, own = answers(system, x)
        np.testing.assert_allclose(force[3:6], -force[10:13], rtol=1e-12)
        about_world = [
            force[i : i + 3] + np.cross(x[2 * i + 3 : 2 * i + 6], force[i + 3 : i + 6])
            for i in (0, 7)
        ]
        np.testing.assert_allclose(about_world[0], -about_world[1], atol=1e-9 * np.abs(force).max())
        assert force[6] == force[13] == 0.0
        power = force[:6] @ x[7:13] + force[7:13] @ x[21:27]
        # displacements a little later, by moving both bodies; then energy by numpy
        moved = []
        for sign in (-1.0, 1.0):
            y, h = x.copy(), sign * 1e-6
            for at in (0, 14):
                turned = Rotation.from_rotvec(h * x[at + 7 : at + 10]) * Rotation.from_euler(
                    "xyz", x[at : at + 3]
                )
                y[at : at + 3], y[at + 3 : at + 6] = (
                    turned.as_euler("xyz"),
                    x[at + 3 : at + 6] + h * x[at + 10 : at + 13],
                )
            moved.append(answers(system, y)[1][:6])
        rate = (moved[1] - moved[0]) / 2e-6
        assert power == pytest.approx(-(stiffness * own[:6]) @ rate - damping @ rate**2, rel=1e-5)


def test_history_is_what_the_port_says(system):
    x = states(21, seed=42)
    forces = np.empty((21, FORCE_SIZE))
    drum_bearing_history(x, np.empty((21, 0)), PACKED, forces)
    np.testing.assert_allclose(
        forces, [answers(system, row)[1] for row in x], rtol=1e-12, atol=1e-12
    )


CLEARANCE = {"clearance": 1e-4, "contact_stiffness": 2e7, "contact_damping": 3e3}


@pytest.fixture(scope="module")
def loose():
    """Return a bearing with a clearance, and little stiffness within it."""
    law = packed_bushing_law(Bearing(**BEARING | {"radial_stiffness": 1e4}).as_bushing())
    placed = DrumBearingParameters(POINT, R_TB, POINT, R_TB, law, **CLEARANCE)
    return element_system(DRUM_BEARING, placed.packed())


def test_beyond_the_clearance_shaft_and_bearing_touch(loose):
    x = np.zeros(28)
    for depth, pressed in ((0.8e-4, 0.0), (1.5e-4, 0.5e-4)):
        x[17:20] = R_TB @ [0.6 * depth, 0.0, -0.8 * depth]
        force, own = answers(loose, x)
        size = 1e4 * depth + 2e7 * pressed
        np.testing.assert_allclose(own[6:9], size * np.array([0.6, 0.0, -0.8]), atol=1e-9)
        np.testing.assert_allclose(force[3:6], R_TB @ own[6:9], atol=1e-9)
        np.testing.assert_allclose(force[10:13], -force[3:6], atol=1e-9)


@pytest.mark.parametrize("kind", ["system", "loose"])
def test_derivatives_are_those_of_finite_differences(kind, request):
    system = request.getfixturevalue(kind)
    differentiable, x = system.ToAutoDiffXd(), states(1, seed=43)[0]
    context = differentiable.CreateDefaultContext()
    differentiable.GetInputPort("plant_state").FixValue(context, InitializeAutoDiff(x).ravel())
    exact = ExtractGradient(
        differentiable.GetOutputPort("generalized_force").Eval(context).reshape(-1, 1)
    )
    for column, step in enumerate(1e-6 * np.eye(28)):
        difference = (answers(system, x + step)[0] - answers(system, x - step)[0]) / 2e-6
        np.testing.assert_allclose(
            exact[:, column], difference, rtol=1e-6, atol=1e-3 * np.abs(exact).max() * 1e-4
        )
