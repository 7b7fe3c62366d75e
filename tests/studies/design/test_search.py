"""Search for Pareto fronts: test functions with known fronts, and a two-mass oscillator."""

import numpy as np
import pytest

pytest.importorskip("pymoo")

from wm_drake.studies.design.search import Problem, SearchSettings, hypervolume, search_front
from wm_drake.studies.design.surrogate import search_with_surfaces


def zdt1(x):
    g = 1.0 + 9.0 * np.mean(x[:, 1:], axis=1)
    f = np.column_stack([x[:, 0], g * (1.0 - np.sqrt(x[:, 0] / g))])
    return f, np.empty((len(x), 0))


def zdt2(x):
    g = 1.0 + 9.0 * np.mean(x[:, 1:], axis=1)
    return np.column_stack([x[:, 0], g * (1.0 - (x[:, 0] / g) ** 2)]), np.empty((len(x), 0))


@pytest.mark.parametrize(
    ("problem", "front"),
    [(zdt1, lambda f: 1.0 - np.sqrt(f)), (zdt2, lambda f: 1.0 - f**2)],
    ids=["ZDT1", "ZDT2"],
)
def test_front_of_zdt(problem, front):
    found = search_front(Problem(problem, np.full(6, 0.5), 2), SearchSettings(6400, seed=1))
    f = found.objectives
    above = f[:, 1] - front(f[:, 0])
    assert above.min() >= -1e-12
    assert np.quantile(above, 0.9) < 0.01
    assert f[:, 0].min() < 0.02
    assert f[:, 0].max() > 0.98
    assert len(f) > 30
    volumes = [volume for _, volume in found.history]
    assert volumes[-1] > volumes[0]
    assert found.evaluations == 6400


def test_search_evaluates_exactly_as_many_designs_as_wanted():
    asked = []

    def counted(x):
        asked.append(len(x))
        return zdt1(x)

    found = search_front(Problem(counted, np.full(6, 0.5), 2), SearchSettings(100, 64))
    assert (asked, found.evaluations) == ([64, 36], 100)
    assert found.history[-1][0] == 100


def circle(x):
    """Return (x, y) outside a circle about 0: the front is its arc."""
    return x, 0.64 - np.sum(x**2, axis=1, keepdims=True)


def test_constrained_front():
    found = search_front(Problem(circle, np.ones(2), 2, 1), SearchSettings(4000))
    radius = np.hypot(*found.objectives.T)
    assert radius.min() >= 0.8 - 1e-12
    assert np.quantile(radius, 0.9) == pytest.approx(0.8, abs=0.01)
    assert (found.constraints <= 0.0).all()
    assert found.objectives.min(axis=0) == pytest.approx([0.0, 0.0], abs=0.02)


def test_three_objectives_on_a_sphere():
    # DTLZ2: the front is the unit sphere
    def dtlz2(x):
        r = 1.0 + np.sum((x[:, 2:] - 0.5) ** 2, axis=1)
        a, b = 0.5 * np.pi * x[:, 0], 0.5 * np.pi * x[:, 1]
        f = [np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)]
        return r[:, None] * np.column_stack(f), np.empty((len(x), 0))

    found = search_front(Problem(dtlz2, np.full(5, 0.3), 3), SearchSettings(4000, population=60))
    assert np.linalg.norm(found.objectives, axis=1) == pytest.approx(1.0, abs=0.05)


def test_best_damper_of_two_masses():
    # Den Hartog, Mechanical Vibrations: a damper mass mu M on a spring makes the largest response
    # of an undamped mass M smallest at f = 1 / (1 + mu), c = 2 m_a w_a zeta with
    # zeta^2 = 3 mu / (8 (1 + mu)); its response at both fixed points is then sqrt(1 + 2 / mu)
    mu, ratio = 0.1, np.linspace(0.5, 1.5, 600)

    def response(x):
        f, zeta = 0.7 + 0.6 * x[:, :1], 0.02 + 0.4 * x[:, 1:2]
        s = 2j * zeta * f * ratio
        inner = f**2 - ratio**2 + s
        size = np.abs(inner / ((1.0 - ratio**2) * inner - mu * ratio**2 * (f**2 + s)))
        return size.max(axis=1, keepdims=True), np.empty((len(x), 0))

    found = search_front(Problem(response, np.array([0.1, 0.9]), 1), SearchSettings(4000))
    (x,) = found.designs[:1]
    assert 0.7 + 0.6 * x[0] == pytest.approx(1.0 / 1.1, rel=0.01)
    assert 0.02 + 0.4 * x[1] == pytest.approx(np.sqrt(3.0 * mu / (8.0 * 1.1)), rel=0.03)
    assert found.objectives[0, 0] == pytest.approx(np.sqrt(1.0 + 2.0 / mu), rel=0.01)


def test_same_seed_gives_the_same_front_and_another_not():
    fronts = [
        search_front(Problem(zdt1, np.full(3, 0.5), 2), SearchSettings(320, seed=seed)).objectives
        for seed in (0, 0, 1)
    ]
    assert np.array_equal(fronts[0], fronts[1])
    assert not np.array_equal(fronts[0], fronts[2])


@pytest.mark.parametrize("search", [search_front, search_with_surfaces])
def test_designs_that_cannot_run_are_not_on_the_front(search):
    def half(x):
        f, g = zdt1(x)
        return np.where(x[:, :1] < 0.5, np.nan, f), g

    found = search(Problem(half, np.full(3, 0.9), 2), SearchSettings(64, population=32))
    assert len(found.designs)
    assert (found.designs[:, 0] >= 0.5).all()


def test_hypervolume_of_known_points():
    first = np.array([[0.0, 0.0], [2.0, 4.0]])
    # scaled to (0.25, 0.5) and (0.5, 0.25): two boxes of 3/4 x 1/2 and 1/2 x 3/4, overlap 1/2 x 1/2
    front = np.array([[0.5, 2.0], [1.0, 1.0]])
    assert hypervolume(front, first) == pytest.approx(0.375 + 0.375 - 0.25)


@pytest.mark.parametrize(
    ("problem", "size", "constraints"), [(zdt1, 6, 0), (circle, 2, 1)], ids=["ZDT1", "circle"]
)
def test_surfaces_need_fewer_designs(problem, size, constraints):
    whole = Problem(problem, np.full(size, 0.9), 2, constraints)
    genetic = search_front(whole, SearchSettings(256, 32, seed=1))
    found = search_with_surfaces(whole, SearchSettings(96, 32, seed=1))
    # both scale with the same first population, so that hypervolumes can be compared
    assert np.array_equal(found.first, genetic.first)
    assert found.hypervolume > genetic.hypervolume
    assert found.evaluations == 96
    assert [count for count, _ in found.history] == [32, 48, 64, 80, 96]
    f, g = problem(found.designs)
    assert f == pytest.approx(found.objectives)
    assert (g <= 0.0).all()


def test_surfaces_find_the_front_of_zdt1_again_with_the_same_seed():
    arguments = Problem(zdt1, np.full(6, 0.9), 2), SearchSettings(112, 32, seed=2)
    found, again = (search_with_surfaces(*arguments) for _ in range(2))
    above = found.objectives[:, 1] - (1.0 - np.sqrt(found.objectives[:, 0]))
    assert above.min() >= -1e-12
    assert np.quantile(above, 0.9) < 0.02
    assert np.array_equal(found.designs, again.designs)
