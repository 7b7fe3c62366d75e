"""Spin profiles and loads: steps, points, CSV, and what is refused."""

import math

import numpy as np
import pytest
from pydantic import ValidationError
from pydrake.multibody.tree import SpatialInertia, UnitInertia

from wm_drake.errors import InputError
from wm_drake.model.bodies import with_load
from wm_drake.parameters import Load, SpinProfile, Unbalance, load_load, load_profile

RPM = 2.0 * math.pi / 60.0


def from_text(tmp_path, text, name="profile.yaml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return load_profile(path)


def from_steps(tmp_path, *steps):
    return from_text(tmp_path, "steps:\n" + "".join(f"  - {step}\n" for step in steps))


def test_ramp_and_hold_of_the_paper(tmp_path):
    profile = from_steps(tmp_path, "{ramp_to: 400 rpm, rate: 7 rpm/s}", "{hold_until: 70 s}")
    assert profile.time == pytest.approx((0.0, 57.142857142857146, 70.0), rel=1e-14)
    assert profile.speed == pytest.approx((0.0, 400.0 * RPM, 400.0 * RPM), rel=1e-14)
    assert profile.duration == 70.0
    assert profile.acceleration() == pytest.approx([7.0 * RPM, 0.0], rel=1e-14)
    assert profile.speed_at([0.0, 10.0, 60.0]) == pytest.approx([0.0, 70.0 * RPM, 400.0 * RPM])


def test_ramp_down_and_backwards(tmp_path):
    profile = from_steps(
        tmp_path,
        "{ramp_to: 60 rpm, rate: 30 rpm/s}",
        "{hold_until: 5 s}",
        "{ramp_to: -30 rpm, rate: 45 rpm/s}",
    )
    assert profile.time == pytest.approx((0.0, 2.0, 5.0, 7.0))
    assert np.array(profile.speed) / RPM == pytest.approx([0.0, 60.0, 60.0, -30.0])


def test_points(tmp_path):
    profile = from_text(
        tmp_path, "source: me\ntime: {value: '(0, 2) s', source: clock}\nspeed: (0, 60) rpm\n"
    )
    assert profile == SpinProfile(time=(0.0, 2.0), speed=(0.0, 60.0 * RPM))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("steps: []", "is empty"),
        ("time: (0) s\nspeed: (0) rpm", "is empty"),
        ("time: () s\nspeed: () rpm", "not a list of numbers"),
        ("time: (0, 2, 1) s\nspeed: (0, 1, 2) rpm", "times must rise"),
        ("time: (0, 1, 1) s\nspeed: (0, 1, 2) rpm", "times must rise"),
        ("time: (1, 2) s\nspeed: (0, 1) rpm", "must begin at time 0 s, begins at 1 s"),
        ("time: (-1, 2) s\nspeed: (0, 1) rpm", "must begin at time 0 s"),
        ("time: (0, 2) s\nspeed: (0, 1, 2) rpm", "has 2 times but 3 speeds"),
        ("time: (0, nan) s\nspeed: (0, 1) rpm", "not a list of numbers"),
        ("time: [0, .nan]\nspeed: (0, 1) rpm", "has no unit|not a finite number"),
        ("time: (0, 2) s\nspeed: (0, 1e400) rpm", "not a finite number"),
        ("time: (0, 2) rpm\nspeed: (0, 1) rpm", "does not fit"),
        ("time: [0, 2]\nspeed: (0, 1) rpm", "has no unit"),
        ("time: (0, 2) s", "speed: is missing"),
        ("steps: 5", "a profile is either"),
        ("steps: [{hold_until: 1 s}]\n'2020-13-45': x", "unknown key '2020-13-45'; a profile"),
        ("steps: [{hold_until: 1 s}]\ntime: (0, 1) s", "a profile is either"),
        ("steps: [{ramp_to: 5 rpm}]", "a step is"),
        ("steps: [{ramp_to: 5 rpm, rate: 1 rpm/s, hold_until: 9 s}]", "a step is"),
        ("steps: [{ramp_to: 5 rpm, rate: 0 rpm/s}]", "allowed is > 0"),
        ("steps: [{ramp_to: 5 rpm, rate: -1 rpm/s}]", "allowed is > 0"),
        ("steps: [{ramp_to: 5 rpm, rate: 1 rpm}]", "does not fit"),
        ("steps: [{ramp_to: 5, rate: 1 rpm/s}]", "has no unit"),
        ("steps: [{ramp_to: 6 rpm, rate: 1 rpm/s}, {hold_until: 5 s}]", "times must rise"),
        ("steps: [{hold_until: -1 s}]", "times must rise"),
    ],
)
def test_bad_profile_is_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as refused:
        from_text(tmp_path, text)
    assert all(
        problem.where.startswith(str(tmp_path / "profile.yaml"))
        for problem in refused.value.problems
    )


