"""Loops in files of laboratories: written by their libraries, chosen by name, units from the file."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io
from lab_writers import WRITERS

from wm_drake.errors import InputError
from wm_drake.parameters import read_loop
from wm_drake.parameters.recorded import ChannelNames, read_recording

TIME = np.linspace(0.0, 2.0, 201)
MM, KN = 5.0 * np.sin(TIME), 0.1 * np.cos(TIME)


def write(path, moved, pushed):
    """Write a loop; that in MDF has its force at another rate."""
    if path.suffix == ".mat":
        names = {"t_s": TIME, f"{moved}_mm": MM, f"{pushed}_kN": KN, "note": "bench"}
        scipy.io.savemat(path, names)
        return
    finer = 0.1 * np.cos(np.linspace(0.0, 2.0, 801))
    force = finer if path.suffix == ".mf4" else KN
    WRITERS[path.suffix](path, TIME, {moved: (MM, "mm"), pushed: (force, "kN")})


@pytest.mark.parametrize("suffix", [*WRITERS, ".mat"])
def test_a_loop_written_by_a_library_is_read_in_si(tmp_path, suffix):
    path = tmp_path / f"loop{suffix}"
    write(path, "displacement", "force")
    loop = read_loop(path)
    assert loop.time == pytest.approx(TIME, abs=1e-6)
    assert loop.displacement == pytest.approx(1e-3 * MM, abs=1e-8)
    assert loop.force == pytest.approx(1e3 * KN, abs=2e-3)
    assert (loop.name, loop.rotates) == ("loop", False)


@pytest.mark.parametrize("suffix", [".mf4", ".tdms", ".uff"])
def test_channels_are_chosen_by_name(tmp_path, suffix):
    path = tmp_path / f"loop{suffix}"
    write(path, "Pos 1", "Load cell")
    with pytest.raises(
        InputError, match="has no channel of displacement; its channels are Pos 1, Load cell"
    ):
        read_named(path, {})
    loop = read_named(path, {"displacement": "Pos 1", "force": "Load cell"})
    assert loop.displacement == pytest.approx(1e-3 * MM, abs=1e-8)
    with pytest.raises(InputError, match="has no channel 'Pos'; its channels are Pos 1, Load cell"):
        read_named(path, {"displacement": "Pos", "force": "Load cell"})


def read_named(path, channels):
    return read_loop(path, ChannelNames(channels))


def test_columns_of_a_csv_are_chosen_by_name(tmp_path):
    path = tmp_path / "loop.csv"
    rows = [f"{t},{d},{f}" for t, d, f in zip(TIME, MM, KN, strict=True)]
    path.write_text("\n".join(["time [s],Pos 1 [mm],Load cell [kN]", *rows]))
    loop = read_named(path, {"displacement": "Pos 1", "force": "Load cell"})
    assert loop.force == pytest.approx(1e3 * KN)
    with pytest.raises(
        InputError, match="has no channel 'Pos'; its channels are time, Pos 1, Load cell"
    ):
        read_named(path, {"displacement": "Pos"})


def test_a_mat_file_that_matlab_wrote_is_read():
    folder = Path(scipy.io.__file__).parent / "matlab" / "tests" / "data"
    path = folder / "testdouble_7.4_GLNX86.mat"
    if not path.is_file():
        pytest.skip("scipy is installed without its test files")
    (channel,) = read_recording(path).signals
    assert channel.name == "testdouble"
    assert channel.values == pytest.approx(np.arange(9) * np.pi / 4.0)


@pytest.mark.parametrize("suffix", [*WRITERS, ".mat"])
def test_a_damaged_file_gets_one_message(tmp_path, suffix):
    path = tmp_path / f"loop{suffix}"
    path.write_bytes(b"no such format, at all" * 9)
    with pytest.raises(InputError) as told:
        read_loop(path)
    assert len(told.value.problems) == 1
    assert len(str(told.value).removeprefix(str(path))) < 300


def test_a_unit_of_another_dimension_is_refused(tmp_path):
    path = tmp_path / "loop.mat"
    scipy.io.savemat(path, {"t_s": TIME, "displacement_N": MM, "force_N": KN})
    with pytest.raises(InputError, match="unit 'N' does not fit"):
        read_loop(path)
    scipy.io.savemat(path, {"t_s": TIME[:50], "displacement_mm": MM, "force_N": KN})
    with pytest.raises(InputError, match="the file has no time for this channel"):
        read_loop(path)
