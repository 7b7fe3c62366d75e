"""Recorded files of every format: labels, clocks, gaps, units and names are treated alike."""

import warnings
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from lab_writers import CLOCKS, write_uff_clocks

from wm_drake.errors import InputError, InputNotice
from wm_drake.parameters import read_loop
from wm_drake.parameters.recorded import (
    ACCELERATION,
    SPEED,
    ChannelNames,
    ChannelUse,
    Synchronous,
    evenly,
    read_recording,
    resampled,
)
from wm_drake.parameters.recorded.formats import read_signals
from wm_drake.parameters.units import Unit, factor_of

STIFFNESS, DAMPING = 10e3, 500.0  # N/m, N s/m
TIME = 0.002 * np.arange(1000)


def loop(time, rate=2.0 * np.pi * 2.0):
    """Return displacement [mm] and force [N] of a spring with a dashpot."""
    x, v = 1e-3 * np.sin(rate * time), 1e-3 * rate * np.cos(rate * time)
    return 1e3 * x, STIFFNESS * x + DAMPING * v


def planted(measured):
    """Return stiffness [N/m] and damping [N s/m] of a measured loop, by least squares."""
    rate = 2.0 * np.pi * 2.0
    phase = rate * measured.time
    columns = np.stack([np.sin(phase), np.cos(phase)], axis=1)
    (a, b), (c, d) = (
        np.linalg.lstsq(columns, signal, rcond=None)[0]
        for signal in (measured.displacement, measured.force)
    )
    ratio = (d + 1j * c) / (b + 1j * a)
    return ratio.real, abs(ratio.imag) / rate


@pytest.mark.parametrize("unit", ["s", "ms", "us", "min"])
@pytest.mark.parametrize("suffix", CLOCKS)
def test_time_in_any_unit_gives_the_planted_numbers(tmp_path, suffix, unit):
    path, (mm, newton) = tmp_path / f"loop{suffix}", loop(TIME)
    CLOCKS[suffix](path, {"displacement": (TIME, mm, "mm"), "force": (TIME, newton, "N")}, unit)
    measured = read_loop(path)
    assert measured.time[-1] == pytest.approx(TIME[-1], rel=1e-4)
    assert planted(measured) == pytest.approx((STIFFNESS, DAMPING), rel=2e-3)


@pytest.mark.parametrize("suffix", CLOCKS)
def test_a_channel_that_begins_late_and_ends_early_is_on_the_common_clock(tmp_path, suffix):
    path, late = tmp_path / f"loop{suffix}", TIME[50:-100]
    channels = {
        "displacement": (TIME, loop(TIME)[0], "mm"),
        "force": (late, loop(late)[1], "N"),
    }
    CLOCKS[suffix](path, channels)
    with pytest.warns(InputNotice, match="do not cover the same time .* used is what all have"):
        measured = read_loop(path)
    assert len(measured.time) == len(late)
    assert measured.time[[0, -1]] == pytest.approx(late[[0, -1]], abs=1e-6)
    assert planted(measured) == pytest.approx((STIFFNESS, DAMPING), rel=1e-3)


@pytest.mark.parametrize("suffix", CLOCKS)
def test_channels_without_common_time_are_refused(tmp_path, suffix):
    path, later = tmp_path / f"loop{suffix}", TIME + 10.0
    CLOCKS[suffix](path, {"displacement": (TIME, *map_mm(TIME)), "force": (later, TIME, "N")})
    with pytest.raises(
        InputError, match=r"no time in common: displacement 0 to 1\.998 s; force 10"
    ):
        read_loop(path)


def map_mm(time):
    return loop(time)[0], "mm"


@pytest.mark.parametrize("suffix", [suffix for suffix in CLOCKS if suffix != ".uff"])
def test_missing_samples_are_left_out_and_never_bridged(tmp_path, suffix):
    path, (mm, newton) = tmp_path / f"loop{suffix}", loop(TIME)
    newton[300:400] = np.nan
    CLOCKS[suffix](path, {"displacement": (TIME, mm, "mm"), "force": (TIME, newton, "N")})
    with pytest.warns(InputNotice, match=r"force: 100 of 1000 samples .* \(0.2 s in 1 gap\)"):
        measured = read_loop(path)
    assert len(measured.time) == 900
    np.testing.assert_allclose(measured.gaps, [[TIME[299], TIME[400]]], atol=1e-6)
    assert planted(measured) == pytest.approx((STIFFNESS, DAMPING), rel=1e-3)


