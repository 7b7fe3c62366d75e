"""The study of a cycle: pieces against a whole run, windows against its record, page and files."""

from pathlib import Path

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.engines.compiled.packing import pack
from wm_drake.engines.compiled.pieces import run_pieces
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.engines.compiled.stepping import choose_stepping
from wm_drake.model.scene import Scene
from wm_drake.parameters import SpinProfile, load_load, load_profile
from wm_drake.simulation.cases import Case
from wm_drake.simulation.feet import foot_loads
from wm_drake.simulation.measures.record import wrenches_on_cabinet
from wm_drake.studies.cycle.study import parts_of, run_cycle, unbalance_of
from wm_drake.studies.cycle.task import WET_LAUNDRY

PROFILE = SpinProfile.model_validate(
    {
        "time": (0.0, 1.0, 8.0, 9.5),
        "speed": (5.0, 15.0, 15.0, 12.0),
        "regions": [
            {"name": "up", "begin": 1.0, "end": 4.0},
            {"name": "on", "begin": 4.0, "end": 9.0},
        ],
    }
)


@pytest.fixture(scope="module")
def machine():
    return wm.build_machine("reference")


@pytest.fixture(scope="module")
def case():
    return Case("wet laundry", load_load(WET_LAUNDRY), PROFILE)


@pytest.mark.slow
def test_pieces_are_the_whole_run(machine, case):
    setup = machine.set_up()
    stepping = choose_stepping(setup, *pack(setup), PROFILE, machine.parameters.step)
    setup = machine.set_up(case.load)
    whole = run_compiled(
        setup, PROFILE, stepping.step, lambda _: None, integrator=stepping.integrator
    )
    pieces = list(run_pieces(setup, PROFILE, stepping, 5e-3, 321))
    assert [len(piece.time) for piece in pieces] == [321] * 5 + [len(whole.time) - 5 * 321]
    for name in ("time", "state", "acceleration", "motor_torque", "water", "deformation"):
        joined = np.concatenate([getattr(piece, name) for piece in pieces])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)


@pytest.mark.slow
def test_windows_have_the_extremes_of_the_record(machine, case):
    course = run_cycle(machine, case).course
    record = wm.simulate(machine, case)
    rows = round(float(np.diff(course.time)[0]) / 5e-3)
    count = course.sizes["time"]
    assert rows == 150
    assert count == len(record.time) // rows
    displacement = record.displacement.values[: rows * count].reshape(count, rows, -1)
    np.testing.assert_allclose(course.half_swing, 0.5 * np.ptp(displacement, axis=1), rtol=1e-9)
    left = record.mass_left.values[rows - 1 :: rows][:count]
    np.testing.assert_allclose(course.mass, left.sum(axis=1), rtol=1e-12)
    gap = Scene(machine.parameters).smallest_gap(
        record.time.values,
        np.column_stack([record.tub_angle, record.tub_position]),
        record.attrs["rest_pose"],
    )
    assert float(course.gap.min()) == pytest.approx(gap.distance, abs=1e-9)
    feet = foot_loads(
        machine.parameters.cabinet, machine.parameters.gravity, wrenches_on_cabinet(record)
    )
    assert float(course.foot_largest.max()) == pytest.approx(feet.normal.max(), rel=1e-9)
    assert float(course.foot_smallest.min()) == pytest.approx(feet.normal.min(), rel=1e-9)


def test_unbalance_is_the_vector_sum(machine, case):
    setup = machine.set_up(case.load)
    a, b = (u.radius * np.exp(1j * u.phase) for u in case.load.unbalances)
    masses = np.array([[0.6, 0.25], [0.3, 0.2]])
    expected = [abs(m * a + n * b) for m, n in masses]
    np.testing.assert_allclose(unbalance_of(setup, masses), expected)


@pytest.mark.slow
def test_parts_are_those_of_the_profile(machine, case):
    course = run_cycle(machine, case).course
    parts = parts_of(course, case)
    assert parts["part"].values.tolist() == ["up", "on"]
    inside = course.sel(time=slice(4.0, 9.0))
    assert float(parts.gap[1]) == float(inside.gap.min())
    assert float(parts.mass[1]) == float(inside.mass[-1])


def test_shipped_cycle_lasts_a_quarter_of_an_hour_and_ends_its_regions_in_order():
    profile = load_profile("household")
    assert profile.duration == 900.0
    assert profile.highest_speed == pytest.approx(1400.0 * np.pi / 30.0)
    assert profile.regions[-1].name == "spin_1400"
    load = load_load(WET_LAUNDRY)
    dry = load.masses(np.zeros(2))
    last = load.masses(np.array([u.water.left[-1] for u in load.unbalances]))
    water = (last - dry) / dry  # cotton keeps 55 % of its dry mass at 1400 rpm
    assert water[0] == pytest.approx(0.55, abs=0.01)


@pytest.mark.slow
def test_command_writes_page_and_files(wm_drake, tmp_path):
    Path("short.yaml").write_text(
        "steps: [{ramp_to: 200 rpm, rate: 40 rpm/s}, {hold_until: 12 s}]\n", encoding="utf-8"
    )
    result = wm_drake("study", "cycle", "--profile", "short.yaml", "--out", tmp_path / "out")
    assert result.code == 0, result.err
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"report.html", "course.csv", "parts.csv"} <= names
