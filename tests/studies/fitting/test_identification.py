"""The core of identification on functions of known answer."""

import numpy as np
import pytest
from scipy.optimize import curve_fit

from wm_drake.errors import InputError
from wm_drake.parameters.units import Unit
from wm_drake.studies.fitting.assessment import assess, correlation_time
from wm_drake.studies.fitting.fit import SearchLog
from wm_drake.studies.fitting.methods import METHODS, identify
from wm_drake.studies.fitting.page import estimates_of
from wm_drake.studies.fitting.problem import FitProblem, Measurement, Unknown
from wm_drake.studies.fitting.surfaces import (
    QuadraticSurface,
    SurfaceRegion,
    surface_design,
)

TIME = np.linspace(0.0, 2.0, 200)
TRUTH = np.array([2.0, 1.5, 0.7])
UNKNOWNS = (
    Unknown("a", 0.0, 10.0),
    Unknown("b", 0.1, 10.0, logarithmic=True),
    Unknown("c", 0.0, 5.0),
)


def decay_and_swing(points):
    a, b, c = points.T[:, :, None]
    return a * np.exp(-b * TIME) + c * np.sin(3.0 * TIME)


def planted(noise=0.0, seed=0, **fields):
    values = decay_and_swing(TRUTH[None])[0] + noise * np.random.default_rng(seed).normal(
        size=TIME.size
    )
    return FitProblem(UNKNOWNS, (Measurement("swing", values, **fields),), decay_and_swing)


@pytest.mark.parametrize("method", METHODS)
def test_planted_numbers_are_found(method):
    fit = identify(planted(), method)
    assert fit.values == pytest.approx(TRUTH, rel=1e-4)
    assert fit.rmse < 1e-6
    assert all(estimate.determined and not estimate.at_bound for estimate in fit.estimates)
    assert list(fit.log.history) == sorted(fit.log.history, reverse=True)


@pytest.mark.parametrize("method", METHODS)
def test_the_same_seed_gives_the_same_fit_and_progress_ends_at_one(method):
    told = []
    first, second = (
        identify(
            planted(0.05), method, seed=0, progress=lambda done, least: told.append((done, least))
        )
        for _ in range(2)
    )
    assert np.array_equal(first.values, second.values)
    assert first.estimates == second.estimates
    assert first.log == second.log
    assert told[-1][0] == 1.0
    assert all(0.0 <= done <= 1.0 for done, _ in told)


@pytest.mark.parametrize(
    "method",
    [
        pytest.param(name, marks=pytest.mark.slow if name == "response-surface" else ())
        for name in METHODS
    ],
)
def test_intervals_hold_the_truth_in_95_of_100_noisy_repeats(method):
    inside = np.zeros(3)
    for seed in range(100):
        fit = identify(planted(0.05, seed), method, seed=seed)
        inside += [
            e.lower <= truth <= e.upper for e, truth in zip(fit.estimates, TRUTH, strict=True)
        ]
    assert inside.min() >= 90
    assert inside.max() <= 99  # they are not simply wide


def straight_valley(p):
    """Return a valley of p combinations, of which one moves the measurement a hundredth as much."""
    axes = np.linalg.qr(np.random.default_rng(0).normal(size=(p, p)))[0]
    strength = np.where(np.arange(p) == 0, 0.01, 1.0)
    unknowns = tuple(Unknown(f"x{k}", 0.0, 2.0, start=1.8) for k in range(p))
    measured = (Measurement("zero", np.zeros(p)),)
    return FitProblem(unknowns, measured, lambda x: np.sinh((1.5 * (x - 1.0)) @ axes * strength))


def bent_valley(p):
    """Return Rosenbrock's valley, whose floor is ten times flatter than its sides; least at 1."""
    unknowns = tuple(Unknown(f"x{k}", -2.0, 2.0, start=(-1.2, 1.0)[k % 2]) for k in range(p))
    measured = (Measurement("zero", np.zeros(2 * (p - 1))),)
    model = lambda x: np.concatenate([10.0 * (x[:, 1:] - x[:, :-1] ** 2), 1.0 - x[:, :-1]], axis=1)  # noqa: E731
    return FitProblem(unknowns, measured, model)


@pytest.mark.parametrize("problem", [straight_valley(9), bent_valley(2), bent_valley(4)])
def test_response_surfaces_come_to_the_end_of_narrow_valleys(problem):
    fit = identify(problem, "response-surface")
    assert fit.values == pytest.approx(np.ones(len(problem.unknowns)), abs=1e-4)
    assert "had not come to an end" not in fit.log.notes[-1]