@pytest.mark.parametrize("suffix", CLOCKS)
def test_a_faster_channel_is_filtered_before_its_rate_is_reduced(tmp_path, suffix):
    """Plant 480 Hz in a force at 2000 Hz: at the 100 Hz of the displacement it would be 20 Hz."""
    path, slow, fast = tmp_path / f"loop{suffix}", 0.01 * np.arange(200), 0.0005 * np.arange(3981)
    force = loop(fast)[1] + 20.0 * np.sin(2.0 * np.pi * 480.0 * fast)
    CLOCKS[suffix](path, {"displacement": (slow, *map_mm(slow)), "force": (fast, force, "N")})
    with pytest.warns(InputNotice, match="force: its rate is reduced from 2000 to 100 Hz"):
        measured = read_loop(path)
    inside = slice(20, -20)  # the filter swings out at the ends
    np.testing.assert_allclose(measured.force[inside], loop(slow)[1][inside], atol=0.02)


@pytest.mark.parametrize(
    ("kind", "function", "unit", "words"),
    [
        (18, 2, "Hz", "a frequency: its function is auto spectrum"),
        (18, 4, "Hz", "a frequency: its function is frequency response"),
        (20, 1, "NONE", "an order"),
        (8, 0, "mm", "a displacement"),
        (0, 0, "mm", "a distance"),
        (0, 0, "NONE", "which the file does not name"),
    ],
)
def test_spectra_and_curves_of_uff_are_refused_in_words_of_the_file(
    tmp_path, kind, function, unit, words
):
    path = tmp_path / "x.uff"
    channels = {"displacement": (TIME, *map_mm(TIME)), "force": (TIME, TIME, "N")}
    write_uff_clocks(path, channels, unit, kind, function)
    with pytest.raises(InputError, match=f"displacement: was recorded over .*{words}"):
        read_loop(path)


def write_angle_mdf(path):
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="4.10")
    signals = [
        asammdf.Signal(values, 360.0 * TIME, name=name, unit=unit, master_metadata=("angle", 2))
        for name, values, unit in (("displacement", TIME, "mm"), ("force", TIME, "N"))
    ]
    file.append(signals)
    file.groups[0].channels[0].unit = "deg"
    file.save(path, overwrite=True)
    file.close()


def write_angle_tdms(path):
    nptdms = pytest.importorskip("nptdms")
    about = {"wf_increment": 0.72, "wf_xname": "Crank", "wf_xunit_string": "deg"}
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("g", name, TIME, {**about, "unit_string": unit})
                for name, unit in (("displacement", "mm"), ("force", "N"))
            ]
        )


def write_angle_hdf5(path):
    import h5py

    with h5py.File(path, "w") as file:
        file["angle"] = TIME
        file["angle"].attrs["units"] = "deg"
        file["angle"].make_scale("angle")
        for name, unit in (("displacement", "mm"), ("force", "N")):
            file[name] = TIME
            file[name].attrs["units"] = unit
            file[name].dims[0].attach_scale(file["angle"])


@pytest.mark.parametrize(
    ("suffix", "write"),
    [(".mf4", write_angle_mdf), (".tdms", write_angle_tdms), (".h5", write_angle_hdf5)],
)
def test_a_recording_over_an_angle_is_refused(tmp_path, suffix, write):
    path = tmp_path / f"x{suffix}"
    write(path)
    with pytest.raises(InputError, match=r"was recorded over '\w+' \[deg\], an angle"):
        read_loop(path)


def test_complex_values_are_refused(tmp_path):
    path = tmp_path / "x.mat"
    scipy.io.savemat(path, {"time": TIME, "displacement": TIME + 1j, "force": TIME})
    with pytest.raises(InputError, match="displacement: has complex values"):
        read_loop(path, ChannelNames(units={"time": "s", "displacement": "mm", "force": "N"}))


