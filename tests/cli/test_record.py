"""Command `wm-drake record`: channels of a file, and orders of strangers' measurements."""

import json
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
