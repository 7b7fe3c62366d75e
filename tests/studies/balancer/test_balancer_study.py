"""The study of rings of balls: closed forms of its parts, and what it finds in a small study."""

import numpy as np
import pytest
import xarray as xr

import wm_drake as wm
from wm_drake.errors import InputError
from wm_drake.parameters import Load, MachineParameters, SpinProfile, load_machine
from wm_drake.simulation.balance import moments_of_load, rings_of
from wm_drake.simulation.cases import Case
from wm_drake.studies.balancer.candidates import (
    BALLS,
    LIQUID,
    NONE,
    RESPONSES,
    WORDS,
    candidate_proposal,
    is_machine,
    with_rings,
)
from wm_drake.studies.balancer.page import diverged
from wm_drake.studies.balancer.rings import (
    capacities_of,
    capacity_of,
    is_within,
    locked,
    picked_up_from,
    with_factors,
    without_rings,
)
from wm_drake.studies.balancer.study import (
    HOLD,
    MASS,
    PLACE,
    base_of,
    compared,
    curves_of,
    from_release,
    lock_below,
    released,
    run_up,
)

RPM = np.pi / 30.0
SPEEDS = RPM * np.array([100.0, 200.0, 300.0])


def curves(*sizes):
    """Return curves of runs with amplitudes in mm; the last one is that at the highest speed."""
    values = 1e-3 * np.array(sizes)
    data = {"amplitude": (("run", "from"), values[:, :-1]), "level": ("run", values[:, -1])}
    return xr.Dataset(data, {"from": SPEEDS[: values.shape[1] - 1]})


def loads_of(free, held, masses, is_within_capacity):
    return compared(curves(*free), curves(*held)).assign(
        mass=MASS.variable("run", masses),
        place=PLACE.variable("run", np.zeros(len(masses))),
        is_within_capacity=("run", is_within_capacity),
    )


def test_capacity_of_a_ring_is_the_sum_of_its_balls():
    ring = rings_of(load_machine("ball_rings"))["front_ring"]
    half = np.arcsin(0.5 * 0.025 / 0.225)  # of the angle between neighbours
    expected = 0.064 * 0.225 * np.sin(8.0 * half) / np.sin(half)
    assert capacity_of(ring) == pytest.approx(expected)
    assert ring.first_angles.size == 8
    assert np.abs(np.exp(1j * ring.first_angles).sum()) * 0.064 * 0.225 == pytest.approx(expected)


def test_capacity_in_the_planes_of_the_rings():
    parameters = load_machine("ball_rings")
    one = capacity_of(rings_of(parameters)["front_ring"])
    capacities = capacities_of(parameters)
    assert capacities == pytest.approx({-0.16: one, 0.16: one})
    assert is_within(capacities, 1.99 * one, 0.0)
    assert not is_within(capacities, 1.2 * one, 0.16)  # all of it in one plane
    (only,) = capacities_of(
        parameters.model_copy(update={"elements": {"a": rings_of(parameters)["front_ring"]}})
    ).values()
    assert only == pytest.approx(one)


def test_a_slow_ball_hangs_in_the_lower_half_of_its_race_until_it_is_picked_up():
    """Below m g R/d its place against the tub is at rest at m g R sin(angle) = d W; above not."""
    parameters = load_machine("ball_rings")
    speed = picked_up_from(parameters)
    assert speed == pytest.approx(0.064 * 9.81 * 0.225 / 0.03)
    one = {**parameters.elements["front_ring"].model_dump(), "balls": 1, "rolling_resistance": 0.0}
    tree = parameters.model_dump(exclude_unset=True) | {"elements": {"ring": one}}
    machine = wm.build_machine(MachineParameters.model_validate(tree))
    turned = []
    for part in (0.8, 1.3):
        profile = SpinProfile(time=(0.0, 8.0), speed=(part * speed, part * speed))
        empty = Load(unbalances=())
        record = wm.simulate(machine, Case("", empty, profile))
        in_tub = record.ball_ring_angle.values[:, 0, 0] + record.drum_angle.values
        turned.append(np.unwrap(in_tub))
    assert np.ptp(turned[0][-800:]) < 0.02
    # carried along from the bottom, and positive as the drum turns
    assert turned[0][-1] % (2.0 * np.pi) == pytest.approx(np.pi + np.arcsin(0.8), abs=0.02)
    assert np.ptp(turned[1][-800:]) > 2.0 * np.pi


def test_locked_balls_add_mass_and_no_unbalance():
    parameters = load_machine("ball_rings")
    load, plain = parameters.loads["back"], without_rings(parameters)
    held = locked(load, parameters)
    assert not plain.elements
    before, after = (
        moments_of_load(Case("", each, parameters.profile), plain) for each in (load, held)
    )
    np.testing.assert_allclose(after, before, atol=1e-15)
    masses = [sum(u.mass for u in each.unbalances) for each in (load, held)]
    assert masses[1] - masses[0] == pytest.approx(16.0 * 0.064)


