"""`calibrate` with records: planted numbers are recovered, wrong structures are called wrong."""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lab_writers import write_mdf

from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, load_profile, with_values
from wm_drake.parameters.recorded_sensors import RecordedSensor, load_recorded_test
from wm_drake.simulation.cases import Case
from wm_drake.simulation.recorded_signal import recorded_signal
from wm_drake.simulation.runs import simulate
from wm_drake.studies.calibrate.records import RecordModel, turned_load
from wm_drake.studies.next.knowledge import of_calibration_folder

SENSORS = ("S1_x", "S1_z", "S3_x", "S3_z")
FRICTION = "damper_types.friction.friction_force"
PROFILE = "time: (0, 20, 24) s\nspeed: (0, 320, 320) rpm\n"
NOISE, GAIN, OFFSET, TILT = 0.02, 0.01, 0.1, np.deg2rad(2.0)
"""Noise [m/s^2], deviations of gains and offsets [1, m/s^2], and tilt [rad] of the sensors."""


def plant(changes, seed=1, repeats=3, angle=0.0, stem="run", of_load="middle", off=(0.0, 0.0, 0.0)):
    """Write records of the reference machine with other numbers, by sensors that are not ideal.

    `off` is by what the place of each sensor is off. [m]
    """
    parameters = load_machine("reference")
    Path("p.yaml").write_text(PROFILE)
    machine = build_machine(with_values(parameters, changes))
    load = turned_load(machine.parameters.loads[of_load], angle)
    case = Case(of_load, load, load_profile("p.yaml"))
    record, points = simulate(machine, case), machine.set_up().accelerometer_points
    generator = np.random.default_rng(seed)
    frames = parameters.accelerometer_frames()
    lines = ["load: middle\nsensors:\n"]
    signals = {}
    for number, name in enumerate(SENSORS, 1):
        tilt = TILT * generator.choice([-1.0, 1.0], 3) / np.sqrt(3.0)
        fields = {"frame": "any", "axis": name[-1], "tilt": tilt.tolist()}
        sensor = RecordedSensor.model_validate(fields)
        signals[f"Acc {number}"] = recorded_signal(record, sensor, points[name[:2]] + np.array(off))
        place = f"frame: {frames[name[:2]]}, axis: {name[-1]}"
        lines.append(f"  {name}: {{channel: Acc {number}, {place}}}\n")
    Path("test.yaml").write_text("".join(lines))
    for repeat in range(repeats):
        late = int(generator.integers(100, 400))
        channels = {}
        for name, signal in signals.items():
            seen = signal[late:] * generator.normal(1.0, GAIN) + generator.normal(0.0, OFFSET)
            channels[name] = (seen + generator.normal(0.0, NOISE, len(seen)), "m/s^2")
        time = record.time.values[late:]
        write_mdf(Path(f"{stem}_{repeat}.mf4"), time - time[0], channels)
    return [f"{stem}_{repeat}.mf4" for repeat in range(repeats)]


@pytest.fixture
def calibrate(wm_drake):
    """Return a function that calibrates the reference machine to records."""

    def command(files, *words, code=0):
        ended = wm_drake(
            "calibrate", *files, "--test", "test.yaml", "--profile", "p.yaml", *words,
            "--out", "out", "--overwrite", "--json",
        )  # fmt: skip
        assert ended.code == code, ended.err
        return json.loads(ended.out) if code == 0 else ended.err

    return command


