"""Measured loops from files: units, columns in any order, and one clear message for each fault."""

import numpy as np
import pytest

from wm_drake.errors import InputError
from wm_drake.parameters import load_component, read_loop, read_loops, shipped_components
from wm_drake.parameters.recorded import ChannelNames

TIME = np.linspace(0.0, 1.0, 40)
DISPLACEMENT, FORCE = 5.0 * np.sin(TIME), 30.0 * np.cos(TIME)
HEAD = "time [s], displacement [mm], force [N]"


def rows(time=TIME, displacement=DISPLACEMENT, force=FORCE):
    return [f"{t:.6f},{d:.6f},{f:.6f}" for t, d, f in zip(time, displacement, force, strict=True)]


def written(folder, head=HEAD, lines=None, name="loop.csv"):
    path = folder / name
    path.write_text(
        "\n".join(["# damper 7, bench 2", head, *(rows() if lines is None else lines)]) + "\n"
    )
    return path


def changed(number, text):
    lines = rows()
    lines[number] = text
    return lines


@pytest.mark.parametrize(
    ("head", "factor"),
    [
        (HEAD, (1.0, 1e-3, 1.0)),
        ("time (ms),displacement (mm),force (kN)", (1e-3, 1e-3, 1e3)),
        ("time_s,displacement_mm,force_N", (1.0, 1e-3, 1.0)),
        ("T [s], X [m], F [N]", (1.0, 1.0, 1.0)),
    ],
)
def test_units_of_the_header_are_converted_to_si(tmp_path, head, factor):
    loop = read_loop(written(tmp_path, head))
    assert loop.time == pytest.approx(factor[0] * TIME, abs=1e-6)
    assert loop.displacement == pytest.approx(factor[1] * 5.0 * np.sin(TIME), abs=1e-6)
    assert loop.force == pytest.approx(factor[2] * 30.0 * np.cos(TIME), abs=1e-3)
    assert not loop.rotates


def test_columns_may_be_in_any_order_among_others(tmp_path):
    lines = [
        f"{f};{k};{t};{d}"
        for k, (t, d, f) in enumerate(
            zip(TIME, 5.0 * np.sin(TIME), 30.0 * np.cos(TIME), strict=True)
        )
    ]
    loop = read_loop(written(tmp_path, "force_N;sample;time_s;displacement_mm", lines))
    assert loop.force[0] == 30.0
    assert loop.time == pytest.approx(TIME)


def test_units_may_come_from_the_command_line(tmp_path):
    names = ChannelNames(units={"time": "s", "displacement": "mm", "force": "N"})
    loop = read_loop(written(tmp_path, "time,displacement,force"), names)
    assert loop.displacement[-1] == pytest.approx(5e-3 * np.sin(1.0), abs=1e-8)


def test_angle_and_moment_are_a_rotation(tmp_path):
    loop = read_loop(written(tmp_path, "time_s,angle_deg,moment_Nm"))
    assert loop.rotates
    assert loop.displacement[-1] == pytest.approx(np.deg2rad(5.0 * np.sin(1.0)), abs=1e-7)


@pytest.mark.parametrize(
    ("head", "lines", "message"),
    [
        ("time [s], force [N]", [f"{t},1" for t in TIME], ": has no channel of displacement; its channels are time, force; choose one: --channels displacement=NAME"),
        ("time [s], displacement [mm], d [mm], force [N]", [f"{row},0" for row in rows()], ": has several channels of displacement: displacement, d; choose one"),
        ("time [s], displacement [mm], moment [N m]", None, ": mixes a rotation with a translation"),
        ("time [s], displacement [mm], force", None, ": force: has no unit; write 'force [N]' in the header, or name it: --unit 'force=N'"),
        ("time, displacement [mm], force [N]", None, ": time: has no unit; write 'time [s]' in the header, or name it: --unit time=s"),
        ("time [s], displacement [N], force [N]", None, ": displacement [N]: unit 'N' does not fit; allowed is a unit such as mm"),
        ("time [s], displacement [furl], force [N]", None, ": displacement [furl]: unit 'furl' is not known"),
        (HEAD, changed(3, "0.1,1.0,-"), ":6: force [N]: '-' is not a number"),
        (HEAD, changed(3, "0.1,5 mm,3.0"), ":6: displacement [mm]: '5 mm' is not a number"),
        (HEAD, changed(3, "0.1,1.0"), ":6: has 2 values but the header has 3 columns"),
        (HEAD, changed(5, "0.01,1.0,2.0"), ":8: time [s]: time falls: 0.01 after 0.102564"),
        (HEAD, rows(force=np.full(40, 7.0)), ": force [N]: is constant (7 in SI)"),
        (HEAD, rows(displacement=np.zeros(40)), ": displacement [mm]: is constant"),
        (HEAD, rows()[:19], ": has 19 samples; a loop needs at least 20"),
    ],
)  # fmt: skip
def test_a_bad_file_gets_one_message_with_file_and_line(tmp_path, head, lines, message):
    path = written(tmp_path, head, lines)
    with pytest.raises(InputError) as told:
        read_loop(path)
    assert len(told.value.problems) == 1
    assert str(told.value).startswith(f"{path}{message}")


def test_contradicting_units_are_refused(tmp_path):
    with pytest.raises(InputError, match="force: is in N by the file, in kN by the option"):
        read_loop(written(tmp_path), ChannelNames(units={"force": "kN"}))
    read_loop(written(tmp_path), ChannelNames(units={"force": "newton"}))


def test_all_bad_files_are_reported_at_once_and_kinds_are_not_mixed(tmp_path):
    good, rotation = (
        written(tmp_path),
        written(tmp_path, "time_s,angle_deg,moment_Nm", name="turned.csv"),
    )
    bad = [written(tmp_path, lines=changed(3, "x,1,2"), name="x.csv"), tmp_path / "none.csv"]
    with pytest.raises(InputError) as told:
        read_loops([good, *bad])
    assert [problem.where for problem in told.value.problems] == [f"{bad[0]}:6", str(bad[1])]
    with pytest.raises(
        InputError,
        match=r"holds angles and moments, .* displacements and forces; all files of a fit must",
    ):
        read_loops([good, rotation])


def test_empty_file(tmp_path):
    path = tmp_path / "empty.csv"
    path.write_text("# nothing\n")
    with pytest.raises(InputError, match="is empty; a recording has a line of names"):
        read_loop(path)


@pytest.mark.parametrize("name", shipped_components())
def test_shipped_components_load_and_every_number_has_a_source(name):
    component = load_component(name)
    written_keys = component.parameters.model_fields_set - {"law"}
    assert {key.split(".")[0] for key in component.sources} == written_keys


def test_component_files_are_checked(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("law: coulomb\nfriction_force: 60\n")
    with pytest.raises(InputError, match="friction_force: '60' has no unit"):
        load_component(str(path))
    with pytest.raises(
        InputError, match=r"no shipped component of that name \(did you mean 'mstv_damper'"
    ):
        load_component("mstv_dampr")
