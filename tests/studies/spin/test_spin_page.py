import base64
import hashlib
import html
import re
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
import xarray as xr
from hand_made_records import case_result, spin_result
from pages import without_scripts

from wm_drake.parameters import MachineParameters, SpinProfile, load_machine
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import number, percent
from wm_drake.report.scripts import packed_plotly
from wm_drake.report.table import readable
from wm_drake.studies.spin.figures import orbits_figure, revolution_starts, simplified_indices
from wm_drake.studies.spin.page import SpinResult, amplitude_table, spin_page, warnings_of
from wm_drake.studies.spin.study import CaseResult, Files, SpinRuns
from wm_drake.studies.spin.tables import (
    accelerations,
    differences,
    mount_force_tables,
    profiles,
    smallest_tensions,
)
from wm_drake.studies.spin.vibration import vibration_pictures
from wm_drake.studies.study import Facts

DIVERGED = "the run diverged at 1.234 s: x = 0.6 m, bound 0.5 m"
VOID = ("meta", "img", "br", "hr", "link", "input")


def slack_case(parameters: MachineParameters, load: str, tensions: Sequence[float]) -> CaseResult:
    case = case_result(parameters, load)
    smallest = case.measures.smallest_tension.copy(data=np.array(tensions))
    table = case.measures.table.assign(smallest_spring_tension=smallest)
    return replace(case, measures=replace(case.measures, table=table))


@pytest.fixture(scope="module")
def machine() -> MachineParameters:
    return load_machine("reference")


@pytest.fixture(scope="module")
def result(machine: MachineParameters) -> SpinRuns:
    return spin_result(
        machine, [case_result(machine, "middle"), case_result(machine, "back", size=0.01, gap=0.03)]
    )


@pytest.fixture(scope="module")
def page(result: SpinRuns) -> str:
    return spin_page(result, Facts("wm-drake spin --set 'a=<b>'"))


@pytest.fixture
def without_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip the slow drawing of the figures, for tests of texts and tables."""
    monkeypatch.setattr("wm_drake.report.page.plotly_of", lambda figure: {})


class Tags(HTMLParser):
    """HTML parser that checks that tags close in order, and keeps their attributes and words."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data.strip())

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attrs for name, attrs in self.found if name == tag]


def test_page_is_one_html_document_with_balanced_tags(page: str) -> None:
    tags = Tags(page)
    assert tags.open == []
    assert page.lstrip().startswith("<!DOCTYPE html>")
    assert [len(tags.all(tag)) for tag in ("html", "head", "body", "h1")] == [1, 1, 1, 1]


def test_page_loads_nothing_from_elsewhere(page: str) -> None:
    tags = Tags(page)
    addresses = [
        value or ""
        for _, attrs in tags.found
        for name, value in attrs.items()
        if name in ("src", "href")
    ]
    assert addresses
    assert all(
        address.startswith(("data:image/", "#", "https://doi.org/")) for address in addresses
    )
    policy = next(a["content"] for a in tags.all("meta") if "http-equiv" in a)
    for element, text in re.findall(r"<script([^>]*)>(.*?)</script>", page, re.DOTALL):
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert "type=" in element or f"'sha256-{digest}'" in policy
    assert "default-src 'none'" in policy
    assert not tags.all("link")
    assert "@import" not in page
    assert "url(" not in page


def test_links_within_the_page_lead_somewhere(page: str) -> None:
    tags = Tags(page)
    anchors = [attrs["id"] for _, attrs in tags.found if "id" in attrs]
    assert len(anchors) == len(set(anchors))
    inside = {attrs["href"] for attrs in tags.all("a") if not attrs["href"].startswith("https:")}
    assert inside
    opens_all = "#everything"  # pictures.js reads it
    assert inside <= {opens_all, *(f"#{anchor}" for anchor in anchors)}


def test_every_figure_says_what_it_shows(page: str) -> None:
    images = [a for a in Tags(page).all("div") if a.get("class") == "plot"]
    # three per case, the gaps, the floor, and the mount forces and accelerations of the first load
    assert len(images) == 10
    assert all(len(image["aria-label"] or "") > 20 for image in images)


