"""Section of the spin page about forces on cabinet and floor, from a short run."""

import numpy as np
import pandas as pd
import pytest

from wm_drake.parameters import SpinProfile, with_value
from wm_drake.parameters.spin import Region
from wm_drake.report.figure import Line
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import measure
from wm_drake.simulation.runs import simulate
from wm_drake.studies.spin.floor import floor_figure, floor_parts, floor_warnings, windows
from wm_drake.studies.spin.page import spin_answer
from wm_drake.studies.spin.study import CaseResult, SpinRuns

PROFILE = SpinProfile(
    time=(0.0, 6.0), speed=(5.0, 30.0), regions=(Region(name="low", begin=0.0, end=2.0),)
)


def spin_result(machine, parameters):
    """Return the result of a short run of the load `counter`."""
    case = Case("counter", parameters.loads["counter"], PROFILE, parameters=parameters)
    record = simulate(machine, case)
    return SpinRuns(parameters, "compiled", (CaseResult(case, record, measure(record), 1.0),))


@pytest.fixture(scope="module")
def result(machine, reference):
    """Return the result with the cabinet of the machine file."""
    return spin_result(machine, reference)


def test_tables_have_the_measures(result):
    plots, tables = floor_parts(result)
    resultant, margins, feet = (table.frame() for table in tables.tables)
    measures = result.results[0].measures
    largest = resultant.set_index("axis").cabinet_force_peak_N["z"]
    assert largest == float(measures.cabinet_force_peak.sel(axis="z"))
    assert margins.part.tolist() == ["whole run", "low"]
    assert margins.slide_margin_N[0] == float(measures.feet.slide_margin)
    assert feet.foot.tolist() == ["front_left", "front_right", "rear_right", "rear_left"]
    assert "friction 0.4" in tables.text
    assert len(plots.shown) == 1


def test_a_slippery_floor_is_warned_of(machine, reference):
    rough = spin_result(machine, with_value(reference, "cabinet.friction", "0.9"))
    assert floor_warnings(rough) == []
    slippery = spin_result(machine, with_value(reference, "cabinet.friction", "0.05"))
    (warning,) = floor_warnings(slippery)
    assert warning.startswith("Load counter (with gasket): the cabinet ")
    assert "turns on the floor" in warning
    _, margins, _ = floor_parts(slippery)[1].tables
    assert margins.data.moves.values[0, 0]
    assert warning in spin_answer(slippery).warned


def test_without_cabinet_the_section_says_so(machine, reference):
    bare = reference.model_copy(update={"cabinet": None})
    plots, tables = floor_parts(spin_result(machine, bare))
    assert len(tables.shown) == 1
    assert "has no cabinet" in tables.text
    assert not plots.shown


def test_figure_shows_the_smallest_values(result):
    panels = floor_figure(list(result.results)).panels
    feet = result.results[0].measures.feet
    for panel, name in zip(
        panels, ("smallest_foot_load", "slide_margin", "turn_margin"), strict=True
    ):
        (line,) = (mark for mark in panel.marks if isinstance(mark, Line))
        assert np.min(line.y) == pytest.approx(float(feet[name]), rel=1e-9)


def test_windows_cover_all_samples():
    time = 5e-3 * np.arange(120)
    values = np.arange(120.0)[:, None]
    middle, smallest = windows(time, values)
    assert smallest[:, 0].tolist() == [0.0, 50.0]  # the rest of 20 samples joins the last window
    middle, smallest = windows(time, values[::-1])
    assert smallest[:, 0].tolist() == [70.0, 0.0]
    assert pd.Series(middle).is_monotonic_increasing
