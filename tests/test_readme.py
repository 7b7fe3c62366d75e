"""README tells the truth where a machine can check it."""

import re
from pathlib import Path

from wm_drake.model.machine import build_machine
from wm_drake.parameters import SpinProfile, load_machine
from wm_drake.parameters.free import load_free
from wm_drake.report.diagram import mermaid
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate
from wm_drake.studies.calibration.parameter_map import parameter_map_of

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def test_the_picture_is_the_diagrams_own_graph():
    drawn = re.search(r"```mermaid\n(.*?)\n```", README, re.DOTALL)[1]
    assert drawn == mermaid(build_machine(load_machine("reference")).diagram)


def test_the_short_python_way_runs():
    code = re.search(r"```python\n(.*?)\n```", README, re.DOTALL)[1]
    lines = [line for line in code.splitlines() if line.strip()]
    assert len(lines) == 3
    import matplotlib

    matplotlib.use("Agg")
    names = {}
    exec(
        code.replace('"middle"', "case").replace(
            "import wm_drake as wm", "import wm_drake as wm\n" + SHORT_CASE
        ),
        names,
    )
    assert names["record"].sizes["time"] == 401


def test_the_python_way_to_many_runs_runs():
    code = re.findall(r"```python\n(.*?)\n```", README, re.DOTALL)[1]
    code = code.replace("parameters.profile", "short").replace("range(0, 40, 5)", "(0, 30)")
    names = {}
    exec(
        "import wm_drake as wm\nfrom wm_drake.parameters import SpinProfile\n"
        + SHORT_PROFILE
        + code,
        names,
    )
    assert names["table"].sizes["run"] == 2
    assert names["table"].case.values[1] == "30 % softer"
    assert (
        names["table"].gasket_force.sel(axis="x")[1] < names["table"].gasket_force.sel(axis="x")[0]
    )


SHORT_PROFILE = "short = SpinProfile(time=(0.0, 6.0), speed=(0.0, 12.0))\n"
SHORT_CASE = """
from wm_drake.parameters import SpinProfile
loads = wm.load_machine("reference").loads
case = wm.Case("middle", loads["middle"], SpinProfile(time=(0.0, 2.0), speed=(0.0, 10.0)))
"""


def test_the_example_of_an_own_machine_is_in_order(tmp_path):
    example = re.search(r"```yaml\n(.*?)\n```", README, re.DOTALL)[1]
    path = tmp_path / "mine.yaml"
    path.write_text(example)
    mine = load_machine(path)
    setup = build_machine(mine).set_up(mine.loads["towel"])
    assert setup.plant_context is not None
    assert mine.bodies["upper_counterweight"].mass == 11.0
    assert max(abs(setup.residual)) < 1e-9


def test_the_example_of_a_free_file_fits_the_reference_machine(tmp_path, machine):
    example = re.findall(r"```yaml\n(.*?)\n```", README, re.DOTALL)[1]
    path = tmp_path / "free.yaml"
    path.write_text(example)
    parameter_map = parameter_map_of(machine, load_free(path))
    made = parameter_map.parameters_at(parameter_map.expected)
    assert (
        made.frames["damper_left_housing"].position[0]
        == -made.frames["damper_right_rear_housing"].position[0]
        == -0.05
    )


def test_the_example_of_a_bearing_runs(tmp_path):
    path = tmp_path / "whirling.yaml"
    path.write_text(re.findall(r"```yaml\n(.*?)\n```", README, re.DOTALL)[2])
    whirling = load_machine(path)
    record = simulate(
        build_machine(whirling),
        Case("front", whirling.loads["front"], SpinProfile(time=(0.0, 1.0), speed=(8.0, 12.0))),
    )
    assert {"drum_displacement", "drum_tilt", "bearing_force", "bearing_moment"} <= set(
        record.data_vars
    )
    assert 1e-6 < float(abs(record.drum_displacement).max()) < 1e-4  # m


def test_every_file_named_in_the_reading_order_exists():
    root = Path(__file__).parents[1]
    for name in re.findall(r"`((?:wm_drake|sdf|tests|analyses)/[\w/.]*)`", README):
        assert (root / name).exists(), name
