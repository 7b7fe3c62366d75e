"""Key paths, with which numbers are changed."""

import pytest
from simple_machines import with_gasket_tables

from wm_drake.errors import InputError
from wm_drake.parameters import (
    BodyOverride,
    ForceTable,
    FrameOverride,
    load_machine,
    quantities,
    source_of,
    with_value,
    with_values,
)

NOT_COMPARED = {"sources", "measured", "published"}
"""Keys of an extended machine that differ from those of its base."""


@pytest.mark.parametrize(
    ("key", "value", "si"),
    [
        ("gravity", 1.62, 1.62),
        ("gravity", "1.62 m/s^2", 1.62),
        ("spring_types.suspension.stiffness", 3200.0, 3200.0),
        ("spring_types.suspension.stiffness", "3.2 N/mm", 3200.0),
        ("gasket.friction_torque_x", "80 N mm", 0.08),  # a default, not written in the file
        ("damper_types.friction.end_bushing.stiffness", "750 N mm/rad", 0.75),
        ("loads.counter.unbalances.1.mass", "300 g", 0.3),
        ("profile.time", (0.0, 50.0, 60.0), (0.0, 50.0, 60.0)),
        ("profile.time", "(0, 50, 60) s", (0.0, 50.0, 60.0)),
        ("accuracy", "0.1 %", 0.001),  # percents of a share are a value
    ],
)
def test_number_is_changed_and_nothing_else(reference, key, value, si):
    changed = with_value(reference, key, value)
    before, after = ({k: v for k, v, _ in quantities(p)} for p in (reference, changed))
    assert after[key] == pytest.approx(si)
    assert {k for k in before | after if before.get(k) != after.get(k)} == {key}


def test_percents_scale_a_number(reference):
    key = "damper_types.friction.friction_force"
    half = with_value(reference, key, "50 %").damper_types["friction"].friction_force
    assert half == 0.5 * reference.damper_types["friction"].friction_force


def test_original_is_unchanged(reference):
    before = reference.model_dump()
    with_value(reference, "loads.counter.unbalances.1.mass", 9.0)
    with_value(reference, "bodies.tub.mass", 9.0)
    assert reference.model_dump() == before


def test_every_number_can_be_set_to_what_it_is_and_to_its_text(reference):
    for key, value, unit in quantities(reference):
        assert with_value(reference, key, value) == reference, key
        assert with_value(reference, key, unit.text(value)) == reference, key


def test_numbers_are_listed_with_value_and_unit(reference, sponges):
    listed = {key: (value, unit.shown) for key, value, unit in quantities(reference)}
    assert listed["gasket.stiffness_x.force"] == (reference.gasket.stiffness_x.force, "N")
    assert listed["gasket.damping_x"] == (reference.gasket.damping_x, "N*s/mm")
    assert listed["loads.middle.unbalances.0.radius"] == (
        reference.loads["middle"].unbalances[0].radius,
        "mm",
    )
    assert listed["profile.speed"] == (reference.profile.speed, "rpm")
    assert len(listed) >= 50
    listed = {key: (value, unit.shown) for key, value, unit in quantities(sponges)}
    assert listed["gasket.stiffness_x"] == (sponges.gasket.stiffness_x, "N/mm")


def test_override_of_a_body_is_added(reference):
    changed = with_value(reference, "bodies.upper_counterweight.mass", "12 kg")
    assert changed.bodies == {"upper_counterweight": BodyOverride(mass=12.0)}
    again = with_value(changed, "bodies.upper_counterweight.centre_of_mass", (0.0, 0.0, 0.2))
    assert again.bodies == {
        "upper_counterweight": BodyOverride(mass=12.0, centre_of_mass=(0.0, 0.0, 0.2))
    }
    assert ("bodies.upper_counterweight.mass", 12.0) in [(k, v) for k, v, _ in quantities(again)]


def test_override_of_a_frame_is_added(reference):
    changed = with_value(reference, "frames.sensor_Xr.position", "(0, 201, -210) mm")
    assert changed.frames == {"sensor_Xr": FrameOverride(position=(0.0, 0.201, -0.21))}


def test_number_may_become_a_table(reference):
    table = {"displacement": "(0, 1) mm", "force": "(0, 8) N"}
    changed = with_value(reference, "spring_types.suspension.stiffness", table)
    assert changed.spring_types["suspension"].stiffness == ForceTable(
        displacement=(0.0, 0.001), force=(0.0, 8.0)
    )
    steeper = with_value(changed, "spring_types.suspension.stiffness.force", "(0, 9) N")
    assert steeper.spring_types["suspension"].stiffness.force == (0.0, 9.0)


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("gasket.stifness_x", "unknown key 'stifness_x' .did you mean 'stiffness_x'"),
        ("gaskett.stiffness_x", "unknown key 'gaskett' .did you mean 'gasket'"),
        ("loads.midle.unbalances.0.mass", "unknown key 'midle' .did you mean 'middle'"),
        ("bodies.tub.mas", "unknown key 'mas' .did you mean 'mass'"),
        ("damper_types.friction.end_bushing.stifness", "did you mean 'stiffness'"),
        ("loads.middle.unbalances.1.mass", "'1' does not exist; allowed are 0 to 0"),
        ("loads.middle.unbalances.first.mass", "'first' does not exist; allowed are 0 to 0"),
        ("gravity.x", "'x' does not exist; the path must end before it"),
        ("frames.damper_left_tub.position.1", "only the SDF has this list; write all of it"),
        ("", "unknown key ''"),
        ("gasket..stiffness_x", "unknown key ''"),
    ],
)
def test_unknown_key_is_refused(reference, key, message):
    with pytest.raises(InputError, match=message) as refused:
        with_value(reference, key, 1.0)
    assert [problem.key for problem in refused.value.problems] == [key]


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("gasket.stiffness_x", -1.0, "out of range; allowed is >= 0"),
        ("gasket.stiffness_x", "3 N", "does not fit"),
        ("gasket.stiffness_x", "3", "has no unit"),
        ("gasket.stiffness_x", float("nan"), "not a finite number"),
        ("gasket.stiffness_x", None, "is missing"),
        ("bodies.tub.mass", 0.0, "out of range; allowed is > 0"),
        ("springs.left.type", "rear", "'rear' is not in spring_types .known: suspension"),
        ("sensors.Xr.axis", "w", "'w' is not allowed; allowed are 'x', 'y' or 'z'"),
        ("profile.time", "(0, 5, 4) s", "times must rise"),
        ("bodies.tub.mass.x", 1.0, "not a number"),
    ],
)
def test_value_that_is_not_allowed_is_refused(reference, key, value, message):
    with pytest.raises(InputError, match=message) as refused:
        with_value(reference, key, value)
    assert [problem.key for problem in refused.value.problems] == [key]


