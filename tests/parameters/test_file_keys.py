"""Keys of a machine file: each has a meaning, and the schema takes files and refuses typing errors."""

import json

import jsonschema
import pytest
from documents import CHECKOUT, HOW_TO, blocks, name_of
from ruamel.yaml import YAML

from wm_drake.parameters.file_keys import file_schema, key_groups

MACHINES = sorted((CHECKOUT / "wm_drake" / "data" / "machines").glob("*.yaml"))
GROUPS = {group.title: group for group in key_groups()}


@pytest.fixture(scope="module")
def validator():
    schema = file_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def read(text):
    return json.loads(json.dumps(YAML(typ="safe").load(text), default=str))


def test_each_key_and_each_group_say_what_they_are():
    silent = [
        f"{group.title}: {key.name}"
        for group in GROUPS.values()
        for key in group.keys
        if not (key.meaning.endswith(".") or key.meaning.endswith("]"))
    ]
    assert silent == []
    assert all(group.about.endswith(".") for group in GROUPS.values())


def test_unit_range_default_and_place_are_those_of_the_type():
    keys = {key.name: key for key in GROUPS["Damper with the law mstv"].keys}
    assert keys["friction_force"].form == "number in N"
    assert keys["friction_force"].allowed == ">= 0 N"
    assert keys["friction_force"].is_required
    assert keys["regularisation_velocity"].default == "0.001 mm/s"
    assert keys["law"].allowed == "mstv"
    assert GROUPS["Bushing"].places == ("gasket", "bushings.NAME")
    assert GROUPS["Bushing"].also == "Bushing type"
    assert {key.name: key for key in GROUPS["Cabinet"].keys}["friction"].form == "number"


@pytest.mark.parametrize("path", MACHINES, ids=name_of)
def test_shipped_machine_files_fit_the_schema(path, validator):
    assert list(validator.iter_errors(read(path.read_text(encoding="utf-8")))) == []


def test_machine_files_of_the_how_to_pages_fit_the_schema(validator):
    found = [text for path in HOW_TO for text in blocks(path, "yaml") if text.startswith("name:")]
    assert len(found) > 1
    for text in found:
        validator.validate(read(text))


@pytest.mark.parametrize(
    "fault",
    [
        {"nam": "mine"},
        {"gasket": {"stifness_x": "5 N/mm"}},
        {"gasket": {"stiffness_x": 5}},
        {"integrator": "euler"},
        {"sensors": {"Xr": {"frame": "a", "axis": "w"}}},
        {"loads": {"towel": {"unbalances": {"mass": "1 kg"}}}},
    ],
)
def test_a_planted_fault_does_not_fit_the_schema(fault, validator):
    assert not validator.is_valid({"extends": "reference", **fault})


def test_null_removes_and_sources_are_allowed(validator):
    file = {
        "extends": "reference",
        "gasket": None,
        "dampers": {"left": None},
        "springs": {"left": {"preload": {"value": "40 N", "source": "measured"}, "source": "x"}},
    }
    assert list(validator.iter_errors(file)) == []
