"""The study of detection: planted orders, estimators and risks, a fixed tub, engines, refusals."""

import json

import numpy as np
import pytest
import xarray as xr
from motor_machines import isotropic_motor
from simple_machines import unbalance

from wm_drake.batch import simulate_many
from wm_drake.elements.unbalance_monitor import UnbalanceMonitor
from wm_drake.engines.compiled.step_check import drum_inertia
from wm_drake.errors import InputError
from wm_drake.export.model import exported_model
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, Unbalance, load_machine, with_values
from wm_drake.report.quantity import SPEED, Quantity
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate
from wm_drake.studies.detect.decision import (
    NoThresholdError,
    speed_limits,
    table_of,
    threshold_for,
    verdict_of,
)
from wm_drake.studies.detect.estimators import LINEAR, LinearFit, estimated
from wm_drake.studies.detect.holds import hold_of, in_ranges
from wm_drake.studies.detect.measures import SIGNALS_OF_HOLD, amplitudes_of_orders
from wm_drake.studies.detect.options import DetectOptions
from wm_drake.studies.detect.signals import chosen_signals, features_of
from wm_drake.studies.detect.study import draws_of, truths_of
from wm_drake.studies.detect.task import DetectTask
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studio.forms import arguments

RUN_UP = SpinProfile(time=(0.0, 40.0, 50.0), speed=(0.0, 40.0, 40.0))
W = SPEED.unit.to_si(90.0)


def test_orders_of_a_window_are_those_planted_beside_a_trend():
    angle = np.linspace(0.0, 8.3 * np.pi, 400)
    signal = 1.0 + 0.3 * angle + 2.0 * np.cos(angle) - np.sin(angle) + 0.5 * np.sin(2.0 * angle)
    found = amplitudes_of_orders(angle, signal[:, None])
    np.testing.assert_allclose(found[:, 0], [[2.0, -1.0], [0.0, 0.5]], atol=1e-9)
    assert np.isnan(amplitudes_of_orders(angle[:5], signal[:5, None])).all()


def test_the_error_of_an_order_is_that_of_noisy_and_rounded_samples():
    """Plant noise and rounding on the samples themselves; compare with the closed form."""
    signal = chosen_signals(
        load_machine("motor"), ["torque, noise=0.3 N*m, resolution=0.5 N*m, sample=10 ms"]
    )[0]
    duration, rng = 4.0 * 2.0 * np.pi / W, np.random.default_rng(0)
    time = np.arange(0.0, duration, signal.sample)
    exact = 1.7 * np.cos(W * time + 0.3)
    noisy = exact + signal.noise * rng.standard_normal((4000, len(time)))
    rounded = signal.resolution * np.round(noisy / signal.resolution)
    errors = amplitudes_of_orders(W * time, (rounded - exact).T)[0]
    np.testing.assert_allclose(errors.std(axis=0), signal.deviation(duration), rtol=0.05)


def test_holds_are_those_of_the_profile_or_of_a_speed():
    profile = SpinProfile(time=(0.0, 9.0, 20.0, 40.0, 50.0), speed=(0.0, W, W, 40.0, 40.0))
    assert hold_of(None, profile, 8.0, 4).ramp.time == (0.0, 9.0, 20.0)
    hold = hold_of("60 rpm", RUN_UP, 8.0, 4)
    assert hold.profile.duration == pytest.approx(8.0 + hold.speed)  # the ramp is 1 rad/s^2
    assert hold.windows == (2, 4, 8)
    lengths = [region.end - region.begin for region in hold.profile.regions]
    np.testing.assert_allclose(lengths, [4.0, 2.0, 2.0])  # 60 rpm: a turn is 1 s
    np.testing.assert_allclose(hold.weights(4), [0.0, 0.5, 0.5])
    for text, words in (("profile", "no hold"), ("500 rpm", "no hold at 500"), ("9 rpm", "turns")):
        with pytest.raises(InputError, match=words):
            hold_of(text, RUN_UP, 8.0, 4)


def test_ranges_of_speed_begin_where_the_profile_exceeds_a_limit_first():
    profile = SpinProfile(time=(0.0, 10.0, 15.0, 20.0, 30.0), speed=(0.0, 20.0, 5.0, 5.0, 30.0))
    ranged, limits = in_ranges(profile)
    for region, limit in zip(ranged.regions, limits, strict=True):
        inside = np.linspace(region.begin, region.end, 50)
        assert max(profile.speed_at(inside)) <= limit + 1e-9
    assert limits[-1] == 30.0
    assert ranged.regions[-1].end == 30.0