def test_points_of_a_region_keep_to_the_ranges_and_fill_it():
    rng = np.random.default_rng(4)
    for p in (1, 2, 5):
        design = surface_design(p)
        for _ in range(50):
            axes = np.linalg.qr(rng.normal(size=(p, p)))[0] * rng.uniform(0.01, 0.5, p)
            region = SurfaceRegion(
                rng.uniform(0.0, 1.0, p).round(), 0.0, axes
            )  # its centre is a corner of the ranges
            points = region.designed(design)
            assert points.min() >= 0.0
            assert points.max() <= 1.0
            assert region.points(region.places(points)) == pytest.approx(points, abs=1e-12)
            gradient = rng.normal(size=p)
            least = QuadraticSurface(
                region.places(points), region.places(points) @ gradient, 0.0
            ).least_place(region)
            inside = region.centre + least @ region.axes.T
            assert inside == pytest.approx(np.clip(inside, 0.0, 1.0), abs=1e-6)
            assert np.abs(least).max() <= 1.0


def tone(phase=0.7):
    """Return the fit of a tone, whose frequency has many local minima."""
    model = lambda x: x[:, :1] * np.sin(x[:, 1:2] * TIME + x[:, 2:3])  # noqa: E731
    unknowns = (
        Unknown("amplitude", 0.0, 5.0),
        Unknown("frequency", 1.0, 60.0),
        Unknown("phase", 0.0, 3.0),
    )
    return FitProblem(
        unknowns, (Measurement("tone", model(np.array([[2.0, 23.0, phase]]))[0]),), model
    )


@pytest.mark.parametrize("seed", range(5))
def test_evolution_finds_a_frequency_among_many_minima(seed):
    fit = identify(tone(), "evolution", seed=seed)
    assert fit.values == pytest.approx([2.0, 23.0, 0.7], rel=1e-4)
    assert "2 came to the same least RMSE" in fit.log.notes[0]


def test_a_search_that_had_not_come_to_an_end_claims_no_interval():
    fit = identify(planted(0.05), "response-surface", rounds=2)
    assert all(np.isnan([estimate.lower, estimate.upper]).all() for estimate in fit.estimates)
    assert np.isnan(fit.covariance).all()
    assert "had not come to an end" in fit.log.notes[-1]
    assert all(np.isnan([e.lower, e.upper]).all() for e in fit.estimates)


def test_covariance_is_that_of_scipys_curve_fit():
    fit = identify(planted(0.05))
    values, covariance = curve_fit(
        lambda _, *x: decay_and_swing(np.array([x]))[0],
        TIME,
        fit.problem.measurements[0].values,
        [1.0, 1.0, 1.0],
        xtol=1e-12,
    )
    assert fit.values == pytest.approx(values, rel=1e-5)
    assert fit.covariance == pytest.approx(covariance, rel=1e-3)


def test_rmse_per_test_is_absolute_and_normalised_by_the_largest_measured_value():
    problem = FitProblem(
        (Unknown("level", 0.0, 10.0),),
        (
            Measurement("low", np.array([1.0, 3.0])),
            Measurement("high", np.array([4.0, 4.0, 4.0, 4.0])),
        ),
        lambda points: np.repeat(points, 6, axis=1),
    )
    fit = identify(problem)
    assert fit.values[0] == pytest.approx(20.0 / 6.0, rel=1e-6)  # mean of all six
    low, high = fit.tests
    assert low.rmse == pytest.approx(np.sqrt(np.mean(np.square(np.array([1.0, 3.0]) - 20.0 / 6.0))))
    assert low.normalised == pytest.approx(low.rmse / 3.0)
    assert high.normalised == pytest.approx((2.0 / 3.0) / 4.0)


@pytest.mark.parametrize("method", METHODS)
def test_what_the_data_cannot_determine_is_named(method):
    """Measure a + b alone; c does not count at all."""
    unknowns = (
        Unknown("a", 0.0, 10.0),
        Unknown("b", 0.0, 10.0),
        Unknown("c", 0.0, 5.0),
        Unknown("d", 0.0, 5.0),
    )
    measured = Measurement("line", np.concatenate([3.0 * TIME, [2.0]]))
    model = lambda x: np.concatenate([(x[:, :1] + x[:, 1:2]) * TIME, x[:, 3:]], axis=1)  # noqa: E731
    fit = identify(FitProblem(unknowns, (measured,), model), method)
    assert {frozenset(direction.names) for direction in fit.undetermined} == {
        frozenset("ab"),
        frozenset("c"),
    }
    (both,) = (direction for direction in fit.undetermined if set(direction.names) == {"a", "b"})
    assert both.parts[0] == pytest.approx(-both.parts[1], rel=1e-3)
    assert [estimate.determined for estimate in fit.estimates] == [False, False, False, True]
    assert np.isnan(estimates_of(fit).value.sel(unknown="c"))
    assert fit["d"].value == pytest.approx(2.0, rel=1e-4)


