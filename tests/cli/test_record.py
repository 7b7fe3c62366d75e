"""Command `wm-drake record`: channels of a file, and orders of strangers' measurements."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from lab_writers import CLOCKS

TIME = 0.01 * np.arange(2000)


def written(name, rpm=300.0, missing=slice(0, 0), unit="g"):
    """Write order 1 of 0.3 in a unit, with samples missing."""
    values = 0.3 * np.cos(2.0 * np.pi * rpm / 60.0 * TIME)
    values[missing] = np.nan
    speed = np.full(len(TIME), rpm)
    channels = {"speed": (TIME, speed, "rpm"), "Acc 1": (TIME, values, unit)}
    CLOCKS[Path(name).suffix](Path(name), channels)


def amplitudes_of(ended, order=1.0):
    """Return the amplitudes of an order over time; NaN where the table is empty."""
    assert ended.code == 0, ended.err
    rows = pd.DataFrame(json.loads(ended.out)["orders"])
    assert set(rows["signal"]) == {"Acc 1"}
    return rows[rows["order"] == order].set_index("time_s")["amplitude_g"].astype(float)


@pytest.mark.parametrize("suffix", CLOCKS)
def test_channels_of_every_format_are_listed(wm_drake, suffix):
    written(f"x{suffix}", unit="m/s²" if suffix != ".uff" else "m/s2")
    ended = wm_drake("record", "channels", f"x{suffix}", "--json")
    assert ended.code == 0, ended.err
    channels = {each["name"]: each for each in json.loads(ended.out)["channels"]}
    acc = channels["Acc 1"]
    assert acc["unit"] in ("m/s²", "m/s2")
    assert acc["samples"] == 2000
    assert [acc["rate_hz"], acc["begin_s"], acc["end_s"]] == pytest.approx([100.0, 0.0, 19.99])
    assert "Acc 1" in wm_drake("record", "channels", f"x{suffix}").out


def faulty(fault):
    """Return channels of a recorder with a fault: time, acceleration, speed and tacho."""
    generator = np.random.default_rng(2)
    time, speed = TIME.copy(), np.linspace(60.0, 300.0, len(TIME))
    turns = np.cumsum(speed / 60.0) * 0.01
    at = np.flatnonzero(np.diff(np.floor(turns)) > 0.0)
    if fault == "pulses":
        at = np.delete(at, [20, 30])
    pulses = np.where(np.isin(np.arange(len(TIME)), at), 5.0, 0.0)
    wave = np.round(speed**2 / 1e4 * np.cos(2.0 * np.pi * turns), 3)
    wave += np.round(generator.normal(0.0, 0.02, len(TIME)), 3)
    if fault == "line":
        wave[1100:1200] = np.linspace(wave[1099], wave[1200], 102)[1:-1]
    elif fault == "clock":
        time[900:] += 1.0
    elif fault == "back":
        time[900:] -= 0.5
    elif fault == "ticks":
        time = np.floor(time / 0.05 + 1e-9) * 0.05
    return {"Acc 1": (time, wave, "g"), "Drum": (time, speed, "rpm"), "Tacho": (time, pulses, "V")}


@pytest.mark.parametrize(
    ("fault", "remarks"),
    [
        ("none", {}),
        ("line", {"Acc 1": "a straight line from .* (11 to 11.99 s); 100 samples"}),
        ("clock", {"Drum": "time jumps by 1 s, .* (8.99 to 10 s)"}),
        ("back", dict.fromkeys(("Acc 1", "Drum", "Tacho"), "time falls: 8.5 after 8.99")),
        ("ticks", dict.fromkeys(("Acc 1", "Drum", "Tacho"), "are ticks of 0.05 s; .* 100 Hz")),
        ("pulses", {"Tacho": "2 pulses are missing; they are counted"}),
    ],
)
def test_faults_are_remarked_on_in_the_list(wm_drake, fault, remarks):
    """Write columns with one time, and find the fault with its place."""
    channels = faulty(fault)
    rows = np.column_stack([channels["Drum"][0], *(values for _, values, _ in channels.values())])
    head = "time [s]," + ",".join(f"{name} [{unit}]" for name, (_, _, unit) in channels.items())
    np.savetxt("x.csv", rows, delimiter=",", header=head, comments="", fmt="%.6g")
    ended = wm_drake("record", "channels", "x.csv", "--json")
    found = {each["name"]: each["remark"] for each in json.loads(ended.out)["channels"][1:]}
    for name, remark in remarks.items():
        assert re.search(re.escape(remark).replace(r"\.\*", ".*"), found[name])
    if fault != "clock":  # whose jump is a pulse that is missing, too
        assert {name for name, text in found.items() if text} == set(remarks)


def test_a_slow_recorder_has_empty_orders_above_half_its_rate(wm_drake):
    """100 Hz at 1400 rpm resolves orders up to 2.14."""
    written("phone.csv", rpm=1400.0)
    ended = wm_drake("record", "orders", "phone.csv", "--json", "--out", "o")
    np.testing.assert_allclose(amplitudes_of(ended), 0.3, rtol=0.01)
    third = amplitudes_of(ended, 3.0)
    assert len(third) == len(amplitudes_of(ended))
    assert third.isna().all()
    for name in ("orders", "largest"):
        is_empty = pd.read_csv(f"o/{name}.csv").groupby("order")["amplitude_g"].count() == 0
        assert is_empty.to_dict() == {0.5: False, 1.0: False, 2.0: False, 3.0: True}
    with xr.open_dataset("o/orders.nc") as maps:
        assert maps.amplitude.sizes == {"time": len(third), "order": 96, "signal": 1}
        assert (maps.amplitude.units, maps.speed.units) == ("g", "rad/s")
    assert Path("o/report.html").is_file()


@pytest.mark.parametrize("suffix", CLOCKS)
def test_orders_of_every_format_in_other_units(wm_drake, suffix):
    """Write a time in ms, a speed in U/min that ends after 12 s, and accelerations in g."""
    wave, until = 0.3 * np.cos(2.0 * np.pi * 5.0 * TIME), 1200
    speed = (TIME[:until], np.full(until, 300.0), "U/min")
    CLOCKS[suffix](Path(f"x{suffix}"), {"speed": speed, "Acc 1": (TIME, wave, "g")}, "ms")
    names = ("--channels", "speed=speed,Acc 1=Acc 1")
    for words in ((), names):
        ended = wm_drake(
            "record", "orders", f"x{suffix}", *words, "--json", "--out", "o", "--overwrite"
        )
        assert "do not cover the same time" in ended.err
        first = amplitudes_of(ended)
        assert 10.0 < first.index.max() < 12.0
        np.testing.assert_allclose(first, 0.3, rtol=0.01)


@pytest.mark.parametrize(
    "head", ["Time (ms),Speed (rpm),Acc 1 (g)", "Time [ms],Speed [1/min],Acc 1 [g]"]
)
def test_units_in_the_header_of_a_table(wm_drake, head):
    wave = 0.3 * np.cos(2.0 * np.pi * 5.0 * TIME)
    rows = np.column_stack([1e3 * TIME, np.full(len(TIME), 300.0), wave])
    np.savetxt("x.csv", rows, delimiter=",", header=head, comments="")
    time, speed, _ = head.split(",")
    for words in ((), ("--channels", f"time={time},speed={speed},Acc 1=Acc 1")):
        ended = wm_drake("record", "orders", "x.csv", *words, "--json", "--out", "o", "--overwrite")
        np.testing.assert_allclose(amplitudes_of(ended), 0.3, rtol=0.01)


def test_a_record_of_three_seconds_has_orders(wm_drake):
    written("x.csv", rpm=600.0)
    Path("short.csv").write_text("\n".join(Path("x.csv").read_text().splitlines()[:300]))
    ended = wm_drake("record", "orders", "short.csv", "--json", "--out", "o")
    np.testing.assert_allclose(amplitudes_of(ended), 0.3, rtol=0.01)


def test_windows_with_missing_samples_are_empty(wm_drake):
    written("x.csv", missing=slice(1000, 1010))
    ended = wm_drake("record", "orders", "x.csv", "--json", "--out", "o")
    assert "Acc 1: 10 of 2000 samples are missing or invalid" in ended.err
    first = amplitudes_of(ended)
    time, empty = first.index, first.isna()
    half = 0.5 * 8 * 60.0 / 300.0  # of a window of eight revolutions
    inside = (time > 10.0 - half) & (time < 10.09 + half)
    np.testing.assert_array_equal(empty, inside)
    np.testing.assert_allclose(first[~empty], 0.3, rtol=0.01)


@pytest.mark.parametrize("value", [0.0, -9999.0, 65535.0])
def test_windows_of_a_dropout_are_empty(wm_drake, value):
    """Fill one and a half seconds as a wireless recorder does, or as one without a signal."""
    generator = np.random.default_rng(3)
    wave = 0.3 * np.cos(2.0 * np.pi * 5.0 * TIME) + 1e-3 * generator.standard_normal(len(TIME))
    wave[1100:1250] = value
    speed = np.full(len(TIME), 300.0)
    CLOCKS[".csv"](Path("x.csv"), {"speed": (TIME, speed, "rpm"), "Acc 1": (TIME, wave, "g")})
    ended = wm_drake("record", "orders", "x.csv", "--json", "--out", "o")
    assert "150 samples are left out" in ended.err
    first = amplitudes_of(ended)
    assert first[(first.index > 11.0) & (first.index < 12.5)].isna().all()
    np.testing.assert_allclose(first.dropna(), 0.3, rtol=0.01)


def test_units_are_named_where_a_file_has_none(wm_drake):
    written("x.mat", unit="-")
    ended = wm_drake("record", "orders", "x.mat", "--json", "--out", "o")
    assert "Acc 1: the file has no unit; m/s^2 is assumed" in ended.err
    for option in ("g", "Acc 1=g"):
        ended = wm_drake(
            "record", "orders", "x.mat", "--unit", option, "--json", "--out", "o", "--overwrite"
        )
        assert amplitudes_of(ended).to_numpy() == pytest.approx(0.3, rel=0.01)


def test_a_record_of_spin_is_read_in_mm_and_kept_in_metres(wm_drake):
    """Displacements of 3 mm with order 1, at 300 rpm."""
    angle = 2.0 * np.pi * 5.0 * TIME
    displacement = ("time", "sensor"), 3e-3 * np.cos(angle)[:, None], {"units": "m"}
    xr.Dataset(
        {"displacement": displacement, "drum_angle": ("time", angle, {"units": "rad"})},
        {"time": ("time", TIME, {"units": "s"}), "sensor": ["Xr"]},
    ).to_netcdf("x.nc", engine="h5netcdf")
    ended = wm_drake("record", "orders", "x.nc", "--json", "--out", "o")
    assert ended.code == 0, ended.err
    largest = pd.DataFrame(json.loads(ended.out)["largest"]).set_index("order").loc[1.0]
    assert largest["signal"] == "Xr"
    assert [largest["amplitude_mm"], largest["speed_rpm"]] == pytest.approx([3.0, 300.0], rel=1e-3)
    with xr.open_dataset("o/orders.nc") as maps:
        assert float(maps.amplitude.max()) == pytest.approx(3e-3, rel=1e-3)
