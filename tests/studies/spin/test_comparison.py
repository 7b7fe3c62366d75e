"""Comparison of spin runs: differences and steady amplitudes of planted values, and the page."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from hand_made_records import case_result, spin_result

from wm_drake.errors import InputError
from wm_drake.parameters import SpinProfile, load_machine, with_value
from wm_drake.report.figure import Area, Rule
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import Measures
from wm_drake.studies.facts import Facts
from wm_drake.studies.spin.comparison import (
    COLOURS,
    STEADY,
    check_comparable,
    comparison_answer,
    differences_of,
    different_parameters,
    envelopes_figure,
    remarks,
    steady_amplitudes,
    steady_window,
)
from wm_drake.studies.spin.options import MOST_VARIANTS
from wm_drake.studies.spin.page import Files
from wm_drake.studies.spin.study import CaseResult, ComparedCases, SpinRuns

SENSORS = ["Xr", "Yr", "Zr", "Xf", "Yf", "Zf"]
WITH, WITHOUT = "with gasket", "without gasket"


@pytest.fixture(scope="module")
def machine():
    return load_machine("reference")


@pytest.fixture(scope="module")
def variants(machine):
    """Return a run with and one without gasket; the latter moves half as far with a wider gap."""
    cases = [
        [case_result(machine, "middle", True), case_result(machine, "back", True)],
        [
            case_result(machine, "middle", False, size=0.01, gap=0.018),
            case_result(machine, "back", False, size=0.01, gap=0.018),
        ],
    ]
    return {name: spin_result(machine, of) for name, of in zip((WITH, WITHOUT), cases, strict=True)}


def differences(variants):
    """Return the differences of all variants from the first one."""
    return differences_of(variants, dict.fromkeys(variants, next(iter(variants))))


@pytest.fixture(scope="module")
def data(variants):
    return differences(variants)


def numbers(data, load, measure):
    """Return value of reference and variant, and change, of each number of a measure."""
    rows = data.isel(row=(data["load"].values == load) & (data.measure.values == measure))
    return rows.of.values.tolist(), rows.value.values, rows.change.values[:, 1]


def answer_of(variants):
    references = dict.fromkeys(variants, next(iter(variants)))
    files = {name: Files(part=name.replace(" ", "_")) for name in variants}
    return comparison_answer(variants, references, files)


def test_differences_of_planted_values(data, variants):
    _, gap, change = numbers(data, "middle", "smallest gap")
    np.testing.assert_allclose([*gap[0], *change], [12.0, 18.0, 0.5])
    _, box, change = numbers(data, "middle", "detergent displacement")
    np.testing.assert_allclose(box[:, 0], [20.0, 6.0, 10.0], rtol=3e-3)  # sampled sines
    np.testing.assert_allclose(change, -0.5, atol=1e-11)
    names, force, change = numbers(data, "middle", "mount force peak")
    left = names.index("springs.left")
    assert [*force[left], change[left]] == [190.0, 190.0, 0.0]
    names, sizes, _ = numbers(data, "middle", "amplitude")
    amplitude = variants[WITHOUT].results[0].measures.amplitude.sel(sensor="Zf")
    assert sizes[names.index("Zf"), 1] == pytest.approx(1e3 * float(amplitude))


def test_every_measure_has_a_row(data, machine):
    measures = data.measure.values[data["load"].values == "back"].tolist()
    assert {name: measures.count(name) for name in measures} == {
        "amplitude": len(machine.sensors),
        "critical speed": len(machine.sensors),
        "detergent displacement": 3,
        "smallest gap": 1,
        "gasket force": 3,
        "gasket moment": 3,
        "mount force peak": 7,  # three springs, three dampers, the gasket
        f"{STEADY}400 rpm": len(machine.sensors),
    }


def test_measure_that_a_variant_lacks_and_percent_of_zero_are_not_numbers(data):
    _, force, change = numbers(data, "middle", "gasket force")
    assert np.isfinite(force[:, 0]).all()
    assert np.isnan([force[:, 1], change]).all()
    names, force, change = numbers(data, "middle", "mount force peak")
    gasket, damper = names.index("gasket"), names.index("dampers.left")
    assert np.isnan([force[gasket, 1], change[gasket], change[damper]]).all()
    assert force[damper].tolist() == [0.0, 0.0]


def test_figure_has_a_colour_per_variant_and_their_measurements(variants):
    measured = replace(variants[WITH], comparison=ComparedCases.ALL)
    none = replace(variants[WITHOUT], comparison=ComparedCases.NONE)
    figure = envelopes_figure({WITH: measured, WITHOUT: none})
    assert len(figure.panels) == 2 * len(SENSORS)
    panel = figure.panels[0]
    assert {mark.color for mark in panel.marks if isinstance(mark, Area)} == {*COLOURS[:2]}
    dashed = [mark for mark in panel.marks if isinstance(mark, Rule) and mark.dash == "dashed"]
    assert [mark.color for mark in dashed] == [COLOURS[0]] * 2
    assert sorted(mark.at for mark in dashed) == [-14.55, 14.55]  # half of [B] Table 1
    assert panel.y.range[1] > 14.55


def test_sensor_that_only_one_machine_has_is_left_out_of_the_figure(machine, variants):
    fewer = {name: s for name, s in machine.sensors.items() if name not in ("Yr", "Yf")}
    other = machine.model_copy(update={"sensors": fewer, "measured": ()})
    runs = replace(variants[WITHOUT], parameters=other, results=variants[WITHOUT].results[:1])
    first = replace(variants[WITH], results=variants[WITH].results[:1])
    names = [panel.name for panel in envelopes_figure({"a": first, "b": runs}).panels]
    assert names == ["middle, Xr", "middle, Zr", "middle, Xf", "middle, Zf"]


def test_there_is_a_colour_for_each_variant():
    assert len(COLOURS) == len(set(COLOURS)) == MOST_VARIANTS


def test_remarks_name_other_loads_profiles_and_sensors(machine, variants):
    assert remarks(variants) == []
    slow = SpinProfile(time=(0.0, 2.0), speed=(0.0, 10.0))
    fewer = {name: s for name, s in machine.sensors.items() if name != "Yf"}
    turned = fewer | {"Xr": machine.sensors["Xr"].model_copy(update={"axis": "z"})}
    other = machine.model_copy(update={"name": "other", "sensors": turned})
    results = [
        replace(case, case=replace(case.case, load=machine.loads["front"], profile=slow))
        for case in variants[WITH].results
    ]
    found = remarks({WITH: variants[WITH], "other": spin_result(other, results)})
    words = ("Load middle", "Load back", "different spin profiles", "sensors Yf", "Sensor Xr")
    assert len(found) == len(words)
    assert all(word in text for word, text in zip(words, found, strict=True))


def test_parameters_that_differ_are_listed(machine):
    soft = with_value(machine, "spring_types.suspension.stiffness", 5000.0)
    own = 1e-3 * machine.spring_types["suspension"].stiffness
    both = {"own": machine, "soft": soft}
    assert different_parameters(both) == [
        f"spring_types.suspension.stiffness: {own:g} N/mm (own), 5 N/mm (soft)"
    ]
    assert different_parameters({"own": machine, "same": machine}) == []


def test_machines_need_names_of_their_own_and_a_common_sensor(machine):
    other = machine.model_copy(update={"name": "other"})
    check_comparable([machine, other], "--machine")
    with pytest.raises(InputError, match="2 machines have the name 'reference'"):
        check_comparable([machine, other, machine], "--machine")
    alone = other.model_copy(update={"sensors": {"A": machine.sensors["Xr"]}})
    with pytest.raises(InputError, match="no sensor of the same name: 'reference' has Xr"):
        check_comparable([machine, alone], "--machine")


def test_diverged_and_short_runs_still_give_a_page(machine, variants):
    short = [case_result(machine, name, samples=12) for name in ("middle", "back")]
    for case in short:
        case.record.attrs["diverged"] = "the run diverged at 0.06 s"
    answer = answer_of({WITH: variants[WITH], "short": spin_result(machine, short)})
    assert answer.diverged[0] == "short: middle: the run diverged at 0.06 s"
    assert "short: Load middle: the run diverged at 0.06 s" in answer.page(Facts())
    none = answer_of({name: spin_result(machine, short) for name in ("a", "b")})
    assert "<figure" not in none.page(Facts())


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


def planted(parameters, gasket, transient, steady, comparison):
    """Return runs of the middle load with planted amplitudes. [m]"""
    case = Case("middle", parameters.loads["middle"], parameters.profile, gasket)
    record = sines(steady, duration=70.0)
    record.attrs |= {"gasket": "yes" if gasket else "no", "diverged": ""}
    sizes = xr.DataArray(np.full(6, transient), {"sensor": SENSORS}, ["sensor"])
    table = xr.Dataset({"amplitude": sizes, "critical_speed": sizes})
    measures = Measures(table, None, None, None, has_cabinet=False)
    return SpinRuns(parameters, "compiled", (CaseResult(case, record, measures, 0.0),), comparison)


@pytest.mark.parametrize("comparison", [ComparedCases.AS_MEASURED, ComparedCases.NONE])
def test_differences_are_those_of_equation_1(reference, comparison):
    data = differences(
        {
            WITHOUT: planted(reference, False, 0.020, 0.0050, comparison),
            WITH: planted(reference, True, 0.025, 0.0048, comparison),
        }
    )
    names, sizes, change = numbers(data, "middle", "amplitude")
    assert names == SENSORS
    np.testing.assert_allclose(sizes, [[20.0, 25.0]] * 6)
    np.testing.assert_allclose(change, 0.25)
    _, _, steady = numbers(data, "middle", STEADY)
    np.testing.assert_allclose(steady, -0.04, atol=5e-4)
    measured = data.measured_change.values[data.measure.values == "amplitude", 1]
    if comparison is ComparedCases.NONE:
        assert np.isnan(measured).all()
        return
    # [B] Table 1, middle load: as printed, from unrounded amplitudes
    np.testing.assert_allclose(100.0 * measured, [23.2, 175.3, 3.3, -1.0, 604.5, 14.9])


def test_each_machine_is_compared_with_itself_without_gasket(reference):
    other = reference.model_copy(update={"name": "other"})
    variants = {
        f"{name}, {gasket}": planted(machine, gasket, scale * size, 0.005, ComparedCases.NONE)
        for name, machine, scale in (("reference", reference, 1.0), ("other", other, 2.0))
        for gasket, size in ((False, 0.02), (True, 0.03))
    }
    names = list(variants)
    references = {name: names[place - place % 2] for place, name in enumerate(names)}
    data = differences_of(variants, references)
    change = data.change.values[data.measure.values == "amplitude"]
    np.testing.assert_allclose(change[:, 1::2], 0.5)
    assert np.isnan(change[:, ::2]).all()
