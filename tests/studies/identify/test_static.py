"""Quasi-static tests: planted table and friction come back, from one-sided and two-sided tests."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from wm_drake.errors import InputError
from wm_drake.parameters import MeasuredLoop, load_machine
from wm_drake.studies.identify.static import field_of, static_curve, table_of_curve

FRICTION, SOON = 3.0, 2e-4  # N, m


def elastic(x):
    return 4e3 * x + 2e8 * x**3


def ramps(ends, *, noise=0.0, offset=0.0, friction=FRICTION, samples=2000, rotates=False):
    """Return ramps at constant rate, with friction that reverses over a fifth of a millimetre (Dahl)."""
    ends = np.array(ends)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(ends)))])
    place = np.linspace(0.0, way[-1], samples)
    x = np.interp(place, way, ends)
    rub = np.zeros(samples)
    for k in range(1, samples):
        step = x[k] - x[k - 1]
        full = np.sign(step) * friction
        rub[k] = full + (rub[k - 1] - full) * np.exp(-abs(step) / SOON)
    rng = np.random.default_rng(1)
    force = elastic(x) + rub + offset + noise * rng.normal(size=samples)
    return MeasuredLoop("test", "test.csv", place / 1.67e-3, x, force, rotates)


@pytest.mark.parametrize(
    "ends",
    [(0.0, 20e-3, 0.0), (0.0, 20e-3, -20e-3, 20e-3, 0.0), (0.0, -20e-3, 0.0, 20e-3, 0.0)],
    ids=["one side", "both sides", "one side after the other"],
)
def test_table_and_hysteresis_come_back(ends):
    curve = static_curve("x", [ramps(ends, noise=0.3, offset=2.0)])
    table = table_of_curve(curve, 5)
    places = np.array(table["displacement"])
    assert len(places) == (6 if ends == (0.0, 20e-3, 0.0) else 11)
    largest = elastic(20e-3)
    assert table["force"] == pytest.approx(elastic(places), abs=0.004 * largest)
    assert dict(zip(places, table["force"], strict=True))[0.0] == 0.0
    assert curve.hysteresis == pytest.approx(FRICTION, rel=0.1)
    position = curve.position.values
    near, inner = position[np.abs(position) <= 4e-3], np.abs(position) < 3e-3
    slope = np.sum(near * elastic(near)) / np.sum(near**2)
    assert curve.stiffness == pytest.approx(slope, rel=0.03)
    assert np.nanmax(np.abs(curve.half_width.values[inner] - FRICTION)) < 0.2 * FRICTION
    assert curve.median_rate == pytest.approx(1.67e-3, rel=1e-2)


def test_energy_of_a_whole_cycle_is_the_area_of_the_loop():
    curve = static_curve("x", [ramps((0.0, 10e-3, -10e-3, 10e-3, -10e-3, 0.0), samples=8000)])
    full = 4.0 * FRICTION * 10e-3
    assert curve.energy_per_cycle == pytest.approx(full, rel=0.1)  # less what turning round saves


def test_repeated_tests_are_averaged_and_purely_elastic_ones_have_no_hysteresis():
    runs = [ramps((0.0, 20e-3, 0.0), friction=0.0, offset=o) for o in (0.0, 0.0, 0.0)]
    curve = static_curve("about_y", runs)
    assert field_of(curve.axis) == "rotational_stiffness_y"
    assert curve.hysteresis == pytest.approx(0.0, abs=1e-3)
    table = table_of_curve(curve, 3)
    assert set(table) == {"angle", "torque"}
    assert table["torque"][-1] == pytest.approx(elastic(20e-3), rel=3e-3)


@pytest.mark.parametrize(
    ("ends", "message"),
    [((5e-3, 20e-3, 5e-3), "does not contain zero"), ((0.0, 20e-3), "goes one way only")],
)
def test_tests_that_give_no_table_are_refused(ends, message):
    with pytest.raises(InputError, match=message):
        static_curve("x", [ramps(ends)])


def write(name, loop, columns):
    scale = 1e3 if "mm" in columns[1] else np.rad2deg(1.0)
    pd.DataFrame(
        {columns[0]: loop.time, columns[1]: scale * loop.displacement, columns[2]: loop.force}
    ).to_csv(name, index=False)


def test_command_gives_all_axes_in_one_plot_and_a_machine(wm_drake):
    straight = ("time_s", "displacement_mm", "force_N")
    turned = ("time_s", "angle_deg", "moment_Nm")
    write("r.csv", ramps((0.0, 20e-3, 0.0)), straight)
    write("a.csv", ramps((0.0, 15e-3, -15e-3, 0.0)), straight)
    write("t.csv", ramps((0.0, 0.1, 0.0), rotates=True), turned)
    write("w.csv", ramps((0.0, 0.05, 0.0), rotates=True), turned)
    tests = "radial=r.csv axial=a.csv tilt=t.csv twist=w.csv"
    ended = wm_drake(f"identify gasket --static {tests} --out fit --json")
    assert ended.code == 0
    found = json.loads(ended.out)
    measures = [*found["measures"], *found["rotational_measures"]]
    assert [row["axis"] for row in measures] == ["x", "y", "about_x", "about_y"]
    assert [row["tests"] for row in measures] == [1, 1, 1, 1]
    gasket = load_machine("fit/identified.yaml").gasket
    assert gasket.stiffness_x == gasket.stiffness_z
    assert gasket.stiffness_x.force[-1] == pytest.approx(elastic(20e-3), rel=0.01)
    assert gasket.rotational_stiffness_z.torque[-1] == pytest.approx(elastic(0.1), rel=0.01)
    assert gasket.damping_x == load_machine("reference").gasket.damping_x
    page = Path("fit/report.html").read_text()
    assert page.count("<figure data-picture>") == 1
    curves = [pd.read_csv(f"fit/{name}.csv") for name in ("static", "rotational_static")]
    assert [set(curve.axis) for curve in curves] == [{"x", "y"}, {"about_x", "about_y"}]
    assert curves[0].displacement_mm.max() == pytest.approx(20.0, rel=0.01)
    assert curves[1].mean_Nm.abs().max() == pytest.approx(elastic(0.1), rel=0.01)


def test_command_finds_the_sponge_of_a_free_stroke_damper(wm_drake):
    """Plant a sponge that has no force in the free stroke, with a friction of 1 N."""
    table = load_machine("free_stroke").damper_types["free_stroke"].sponge
    test = ramps((0.0, 9e-3, -9e-3, 9e-3, 0.0), samples=8000)
    rising = np.gradient(test.displacement) >= 0.0
    force = np.interp(test.displacement, table.displacement, table.force) + np.where(rising, 1, -1)
    straight = ("time_s", "displacement_mm", "force_N")
    write("s.csv", replace(test, force=force), straight)
    ended = wm_drake("identify damper --static s.csv --machine free_stroke --knots 9 --out fit")
    assert ended.code == 0
    found = load_machine("fit/identified.yaml").damper_types["free_stroke"].sponge
    places = np.array([-8e-3, -5e-3, 0.0, 2e-3, 5e-3, 8e-3])
    wanted = np.interp(places, table.displacement, table.force)
    got = np.interp(places, found.displacement, found.force)
    assert got == pytest.approx(wanted, abs=0.4)
    measures = pd.read_csv("fit/measures.csv")
    assert measures.hysteresis_N[0] == pytest.approx(1.0, rel=0.01)
    assert measures.filter(like="stiffness").iloc[0, 0] == 0.0  # no rounding of a flat part


def test_a_damper_without_a_sponge_table_is_refused(wm_drake):
    write("s.csv", ramps((0.0, 9e-3, 0.0)), ("time_s", "displacement_mm", "force_N"))
    ended = wm_drake("identify damper --static s.csv --machine reference")
    assert ended.code == 2
    assert "the law havsin" in ended.err
