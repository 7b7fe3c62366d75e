"""Force elements: which numbers are allowed, and the packed form of tables."""

import pytest
from pydantic import TypeAdapter, ValidationError
from ruamel.yaml import YAML

from wm_drake.elements.layouts import packed_stiffness, packed_stiffnesses
from wm_drake.parameters import (
    Bushing,
    DamperType,
    EndBushing,
    ForceTable,
    MstvDamper,
    SpringType,
    TorqueTable,
)

X, Y = (-0.02, -0.005, 0.0, 0.01, 0.03), (-90.0, -20.0, 0.0, 0.0, 150.0)

DAMPERS = {
    "coulomb": "{law: coulomb, friction_force: 20 N, damping: 0.01 N s/mm}",
    "stv": "{law: stv, friction_force: 20 N, transition_velocity: 2 mm/s}",
    "havsin": "{law: havsin, friction_force: 20 N, full_friction_velocity: 2 mm/s, end_bushing: {stiffness: 750 N mm/rad}}",
    "mstv": "{law: mstv, friction_force: 20 N, sponge_stiffness: 176 N/mm, sponge_damping: 0.09 N s/mm, slider_damping: 0.4 N s/mm}",
    "stv_sponge": "{law: stv_sponge, friction_force: 20 N, sponge_stiffness: 176 N/mm, sponge_damping: 0.09 N s/mm}",
    "free_stroke": """{law: free_stroke, friction_force: 80 N, friction_damping: 0.1 N s/mm, basic_friction_force: 5 N,
        basic_full_friction_velocity: 2 mm/s, sponge: {displacement: '(-9, -5, 5, 9) mm', force: '(-200, 0, 0, 200) N'}}""",
}


def in_file(kind, text):
    return TypeAdapter(kind).validate_python(
        YAML(typ="safe").load(text), context={"units_required": True}
    )


@pytest.mark.parametrize(
    ("x", "y", "message"),
    [
        ((0.0, 1.0, 2.0), (0.0, 1.0), "as many values of displacement as of force, at least two; has 3 and 2"),
        ((0.0,), (0.0,), "at least two; has 1 and 1"),
        ((0.0, 1.0, 1.0), (0.0, 1.0, 2.0), "displacement must rise"),
        ((0.0, 2.0, 1.0), (0.0, 1.0, 2.0), "displacement must rise"),
        ((0.0, 1.0, 2.0), (0.0, 1.0, 0.5), "force must not fall"),
        ((0.0, 1.0), (0.0, float("nan")), "not a finite number"),
    ],
)  # fmt: skip
def test_bad_table_is_refused(x, y, message):
    with pytest.raises(ValidationError, match=message):
        ForceTable(displacement=x, force=y)


def test_bad_torque_table_is_refused():
    with pytest.raises(ValidationError, match="torque must not fall"):
        TorqueTable(angle=(0.0, 1.0), torque=(1.0, 0.0))


def test_table_from_a_file():
    table = in_file(
        SpringType, "stiffness: {displacement: '(-1, 0, 2) mm', force: '(-8, 0, 16) N'}"
    ).stiffness
    assert table == ForceTable(displacement=(-0.001, 0.0, 0.002), force=(-8.0, 0.0, 16.0))


@pytest.mark.parametrize("law", DAMPERS)
def test_every_damper_law_is_read_from_a_mapping(law):
    damper = in_file(DamperType, DAMPERS[law])
    assert damper.law == law
    assert damper.friction_force in (20.0, 80.0)
    assert damper.end_bushing == EndBushing(stiffness=0.75 if law == "havsin" else 0.0)


@pytest.mark.parametrize(
    "name", ["friction_force", "sponge_stiffness", "sponge_damping", "slider_damping"]
)
def test_required_number_of_a_damper_is_missed(name):
    mapping = YAML(typ="safe").load(DAMPERS["mstv"])
    del mapping[name]
    with pytest.raises(ValidationError, match=name):
        TypeAdapter(DamperType).validate_python(mapping)


def test_mstv_damper_needs_some_damping():
    numbers = {
        "law": "mstv",
        "friction_force": 20.0,
        "sponge_stiffness": 1e5,
        "sponge_damping": 0.0,
        "slider_damping": 0.0,
    }
    with pytest.raises(ValidationError, match="a massless slider needs one"):
        MstvDamper(**numbers)
    assert MstvDamper(**numbers | {"friction_damping": 1.0}).friction_damping == 1.0


@pytest.mark.parametrize(
    ("law", "wrong"),
    [
        ("coulomb", {"friction_force": -1.0}),
        ("coulomb", {"damping": -1.0}),
        ("stv", {"transition_velocity": 0.0}),
        ("havsin", {"full_friction_velocity": 0.0}),
        ("mstv", {"sponge_stiffness": -1.0}),
        ("mstv", {"regularisation_velocity": 0.0}),
        ("free_stroke", {"friction_damping": 0.0}),
        ("free_stroke", {"basic_friction_force": -1.0}),
        ("mstv", {"end_bushing": {"full_friction_rate": 0.0}}),
        ("mstv", {"end_bushing": {"stiffness": -1.0}}),
        ("coulomb", {"transition_velocity": 1.0}),  # belongs to another law
        ("coulomb", {"law": "viscous"}),
    ],
)
def test_number_out_of_range_is_refused(law, wrong):
    mapping = YAML(typ="safe").load(DAMPERS[law]) | wrong
    with pytest.raises(ValidationError) as refused:
        TypeAdapter(DamperType).validate_python(mapping)
    assert refused.value.error_count() == 1


def test_negative_stiffness_is_refused():
    with pytest.raises(ValidationError, match="greater than or equal to 0"):
        SpringType(stiffness=-1.0)
    with pytest.raises(ValidationError, match="greater than or equal to 0"):
        in_file(SpringType, "stiffness: -1 N/mm")


def test_bushing_takes_numbers_and_tables(reference):
    mapping = reference.gasket.model_dump() | {
        "stiffness_y": {"displacement": X, "force": Y},
        "rotational_stiffness_x": 5.0,
    }
    bushing = Bushing(**mapping)
    assert bushing.stiffness_y == ForceTable(displacement=X, force=Y)
    assert bushing.rotational_stiffness_x == 5.0
    with pytest.raises(ValidationError, match="rotational_stiffness_x"):
        Bushing(**mapping | {"rotational_stiffness_x": -5.0})


def test_elements_are_frozen(reference):
    with pytest.raises(ValidationError, match="frozen"):
        reference.gasket.stiffness_x = 1.0


def test_tables_packed_together_are_those_packed_alone():
    stiffnesses = [
        ForceTable(displacement=X, force=Y),
        300.0,
        TorqueTable(angle=(-1.0, 1.0), torque=(-2.0, 3.0)),
        ForceTable(displacement=X, force=tuple(1.7 * y for y in Y)),
    ]
    together = packed_stiffnesses(stiffnesses)
    for stiffness, packed in zip(stiffnesses, together, strict=True):
        assert packed.tolist() == packed_stiffness(stiffness).tolist()
