"""Units: text is converted to SI and back without loss."""

import math
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wm_drake.parameters import units
from wm_drake.parameters.units import Unit, to_si, to_si_vector

IN_FILE = SimpleNamespace(context={"units_required": True})
IN_CODE = SimpleNamespace(context=None)

STIFFNESS = Unit("N/m", "N/mm")
ROTATIONAL_STIFFNESS = Unit("N*m/rad", "N*mm/rad")
LENGTH = Unit("m", "mm")
MASS = Unit("kg", "kg")
ALL_UNITS = sorted(
    {kind.__metadata__[0] for kind in vars(units).values() if hasattr(kind, "__metadata__")},
    key=lambda unit: unit.shown,
)


@pytest.mark.parametrize(
    ("text", "si", "value"),
    [
        ("3.2 N/mm", "N/m", 3200.0),
        ("0.09 N s/mm", "N*s/m", 90.0),
        ("19 N s/m", "N*s/m", 19.0),
        ("60 N mm s/deg", "N*m*s/rad", 60e-3 * 180.0 / math.pi),
        ("750 N mm/rad", "N*m/rad", 0.75),
        ("1 N mm/deg", "N*m/rad", 1e-3 * 180.0 / math.pi),
        ("7 rpm/s", "rad/s^2", 7.0 * 2.0 * math.pi / 60.0),
        ("400 rpm", "rad/s", 400.0 * 2.0 * math.pi / 60.0),
        ("180 deg", "rad", math.pi),
        ("-32 mm", "m", -0.032),
        ("0.7 kg", "kg", 0.7),
        ("700 g", "kg", 0.7),
        ("2 kg m^2", "kg*m^2", 2.0),
        ("1.5 min", "s", 90.0),
        ("0.001 mm/s", "m/s", 1e-6),
        ("9.81 m/s^2", "m/s^2", 9.81),
        (" +1.e1mm ", "m", 0.01),
        ("1e-3 N·m", "N*m", 1e-3),
    ],
)
def test_text_becomes_si(text, si, value):
    assert to_si(text, IN_FILE, Unit(si, si)) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(("unit", "other"), sorted(units.FACTORS))
def test_known_factors_are_those_of_pint(unit, other):
    random = np.random.default_rng(0)
    numbers = random.normal(size=200) * 10.0 ** random.uniform(-6.0, 6.0, size=200)
    for spelt in (unit, unit.replace("*", " ")):
        quantities = [units.registry().Quantity(float(n), spelt).to(other) for n in numbers]
        assert [q.magnitude for q in quantities] == [
            n * units.FACTORS[unit, other] for n in numbers
        ]


def test_shipped_machine_is_read_without_pint():
    code = (
        "import sys, wm_drake as wm; wm.load_machine('reference'); assert 'pint' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_vector_becomes_si():
    assert to_si_vector("(1, -2.5, 3e1) mm", IN_FILE, LENGTH) == pytest.approx(
        (0.001, -0.0025, 0.03)
    )


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("1 N mm", ROTATIONAL_STIFFNESS),  # a torque is not a torque per angle
        ("1 N/mm", ROTATIONAL_STIFFNESS),
        ("1 N", STIFFNESS),
        ("1 N mm/rad", Unit("N*m", "N*mm")),
        ("1 Hz", Unit("rad/s", "rpm")),
        ("1 1/s", Unit("rad/s", "rpm")),
        ("1 percent", Unit("rad", "deg")),
        ("1 rad", LENGTH),
        ("1 lbf", MASS),
    ],
)
def test_another_dimension_is_refused(text, unit):
    with pytest.raises(ValueError, match="does not fit; allowed is a unit such as"):
        to_si(text, IN_FILE, unit)


@pytest.mark.parametrize(
    ("value", "read"),
    [("1", to_si), (1, to_si), (1.0, to_si), ("(1, 2)", to_si_vector), ([1, 2], to_si_vector)],
)
def test_missing_unit_is_refused_in_a_file(value, read):
    with pytest.raises(ValueError, match="has no unit; write for example"):
        read(value, IN_FILE, LENGTH)


@pytest.mark.parametrize("text", ["1 foo", "1 2 mm", "1 mm)", "1_000 mm", "1 __import__('os')"])
def test_unknown_unit_is_refused(text):
    with pytest.raises(ValueError, match="is not known; write for example '1 mm'"):
        to_si(text, IN_FILE, LENGTH)


@pytest.mark.parametrize("text", ["1,5 mm", " -1,5mm", "1,5"])
def test_decimal_comma_is_named(text):
    with pytest.raises(ValueError, match=r"decimal sign is a point, not a comma: write -?1\.5"):
        to_si(text, IN_FILE, LENGTH)
    with pytest.raises(ValueError, match="decimal sign is a point"):
        units.split(text)


@pytest.mark.parametrize(
    "text", ["nan mm", "inf mm", "-inf mm", "1e400 mm", "-1e400 mm", "1e308 Gm"]
)
def test_not_finite_text_is_refused(text):
    with pytest.raises(ValueError, match="not a"):
        to_si(text, IN_FILE, LENGTH)


@pytest.mark.parametrize(
    "text",
    [
        "(1, nan) mm",
        "(inf, 1) mm",
        "(1, 1e400) mm",
        "(1,, 2) mm",
        "(1 mm, 2 mm)",
        "() mm",
        "1 mm",
        "[1, 2] mm",
    ],
)
def test_bad_vector_is_refused(text):
    with pytest.raises(ValueError, match="not a"):
        to_si_vector(text, IN_FILE, LENGTH)


@pytest.mark.parametrize(
    "value",
    [math.nan, math.inf, 10**400, True, None, [], {}, "", "mm", "long"],
    ids=lambda v: repr(v)[:9],
)
def test_value_that_is_not_a_finite_number_is_refused_in_code_too(value):
    with pytest.raises(ValueError, match="number"):
        to_si(value, IN_CODE, LENGTH)


def test_plain_numbers_are_si_in_code():
    assert to_si(3, IN_CODE, LENGTH) == 3.0
    assert to_si_vector([1, 2.0], IN_CODE, LENGTH) == (1.0, 2.0)


def test_shown_value():
    assert STIFFNESS.from_si(3200.0) == pytest.approx(3.2)
    assert STIFFNESS.text(3200.0) == "3.2 N/mm"
    assert LENGTH.text((0.001, -0.0025)) == "(1, -2.5) mm"


@given(
    unit=st.sampled_from(ALL_UNITS),
    value=st.floats(-1e9, 1e9).filter(lambda x: x == 0.0 or abs(x) > 1e-12),
)
def test_text_is_read_back_as_exactly_the_same_number(unit, value):
    assert to_si(unit.text(value), IN_FILE, unit) == value


@given(
    values=st.lists(
        st.floats(-1e3, 1e3).filter(lambda x: x == 0.0 or abs(x) > 1e-12), min_size=1, max_size=4
    ).map(tuple)
)
def test_text_of_a_vector_is_read_back_as_the_very_same_numbers(values):
    unit = Unit("rad/s", "rpm")
    assert to_si_vector(unit.text(values), IN_FILE, unit) == values
