"""`wm-drake rig gasket --static`: quasi-static tests of [B] section 3.1.1, also of a clamped gasket."""

import json

import numpy as np
import pandas as pd
import pytest

from wm_drake.elements.layouts import packed_stiffness
from wm_drake.laws.table import stiffness_force
from wm_drake.parameters import load_machine

AXIAL = "rig gasket --static --axis axial -a '20 mm' --json"
TILT = "rig gasket --static --axis tilt -a '5 deg'"


@pytest.mark.parametrize("preload", [0.0, 5.0])
def test_a_test_has_the_curve_about_the_place_where_it_is_clamped(wm_drake, preload):
    ended = wm_drake(AXIAL, "--preload", f"{preload} mm", "--rate", "100 mm/min", "--out", "test")
    (found,) = json.loads(ended.out)["measures"]
    gasket = load_machine("reference").gasket
    curve = packed_stiffness(gasket.stiffness_y)

    def force(x):
        return stiffness_force(1e-3 * x, curve, 0)

    damping = gasket.damping_y * 0.1 / 60.0
    assert found["hysteresis_N"] == pytest.approx(damping, rel=1e-3)
    assert found["offset_N"] == pytest.approx(force(preload), abs=0.01)
    near = np.linspace(-4.0, 4.0, 17)
    rise = np.array([force(preload + x) - force(preload) for x in near])
    slope = np.sum(near * rise) / np.sum(near**2)
    assert found["stiffness_N_per_mm"] == pytest.approx(slope, rel=0.01)
    samples = pd.read_csv("test/test.csv")
    there = samples.displacement_mm == 20.0
    assert samples.force_N[there].max() == pytest.approx(force(preload + 20.0) + damping, rel=1e-6)
    read = json.loads(wm_drake("identify gasket --static axial=test/test.csv --json").out)
    (again,) = read["measures"]
    assert again["stiffness_N_per_mm"] == pytest.approx(slope, rel=0.01)


def test_branches_of_rubber_begin_relaxed_where_the_gasket_is_clamped(wm_drake):
    friction = ("--set", "gasket.dahl_force_y=4 N", "--set", "gasket.dahl_displacement_y=0.5 mm")
    ended = wm_drake(AXIAL, "--preload", "5 mm", *friction, "--out", "test")
    (found,) = json.loads(ended.out)["measures"]
    assert found["hysteresis_N"] == pytest.approx(4.0, rel=0.02)
    first = pd.read_csv("test/test.csv").iloc[0]
    gasket = load_machine("reference").gasket
    assert first.force_N == pytest.approx(
        stiffness_force(5e-3, packed_stiffness(gasket.stiffness_y), 0)
    )


def test_rotations_have_a_rate_of_their_own(wm_drake):
    (found,) = json.loads(wm_drake(TILT, "--rate", "30 deg/min", "--json").out)[
        "rotational_measures"
    ]
    gasket = load_machine("reference").gasket
    moment = gasket.rotational_damping_x * np.deg2rad(0.5)
    assert found["hysteresis_Nm"] == pytest.approx(moment, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (TILT, "--rate: is needed"),
        ("rig gasket --static --axis axial", "--amplitude: is needed"),
        (f"{AXIAL} -f '1 Hz'", "--frequency: is of harmonic tests only"),
        (f"{AXIAL} --rate '0 mm/min'", "--rate: is 0 mm/min"),
        ("rig gasket --axis axial -f '1 Hz' -a '1 mm' --preload '1 mm'", "--preload: is of quasi"),
        (f"{TILT} --rate '1 deg/s' --arm '100 mm'", "--arm: is of harmonic tests only"),
    ],
)
def test_options_that_do_not_fit_are_refused(wm_drake, options, message):
    ended = wm_drake(options)
    assert ended.code == 2
    assert ended.err.startswith(message)
