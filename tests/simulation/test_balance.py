"""Unbalance of load and balls in planes: closed forms, and runs of the machine with two rings."""

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.parameters import Load, MachineParameters, SpinProfile, load_machine
from wm_drake.simulation.balance import balance_of, in_planes, moments_of_load
from wm_drake.studies.spin.page import spin_answer
from wm_drake.studies.spin.study import run_spin

FULL = 1200.0 * np.pi / 30.0


@pytest.fixture(scope="module")
def result():
    """Return spin runs at a constant speed from the start, for all loads of the machine."""
    parameters = load_machine("ball_rings")
    profile = SpinProfile(time=(0.0, 6.0), speed=(FULL, FULL))
    cases = [wm.Case(name, load, profile) for name, load in parameters.loads.items()]
    return run_spin(parameters, cases)


def test_two_unbalances_have_the_moments_of_the_load():
    rng, planes = np.random.default_rng(0), np.array([-0.16, 0.2])
    static, with_y = rng.standard_normal((2, 5, 2))
    parts = in_planes(static, with_y, planes)
    np.testing.assert_allclose(parts.sum(axis=1), static)
    np.testing.assert_allclose(np.einsum("p,npk->nk", planes, parts), with_y)
    np.testing.assert_array_equal(in_planes(static, with_y, planes[:1])[:, 0], static)


def test_moments_of_a_load_of_all_kinds():
    load = {
        "unbalances": [{"mass": 0.5, "radius": 0.2, "y": 0.1, "phase": np.pi / 2.0}],
        "static": {"moment": 0.03, "y": -0.1},
        "couple": {"moment": 0.02, "phase": np.pi / 2.0},
    }
    case = wm.Case("", Load.model_validate(load), SpinProfile(time=(0.0, 1.0), speed=(1.0, 1.0)))
    static, with_y = moments_of_load(case, load_machine("reference"))
    np.testing.assert_allclose(static, [0.1, 0.03], atol=1e-15)
    np.testing.assert_allclose(with_y, [0.01 + 0.02, -0.003], atol=1e-15)


@pytest.mark.slow
def test_balls_take_the_place_of_closed_form_in_both_planes(result):
    """At full speed each ring is opposite to its share of the load, to 1 % of its capacity."""
    capacity = 8.0 * 0.064 * 0.225
    shares = {  # of the load in the planes at -160 and 160 mm, by the lever rule [kg m]
        "middle": (0.5 * 0.235 * 0.5, 0.5 * 0.235 * 0.5),
        "front": (0.35 * 0.235 * 270.0 / 320.0, 0.35 * 0.235 * 50.0 / 320.0),
        "back": (0.35 * 0.235 * 50.0 / 320.0, 0.35 * 0.235 * 270.0 / 320.0),
        "counter": (0.25 * 0.235 * 220.0 / 320.0, -0.25 * 0.235 * 220.0 / 320.0),
    }
    for case in result.results:
        balance = balance_of(case.case, result.parameters, case.record)
        expected = [[0.0, share] for share in shares[case.case.name]]
        np.testing.assert_allclose(balance.load, expected, atol=1e-12)
        moments = case.record.ball_ring_moment.values[-1][:, [0, 2]]
        np.testing.assert_allclose(moments, -balance.load, rtol=0, atol=0.01 * capacity)
        np.testing.assert_allclose(balance.remaining[-1], moments + balance.load, atol=1e-12)
        assert (balance.at_end < 0.01 * capacity).all()


@pytest.mark.slow
def test_tables_have_the_balance(result):
    tables = spin_answer(result).tables()
    balance = tables["balance"]
    assert list(balance.plane) == ["front_ring", "rear_ring"] * 4
    assert balance.load_alone_gm[0] == pytest.approx(58.75)
    assert balance.end_gm[0] < 1.2 < balance.largest_gm[0]
    balls = tables["balls"]
    assert {"time_s", "front_ring_ball_8_deg", "rear_ring_unbalance_gm"} <= set(balls)
    assert np.diff(balls.time_s[balls.load == "back"]) == pytest.approx(0.1)


def test_a_machine_without_rings_has_no_balance():
    parameters = load_machine("reference")
    profile = SpinProfile(time=(0.0, 1.0), speed=(0.0, 10.0))
    result = run_spin(parameters, [wm.Case("m", parameters.loads["middle"], profile)])
    assert not {"balance", "balls"} & set(spin_answer(result).tables())


@pytest.mark.slow
def test_one_ring_has_one_plane_and_leaves_the_couple():
    tree = load_machine("ball_rings").model_dump(exclude_unset=True)
    tree["elements"] = {"only": tree["elements"]["front_ring"] | {"balls": 1}}  # compiled once
    parameters = MachineParameters.model_validate(tree)
    profile = SpinProfile(time=(0.0, 4.0), speed=(FULL, FULL))
    case = wm.Case("counter", parameters.loads["counter"], profile)
    balance = balance_of(case, parameters, wm.simulate(wm.build_machine(parameters), case))
    assert balance.rings == ("only",)
    np.testing.assert_allclose(balance.load, 0.0, atol=1e-12)
    assert balance.size.shape[1:] == (1,)
    assert np.isnan(balance.balanced_from)  # nothing is smaller than none