def planted(count, seed, spread=0.1):
    """Return scores and contacts of loads that touch more often, the larger their score."""
    rng = np.random.default_rng(seed)
    score = rng.uniform(0.0, 1.0, count)
    return score, rng.uniform(size=count) < 0.5 * np.exp(-(1.0 - score) / spread)


@pytest.mark.parametrize("risk", [0.01, 0.02, 0.05])
def test_the_risk_of_a_chosen_threshold_is_the_tolerated_one_and_its_intervals_hold(risk):
    """Check the mean risk of 300 repeats, and how often intervals have the shares of 20,000 loads."""
    true_score, true_touch = planted(20000, 10**6)
    risks, holds = [], []
    for seed in range(300):
        score, touches = planted(1024, seed)
        threshold = threshold_for(score[:512], touches[:512], risk)
        judged = verdict_of(score[512:], touches[512:], threshold)
        spins = true_score <= threshold
        truth = (true_touch[spins].mean(), spins.mean(), (~spins & ~true_touch).mean())
        risks.append(truth[0])
        shares = (judged.touches, judged.spins, judged.refused)
        holds.append([of.lower <= t <= of.upper for of, t in zip(shares, truth, strict=True)])
    assert 0.8 * risk < np.mean(risks) <= risk
    held = np.mean(holds, axis=0)
    assert np.all((held >= 0.90) & (held <= 0.98)), held


def test_a_table_of_thresholds_counts_loads_and_distributions():
    score, touches = np.array([1.0, 2.0, 3.0, 4.0]), np.array([False, False, False, True])
    table = table_of(np.array([2.5, 4.0]), Quantity("ripple"), score, touches, 90.0)
    np.testing.assert_allclose(table.spins, [0.5, 1.0])
    np.testing.assert_allclose(table.refused, [0.25, 0.0])
    np.testing.assert_allclose(table.touches, [0.0, 0.25])
    np.testing.assert_allclose(table.minutes, [3.0, 1.5])
    with pytest.raises(NoThresholdError, match=r"at best 25 %, where 3 of 4 loads spin"):
        threshold_for(score, touches, 0.1)


def test_speed_limits_never_rise_and_no_load_of_their_making_touches():
    rng = np.random.default_rng(0)
    score = rng.uniform(size=400)
    highest = np.where(score + 0.1 * rng.standard_normal(400) > 0.8, 10.0, 40.0)
    fitted = np.arange(400) < 200
    table = speed_limits(score, highest, fitted, Quantity("ripple"))
    assert (np.diff(table["limit"]) <= 0.0).all()
    for bound, limit in zip(table.up_to.values, table["limit"].values, strict=True):
        assert highest[fitted & (score <= bound)].min() <= limit or limit == 40.0
    assert table.loads.sum() <= 200.0


def test_estimators_of_known_error_have_it_and_a_users_function_works():
    rng = np.random.default_rng(0)
    features = xr.DataArray(
        rng.standard_normal((2000, 2)), {"feature": ["a", "b"]}, ("draw", "feature")
    )
    truth = 1.0 + features.values @ [2.0, -3.0]
    values = truth + 0.1 * rng.standard_normal(2000)
    fitted = np.arange(2000) < 1000
    fit, estimates = estimated(LINEAR, features, values, fitted)
    assert isinstance(fit, LinearFit)
    assert fit.coefficients == pytest.approx({"a": 2.0, "b": -3.0}, abs=0.02)
    assert np.std((estimates - values)[~fitted]) == pytest.approx(0.1, rel=0.05)
    mean = type(LINEAR)("mean", lambda _, v: lambda f: np.full(len(f), v.mean()))
    assert np.ptp(estimated(mean, features, values, fitted)[1]) == 0.0