@pytest.mark.parametrize("suffix", CLOCKS)
def test_units_of_the_file_are_read_and_others_named(tmp_path, suffix):
    """A drum speed in U/min, and an acceleration whose unit the user names."""
    path = tmp_path / f"x{suffix}"
    channels = {"speed": (TIME, 60.0 + TIME, "U/min"), "acc": (TIME, np.sin(TIME), "-")}
    CLOCKS[suffix](path, channels)

    def read(names=None):
        recording = read_recording(path, names)
        wanted = {
            "speed": ChannelUse(recording.chosen("speed"), SPEED, "rpm"),
            "acc": ChannelUse(recording.chosen("acc"), ACCELERATION, "m/s^2"),
        }
        return recording.synchronous(wanted)

    with pytest.warns(InputNotice, match=r"acc: the file has no unit; m/s\^2 is assumed"):
        assumed = read()
    assert assumed.values["speed"][0] == pytest.approx(2.0 * np.pi)
    with warnings.catch_warnings():
        warnings.simplefilter("error", InputNotice)
        given = read(ChannelNames(units={"acc": "g"}))
    np.testing.assert_allclose(given.values["acc"], 9.80665 * assumed.values["acc"])
    with pytest.raises(InputError, match="speed: is in U/min by the file, in Hz by the option"):
        read(ChannelNames(units={"speed": "Hz", "acc": "g"}))
    with pytest.raises(InputError, match=r"--unit: .* has no channel 'Acc 9'"):
        read(ChannelNames(units={"Acc 9": "g"}))


@pytest.mark.parametrize("suffix", CLOCKS)
@pytest.mark.parametrize("unit", ["V", "mV", "mm"])
def test_a_force_in_another_unit_is_refused(tmp_path, suffix, unit):
    path = tmp_path / f"x{suffix}"
    CLOCKS[suffix](path, {"displacement": (TIME, *map_mm(TIME)), "force": (TIME, TIME, unit)})
    with pytest.raises(InputError, match=f"force.*: unit '{unit}' does not fit; allowed is"):
        read_loop(path)


RPM, RAD = 2.0 * np.pi / 60.0, np.pi / 180.0
UNITS = {
    "rad/s": {
        **dict.fromkeys(
            ("RPM", "rpm", "U/min", "1/min", "min-1", "min^-1", "min⁻¹", "rev/min", "r/min"), RPM
        ),
        **dict.fromkeys(("Hz", "rev/s"), 2.0 * np.pi),
        **dict.fromkeys(("deg/s", "°/s"), RAD),
    },
    "m/s^2": {
        **dict.fromkeys(("m/s²", "m/s^2", "m/s2", "m/s**2", "[m/s^2]", "m·s^-2"), 1.0),
        **dict.fromkeys(("mm/s²", "mm/s^2", "mm/s2"), 1e-3),
        **dict.fromkeys(("g", "gn", "G", "g_0"), 9.80665),
        "mg": 9.80665e-3,
    },
    "N": {"N": 1.0, "kN": 1e3, "KN": 1e3, "lbf": 4.4482216152605, "daN": 10.0, "kp": 9.80665},
    "N*m": {"Nm": 1.0, "N·mm": 1e-3, "N mm": 1e-3, "Nmm": 1e-3, "kNm": 1e3, "N-m": 1.0},
    "s": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "µs": 1e-6, "μs": 1e-6, "min": 60.0, "h": 3600.0},
    "m": {"mm": 1e-3, "MM": 1e-3, "µm": 1e-6, "in": 0.0254},
    "rad": {"deg": RAD, "°": RAD, "mrad": 1e-3},
}


@pytest.mark.parametrize(
    ("si", "text"), [(si, text) for si, texts in UNITS.items() for text in texts]
)
def test_units_as_instruments_write_them(si, text):
    assert factor_of(text, Unit(si, si)) == pytest.approx(UNITS[si][text], rel=1e-12)


@pytest.mark.parametrize(
    ("si", "text"),
    [("rad/s", "1/s"), ("N", "V"), ("N", "lb"), ("s", "deg"), ("s", "Hz"), ("m/s^2", "mm"), ("N", "-")],
)  # fmt: skip
def test_units_that_do_not_fit_are_refused(si, text):
    with pytest.raises(ValueError, match=r"does not fit|has no unit"):
        factor_of(text, Unit(si, si))