def test_missing_parts_of_an_inertia_are_named(reference):
    with pytest.raises(InputError, match=r"yy.*is missing\n.*zz.*is missing"):
        with_value(reference, "bodies.tub.inertia.xx", 1.0)


def test_source_is_the_nearest_above(reference):
    assert source_of(reference, "profile.time") == source_of(reference, "profile") != ""
    assert source_of(reference, "gravity") == "standard value to three digits"
    assert source_of(reference, "drive.joint") == ""


def test_setting_several_values_at_once_equals_setting_them_one_by_one(reference):
    values = {
        "gasket.damping_x": "0.03 N s/mm",
        "gasket.stiffness_x": {"displacement": "(-9, 0, 9) mm", "force": "(-20, 0, 30) N"},
        "gasket.stiffness_x.force": "(-20, 0, 40) N",
        "loads.counter.unbalances.0.mass": 0.3,
        "loads.counter.unbalances.1.mass": 0.4,
        "bodies.tub.mass": 9.0,
        "bodies.tub.centre_of_mass": (0.0, 0.0, 0.1),
        "frames.sensor_Xr.position": (0.0, 0.2, -0.2),
    }
    one_by_one = reference
    for key, value in values.items():
        one_by_one = with_value(one_by_one, key, value)
    assert with_values(reference, values) == one_by_one
    assert with_values(reference, {}) == reference


def test_two_values_that_only_fit_together_are_set_together(reference):
    longer = {
        "gasket.stiffness_x.displacement": (-0.01, 0.0, 0.01),
        "gasket.stiffness_x.force": (-9.0, 0.0, 9.0),
    }
    tables = with_gasket_tables(reference)
    with pytest.raises(InputError, match="needs as many values"):
        with_value(tables, *next(iter(longer.items())))
    assert with_values(tables, longer).gasket.stiffness_x.force == (-9.0, 0.0, 9.0)


def test_every_problem_among_several_values_names_its_key(reference):
    with pytest.raises(InputError) as refused:
        with_values(
            reference,
            {"gasket.damping_x": -1.0, "gasket.damping_y": 2.0, "gasket.damping_z": "3 N"},
        )
    assert [problem.key for problem in refused.value.problems] == [
        "gasket.damping_x",
        "gasket.damping_z",
    ]


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("dampers.lft", r"dampers.lft: unknown key 'lft' \(did you mean 'left'"),
        ("gravity", "gravity: is missing"),
        ("loads.counter.unbalances.1", "one entry of a list cannot be removed"),
        ("damper_types.friction", r"left\.type: 'friction' is not in damper_types"),
        ("frames.nosuch", r"frames\.nosuch: unknown key 'nosuch'"),
    ],
)
def test_what_cannot_be_removed_is_refused(reference, key, message):
    with pytest.raises(InputError, match=message):
        with_value(reference, key, None)


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("dampers.left", "dampers: {left: null}"),
        ("gasket", "gasket: null"),
        ("gasket.damping_x", "gasket: {damping_x: null}"),
        ("sensors.Xr", "sensors: {Xr: null}"),
        ("loads.front", "loads: {front: null}"),
    ],
)
def test_none_removes_as_null_in_a_file(reference, tmp_path, key, text):
    path = tmp_path / "file.yaml"
    path.write_text(f"extends: reference\n{text}\n")
    in_file = load_machine(path).model_dump(exclude=NOT_COMPARED)
    removed = with_value(reference, key, None).model_dump(exclude=NOT_COMPARED)
    assert removed == in_file
    assert removed != reference.model_dump(exclude=NOT_COMPARED)


def test_parts_that_do_not_change_stay_the_same_objects():
    """A study recognises them by identity, and prepares them once."""
    parameters = load_machine("reference")
    changed = with_values(parameters, {"gasket.damping_x": 30.0})
    assert changed.gasket.damping_x == 30.0
    assert changed.springs is parameters.springs
    assert changed.loads is parameters.loads
    whole = type(parameters).model_validate(changed.model_dump(exclude_unset=True))
    assert changed == whole


def test_number_that_was_not_there_is_checked_against_the_other_parts():
    """A spring has a preload or a type with a free length, not both."""
    parameters = load_machine("reference")
    name, spring = next(iter(parameters.springs.items()))
    given = with_values(
        parameters,
        {f"springs.{name}.preload": None, f"spring_types.{spring.type}.free_length": 0.2},
    )
    with pytest.raises(InputError, match="give only one of them"):
        with_values(given, {f"springs.{name}.preload": 50.0})
