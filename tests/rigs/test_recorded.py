"""Motions that are no sines drive the law as recorded: triangles, ramps, sweeps, random motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import chirp, sawtooth

from wm_drake.elements.damper_law import damper_response
from wm_drake.errors import InputNotice
from wm_drake.parameters import CoulombDamper, MeasuredLoop, load_component, load_machine
from wm_drake.rigs import Harmonic, bushing_bench, damper_bench, force_loops
from wm_drake.rigs.forces import damper_tensions
from wm_drake.rigs.measured import HarmonicMotion, RecordedMotion, measured_motion
from wm_drake.rigs.recorded import recorded_deformation, recorded_forces
from wm_drake.rigs.smoothing import smoothed

MSTV = damper_bench(load_component("mstv_damper").parameters)
COULOMB = damper_bench(CoulombDamper(law="coulomb", friction_force=60.0, damping=100.0))
FREE_STROKE = damper_bench(load_machine("free_stroke").damper_types["free_stroke"])
GASKET = bushing_bench(load_machine("free_stroke").gasket, "x")
TIME = np.linspace(0.0, 3.0, 3001)
TRIANGLE = 2e-3 * sawtooth(2.0 * np.pi * 1.5 * TIME + 0.5 * np.pi, 0.5)
RNG = np.random.default_rng(0)
RANDOM = 1e-3 * sum(
    RNG.normal() * np.sin(2.0 * np.pi * f * TIME + RNG.uniform(0.0, 6.0))
    for f in np.arange(0.5, 12.0, 0.5)
)
MOTIONS = {
    "triangle": TRIANGLE,
    "ramp and back": 5e-3 * sawtooth(2.0 * np.pi * TIME / 3.0, 0.5) + 5e-3,
    "sweep": 2e-3 * chirp(TIME, 1.0, 3.0, 10.0),
    "random": RANDOM,
    "amplitudes": np.where(TIME < 1.5, 0.3e-3, 1e-3) * np.sin(2.0 * np.pi * 4.0 * TIME),
}


def recorded(displacement, time=TIME, cutoff=None):
    return measured_motion(
        MeasuredLoop("test", "test.csv", time, displacement, np.ones_like(time), False), cutoff
    )


def test_a_motion_with_a_gap_is_cut_to_its_longest_part():
    kept = (TIME < 1.0) | (TIME > 1.5)
    gaps = np.array([[TIME[kept & (TIME < 1.0)][-1], TIME[TIME > 1.5][0]]])
    time, values = TIME[kept], RANDOM[kept]
    with pytest.warns(InputNotice, match=r"used is the longest part without one, 1\.501 to 3 s"):
        found = measured_motion(MeasuredLoop("t", "t.csv", time, values, values, False, gaps))
    np.testing.assert_array_equal(found.loop.time, TIME[TIME > 1.5])
    whole = recorded(RANDOM[TIME > 1.5], TIME[TIME > 1.5])
    np.testing.assert_array_equal(found.rate, whole.rate)


@pytest.mark.parametrize("name", MOTIONS)
def test_a_motion_that_is_no_sine_is_never_taken_as_one(name):
    found = recorded(MOTIONS[name])
    assert isinstance(found, RecordedMotion)
    assert found.position == pytest.approx(MOTIONS[name], abs=0.01 * np.max(np.abs(MOTIONS[name])))
    assert (found.repeats > 0) == (name == "triangle")


@pytest.mark.parametrize("noise", [0.0, 0.005, 0.02])
def test_a_sine_is_taken_as_one_also_with_noise(noise):
    sine = 1e-3 * (np.sin(2.0 * np.pi * 4.0 * TIME) + noise * RNG.normal(size=TIME.size))
    found = recorded(sine)
    assert isinstance(found, HarmonicMotion)
    assert found.motion.frequency == pytest.approx(4.0, rel=1e-3)
    assert found.motion.amplitude == pytest.approx(1e-3, rel=5e-3)


def test_a_sine_with_a_third_harmonic_of_three_percent_is_taken_as_recorded():
    angle = 2.0 * np.pi * 4.0 * TIME
    assert isinstance(recorded(np.sin(angle) + 0.03 * np.sin(3.0 * angle)), RecordedMotion)
    assert isinstance(recorded(np.sin(angle) + 0.01 * np.sin(3.0 * angle)), HarmonicMotion)


def test_dry_friction_of_a_triangle_has_two_values():
    """Take a triangle; a sine of the same file would give a force wrong by -16 to +21 %."""
    found = recorded_forces(COULOMB, recorded(TRIANGLE))
    speed = 4.0 * 2e-3 * 1.5
    inside = np.abs(np.abs(TRIANGLE) - 2e-3) > 1e-4
    assert np.abs(found[inside]) == pytest.approx(60.0 + 100.0 * speed, rel=2e-3)


@pytest.mark.parametrize("bench", [MSTV, FREE_STROKE], ids=["mstv", "free stroke"])
@pytest.mark.parametrize("name", ["ramp and back", "sweep", "random"])
def test_a_sponge_moves_as_an_integrator_with_error_control_finds(bench, name):
    motion = recorded(MOTIONS[name])
    ends = np.concatenate([[0.0], np.cumsum(motion.step)])
    found = recorded_deformation(bench, motion)
    rate = lambda t: np.interp(t, ends, motion.step_rate)  # noqa: E731
    expected = solve_ivp(
        lambda t, x: [damper_response(rate(t), x[0], bench.packed, 0)[1]],
        (0.0, ends[-1]),
        [0.0],
        "LSODA",
        t_eval=ends,
        rtol=1e-8,
        atol=1e-11,
        max_step=2e-3,
    ).y[0]
    assert found == pytest.approx(expected, abs=3e-3 * np.max(np.abs(expected)))


@pytest.mark.parametrize("bench", [MSTV, FREE_STROKE, COULOMB], ids=["mstv", "free", "coulomb"])
def test_a_sine_that_is_taken_as_recorded_gives_the_steady_loop(bench):
    (loop,) = force_loops(bench, [Harmonic(3.0, 2e-3)])
    time = np.arange(0.0, 1.0, 1.0 / (3.0 * 360))
    motion = recorded(2e-3 * np.sin(2.0 * np.pi * 3.0 * time), time, cutoff=1000.0)
    assert isinstance(motion, RecordedMotion)
    assert motion.repeats
    force = recorded_forces(bench, motion)
    inside = np.min(np.abs(np.arange(len(time))[:, None] % 180 - [0, 90, 180]), axis=1) > 2
    expected = np.tile(loop.force[::4], 3)[: len(time)]
    error = (force - expected)[inside & (time > 0.01)]
    assert np.max(np.abs(error)) < 3e-3 * np.max(np.abs(expected))


def test_a_bushing_follows_displacement_and_rate():
    motion = recorded(RANDOM)
    gasket = load_machine("free_stroke").gasket
    rate = np.gradient(RANDOM, TIME)
    expected = gasket.stiffness_x * RANDOM + gasket.damping_x * rate
    error = recorded_forces(GASKET, motion) - expected
    assert np.max(np.abs(error[2:-2])) < 1e-2 * np.max(np.abs(expected))


def test_smoothing_halves_a_motion_at_its_cutoff():
    time = np.linspace(0.0, 2.0, 2001)
    for frequency, factor in ((10.0, 1.0), (50.0, 0.5), (150.0, 1.0 / 82.0)):
        signal = np.sin(2.0 * np.pi * frequency * time)
        curve = smoothed(time, signal + np.sin(2.0 * np.pi * 1.0 * time) * 20.0, 50.0, "")
        kept = curve.position - 20.0 * np.sin(2.0 * np.pi * 1.0 * time)
        assert 2.0 * np.mean((kept * signal)[200:1801]) == pytest.approx(factor, abs=0.01)


def test_noise_of_the_displacement_is_found_and_hardly_reaches_the_rate():
    noisy = RANDOM + 2e-5 * np.random.default_rng(3).normal(size=TIME.size)
    motion, clean = recorded(noisy), recorded(RANDOM)
    assert motion.noise == pytest.approx(2e-5, rel=0.1)
    assert 12.0 < motion.cutoff < 100.0
    error = np.sqrt(np.mean(np.square(motion.rate - clean.rate)))
    assert error < 0.03 * np.sqrt(np.mean(np.square(clean.rate)))
    differences = np.gradient(noisy, TIME) - clean.rate
    assert error < 0.2 * np.sqrt(np.mean(np.square(differences)))


def test_forces_follow_the_law_and_not_the_measured_force():
    motion = recorded(RANDOM)
    sponge = recorded_deformation(MSTV, motion)[motion.samples]
    expected = damper_tensions(motion.step_rate[motion.samples], sponge, MSTV.packed)
    assert recorded_forces(MSTV, motion) == pytest.approx(expected, rel=1e-12)