def write_text(path, text, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return path


ROWS = [f"{t:.3f},{x:.6f},{f:.6f}" for t, x, f in zip(TIME, *loop(TIME), strict=True)]
TABLE = "\n".join(["time [s],displacement [mm],force [N]", *ROWS])


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (TABLE, "utf-8-sig"),
        (TABLE, "utf-16"),
        (TABLE.replace(",", ";"), "utf-8"),
        (TABLE.replace(",", "\t"), "utf-8"),
        ("sep=;\n" + TABLE.replace(",", ";"), "utf-8"),
        (TABLE.replace(",", " ").replace("time [s] displacement [mm] force [N]", "time_s displacement_mm force_N"), "utf-8"),
        ("\n".join(line + ",," for line in TABLE.splitlines()), "utf-8"),
        ("\n".join([TABLE.splitlines()[0], *(f"{row}," for row in ROWS)]), "utf-8"),
        ("\n".join(["time,displacement,force", "s,mm,N", *ROWS]), "utf-8"),
        ("\n".join(["time,displacement,force", "[s],[mm],[N]", *ROWS]), "utf-8"),
        ("\n".join(["time / s,displacement / mm,force in N", *ROWS]), "utf-8"),
        ("\n".join(["time (s),displacement (µm),force (N)", *(f"{t:.3f},{1e3 * x:.3f},{f:.6f}" for t, x, f in zip(TIME, *loop(TIME), strict=True))]), "cp1252"),
        ("\n".join(['"Time [s]","Displacement\n[mm]","Force [N]"', *ROWS]), "utf-8"),
        ("\n".join(["time,displacement [mm],force [N]", *(f"2026-05-01T23:59:{59 + t:06.3f},{x:.6f},{f:.6f}" if t < 1 else f"2026-05-02T00:00:{t - 1:06.3f},{x:.6f},{f:.6f}" for t, x, f in zip(TIME, *loop(TIME), strict=True))]), "utf-8"),
        ("\n".join(["time,displacement [mm],force [N]", *(f"23:59:{59 + t:06.3f},{x:.6f},{f:.6f}" if t < 1 else f"00:00:{t - 1:06.3f},{x:.6f},{f:.6f}" for t, x, f in zip(TIME, *loop(TIME), strict=True))]), "utf-8"),
        ("\n".join(["time,displacement [mm],force [N]", *(f"03/04/2026 01:00:{t:06.3f} PM,{x:.6f},{f:.6f}" for t, x, f in zip(TIME, *loop(TIME), strict=True))]), "utf-8"),
    ],
)  # fmt: skip
def test_tables_of_every_usual_form_are_the_same(tmp_path, text, encoding):
    measured = read_loop(write_text(tmp_path / "loop.csv", text, encoding))
    np.testing.assert_allclose(measured.time, TIME, atol=1e-9)
    np.testing.assert_allclose(measured.displacement, 1e-3 * loop(TIME)[0], atol=1e-8)
    assert planted(measured) == pytest.approx((STIFFNESS, DAMPING), rel=1e-4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TABLE.replace("0.004,", "0,004;"), r"x.csv:4: displacement \[mm\]: '004;0.050244' is not a number"),
        (TABLE.replace(",", ";").replace(".", ","), "'0,002' is not a number; the decimal sign is a point|'0,000' is not"),
        ("\n".join(ROWS), "x.csv:1: has numbers where the names of the columns belong"),
        (TABLE.replace("0.010,", "0.001,"), r"x.csv:7: time \[s\]: time falls: 0.001 after 0.008"),
        (TABLE.replace("0.008,0.100", "0.008,x"), r"x.csv:6: displacement \[mm\]: 'x\w*' is not a number"),
        (TABLE.replace("time [s]", "angle [deg]"), "has several channels of displacement"),
        (TABLE.replace("time [s]", "frequency [Hz]"), "the file has no time for this channel"),
        (TABLE.replace("time [s]", "time [deg]"), "unit 'deg'|an angle"),
        ("\n".join(["time,displacement [mm],force [N]", *(f"0{1 + k % 9}/0{1 + k % 7}/2026 01:00:{t:06.3f},1,2" for k, t in enumerate(TIME))]), "can be read in two ways; write 2026-05-31"),
        ("\x00\x01" + TABLE, "is not text"),
        ("PK\x03\x04" + TABLE, "is a workbook or another archive; save the sheet as CSV"),
    ],
)  # fmt: skip
def test_wrong_tables_are_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as refusal:
        read_loop(write_text(tmp_path / "x.csv", text))
    assert len(refusal.value.problems) == 1


