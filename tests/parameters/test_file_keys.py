"""Keys of a machine file: each has a meaning, and the schema takes files and refuses typing errors."""

import json

import jsonschema
import pytest
from documents import CHECKOUT, HOW_TO, blocks, name_of
from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML

from wm_drake.parameters import MachineParameters, load_machine, quantities
from wm_drake.parameters.file_keys import file_schema, key_groups, meanings_of
from wm_drake.parameters.files import machine_tree

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


@pytest.mark.parametrize("indentation", ["    ", ""], ids=["up to Python 3.12", "from 3.13 on"])
def test_meanings_are_read_with_and_without_the_indentation_of_a_docstring(indentation):
    docstring = f"""A spring.

{indentation}Attributes:
{indentation}    stiffness, preload: Force by elongation,
{indentation}        and at rest. [N/m]
{indentation}    length:
{indentation}        Unloaded.

{indentation}Drawn in [B].
"""
    spring = type("Spring", (BaseModel,), {"__doc__": docstring})
    both = "Force by elongation, and at rest."
    expected = {"stiffness": both, "preload": both, "length": "Unloaded."}
    assert meanings_of(spring) == meanings_of(BaseModel) | expected


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


GROUPS_OF_MACHINES = (
    "gasket", "loads.middle.unbalances.0", "spring_types.suspension", "springs.left", "profile",
    "sensors.Xr", "clearance", "drive",
)  # fmt: skip
FAULTS = {
    "no unit": lambda text: text.partition(" ")[0] if text[0] != "(" else f"{text.split(')')[0]})",
    "number of YAML": lambda text: 1.5,
    "words": lambda text: "a lot",
    "empty text": lambda text: "",
    "decimal comma": lambda text: f"1,5 {text.split()[-1]}",
    "list of YAML": lambda text: [1.0, 2.0],
    "unknown group": lambda text: {"amount": text},
}
"""Values of a number that no file may have, by what is wrong with them."""


def changed(tree, key, value):
    """Return a tree with one value replaced, and the groups that lead to it copied."""
    part, _, rest = key.partition(".")
    copy = list(tree) if isinstance(tree, list) else dict(tree)
    place = int(part) if isinstance(tree, list) else part
    copy[place] = changed(tree[place], rest, value) if rest else value
    return copy


def is_refused(tree):
    """Return whether the loader refuses the tree of a file without sources."""
    try:
        MachineParameters.model_validate(tree, context={"units_required": True})
    except ValidationError:
        return True
    return False


def tree_of(name):
    return machine_tree(load_machine(name).model_copy(update={"sources": {}}))


@pytest.fixture(scope="module")
def numbers(validator):
    """Return the tree and the numbers of each of three machines, each key with its first machine."""
    found, known = [], set()
    for name in ("reference", "free_stroke", "heavy_cabinet"):
        tree = tree_of(name)
        assert not is_refused(tree)
        assert validator.is_valid(tree)
        listed = [key for key, _, unit in quantities(load_machine(name)) if unit.si]
        keys = [key for key in listed if isinstance(value_in(tree, key), str)]
        found.append((tree, [key for key in keys if key not in known]))
        known |= set(keys)
    assert min(len(keys) for _, keys in found) > 5
    return found


@pytest.mark.parametrize("fault", FAULTS)
def test_a_number_that_the_loader_refuses_does_not_fit_the_schema(fault, numbers, validator):
    for tree, keys in numbers:
        for index, key in enumerate(keys):
            faulty = changed(tree, key, FAULTS[fault](value_in(tree, key)))
            section = key.split(".")[0]
            assert index % 5 or is_refused(faulty), key  # it takes 0.1 s
            assert not validator.is_valid({section: faulty[section]}), key


def value_in(tree, key):
    for part in key.split("."):
        tree = tree[int(part)] if isinstance(tree, list) else tree.get(part)
        if tree is None:
            return None
    return tree


@pytest.mark.parametrize("group", GROUPS_OF_MACHINES)
@pytest.mark.parametrize("value", ["text", 7, ["a"], {"misspelt": "1 mm"}])
def test_a_group_that_the_loader_refuses_does_not_fit_the_schema(group, value, validator):
    faulty = changed(tree_of("motor"), group, value)
    assert is_refused(faulty)
    assert not validator.is_valid(faulty)


@pytest.mark.parametrize("name", ["two words", "1st", "a" * 65, "dot.ted"])
@pytest.mark.parametrize("table", ["springs", "loads", "sensors", "bodies"])
def test_a_name_that_the_loader_refuses_does_not_fit_the_schema(table, name, validator):
    tree = tree_of("reference")
    faulty = tree | {table: {**tree.get(table, {}), name: {}}}
    assert is_refused(faulty)
    assert not validator.is_valid(faulty)


def test_null_removes_and_sources_are_allowed(validator):
    file = {
        "extends": "reference",
        "gasket": None,
        "dampers": {"left": None},
        "springs": {"left": {"preload": {"value": "40 N", "source": "measured"}, "source": "x"}},
    }
    assert list(validator.iter_errors(file)) == []
