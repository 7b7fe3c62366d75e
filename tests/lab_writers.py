"""Files of laboratories, written by the libraries of their formats."""

import itertools

import numpy as np
import pytest
import scipy.io


def write_mdf(path, time, channels):
    """Write MDF 4; channels with another number of samples have another rate."""
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="4.10")
    for name, (values, unit) in channels.items():
        own = np.linspace(time[0], time[-1], len(values))
        file.append([asammdf.Signal(samples=values, timestamps=own, name=name, unit=unit)])
    file.save(path, overwrite=True)
    file.close()


def write_tdms(path, time, channels):
    nptdms = pytest.importorskip("nptdms")
    clock = {"wf_increment": time[1], "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("machine", name, values, {**clock, "unit_string": unit})
                for name, (values, unit) in channels.items()
            ]
        )


def write_uff(path, time, channels):
    pyuff = pytest.importorskip("pyuff")
    common = dict.fromkeys(
        ("func_type", "rsp_node", "rsp_dir", "ref_node", "ref_dir", "abscissa_spacing"), 1
    ) | dict.fromkeys(("orddenom_spec_data_type", "z_axis_spec_data_type", "binary"), 0)
    sets = [
        pyuff.prepare_58(
            **common, id1=name, abscissa_min=0.0, abscissa_inc=time[1], num_pts=len(time),
            ord_data_type=4, abscissa_spec_data_type=17, abscissa_axis_units_lab="s",
            ordinate_spec_data_type=8, ordinate_axis_units_lab=unit, data=values, x=time,
        )
        for name, (values, unit) in channels.items()
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")


WRITERS = {".mf4": write_mdf, ".tdms": write_tdms, ".uff": write_uff}
"""Functions of path, time [s] and channels: values and unit by name."""


PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "min": 1.0 / 60.0}
"""Units of time of a second."""


def write_mdf_clocks(path, channels, unit="s"):
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="4.10")
    for name, (time, values, of) in channels.items():
        bits = (
            None
            if np.isfinite(values).all()
            else asammdf.signal.InvalidationArray(np.isnan(values))
        )
        stamps = time * PER_SECOND[unit]
        samples = np.nan_to_num(values)
        file.append([asammdf.Signal(samples, stamps, name=name, unit=of, invalidation_bits=bits)])
        file.groups[-1].channels[0].unit = unit
    file.save(path, overwrite=True)
    file.close()


def write_tdms_clocks(path, channels, unit="s"):
    nptdms = pytest.importorskip("nptdms")
    parts = [
        nptdms.ChannelObject(
            "machine",
            name,
            values,
            {
                "wf_increment": float(time[1] - time[0]) * PER_SECOND[unit],
                "wf_start_offset": 0.0,
                "wf_start_time": np.datetime64("2026-05-01T12:00:00")
                + np.timedelta64(round(1e6 * time[0]), "us"),
                "wf_xunit_string": unit,
                "NI_UnitDescription": of,
            },
        )
        for name, (time, values, of) in channels.items()
    ]
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(parts)


def write_uff_clocks(path, channels, unit="s", kind=17, function=1):
    pyuff = pytest.importorskip("pyuff")
    common = dict.fromkeys(
        ("rsp_node", "rsp_dir", "ref_node", "ref_dir", "abscissa_spacing"), 1
    ) | dict.fromkeys(("orddenom_spec_data_type", "z_axis_spec_data_type", "binary"), 0)
    sets = [
        pyuff.prepare_58(
            **common, id1=name, func_type=function, abscissa_min=time[0] * PER_SECOND.get(unit, 1),
            abscissa_inc=float(time[1] - time[0]) * PER_SECOND.get(unit, 1), num_pts=len(time),
            ord_data_type=4, abscissa_spec_data_type=kind, abscissa_axis_units_lab=unit,
            ordinate_spec_data_type=8, ordinate_axis_units_lab=of, data=values,
            x=time * PER_SECOND.get(unit, 1),
        )
        for name, (time, values, of) in channels.items()
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")


def write_csv_clocks(path, channels, unit="s"):
    """Write a column of time at the left of each channel; shorter ones end in empty cells."""
    head, columns = [], []
    for name, (time, values, of) in channels.items():
        head += [f"time ({unit})", f"{name} [{of}]"]
        columns += [
            [f"{value:.12g}" for value in time * PER_SECOND[unit]],
            ["" if np.isnan(value) else f"{value:.12g}" for value in values],
        ]
    rows = itertools.zip_longest(*columns, fillvalue="")
    path.write_text("\n".join([",".join(head), *map(",".join, rows)]) + "\n", encoding="utf-8")


def write_hdf5_clocks(path, channels, unit="s"):
    import h5py

    with h5py.File(path, "w") as file:
        for name, (time, values, of) in channels.items():
            group = file.create_group(f"of {name}")
            group[name], group["time"] = values, time * PER_SECOND[unit]
            group[name].attrs["units"], group["time"].attrs["unit"] = of, unit


def write_mat_clocks(path, channels, unit="s"):
    """Write structures with time, values and unit."""
    scipy.io.savemat(
        path,
        {
            f"group{number}": {
                "time": {"data": time * PER_SECOND[unit], "unit": unit},
                name: {"data": values, "unit": of},
            }
            for number, (name, (time, values, of)) in enumerate(channels.items())
        },
    )


CLOCKS = {
    ".mf4": write_mdf_clocks,
    ".tdms": write_tdms_clocks,
    ".uff": write_uff_clocks,
    ".csv": write_csv_clocks,
    ".h5": write_hdf5_clocks,
    ".mat": write_mat_clocks,
}
"""Functions of path, channels and unit of time; a channel is its time [s], values and unit."""
