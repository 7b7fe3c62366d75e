"""Study of drawings: the surface finds what is planted, drawings change as said, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats.qmc import LatinHypercube

import wm_drake as wm
from wm_drake.errors import InputError
from wm_drake.parameters.gasket_drawing import load_gasket_drawing
from wm_drake.studies.gasket_geometry.drawings import changed, factors_of, with_folds
from wm_drake.studies.gasket_geometry.study import GAP, excess, fit, ranked

SAMPLE = 2.0 * LatinHypercube(4, rng=3).random(4096) - 1.0
"""Even levels, over which variances are taken."""


def test_surface_of_degree_two_is_found_and_its_variance_is_shared():
    """1 + 3 x1 + 2 x2^2 + x1 x3: the variances are 9/3, 4 * 4/45 and 1/9."""
    levels = np.random.default_rng(1).uniform(-1.0, 1.0, (27, 4))
    x1, x2, x3, _ = levels.T
    surface = fit(levels, 1.0 + 3.0 * x1 + 2.0 * x2**2 + x1 * x3)
    assert surface.degree == 2
    fresh = np.random.default_rng(2).uniform(-1.0, 1.0, (9, 4))
    planted = 1.0 + 3.0 * fresh[:, 0] + 2.0 * fresh[:, 1] ** 2 + fresh[:, 0] * fresh[:, 2]
    assert surface.at(fresh) == pytest.approx(planted, rel=1e-9)
    parts = np.array([3.0, 16.0 / 45.0, 0.0, 0.0, 1.0 / 9.0])
    assert surface.contributions(SAMPLE) == pytest.approx(parts / parts.sum(), abs=5e-3)


def test_few_runs_give_a_plane():
    levels = np.random.default_rng(1).uniform(-1.0, 1.0, (8, 4))
    surface = fit(levels, 2.0 + levels @ [1.0, 0.0, -2.0, 0.0])
    assert surface.degree == 1
    assert surface.contributions(SAMPLE) == pytest.approx([0.2, 0.0, 0.8, 0.0, 0.0], abs=5e-3)


def test_factors_change_the_drawing():
    drawing = load_gasket_drawing("bellows")
    factors = factors_of(drawing)
    same = changed(drawing, factors, np.array([0.0, 0.0, 1.0, 0.0]))
    assert same.meridian == drawing.meridian
    assert same.rubber == drawing.rubber
    other = changed(drawing, factors, np.array([1.0, 1.0, 0.0, -1.0]))
    assert other.meridian[2].thickness == pytest.approx(1.15 * 2.5e-3)
    assert other.meridian[2].radius == pytest.approx(0.160 + 1.12 * 0.025)
    assert [point.radius for point in other.meridian[:2]] == pytest.approx([0.16, 0.16])
    assert other.meridian[2].fillet == pytest.approx(0.92 * 0.01)
    assert other.rubber.shore_a == 34.0
    wide = (replace(factors[0], half=9.0), *factors[1:])
    with pytest.raises(InputError, match=r"at thickness 1e\+03 %, depth 100 %.*too sharp"):
        changed(drawing, wide, np.array([1.0, 0.0, 0.0, 0.0]))


def test_number_of_folds_is_a_factor_of_whole_numbers():
    """Two levels: a slope of 2 is all of the variance, and it has no curvature."""
    folded = load_gasket_drawing("folded")
    factors = factors_of(folded, (2, 1, 2))
    assert [factor.name for factor in factors] == [
        "thickness", "depth", "fillet", "hardness", "folds",
    ]  # fmt: skip
    levels = factors[-1].levels(np.array([0.0, 0.49, 0.5, 0.99]))
    assert levels.tolist() == [-1.0, -1.0, 1.0, 1.0]
    assert factors_of(folded, (1, 2, 3))[-1].levels(np.array([0.1, 0.5, 0.9])).tolist() == [
        -1,
        0,
        1,
    ]
    twice = changed(folded, factors, np.array([0.0, 0.0, 0.0, 0.0, 1.0]))
    assert len(twice.meridian) == 10
    assert len(changed(folded, factors, np.array([0.0, 0.0, 0.0, 0.0, -1.0])).meridian) == 6
    sample = np.column_stack([SAMPLE, np.sign(SAMPLE[:, 0])])
    surface = fit(sample[:40], 3.0 + 2.0 * sample[:40, 4])
    assert surface.contributions(sample) == pytest.approx([0, 0, 0, 0, 1, 0], abs=1e-9)
    assert surface.at(np.zeros((1, 5)))[0] == pytest.approx(3.0, abs=1e-9)
    with pytest.raises(InputError, match="allowed are numbers from 1 to 6"):
        factors_of(folded, (0, 2))


def test_folds_are_repeated_in_the_room_of_the_drawn_ones():
    folded = load_gasket_drawing("folded")
    assert with_folds(folded, 1) is folded
    twice = with_folds(folded, 2)
    places = [(1e3 * point.radius, 1e3 * point.y) for point in twice.meridian]
    assert np.array(places) == pytest.approx(np.array([
        (160, 0), (160, 30), (168, 30), (168, 8), (176, 8), (176, 30), (184, 30), (184, 8),
        (192, 8), (192, 60),
    ]))  # fmt: skip
    assert {point.fillet for point in twice.meridian[1:-1]} == {3e-3}
    wave = with_folds(load_gasket_drawing("bellows").model_copy(update={"meridian": tuple(
        point.model_copy(update={"fillet": min(point.fillet, 6e-3)})
        for point in load_gasket_drawing("bellows").meridian)}), 2)  # fmt: skip
    assert [round(1e3 * point.y, 9) for point in wave.meridian] == [0, 20, 27.5, 35, 42.5, 50, 70]
    with pytest.raises(InputError, match=r"with folds repeated 6 times: .*too sharp"):
        with_folds(folded, 6)
    tube = folded.model_copy(update={"meridian": (folded.meridian[0], folded.meridian[-1])})
    with pytest.raises(InputError, match="has 0 corners between its rims"):
        with_folds(tube, 2)


def test_the_best_drawing_keeps_the_limits_and_then_has_the_largest_gap():
    responses = {GAP: np.array([3.0, 9.0, 5.0, 4.0]), "largest_stretch": np.array([1, 4, 1.9, 2.0])}
    assert ranked(responses, {}).tolist() == [1, 2, 3, 0]
    assert ranked(responses, {"largest_stretch": 2.0}).tolist() == [2, 3, 0, 1]
    assert ranked(responses, {"largest_stretch": 0.5})[0] == 0
    assert excess(responses, {"largest_stretch": 2.0}) == pytest.approx([0.0, 1.0, 0.0, 0.0])


@pytest.mark.slow
def test_thicker_and_harder_walls_are_stiffer_and_the_best_drawing_is_verified(tmp_path):
    out = tmp_path / "out"
    limit = 1.05
    result = wm.run_study(
        "gasket-geometry", quick=True, quiet=True, out=out, limit=[f"largest_stretch={limit}"]
    )
    tables = {name: table.data for name, table in result.labelled().items()}
    drawings, shares, changes = (tables[n] for n in ("drawings", "contributions", "changes"))
    for factor in ("thickness", "hardness"):
        change = changes.sel(surface=f"change over {factor}")
        assert all(change[name] > 0.0 for name in ("radial", "axial", "twist", "tilt"))
    bending, shear = shares.share.sel(response=["axial", "twist"], source="thickness").values
    assert bending > 1.5 * shear  # bending goes with the cube of the thickness
    assert drawings.kind.values.tolist() == ["design"] * 6 + ["fresh"] * 2 + ["best of surface"]
    assert shares.error_on_fresh.sel(response="twist") < 0.1
    gap, stretch = drawings[GAP].values, drawings.largest_stretch.values
    assert tables["conditions"].keeps_limits
    best = int(tables["conditions"].best)
    assert gap[best] == gap[stretch <= limit].max()
    assert np.all((stretch > 1.0) & (stretch < 1.3))
    written = load_gasket_drawing(out / "best.yaml")
    assert written.rubber.shore_a == pytest.approx(drawings.hardness[best].item())
    parts = [
        point.thickness / drawn.thickness
        for point, drawn in zip(
            written.meridian, load_gasket_drawing("folded").meridian, strict=True
        )
    ]
    assert parts == pytest.approx([drawings.thickness[best].item()] * len(parts), abs=1e-3)