def test_phases_against_the_first_signal_separate_mass_and_place():
    """Plant X = m (a + b y) and T = c m with complex a, b, c: mass and moment are linear."""
    rng = np.random.default_rng(0)
    mass, y, angle = rng.uniform(0.1, 1.0, 500), rng.uniform(-0.1, 0.1, 500), rng.uniform(0, 6, 500)
    turned = mass * np.exp(1j * angle)
    torque, sensor = (0.7 - 0.2j) * turned, ((1 + 2j) + (5 - 3j) * y) * turned
    signals = chosen_signals(load_machine("motor"), ["torque", "Xr"])
    pairs = [np.column_stack([signal, signal]) for signal in (torque, sensor)]
    features = features_of(signals, ("amplitude", "phase"), pairs)
    fitted = np.arange(500) < 250
    for truth in (mass, mass * y):
        np.testing.assert_allclose(estimated(LINEAR, features, truth, fitted)[1], truth, atol=1e-9)


def test_mass_and_moment_of_a_load():
    lump = {"radius": 0.2, "phase": 1.0}
    one = Load(unbalances=(Unbalance(mass=0.5, y=-0.1, **lump),))
    assert truths_of(one) == pytest.approx((0.5, -0.5 * 0.2 * 0.1, 0.5 * 0.2))
    two = Load(unbalances=(Unbalance(mass=0.5, y=-0.1, **lump), Unbalance(mass=0.3, y=0.2, **lump)))
    assert truths_of(two) == pytest.approx((0.8, 0.2 * (0.3 * 0.2 - 0.5 * 0.1), 0.16))


def orders_of(machine, loads, engine="compiled"):
    """Return the measures of loads in a hold at 90 rpm."""
    profile = hold_of("90 rpm", RUN_UP, 8.0, 4).profile
    cases = [Case(f"{k}", load, profile) for k, load in enumerate(loads)]
    return simulate_many(machine, cases, measures=[SIGNALS_OF_HOLD.name], engine=engine)


def on_fixed_tub(**elements):
    """Return a machine with a motor whose tub of 1000 kg on 1e7 N/m moves by micrometres."""
    stiff = {f"gasket.stiffness_{axis}": 1e7 for axis in "xyz"}
    stiff |= {f"gasket.rotational_stiffness_{axis}": 1e6 for axis in "xyz"}
    heavy = {f"bodies.tub.inertia.{axis}": 100.0 for axis in ("xx", "yy", "zz")}
    heavy |= {"gravity": 9.81, "bodies.tub.mass": 1e3}
    machine = with_values(isotropic_motor(), stiff | heavy)
    return build_machine(machine.model_copy(update={"elements": elements}))


def impedances_of(machine, inertia):
    """Return controller C and impedance C + j w J of docs/theory/detect.md at 90 rpm."""
    drive = machine.parameters.drive
    gains, ratio = drive.controller, drive.belt_ratio**2
    control = ratio * (gains.proportional_gain + gains.integral_gain / (1j * W))
    return control, control + 1j * W * (drum_inertia(machine.set_up()) + inertia)


def test_torque_and_speed_ripple_of_a_fixed_tub_are_the_closed_form():
    machine = on_fixed_tub()
    mass, radius, places = np.array([0.3, 1.0, 1.0]), 0.24, (0.0, -0.13, 0.13)
    found = orders_of(
        machine, [unbalance(m, radius, y, 1.0) for m, y in zip(mass, places, strict=True)]
    )
    control, impedance = impedances_of(machine, mass * radius**2)
    speed = mass * radius * 9.81 / np.abs(impedance)
    torque = np.linalg.norm(found.window_torque_1.values[:, -1], axis=-1)
    ripple = np.linalg.norm(found.window_speed_1.values[:, -1], axis=-1)
    np.testing.assert_allclose(ripple, speed, rtol=3e-3)
    np.testing.assert_allclose(torque, np.abs(control) * speed, rtol=3e-3)
    assert np.ptp(torque[1:]) < 1e-3 * torque[1]  # the place does not matter


def test_a_monitor_estimates_the_unbalance_from_the_closed_form_impedance():
    mass, radius = 0.7, 0.24
    impedance = abs(impedances_of(on_fixed_tub(), mass * radius**2)[1])
    monitor = UnbalanceMonitor(kind="unbalance_monitor", impedance=impedance, turns=2.0)
    machine = on_fixed_tub(monitor=monitor)
    profile = SpinProfile(time=(0.0, 20.0), speed=(W, W))
    record = simulate(machine, Case("one", unbalance(mass, radius, 0.1, 1.0), profile))
    last = record.unbalance_monitor_unbalance_estimate.values[-800:].mean()
    assert last == pytest.approx(mass * radius, rel=0.01)