def test_an_unknown_that_came_to_a_bound_by_chance_is_not_said_to_have_hit_it():
    unknowns = (Unknown("seen", 0.0, 10.0), Unknown("unseen", 0.0, 5.0, start=5.0))
    problem = FitProblem(unknowns, (Measurement("line", 3.0 * TIME),), lambda x: x[:, :1] * TIME)
    fit = identify(problem, "least-squares")
    assert (fit["unseen"].at_bound, fit["unseen"].determined) == ("", False)


def test_a_bound_that_is_hit_is_told_and_claims_no_interval():
    unknowns = (Unknown("a", 0.0, 1.0), UNKNOWNS[1], UNKNOWNS[2])
    fit = identify(FitProblem(unknowns, planted().measurements, decay_and_swing))
    assert fit["a"].at_bound == "upper"
    assert fit["a"].value == pytest.approx(1.0, abs=1e-3)
    assert np.isnan(fit["a"].lower)
    assert np.isfinite(fit["b"].lower)


def test_offset_and_drift_of_the_instrument_are_taken_out():
    problem = planted()
    spoilt = problem.measurements[0].values + 5.0 - 3.0 * TIME
    baseline = np.stack([np.ones_like(TIME), TIME], axis=1)
    fit = identify(FitProblem(UNKNOWNS, (Measurement("swing", spoilt, baseline),), decay_and_swing))
    assert fit.values == pytest.approx(TRUTH, rel=1e-6)
    assert fit.baselines[0] == pytest.approx([5.0, -3.0], rel=1e-6)
    assert fit.computed == pytest.approx(spoilt, abs=1e-6)


def test_a_model_that_fails_in_places_is_searched_elsewhere():
    def fails_above_four(points):
        return np.where(points[:, :1] > 4.0, np.nan, decay_and_swing(points))

    for method in METHODS:
        fit = identify(FitProblem(UNKNOWNS, planted().measurements, fails_above_four), method)
        assert fit.values == pytest.approx(TRUTH, rel=1e-4)


@pytest.mark.parametrize("slope", [1.0, -1.0])
def test_an_unknown_that_the_data_limit_to_one_side_is_not_determined(slope):
    """End at the corner beyond which the unknown has no effect, or anywhere beyond it."""
    corner, unknowns = 0.655, (Unknown("level", 0.0, 2.0), Unknown("limit", 0.0, 1.0))

    def model(points):
        beyond = np.maximum(slope * (points[:, 1] - corner), 0.0)
        return points[:, :1] + beyond[:, None] * TIME

    problem = FitProblem(unknowns, (Measurement("m", np.ones(200)),), model)
    for limit in (corner, corner - slope * 0.2):
        fit = assess(problem, np.array([0.5, limit]), SearchLog(""))
        assert fit["level"].determined
        assert not fit["limit"].determined
        assert [direction.names for direction in fit.undetermined] == [("limit",)]


def test_correlated_samples_claim_less():
    rng = np.random.default_rng(0)
    noise = np.convolve(rng.normal(size=2040), np.ones(40) / 40.0, "valid")[:2000]
    values = 3.0 + noise
    widths = {}
    for errors in ("alike", "correlated"):
        problem = FitProblem(
            (Unknown("mean", 0.0, 10.0),),
            (Measurement("m", values, errors=errors),),
            lambda x: np.repeat(x, 2000, 1),
        )
        fit = identify(problem)
        widths[errors] = fit["mean"].upper - fit["mean"].lower
    assert (
        4.0 < widths["correlated"] / widths["alike"] < 9.0
    )  # root of 40 samples that move together


