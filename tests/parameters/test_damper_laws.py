"""The registry of damper laws: names agree everywhere, and wrong entries are refused."""

import re
from dataclasses import replace
from typing import Literal

import pytest
from pydantic import TypeAdapter, ValidationError

from wm_drake.parameters import DAMPER_LAWS, CoulombDamper, DamperType, FreeStrokeDamper
from wm_drake.parameters.damper_laws import DamperLaw, _registry

COULOMB = DAMPER_LAWS["coulomb"]


@pytest.mark.parametrize("name", DAMPER_LAWS)
def test_arguments_of_the_law_are_the_fields_of_the_class_in_their_order(name):
    law = DAMPER_LAWS[name]
    assert law.name == name
    first = ("rate", "deformation") if law.has_sponge else ("rate",)
    assert DamperLaw.arguments(law.response) == (*first, *law.fields)


@pytest.mark.parametrize("name", DAMPER_LAWS)
def test_law_and_class_cite_the_equations_of_the_entry(name):
    law = DAMPER_LAWS[name]
    cited = re.fullmatch(r"(\[\w+\]|own derivation)(?: (.+))?", law.equations)
    assert cited, f"{name}: write equations='[C] (4)' or 'own derivation', not '{law.equations}'"
    paper, numbers = cited[1], cited[2] or ""
    for text in (law.response.py_func.__doc__, law.parameters.__doc__):
        assert paper in text
        assert numbers.split(", ")[0] in text


def test_laws_with_a_curve_or_a_state():
    assert {name for name, law in DAMPER_LAWS.items() if law.curves} == {"free_stroke"}
    assert DAMPER_LAWS["free_stroke"].curves == ("sponge",)
    assert {name for name, law in DAMPER_LAWS.items() if law.has_sponge} == {
        "mstv",
        "stv_sponge",
        "free_stroke",
    }


def test_the_file_type_is_the_union_of_all_classes():
    with pytest.raises(ValidationError) as told:
        TypeAdapter(DamperType).validate_python({"law": "glue"})
    assert ", ".join(f"'{name}'" for name in DAMPER_LAWS) in str(told.value)


@pytest.mark.parametrize(
    ("change", "odd"),
    [
        ({"parameters": FreeStrokeDamper}, "basic_friction_force"),
        ({"response": DAMPER_LAWS["stv"].response}, "transition_velocity"),
        ({"unknowns": {"friction": "force"}}, "friction"),
    ],
)
def test_an_entry_whose_names_do_not_agree_is_refused(change, odd):
    with pytest.raises(ValueError, match=f"not in class and law: .*{odd}"):
        replace(COULOMB, **change)


def test_two_laws_of_one_number_or_name_are_refused():
    class GlueDamper(CoulombDamper):
        law: Literal["glue"]

    glue = replace(COULOMB, parameters=GlueDamper)
    with pytest.raises(ValueError, match="the same name or number"):
        _registry(COULOMB, glue)
    with pytest.raises(ValueError, match="the same name or number"):
        _registry(COULOMB, replace(COULOMB, number=9))
    assert set(_registry(COULOMB, replace(glue, number=9))) == {"coulomb", "glue"}
