"""`record compare`: exact signals through all formats, planted faults, repeats, and refusals."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from lab_machine import recorded_channels
from lab_writers import WRITERS, write_mdf_clocks

from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, load_profile, with_values
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate

PROFILE = """time: (0, 20, 24) s
speed: (0, 320, 320) rpm
regions: [{name: R1, begin: 4 s, end: 10 s}, {name: R2, begin: 10 s, end: 16 s}, {name: R3, begin: 16 s, end: 24 s}]
"""
SENSORS = ("S1_x", "S1_z", "S2_y")


def measured(folder, profile=PROFILE):
    """Return time, channels with names of a recorder, and the drum speed. [s, g, rpm]"""
    (folder / "p.yaml").write_text(profile)
    fine = with_values(load_machine("reference"), {"step": 1.25e-3, "output_period": 1.25e-3})
    machine = build_machine(fine)
    case = Case("middle", fine.loads["middle"], load_profile(folder / "p.yaml"))
    record = simulate(machine, case)
    points = machine.set_up().accelerometer_points
    where = {name: points[name[:2]] for name in SENSORS}
    time, channels, at = recorded_channels(record, where, begin=1.5, ppm=200.0)
    rpm = np.interp(at, record.time.values, record.drum_speed.values) * 30.0 / np.pi
    renamed = {f"Acc {k}": channels[name] for k, name in enumerate(SENSORS, 1)}
    return time, renamed, rpm


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """Return what is measured of the profile."""
    return measured(tmp_path_factory.mktemp("profile"))


@pytest.fixture
def compare(wm_drake):
    """Return a function that compares files with the reference machine."""
    write_test()

    def command(*words, code=0):
        profile = () if "--profile" in words else ("--profile", "p.yaml")
        options = ("--out", "out", "--overwrite", "--json")
        ended = wm_drake("record", "compare", *words, *profile, *options)
        assert ended.code == code, ended.err
        return json.loads(ended.out) if code == 0 else ended.err

    return command


def write_test(speed="speed: {channel: Drum}\n", load="load: middle\n", **changes):
    """Write profile and test; `changes` replaces words of the test."""
    frames = load_machine("reference").accelerometer_frames()
    lines = [
        f"  {name}: {{channel: Acc {k}, frame: {frames[name[:2]]}, axis: {name[-1]}}}\n"
        for k, name in enumerate(SENSORS, 1)
    ]
    text = f"{load}sensors:\n{''.join(lines)}{speed}"
    for old, new in changes.values():
        text = text.replace(old, new)
    Path("test.yaml").write_text(text)
    Path("p.yaml").write_text(PROFILE)


def write_csv(path, time, channels):
    names = ",".join(f"{name} [{unit}]" for name, (_, unit) in channels.items())
    table = np.column_stack([time, *(values for values, _ in channels.values())])
    header = f"time [s],{names}".replace(" []", "")
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.17g")


def rows(result, name, key):
    return {tuple(row[k] for k in key): row for row in result[name]}


def test_exact_signals_agree_in_every_region_through_every_format(compare, laboratory):
    time, channels, rpm = laboratory
    with_speed = {**channels, "Drum": (rpm, "rpm")}
    found = {}
    for suffix, write in {**WRITERS, ".csv": write_csv}.items():
        write(f"run{suffix}", time, with_speed)
        found[suffix] = compare(f"run{suffix}", "--test", "test.yaml")
    for result in found.values():
        assert [row["region"] for row in result["errors_acceleration"]] == ["R1", "R2", "R3"]
        assert max(row["error_percent"] for row in result["errors_acceleration"]) < 0.1
        assert min(row["correlation"] for row in result["sensors_acceleration"]) > 0.9999
        assert min(row["within_percent"] for row in result["sensors_acceleration"]) > 95.0
        clock = result["clocks"][0]
        assert clock["offset_ms"] == pytest.approx(1500.0, abs=1.0)
        assert clock["rate_ppm"] == pytest.approx(200.0, abs=40.0)
    first = found.pop(".csv")
    for result in found.values():
        for name in ("sensors_acceleration", "errors_acceleration", "rms_acceleration"):
            for row, other in zip(result[name], first[name], strict=True):
                assert {k: v for k, v in row.items() if isinstance(v, str)} == {
                    k: v for k, v in other.items() if isinstance(v, str)
                }
                numbers = [k for k, v in row.items() if isinstance(v, float)]
                np.testing.assert_allclose(
                    [row[k] for k in numbers], [other[k] for k in numbers], rtol=1e-5, atol=2e-4
                )


def test_without_gravity_in_the_model_the_slow_regions_are_wrong(compare, laboratory):
    """Leave the planted gravity out of the model: errors are of some percent."""
    time, channels, rpm = laboratory
    write_csv("run.csv", time, {**channels, "Drum": (rpm, "rpm")})
    write_test(gravity=("axis: x}", "axis: x, gravity: removed}"))
    result = compare("run.csv", "--test", "test.yaml")
    by_sensor = rows(result, "rms_acceleration", ("region", "sensor"))
    slow = by_sensor["R1", "S1_x"]
    assert abs(slow["computed_m_per_s2"] / slow["measured_m_per_s2"] - 1.0) > 0.03


def test_without_a_speed_the_signals_align_the_clock(compare, laboratory):
    time, channels, _ = laboratory
    write_test(speed="")
    write_csv("run.csv", time, channels)
    result = compare("run.csv", "--test", "test.yaml")
    clock = result["clocks"][0]
    assert clock["by"] == "spectra and order 1"
    assert clock["offset_ms"] == pytest.approx(1500.0, abs=2.0)
    assert max(row["error_percent"] for row in result["errors_acceleration"]) < 0.1


def test_pulses_of_a_tacho_on_the_motor(compare, laboratory):
    time, channels, rpm = laboratory
    angle = np.cumsum(rpm * np.pi / 30.0 * np.gradient(time))
    fine = np.linspace(time[0], time[-1], 12 * len(time))
    pulses = (np.sin(4.0 * np.interp(fine, time, angle)) > 0.0) * 5.0
    WRITERS[".mf4"]("run.mf4", time, {**channels, "Tacho": (pulses, "V")})
    write_test(speed="speed: {channel: Tacho, kind: pulses, pulses_per_turn: 2, ratio: 2}\n")
    result = compare("run.mf4", "--test", "test.yaml")
    clock = result["clocks"][0]
    assert clock["by"] == "pulses of the tacho"
    assert clock["offset_ms"] == pytest.approx(1500.0, abs=2.0)


def test_repeats_have_a_scatter_and_the_difference_is_named(compare, laboratory):
    """Gains of 1 % scatter; one sensor is 30 % too large in all of them."""
    time, channels, rpm = laboratory
    generator = np.random.default_rng(5)
    files = []
    for number in range(4):
        gains = 1.0 + 0.01 * generator.standard_normal(3)
        late = int(generator.integers(0, 300))
        scaled = {
            name: (values[late:] * gain * (1.3 if name == "Acc 2" else 1.0), unit)
            for (name, (values, unit)), gain in zip(channels.items(), gains, strict=True)
        }
        files.append(f"run_{number}.csv")
        write_csv(files[-1], time[late:] - time[late], {**scaled, "Drum": (rpm[late:], "rpm")})
    result = compare(*files, "--test", "test.yaml")
    sensors = rows(result, "sensors_acceleration", ("sensor",))
    assert sensors[("S1_z",)]["difference_percent"] == pytest.approx(-23.1, abs=1.5)  # 1 / 1.3
    assert sensors[("S1_x",)]["within_percent"] > 95.0
    assert sensors[("S1_z",)]["within_percent"] < 60.0


def test_the_recorded_speed_drives_the_model(compare, laboratory):
    """Refuse a named profile that the machine did not follow; agree with its own speed."""
    time, channels, rpm = laboratory
    write_csv("run.csv", time, {**channels, "Drum": (rpm, "rpm")})
    Path("other.yaml").write_text("{time: '(0, 60) s', speed: '(0, 200) rpm'}")
    words = ("run.csv", "--test", "test.yaml", "--profile", "other.yaml")
    error = compare(*words, code=2)
    assert "run.csv: the recorded drum speed contradicts the profile" in error
    assert "--speed measured" in error
    result = compare(*words, "--speed", "measured")
    assert max(row["error_percent"] for row in result["errors_acceleration"]) < 5.0


@pytest.mark.slow
def test_order_one_tells_the_speed_that_drives_the_model(compare, laboratory):
    """Name a profile whose last speed is 3 % slow, for a record without a channel of the speed."""
    time, channels, _ = laboratory
    write_test(speed="")
    write_csv("run.csv", time, channels)
    Path("slow.yaml").write_text(PROFILE.replace("320", "310"))
    words = ("run.csv", "--test", "test.yaml", "--profile", "slow.yaml", "--speed")
    found = {
        speed: compare(*words, speed)["sensors_acceleration"][0]
        for speed in ("profile", "measured")
    }
    assert found["profile"]["sensor"] == "S1_x"
    assert abs(found["profile"]["difference_percent"]) > 3.0
    assert abs(found["measured"]["difference_percent"]) < 0.3
    assert found["profile"]["correlation"] < 0.99
    assert found["measured"]["correlation"] > 0.998


def lost(of, name, value):
    of[name][0][[1500, 2500, 3500]] = value


def zeros(of):
    for name in set(of) - {"time"}:
        of[name][0][3000:3700] = 0.0


def straight(of):
    for name in set(of) - {"time", "Drum"}:
        x = of[name][0]
        x[3000:3700] = np.round(np.linspace(x[2999], x[3700], 702)[1:-1], 6)


def clipped(of):
    np.clip(of["Acc 2"][0], None, 1.4, out=of["Acc 2"][0])


def speed_off(of):
    of["Drum"][0][3000:3700] = 0.0


def set_forward(of):
    of["time"] += 0.7 * (np.arange(len(of["time"])) >= 4000)


def exchanged(of):
    of["Acc 1"], of["Acc 2"] = of["Acc 2"], of["Acc 1"]


def reversed_x(of):
    of["Acc 1"] = (-of["Acc 1"][0], "g")


def reversed_z(of):
    """Leave one sensor, whose sign only gravity tells."""
    del of["Acc 1"], of["Acc 3"]
    of["Acc 2"] = (-of["Acc 2"][0], "g")


def in_wrong_unit(of):
    for name in ("Acc 1", "Acc 2", "Acc 3"):
        of[name] = (of[name][0], "m/s^2")


def twice_the_speed(of):
    of["Drum"] = (2.0 * of["Drum"][0], "rpm")


def on_the_motor(of):
    of["Drum"] = (12.3 * of["Drum"][0], "rpm")


def in_hertz(of):
    of["Drum"] = (of["Drum"][0] / 60.0, "rpm")


def without_a_unit(of):
    of["Acc 1"] = (of["Acc 1"][0], "")


def in_ticks(of):
    of["time"] = np.floor(of["time"] / 0.05) * 0.05


def ac_coupled(of):
    of["Acc 2"] = (of["Acc 2"][0] - 1.0, "g")


@pytest.mark.parametrize(
    ("plant", "message", "least"),
    [
        (zeros, "stays at exactly 0", 0.0),
        (partial(lost, name="Acc 3", value=-9999.0), "are -9999, a mark", 0.0),
        (partial(lost, name="Acc 3", value=40.0), "impossible beside their neighbours", 0.0),
        (partial(lost, name="Drum", value=65535.0), "are 65535, a mark", 0.0),
        (clipped, "S1_z: is clipped", 0.0),
        (straight, "is a straight line", 0.0),
        (speed_off, "speed: stays at exactly 0", 0.0),
        (ac_coupled, "S1_z: gravity is taken out of it (gravity: removed)", 0.0),
        (in_ticks, "its time stamps are ticks of 0.05 s", 0.0),
        (set_forward, "time jumps by 0.7 s", None),
        (without_a_unit, "Acc 1: has no unit; write 'Acc 1 [m/s^2]' in the header", None),
        (exchanged, "the channels of S1_x and S1_z are exchanged", None),
        (reversed_x, "S1_x: it has the other sign (polarity: negative)", None),
        (reversed_z, "S1_z: it has the other sign (polarity: negative)", None),
        (in_wrong_unit, "the units of S1_x, S1_z, S2_y are larger than declared", None),
        (twice_the_speed, "with ratio: 2 both agree", None),
        (on_the_motor, "with ratio: 12.", None),
        (in_hertz, "or its unit is Hz, not rpm", None),
    ],
)
def test_planted_faults_are_named_or_left_out(wm_drake, laboratory, plant, message, least):
    """Plant one fault in exact signals: refuse it, or agree as without it, with a notice."""
    time, channels, rpm = laboratory
    every = {name: (np.round(values, 6), unit) for name, (values, unit) in channels.items()}
    every["Drum"] = (np.round(rpm, 2), "rpm")
    every["time"] = time.copy()
    plant(every)
    write_test()
    write_csv("run.csv", every.pop("time"), every)
    words = ("run.csv", "--test", "test.yaml", "--profile", "p.yaml", "--json")
    ended = wm_drake("record", "compare", *words)
    assert ended.code == (2 if least is None else 0), ended.err
    assert message in ended.err
    if least is None:
        assert ended.err.count(";") < 3  # one cause is named, no other
        return
    result = json.loads(ended.out)
    for row in result["sensors_acceleration"]:
        assert abs(row["difference_percent"]) < 1.0
        assert row["within_percent"] > 95.0


def test_a_speed_that_drops_out_does_not_drive_the_model(wm_drake, laboratory):
    time, channels, rpm = laboratory
    every = {**channels, "Drum": (np.round(rpm, 2), "rpm")}
    speed_off(every)
    write_test()
    write_csv("run.csv", time, every)
    words = ("--test", "test.yaml", "--profile", "p.yaml", "--speed", "measured", "--json")
    ended = wm_drake("record", "compare", "run.csv", *words)
    assert "speed: stays at exactly 0 while it moves before and after" in ended.err
    for row in json.loads(ended.out)["sensors_acceleration"]:
        assert abs(row["difference_percent"]) < 1.0


def test_milliseconds_without_a_unit_are_asked_for(compare, laboratory):
    time, channels, rpm = laboratory
    write_csv("run.csv", 1e3 * time, {**channels, "Drum": (rpm, "rpm")})
    Path("run.csv").write_text(Path("run.csv").read_text().replace("time [s]", "time", 1))
    assert "--unit time=ms" in compare("run.csv", "--test", "test.yaml", code=2)
    result = compare("run.csv", "--test", "test.yaml", "--unit", "time=ms")
    assert max(row["error_percent"] for row in result["errors_acceleration"]) < 0.1


def test_a_drum_that_turned_the_other_way_is_named(compare, tmp_path_factory):
    """Record with a tacho that does not tell the direction, then name a profile of it."""
    backwards = PROFILE.replace("320, 320", "-320, -320")
    time, channels, rpm = measured(tmp_path_factory.mktemp("backwards"), backwards)
    write_csv("run.csv", time, {**channels, "Drum": (np.abs(rpm), "rpm")})
    error = compare("run.csv", "--test", "test.yaml", code=2)
    assert error.count("what explains it: the drum turned the other way") == 1
    assert error.count(";") < 3  # one cause is named, no other
    Path("back.yaml").write_text(backwards)
    for speed in ("speed: {channel: Drum}\n", ""):  # else the signals align the clock
        write_test(speed=speed)
        result = compare("run.csv", "--test", "test.yaml", "--profile", "back.yaml")
        assert max(row["error_percent"] for row in result["errors_acceleration"]) < 0.3
    assert "the drum turned the other way" in compare("run.csv", "--test", "test.yaml", code=2)


def in_hundredths(values):
    return np.round(values, 2)


def in_three_digits(values):
    return np.array([float(f"{value:.3g}") for value in values])


def half_the_rate(values):
    """Return every second sample, cut to hundredths."""
    return np.floor(100.0 * values[1::2]) / 100.0


def means_of_two(values):
    return np.round(0.5 * (values[:-1:2] + values[1::2]), 3)


def cut_and_later(values):
    return values[700:]


@pytest.mark.parametrize(
    "changed",
    [np.copy, in_hundredths, in_three_digits, half_the_rate, means_of_two, cut_and_later],
)
def test_a_copy_is_no_repeat(compare, laboratory, changed):
    """Copy a record, also with fewer digits, at half the rate or cut, with other time stamps."""
    time, channels, _ = laboratory
    generator = np.random.default_rng(4)

    def noisy():
        return {
            n: (v + 0.002 * generator.standard_normal(len(v)), u) for n, (v, u) in channels.items()
        }

    write_test(speed="")
    first = noisy()
    write_csv("run.csv", time, first)
    copied = {name: (changed(values), unit) for name, (values, unit) in first.items()}
    size = len(copied["Acc 1"][0])
    later = 5.0 + (time[::2][:size] if size <= len(time) // 2 + 1 else time[:size])
    write_csv("copy.csv", later, copied)
    repeated = {name: (changed(values), unit) for name, (values, unit) in noisy().items()}
    write_csv("repeat.csv", later, repeated)
    words = ("--test", "test.yaml")
    error = compare("run.csv", "repeat.csv", "copy.csv", *words, code=2)
    assert "copy.csv: has the same samples as run.csv" in error
    compare("run.csv", "repeat.csv", *words)


@pytest.mark.parametrize("speed", ["profile", "measured"])
def test_missing_pulses_of_a_tacho_are_counted(wm_drake, laboratory, speed):
    """Take four of some eighty pulses away, two of them neighbours."""
    time, channels, rpm = laboratory
    angle = np.cumsum(rpm * np.pi / 30.0 * np.gradient(time))
    high = np.flatnonzero(np.diff((np.sin(angle) > 0.0).astype(int)) > 0)
    pulses = np.zeros(len(time))
    for number, at in enumerate(high):
        if number not in (12, 13, 24, 35):
            pulses[at + 1 : at + 20] = 5.0
    write_csv("run.csv", time, {**channels, "Drum": (pulses, "V")})
    write_test(speed="speed: {channel: Drum, kind: pulses, pulses_per_turn: 1}\n")
    words = ("--test", "test.yaml", "--speed", speed, "--profile", "p.yaml", "--json")
    ended = wm_drake("record", "compare", "run.csv", *words)
    assert "4 pulses are missing; they are counted" in ended.err
    result = json.loads(ended.out)
    for row in result["sensors_acceleration"]:
        assert abs(row["difference_percent"]) < (0.5 if speed == "profile" else 1.0)
    errors = [row["error_percent"] for row in result["errors_acceleration"]]
    assert max(errors) < (0.3 if speed == "profile" else 2.0)


@pytest.mark.parametrize("has_speed", [True, False])
def test_noise_is_refused(compare, laboratory, has_speed):
    time, channels, rpm = laboratory
    generator = np.random.default_rng(1)
    noise = {name: (generator.standard_normal(len(time)), "g") for name in channels}
    write_csv("run.csv", time, {**noise, **({"Drum": (rpm, "rpm")} if has_speed else {})})
    write_test(**({} if has_speed else {"speed": ""}))
    error = compare("run.csv", "--test", "test.yaml", code=2)
    assert error.startswith("run.csv: no sensor shows the turning drum")
    assert len(error.strip().splitlines()) == 1


def test_gaps_and_rounded_stamps(compare, laboratory):
    time, channels, rpm = laboratory
    holed = {name: (values.copy(), unit) for name, (values, unit) in channels.items()}
    holed["Acc 1"][0][3000:3400] = np.nan
    write_csv("run.csv", np.round(time, 3) + 0.0, {**holed, "Drum": (rpm, "rpm")})
    result = compare("run.csv", "--test", "test.yaml")
    assert max(row["error_percent"] for row in result["errors_acceleration"]) < 0.1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sensors: {a: {axis: z}}", "sensors.a: needs either frame"),
        ("sensors: {a: {axis: w, frame: sensor_Xr}}", "sensors.a.axis"),
        ("sensors: {a: {axis: z, frame: nosuch}}", "no frame 'nosuch' in the SDF"),
        ("sensors: {a: {axis: z, frame: sensor_Xr, noise: 3}}", "sensors.a.noise"),
        ("sensors: {a: {axis: z, frame: sensor_Xr, low_pass: 3 mm}}", "sensors.a.low_pass"),
        ("sensors: {a: {axis: z, frame: sensor_Xr, chanel: x}}", "did you mean 'channel'"),
        ("sensors: {}", "sensors"),
        (
            "sensors: {a: {axis: z, frame: sensor_Xr, quantity: velocity, gravity: removed}}",
            "a velocity has none",
        ),
    ],
)
def test_a_wrong_test_is_refused(compare, laboratory, text, message):
    time, channels, rpm = laboratory
    write_csv(
        "run.csv", time[:300], {"a": (channels["Acc 1"][0][:300], "g"), "Drum": (rpm[:300], "rpm")}
    )
    Path("test.yaml").write_text(f"load: middle\n{text}\n")
    error = compare("run.csv", "--test", "test.yaml", code=2)
    assert message in error
    assert error.startswith("test.yaml")


@pytest.mark.parametrize(
    ("channels", "words", "message"),
    [
        (("Torque", "Drum"), (), "has no channel of a sensor of the test, such as Acc 1"),
        (("Acc 1",), ("run.csv",), "'run.csv' is given twice"),
        (("Acc 1",), ("--load", "nosuch"), "'nosuch' is neither a load of machine"),
        (("Acc 1",), ("--channels", "S1_q=Acc 1"), "no word 'S1_q'"),
        (("Acc 1",), ("--machine", "light_cabinet"), "cabinet"),
    ],
)
def test_wrong_records_and_options_are_refused(compare, laboratory, channels, words, message):
    time, known, rpm = laboratory
    values = {name: (known.get(name, (rpm, "rpm"))[0][:400], "g") for name in channels}
    if "Drum" in values:
        values["Drum"] = (rpm[:400], "rpm")
    if "Torque" in values:
        values["Torque"] = (rpm[:400], "N*m")
    write_csv("run.csv", time[:400], values)
    error = compare("run.csv", *words, "--test", "test.yaml", code=2)
    assert message in error
    assert len(error.strip().splitlines()) == 1


@pytest.mark.parametrize("file", ["run.mf4", "run.csv"])
def test_a_channel_without_a_sample_is_refused(compare, laboratory, file):
    time, channels, _ = laboratory
    empty = {name: (np.full(len(time), np.nan), "g") for name in channels}
    if file == "run.csv":
        write_csv(file, time, empty)
    else:
        write_mdf_clocks(file, {name: (time, *of) for name, of in empty.items()})
    write_test(speed="")
    error = compare(file, "--test", "test.yaml", code=2)
    *_, last = error.strip().splitlines()  # notices of the missing samples stand before
    assert last.startswith(f"{file}: Acc 1")
    assert "has no valid sample" in last


def test_a_machine_with_several_loads_needs_the_name_of_one(compare, laboratory):
    time, channels, _ = laboratory
    write_csv("run.csv", time, channels)
    write_test(speed="", load="")
    error = compare("run.csv", "--test", "test.yaml", code=2)
    assert "--load: the machine has the loads middle, counter" in error