def test_mount_forces_and_accelerations_of_planted_motion(
    result: SpinRuns, machine: MachineParameters
) -> None:
    (table,) = mount_force_tables(result)
    assert table.header[-1] == "RMS 300 to 400 rpm, N"
    of_middle = {row.cells[0]: row.cells[1:] for row in table.shown[0].rows}
    assert next(iter(of_middle)) == "springs.left"
    assert of_middle["springs.left"][:2] == ("190.0", "190.0")
    # 20, 6 and 10 N in phase: length 23.2 N, RMS 16.4 N, all at 240 rpm
    length = 1000.0 * 0.02 * np.sqrt(1.0 + 0.3**2 + 0.5**2)
    assert float(of_middle["gasket"][1]) == pytest.approx(length, rel=3e-3)  # sampled sines
    assert of_middle["gasket"][2:6] == ("240", "–", "–", number(length / np.sqrt(2.0), 1))
    rows = accelerations(result).shown[0].rows
    largest = dict(zip(machine.sensors, rows[0].cells[1:], strict=True))
    omega = 8.0 * np.pi
    # the tub's angles are small: a = omega^2 d, within a few percent
    for name, text in largest.items():
        displacement = float(abs(result.results[0].record.displacement.sel(sensor=name)).max())
        assert float(text) == pytest.approx(omega**2 * displacement, rel=0.05)


@pytest.mark.slow
def test_detail_draws_the_vibration_of_every_load(result: SpinRuns, page: str) -> None:
    assert page.count("drawn for this load only, that with the largest amplitude") == 1
    detailed = spin_page(replace(result, files=Files(detail=True)))
    assert detailed.count("Mount forces over time, load") == len(result.results)
    assert page.count("Mount forces over time, load") == 1
    assert "the option --detail" not in detailed


def test_spectra_show_the_sensor_with_the_largest_amplitude(machine: MachineParameters) -> None:
    case = case_result(machine, samples=4000)
    figure = vibration_pictures(spin_result(machine, [case]), case)[-1]
    assert figure is not None
    sensor = str(case.measures.amplitude.idxmax("sensor").values)
    assert f"at sensor {sensor}, load middle" in figure.alternative
    assert figure.drawing is not None
    assert figure.drawing.count('"type":"heatmap"') == 4  # maps of displacement and acceleration


def test_no_warning_where_all_is_well(page: str) -> None:
    assert 'class="warning"' not in page


@pytest.mark.usefixtures("without_drawing")
def test_diverged_case_is_warned_of_and_left_out_of_the_summary(machine: MachineParameters) -> None:
    good, bad = (
        case_result(machine, "back", size=0.01),
        case_result(machine, "middle", size=0.3, samples=12),
    )
    bad.record.attrs["diverged"] = DIVERGED
    page = spin_page(spin_result(machine, [bad, good]))
    assert Tags(page).open == []
    box = page[page.index('<section class="warning"') :]
    assert DIVERGED in box[: box.index("</section>")]
    assert "1 run diverged and is excluded from this summary" in page
    assert "The largest amplitude occurs with load back" in page
    assert "too short for the band-pass filter" in page


@pytest.mark.usefixtures("without_drawing")
def test_all_cases_diverged_still_give_a_page(machine: MachineParameters) -> None:
    bad = case_result(machine, samples=1)
    bad.record.attrs["diverged"] = DIVERGED
    page = spin_page(spin_result(machine, [bad]))
    assert DIVERGED in page
    assert "no result to summarize" in page
    assert "<figure" not in page


@pytest.mark.usefixtures("without_drawing")
def test_overlap_is_warned_of(machine: MachineParameters) -> None:
    page = spin_page(spin_result(machine, [case_result(machine, gap=-0.003)]))
    assert "tub shell and wall right overlap by 3.0 mm" in page
    answer = "The tub touches the housing: overlap of 3.0 mm, between tub shell and wall right"
    assert page.index(answer) < page.index("1 case was run")  # the answer comes first


@pytest.mark.parametrize(
    ("gap", "size"), [(0.0187, "18.7 mm between"), (-0.0169, "−16.9 mm (they touch) between")]
)
@pytest.mark.usefixtures("without_drawing")
def test_terminal_and_page_say_the_same_gap(
    machine: MachineParameters, gap: float, size: str
) -> None:
    case = case_result(machine, gap=gap)
    text = f"smallest gap {size} tub shell and wall right, at 240 rpm (0.50 s)"
    result = spin_result(machine, [case])
    assert f"{case.case.name}: {text}" in SpinResult(result).terminal()
    assert text.removeprefix("smallest gap ") in spin_page(result)


