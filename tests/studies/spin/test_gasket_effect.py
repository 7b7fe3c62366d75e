"""Effect of the gasket: percent differences and steady amplitudes on records of known answer."""

import numpy as np
import pytest
import xarray as xr

from wm_drake.parameters import SpinProfile
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import Measures
from wm_drake.studies.spin.comparison import (
    Variant,
    effect_table,
    effects,
    steady_amplitudes,
    steady_window,
)
from wm_drake.studies.spin.comparison_page import effect_amplitudes, effect_summary
from wm_drake.studies.spin.study import CaseResult, Comparison, SpinRuns

SENSORS = ["Xr", "Yr", "Zr", "Xf", "Yf", "Zf"]


def profile(*points):
    time, speed = zip(*points, strict=True)
    return SpinProfile(time=time, speed=speed)


def test_steady_state_is_the_last_half_of_the_fastest_stretch_of_constant_speed():
    run_up = profile((0.0, 0.0), (57.0, 40.0), (70.0, 40.0))
    assert steady_window(run_up) == (63.5, 70.0)
    cycle = profile((0, 0), (5, 10), (20, 10), (25, 30), (45, 30), (50, 0), (90, 0))
    assert steady_window(cycle) == (35.0, 45.0)
    backwards = profile((0.0, 0.0), (5.0, -10.0), (20.0, -10.0), (25.0, 0.0))
    assert steady_window(backwards) == (12.5, 20.0)
    assert steady_window(profile((0.0, 0.0), (9.0, 9.0))) is None
    assert steady_window(profile((0.0, 9.0), (5.0, 0.0), (9.0, 0.0))) is None  # at rest


def sines(amplitude, frequency=5.0, duration=40.0):
    """Return a record whose sensors move by sines; the first second is ten times as large."""
    time = np.arange(0.0, duration, 0.005)
    size = amplitude * np.where(time < 1.0, 10.0, 1.0)
    values = size[:, None] * np.sin(2 * np.pi * frequency * time)[:, None] * np.ones(len(SENSORS))
    return xr.Dataset(
        {"displacement": (("time", "sensor"), values)}, {"time": time, "sensor": SENSORS}
    )


def test_steady_amplitude_is_that_of_the_sine():
    found = steady_amplitudes(sines(0.002), (20.0, 40.0))
    assert found.values == pytest.approx(np.full(6, 0.002), rel=5e-3)


def result(parameters, gasket, transient, steady, comparison):
    """Return a spin result of the middle load with planted amplitudes. [m]"""
    case = Case("middle", parameters.loads["middle"], parameters.profile, gasket)
    record = sines(steady, duration=70.0)
    record.attrs |= {"gasket": "yes" if gasket else "no", "diverged": ""}
    sizes = xr.DataArray(np.full(6, transient), {"sensor": SENSORS}, ["sensor"])
    table = xr.Dataset({"amplitude": sizes, "critical_speed": sizes})
    measures = Measures(table, None, None, None, has_cabinet=False)
    results = (CaseResult(case, record, measures, 0.0),)
    return SpinRuns(parameters, "compiled", results, comparison)


@pytest.mark.parametrize("comparison", [Comparison.AS_MEASURED, Comparison.NONE])
def test_differences_are_those_of_equation_1(reference, comparison):
    effect = effect_table(
        result(reference, False, 0.020, 0.0050, comparison),
        result(reference, True, 0.025, 0.0048, comparison),
    )
    table = effect.set_index("sensor")
    assert list(table["percent"]) == pytest.approx([25.0] * 6)
    assert (table["without_mm"].iloc[0], table["with_mm"].iloc[0]) == pytest.approx((20.0, 25.0))
    assert list(table["steady_percent"]) == pytest.approx([-4.0] * 6, abs=0.05)
    text = effect_summary(effect)
    assert (
        "In the steady state the gasket matters little: amplitudes of at least 1 mm without gasket "
        "differ by up to 4.0 %"
    ) in text
    shown = effect_amplitudes(effect)
    if comparison is Comparison.NONE:
        assert table["experiment_percent"].isna().all()
        assert "experiment" not in text
        assert len(shown.groups[0].rows) == 3
        return
    # [B] Table 1, middle load: as printed, from unrounded amplitudes
    assert list(table["experiment_percent"]) == [23.2, 175.3, 3.3, -1.0, 604.5, 14.9]
    assert "The sign of the difference is that of the experiment in 5 of 6 cases." in text
    assert len(shown.groups[0].rows) == 6


def test_of_several_machines_each_row_names_its_machine(reference):
    other = reference.model_copy(update={"name": "other"})
    variants = [
        Variant("", result(machine, gasket, size, 0.005, Comparison.NONE))
        for machine in (reference, other)
        for gasket, size in ((True, 0.03), (False, 0.02))
    ]
    table = effects(variants)
    assert table["percent"].to_numpy() == pytest.approx(50.0)
    assert table.groupby("machine", sort=False).size().to_dict() == {"reference": 6, "other": 6}
    assert effect_summary(table).startswith("Load reference, middle: ")
    assert [group.heading for group in effect_amplitudes(table).groups] == [
        "reference, middle",
        "other, middle",
    ]
    assert "machine" not in effects(variants[:2])
