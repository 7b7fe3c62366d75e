"""Judgement of a fit: noise without a model, lack of fit, reversed signs and delays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wm_drake.parameters import CoulombDamper, MeasuredLoop, load_component, load_machine
from wm_drake.rigs import Harmonic, bushing_bench, damper_bench, force_loops
from wm_drake.rigs.measured import measured_motion
from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.identify.judgement import judge, noise_of
from wm_drake.studies.identify.models import Given, TestedAxis, bushing_model, damper_model
from wm_drake.studies.identify.problem import fit_problem

MSTV = load_component("mstv_damper").parameters
GASKET = load_machine("free_stroke").gasket
MOTIONS = [Harmonic(1.0, 1e-3), Harmonic(5.0, 3e-3)]


def recorded(bench, *, sign=1.0, noise=0.0, delay=0.0, periods=3.1, samples=400):
    """Record loops, unevenly sampled; noise is a part of the largest force, delay an angle."""
    rng, found = np.random.default_rng(3), []
    for k, (motion, loop) in enumerate(zip(MOTIONS, force_loops(bench, MOTIONS), strict=True)):
        t = np.sort(rng.uniform(0.0, periods / motion.frequency, samples))
        phase = motion.angular_frequency * t
        force = np.interp(
            (phase - delay) % (2.0 * np.pi),
            np.append(loop.time * motion.angular_frequency, 2.0 * np.pi),
            np.append(loop.force, loop.force[0]),
        )
        force += noise * np.max(np.abs(force)) * rng.normal(size=samples)
        displacement = motion.amplitude * np.sin(phase)
        found.append(
            measured_motion(
                MeasuredLoop(f"loop_{k}", f"{k}.csv", t, displacement, sign * force, False)
            )
        )
    return found


def judged(model, loops):
    fit = identify(fit_problem(model, loops), starts=1)
    return judge(fit, loops)


@given(
    sigma=st.floats(0.01, 10.0),
    size=st.floats(0.0, 100.0),
    jump=st.floats(-100.0, 100.0),
    seed=st.integers(0, 1000),
)
def test_noise_is_found_under_a_smooth_loop_with_jumps(sigma, size, jump, seed):
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0.0, 2.0 * np.pi, 3000)
    values = size * np.sin(phase) + jump * (phase > np.pi) + sigma * rng.normal(size=3000)
    assert noise_of(phase, values) == pytest.approx(sigma, rel=0.15)


def test_noise_that_is_slow_in_time_counts_with_several_periods():
    """Add a drifting error: smooth within one period, shown by the next."""
    rng = np.random.default_rng(0)
    t = np.sort(rng.uniform(0.0, 20.0, 4000))
    slow = np.sin(0.37 * t) + np.sin(0.81 * t + 1.0)
    phase = (2.0 * np.pi * t) % (2.0 * np.pi)
    assert noise_of(phase, slow + np.sin(phase)) == pytest.approx(1.0, rel=0.35)
    first = t < 1.0
    assert noise_of(phase[first], slow[first]) < 0.05


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.2])
def test_the_right_law_is_a_good_fit_at_any_noise(noise):
    loops = recorded(damper_bench(MSTV), noise=noise)
    judgement = judged(damper_model("mstv", loops), loops)
    assert judgement.verdict == "good"
    assert judgement.missed < 0.01
    assert judgement.noise == pytest.approx(noise * 1.1, rel=0.3, abs=0.01)
    assert judgement.hints == ()


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_law_without_sponge_on_a_damper_with_one_is_a_poor_fit(noise):
    loops = recorded(damper_bench(MSTV), noise=noise)
    fit = identify(fit_problem(damper_model("coulomb", loops), loops), starts=1)
    judgement = judge(fit, loops)
    assert judgement.verdict == "poor"
    assert judgement.hints == ()
    # lack of fit and noise together are the residual
    squares = [np.mean(np.square(m.loop.force - m.baseline @ b)) for m, b in zip(
        loops, fit.baselines, strict=True)]  # fmt: skip
    whole = fit.rmse**2 / np.mean(squares)
    assert judgement.missed**2 + judgement.noise**2 == pytest.approx(whole, rel=0.05)


def test_lack_of_fit_below_the_noise_is_not_claimed():
    """Lose a small friction under a linear law in the noise; without noise it is seen."""
    rubber = CoulombDamper(law="coulomb", friction_force=0.5, damping=2000.0)
    found = []
    for noise in (0.1, 0.0):
        loops = recorded(damper_bench(rubber), noise=noise)
        model = damper_model("coulomb", loops, Given(fixed={"friction_force": 0.0}))
        found.append(judged(model, loops).missed)
    assert found[0] == 0.0
    assert 5e-4 < found[1] < 0.05


@pytest.mark.parametrize("bench", ["damper", "gasket"])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_reversed_sign_is_told(bench, noise):
    benches = {"damper": damper_bench(MSTV), "gasket": bushing_bench(GASKET, "x")}
    for sign in (1.0, -1.0):
        loops = recorded(benches[bench], sign=sign, noise=noise)
        model = (
            damper_model("coulomb", loops)
            if bench == "damper"
            else bushing_model("voigt", loops, TestedAxis(GASKET, "x"))
        )
        judgement = judged(model, loops)
        if sign > 0.0:
            assert judgement.hints == ()
            assert all(loop.work > 0.0 for loop in judgement.loops)
        else:
            assert judgement.verdict == "poor"
            (hint,) = judgement.hints
            assert "wrong sign" in hint
            assert hint in judgement.sentences


def test_a_delay_of_the_force_is_told_from_a_reversed_sign():
    loops = recorded(bushing_bench(GASKET, "x"), delay=0.5)
    (hint,) = judged(bushing_model("voigt", loops, TestedAxis(GASKET, "x")), loops).hints
    assert "gives energy" in hint


def test_work_of_a_loop_is_its_area():
    damper = CoulombDamper(law="coulomb", friction_force=40.0)
    loops = recorded(damper_bench(damper))
    for loop, motion in zip(
        judged(damper_model("coulomb", loops), loops).loops, MOTIONS, strict=True
    ):
        assert loop.work == pytest.approx(4.0 * 40.0 * motion.amplitude, rel=0.02)