@pytest.mark.usefixtures("without_drawing")
def test_page_says_the_steps_that_the_runs_took(machine: MachineParameters) -> None:
    cases = [case_result(machine), case_result(machine), case_result(machine)]
    shorter = {"integrator": "multistep", "step_s": 1.25e-3}
    cases[1] = replace(cases[1], record=cases[1].record.assign_attrs(shorter))
    words = (
        "steps of up to 2.5 ms with controlled error, samples every 5 ms; "
        "multistep, steps of 1.25 ms, samples every 5 ms"
    )
    assert words in spin_page(spin_result(machine, cases))


def test_names_cannot_inject_markup(machine: MachineParameters) -> None:
    evil = "<script>alert('$x$')</script>"
    parameters = machine.model_copy(
        update={"name": evil, "about": evil, "loads": {evil: machine.loads["middle"]}}
    )
    page = spin_page(
        spin_result(
            parameters, [case_result(parameters, evil), case_result(parameters, evil, gasket=False)]
        ),
        Facts(evil),
    )
    assert "<script>alert" not in page
    assert "<script" not in without_scripts(page)
    assert page.count(html.escape(evil, quote=False).replace("'", "&#39;")) > 5
    assert Tags(page).open == []


def test_amplitude_table_has_only_measured_rows_that_match_a_case(
    result: SpinRuns, machine: MachineParameters
) -> None:
    table = amplitude_table(result)
    assert list(table.columns) == ["load", "gasket", "source", *machine.sensors]
    assert table[["load", "gasket", "source"]].to_numpy().tolist() == [
        ["middle", "yes", "experiment"],
        ["middle", "yes", "Adams model of [B]"],
        ["middle", "yes", "wm_drake"],
        ["back", "yes", "experiment"],
        ["back", "yes", "Adams model of [B]"],
        ["back", "yes", "wm_drake"],
    ]
    assert table.loc[0, "Xr"] == 14.55  # half of [B] Table 1, middle load with gasket
    expected = 1e3 * result.results[0].measures.amplitude.values
    np.testing.assert_allclose(
        table.loc[2, list(machine.sensors)].to_numpy(float), expected, rtol=1e-12
    )


def test_amplitude_table_tells_gasket_from_none(machine: MachineParameters) -> None:
    both = [case_result(machine, "counter", gasket) for gasket in (False, True)]
    table = amplitude_table(spin_result(machine, both))
    experiment = table[table["source"] == "experiment"]
    assert experiment[["gasket", "Xr"]].to_numpy().tolist() == [
        ["no", 6.3],
        ["yes", 4.8],
    ]  # half of [B] Table 1


@pytest.mark.usefixtures("without_drawing")
def test_amplitude_table_without_measurements_has_our_rows_alone(
    machine: MachineParameters,
) -> None:
    parameters = machine.model_copy(update={"measured": ()})
    result = spin_result(parameters, [case_result(parameters)])
    table = amplitude_table(result)
    assert table["source"].tolist() == ["wm_drake"]
    assert differences(table, result.results[0]) == []
    assert "no measured amplitudes" in spin_page(result)


@pytest.mark.usefixtures("without_drawing")
def test_percent_difference_row_by_hand(machine: MachineParameters) -> None:
    case = case_result(machine, "middle")
    amplitude = case.measures.amplitude.copy(
        data=1e-3 * np.array([17.46, 4.35, 4.725, 11.95, 2.0, 1.15])
    )
    table = case.measures.table.assign(amplitude=amplitude)
    result = spin_result(machine, [replace(case, measures=replace(case.measures, table=table))])
    # half of 29.1, 8.7, 18.9, 23.9, 8.0, 23.0 mm: 34.92 / 29.1 = 1.2, 9.45 / 18.9 = 0.5, 4 / 8 = 0.5, 2.3 / 23 = 0.1
    found = differences(amplitude_table(result), result.results[0])
    np.testing.assert_allclose(
        [change.percent for change in found], [20.0, 0.0, -50.0, 0.0, -50.0, -90.0], atol=1e-9
    )
    page = spin_page(result)
    row = re.search(r"wm_drake vs. experiment</td>(.*?)</tr>", page, re.DOTALL)
    assert row is not None
    cells = [word for word in Tags(row[1]).words if word]
    assert cells == ["+20 %", "0 %", "−50 %", "0 %", "−50 %", "−90 %", "35 %"]  # 210 / 6
    assert "The mean absolute difference is 35 %" in page
    assert "The largest difference is −90 %, at sensor Zf" in page


