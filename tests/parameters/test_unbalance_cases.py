"""Cases of a spin-cycle study: the 33 of [A] Table 9, a user's table, and regions of a profile."""

import numpy as np
import pytest

from wm_drake.errors import InputError
from wm_drake.parameters import load_machine, load_profile, with_value
from wm_drake.parameters.unbalance_cases import load_unbalance_cases, unbalance_planes

HEAD = "case,front_g,rear_g,phase_deg\n"


def test_the_33_cases_come_in_the_order_of_table_9():
    cases = load_unbalance_cases()
    masses = (200, 400, 600)
    pairs = [(m, 0, 0) for m in masses] + [(0, m, 0) for m in masses]
    pairs += [(front, rear, phase) for phase in (0, 90, 180) for rear in masses for front in masses]
    shown = [(1e3 * c.front, 1e3 * c.rear, np.rad2deg(c.phase)) for c in cases]
    np.testing.assert_allclose(shown, pairs)
    errors = np.array([case.published_error_percent for case in cases])
    # [A] section 4.2 prints mean and standard deviation
    assert errors.mean() == pytest.approx(20.11, abs=0.01)
    # standard deviation of the 33 values, not of a sample
    assert errors.std() == pytest.approx(4.10, abs=0.005)


def test_a_case_is_a_load_in_the_planes_of_the_machine(reference):
    case = load_unbalance_cases()[20]  # 600 g, 400 g, 90 deg
    front, rear = case.load(reference).unbalances
    planes = unbalance_planes(reference)
    assert (front.mass, front.phase, front.y) == (0.6, 0.0, planes.front.y)
    assert (rear.mass, rear.phase, rear.y) == (0.4, pytest.approx(np.pi / 2), planes.rear.y)
    single = load_unbalance_cases()[0].load(reference)
    assert len(single.unbalances) == 1


def test_phase_error_shifts_the_rear_mass_of_pairs_only(reference):
    wrong = with_value(reference, "imperfections.phase_error", "10 deg")
    cases = load_unbalance_cases()
    assert cases[20].load(wrong).unbalances[1].phase == pytest.approx(np.deg2rad(100.0))
    assert cases[4].load(wrong) == cases[4].load(reference)


def test_machine_without_positions_for_unbalances_is_refused(reference):
    bare = reference.model_copy(update={"loads": {"middle": reference.loads["middle"]}})
    with pytest.raises(InputError, match="unbalance_planes: is missing"):
        unbalance_planes(bare)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD, "has no case"),
        ("case,front,rear\n1,2,3\n", "needs the columns case,front_g"),
        (HEAD + "1,-200,0,0\n", "case 1.front: '-200 g' is out of range"),
        (HEAD + "1,x,0,0\n", "case 1.front: 'x g' is not a number"),
        (HEAD + "1,200,0,0\n1,400,0,0\n", "case '1' occurs twice"),
    ],
)
def test_bad_tables_are_refused(tmp_path, text, message):
    path = tmp_path / "cases.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=r"cases\.csv") as refused:
        load_unbalance_cases(path)
    assert message in str(refused.value)


@pytest.mark.parametrize("name", ["spin_cycle", "run_up", "ifb_9kg"])
def test_shipped_profiles_have_eight_regions(name):
    profile = load_profile(name)
    assert [region.name for region in profile.regions] == [f"R{number}" for number in range(1, 9)]


def test_run_up_is_that_of_the_reference_machine():
    assert (load_profile("run_up").time, load_profile("run_up").speed) == (
        load_machine("reference").profile.time,
        load_machine("reference").profile.speed,
    )


def test_regions_of_a_csv_reach_from_row_to_row(tmp_path):
    path = tmp_path / "p.csv"
    path.write_text("time_s,speed_rpm,region\n0,0,\n1,10,low\n2,20,low\n4,20,high\n5,0,\n")
    regions = load_profile(path).regions
    assert [(r.name, r.begin, r.end) for r in regions] == [("low", 1.0, 4.0), ("high", 4.0, 5.0)]


@pytest.mark.parametrize(
    ("regions", "message"),
    [
        ("[{name: A, begin: 0 s, end: 9 s}]", "end at the end of the profile"),
        ("[{name: A, begin: 1 s, end: 1 s}]", "end after its begin"),
        ("[{name: A, begin: 0 s, end: 2 s}, {name: B, begin: 1 s, end: 3 s}]", "must begin at"),
        ("[{name: A, begin: 0 s, end: 1 s}, {name: A, begin: 1 s, end: 3 s}]", "'A' occurs twice"),
        ("[{name: A, begin: 0, end: 1 s}]", "'0' has no unit"),
        ("[{name: 'a b', begin: 0 s, end: 1 s}]", "is not a name"),
    ],
)
def test_bad_regions_are_refused(tmp_path, regions, message):
    path = tmp_path / "p.yaml"
    path.write_text(f"time: (0, 4) s\nspeed: (0, 100) rpm\nregions: {regions}\n")
    with pytest.raises(InputError) as refused:
        load_profile(path)
    assert message in str(refused.value)


def test_names_of_cases_are_texts(tmp_path):
    path, names = tmp_path / "cases.csv", ["01", "1", "1e3", "NA", "true", "007", "1_0"]
    rows = "".join(f"{name},300,0,0\n" for name in names)
    path.write_text(f"case,front_g,rear_g,phase_deg\n{rows}")
    assert [case.name for case in load_unbalance_cases(path)] == names