def coverage_of_line(errors, repeats=300):
    """Return how often the interval of a slope holds it, with an error of 2 % of each value."""
    x = np.geomspace(0.02, 2.0, 60)  # a few large values, which determine the slope
    rng, hits = np.random.default_rng(8), 0
    for _ in range(repeats):
        values = 1.5 * x * (1.0 + 0.02 * rng.standard_normal(x.size))
        test = Measurement("line", values, errors=errors)
        problem = FitProblem((Unknown("slope", 1.0, 2.0),), (test,), lambda points: points * x)
        slope = float(values @ x / (x @ x))
        fit = assess(problem, problem.coordinates_of(np.array([slope])), SearchLog("by hand"))
        hits += fit["slope"].lower <= 1.5 <= fit["slope"].upper
    return hits / repeats


def test_errors_that_grow_with_the_values_widen_the_interval_so_that_it_holds():
    assert 0.92 < coverage_of_line("each") < 0.98
    assert coverage_of_line("alike") < 0.85


def test_correlation_time_of_white_noise_is_one():
    assert correlation_time(np.random.default_rng(1).normal(size=4000)) == pytest.approx(
        1.0, abs=0.05
    )
    assert correlation_time(np.zeros(50)) == 1.0


@pytest.mark.parametrize("p", [1, 2, 3, 5])
def test_a_quadratic_is_its_own_surface(p):
    rng = np.random.default_rng(p)
    root = rng.normal(size=(p, p))
    hessian, least = root @ root.T + np.eye(p), rng.uniform(-0.5, 0.5, p)

    def value(x):
        return 2.0 + 0.5 * np.einsum("ki,ij,kj->k", x - least, hessian, x - least)

    design = surface_design(p)
    assert len(design) >= p + p * (p + 1) // 2
    surface = QuadraticSurface(design, value(design), float(value(np.zeros((1, p)))[0]))
    assert surface.hessian == pytest.approx(hessian, abs=1e-9)
    assert surface.least_place(
        SurfaceRegion(np.full(p, 0.5), 0.0, 0.1 * np.eye(p))
    ) == pytest.approx(least, abs=1e-4)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Unknown("k", 2e3, 1e3, Unit("N/m", "N/mm")), "k: bounds 2 N/mm to 1 N/mm are not a range"),
        (lambda: Unknown("k", 0.0, np.inf, Unit("N", "N")), "k: bounds 0 N to inf are not a range"),
        (lambda: Unknown("k", 0.0, 1.0, logarithmic=True), "k: a logarithmic search needs a lower bound > 0"),
        (lambda: Unknown("k", 0.0, 1.0, Unit("N", "N"), start=2.0), "k: start 2 N is outside the bounds"),
        (lambda: FitProblem((), (), decay_and_swing), "an identification needs at least one measurement"),
        (lambda: FitProblem((UNKNOWNS[0],) * 2, planted().measurements, decay_and_swing), "a: is unknown twice"),
        (lambda: identify(planted(), "leastsquares"), "--method: no method 'leastsquares' (did you mean 'least-squares'?"),
    ],
)  # fmt: skip
def test_bad_input_is_told(make, message):
    with pytest.raises(InputError) as told:
        make()
    assert str(told.value).startswith(message)


SPEED = np.linspace(-1.0, 1.0, 200)
STV = (
    Unknown("friction", 0.0, 20.0),
    Unknown("transition", 0.001, 2.0, logarithmic=True),
    Unknown("damping", 0.01, 100.2, logarithmic=True),
)


def stv(points):
    friction, transition, damping = points.T[:, :, None]
    return friction * np.clip(SPEED / transition, -1.0, 1.0) + damping * SPEED


@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize(
    ("friction", "transition"),
    [
        (0.13, 2.0),  # transition and damping within AT_BOUND of theirs
        (0.13, 1.4),
        (0.3, 1.0),  # the corner, where the fastest sample just has full friction
        (0.0, 2.0),
        (0.0, 1.0),
        (14.0, 1.0),
        (20.0, 1.5),
        (20.0, 2.0),
    ],
)
def test_wherever_a_search_ends_in_a_flat_valley_nothing_of_it_is_claimed(
    friction, transition, noise
):
    """Measure a dashpot: friction that is never full is a dashpot too."""
    values = 100.0 * SPEED + noise * np.random.default_rng(0).normal(size=SPEED.size)
    problem = FitProblem(STV, (Measurement("dashpot", values),), stv)
    end = problem.coordinates_of(np.array([friction, transition, 100.0 - friction / transition]))
    fit = assess(problem, end, SearchLog(""))
    for estimate in fit.estimates:
        assert not estimate.determined
        assert estimate.at_bound == ""
        assert np.isnan([estimate.lower, estimate.upper]).all()
