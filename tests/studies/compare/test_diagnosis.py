"""Discrete causes that explain a recording: each planted one is named first, others are not."""

from pathlib import Path

import numpy as np
import pytest

from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile, load_machine, with_values
from wm_drake.parameters.recorded import Synchronous
from wm_drake.parameters.recorded_sensors import recorded_test_of
from wm_drake.simulation.alignment import Alignment
from wm_drake.simulation.cases import Case
from wm_drake.simulation.recorded_signal import recorded_signal
from wm_drake.simulation.runs import simulate
from wm_drake.studies.compare.diagnosis import Suspect, diagnosed
from wm_drake.studies.compare.pairs import Pair
from wm_drake.studies.compare.recordings import TestRecording as Recorded
from wm_drake.studies.compare.task import sensor_points

PROFILE = SpinProfile(time=(0.0, 15.0, 18.0), speed=(0.0, 35.0, 35.0))
NAMES = ("S1_x", "S1_y", "S1_z", "S2_x", "S3_z")


@pytest.fixture(scope="module")
def runs():
    """Return sensors, points, and runs: as declared, backwards, of another load and machine."""
    parameters = load_machine("reference")
    changes = {
        f"spring_types.{n}.stiffness": 0.6 * s.stiffness for n, s in parameters.spring_types.items()
    }
    friction = "damper_types.friction.friction_force"
    changes[friction] = 2.5 * parameters.damper_types["friction"].friction_force
    machine, other = build_machine(parameters), build_machine(with_values(parameters, changes))
    loads = parameters.loads
    backwards = PROFILE.model_copy(update={"speed": tuple(-w for w in PROFILE.speed)})
    cases = {
        "declared": (machine, loads["middle"], PROFILE),
        "backwards": (machine, loads["middle"], backwards),
        "counter": (machine, loads["counter"], PROFILE),
        "other": (other, loads["middle"], PROFILE),
    }
    records = {n: simulate(m, Case(n, load, profile)) for n, (m, load, profile) in cases.items()}
    sensors = recorded_test_of(parameters).sensors
    sensors = {name: sensors[name] for name in NAMES}
    return sensors, sensor_points(machine, recorded_test_of(parameters)), records


def recorded(runs, of="declared", changes=None):
    """Return the signals of sensors that differ from the declared ones, with noise."""
    sensors, points, records = runs
    turned = {
        n: sensor.model_copy(update=(changes or {}).get(n, {})) for n, sensor in sensors.items()
    }
    columns = [recorded_signal(records[of], s, points[n]) for n, s in turned.items()]
    noise = np.random.default_rng(1).normal(0.0, 0.02, (len(columns[0]), len(columns)))
    return np.stack(columns, axis=1) + noise


def diagnosis(runs, signals, others=("backwards", "counter")):
    """Return the diagnosis of signals recorded as declared, with causes of other runs."""
    sensors, points, records = runs

    def suspect(name, words):
        run = records[name]
        channels = Synchronous(
            Path("x.csv"), run.time.values, dict(zip(NAMES, signals.T, strict=True))
        )
        pair = Pair(Recorded(channels), run, Alignment(), signals, signals)
        return Suspect(words, pair, sensors, points)

    return diagnosed(suspect("declared", ""), [suspect(name, name) for name in others])


QUARTER = {"S1_x": {"axis": "y"}, "S1_y": {"axis": "x", "polarity": "negative"}}


@pytest.mark.parametrize(
    ("of", "changes", "causes"),
    [
        ("backwards", {}, ["backwards"]),
        ("counter", {}, ["counter"]),
        ("declared", {"S2_x": {"polarity": "negative"}}, ["S2_x: it has the other sign"]),
        ("declared", {"S2_x": {"axis": "y"}}, ["S2_x: its axis is y, not x"]),
        ("declared", {"S3_z": {"gain": 9.80665}}, ["the units of S3_z are larger"]),
        ("declared", {"S3_z": {"gravity": "removed"}}, ["S3_z: gravity is taken out"]),
        ("declared", {"S3_z": {"ac_coupling": 1.6}}, ["S3_z: it is AC-coupled at about 1.6 Hz"]),
        ("declared", QUARTER, ["S1_x and S1_y are exchanged, and S1_x has the other sign"]),
        ("counter", {"S2_x": {"polarity": "negative"}}, ["counter", "S2_x: it has the other sign"]),
    ],
)
def test_a_planted_cause_is_named_first(runs, of, changes, causes):
    found = diagnosis(runs, recorded(runs, of, changes))
    assert found.explanations, found.text
    best = found.explanations[0]
    assert best.misfit < 0.1
    assert len(best.causes) == len(causes)
    for cause in causes:
        assert any(cause in each for each in best.causes)


@pytest.mark.parametrize(
    ("order", "count"), [((3, 1, 2, 0, 4), 1), ((0, 1, 4, 3, 2), 1), ((2, 1, 3, 0, 4), 2)]
)
def test_exchanged_channels_of_like_sensors_are_named(runs, order, count):
    """Exchange S1_x and S2_x, S1_z and S3_z, and three in a ring."""
    best = diagnosis(runs, recorded(runs)[:, order]).explanations[0]
    assert best.misfit < 0.05
    assert len(best.causes) == count
    assert all("are exchanged" in cause for cause in best.causes)


SIGNS = np.array([-1.0, 1.0, 1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("factor", "causes"),
    [
        (-1.0, ["all sensors have the other sign"]),
        (SIGNS, ["S1_x: it has the other sign", "S2_x: it has the other sign"]),
        (1e3, ["the units of S1_x, S1_y, S1_z, S2_x, S3_z are larger"]),
    ],
)
def test_faults_of_several_sensors_are_named(runs, factor, causes):
    best = diagnosis(runs, factor * recorded(runs)).explanations[0]
    assert best.misfit < 0.05
    assert len(best.causes) == len(causes)
    for cause in causes:
        assert any(cause in each for each in best.causes)


def test_as_declared_nothing_is_tried(runs):
    found = diagnosis(runs, recorded(runs))
    assert not found.unlike
    assert not found.shifted
    assert found.misfit < 0.02


def test_another_machine_is_explained_by_none(runs):
    found = diagnosis(runs, recorded(runs, "other"))
    assert found.unlike
    assert not found.explanations
    assert "none of these explains it" in found.text


def test_an_unlike_angle_at_the_start_explains_itself(runs):
    """Turn the load in the drum, as nobody knows where it stood."""
    sensors, points, records = runs
    signals = recorded(runs)
    run = records["declared"]
    turned = run.assign(drum_angle=run.drum_angle + 1.0)
    found = diagnosis((sensors, points, {**records, "declared": turned}), signals)
    assert found.misfit < 0.02
