"""Files written here are those that xarray would write."""

import numpy as np
import xarray as xr

import wm_drake as wm
from wm_drake.simulation.netcdf import netcdf_bytes


def read(path, content):
    path.write_bytes(content)
    return xr.load_dataset(path, engine="h5netcdf")


def both(dataset, tmp_path):
    ours = read(tmp_path / "ours.nc", netcdf_bytes(dataset))
    theirs = read(tmp_path / "theirs.nc", bytes(dataset.to_netcdf(engine="h5netcdf")))
    return ours, theirs


def test_numbers_texts_and_attributes_are_read_as_if_xarray_had_written_them(tmp_path):
    dataset = xr.Dataset(
        {
            "force": (("time", "axis"), np.array([[1.0, np.nan], [3.0, 4.0]]), {"units": "N"}),
            "count": ("axis", np.array([1, 2]), {"long_name": "a count"}),
            "touches": ("time", np.array([True, False])),
            "plain": ((), 2.5),
            "of_no_coordinate": ("step", np.arange(3.0)),
        },
        {"axis": ["x", "öst"], "time": [0.0, 0.5], "speed": ("time", [1.0, 2.0])},
        {"machine": "a name", "period": 0.25, "rest": [0.0, 1.0]},
    )
    ours, theirs = both(dataset, tmp_path)
    assert ours.identical(theirs)
    assert ours.force.equals(dataset.force)
    assert set(ours.coords) == {"axis", "time", "speed"}


def test_a_record_is_that_of_xarray(machine, tmp_path):
    record = wm.simulate(machine, "middle")
    ours, theirs = both(record, tmp_path)
    assert ours.identical(theirs)
    assert ours.identical(record)
