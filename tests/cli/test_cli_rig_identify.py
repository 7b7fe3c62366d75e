"""`wm-drake rig` and `wm-drake identify`: from a bench test to a machine that runs on its numbers."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from simple_machines import SPONGES

from wm_drake.elements.layouts import packed_stiffness
from wm_drake.laws.table import stiffness_force
from wm_drake.parameters import load_component, load_machine
from wm_drake.parameters.units import to_base

COULOMB = "law: coulomb\nfriction_force: 60 N\n"
KINDS = (("", "N/mm"), ("rotational_", "N mm/rad"))
ONE_LOOP = {
    "frequency_Hz", "amplitude_mm", "peak_force_N", "energy_per_cycle_mJ",
    "equivalent_damping_Ns_per_mm", "dynamic_stiffness_N_per_mm", "loss_angle_deg",
}  # fmt: skip


def si_value(row):
    """Return the value of an estimate in SI."""
    return to_base(row["value"], row["unit"])


def loop_of(ended):
    """Return what the JSON of a command says of its one loop."""
    (loop,) = json.loads(ended.out)["measures"]
    return loop


def test_one_loop_as_json(wm_drake):
    Path("coulomb.yaml").write_text(COULOMB)
    ended = wm_drake("rig damper --component coulomb.yaml -f '3 Hz' -a '5 mm' --json")
    assert ended.code == 0
    assert len(ended.out.splitlines()) == 1
    loop = loop_of(ended)
    assert set(loop) == ONE_LOOP
    assert loop["energy_per_cycle_mJ"] == pytest.approx(4.0 * 60.0 * 5.0, rel=1e-4)
    assert loop["peak_force_N"] == 60.0


def test_rotations_give_moments(wm_drake):
    straight = ("--set", "gasket.rotational_stiffness_x=60 N m/rad")
    ended = wm_drake("rig gasket --axis tilt -f 3Hz -a '2 deg' --json", *straight)
    gasket = load_machine("reference").gasket
    loop = loop_of(ended)
    stiffness = np.hypot(60.0, gasket.rotational_damping_x * 2.0 * np.pi * 3.0)
    assert loop["dynamic_stiffness_Nm_per_rad"] == pytest.approx(stiffness, rel=1e-6)
    assert loop["peak_moment_Nm"] == pytest.approx(stiffness * np.deg2rad(2.0), rel=1e-4)


def test_the_machine_may_be_changed_on_the_command_line(wm_drake):
    change = ("--set", "damper_types.friction.friction_force=200 N", "--sponge-mass", "10 g")
    plain, changed = (
        json.loads(
            wm_drake(f"rig damper --machine {SPONGES} -f '1 Hz' -a '10 mm' --json", *more).out
        )
        for more in ((), (*change, "--overwrite"))
    )
    assert changed["measures"][0]["peak_force_N"] > 3.0 * plain["measures"][0]["peak_force_N"]
    assert "sponge of 10 g" in changed["title"]


def test_changes_that_need_each_other_come_in_any_order(wm_drake):
    force = ("--set", "gasket.dahl_force_y=4 N")
    displacement = ("--set", "gasket.dahl_displacement_y=0.5 mm")
    stiffness = ("--set", "gasket.stiffness_y=3 N/mm")
    bench = "rig gasket --axis axial -f '1 Hz' -a '5 mm' --json"
    loops = [
        json.loads(wm_drake(bench, *sets, "--overwrite").out)
        for sets in ((*force, *displacement), (*displacement, *force))
    ]
    assert loops[0] | {"wall_s": 0.0} == loops[1] | {"wall_s": 0.0}
    ended = wm_drake(bench, *stiffness, *force)
    assert ended.code == 2
    assert ended.err == (
        "--set: gasket.dahl_force_y: dahl_displacement_y: must be above 0 where dahl_force_y is\n"
    )


def test_a_whole_matrix_writes_loops_and_one_page(wm_drake):
    ended = wm_drake("rig damper --component mstv_damper --matrix C --out out")
    assert ended.code == 0
    assert len(list(Path("out").glob("loop_*.csv"))) == 18  # [C] Table 1
    assert len(pd.read_csv("out/measures.csv")) == 18
    page = Path("out/report.html").read_text()
    assert page.count("<figure data-picture") == 6
    assert re.findall(r'(?:src|href)="(?!data:|#|https://doi.org/)', page) == []


@pytest.mark.parametrize(
    ("arguments", "count", "has_arm"),
    [("bushing --machine free_stroke --axis tilt", 8, True), ("gasket --axis axial", 9, False)],
)
def test_matrices_of_bushing_and_gasket(wm_drake, arguments, count, has_arm):
    found = json.loads(wm_drake(f"rig {arguments} --matrix A --json").out)
    assert len(found["measures"]) == count
    assert all(loop["energy_per_cycle_mJ"] > 0.0 for loop in found["measures"])
    assert ("arm of 100 mm" in found["title"]) == has_arm


@pytest.fixture
def loops_of(wm_drake):
    """Return files of loops of a component, as a bench would write them."""

    def run(*arguments):
        assert wm_drake("rig", *arguments, "--out", "bench").code == 0
        return sorted(Path("bench").glob("loop_*.csv"))

    return run


def test_a_damper_goes_from_the_bench_into_a_machine(wm_drake, loops_of):
    files = loops_of("damper", "--component", "mstv_damper", "-f", "1,10 Hz", "-a", "0.3,1 mm")
    ended = wm_drake("identify", "damper", *files, "--law", "mstv", "--out", "fit", "--json")
    assert ended.code == 0
    found = json.loads(ended.out)
    truth = load_component("mstv_damper").parameters
    values = {row["unknown"]: si_value(row) for row in found["estimates"]}
    for name in ("friction_force", "sponge_stiffness", "sponge_damping", "slider_damping"):
        assert values[name] == pytest.approx(getattr(truth, name), rel=0.01)
    assert {path.name for path in Path("fit").iterdir()} == {
        "report.html", "identified.yaml", "estimates.csv", "errors.csv", "loops.csv", "fit.csv",
        "correlations.csv", "search.csv", "run.json",
    }  # fmt: skip
    Path("mine.yaml").write_text("name: mine\nextends: fit/identified.yaml\n")
    assert wm_drake("machine", "check", "mine.yaml").code == 0
    mine, reference = load_machine("mine.yaml"), load_machine("reference")
    damper = mine.damper_types["friction"]
    assert damper.sponge_stiffness == pytest.approx(176e3, rel=0.01)
    assert damper.end_bushing == reference.damper_types["friction"].end_bushing
    assert mine.sources["damper_types.friction.sponge_stiffness"].startswith(
        "identified from 4 loops"
    )
    assert mine.gasket == reference.gasket


def test_a_radial_axis_serves_x_and_z_and_a_component_file_serves_the_bench(wm_drake, loops_of):
    files = loops_of(
        "gasket", "--machine", "free_stroke", "--axis", "radial", "-f", "1,5 Hz", "-a", "1,10 mm"
    )
    assert wm_drake("identify", "gasket", *files, "--axis", "radial", "--out", "fit").code == 0
    gasket = load_machine("fit/identified.yaml").gasket
    assert (gasket.stiffness_x, gasket.stiffness_z) == (pytest.approx(8e3), pytest.approx(8e3))
    assert gasket.stiffness_y == load_machine("reference").gasket.stiffness_y
    Path("rubber.yaml").write_text(
        "".join(f"{kind}stiffness_{axis}: 1 {unit}\n" for kind, unit in KINDS for axis in "xyz")
    )
    alone = "--component rubber.yaml --axis radial --out alone --fix 'damping_x=0.05 N s/mm'"
    assert wm_drake(f"identify gasket {alone}", *files).code == 0
    assert load_component("alone/identified.yaml").parameters.stiffness_z == pytest.approx(
        8e3, rel=1e-3
    )
    again = wm_drake("rig gasket --component alone/identified.yaml --axis x -f 1Hz -a 1mm --json")
    assert loop_of(again)["peak_force_N"] == pytest.approx(8.0, rel=1e-3)


def test_fixed_numbers_are_written_with_the_identified_ones(wm_drake, loops_of):
    """Fix on one axis, on the axes copied from it, and with a law that is new to the machine."""
    files = loops_of("gasket", "--axis", "x", "-f", "1,5 Hz", "-a", "5 mm")
    fix = ("--fix", "damping_x=0.06 N s/mm")
    for axis in ("x", "radial"):
        ended = wm_drake("identify", "gasket", *files, "--axis", axis, *fix, "--out", axis)
        assert ended.code == 0
        assert "fixed" in ended.out
    ended = wm_drake("rig gasket --machine x/identified.yaml --axis x -f '5 Hz' -a '5 mm' --json")
    energy = 1e3 * np.pi * 60.0 * 2.0 * np.pi * 5.0 * 5e-3**2
    assert loop_of(ended)["energy_per_cycle_mJ"] == pytest.approx(energy, rel=1e-6)
    reference, one, two = (
        load_machine(m).gasket for m in ("reference", "x/identified.yaml", "radial/identified.yaml")
    )
    assert (one.damping_x, one.damping_z) == (60.0, reference.damping_z)
    assert (two.damping_x, two.damping_z) == (60.0, 60.0)
    assert "fixed by the user" in Path("x/identified.yaml").read_text()
    fixed = pd.read_csv("x/estimates.csv").set_index("unknown").loc["damping_x"]
    assert (fixed.value, fixed.unit, fixed.remark) == (0.06, "N s/mm", "fixed")


def test_a_number_of_a_new_law_may_be_fixed(wm_drake, loops_of):
    files = loops_of("damper", "-f", "1,3 Hz", "-a", "1,5 mm")
    options = ("--law", "coulomb", "--fix", "damping=0.1 N s/mm", "--out", "fit")
    ended = wm_drake("identify", "damper", *files, *options)
    assert ended.code == 0
    damper = load_machine("fit/identified.yaml").damper_types["friction"]
    assert (damper.law, damper.damping) == ("coulomb", 100.0)


def test_a_fixed_rise_of_a_table_stays(wm_drake, loops_of):
    files = loops_of("gasket", "--axis", "x", "-f", "1,5 Hz", "-a", "5 mm")
    options = ("--axis", "x", "--law", "table", "--knots", "2", "--out", "fit")
    rise = ("--fix", "stiffness_x.rise_plus_1=2 N")
    assert wm_drake("identify", "gasket", *files, *options, *rise).code == 0
    table = load_machine("fit/identified.yaml").gasket.stiffness_x
    assert table.force[3] == 2.0
    assert "rise_plus_1 fixed" in Path("fit/identified.yaml").read_text()


def test_other_changes_of_the_machine_are_kept(wm_drake, loops_of):
    files = loops_of("gasket", "--axis", "x", "-f", "1,5 Hz", "-a", "5 mm")
    sets = (
        "--set", "gasket.damping_y=0.07 N s/mm",
        "--set", "damper_types.friction.friction_force=33 N",
        "--set", "loads.middle.unbalances.0.radius=230 mm",
    )  # fmt: skip
    ended = wm_drake("identify", "gasket", *files, "--axis", "x", *sets, "--out", "fit")
    assert ended.code == 0
    machine = load_machine("fit/identified.yaml")
    assert machine.gasket.damping_y == 70.0
    assert machine.gasket.damping_x == pytest.approx(19.0, rel=0.01)
    assert machine.damper_types["friction"].friction_force == 33.0
    text = Path("fit/identified.yaml").read_text()
    assert "# Not in this file: --set loads.middle.unbalances.0.radius=230 mm." in text


def test_a_bad_fit_is_called_bad_first(wm_drake, loops_of):
    sponge = ("--machine", SPONGES)
    files = loops_of("damper", *sponge, "-f", "1,3 Hz", "-a", "1,5 mm")
    ended = wm_drake("identify", "damper", *files, *sponge, "--law", "coulomb", "--out", "fit")
    assert ended.code == 0
    for text in (
        ended.out,
        *(Path("fit", name).read_text() for name in ("identified.yaml", "report.html")),
    ):
        assert "Poor fit" in text
    found = pd.read_csv("fit/fit.csv").loc[0]
    assert found.verdict == "poor"
    assert found.rmse_N > 0.0
    assert pd.isna(found.hints)
    for path in files:
        table = pd.read_csv(path)
        table["force_N"] *= -1.0
        table.to_csv(path, index=False)
    ended = wm_drake("identify", "damper", *files, *sponge, "--out", "flipped", "--json")
    (found,) = json.loads(ended.out)["fit"]
    assert "wrong sign" in found["hints"]
    assert found["hints"] in ended.err


def test_axial_curve_of_a_bushing_is_found_as_a_monotone_table(wm_drake, loops_of):
    files = loops_of(
        "bushing", "--machine", "free_stroke", "--axis", "axial", "-f", "1,7 Hz", "-a", "0.4,1 mm"
    )
    options = "--machine free_stroke --axis axial --law table --knots 5 --out fit"
    assert wm_drake(f"identify bushing {options}", *files).code == 0
    table = load_machine("fit/identified.yaml").bushing_types["connecting"].stiffness_y
    planted = load_machine("free_stroke").bushing_types["connecting"]
    at = np.array([-1e-3, 0.4e-3, 0.8e-3])
    expected = [stiffness_force(x, packed_stiffness(planted.stiffness_y), 0) for x in at]
    assert [stiffness_force(x, packed_stiffness(table), 0) for x in at] == pytest.approx(
        expected, rel=0.05
    )
    assert np.all(np.diff(table.force) >= 0.0)