@pytest.mark.parametrize(("first", "step"), [(46142.5, 2e-8), (1.7776e12, 2.0)])
def test_dates_without_a_unit_are_refused(tmp_path, first, step):
    rows = [f"{first + step * k!r},60,{k % 7}" for k in range(100)]
    path = write_text(tmp_path / "x.csv", "\n".join(["time,speed,acc", *rows]))
    recording = read_recording(path)
    wanted = {"acc": ChannelUse(recording.chosen("acc"), ACCELERATION, "m/s^2")}
    with pytest.raises(InputError, match=r"has no unit, and its first value, .* looks like"):
        recording.synchronous(wanted)


def test_names_of_channels_with_blanks_commas_and_brackets(tmp_path):
    head = 'time [s],"Acc, left (1) [g]",Acc [g],Acc [g],Acc (left)'
    path = write_text(tmp_path / "x.csv", "\n".join([head, "0,1,2,3,4", "1,1,2,3,4"]))
    recording = read_recording(path)
    assert list(recording.addresses) == ["time", "Acc, left (1)", "Acc#1", "Acc#2", "Acc (left)"]
    assert recording.chosen("Acc, left (1) [g]").unit == "g"
    assert recording.chosen("Acc#2").values[0] == 3.0
    with pytest.raises(InputError, match="has 2 channels 'Acc'; one is needed: choose among Acc#1"):
        recording.chosen("Acc")


def test_channels_are_chosen_by_group_and_node(tmp_path):
    nptdms, pyuff = pytest.importorskip("nptdms"), pytest.importorskip("pyuff")
    path = tmp_path / "x.tdms"
    with nptdms.TdmsWriter(path) as writer:
        about = {"wf_increment": 0.01}
        writer.write_segment(
            [nptdms.ChannelObject(g, "Acc", k * TIME, about) for k, g in ((1, "tub"), (2, "feet"))]
        )
    recording = read_recording(path)
    assert sorted(recording.addresses) == ["feet/Acc", "tub/Acc"]
    np.testing.assert_array_equal(recording.chosen("feet/Acc").values, 2.0 * TIME)
    with pytest.raises(InputError, match=r"choose among (tub/Acc, feet|feet/Acc, tub)/Acc"):
        recording.chosen("Acc")
    path = tmp_path / "x.unv"
    sets = [
        pyuff.prepare_58(
            binary=0, id1="Run 7", func_type=1, rsp_node=node, rsp_dir=direction, ref_node=0,
            ref_dir=0, abscissa_spacing=1, abscissa_min=0.0, abscissa_inc=0.01, num_pts=3997,
            ord_data_type=2, abscissa_spec_data_type=17, ordinate_spec_data_type=12,
            orddenom_spec_data_type=0, z_axis_spec_data_type=0, x=TIME,
            data=node * np.ones(3997),
        )
        for node, direction in ((1, 3), (2, -1))
    ]  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite", force_double=False)
    recording = read_recording(path)
    assert list(recording.addresses) == ["Run 7:1+Z", "Run 7:2-X"]
    # 3997 values in lines of six: zeros that fill the last line are no samples
    assert recording.chosen("Run 7:2-X").values.tolist() == [2.0] * 3997


def test_structures_and_matrices_of_matlab(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "x.mat"
    scipy.io.savemat(path, {"rec": {"time": TIME, "acc": TIME}, "m": np.outer(TIME, [1, 2])})
    recording = read_recording(path)
    assert list(recording.addresses) == ["time", "acc", "m(:,1)", "m(:,2)"]
    assert recording.chosen("rec/acc").abscissa.name == "time"
    assert recording.chosen("m(:,2)").values[-1] == pytest.approx(2.0 * TIME[-1])
    scipy.io.savemat(path, {"note": "no numbers"})
    with pytest.raises(InputError, match=r"has no numeric channel; its variables are note \(str\)"):
        read_recording(path)
    path = tmp_path / "v73.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name in ("time", "acc"):
            file[f"rec/{name}"] = TIME[None]
            file[f"rec/{name}"].attrs["MATLAB_class"] = np.bytes_("double")
        file["word"] = np.array([[72], [105]], dtype=np.uint16)
        file["word"].attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(128))
    recording = read_recording(path)
    assert sorted(recording.addresses) == ["acc", "time"]
    np.testing.assert_array_equal(recording.chosen("acc").abscissa.values, TIME)