def test_factors_change_all_rings():
    changed = rings_of(with_factors(load_machine("ball_rings"), 0.5, 3.0))
    assert [(r.ball_mass, r.damping) for r in changed.values()] == [(0.032, 0.09)] * 2


def test_a_run_up_has_a_region_for_each_range_of_speed():
    profile = run_up(400.0 * RPM, 20.0 * RPM)
    assert profile.duration == pytest.approx(20.0 + HOLD)
    *ranges, last = profile.regions
    begins = [profile.speed_at(region.begin) / RPM for region in ranges]
    assert begins == pytest.approx(np.arange(25.0, 400.0, 25.0))
    assert (last.begin, last.end) == pytest.approx((20.0 + 0.5 * HOLD, 20.0 + HOLD))
    released = from_release(300.0 * RPM, 400.0 * RPM, 20.0 * RPM)
    assert released.speed[0] == pytest.approx(300.0 * RPM)
    assert len(released.regions) == 2


def test_a_run_that_diverged_is_worse_than_any_other():
    sizes = np.array([np.full((2, 2), np.nan), [[1.0, 2.0], [3.0, 4.0]]])
    runs = xr.Dataset({"region_amplitude": (("run", "region", "sensor"), sizes)})
    found = curves_of(runs, run_up(4.0, 1.0))
    assert np.isinf(found.level[0])
    assert (found.amplitude.values[1], found.level[1]) == (2.0, 4.0)
    both = compared(found, found)
    assert both.is_larger_at_highest_speed.all()
    assert both.worst_quotient.isnull().values.tolist() == [True, False]
    assert both.pays_from.isnull().all()


@pytest.mark.parametrize(
    ("free", "held", "rpm"),
    [
        ((2.0, 2.0, 1.0, 0.1), (1.0, 1.0, 2.0, 2.0), 300.0),
        ((0.5, 2.0, 1.0, 0.1), (1.0, 1.0, 2.0, 2.0), 300.0),
        ((0.5, 0.5, 1.0, 0.1), (1.0, 1.0, 2.0, 2.0), 100.0),
        ((2.0, 2.0, 1.0, 3.0), (1.0, 1.0, 2.0, 2.0), np.nan),
    ],
)
def test_balls_pay_from_the_speed_above_which_they_are_never_worse(free, held, rpm):
    pays_from = compared(curves(free), curves(held)).pays_from
    np.testing.assert_allclose(pays_from / RPM, [rpm])


def test_the_lock_holds_for_the_loads_that_the_balls_can_balance():
    good, beyond = (4.0, 2.0, 1.0, 0.1), (4.0, 2.0, 1.0, 3.0)
    held = (1.0, 1.0, 2.0, 2.0)
    loads = loads_of([good, beyond], [held, held], [0.5, 1.0], [True, False])
    assert loads.worst_quotient.values == pytest.approx(4.0)
    assert loads.worst.values == pytest.approx(100.0 * RPM)
    assert lock_below(loads) == pytest.approx(300.0 * RPM)
    assert base_of(loads).mass == 0.5
    assert np.isnan(lock_below(loads.assign(is_within_capacity=("run", [True, True]))))
    none = loads.assign(is_within_capacity=("run", [False, False]))
    assert np.isnan(lock_below(none))
    assert base_of(none).mass == 0.5


def test_a_release_is_judged_by_all_of_its_run():
    found = released([20.0, 30.0], curves((3.0, 0.1), (1.0, 2.5)), curves((2.0, 2.0), (2.0, 2.0)))
    assert found.is_larger.values.tolist() == [True, True]
    assert found.after_free.values == pytest.approx([3e-3, 2.5e-3])


def candidate_runs(balls, liquid):
    """Return responses of two loads without a balancer, with balls and with liquid. [mm]"""
    values = 1e-3 * np.array([[[10.0, 4.0], [8.0, 3.0]], balls, liquid])
    labels = {"candidate": [NONE, BALLS, LIQUID], "load": ["a", "b"], "response": list(RESPONSES)}
    return xr.DataArray(values, labels)


COMMANDS = {BALLS: "spin --machine balls", LIQUID: "spin --machine liquid"}
WORSE_IN_RUN_UP = [[12.0, 0.1], [9.0, 0.1]]
SOMEWHAT_BETTER = [[9.0, 3.0], [7.0, 2.0]]
BETTER = [[9.5, 0.1], [8.0, 0.1]]
ALIKE = [[10.01, 4.0], [8.0, 3.0]]


