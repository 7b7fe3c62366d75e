"""`wm-drake gasket curves`: from a drawing to a machine that spins with it; wrong drawings."""

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import wm_drake as wm
from wm_drake.parameters import load_machine
from wm_drake.parameters.gasket_drawing import load_gasket_drawing, tension_stress
from wm_drake.solid import curves as solid_curves
from wm_drake.solid.rubber import energy

SMALL = ("--quick", "--points", "2", "--twist", "2 deg", "--tilt", "1 deg")


def drawing(**changes):
    """Return the text of a straight tube of rubber with changed numbers."""
    numbers = {"thickness": "2.5 mm", "rubber": "{shore_a: 40, loss_factor: 0.15}"} | changes
    points = numbers.get(
        "points", "- {radius: 160 mm, y: 0 mm, T}\n- {radius: 170 mm, y: 50 mm, T}\n"
    )
    meridian = points.replace("T}", f"thickness: {numbers['thickness']}}}")
    return f"about: test\nmeridian:\n{meridian}rubber: {numbers['rubber']}\n"


@pytest.mark.slow
def test_the_shipped_machine_has_the_curves_of_its_drawing(wm_drake):
    sizes = ("--points", "2", "--twist", "2.5 deg", "--tilt", "0.75 deg")
    ended = wm_drake(
        "gasket",
        "curves",
        "folded",
        *sizes,
        "--axial",
        "2.25 mm",
        "--radial",
        "3 mm",
        "--out",
        "out",
    )
    assert ended.code == 0, ended.err
    found, shipped = (load_machine(m).gasket for m in ("out/machine.yaml", "reference_folded"))
    for axis in "xyz":
        for kind in ("stiffness", "rotational_stiffness"):
            table, whole = (getattr(gasket, f"{kind}_{axis}") for gasket in (found, shipped))
            x, y = map(np.array, table.curve)
            np.testing.assert_allclose(y, whole.values(x), rtol=2e-3, atol=2e-3 * max(y))
    assert found.cross_stiffness_x_about_z == pytest.approx(
        shipped.cross_stiffness_x_about_z, rel=1e-3
    )


@pytest.mark.slow
def test_curves_of_a_drawing_give_a_machine_that_spins(wm_drake):
    ended = wm_drake("gasket", "curves", "folded", *SMALL, "--out", "out")
    assert ended.code == 0, ended.err
    assert {path.name for path in Path("out").iterdir()} == {
        "checks.csv", "curves.csv", "gasket.yaml", "machine.yaml", "numbers.csv", "report.html",
        "rotational_checks.csv", "rotational_curves.csv", "rotational_values.csv", "run.json",
        "values.csv",
    }  # fmt: skip
    gasket = load_machine("out/machine.yaml").gasket
    values, rotational = (
        pd.read_csv(f"out/{kind}values.csv", index_col=0) for kind in ("", "rotational_")
    )
    damping = 0.15 / (2.0 * math.pi * 2.5)
    for axis in "xyz":
        along = 1e3 * values.stiffness_first_20_percent_N_per_mm[axis]
        about = rotational.stiffness_first_20_percent_Nm_per_rad[f"about_{axis}"]
        for kind, stiffness in (("", along), ("rotational_", about)):
            table = getattr(gasket, f"{kind}stiffness_{axis}")
            assert table.nominal_stiffness == pytest.approx(stiffness, rel=1e-5)
            assert getattr(gasket, f"{kind}damping_{axis}") == pytest.approx(
                damping * table.nominal_stiffness, rel=1e-9
            )
    at_rest = values.stiffness_at_rest_N_per_mm
    assert at_rest["y"] < 0.3 * at_rest["x"]
    at_rest = rotational.stiffness_at_rest_Nm_per_rad
    assert at_rest["about_y"] > at_rest["about_x"]
    assert gasket.cross_stiffness_x_about_z == -gasket.cross_stiffness_z_about_x > 0.0
    assert gasket.tub_frame == load_machine("reference").gasket.tub_frame
    # the section in a machine file of the user's
    section = Path("out/gasket.yaml").read_text()
    Path("mine.yaml").write_text(f"extends: reference\nname: mine\n{section}")
    for axis in "xyz":
        name = f"stiffness_{axis}"
        assert getattr(load_machine("mine.yaml").gasket, name) == getattr(gasket, name)
    Path("short.csv").write_text("time_s,speed_rpm\n0,30\n6,120\n")
    spin = wm_drake("spin --machine mine.yaml --load middle --profile short.csv --out spin")
    assert spin.code in (0, 1), spin.err


@pytest.mark.slow
def test_python_and_json_give_the_same(wm_drake):
    result = wm.run_study("curves", file="bellows", quick=True, points=2, tilt="1 deg", quiet=True)
    printed = json.loads(
        wm_drake("gasket curves bellows --quick --points 2 --tilt '1 deg' --json --out o").out
    )
    name = "stiffness_at_rest_N_per_mm"
    for ours, theirs in zip(result.as_json()["values"], printed["values"], strict=True):
        assert ours["axis"] == theirs["axis"]
        assert ours[name] == pytest.approx(theirs[name], rel=1e-9)
    checks = [*printed["checks"], *printed["rotational_checks"]]
    assert max(row["work_error_percent"] for row in checks) < 1.0
    by_axis = {row["axis"]: row[name] for row in printed["values"]}
    assert by_axis["x"] == by_axis["z"]


