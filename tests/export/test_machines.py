"""FMUs of machines with the parts of all shipped ones compute what the engine does."""

import shutil

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.elements.stop import Stop
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.parameters import SpinProfile, shipped_machines
from wm_drake.simulation.outputs import variables_of

fmpy = pytest.importorskip("fmpy", reason="headers and importer are FMPy's: install wm-drake[fmu]")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler on this computer"),
]

PROFILE = SpinProfile(time=(0.0, 0.5), speed=(0.0, 10.0))
RUBBER = """
name: rubber
extends: light_cabinet
step: 0.5 ms
gasket:
  dahl_displacement_y: 0.5 mm
  dahl_force_y: 4 N
  maxwell_stiffness_y: 0.8 N/mm
  maxwell_damping_y: 0.04 N s/mm
  cross_stiffness_y_z: 0.3 N/mm
imperfections:
  bearing:
    radial_stiffness: 10 kN/mm
    axial_stiffness: 8 kN/mm
    tilting_stiffness: 100 kN m/rad
    radial_damping: 1 N s/mm
    axial_damping: 1 N s/mm
    tilting_damping: 10 N m s/rad
    y: 170 mm
"""
"""Parts that no shipped machine has: docs/how-to/rubber.md, compliant-bearing.md."""
TOGETHER = "a motor, balls, liquid, a stop and tubes"
ALIKE = {
    "reference": "test_fmu.py runs it",
    "light_cabinet": "the machine of rubber has its feet",
    "heavy_cabinet": "other numbers of light_cabinet",
    "reference_folded": "other curves of the gasket of reference",
    "reference_sponge": "a law of dampers whose derivatives both engines share in tests/elements",
    "rodrigues_2010": "two bushings alone",
    "free_stroke": TOGETHER,
    "ball_rings": TOGETHER,
    "liquid_rings": TOGETHER,
    "motor": TOGETHER,
}
"""Machines without compiled code that others do not have, and why."""
OUTPUTS = {
    "displacement": "displacement",
    "mount_force": "mount_force",
    "cabinet_force": "cabinet_force",
    "cabinet_moment": "cabinet_moment",
    "floor_force": "floor_force",
    "drum_angle": "drum_angle",
    "drum_speed": "drum_rate",
}
"""Outputs of an FMU by the variable of a record; the detergent box is another variable there."""


def machine_named(name, folder):
    """Return a shipped machine, that of `RUBBER`, or one with the parts of four shipped ones."""
    if name == TOGETHER:
        rings = (wm.load_machine(name).elements for name in ("ball_rings", "liquid_rings"))
        buffer = Stop(
            kind="stop", tub_frame="damper_left_tub", housing_frame="damper_left_housing",
            gap="0 mm", stiffness="5 N/mm", loss="1 s/m", friction=0.3
        )  # fmt: skip
        parts = {"elements": {ring: e for elements in rings for ring, e in elements.items()}}
        parts["elements"]["buffer"] = buffer
        parts |= {"drive": wm.load_machine("motor").drive}
        return wm.load_machine("free_stroke").model_copy(update=parts)
    if name != "rubber":
        return wm.load_machine(name)
    path = folder / "rubber.yaml"
    path.write_text(RUBBER, encoding="utf-8")
    return wm.load_machine(path)


def in_world(variables):
    """Return the variables of a record with the floor forces in W, as the FMU has them.

    Those of a record turn with the yaw of the cabinet.
    """
    if "floor_force" not in variables:
        return variables
    dims, force, *about = variables["floor_force"]
    yaw = variables["cabinet_angle"][1][:, 2, np.newaxis]
    x, y = force[:, :, 0], force[:, :, 1]
    along = np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x + np.cos(yaw) * y
    turned = np.stack([*along, force[:, :, 2]], axis=2)
    return {**variables, "floor_force": (dims, turned, *about)}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.hours] if name in ALIKE else [])
        for name in (*shipped_machines(), "rubber", TOGETHER)
    ],
)
def test_fmu_equals_engine(name, tmp_path):
    # an FMU has the outputs of a run with the profile of its machine beside it
    parameters = machine_named(name, tmp_path).model_copy(update={"profile": PROFILE})
    load = list(parameters.loads)[-1]
    written = wm.export_fmu(parameters, load, tmp_path / "machine.fmu")
    setup = written.model.setup.machine.set_up(load)
    step = written.model.step
    trajectory = run_compiled(setup, PROFILE, step, lambda _: None, integrator="runge_kutta")
    expected = in_world(variables_of(setup, trajectory))
    names = [v.name for v in written.model.variables if v.causality == "output"]
    columns = {
        variable: [n for n in names if n.split(".")[0] == output and "detergent" not in n]
        for variable, output in OUTPUTS.items()
        if variable in expected
    }
    rates = np.full((2, 1), PROFILE.speed[1] / PROFILE.duration)
    rows = np.column_stack([PROFILE.time, PROFILE.speed, rates])
    signals = np.array(
        [tuple(row) for row in rows],
        dtype=[(n, float) for n in ("time", "drum_speed", "drum_acceleration")],
    )
    interval = trajectory.time[1] - trajectory.time[0]
    result = fmpy.simulate_fmu(
        written.path,
        stop_time=PROFILE.duration,
        output_interval=interval,
        input=signals,
        output=[output for outputs in columns.values() for output in outputs],
        fmi_type="CoSimulation",
    )
    at = np.searchsorted(result["time"], trajectory.time + 1e-9) - 1
    assert {"displacement", "drum_speed"} <= set(columns)
    if name == TOGETHER:
        assert np.abs(expected["stop_force"][1]).max() > 1.0  # it is touched
    for variable, outputs in columns.items():
        values = expected[variable][1].reshape(len(at), -1)
        size = np.abs(values).max()
        for column, output in enumerate(outputs):
            deviation = np.abs(result[output][at] - values[:, column]).max()
            assert deviation <= 1e-9 * size, output
        assert outputs
        assert size > 0.0
