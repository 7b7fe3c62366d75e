"""Accelerations and records in files of laboratories are read as those in CSV files are."""

import numpy as np
import pytest
import scipy.io
import xarray as xr
from lab_writers import WRITERS

from wm_drake.errors import InputError
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.recorded import ChannelNames
from wm_drake.parameters.spin import Region
from wm_drake.studies.orders.study import read_signals
from wm_drake.studies.spin_cycle.measured import read_accelerations

TIME = np.linspace(0.0, 20.0, 4001)
NAMES = ("S1_x", "S1_y", "S1_z")
# m/s^2
ACCELERATIONS = [amplitude * np.sin(2.0 * np.pi * 3.0 * TIME) for amplitude in (2.0, 3.0, 1.0)]
SPEED = np.linspace(60.0, 400.0, len(TIME))  # rpm
LABELS = {"case": ["front"], "region": [0], "accelerometer": ["S1"], "axis": ["x", "y", "z"]}
PROFILE = SpinProfile(
    time=(0.0, 20.0), speed=(10.0, 10.0), regions=(Region(name="all", begin=2.0, end=18.0),)
)
G = 9.80665
SUFFIXES = [*WRITERS, ".mat"]


def write(path, channels):
    """Write a file; MAT has no units: accelerations are in m/s^2 there, the speed in rpm."""
    if path.suffix == ".mat":
        values = {n: value * (G if unit == "g" else 1.0) for n, (value, unit) in channels.items()}
        scipy.io.savemat(path, {"time": TIME, **values})
    else:
        WRITERS[path.suffix](path, TIME, channels)


def write_csv(path, columns):
    np.savetxt(
        path,
        np.column_stack(list(columns.values())),
        "%.15g",
        ",",
        header=",".join(columns),
        comments="",
    )


@pytest.fixture(scope="module")
def by_csv(tmp_path_factory):
    folder = tmp_path_factory.mktemp("csv")
    write_csv(
        folder / "front.csv", {"time_s": TIME, **dict(zip(NAMES, ACCELERATIONS, strict=True))}
    )
    return read_accelerations(folder, LABELS, PROFILE)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_accelerations_of_a_laboratory_are_those_of_a_csv(tmp_path, by_csv, suffix):
    channels = {n: (a / G, "g") for n, a in zip(NAMES, ACCELERATIONS, strict=True)}
    write(tmp_path / f"front{suffix}", channels)
    found = read_accelerations(tmp_path, LABELS, PROFILE)
    np.testing.assert_allclose(found, by_csv, rtol=2e-5)  # UFF keeps single precision
    expected = 2.0 / (2.0 * np.pi * 3.0) ** 2 / np.sqrt(2.0)  # m
    assert float(found[0, 0, 0, 0]) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_record_of_a_laboratory_is_that_of_a_csv(tmp_path, suffix):
    path = tmp_path / f"run{suffix}"
    write(path, {"speed_rpm": (SPEED, "rpm"), "Xr": (1e3 * ACCELERATIONS[0], "mm")})
    write_csv(
        tmp_path / "run.csv", {"time_s": TIME, "speed_rpm": SPEED, "Xr": 1e3 * ACCELERATIONS[0]}
    )
    found, expected = read_signals(path, unit="mm"), read_signals(tmp_path / "run.csv", unit="mm")
    assert (found.signal.values.tolist(), found.value.units) == (["Xr"], "mm")
    np.testing.assert_allclose(found.drum_angle, expected.drum_angle, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.value, expected.value, rtol=1e-6, atol=1e-4)


def test_wrong_files_are_refused(tmp_path):
    path = tmp_path / "front.mat"
    write(path, {"S1_x": (ACCELERATIONS[0], "g")})
    with pytest.raises(InputError, match="has no channel 'S1_y'; its channels are time, S1_x"):
        read_accelerations(tmp_path, LABELS, PROFILE)
    (tmp_path / "front.csv").write_text("time_s\n")
    with pytest.raises(InputError, match=r"has front\.csv and front\.mat; give one file"):
        read_accelerations(tmp_path, LABELS, PROFILE)
    scipy.io.savemat(tmp_path / "x.mat", {"S1_x": ACCELERATIONS[0]})
    with pytest.raises(InputError, match="needs one channel of the drum speed"):
        read_signals(tmp_path / "x.mat")
    record = xr.Dataset(
        {
            "displacement": (("time", "sensor"), np.zeros((len(TIME), 0))),
            "drum_angle": ("time", TIME),
        },
        {"time": TIME, "sensor": np.array([], dtype=str)},
    )
    record.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with pytest.raises(InputError, match="displacement: has no values"):
        read_signals(tmp_path / "run.nc")


def write_named_csv(path, channels):
    """Write a CSV with units in its header and a column of words."""
    head = ["Clock [s]", *(f"{name} [{unit}]" for name, (_, unit) in channels.items()), "remark"]
    rows = np.column_stack([TIME, *(values for values, _ in channels.values())])
    lines = [",".join([*(f"{value:.15g}" for value in row), "ok"]) for row in rows]
    path.write_text("\n".join([",".join(head), *lines]) + "\n", encoding="utf-8")


@pytest.mark.parametrize("suffix", [".csv", ".mf4", ".mat"])
def test_channels_are_chosen_by_name(tmp_path, suffix):
    """Read accelerations and records under names of the laboratory, some of them not wanted."""
    named = {f"Acc {k}": (values / G, "g") for k, values in enumerate(ACCELERATIONS)}
    named |= {"Drum": (SPEED, "rpm"), "Door": (np.sin(TIME), "V")}
    if suffix == ".mat":  # names without blanks, no units
        named = {name.replace(" ", "_"): value for name, value in named.items()}
    names = dict(zip(NAMES, named, strict=False))
    clock = {"time": "Clock"} if suffix == ".csv" else {}
    write_it = write_named_csv if suffix == ".csv" else write
    write_it(tmp_path / f"front{suffix}", named)
    plain = tmp_path / "plain"
    plain.mkdir()
    write_csv(plain / "front.csv", {"time_s": TIME, **dict(zip(NAMES, ACCELERATIONS, strict=True))})
    wanted = read_accelerations(plain, LABELS, PROFILE)
    found = read_accelerations(tmp_path, LABELS, PROFILE, ChannelNames(names | clock))
    np.testing.assert_allclose(found, wanted, rtol=1e-9)
    chosen = {"speed": "Drum", "side": names["S1_y"], **clock}
    signals = read_signals(tmp_path / f"front{suffix}", ChannelNames(chosen))
    assert signals.signal.values.tolist() == ["side"]
    assert signals.value.units == ("m/s^2" if suffix == ".mat" else "g")
    size = np.max(np.abs(signals.value.values)) * (1.0 if suffix == ".mat" else G)
    assert size == pytest.approx(3.0, rel=1e-3)
    turns = np.trapezoid(SPEED, TIME) / 60.0
    assert signals.drum_angle.values[-1] / (2.0 * np.pi) == pytest.approx(turns, rel=1e-6)


def test_wrong_names_of_channels_are_refused(tmp_path):
    write_named_csv(tmp_path / "front.csv", {"Acc 0": (ACCELERATIONS[0], "g")})
    with pytest.raises(InputError, match="no word 'S9_x'"):
        read_accelerations(tmp_path, LABELS, PROFILE, ChannelNames({"S9_x": "Acc 0"}))
    with pytest.raises(InputError, match="has no channel 'Acc 7'"):
        read_accelerations(tmp_path, LABELS, PROFILE, ChannelNames({"S1_x": "Acc 7"}))