def test_a_format_is_told_by_the_content_of_a_file(tmp_path):
    path, (mm, newton) = tmp_path / "loop.dat", loop(TIME)
    channels = {"displacement": (TIME, mm, "mm"), "force": (TIME, newton, "N")}
    for suffix, write in CLOCKS.items():
        write(tmp_path / f"loop{suffix}", channels)
        path.write_bytes((tmp_path / f"loop{suffix}").read_bytes())
        assert planted(read_loop(path)) == pytest.approx((STIFFNESS, DAMPING), rel=1e-3)


def test_interpolation_ends_where_the_samples_end():
    values = np.sin(TIME)[:, None].copy()
    values[500] = np.nan
    at = np.array([-0.1, 0.0, 0.5005, TIME[500], TIME[500] + 0.001, TIME[-1], TIME[-1] + 0.1])
    moved = resampled(TIME, values, at, 0.001)[:, 0]
    assert np.isnan(moved).tolist() == [True, False, False, True, True, False, True]
    assert moved[2] == pytest.approx(np.sin(0.5005), abs=1e-9)


def test_an_even_clock_has_places_for_samples_that_were_not_recorded(tmp_path):
    kept = np.delete(np.arange(1000), np.arange(400, 420))
    rows = [f"{TIME[k]:.3f},{k}" for k in kept]
    path = write_text(tmp_path / "x.csv", "\n".join(["time [s],acc [g]", *rows]))
    recording = read_recording(path)
    channels = recording.synchronous({"acc": ChannelUse(recording.chosen("acc"), None)})
    with pytest.warns(InputNotice, match=r"20 samples of 1000 were not recorded \(1 gap in"):
        even = evenly(channels)
    np.testing.assert_allclose(even.time, TIME, atol=1e-9)
    assert np.isnan(even.values["acc"]).sum() == 20


def test_scattered_time_stamps_are_made_even():
    random = np.random.default_rng(5)
    time = TIME + 0.0003 * random.uniform(-1.0, 1.0, len(TIME))
    channels = Synchronous(Path("x.csv"), time, {"acc": np.sin(2.0 * np.pi * 20.0 * time)})
    with pytest.warns(InputNotice, match="its steps of time scatter"):
        even = evenly(channels)
    assert np.ptp(np.diff(even.time)) < 1e-12
    wanted = np.sin(2.0 * np.pi * 20.0 * even.time)
    np.testing.assert_allclose(even.values["acc"], wanted, atol=2e-3)


def binary_set(name, unit, values):
    """Return a set 58b: a head of text, then little-endian floats of 8 bytes."""
    head = [
        "    -1",
        f"    58b     1     2          11{8 * len(values):>12}     0     0           0           0",
        *(f"{text:<80}" for text in (name, "NONE", "NONE", "NONE", "NONE")),
        "    1         0    0         0 NONE               1   3 NONE               0   0",
        f"         4{len(values):>10}         1  0.00000E+00  2.00000E-03  0.00000E+00",
        "        17    0    0    0 Time                 s                   ",
        f"         8    0    0    0 NONE                 {unit:<20}",
        "         0    0    0    0 NONE                 NONE                ",
        "         0    0    0    0 NONE                 NONE                ",
    ]
    return "\n".join(head).encode() + b"\n" + values.astype("<f8").tobytes() + b"\n    -1\n"


def test_binary_sets_of_uff_are_read(tmp_path):
    pytest.importorskip("pyuff")
    path, (mm, newton) = tmp_path / "x.uff", loop(TIME)
    path.write_bytes(binary_set("displacement", "mm", mm) + binary_set("force", "N", newton))
    assert planted(read_loop(path)) == pytest.approx((STIFFNESS, DAMPING), rel=1e-6)


def test_a_header_and_a_row_of_units_must_agree(tmp_path):
    text = "\n".join(["time [s],displacement [mm],force [N]", "ms,mm,N", *ROWS])
    with pytest.raises(InputError, match=r"time \[s\]: is in s by its header, in ms by the row"):
        read_loop(write_text(tmp_path / "x.csv", text))


def test_texts_beside_the_arrays_of_an_hdf5_file_are_no_references(tmp_path):
    import h5py

    path = tmp_path / "texts.h5"
    with h5py.File(path, "w") as file:
        file["labels"] = ["x", "y"]
        file["force"] = np.arange(5.0)
        file["force"].attrs["units"] = "N"
    (signal,) = read_signals(path)
    assert (signal.name, signal.unit) == ("force", "N")
