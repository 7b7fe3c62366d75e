"""Comparison of spin results: differences of planted values, remarks, and the page."""

from dataclasses import replace

import numpy as np
import pytest
from hand_made_records import case_result, spin_result

from wm_drake.errors import InputError
from wm_drake.parameters import SpinProfile, load_machine, with_value
from wm_drake.report.figure import Area, Rule
from wm_drake.studies.spin.comparison import (
    MOST_VARIANTS,
    Variant,
    check_comparable,
    difference_table,
    effects,
    remarks,
)
from wm_drake.studies.spin.comparison_page import (
    COLOURS,
    SpinComparisonResult,
    comparison_page,
    differences,
    different_parameters,
    overlaid_envelopes_figure,
)
from wm_drake.studies.spin.study import Files
from wm_drake.studies.study import Facts


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
    names = ("with gasket", "without gasket")
    return [Variant(name, spin_result(machine, of)) for name, of in zip(names, cases, strict=True)]


@pytest.fixture(scope="module")
def table(variants):
    return difference_table(variants)


def page_of(variants, command=""):
    effect = effects(variants) if variants[1].name == "without gasket" else None
    comparison = SpinComparisonResult(tuple(variants), difference_table(variants), effect)
    return comparison_page(comparison, Facts(command))


@pytest.fixture(scope="module")
def page(variants):
    files = Files(part="w")
    first = replace(variants[0], result=replace(variants[0].result, files=files))
    return page_of([first, variants[1]], "wm-drake spin --compare-gasket")


def test_terminal_has_the_gap_of_each_case(variants, table):
    shown = SpinComparisonResult(tuple(variants), table, None).terminal()
    gap = "smallest gap 18.0 mm between tub shell and wall right, at 240 rpm (0.50 s)"
    assert f"without gasket, back: {gap}" in shown


def test_differences_of_planted_values(table, variants):
    of_middle = table[table["load"] == "middle"].set_index(["measure", "name"])
    gap = of_middle.loc[("smallest gap", "")]
    assert gap[["reference_value", "value", "difference", "percent"]].tolist() == pytest.approx(
        [12.0, 18.0, 6.0, 50.0]
    )
    box = of_middle.loc["detergent box displacement"]
    np.testing.assert_allclose(
        box["reference_value"], [20.0, 6.0, 10.0], rtol=3e-3
    )  # sampled sines
    np.testing.assert_allclose(box["percent"], -50.0, atol=1e-9)
    spring = of_middle.loc[("largest mount force", "springs.left")]
    assert spring[["reference_value", "value", "difference", "percent"]].tolist() == [
        190.0,
        190.0,
        0.0,
        0.0,
    ]
    amplitude = variants[1].result.results[0].measures.amplitude.sel(sensor="Zf")
    assert of_middle.loc[("amplitude", "Zf"), "value"] == pytest.approx(1e3 * float(amplitude))


def test_every_measure_has_a_row(table, machine):
    counts = table[table["load"] == "back"].groupby("measure", sort=False).size().to_dict()
    assert counts == {
        "amplitude": len(machine.sensors),
        "critical speed": len(machine.sensors),
        "detergent box displacement": 3,
        "smallest gap": 1,
        "gasket force": 3,
        "gasket moment": 3,
        "largest mount force": 7,  # three springs, three dampers, the gasket
    }


def test_measure_that_a_variant_lacks_is_not_a_number(table):
    gasket = table[table["measure"].str.startswith("gasket") | (table["name"] == "gasket")]
    assert len(gasket) == 2 * 7
    assert np.isfinite(gasket["reference_value"]).all()
    assert gasket[["value", "difference", "percent"]].isna().all(axis=None)


def test_percent_of_zero_is_not_a_number(table):
    damper = table[table["name"] == "dampers.left"]
    assert (damper["difference"] == 0.0).all()
    assert damper["percent"].isna().all()


def test_table_on_the_page_has_the_numbers_in_their_units(table):
    shown = {
        (group.heading, row.cells[0]): row.cells[1:]
        for group in differences(table, "middle").groups
        for row in group.rows
    }
    assert shown["smallest gap", ""] == ("mm", "12.0", "18.0", "+6.0", "+50")
    assert shown["gasket force", "x"] == ("N", "20.0", "–", "–", "–")
    assert shown["gasket moment", "x"] == ("N m", "2.00", "–", "–", "–")
    assert shown["critical speed", "Xr"] == ("rpm", "240", "240", "0", "0")


def test_figure_has_a_colour_per_variant_and_their_measurements(variants):
    cases = {variant.name: variant.result.results[0] for variant in variants}
    measured = {"with gasket": dict.fromkeys(variants[0].result.parameters.sensors, 29.0)}
    figure = overlaid_envelopes_figure(cases, measured)
    assert len(figure.panels) == 6
    panel = figure.panels[0]
    areas = {mark.color for mark in panel.marks if isinstance(mark, Area)}
    assert areas == {*COLOURS[:2]}
    dashed = [mark for mark in panel.marks if isinstance(mark, Rule) and mark.dash == "dashed"]
    assert [mark.color for mark in dashed] == [COLOURS[0]] * 2
    assert sorted(mark.at for mark in dashed) == [-29.0, 29.0]
    assert panel.y.range[1] > 29.0


def test_sensor_that_only_one_machine_has_is_left_out_of_the_figure(variants):
    other = variants[1].result.results[0]
    fewer = replace(other, record=other.record.drop_sel(sensor=["Yr", "Yf"]))
    figure = overlaid_envelopes_figure({"a": variants[0].result.results[0], "b": fewer})
    assert [panel.name for panel in figure.panels] == ["Xr", "Zr", "Xf", "Zf"]


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
        for case in variants[0].result.results
    ]
    found = remarks([variants[0], Variant("other", spin_result(other, results))])
    assert found == [
        "Load middle is not the same in 'with gasket' and 'other'.",
        "Load back is not the same in 'with gasket' and 'other'.",
        "'with gasket' and 'other' follow different spin profiles.",
        "Not all machines have the sensors Yf of 'reference'; the figures leave them out.",
        "Sensor Xr measures along x in 'reference' and along z in 'other'.",
    ]


def test_parameters_that_differ_are_listed(machine, variants):
    soft = with_value(machine, "spring_types.suspension.stiffness", 5000.0)
    own = 1e-3 * machine.spring_types["suspension"].stiffness
    both = [variants[0], Variant("soft", replace(variants[1].result, parameters=soft))]
    table = different_parameters(both)
    assert [(g.heading, g.rows[0].cells) for g in table.groups] == [
        ("spring_types.suspension.stiffness", (f"{own:g} N/mm", "5 N/mm"))
    ]
    assert different_parameters(variants) is None


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
    page = page_of([variants[0], Variant("short", spin_result(machine, short))])
    assert "short: Load middle (with gasket): the run diverged at 0.06 s" in page
    assert "Every run of short diverged." in page
    none = [Variant(name, spin_result(machine, short)) for name in ("a", "b")]
    assert "<figure" not in page_of(none)
