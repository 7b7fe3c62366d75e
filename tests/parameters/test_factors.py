"""Factors: the numbers they change, their levels, and errors."""

import numpy as np
import pytest

from wm_drake.elements.layouts import packed_stiffness
from wm_drake.errors import InputError
from wm_drake.laws.table import stiffness_force
from wm_drake.parameters import (
    GASKET_FACTORS,
    Factor,
    ForceTable,
    at_levels,
    factor_of_text,
    levels_of,
    load_factors,
    quantities,
    with_value,
)
from wm_drake.parameters.rubber import RubberBranches

KNOWN = load_factors(GASKET_FACTORS)
STIFFNESSES = [f"{kind}stiffness_{axis}" for kind in ("", "rotational_") for axis in "xyz"]
HARDENING = ForceTable(
    displacement=(-0.03, -0.01, 0.0, 0.01, 0.03), force=(-150.0, -40.0, 0.0, 40.0, 150.0)
)


@pytest.fixture
def plain(reference):
    """Return the reference machine with plain numbers for the stiffnesses of its gasket."""
    for index, name in enumerate(STIFFNESSES):
        reference = with_value(reference, f"gasket.{name}", 3000.0 + 100.0 * index)
    return reference


def one(parameters, text, tables="linear"):
    return levels_of(parameters, dict([factor_of_text(text, KNOWN)]), tables)


def test_gasket_factors_move_every_stiffness_and_damping_once(plain):
    levels = levels_of(plain, KNOWN)
    assert [factor.name for factor in levels] == [
        "C_L", "C_T", "K_Lx", "K_Ly", "K_Lz", "K_Tx", "K_Ty", "K_Tz",
    ]  # fmt: skip
    moved = [key for factor in levels for key in factor.settings[0]]
    expected = [
        key
        for key, _, _ in quantities(plain)
        if key.startswith("gasket.")
        and ("stiffness" in key or "damping" in key)
        and key.removeprefix("gasket.") not in RubberBranches.model_fields  # they are 0 in the file
    ]
    assert sorted(moved) == sorted(expected)
    for factor in levels:
        for key in factor.settings[0]:
            nominal = getattr(plain.gasket, key.removeprefix("gasket."))
            assert [setting[key] for setting in factor.settings] == pytest.approx(
                [0.5 * nominal, nominal, 1.5 * nominal]
            )


def test_levels_are_set_and_nothing_else(plain):
    levels = levels_of(plain, KNOWN)
    same = at_levels(plain, levels, [0] * 8)
    assert same == plain
    changed = at_levels(plain, levels, [1, 0, 0, -1, 0, 0, 0, 0])
    assert changed.gasket.damping_z == pytest.approx(1.5 * plain.gasket.damping_z)
    assert changed.gasket.stiffness_y == pytest.approx(0.5 * plain.gasket.stiffness_y)
    back = changed
    for key in ("damping_x", "damping_y", "damping_z", "stiffness_y"):
        back = with_value(back, f"gasket.{key}", getattr(plain.gasket, key))
    assert back == plain


@pytest.mark.parametrize(
    ("text", "key", "expected"),
    [
        ("damper_types.friction.friction_force=20 N..30 N", "damper_types.friction.friction_force", [20.0, 25.0, 30.0]),
        ("loads.middle.unbalances.0.mass=90 %..120 %", "loads.middle.unbalances.0.mass", [0.9, 1.05, 1.2]),
        ("K_Lx=2 N/mm..4000 N/m", "gasket.stiffness_x", [2000.0, 3000.0, 4000.0]),
        ("bodies.tub.mass=9 kg..11 kg", "bodies.tub.mass", [9.0, 10.0, 11.0]),
        ("gravity", "gravity", [4.905, 9.81, 14.715]),
    ],
)  # fmt: skip
def test_any_number_can_be_a_factor(reference, text, key, expected):
    (factor,) = one(reference, text)
    assert [setting[key] for setting in factor.settings] == pytest.approx(expected)
    at_levels(reference, [factor], [1])


