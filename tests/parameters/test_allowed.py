"""Allowed ranges, as the types of the machine file declare them."""

import math

import pytest
from pydantic import ValidationError

from wm_drake.errors import InputError
from wm_drake.parameters import quantities, with_value
from wm_drake.parameters.keys import AllowedRange, allowed_range


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("gasket.stiffness_x", AllowedRange(0.0, math.inf, low_is_in=True)),
        ("cabinet.mass", AllowedRange(0.0, math.inf)),
        ("cabinet.floor", AllowedRange()),
        ("loads.middle.unbalances.0.mass", AllowedRange(0.0, math.inf, low_is_in=True)),
        ("profile.time", AllowedRange()),
    ],
)
def test_range_is_that_of_the_field(reference, key, expected):
    assert allowed_range(reference, key) == expected


def test_declared_ends_are_those_that_validation_knows(reference):
    for key, value, _ in quantities(reference):
        if isinstance(value, tuple):
            continue
        allowed = allowed_range(reference, key)
        for end in (allowed.low, allowed.high):
            if math.isfinite(end) and not allowed.holds(end):
                with pytest.raises((InputError, ValidationError)):
                    with_value(reference, key, end)
        if math.isfinite(allowed.low):
            with pytest.raises((InputError, ValidationError)):
                with_value(reference, key, allowed.low - 1.0)