def test_constants_are_fitted_to_a_tension_test(wm_drake):
    planted = (0.3e6, -0.01e6, 0.002e6)
    stretch = [0.8, 1.0, 1.2, 1.6, 2.0, 2.4, 2.8]
    stress = 1e-6 * tension_stress(np.array(stretch), planted)
    listed = ", ".join(f"{value!r}" for value in stress.tolist())
    rubber = f"{{test: {{stretch: {stretch}, stress: '({listed}) MPa'}}}}"
    Path("mine.yaml").write_text(drawing(rubber=rubber))
    fitted = load_gasket_drawing("mine.yaml").rubber
    np.testing.assert_allclose(fitted.constants, planted, rtol=1e-9)
    assert fitted.test.deviation < 1e-12
    ended = wm_drake("gasket", "curves", "mine.yaml", *SMALL, "--out", "out")
    assert ended.code == 0, ended.err


def test_stress_in_tension_is_the_slope_of_the_energy():
    constants, stretch, step = np.array([0.3e6, -0.01e6, 0.002e6]), 1.7, 1e-5

    def energy_at(length):
        across = length**-0.5
        return energy(np.diag([length, across, across]), constants)

    slope = (energy_at(stretch + step) - energy_at(stretch - step)) / (2.0 * step)
    assert tension_stress(np.array([stretch]), constants)[0] == pytest.approx(slope, rel=1e-8)


CROSSING = (
    "- {radius: 160 mm, y: 0 mm, T}\n- {radius: 160 mm, y: 40 mm, T, fillet: 4 mm}\n"
    "- {radius: 180 mm, y: 40 mm, T, fillet: 4 mm}\n- {radius: 180 mm, y: 20 mm, T, fillet: 4 mm}\n"
    "- {radius: 140 mm, y: 20 mm, T}\n"
).replace("T, fillet: 4 mm}", "fillet: 4 mm, T}")
THIN = (
    "- {radius: 160 mm, y: 0 mm, thickness: 0 mm}\n- {radius: 170 mm, y: 50 mm, thickness: 2 mm}\n"
)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"points": CROSSING}, "meridian: the wall crosses itself, at radius and y"),
        ({"points": THIN}, "meridian.0.thickness: '0 mm' is out of range; allowed is > 0"),
        ({"rubber": "{c1: -0.3 MPa}"}, "rubber.c1: '-0.3 MPa' is out of range; allowed is > 0"),
        ({"rubber": "{c1: 0.3 MPa, c2: -0.1 MPa}"}, "the rubber is unstable: its force falls"),
        ({"rubber": "{shore_a: 40, c1: 0.3 MPa}"}, "needs either shore_a or c1"),
        ({"rubber": "{shore_a: 40 mm}"}, "shore_a"),
        (
            {"rubber": "{test: {stretch: [1, 1.5, 2], stress: '(0, 0.4) MPa'}}"},
            "needs as many stretches as stresses; has 3 and 2",
        ),
        (
            {"rubber": "{test: {stretch: [1, 1.5, 2], stress: '(0, 0.4, 0.6) MPa', terms: 3}}"},
            "has 2 stretches beside 1; 3 constants need at least 4",
        ),
        (
            {"rubber": "{test: {stretch: [1.2, 1.5, 2], stress: '(-1, -2, -3) MPa', terms: 1}}"},
            "of the test, no number of constants is stable",
        ),
        (
            {"points": "- {radius: 1 mm, y: 0 mm, T}\n- {radius: 1 mm, y: 9 mm, T}\n"},
            "reaches the axis",
        ),
    ],
)
def test_a_wrong_drawing_is_one_message(wm_drake, changes, message):
    Path("mine.yaml").write_text(drawing(**changes))
    ended = wm_drake("gasket curves mine.yaml --out out")
    assert (ended.code, ended.out, len(ended.messages)) == (2, "", 1)
    assert "mine.yaml" in ended.err
    assert message in ended.err
    assert not Path("out").exists()


def test_a_load_step_without_equilibrium_keeps_what_was_computed(wm_drake, monkeypatch):
    solve = solid_curves.Solver.solve

    def at_most_a_millimetre(self, rim, start):
        if abs(rim[:, 0]).max() > 3e-3:
            raise solid_curves.NoEquilibriumError
        return solve(self, rim, start)

    Path("tube.yaml").write_text(drawing())
    monkeypatch.setattr(solid_curves.Solver, "solve", at_most_a_millimetre)
    words = "gasket curves tube.yaml --quick --axial '1 mm' --twist '.5 deg' --tilt '.5 deg'"
    ended = wm_drake(f"{words} --out out")
    assert ended.code == 1
    assert "radial: no equilibrium was found beyond 2.99 mm; the curve ends there" in ended.err
    curves = pd.read_csv("out/curves.csv").groupby("curve").displacement_mm.max()
    assert curves["radial"] == 2.0
    assert curves["axial"] == 1.0
    assert load_machine("out/machine.yaml").gasket.stiffness_x.displacement[-1] == 2e-3
