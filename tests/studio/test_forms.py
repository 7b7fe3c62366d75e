"""Forms of studies come from their options models."""

import pytest

from wm_drake.errors import InputError
from wm_drake.studies.study import STUDIES
from wm_drake.studio.forms import arguments, forms

OFFERED = ["verdict", *(name for name, study in STUDIES.items() if study.group == "study")]


@pytest.mark.parametrize("name", OFFERED)
def test_each_study_has_a_form_without_paths(name):
    fields = {field["name"]: field for field in forms()[name]}
    assert {"machine", "sets", "out", "cluster", "figures"}.isdisjoint(fields)
    assert fields["quick"]["kind"] == "boolean"
    assert all(field["description"] for field in fields.values())
    options = STUDIES[name].options.model_fields
    for field in fields.values():
        if field["name"] in options and field["default"]:
            assert field["default"] == str(options[field["name"]].default)


def test_fields_become_arguments_of_the_command():
    given = {"load": "middle, counter", "trials": "27", "quick": "true", "design": "full"}
    words = ["--load=middle", "--load=counter", "--trials=27", "--quick", "--design=full"]
    assert arguments("gasket", given) == words
    assert arguments("tolerance", {"file": "heavy_laundry"}) == ["heavy_laundry"]
    assert arguments("response", {"low": "50 rpm", "no_sweeps": "true"}) == [
        "--from=50 rpm",
        "--no-sweeps",
    ]


def test_limits_of_the_options_hold_for_forms():
    with pytest.raises(InputError, match="torques"):
        arguments("drive", {"torques": "51"})