def test_same_result_gives_the_same_page(result: SpinRuns, page: str) -> None:
    footer = re.compile(r"<footer>.*?</footer>", re.DOTALL)  # has the date
    again = spin_page(result, Facts("wm-drake spin --set 'a=<b>'"))
    assert footer.sub("", again) == footer.sub("", page) != page


def test_page_is_small(page: str) -> None:
    assert len(packed_plotly()) < 2_000_000
    # ten pictures; a single one as SVG took up to 270 kB
    assert len(page) - len(packed_plotly()) < 7 * 100_000


def test_outline_keeps_corners_within_tolerance() -> None:
    x = np.linspace(0.0, 10.0, 1001)
    tent = np.interp(x, [0.0, 3.0, 10.0], [0.0, 6.0, -1.0])
    assert x[simplified_indices(x, tent, 1e-6)].tolist() == [0.0, 3.0, 10.0]
    wave = np.sin(x)
    kept = simplified_indices(x, wave, 0.01)
    assert len(kept) < 50
    assert np.abs(np.interp(x, x[kept], wave[kept]) - wave).max() <= 0.01


def test_revolutions_start_where_the_drum_has_turned_once() -> None:
    turning = xr.Dataset(
        {"drum_angle": ("time", -2.0 * np.pi * np.arange(1000) / 25.3)}
    )  # 39.5 turns, backwards
    starts = revolution_starts(turning)
    assert set(np.diff(starts)) == {25, 26}
    assert len(starts) == 39  # the last is not complete
    standing = xr.Dataset({"drum_angle": ("time", np.zeros(7))})
    assert revolution_starts(standing).tolist() == list(range(7))


@pytest.mark.parametrize(
    ("value", "text"),
    [(12.34, "+12 %"), (-3.6, "−4 %"), (-0.4, "0 %"), (0.4, "0 %"), (float("nan"), "–")],
)
def test_percent_is_written_with_its_sign(value: float, text: str) -> None:
    assert percent(value) == text


def test_long_lists_are_shown_by_their_ends(machine: MachineParameters) -> None:
    times = tuple(np.linspace(0.0, 2.0, 501).tolist())
    assert readable(times, Unit("s", "s")) == "501 values, 0 s to 2 s"
    case = case_result(machine)
    long = replace(case, case=replace(case.case, profile=SpinProfile(time=times, speed=times)))
    rows = profiles(spin_result(machine, [long])).groups[0].rows
    assert len(rows) == 25
    assert rows[12].cells[0] == "477 more"


def test_numbers_are_rounded_with_a_true_minus() -> None:
    assert [number(-1.25), number(-0.04), number(float("inf")), number(2.0, 0)] == [
        "−1.2",
        "0.0",
        "–",
        "2",
    ]


def test_slack_springs_are_warned_of(machine: MachineParameters) -> None:
    loads = {"middle": (0.0, 12.0, 0.0), "back": (0.0, 3.0, 40.0), "front": (-5.0, 1.0, 1.0)}
    cases = [slack_case(machine, load, tensions) for load, tensions in loads.items()]
    result = spin_result(machine, cases)
    (warning,) = [text for text in warnings_of(result) if "slack" in text]
    assert warning.startswith(
        "Springs go slack: left in load middle (with gasket), back (with gasket); "
        "rear in load middle (with gasket). A slack spring"
    )
    rows = [group.rows[0] for group in smallest_tensions(result).shown]
    assert [row.cells for row in rows][2] == ("−5.0", "1.0", "1.0")
    assert [row.kind for row in rows] == ["alarm", "alarm", ""]
    assert "smallest tension of each spring" in spin_page(result).lower()
    taut = spin_result(machine, [case_result(machine)])
    assert not any("slack" in text for text in warnings_of(taut))


def test_sensors_in_one_plane_have_one_orbit(machine: MachineParameters) -> None:
    record = case_result(machine).record
    apart, together = orbits_figure(record, -0.1, 0.1), orbits_figure(record, 0.1, 0.1)
    assert [len(figure.panels) for figure in (apart, together)] == [2, 1]
    titles = [panel.title for panel in together.panels]
    assert titles == ["y = 100 mm"]