@pytest.mark.slow
@pytest.mark.parametrize(
    "by",
    [
        "envelope",
        "order",
        *(pytest.param(by, marks=pytest.mark.hours) for by in ("rms", "history")),
    ],
)
def test_a_planted_friction_is_found(calibrate, by):
    truth = 1.2 * load_machine("reference").damper_types["friction"].friction_force
    result = calibrate(plant({FRICTION: truth}), "--unknown", FRICTION, "--by", by)
    found = result["estimates"][0]
    assert found["value"] == pytest.approx(truth, rel=0.03)
    assert found["lower_95"] < found["upper_95"]
    verdict = result["numbers"][0]
    assert (verdict["verdict"], verdict["structure"]) == ("good", "not refuted")
    text = Path("out/calibrated.yaml").read_text()
    assert "calibrated to run_0.mf4" in text
    test = load_recorded_test(Path("out/calibrated_test.yaml"))
    for name, sensor in test.sensors.items():  # gains and tilts that were planted, as found
        assert sensor.gain == pytest.approx(1.0, abs=4.0 * GAIN)
        assert np.abs(sensor.tilt).max() < 4.0 * TILT, name
    machine = build_machine(load_machine("reference"))
    knowledge = of_calibration_folder(machine, "out/calibrated_vary.yaml", Path("out"))
    assert list(knowledge.names) == [FRICTION]
    assert knowledge.values(np.zeros((1, 1))).item() == pytest.approx(found["value"], rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "off", "old", "new", "number", "value"),
    [
        (1.05, (0.0, 0.0, 0.0), "load:", "load_deviation: 5 %\nload:", "mass of load middle", 1.05),
        (1.0, (0.0, 0.03, 0.0), "axis:", "place_deviation: 20 mm, axis:", "y of S1_x", 30.0),
    ],
)
def test_what_is_not_known_of_load_and_places_is_found_or_said(
    calibrate, changes, off, old, new, number, value
):
    """Plant a load, or places of sensors, that are off; the friction is within its interval."""
    machine = load_machine("reference")
    key, mass = "loads.middle.unbalances.0.mass", machine.loads["middle"].unbalances[0].mass
    truth = 1.35 * machine.damper_types["friction"].friction_force
    files = plant({FRICTION: truth, key: changes * mass}, off=off)
    words = ("--unknown", FRICTION)
    wrong = calibrate(files, *words)["estimates"][0]
    assert not wrong["lower_95"] < truth < wrong["upper_95"]
    text = Path("test.yaml").read_text()
    Path("test.yaml").write_text(text.replace(old, new))
    found = {row["unknown"]: row for row in calibrate(files, *words)["estimates"]}
    assert found[FRICTION]["lower_95"] < truth < found[FRICTION]["upper_95"]
    assert found[FRICTION]["value"] == pytest.approx(truth, rel=0.03)
    assert found[number]["lower_95"] < value < found[number]["upper_95"]


SOON = ("springs", "envelope")
"""What CI runs of the next test: it takes seconds each."""


@pytest.mark.parametrize(
    ("what", "by"),
    [
        pytest.param(what, by, marks=pytest.mark.slow if (what, by) == SOON else pytest.mark.hours)
        for what in ("springs", "gasket")
        for by in ("envelope", "order", "rms", "history")
    ],
)
def test_a_wrong_structure_is_called_wrong(calibrate, what, by):
    """Plant springs that are half as stiff again, or no gasket; free the friction only."""
    machine = load_machine("reference")
    changes = {
        f"spring_types.{n}.stiffness": 1.5 * s.stiffness for n, s in machine.spring_types.items()
    }
    if what == "gasket":
        changes = {"gasket": None}
    result = calibrate(plant(changes), "--unknown", FRICTION, "--by", by)
    assert result["numbers"][0]["structure"] == "wrong"
    assert result["numbers"][0]["misfit"] > 2.0


@pytest.mark.parametrize(
    ("unknown", "message"),
    [
        ("gasket.stifness_x", "did you mean 'stiffness_x'"),
        ("gravity=(1, 2) mm", "gravity"),
        ("damper_types.friction.friction_force=(-1, 2) N", "out of range"),
    ],
)
def test_wrong_unknowns_are_refused(calibrate, unknown, message):
    Path("run.csv").write_text("time [s],Xr [mm]\n0,1\n1,2\n")
    Path("p.yaml").write_text(PROFILE)
    Path("test.yaml").write_text("load: middle\nsensors: {Xr: {axis: x, frame: sensor_Xr}}\n")
    error = calibrate(["run.csv"], "--unknown", unknown, code=2)
    assert message in error
    assert len(error.strip().splitlines()) == 1


