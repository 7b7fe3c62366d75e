"""Steady response against closed forms, time integration and planted folds."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import wofz
from simple_machines import DAMPING, MASS, STIFFNESS, isotropic_machine, unbalance
from threadpoolctl import threadpool_limits

import wm_drake as wm
from wm_drake.engines.compiled.mechanics import DRUM_ANGLE, DRUM_RATE
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile
from wm_drake.simulation.outputs import tub_outputs
from wm_drake.studies.response.balance import HARMONICS, HarmonicBalance
from wm_drake.studies.response.condensed import Corrections
from wm_drake.studies.response.continuation import first_motion, floquet_multipliers, is_stable
from wm_drake.studies.response.response import (
    branch_of,
    coefficients_of,
    settled_trajectory,
    trajectory_of_period,
)
from wm_drake.studies.response.series import Series, write_derivative

RPM = np.pi / 30.0
EXCESS, RADIUS = 0.1, 0.25
"""Mass and radius of the unbalance of the closed forms. [kg, m]"""


@pytest.fixture(scope="module")
def stiff_in_rotation():
    """Return a machine that only translates: a Jeffcott rotor with an elastic foundation."""
    return build_machine(isotropic_machine(rotational_stiffness=1e7))


def jeffcott(speed):
    """Return the complex amplitude of To along z to the rotating unbalance, at phase 0 on z. [m]"""
    mass = MASS + EXCESS
    force = EXCESS * RADIUS * speed**2
    return force / (STIFFNESS - mass * speed**2 + 1j * speed * DAMPING)


def test_response_and_phase_of_one_mass_are_those_of_the_closed_form(stiff_in_rotation):
    setup = stiff_in_rotation.set_up(unbalance(EXCESS))
    balance = HarmonicBalance(setup, Series(3, 32))
    speeds = np.linspace(40.0, 400.0, 25) * RPM
    points = branch_of(balance, setup, speeds)
    assert [p.speed for p in points if p.on_grid] == pytest.approx(list(speeds))
    for point in points:
        cosine, sine = point.coefficients[1], point.coefficients[2]
        wanted = jeffcott(point.speed)
        z, x = cosine[5] - 1j * sine[5], cosine[3] - 1j * sine[3]
        assert abs(z / wanted - 1.0) < 1e-6  # size and phase
        assert abs(x / (-1j * wanted) - 1.0) < 1e-6  # a quarter turn later, towards +x
        assert point.stable


def test_public_function_has_the_closed_form_at_the_sensors(stiff_in_rotation):
    speeds = np.array([90.0, 120.0, 200.0]) * RPM
    found = wm.steady_response(stiff_in_rotation, unbalance(EXCESS), speeds)
    found = found.isel(point=found.on_grid.values)
    wanted = np.abs([jeffcott(speed) for speed in speeds])
    for sensor in ("Xr", "Zf"):
        # 128 samples of a circle miss its top by up to 3e-4
        np.testing.assert_allclose(found.amplitude.sel(sensor=sensor), wanted, rtol=4e-4)
    np.testing.assert_allclose(found.amplitude.sel(sensor="Yr"), 0.0, atol=1e-9)
    assert found.stable.values.all()
    assert found.on_grid.values.all()


def swept_unbalance(time, rate, frequency, damping, ratio):
    """Return the motion of one mass under an unbalance that speeds up from rest at a rate. [m]

        x'' + 2 zeta w x' + w^2 x = -ratio g'',    g = exp(i rate t^2 / 2),    x(0) = x'(0) = 0

    F. M. Lewis, Vibration during acceleration through a critical speed, Trans. ASME 54 (1932). The
    convolution with exp(s t) is a Fresnel integral of complex argument, here by the Faddeeva
    function w: with q = exp(-i pi / 4) sqrt(rate / 2), u = q t + s / (2 q), u0 = s / (2 q),

        E = integral of exp(s (t - tau)) g(tau) d tau
          = sqrt(pi) / (2 q) (exp(s t) w(i u0) - g(t) w(i u))

    In the lower half plane w(z) = 2 exp(-z^2) - w(-z); the first terms cancel if both are there.
    """
    root = np.sqrt(damping**2 - 1.0 + 0j)
    roots = frequency * (-damping + root), frequency * (-damping - root)
    g = np.exp(0.5j * rate * time**2)
    g_rate = 1j * rate * time * g

    def upper_half(z):
        lower = np.imag(z) < 0.0
        return np.where(lower, -1.0, 1.0) * wofz(np.where(lower, -z, z)), lower.astype(float)

    def convolved(s):
        q = np.exp(-0.25j * np.pi) * np.sqrt(0.5 * rate)
        u, u0 = q * time + s / (2.0 * q), s / (2.0 * q)
        first, begins = upper_half(1j * u0)
        second, passed = upper_half(1j * u)
        resonance = 2.0 * (begins - passed) * np.exp(s * time + u0 * u0)
        resonance = np.where(begins == passed, 0.0, resonance)
        e = np.sqrt(np.pi) / (2.0 * q) * (np.exp(s * time) * first - g * second + resonance)
        # two integrations by parts of the convolution with g''
        return g_rate + s * (g - np.exp(s * time)) + s * s * e

    return -ratio * (convolved(roots[0]) - convolved(roots[1])) / (roots[0] - roots[1])


def test_closed_form_of_the_sweep_solves_its_equation():
    """Check the closed form against a numerical solution, before it serves as a check."""
    rate, frequency, damping = 0.7, 12.0, 0.05
    time = np.linspace(0.0, 30.0, 3001)

    def slope(t, y):
        g = np.exp(0.5j * rate * t * t)
        second = (1j * rate - (rate * t) ** 2) * g
        return [y[1], -second - 2.0 * damping * frequency * y[1] - frequency**2 * y[0]]

    solved = solve_ivp(slope, (0.0, 30.0), [0j, 0j], t_eval=time, rtol=1e-10, atol=1e-12)
    wanted = swept_unbalance(time, rate, frequency, damping, 1.0)
    np.testing.assert_allclose(solved.y[0], wanted, atol=1e-6)


@pytest.mark.parametrize("rate_rpm_s", [2.0, 7.0, 20.0])
def test_passage_through_resonance_is_that_of_lewis(stiff_in_rotation, rate_rpm_s):
    rate = rate_rpm_s * RPM
    last = 220.0 * RPM
    profile = SpinProfile(time=(0.0, last / rate), speed=(0.0, last))
    setup = stiff_in_rotation.set_up(unbalance(EXCESS))
    run = run_compiled(setup, profile, 1e-3, lambda fraction: None)
    mass = MASS + EXCESS
    frequency = np.sqrt(STIFFNESS / mass)
    wanted = swept_unbalance(
        run.time,
        rate,
        frequency,
        DAMPING / (2.0 * np.sqrt(STIFFNESS * mass)),
        EXCESS * RADIUS / mass,
    )
    peak = np.max(np.abs(wanted))
    np.testing.assert_allclose(run.state[:, 5], wanted.real, atol=2e-3 * peak)
    size = np.hypot(run.state[:, 3], run.state[:, 5])
    assert size.max() == pytest.approx(peak, rel=0.01)
    speeds = run.state[:, 13]
    at = speeds[np.argmax(np.abs(wanted))]
    assert speeds[np.argmax(size)] == pytest.approx(at, rel=0.01)
    # a sweep passes later and lower than the steady peak
    grid = np.linspace(0.9, 1.1, 2001) * frequency
    assert peak < np.max(np.abs(jeffcott(grid)))
    assert at > grid[np.argmax(np.abs(jeffcott(grid)))]


def amplitudes(setup, trajectory):
    """Return the largest deviation from the mean at each measured point. [m]"""
    displaced = tub_outputs(setup, trajectory)[0]
    return np.abs(displaced - displaced.mean(axis=0)).max(axis=0)


def deviation_from_engine(machine, load, harmonics, speeds, settled):
    """Return the difference of amplitudes over those of the engine, of the largest axis each."""
    setup = machine.set_up(load)
    balance = HarmonicBalance(setup, Series(harmonics, 128))
    points = [p for p in branch_of(balance, setup, speeds) if p.on_grid]
    assert len(points) == len(speeds)
    errors = []
    for point, (wanted, multiplier) in zip(points, settled, strict=True):
        assert point.stable, multiplier
        own = trajectory_of_period(balance, point.coefficients, point.speed, 128)
        found = amplitudes(setup, own)
        errors.append(np.abs(found - wanted) / wanted)
    return np.array(errors)


@pytest.mark.slow
@pytest.mark.parametrize("load", ["middle", "counter", "back", "front"])
def test_harmonic_balance_has_the_amplitudes_of_the_engine(machine, load):
    """Check 10 speeds: within 1 % at every sensor, and not worse than with fewer harmonics.

    Below about 0.2 % the 128 samples of the comparison decide, so the errors need not fall
    strictly.
    """
    speeds = np.linspace(60.0, 400.0, 10) * RPM
    setup = machine.set_up(load)
    settled = [
        (amplitudes(setup, settled_trajectory(setup, speed, 128, round(6.0 * speed))), speed)
        for speed in speeds  # 38 s each
    ]
    largest = {
        harmonics: deviation_from_engine(machine, load, harmonics, speeds, settled).max()
        for harmonics in (3, 5, HARMONICS)
    }
    assert largest[HARMONICS] < 0.01, largest
    assert largest[HARMONICS] < min(largest[5], largest[3]) + 5e-4, largest


def test_harmonic_balance_has_the_amplitudes_of_the_engine_at_some_speeds(machine):
    speeds = np.array([100.0, 250.0]) * RPM
    setup = machine.set_up("front")
    settled = [
        (amplitudes(setup, settled_trajectory(setup, speed, 128, 120)), speed) for speed in speeds
    ]
    assert deviation_from_engine(machine, "front", HARMONICS, speeds, settled).max() < 0.01


@pytest.fixture(scope="module")
def hardening():
    """Return a machine whose bushing hardens along z and x: its response folds over."""
    base = isotropic_machine(damping=12.0)
    displacement = (-0.03, -0.02, -0.01, 0.0, 0.01, 0.02, 0.03)
    table = {
        "displacement": displacement,
        "force": tuple(STIFFNESS * (d + 700.0 * d**3) for d in displacement),
    }
    gasket = base.gasket.model_dump() | {"stiffness_x": table, "stiffness_z": table}
    gasket |= {f"rotational_damping_{axis}": 10.0 for axis in "xyz"}
    return build_machine(type(base).model_validate(base.model_dump() | {"gasket": gasket}))


@pytest.fixture(scope="module")
def folded(hardening):
    """Return setup, balance and branch of a response with folds."""
    setup = hardening.set_up(unbalance(0.25))
    balance = HarmonicBalance(setup, Series(5, 64))
    speeds = np.linspace(90.0, 260.0, 35) * RPM
    return setup, balance, branch_of(balance, setup, speeds)


def test_branch_goes_around_folds_and_is_unstable_between(folded):
    _, _, points = folded
    speeds = np.array([point.speed for point in points])
    stable = np.array([point.stable for point in points])
    back = np.array([point.back for point in points])
    assert back.any()
    assert points[-1].speed == pytest.approx(260.0 * RPM)
    turns = np.flatnonzero(np.diff(back.astype(int)) != 0)
    assert len(turns) == 2  # one fold up, one fold down
    inner = back.copy()
    inner[[turns[0], turns[0] + 1, turns[1], turns[1] + 1]] = False
    assert not stable[inner].any()
    assert stable[~back & (speeds < speeds[back].min())].all()
    assert not stable.all()
    assert stable[-1]


def integrated(balance, start, speed, revolutions, tolerance=1e-6):
    """Return the states after each revolution, from a free state at drum angle 0."""
    derivative = balance.derivative
    state = derivative.rest.copy()

    def slope(t, free):
        state[derivative.free] = free
        state[DRUM_ANGLE], state[DRUM_RATE] = speed * t, speed
        return derivative(state[None])[0, derivative.free]

    period = 2.0 * np.pi / speed
    solved = solve_ivp(
        slope,
        (0.0, revolutions * period),
        start,
        t_eval=period * np.arange(revolutions + 1),
        rtol=tolerance,
        atol=1e-3 * tolerance,
        method="DOP853",
    )
    return solved.y.T


def test_time_integration_holds_stable_motions_and_leaves_unstable_ones(folded):
    _, balance, points = folded
    unstable = max((p for p in points if not p.stable), key=lambda p: p.multiplier)
    same_speed = [
        p for p in points if p.stable and abs(p.speed - unstable.speed) < 0.04 * unstable.speed
    ]
    assert len(same_speed) >= 2  # a lower and an upper branch
    for point, holds in [(unstable, False), *((p, True) for p in same_speed[:1] + same_speed[-1:])]:
        start = balance.series.synthesis[0] @ point.coefficients
        size = balance.extent(point.coefficients[1:3] * 1.0)
        start[[3, 5]] += 0.01 * size
        revolutions = integrated(balance, start, point.speed, 60)
        begin = balance.series.synthesis[0] @ point.coefficients
        away = np.linalg.norm((revolutions - begin) * balance.scale, axis=1)
        assert (away[-1] < 0.5 * away[0]) == holds
        if not holds:
            assert away[-1] > 5.0 * away[0]


def revolutions_of(balance, start, speed, count, steps=256):
    """Return the states after each revolution by RK4, from free states (n, size) at angle 0."""
    derivative = balance.derivative
    states = np.tile(derivative.rest, (len(start), 1))
    states[:, DRUM_RATE] = speed
    step = 2.0 * np.pi / speed / steps

    def rate(angle, free):
        states[:, derivative.free], states[:, DRUM_ANGLE] = free, angle
        return derivative(states)[:, derivative.free]

    here, ended = np.array(start), [np.array(start)]
    for _ in range(count):
        for number in range(steps):
            angle, half = 2.0 * np.pi * number / steps, 0.5 * step
            first = rate(angle, here)
            second = rate(angle + speed * half, here + half * first)
            third = rate(angle + speed * half, here + half * second)
            fourth = rate(angle + speed * step, here + step * third)
            here = here + step / 6.0 * (first + 2.0 * (second + third) + fourth)
        ended.append(here)
    return np.array(ended)


def test_a_machine_without_gasket_leaves_its_unstable_motions_and_keeps_its_stable_ones(sponges):
    """Check load middle with sponges: unstable from 200 to 270 rpm.

    A run that starts on the harmonic balance misses the motion by the cut harmonics, 0.03 mm. This
    distance stays on a stable motion and grows on an unstable one.
    """
    setup = build_machine(sponges).set_up("middle", gasket=False)
    balance = HarmonicBalance(setup, Series(HARMONICS, 128))
    with threadpool_limits(1, "blas"):
        points = branch_of(balance, setup, np.linspace(160.0, 300.0, 15) * RPM)
    unstable = max(points, key=lambda point: point.multiplier)
    assert 215.0 <= unstable.speed / RPM <= 230.0
    for point, count in ((points[2], 20), (unstable, 40), (points[-2], 20)):
        begin = balance.series.synthesis[0] @ point.coefficients
        states = revolutions_of(balance, [begin], point.speed, count)[:, 0]
        away = np.linalg.norm((states - begin) * balance.scale, axis=1)
        assert away[1] < 3e-5
        assert point.stable == (away[-1] < 1.2 * away[1])
        if point is unstable:
            assert away[-1] > 10.0 * away[1]
    step = 1e-6 * np.eye(balance.size)
    begin = balance.series.synthesis[0] @ unstable.coefficients
    ends = revolutions_of(balance, [*(begin + step), *(begin - step)], unstable.speed, 1, 512)[-1]
    change = (ends[: balance.size] - ends[balance.size :]).T / 2e-6
    largest = np.abs(np.linalg.eigvals(change)).max()
    assert unstable.multiplier == pytest.approx(largest, rel=3e-3)
    assert largest > 1.1


def test_harmonics_converge_in_length_where_one_amplitude_does_not(machine):
    """Check load back: one sensor is worse with 5 harmonics than with 3; the motion is better."""
    setup, speeds = machine.set_up("back"), np.array([78.0, 96.0]) * RPM
    motions = {}
    with threadpool_limits(1, "blas"):
        for order in (3, 5, 7, 11):
            balance = HarmonicBalance(setup, Series(order, 128))
            points = [point for point in branch_of(balance, setup, speeds) if point.on_grid]
            motions[order] = np.array([point.coefficients[:7, :6] for point in points])
    errors = [np.abs(motions[order] - motions[11]).max() for order in (3, 5, 7)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.6 * errors[0]


def test_floquet_multipliers_are_those_of_the_map_of_a_revolution(folded):
    """Compare with differences of time integrations over one revolution."""
    _, balance, points = folded
    point = points[10]
    begin = balance.series.synthesis[0] @ point.coefficients
    step = 1e-5
    columns = [
        (
            integrated(balance, begin + step * unit, point.speed, 1, 1e-11)[-1]
            - integrated(balance, begin - step * unit, point.speed, 1, 1e-11)[-1]
        )
        / (2.0 * step)
        for unit in np.eye(balance.size)
    ]
    wanted = np.sort(np.abs(np.linalg.eigvals(np.column_stack(columns))))
    phase = 2.0 * np.pi * np.arange(2048) / 2048
    _, slopes = balance.derivative.with_slopes(
        balance.states(point.coefficients, point.speed, phase)
    )
    found = np.sort(np.abs(floquet_multipliers(slopes, 2.0 * np.pi / point.speed)))
    np.testing.assert_allclose(found[-4:], wanted[-4:], rtol=5e-3)


def test_multipliers_of_a_constant_matrix_are_its_exponentials():
    matrix = np.array([[0.0, 1.0], [-4.0, -0.3]])
    slopes = np.tile(matrix.T, (512, 1, 1))  # by each number: transposed
    found = np.sort_complex(floquet_multipliers(slopes, 1.7))
    wanted = np.sort_complex(np.exp(1.7 * np.linalg.eigvals(matrix)))
    np.testing.assert_allclose(found, wanted, rtol=1e-4)
    assert is_stable(found)
    assert not is_stable(np.array([1.2, 0.3]))


def test_falling_speeds_give_the_same_motions(machine):
    speeds = np.linspace(100.0, 200.0, 6) * RPM
    up = wm.steady_response(machine, "front", speeds)
    down = wm.steady_response(machine, "front", speeds[::-1])
    up, down = (found.isel(point=found.on_grid.values) for found in (up, down))
    # at 160 rpm a sample is at a reversal of friction, where whole corrections do not converge
    assert [found.sizes["point"] for found in (up, down)] == [6, 6]
    assert up.stable.values.all()
    assert down.stable.values.all()
    np.testing.assert_allclose(down.amplitude.values[::-1], up.amplitude.values, rtol=1e-5)


def test_series_of_samples_gives_the_coefficients_back():
    series = Series(4, 32)
    rng = np.random.default_rng(3)
    coefficients = rng.normal(size=(series.size, 2))
    np.testing.assert_allclose(
        series.analysis @ (series.synthesis @ coefficients), coefficients, atol=1e-13
    )
    step = 1e-6
    ahead, back = series.at(series.phase + step), series.at(series.phase - step)
    np.testing.assert_allclose(
        series.synthesis @ series.slope, (ahead - back) / (2.0 * step), atol=1e-7
    )


def test_matrix_is_the_derivative_of_the_residual(machine):
    balance = HarmonicBalance(machine.set_up("front"), Series(2, 32))
    speed = 150.0 * RPM
    motion = first_motion(balance, speed, iter([balance.rest()]))
    at = balance.linearised(motion, speed)
    rng = np.random.default_rng(1)
    change = rng.normal(size=motion.shape) * np.where(balance.derivative.is_velocity, 1e-6, 1e-7)
    ahead, back = balance.residual(motion + change, speed), balance.residual(motion - change, speed)
    wanted = 0.5 * (ahead - back).ravel()
    np.testing.assert_allclose(
        np.tensordot(balance.matrix(at.slopes, speed), change, 2).ravel(),
        wanted,
        atol=2e-3 * np.max(np.abs(wanted)),
    )
    faster, slower = balance.residual(motion, speed + 1e-5), balance.residual(motion, speed - 1e-5)
    by_speed = (faster - slower) / 2e-5
    np.testing.assert_allclose(at.by_speed, by_speed, atol=1e-3 * np.max(np.abs(by_speed)))


@pytest.mark.parametrize(
    ("speeds", "options", "word"),
    [
        ([10.0], {}, "at least two"),
        ([10.0, 5.0, 7.0], {}, "rise or fall"),
        ([0.0, 5.0], {}, "above 0"),
        ([10.0, float("nan")], {}, "rise or fall"),
        ([10.0, 20.0], {"harmonics": 0}, "not between 1"),
        ([10.0, 20.0], {"harmonics": 9, "samples": 18}, "not above 18"),
    ],
)
def test_wrong_arguments_are_refused(machine, speeds, options, word):
    with pytest.raises(InputError, match=word):
        wm.steady_response(machine, "front", speeds, **options)


@pytest.mark.slow
def test_telescopic_dampers_move_as_the_engine_moves_them():
    """Check the free-stroke machine: nothing holds the spin of its tubes about their axes."""
    machine = build_machine(wm.load_machine("free_stroke"))
    setup = machine.set_up("front")
    speeds = np.array([100.0, 110.0]) * RPM
    balance = HarmonicBalance(setup, Series(3, 64))
    assert len(balance.kinematics.spins) == 3
    points = [p for p in branch_of(balance, setup, speeds) if p.on_grid]
    assert len(points) == 2
    assert all(point.stable for point in points)
    engine = settled_trajectory(setup, speeds[1], 128, 60)
    own = trajectory_of_period(balance, points[1].coefficients, speeds[1], 128)
    np.testing.assert_allclose(amplitudes(setup, own), amplitudes(setup, engine), rtol=2e-3)


@pytest.mark.slow
def test_response_follows_dampers_that_spin():
    """Check 200 rpm, where the left damper turns by a degree in a revolution of the drum.

    The engine never settles: its amplitudes follow the angles of the dampers. At each of these
    angles the harmonic balance has the same amplitudes.
    """
    machine = build_machine(wm.load_machine("free_stroke"))
    setup, speed = machine.set_up("front"), 200.0 * RPM
    balance = HarmonicBalance(setup, Series(HARMONICS, 128))
    sizes = []
    for revolutions in (71, 271, 371):
        engine = settled_trajectory(setup, speed, 128, revolutions)
        begin = coefficients_of(balance, engine)
        with threadpool_limits(1, "blas"):
            motion = first_motion(balance, speed, iter([begin]))
        own = trajectory_of_period(balance, motion, speed, 128)
        sizes.append(amplitudes(setup, engine))
        large = sizes[-1] > 1e-3
        np.testing.assert_allclose(amplitudes(setup, own)[large], sizes[-1][large], rtol=1e-3)
        rates = balance.derivative(balance.states(motion, speed))[:, balance.derivative.free]
        spins = balance.kinematics.spin_rates(motion[0], rates.mean(axis=0))
        assert 0.5 < 360.0 * abs(spins[0]) / speed < 3.0
    assert np.ptp(sizes, axis=0).max() > 0.05e-3  # they vary by 0.8 % of 12 mm


def test_telescopic_dampers_begin_at_any_speed():
    """Check a first speed at which a sample is at a reversal of friction."""
    machine = build_machine(wm.load_machine("free_stroke"))
    balance = HarmonicBalance(machine.set_up("front"), Series(3, 64))
    setup = machine.set_up("front")
    with threadpool_limits(1, "blas"):
        points = branch_of(balance, setup, np.array([200.0, 202.0]) * RPM)
    assert points[0].speed == pytest.approx(200.0 * RPM)
    assert len(points[0].spins) == 3


def test_condensed_corrections_are_those_of_the_whole_system(machine):
    """Compare with a dense solution of the bordered system."""
    balance = HarmonicBalance(machine.set_up("front"), Series(2, 32))
    speed = 150.0 * RPM
    rng = np.random.default_rng(2)
    at = balance.linearised(balance.rest() + 1e-4 * rng.normal(size=balance.rest().shape), speed)
    row = rng.normal(size=at.residual.shape)
    row[:, balance.kinematics.partition.velocities] = 0.0
    size = row.size
    matrix = balance.matrix(at.slopes, speed).reshape(size, size)
    whole = np.block([[matrix, at.by_speed.reshape(-1, 1)], [row.reshape(1, -1), 0.3]])
    wanted = np.linalg.solve(whole, np.append(-at.residual.ravel(), 0.7))
    change, faster = Corrections(balance, at, row, 0.3)(at.residual, 0.7)
    np.testing.assert_allclose(change.ravel(), wanted[:-1], rtol=1e-6, atol=1e-9)
    assert faster == pytest.approx(wanted[-1], rel=1e-6)


def test_matrix_of_products_multiplies_series():
    """Compare with the product of samples; with few samples harmonics fold alike."""
    rng = np.random.default_rng(4)
    one = np.zeros(1, dtype=int)
    for samples in (7, 9, 32):
        series = Series(3, samples)
        factor, coefficients = rng.normal(size=(samples, 1, 1)), rng.normal(size=7)
        matrix = np.empty((7, 7))
        held = np.ones(1, dtype=bool)
        write_derivative(series.factors(factor), one, one, 2.0, held, 0.3, matrix)
        wanted = 2.0 * series.slope @ coefficients
        wanted -= series.analysis @ (factor[:, 0, 0] * (series.synthesis @ coefficients))
        wanted[0] += 0.3 * coefficients[0]
        np.testing.assert_allclose(matrix @ coefficients, wanted, atol=1e-12)
