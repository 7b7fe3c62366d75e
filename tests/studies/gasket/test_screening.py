"""Screening and the gasket study on functions with a known answer."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from made_up_runs import made_up

from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import (
    SpinProfile,
    varying,
)
from wm_drake.parameters.spin import Region
from wm_drake.parameters.units import Unit
from wm_drake.parameters.vary import entries_of_texts
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.report.quantity import Quantity, shown
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import measure
from wm_drake.simulation.measures.responses import chosen_responses, measures_of
from wm_drake.simulation.runs import simulate
from wm_drake.studies.doe.coding import level_matrix
from wm_drake.studies.doe.design import Design, make_design, read_design
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.gasket.page import gasket_answer
from wm_drake.studies.gasket.screening import at, leading, mean_at, run_screening, runs_of
from wm_drake.studies.gasket.study import GasketTrials, responses_of
from wm_drake.studies.gasket.surface import models_of

NAMES = ("a", "b", "c")
QUANTITIES = {"y": Quantity("y", Unit("m", "mm")), "z": Quantity("z", Unit("N", "N"))}


def additive(design):
    """Return y = 10 + 3 a + b^2 - 2/3, z = a b for load one, twice that for load two."""
    a, b, _ = design.levels.T.astype(float)
    one = {"y": 10.0 + 3.0 * a + b**2 - 2.0 / 3.0, "z": 5.0 + a * b}
    return runs_of({"one": one, "two": {n: 2.0 * v for n, v in one.items()}}, QUANTITIES)


@pytest.fixture(scope="module")
def screening():
    return run_screening(make_design("full", NAMES), additive)


def test_known_effects_are_recovered(screening):
    of = at(screening, ("two", "y"))
    assert of["mean"].item() == pytest.approx(20.0)
    effects = of.effect.sel(other_level="")
    assert effects.sel(term="a").values == pytest.approx([-6.0, 0.0, 6.0])
    assert effects.sel(term="b").values == pytest.approx(np.array([2.0, -4.0, 2.0]) / 3.0)
    assert of.share.sel(term="c").item() == pytest.approx(0.0, abs=1e-12)
    assert of.share.sel(term="a").item() == pytest.approx(6.0 / (6.0 + 2.0 / 9.0))
    assert at(screening, ("one", "z")).interaction.item() == pytest.approx(1.0)


def test_leading_terms_are_those_above_the_thresholds(screening):
    assert leading(at(screening, ("one", "y"))) == ["a"]
    assert leading(at(screening, ("one", "z"))) == ["a:b"]


def test_mean_at_levels_is_the_mean_over_the_others(screening):
    of, levels = at(screening, ("one", "z")), screening.design.levels
    for (b, a), mean in np.ndenumerate(mean_at(of, "b", "a")):
        chosen = (levels[:, 0] == a - 1) & (levels[:, 1] == b - 1)
        assert mean == pytest.approx(of.value.values[chosen].mean())


def factors_of(machine, *texts):
    """Return the factors of texts of `--factor`, with a number in place of a table."""
    entries = entries_of_texts(texts, gasket_entries(), "--factor", "50 %..150 %")
    return varying(machine, entries, tables="linear")


def answer_of(screening, machine, factors=()):
    """Return the answer of a screening; without factors they have no physical values."""
    trials = SimpleNamespace(factors=factors, parameters=machine, loads=())
    return gasket_answer(screening, models_of(screening), trials)


def test_tables_are_the_same_bytes_each_time(reference, tmp_path):
    factors = factors_of(reference, "C_L", "C_T", "K_Lx").every
    screening = run_screening(make_design("full", ("C_L", "C_T", "K_Lx")), additive)
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        answer_of(screening, reference, factors).write(tmp_path / name)
    files = {path.name: path.read_bytes() for path in (tmp_path / "first").iterdir()}
    assert files == {path.name: path.read_bytes() for path in (tmp_path / "second").iterdir()}
    variance = pd.read_csv(tmp_path / "first" / "variance.csv").set_index(["load", "response"])
    assert variance.loc[("two", "y"), ["mean", "smallest", "largest"]].tolist() == pytest.approx(
        [20e3, 38e3 / 3, 80e3 / 3]
    )
    assert variance.loc[("two", "y"), "unit"] == "mm"
    assert len(pd.read_csv(tmp_path / "first" / "runs.csv")) == 54
    effects = pd.read_csv(tmp_path / "first" / "effects.csv", dtype={"other_level": "string"})
    of_pair = effects[
        (effects.load == "one") & (effects.response == "z") & (effects.term == "C_L:C_T")
    ]
    assert len(of_pair) == 9
    first = of_pair[(of_pair.level == -1) & (of_pair.other_level == "-1")]
    assert first.effect.item() == pytest.approx(1.0)


def failing(trials):
    def evaluate(design):
        runs = additive(design)
        rows = [trial - 1 for trial in trials]
        runs.value.loc[{"load": "two"}][rows] = np.nan
        runs.failed.loc[{"load": "two"}][rows] = "diverged"
        return runs

    return evaluate


def test_failed_runs_are_omitted_if_the_others_determine_the_effects():
    design = make_design("full", NAMES)
    screening = run_screening(design, failing([4, 21]))
    of = at(screening, ("two", "y"))
    assert of.effect.sel(term="a", level=1, other_level="").item() == pytest.approx(6.0)
    assert int(of.residual.notnull().sum()) == 25
    with pytest.raises(InputError, match="load two: 20 of 27 runs failed"):
        run_screening(design, failing(range(1, 21)))


SHORT = SpinProfile(time=(0.0, 2.0), speed=(5.0, 12.0))


def test_cases_of_trials_have_their_levels(reference):
    texts = ("K_Lx", "loads.middle.unbalances.0.mass=80 %..120 %")
    factors = factors_of(reference, *texts)
    machine = build_machine(factors.at_levels([0, 0]))
    loads = [Case(name, reference.loads[name], SHORT) for name in ("middle", "counter")]
    trials = GasketTrials(factors, loads)
    assert trials.measures == ("extremes", "gap", "spring tensions")
    design = Design("own", texts, level_matrix(2), "main")
    experiment = Experiment(machine, trials.measures, loads=tuple(loads))
    responses = trials.responses(design, experiment)
    assert responses["load"].values.tolist() == ["middle", "counter"]
    names = [letter + axis for letter in "DFM" for axis in "xyz"]
    assert responses.response.values.tolist() == [*names, "gap"]
    # levels 0, 1: heavier, middle load
    heavy, _ = experiment.cases_of(factors.at_levels(design.levels[5]), "")
    assert heavy.load.unbalances[0].mass == pytest.approx(1.2)
    measures = measure(simulate(machine, heavy), Scene(heavy.parameters))
    expected = [
        *measures.detergent_displacement.values,
        *measures.gasket_force.values,
        *measures.gasket_moment.values,
        measures.smallest_gap.distance,
    ]
    values = responses.value
    assert values.sel(load="middle", trial=6).values == pytest.approx(expected, rel=1e-9)
    counter = values.sel(load="counter", response="Dx")
    assert counter.sel(trial=4) == counter.sel(trial=6)  # its own masses stay


def test_any_measure_can_be_a_response(machine, reference):
    profile = SpinProfile(
        time=(0.0, 2.0), speed=(5.0, 12.0), regions=(Region(name="R1", begin=0.5, end=1.5),)
    )
    names = ("gap", "amplitude_Xr", "critical_speed", "power means", "region_displacement_R1_S1_z")
    names += ("mount_force_rms_springs.left", "cabinet_moment_peak")
    names += ("turn_margin", "drive_mean_torque", "drive_speed_ripple", "drive_end_speed")
    chosen = chosen_responses(reference, profile, names)
    case = Case("middle", reference.loads["middle"], profile)
    experiment = Experiment(machine, measures_of(reference, chosen), loads=(case,))
    table = experiment.at([""], [reference])
    values = responses_of(table, chosen).value.sel(load="middle", trial=1)
    found = dict(zip(values.response.values.tolist(), shown(values), strict=True))
    assert found["gap"] == pytest.approx(1e3 * table.smallest_gap.item())
    assert found["amplitude_Xr"] == pytest.approx(1e3 * table.amplitude.sel(sensor="Xr").item())
    rpm = 30.0 / np.pi * table.critical_speed.sel(sensor="Yf").item()
    assert found["critical_speed_Yf"] == pytest.approx(rpm)
    assert found["power_mean_Zr"] == pytest.approx(1e3 * table.power_mean.sel(sensor="Zr").item())
    rms = table.region_displacement.sel(accelerometer="S1", axis="z").item()
    assert found["region_displacement_R1_S1_z"] == pytest.approx(1e3 * rms)
    rms = table.mount_force_rms.sel(mount="springs.left").item()
    assert found["mount_force_rms_springs.left"] == pytest.approx(rms)
    peak = table.cabinet_moment_peak.sel(axis="y").item()
    assert found["cabinet_moment_peak_y"] == pytest.approx(peak)
    assert found["turn_margin"] == pytest.approx(table.turn_margin.item())
    assert found["drive_mean_torque"] == pytest.approx(table.drive_mean_torque.item())
    assert found["drive_speed_ripple"] == pytest.approx(100.0 * table.drive_speed_ripple.item())
    # the last revolution is on the ramp, below the end of the profile
    assert found["drive_end_speed"] == pytest.approx(12.0 * 30.0 / np.pi, rel=0.2)
    assert len(found) == 1 + 1 + 2 * len(reference.sensors) + 1 + 1 + 3 + 4


def test_runs_that_touch_are_marked(reference):
    chosen = chosen_responses(reference, SHORT, ["Dx"])
    # gap and tensions are measured also where they are no responses
    assert measures_of(reference, chosen) == ("extremes", "gap", "spring tensions")
    table = xr.Dataset(
        {
            "detergent_displacement": (("run", "axis"), np.ones((4, 3))),
            "smallest_gap": ("run", [0.002, -0.001, 0.0, -0.003]),
            "smallest_spring_tension": (("run", "spring"), [[0, 1], [0, 0], [-1, 2], [0, 0]]),
            "diverged": ("run", np.array(["", "", "", "at 1 s"], dtype=object)),
        },
        {"run": range(4), "spring": ["left", "rear"]},
    )
    loads = [Case(name, reference.loads["middle"], SHORT) for name in ("one", "two")]
    data = made_up(lambda _: table, reference, loads).at(["1", "2"], [reference] * 2)
    runs = responses_of(data, chosen)
    assert runs.overlap.sel(load="two", trial=1) == -0.001
    assert runs.overlap.sel(load="one", trial=2) == 0.0
    assert int(runs.overlap.notnull().sum()) == 2
    assert runs.slack.values.tolist() == [["left", ""], ["left, rear", ""]]
    assert np.isnan(runs.value.sel(load="two", trial=2, response="Dx"))


def test_physical_values_are_in_design_and_runs(reference, tmp_path):
    texts = ("C_L", "K_Lx=2 N/mm..4 N/mm")
    factors = factors_of(reference, *texts)
    design = Design("own", ("C_L", "K_Lx"), level_matrix(2), "main")
    y = {"y": np.arange(9.0)}
    screening = run_screening(design, lambda _: runs_of({"one": y}, {"y": QUANTITIES["y"]}))
    answer_of(screening, reference, factors.every).write(tmp_path)
    for name in ("design.csv", "runs.csv"):
        table = pd.read_csv(tmp_path / name)
        assert list(table["K_Lx_N_per_mm"]) == pytest.approx([2.0, 3.0, 4.0] * 3)
        damping = 1e-3 * factors.at_levels([-1, 0]).gasket.damping_x
        assert table["C_L_Ns_per_mm"][0] == pytest.approx(damping)
    again = read_design(tmp_path / "design.csv", ("C_L", "K_Lx"), "main")
    np.testing.assert_array_equal(again.levels, design.levels)