def test_noise_is_refused(calibrate):
    """Give a record of accelerometers that lie on a table: gravity and noise."""
    parameters, time = load_machine("reference"), 0.005 * np.arange(4000)
    generator = np.random.default_rng(2)
    noise = {n: (9.81 + generator.normal(0.0, NOISE, len(time)), "m/s^2") for n in SENSORS}
    write_mdf(Path("run.mf4"), time, noise)
    frames = parameters.accelerometer_frames()
    places = [f"  {n}: {{frame: {frames[n[:2]]}, axis: {n[-1]}}}\n" for n in SENSORS]
    Path("test.yaml").write_text(f"load: middle\nsensors:\n{''.join(places)}")
    Path("p.yaml").write_text(PROFILE)
    error = calibrate(["run.mf4"], "--unknown", FRICTION, code=2)
    assert error.startswith("run.mf4: no sensor shows the turning drum")
    assert len(error.strip().splitlines()) == 1


def exchange(one, other):
    """Exchange two cables."""
    text = Path("test.yaml").read_text().replace(f"Acc {one},", "Acc ,")
    text = text.replace(f"Acc {other},", f"Acc {one},").replace("Acc ,", f"Acc {other},")
    Path("test.yaml").write_text(text)


def test_exchanged_cables_are_named_before_the_fit(calibrate):
    files = plant({FRICTION: 1.2 * 34.38}, repeats=1)
    exchange(1, 2)
    error = calibrate(files, "--unknown", FRICTION, code=2)
    assert "what explains it: the channels of S1_x and S1_z are exchanged" in error


@pytest.mark.slow
def test_a_cause_that_only_the_fitted_machine_shows_is_named(wm_drake):
    """Exchange sensors along one axis, and let the friction differ as much as they do."""
    files = plant({FRICTION: 1.2 * 34.38}, repeats=1)
    exchange(2, 4)
    words = ("--test", "test.yaml", "--profile", "p.yaml", "--unknown", FRICTION)
    ended = wm_drake("calibrate", *files, *words, "--by", "order", "--out", "out", "--json")
    assert json.loads(ended.out)["numbers"][0]["structure"] == "wrong"
    assert "what explains it: the channels of S1_z and S3_z are exchanged" in ended.err
    assert "none of these explains it" not in ended.err


def test_a_record_of_one_load_given_for_another_is_refused(calibrate):
    (file,) = plant({}, repeats=1)
    Path("copy.mf4").write_bytes(Path(file).read_bytes())
    error = calibrate([file, "counter=copy.mf4"], "--unknown", FRICTION, code=2)
    assert error.startswith("copy.mf4: has the same samples as run_0.mf4")


@pytest.mark.slow
def test_signals_over_time_tell_the_angle_of_the_drum_and_the_clock(calibrate):
    """Plant a drum that stood 40 degrees further at the start."""
    truth = 1.1 * load_machine("reference").damper_types["friction"].friction_force
    files = plant({FRICTION: truth}, repeats=1, angle=np.deg2rad(40.0))
    result = calibrate(files, "--unknown", FRICTION, "--by", "history")
    found = {row["unknown"]: row for row in result["estimates"]}
    assert found[FRICTION]["value"] == pytest.approx(truth, rel=0.03)
    assert found["drum angle of run_0.mf4"]["value"] == pytest.approx(40.0, abs=3.0)
    assert result["numbers"][0]["verdict"] == "good"


@pytest.mark.slow
def test_records_of_two_loads_are_fitted_together(calibrate):
    """Plant two masses, each of which only the records of its load tell, and a friction of both."""
    parameters = load_machine("reference")
    keys = [f"loads.{name}.unbalances.0.mass" for name in ("middle", "counter")]
    masses = [parameters.loads[name].unbalances[0].mass for name in ("middle", "counter")]
    friction = parameters.damper_types["friction"].friction_force
    truth = {FRICTION: 1.15 * friction, keys[0]: 1.1 * masses[0], keys[1]: 0.85 * masses[1]}
    files = [*plant(truth, of_load="middle", stem="a", repeats=2)]
    files += [f"counter={one}" for one in plant(truth, seed=2, of_load="counter", stem="b")]
    words = [word for key in truth for word in ("--unknown", key)]
    result = calibrate(files, *words)
    found = {row["unknown"]: row for row in result["estimates"]}
    for key, value in truth.items():
        assert found[key]["value"] == pytest.approx(value, rel=0.03), key
        assert found[key]["lower_95"] < value < found[key]["upper_95"], key
    assert result["numbers"][0]["verdict"] == "good"
    table = pd.read_csv("out/fitted_acceleration.csv")
    assert set(table["block"]) == {"middle", "counter"}


