"""A PI controller outside of an FMU drives the drum as the sampled controller of Drake's diagram."""

import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.engines.drake import run_drake
from wm_drake.export.options import FmuOptions
from wm_drake.parameters import SpinProfile

pytest.importorskip("fmpy", reason="headers and importer are FMPy's: install wm-drake[fmu]")
SCRIPT = Path(__file__).parents[2] / "analyses" / "spin_up_fmu.py"
SAMPLE_TIME, SAMPLES = 1e-3, 1000
PROFILE = SpinProfile(time=(0.0, 1.0), speed=(0.0, 5.0))


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler on this computer")
def test_external_controller_equals_the_drake_diagram(tmp_path):
    parameters = wm.with_value(
        wm.load_machine("motor"), "drive.controller.sample_time", SAMPLE_TIME
    )
    path = tmp_path / "machine.fmu"
    wm.export_fmu(parameters, "middle", path, FmuOptions(input="torque"))
    drive = parameters.drive
    gains = (
        drive.belt_ratio,
        drive.controller.proportional_gain,
        drive.controller.integral_gain,
    )
    samples = SAMPLE_TIME * np.arange(SAMPLES)
    reference = drive.belt_ratio * PROFILE.speed_at(samples)
    spin_up = runpy.run_path(str(SCRIPT))["spin_up"]
    history = np.array(spin_up(path, reference, gains, SAMPLE_TIME))

    setup = wm.build_machine(parameters).set_up("middle", profile=PROFILE)
    trajectory = run_drake(setup, PROFILE, 5e-4, lambda _: None)
    after = np.rint(trajectory.time[1:] / SAMPLE_TIME).astype(int) - 1
    speed = trajectory.state[1:, 13]
    assert np.abs(history[after, 0] - speed).max() < 1e-3 * np.abs(speed).max()
    assert np.abs(speed).max() > 2.0
