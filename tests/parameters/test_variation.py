"""Variations: texts, forms, ranges, and the machine with values of them."""

import pytest
from simple_machines import with_gasket_tables

from wm_drake.errors import InputError
from wm_drake.parameters import Change, apply, variation_of
from wm_drake.parameters.units import PureNumber, Share, Unit
from wm_drake.parameters.variation import change_of, number_at, owned_twice, range_of

STIFFNESS = Unit("N/m", "N/mm")
SPRING = "spring_types.suspension.stiffness"


@pytest.mark.parametrize(
    ("text", "unit", "change", "value"),
    [
        ("95 %", STIFFNESS, Change.PERCENT, 0.95),
        (" -5%", STIFFNESS, Change.PERCENT, -0.05),
        ("9 N/mm", STIFFNESS, Change.VALUE, 9000.0),
        ("nominal", STIFFNESS, Change.DISTANCE, 0.0),
        ("nominal + 2 N/mm", STIFFNESS, Change.DISTANCE, 2000.0),
        ("nominal - 2 N/mm", STIFFNESS, Change.DISTANCE, -2000.0),
        ("0.4", PureNumber(), Change.VALUE, 0.4),
        ("40 %", PureNumber(), Change.PERCENT, 0.4),
        ("40 %", Share(), Change.VALUE, 0.4),
        ("0.4", Share(), Change.VALUE, 0.4),
    ],
)
def test_form_and_value_of_a_text(text, unit, change, value):
    assert change_of(text, unit, "key") == (change, pytest.approx(value))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("9", "'9' has no unit"),
        ("9 kg", "unit 'kg' does not fit; allowed is a unit such as N/mm"),
        ("9 foo", "unit 'foo' is not known"),
        ("9,5 N/mm", "decimal sign is a point"),
        ("nominal + 2", "'2' has no unit"),
        ("nominal * 2 N/mm", "is not a number with a unit"),
        ("x %", "'x ' is not a number without unit"),
        ("(1, 2) N/mm", "is not a number with a unit"),
        ("", "'' is not a number with a unit"),
    ],
)
def test_wrong_text_is_refused_with_its_key(text, message):
    with pytest.raises(InputError) as caught:
        change_of(text, STIFFNESS, "k.low")
    assert caught.value.problems[0].key == "k.low"
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "ends"),
    [
        ("2 N/mm..4000 N/m", ("2 N/mm", "4000 N/m")),
        ("50 % .. 150 %", ("50 %", "150 %")),
        ("(1, 2) N/mm", ("1 N/mm", "2 N/mm")),
        ("(1,2)", ("1", "2")),
        ("1 mm", None),
        ("1 mm..", None),
        ("(1, 2, 3) mm", None),
    ],
)
def test_ends_of_a_range(text, ends):
    assert range_of(text) == ends


@pytest.mark.parametrize(
    ("text", "expected"), [("110 %", 1.1), ("nominal + 1 kN/m", None), ("9 N/mm", None)]
)
def test_variation_changes_all_its_numbers_and_nothing_else(sponges, text, expected):
    keys = (SPRING, "gasket.stiffness_x")
    variation, values = variation_of(sponges, "k", keys, {"to": text})
    changed = apply(sponges, [variation], [values["to"]])
    for key in keys:
        before, after = number_at(sponges, key).nominal, number_at(changed, key).nominal
        known = {"nominal + 1 kN/m": before + 1000.0, "9 N/mm": 9000.0}
        assert after == pytest.approx(expected * before if expected else known[text])
    if variation.change is not Change.VALUE:
        assert apply(sponges, [variation], [variation.nominal]) == sponges


def test_table_is_scaled_with_its_nominal_stiffness(reference):
    machine, key = with_gasket_tables(reference), "gasket.stiffness_x"
    variation, values = variation_of(machine, "k", (key,), {"low": "90 %", "high": "110 %"})
    low, high = (
        apply(machine, [variation], [value]).gasket.stiffness_x for value in values.values()
    )
    assert low.displacement == high.displacement == machine.gasket.stiffness_x.displacement
    assert low.nominal_stiffness == pytest.approx(0.9 * variation.numbers[0].nominal)
    assert high.force == pytest.approx([1.1 * f for f in machine.gasket.stiffness_x.force])


@pytest.mark.parametrize(
    ("key", "texts", "message"),
    [
        (SPRING, {"low": "90 %", "high": "9 N/mm"}, "low and high have different forms"),
        ("bodies.tub.mass", {"low": "90 %"}, "has no number of a machine"),
        ("damper_types.friction.friction_damping", {"low": "90 %"}, "percents of it are 0"),
        ("gasket.stifness_x", {"low": "90 %"}, "did you mean 'stiffness_x'"),
        ("bodies.tub.masss", {"low": "9 kg"}, "did you mean 'mass'"),
        ("profile.time", {"low": "9 s"}, "name one of them by its index"),
        ("profile.time.99", {"low": "9 s"}, "unknown key '99'"),
        ("gasket.tub_frame", {"low": "9 s"}, "is not a number of the machine"),
        ("gasket", {"low": "9 s"}, "is not a number of the machine"),
        ("gasket.stiffness_x", {"low": "9 N"}, "unit 'N' does not fit"),
    ],
)
def test_wrong_variation_is_refused(sponges, key, texts, message):
    with pytest.raises(InputError, match=message) as caught:
        variation_of(sponges, "k", (key,), texts)
    assert caught.value.problems[0].key.startswith(key)


def test_table_takes_percents_only(reference):
    with pytest.raises(InputError, match="is a table; write values in percent"):
        variation_of(reference, "g", ("gasket.stiffness_x",), {"to": "4 N/mm"})


def test_number_of_the_sdf_has_a_unit_but_no_value(reference):
    number = number_at(reference, "bodies.motor.mass")
    assert (number.nominal, number.unit.shown) == (None, "kg")


def test_key_of_two_variations_is_refused():
    (problem,) = owned_twice({"a": ("x", "y"), "b": ("y",)}, "factor")
    assert str(problem) == (
        "factor b: y: belongs to factor a already; a key may be in one factor only"
    )