FREE = """
vary:
  friction:
    bounds: (20, 60) N
    prior: (34, 6) N
    sets: damper_types.friction.friction_force
    source: test
"""


@pytest.mark.slow
def test_quantities_of_a_free_file_and_a_record_of_a_named_load(calibrate):
    """Give the load before the name of the file; the test names another one."""
    truth = 1.2 * load_machine("reference").damper_types["friction"].friction_force
    files = plant({FRICTION: truth}, repeats=1)
    text = Path("test.yaml").read_text()
    Path("test.yaml").write_text(text.replace("load: middle", "load: counter"))
    Path("free.yaml").write_text(FREE)
    result = calibrate([f"middle={files[0]}"], "--vary", "free.yaml", "--by", "order")
    found = result["estimates"][0]
    assert found["unknown"] == "friction"
    assert found["value"] == pytest.approx(truth, rel=0.06)
    machine = load_machine("out/calibrated.yaml")
    assert machine.damper_types["friction"].friction_force == pytest.approx(
        found["value"], rel=1e-3
    )
    assert machine.sources[FRICTION].startswith("fit: friction ")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "--unknown: records need either --unknown NAME[=VALUES] or --vary FILE"),
        (("--unknown", FRICTION, "--targets", "a.csv"), "--targets: is about targets"),
        (("--unknown", FRICTION, "--by", "history", "--speed", "measured"), "--by: history needs"),
        (("--vary", "free.yaml"), "free.yaml: spring_preload and spring_elongation"),
    ],
)
def test_options_that_do_not_fit_records_are_refused(calibrate, words, message):
    Path("run.csv").write_text("time [s],Xr [mm]\n0,1\n1,2\n")
    Path("p.yaml").write_text(PROFILE)
    Path("test.yaml").write_text("load: middle\nsensors: {Xr: {axis: x, frame: sensor_Xr}}\n")
    Path("free.yaml").write_text(f"spring_preload: {{prior: '(100, 20) N', source: test}}\n{FREE}")
    error = calibrate(["run.csv"], *words, code=2)
    assert message in error
    assert len(error.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--vary", "free.yaml", "--by", "order"), "--by: is about records"),
        ((), "--vary: is missing"),
    ],
)
def test_options_that_do_not_fit_targets_are_refused(wm_drake, words, message):
    Path("free.yaml").write_text(FREE)
    ended = wm_drake("calibrate", *words)
    assert ended.code == 2
    assert message in ended.err


@pytest.mark.slow
def test_a_fit_that_is_killed_goes_on_with_what_it_has(wm_drake, monkeypatch):
    (file,) = plant({FRICTION: 50.0}, repeats=1)
    command = f"calibrate {file} --test test.yaml --profile p.yaml --unknown {FRICTION} --by rms"
    words = [sys.executable, "-m", "wm_drake", *command.split(), "--out", "killed"]
    process, stored = subprocess.Popen(words), Path("killed/ledger.sqlite-wal")
    while not stored.exists() or stored.stat().st_size < 50_000:
        assert process.poll() is None
        time.sleep(0.05)
    process.kill()
    process.wait()
    computed, points, counts, found = RecordModel._at, [], [], []

    def counted(model, new):
        points.extend(new)
        return computed(model, new)

    monkeypatch.setattr(RecordModel, "_at", counted)
    for out in ("killed --resume", "whole"):
        found.append(json.loads(wm_drake(f"{command} --json --out {out}").out)["estimates"])
        counts.append(len(points))
        points.clear()
    assert found[0] == found[1]
    assert counts[0] < counts[1]