def test_an_fmu_has_the_estimate_as_an_output():
    monitor = UnbalanceMonitor(kind="unbalance_monitor", impedance=5.3)
    machine = load_machine("motor").model_copy(update={"elements": {"monitor": monitor}})
    outputs = {v.name: v for v in exported_model(machine, "middle", input_kind="torque").variables}
    estimate = outputs["elements.monitor.unbalance_estimate"]
    assert (estimate.causality, estimate.unit) == ("output", "kg*m")


@pytest.mark.slow
def test_both_engines_have_the_same_orders(shipped):
    loads = [unbalance(0.7, 0.235, y, 1.0) for y in (-0.1, 0.1)]
    ours, theirs = (orders_of(shipped("motor"), loads, name) for name in ("compiled", "drake"))
    for name in ("torque_1", "speed_1", "displacement_1"):
        ours_, theirs_ = (of[f"window_{name}"].values for of in (ours, theirs))
        assert np.abs(ours_ - theirs_).max() < 2e-3 * np.abs(theirs_).max()


def drawn(machine, scores, seed):
    """Return the plan of the default study, and draws of its laundry at given scores."""
    task = DetectTask(DetectOptions(), machine)
    cases = list(task.laundry.uncertain.cases(scores))
    experiment = Experiment(task.laundry.machine, ())
    return task.plan, draws_of(experiment, cases, task.holds, 0.0, seed, has_accelerometers=False)


@pytest.mark.hours
@pytest.mark.parametrize("count", [20000])
def test_the_risk_is_that_of_plain_sampling(shipped, count):
    """Four minutes of processor time. Risk 0.30 % where 0.5 % is tolerated."""
    machine, size = shipped("motor"), 7
    plan, few = drawn(machine, base_samples(size, 1024, 0)[0], 0)
    _, many = drawn(machine, np.random.default_rng(99).standard_normal((count, size)), 99)
    score, half = plan.ripple(few), few.is_fitted
    threshold = threshold_for(score[half], few.touches[half], 0.005)
    judged = verdict_of(score[~half], few.touches[~half], threshold).touches
    risk = many.touches[plan.ripple(many) <= threshold].mean()
    assert judged.lower <= risk <= judged.upper
    assert risk <= 0.005


def test_the_command_answers_and_writes_what_a_controller_carries(wm_drake, tmp_path):
    out = tmp_path / "detect"
    ended = wm_drake("study", "detect", "--quick", "--json", "--out", str(out), "--at", "80 rpm")
    assert ended.code == 0, ended.err
    found = json.loads(ended.out)
    assert found["answer"].startswith("Spin if the torque ripple at 80 rpm is below ")
    assert {"decisions", "errors", "ranking", "speed_limits", "coefficients"} <= found.keys()
    assert sum(row["is_chosen"] for row in found["decisions"]) == 1
    assert "wm_speed_limits" in (out / "speed_limits.h").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--at", "profile"), "no hold"),
        (("--at", "900 rpm"), "no hold at 900 rpm"),
        (("--signal", "Xq"), "no signal 'Xq'"),
        (("--signal", "torque, noise=1 mm"), "noise"),
        (("--features", "guess"), "no features 'guess'"),
        (("--estimator", "deep"), "no estimator 'deep'"),
        (("--risk", "0.01 %"), "no threshold reaches 0.01 % with 64 draws: at best 3"),
    ],
)
def test_wrong_input_is_one_message(wm_drake, words, message):
    ended = wm_drake("study", "detect", "motor", "--quick", *words)
    assert (ended.code, ended.out) == (2, "")
    assert message in ended.err
    assert "Traceback" not in ended.err


def test_the_form_of_the_studio_takes_signals_with_their_errors():
    given = {"signal": "torque, noise=0.3 N m, sample=5 ms, Xr"}
    texts = [word.removeprefix("--signal=") for word in arguments("detect", given)]
    torque, sensor = chosen_signals(load_machine("motor"), texts)
    assert (torque.name, torque.noise, torque.sample) == ("torque", 0.3, pytest.approx(0.005))
    assert sensor.name == "Xr"


def test_a_controller_that_sees_nothing_is_refused(reference):
    blind = reference.model_copy(update={"sensors": {}})
    with pytest.raises(InputError, match="neither a motor nor a sensor"):
        chosen_signals(blind, [])
    assert [signal.name for signal in chosen_signals(reference, [])] == ["Xr"]