def test_message_for_a_misspelt_key_of_a_step_names_the_keys_of_a_step(tmp_path):
    with pytest.raises(InputError, match="did you mean 'ramp_to'"):
        from_steps(tmp_path, "{ramp_t: 5 rpm, rate: 1 rpm/s}")


def test_nan_is_refused_in_code_too():
    with pytest.raises(ValidationError, match="not a finite number"):
        SpinProfile(time=(0.0, 1.0), speed=(0.0, math.nan))


@pytest.mark.parametrize("head", ["time_s,speed_rpm", "time [s],speed [rpm]"])
def test_profile_from_csv(tmp_path, head):
    text = f"# measured on a machine\n{head}\n0,0\n140,0  # still\n145, 110\n1.5e2,-60.5\n"
    profile = from_text(tmp_path, text, "profile.csv")
    assert profile.time == (0.0, 140.0, 145.0, 150.0)
    assert np.array(profile.speed) / RPM == pytest.approx([0.0, 0.0, 110.0, -60.5])


@pytest.mark.parametrize("head", ["", "\ufeff", "sep=;\r\n"])
def test_profile_of_a_spreadsheet(tmp_path, head):
    text = f"{head}Time [s];speed [rpm]\r\n0;0\r\n140,0;0\r\n1,5e2;-60,5\r\n;\r\n"
    for content in (text, text.replace(";", "\t")):
        profile = from_text(tmp_path, content, "profile.csv")
        assert profile.time == (0.0, 140.0, 150.0)
        assert np.array(profile.speed) / RPM == pytest.approx([0.0, 0.0, -60.5])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "cannot be read as CSV"),
        ("# nothing\n", "cannot be read as CSV"),
        ("time_s,speed_rpm\n", "is empty"),
        ("time_s,speed_rpm\n0,0\n", "is empty"),
        ("time,speed\n0,0\n1,1\n", "needs the columns time_s,speed_rpm, has time,speed"),
        ("speed_rpm,time_s\n0,0\n1,1\n", "needs the columns"),
        ("time_s,speed_rpm,torque\n0,0,0\n1,1,1\n", "needs the columns"),
        ("time_s;speed_rpm\n0;0\n1;1,5,0\n", "row 2 of the data: '1,5,0' is not a finite"),
        ("time_s,speed_rpm\n0,0\n1,fast\n", "row 2 of the data: .* is not a finite"),
        ("time_s,speed_rpm\n0,0\n1,\n", "row 2 of the data: .* is not a finite"),
        ("time_s,speed_rpm\n0,0\n1\n", "row 2 of the data: .* is not a finite"),
        ("time_s,speed_rpm\n0,0\n1,nan\n", "row 2 of the data: .* is not a finite"),
        ("time_s,speed_rpm\n0,0\ninf,1\n", "row 2 of the data: .* is not a finite"),
        ("time_s,speed_rpm\n0,0\n1,1e400\n", "row 2 of the data: .* is not a finite"),
        (
            "time_s,speed_rpm\n0,0,5\n1,7,5\n",
            "columns|cannot be read|numbers",
        ),  # three values under two names
        ("time_s,speed_rpm\n0,0\n1,7,5\n", "cannot be read as CSV"),
        ("time_s,speed_rpm\n0,0\n2,1\n1,2\n", "times must rise"),
        ("time_s,speed_rpm\n1,0\n2,1\n", "must begin at time 0 s"),
    ],
)
def test_bad_csv_is_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as refused:
        from_text(tmp_path, text, "profile.csv")
    assert refused.value.problems[0].where == str(tmp_path / "profile.csv")


def test_csv_that_is_not_text_is_refused(tmp_path):
    path = tmp_path / "profile.csv"
    path.write_bytes(b"time_s,speed_rpm\n0,0\n1,\xff\xfe\n")
    with pytest.raises(InputError, match="is not a finite number"):
        load_profile(path)


@pytest.mark.parametrize(
    ("phase", "place"),
    [(0.0, (0.0, 0.1, 0.25)), (math.pi / 2.0, (0.25, 0.1, 0.0)), (math.pi, (0.0, 0.1, -0.25))],
)
def test_phase_turns_an_unbalance_from_the_top_to_the_right(phase, place):
    assert Unbalance(mass=1.0, radius=0.25, y=0.1, phase=phase).position() == pytest.approx(
        place, abs=1e-15
    )


