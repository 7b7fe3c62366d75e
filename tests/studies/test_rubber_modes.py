"""Modes and steady response of a machine with rubber: both engines, and the engine over time."""

import numpy as np
import pytest
from drake_spectrum import drake_spectrum
from machine_with_bearing import with_bearing
from machines_of_each_kind import RUBBER, changed

from wm_drake.elements.state_map import CARRIER, STRETCHES
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine
from wm_drake.studies.modes.linearisation import Linearisation
from wm_drake.studies.modes.shapes import ANGLE_ARM
from wm_drake.studies.response.balance import HarmonicBalance
from wm_drake.studies.response.response import branch_of, settled_trajectory, trajectory_of_period
from wm_drake.studies.response.series import Series

pytestmark = pytest.mark.slow
REFERENCE = load_machine("reference")
RPM = np.pi / 30.0


@pytest.fixture(scope="module")
def rubber():
    return build_machine(changed(gasket=REFERENCE.gasket.model_dump() | RUBBER))


@pytest.mark.parametrize("friction", [True, False])
def test_compiled_modes_are_drakes(rubber, friction):
    ours = Linearisation(rubber.set_up(friction=friction)).spectrum().first(6)
    drakes = drake_spectrum(rubber.set_up(friction=friction)).first(6)
    np.testing.assert_allclose(ours.values, drakes.values, rtol=2e-6)


def test_stuck_friction_is_a_spring():
    """Put F / x_c in place of the friction: the same modes; sliding, none does the same.

    The springs hold a part of the weight, as the friction does not, so that the rest pose moves:
    this changes the modes by up to 4.3e-3.
    """
    gasket = REFERENCE.gasket.model_dump()
    plain = {name: 0.0 for name in RUBBER if name.startswith("dahl")}
    springs = {
        "stiffness_x": RUBBER["dahl_force_x"] / RUBBER["dahl_displacement_x"],
        "stiffness_y": RUBBER["dahl_force_y"] / RUBBER["dahl_displacement_y"],
        "rotational_stiffness_z": RUBBER["dahl_torque_z"] / RUBBER["dahl_angle_z"],
    }
    linear = dict.fromkeys(("stiffness_x", "stiffness_y"), 3e3) | {"rotational_stiffness_z": 50.0}
    stiffer = {name: linear[name] + added for name, added in springs.items()}

    def values(numbers, friction):
        machine = build_machine(changed(gasket=gasket | linear | numbers))
        return Linearisation(machine.set_up(friction=friction)).spectrum().first(6).values

    stuck = values(RUBBER, True)
    np.testing.assert_allclose(stuck, values(RUBBER | plain | stiffer, True), rtol=5e-3)
    sliding = values(RUBBER, False)
    np.testing.assert_allclose(sliding, values(RUBBER | plain, False), rtol=1e-6)
    assert np.max(np.abs(stuck / sliding - 1.0)) > 0.05


def test_branches_stay_relaxed_under_a_load(rubber):
    """Check that springs carry the weight of a load: friction holds none of it."""
    loaded = Linearisation(rubber.set_up("middle"), loaded=True)
    assert not loaded.equilibrium[loaded.derivative.layout.states.span(STRETCHES)].any()
    assert np.max(np.abs(loaded.equilibrium - loaded.derivative.rest)) > 1e-4


def test_response_is_that_of_the_engine_over_time(rubber):
    speed = np.array([110.0, 250.0]) * RPM
    setup = rubber.set_up("front")
    balance = HarmonicBalance(setup, Series(11, 128))
    points = [point for point in branch_of(balance, setup, speed) if point.on_grid]
    assert len(points) == len(speed)
    for point in points:
        found = trajectory_of_period(balance, point.coefficients, point.speed, 128)
        wanted = settled_trajectory(setup, point.speed, 128, 120)
        for name in ("state", "stretches"):
            ours, engine = (np.ptp(getattr(each, name)[:, :6], axis=0) for each in (found, wanted))
            np.testing.assert_allclose(ours, engine, rtol=0.01, atol=2e-3 * engine.max())
    assert balance.derivative.layout.states.of_kind(STRETCHES)


def test_indices_of_the_bearing_are_right_beside_rubber():
    both = with_bearing(changed(gasket=REFERENCE.gasket.model_dump() | RUBBER))
    balance = HarmonicBalance(build_machine(both).set_up("front"), Series(3, 16))
    carrier = balance.derivative.layout.states.span(CARRIER)
    angles = np.isin(balance.derivative.free, carrier.start + np.arange(3))
    np.testing.assert_array_equal(balance.scale[angles], ANGLE_ARM)
    assert balance.derivative.layout.states.span(STRETCHES).start == carrier.stop
    turns, shifts = balance.kinematics.turns, balance.kinematics.shifts
    velocities = np.concatenate([turns[1].ravel(), shifts[1]])
    assert balance.derivative.free[velocities].max() < carrier.stop
    assert np.all(balance.derivative.is_velocity[velocities])