@pytest.mark.parametrize(
    ("balls", "liquid", "chosen"),
    [
        (WORSE_IN_RUN_UP, SOMEWHAT_BETTER, LIQUID),  # balls raise a response by a fifth
        (BETTER, ALIKE, BALLS),
        (WORSE_IN_RUN_UP, ALIKE, None),
        ([[np.nan, np.nan], [9.0, 0.1]], SOMEWHAT_BETTER, LIQUID),  # a run failed
    ],
)
def test_the_fitted_balancer_raises_no_response_by_more_than_a_tenth(balls, liquid, chosen):
    proposal = candidate_proposal(candidate_runs(balls, liquid), COMMANDS)
    assert bool(proposal.is_confirmed) == (chosen is not None)
    assert proposal.line_to_copy.item() == COMMANDS.get(chosen, "")
    assert proposal.value.values.tolist() == ([WORDS[chosen]] if chosen else [])
    assert proposal.before.values.tolist() == pytest.approx([10e-3, 4e-3])


def test_a_machine_gets_the_rings_that_it_does_not_have():
    balls, liquid = load_machine("ball_rings"), load_machine("liquid_rings")
    own = with_rings(balls, BALLS, liquid)
    assert own == balls
    other = with_rings(balls, LIQUID, liquid)
    assert other.elements == liquid.elements
    assert is_machine(other, liquid)
    plain = with_rings(load_machine("reference"), LIQUID, liquid)
    assert plain.elements == liquid.elements
    assert plain.step == liquid.step < load_machine("reference").step
    assert not is_machine(plain, liquid)  # other loads
    both = wm.with_values(balls, {"elements": {**balls.elements, **liquid.elements}})
    assert with_rings(both, BALLS, liquid).elements == balls.elements
    assert not without_rings(both).elements


@pytest.fixture(scope="module")
def result():
    return wm.run_study("balancer", quick=True, quiet=True)


def test_balls_help_at_speed_and_hurt_in_the_run_up(result):
    """Check the planted physics: balls add to the unbalance below the resonances, cancel it above."""
    tables = result.tables()
    loads, curve = tables["loads"], tables["curve"]
    assert (loads.level_free_mm < 0.1 * loads.level_locked_mm).all()
    assert (loads.worst_quotient > 1.2).all()
    assert loads.pays_from_rpm.between(200.0, 325.0).all()
    same = curve.from_rpm < 75.0  # locked balls are as good as none, up to their mass
    np.testing.assert_allclose(curve.locked_mm[same], curve.without_rings_mm[same], rtol=0.1)
    (release,) = tables["releases"].itertuples()
    assert release.after_free_mm < release.after_locked_mm
    assert release.level_free_mm < 0.1 * release.level_locked_mm
    assert result.diverged == ()


def test_the_candidates_run_with_the_same_loads(result):
    """Check that liquid helps at the highest speed, less than balls, and hurts in the run-up.

    Below the resonances the liquid is on the side of the unbalance and adds to it.
    """
    tables = result.tables()
    level, peak = (
        tables["candidates"][[f"{name}_{one}_mm" for one in (NONE, BALLS, LIQUID)]].to_numpy().T
        for name in ("level", "peak")
    )
    assert (level[1] < 0.1 * level[0]).all()
    assert (level[1] < level[2]).all()
    assert (level[2] < level[0]).all()
    assert (peak[0] < peak[2]).all()
    assert (peak[2] < 2.0 * peak[0]).all()
    lags = tables["lags"]
    assert len(lags) == 3
    assert lags.level_mm.max() < 1.02 * lags.level_mm.min()  # a steady whirl does not depend on it
    np.testing.assert_allclose(level[1], tables["loads"].level_free_mm)


def test_more_damping_passes_and_less_damping_changes_the_run_up(result):
    rings = result.tables()["rings"]
    assert list(rings.damping_percent) == [30.0, 100.0]
    assert rings.peak_free_mm.nunique() == 2
    # the locked balls of both are the same run
    assert rings.peak_locked_mm.nunique() == 1


def test_a_run_that_diverged_is_a_failure(result):
    loads, rings, releases = (
        result.labelled()[name].data for name in ("loads", "rings", "releases")
    )
    worse = loads.assign(level_free=loads.level_free.copy(data=[np.inf, 1.0]))
    assert diverged(worse, rings, releases) == ("0.4 kg at 0 mm: a run diverged",)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"machine": "heavy_cabinet"}, "needs a rigid bearing and a fixed"),
        ({"liquid": "none.yaml"}, "none.yaml"),
        ({"mass": "0 kg"}, "--mass: '0 kg' is not above 0"),
        ({"place": "1 kg"}, "--place"),
        ({"high": "50 rpm"}, "--to: is below 100 rpm"),
        ({"high": "100 rpm", "release": "100 rpm"}, "--release: is not below the highest speed"),
        ({"release": "1300 rpm"}, "--release: is not below the highest speed, 1200 rpm"),
        ({"ball_mass": "0.001 %"}, "step"),
        ({"mass": ",".join(f"{0.1 + 0.01 * i:.2f}" for i in range(30)) + " kg"}, "has 30 values"),
    ],
)
def test_options_that_cannot_be(changes, message):
    with pytest.raises(InputError, match=message.replace("(", r"\(")):
        wm.run_study("balancer", quiet=True, **changes)