def test_load_file(tmp_path):
    path = tmp_path / "towels.yaml"
    path.write_text(
        "unbalances:\n  - {mass: {value: 300 g, source: scale}, radius: 24 cm, y: -32 mm, phase: 90 deg}\n"
    )
    assert load_load(path) == Load(
        unbalances=({"mass": 0.3, "radius": 0.24, "y": -0.032, "phase": math.pi / 2.0},)
    )


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{mass: -1 kg, radius: 1 mm, y: 0 mm}", ":2: unbalances.0.mass: '-1 kg' is out of range; allowed is >= 0"),
        ("{mass: 1 kg, radius: -1 mm, y: 0 mm}", ":2: unbalances.0.radius: '-1 mm' is out of range"),
        ("{mass: 1 kg, radius: 1 mm}", ":2: unbalances.0.y: is missing"),
        ("{mass: 1, radius: 1 mm, y: 0 mm}", ":2: unbalances.0.mass: '1' has no unit"),
        ("{mas: 1 kg, mass: 1 kg, radius: 1 mm, y: 0 mm}", "unknown key 'mas' .did you mean 'mass'"),
    ],
)  # fmt: skip
def test_bad_load_file_is_refused(tmp_path, entry, message):
    path = tmp_path / "towels.yaml"
    path.write_text(f"unbalances:\n  - {entry}\n")
    with pytest.raises(InputError, match=message):
        load_load(path)


STAIRS = "{{stairs_to: {to} rpm, stair: 40 rpm, rate: 60 rpm/s, settle: 1 s, measure: 2 s}}"


def test_staircase_goes_up_and_down_with_a_region_at_each_hold(tmp_path):
    profile = from_steps(tmp_path, STAIRS.format(to=100), STAIRS.format(to=60))
    rpm = [speed / RPM for speed in profile.speed]
    assert rpm == pytest.approx([0.0, 40.0, 40.0, 80.0, 80.0, 100.0, 100.0, 60.0, 60.0])
    assert [region.name for region in profile.regions] == ["up_40", "up_80", "up_100", "down_60"]
    for region in profile.regions:
        assert region.end - region.begin == pytest.approx(2.0)
        assert profile.speed_at(region.begin - 1.0 + 1e-9) == profile.speed_at(region.end)
    assert profile.duration == pytest.approx(4 * 3.0 + (40 + 40 + 20 + 40) / 60)


def test_load_needs_an_unbalance_of_some_form():
    with pytest.raises(ValidationError, match="needs unbalances, static or couple"):
        Load.model_validate({})


def test_static_and_couple_unbalance_are_those_of_point_masses():
    drum = SpatialInertia(9.0, [0.0, 0.06, 0.0], UnitInertia(0.04, 0.04, 0.04))
    masses = [
        {"mass": 1e-6, "radius": 1e3, "y": y, "phase": phase}
        for y, phase in [(0.1, 0.3), (-0.1, 0.3 + math.pi), (0.02, 1.2)]
    ]
    parts = {
        "couple": {"moment": 2 * 1e-3 * 0.1, "phase": 0.3},
        "static": {"moment": 1e-3, "y": 0.02, "phase": 1.2},
    }
    of_masses = with_load(drum, Load.model_validate({"unbalances": masses}))
    of_parts = with_load(drum, Load.model_validate(parts))
    np.testing.assert_allclose(
        of_parts.get_mass() * of_parts.get_com(),
        of_masses.get_mass() * of_masses.get_com(),
        atol=1e-15,
    )
    inertias = [one.CalcRotationalInertia().CopyToFullMatrix3() for one in (of_parts, of_masses)]
    np.testing.assert_allclose(inertias[0][0, 1], inertias[1][0, 1], atol=1e-12)
    np.testing.assert_allclose(inertias[0][2, 1], inertias[1][2, 1], atol=1e-12)


def test_unbalance_that_no_drum_can_have_is_refused():
    drum = SpatialInertia(9.0, [0.0, 0.06, 0.0], UnitInertia(0.04, 0.04, 0.04))
    with pytest.raises(InputError, match="too large for mass and inertia"):
        with_load(drum, Load.model_validate({"couple": {"moment": 5.0}}))


@pytest.mark.parametrize(("text", "share"), [("0.6", 0.6), ("60 %", 0.6), ("60%", 0.6)])
def test_a_share_of_water_may_be_in_percent(text, share):
    water = {"share": text, "speed": "(0, 400) rpm", "left": "(100, 60) %", "time_constant": "20 s"}
    mass = {"mass": "1 kg", "radius": "240 mm", "y": "0 mm", "water": water}
    (found,) = Load.model_validate({"unbalances": [mass]}).unbalances
    assert found.water.share == pytest.approx(share)
    assert found.water.left == pytest.approx((1.0, 0.6))


def test_a_profile_up_to_a_time_has_the_regions_that_end_by_then():
    text = {"time": "(0, 10, 20) s", "speed": "(0, 100, 300) rpm"}
    parts = [
        {"name": name, "begin": f"{begin} s", "end": f"{end} s"}
        for name, begin, end in (("A", 0, 5), ("B", 5, 15), ("C", 15, 20))
    ]
    profile = SpinProfile.model_validate({**text, "regions": parts})
    short = profile.until(15.0)
    assert short.time == (0.0, 10.0, 15.0)
    assert short.speed == pytest.approx(np.array([0.0, 100.0, 200.0]) * math.pi / 30.0)
    assert [region.name for region in short.regions] == ["A", "B"]
    assert profile.until(10.0).time == (0.0, 10.0)
    assert profile.until(25.0) is profile
