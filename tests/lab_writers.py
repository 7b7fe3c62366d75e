"""Files of laboratories, written by the libraries of their formats."""

import numpy as np
import pytest


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
