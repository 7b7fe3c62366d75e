"""A PI controller outside of an FMU drives the drum as the sampled controller of Drake's diagram."""

import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.engines.drake import run_drake_accurately
from wm_drake.export.options import FmuOptions
from wm_drake.parameters import SpinProfile

fmpy = pytest.importorskip("fmpy", reason="headers and importer are FMPy's: install wm-drake[fmu]")
SCRIPT = Path(__file__).parents[2] / "analyses" / "spin_up_fmu.py"
SAMPLE_TIME, SAMPLES = 1e-3, 1000
PROFILE = SpinProfile(time=(0.0, 1.0), speed=(0.0, 5.0))
CONSTANT = 0.2
"""Torque over current of the motor. [N m/A]"""


@pytest.fixture(scope="module")
def parameters():
    """Return a motor with a sampled controller, a torque constant and a short profile."""
    numbers = {"drive.controller.sample_time": SAMPLE_TIME, "drive.torque_constant": CONSTANT}
    plain = wm.load_machine("motor").model_copy(update={"profile": PROFILE})
    return wm.with_values(plain, numbers)


@pytest.fixture(scope="module")
def fmu(parameters, tmp_path_factory):
    """Return an FMU whose input is the torque; it takes seconds to compile."""
    if not shutil.which("cc"):
        pytest.skip("no C compiler on this computer")
    path = tmp_path_factory.mktemp("fmu") / "machine.fmu"
    return wm.export_fmu(parameters, "middle", path, FmuOptions(input="torque")).path


@pytest.mark.slow
def test_external_controller_equals_the_drake_diagram(parameters, fmu):
    drive = parameters.drive
    gains = (drive.belt_ratio, drive.controller.proportional_gain, drive.controller.integral_gain)
    samples = SAMPLE_TIME * np.arange(SAMPLES)
    reference = drive.belt_ratio * PROFILE.speed_at(samples)
    spin_up = runpy.run_path(str(SCRIPT))["spin_up"]
    history = np.array(spin_up(fmu, reference, gains, SAMPLE_TIME))

    setup = wm.build_machine(parameters).set_up("middle")
    trajectory = run_drake_accurately(setup, PROFILE, 5e-4, lambda _: None)
    after = np.rint(trajectory.time[1:] / SAMPLE_TIME).astype(int) - 1
    speed = trajectory.state[1:, 13]
    assert np.abs(history[after, 0] - speed).max() < 1e-3 * np.abs(speed).max()
    assert np.abs(speed).max() > 2.0


@pytest.mark.slow
def test_current_is_torque_at_the_shaft_over_torque_constant(fmu):
    assert fmpy.read_model_description(fmu).unitDefinitions
    demand = np.array(
        [(0.0, 1.5), (0.5, 1.5)], dtype=[("time", float), ("motor_torque_demand", float)]
    )
    result = fmpy.simulate_fmu(
        fmu, stop_time=0.5, input=demand, output=["drive_current", "drum_torque"]
    )
    assert result["drive_current"][-1] == pytest.approx(1.5 / CONSTANT, rel=1e-12)
    assert result["drum_torque"][-1] == pytest.approx(12 * 1.5, rel=1e-12)


def test_record_has_the_current_of_a_motor_with_a_torque_constant(parameters):
    record = wm.simulate(parameters, "middle")
    assert record.motor_current.attrs["units"] == "A"
    shaft_torque = record.motor_torque.values / parameters.drive.belt_ratio
    np.testing.assert_allclose(CONSTANT * record.motor_current.values, shaft_torque, rtol=1e-12)
    assert np.abs(record.motor_current.values).max() > 1.0
    plain = wm.with_value(parameters, "drive.torque_constant", None)
    assert "motor_current" not in wm.simulate(plain, "middle")