def test_nominal_stiffness_is_the_slope_of_the_first_fifth():
    line = ForceTable(displacement=(-0.02, 0.0, 0.02), force=(-60.0, 0.0, 60.0))
    assert line.nominal_stiffness == pytest.approx(3000.0)
    x = np.linspace(-0.006, 0.006, 4001)
    forces = [stiffness_force(float(point), packed_stiffness(HARDENING), 0) for point in x]
    assert HARDENING.nominal_stiffness == pytest.approx(float(x @ forces / (x @ x)), rel=1e-3)


def test_tables_become_numbers_or_are_scaled(reference):
    parameters = with_value(reference, "gasket.stiffness_x", HARDENING)
    nominal = HARDENING.nominal_stiffness
    (linear,), (scaled,) = one(parameters, "K_Lx"), one(parameters, "K_Lx", "scaled")
    assert [setting["gasket.stiffness_x"] for setting in linear.settings] == pytest.approx(
        [0.5 * nominal, nominal, 1.5 * nominal]
    )
    low, middle, high = (setting["gasket.stiffness_x"] for setting in scaled.settings)
    assert middle.force == pytest.approx(HARDENING.force)
    assert low.force == pytest.approx([0.5 * force for force in HARDENING.force])
    assert high.displacement == HARDENING.displacement
    (absolute,) = one(parameters, "K_Lx=2 N/mm..6 N/mm", "scaled")
    assert absolute.settings[0]["gasket.stiffness_x"].nominal_stiffness == pytest.approx(2000.0)
    assert "gasket.stiffness_x" in scaled.nominal
    with pytest.raises(InputError, match=r"stiffness_x: '-.*' is out of range"):
        one(parameters, "K_Lx=-10 %..50 %", "scaled")


def test_curve_that_cannot_be_a_number_is_scaled(reference):
    sponge = {
        "displacement": (-0.02, -0.01, -0.004, 0.004, 0.01, 0.02),
        "force": (-120.0, -40.0, 0.0, 0.0, 40.0, 120.0),
    }
    damper = {
        "law": "free_stroke",
        "friction_force": 25.0,
        "friction_damping": 60.0,
        "basic_friction_force": 5.0,
    }
    damper |= {"basic_full_friction_velocity": 0.09, "sponge": sponge}
    tree = reference.model_dump() | {"damper_types": {"friction": damper}}
    parameters = type(reference).model_validate(tree)
    (factor,) = one(parameters, "damper_types.friction.sponge")
    assert factor.settings[2]["damper_types.friction.sponge"].force == pytest.approx(
        [1.5 * force for force in sponge["force"]]
    )


FAULTS = {
    "falling": ("K_Lx=150 %..50 %", "do not rise"),
    "zero": ("gasket.friction_torque_x", "do not rise (the value is 0)"),
    "unit": ("K_Lx=1 N..2 N", "unit 'N' does not fit"),
    "form": ("K_Lx=1 N/mm", "is not of the form NAME=LOW..HIGH"),
    "range": ("K_Lx=-50 %..50 %", "out of range"),
    "percent of the SDF's": ("bodies.tub.mass", "is in the SDF"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_refused_in_one_line(plain, fault):
    text, message = FAULTS[fault]
    with pytest.raises(InputError) as caught:
        one(plain, text)
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_two_factors_may_not_move_one_number(reference):
    with pytest.raises(InputError, match="belongs to factor C_L already"):
        levels_of(reference, KNOWN | {"other": Factor(keys=("gasket.damping_x",))})


def test_machine_without_gasket_is_refused(reference):
    tree = reference.model_dump() | {"gasket": None}
    with pytest.raises(InputError, match="the machine has no gasket"):
        levels_of(type(reference).model_validate(tree), KNOWN)


def test_faulty_factor_file_is_refused(tmp_path):
    path = tmp_path / "factors.yaml"
    path.write_text("soft: {keys: [gasket.stiffness_x], lo: 50 %}\nempty: {keys: []}\n")
    with pytest.raises(InputError) as caught:
        load_factors(path)
    assert "soft" in str(caught.value)
    assert "unknown key 'lo' (did you mean 'low'?" in str(caught.value)
    assert "empty" in str(caught.value)
