import base64
import hashlib
import html
import re
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hand_made_records import case_result, spin_result
from pages import without_scripts

from wm_drake.parameters import MachineParameters, load_machine
from wm_drake.parameters.units import Unit
from wm_drake.report.figure import Cells
from wm_drake.report.formatting import number, signed
from wm_drake.report.scripts import packed_plotly
from wm_drake.report.table import readable
from wm_drake.simulation.spring_tension import slack_springs
from wm_drake.studies.facts import Facts
from wm_drake.studies.spin.data import amplitudes_of, differences_of, mounts_of, of_sensors
from wm_drake.studies.spin.figures import orbits_figure, revolution_starts, simplified_indices
from wm_drake.studies.spin.page import Files, spin_answer, warnings_of
from wm_drake.studies.spin.study import CaseResult, SpinRuns
from wm_drake.studies.spin.vibration import vibration_plots

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
    return spin_answer(result).page(Facts("wm-drake spin --set 'a=<b>'"))


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


def plots_of(tags: Tags) -> list[dict[str, str | None]]:
    return [attrs for attrs in tags.all("div") if attrs.get("class") == "plot"]


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
    images = plots_of(Tags(page))
    # three per case, the gaps, the floor, and the mount forces and accelerations of the first load
    assert len(images) == 10
    assert all(len(image["aria-label"] or "") > 20 for image in images)


def test_mount_forces_and_accelerations_of_planted_motion(
    result: SpinRuns, machine: MachineParameters
) -> None:
    forces = mounts_of(result)
    assert forces.range.values.tolist()[-1] == "300 to 400 rpm"
    of_middle = forces.isel(row=forces["load"].values == "middle")
    mounts = of_middle.mount.values.tolist()
    spring, gasket = (of_middle.isel(row=mounts.index(name)) for name in ("springs.left", "gasket"))
    assert [spring.at_rest.item(), spring.peak.item()] == pytest.approx([190.0, 190.0])
    # 20, 6 and 10 N in phase: length 23.2 N, RMS 16.4 N, all at 240 rpm
    length = 1000.0 * 0.02 * np.sqrt(1.0 + 0.3**2 + 0.5**2)
    assert gasket.peak.item() == pytest.approx(length, rel=3e-3)  # sampled sines
    assert gasket.speed.item() == pytest.approx(8.0 * np.pi)
    rms = [np.nan, np.nan, length / np.sqrt(2.0), np.nan]
    np.testing.assert_allclose(gasket.dynamic_rms, rms, rtol=3e-3)
    sensors = of_sensors(result).sel(load="middle")
    # the tub's angles are small: a = omega^2 d, within a few percent
    displacement = abs(result.results[0].record.displacement).max("time")
    expected = (8.0 * np.pi) ** 2 * displacement.sel(sensor=list(machine.sensors))
    np.testing.assert_allclose(sensors.largest_acceleration, expected, rtol=0.05)


@pytest.mark.slow
def test_detail_draws_the_vibration_of_every_load(result: SpinRuns, page: str) -> None:
    detailed = spin_answer(result, files=Files(detail=True)).page(Facts())
    counts = [len(plots_of(Tags(text))) for text in (page, detailed)]
    pictures = len(vibration_plots(result, result.results[0]))
    assert counts[1] - counts[0] == pictures * (len(result.results) - 1) > 0


def test_spectra_show_the_sensor_with_the_largest_amplitude(machine: MachineParameters) -> None:
    case = case_result(machine, samples=4000)
    plot = vibration_plots(spin_result(machine, [case]), case)[-1]
    sensor = str(case.measures.amplitude.idxmax("sensor").values)
    assert f"at sensor {sensor}, load middle" in plot.alternative
    marks = [mark for panel in plot.figure.panels for mark in panel.marks]
    cells = [mark for mark in marks if isinstance(mark, Cells)]
    assert len(cells) == 4  # maps of displacement and acceleration


def test_no_warning_where_all_is_well(page: str) -> None:
    assert 'class="warning"' not in page


@pytest.mark.usefixtures("without_drawing")
def test_diverged_case_is_warned_of_and_left_out_of_the_summary(machine: MachineParameters) -> None:
    good, bad = (
        case_result(machine, "back", size=0.01),
        case_result(machine, "middle", size=0.3, samples=12),
    )
    bad.record.attrs["diverged"] = DIVERGED
    answer = spin_answer(spin_result(machine, [bad, good]))
    page = answer.page(Facts())
    assert Tags(page).open == []
    box = page[page.index('<section class="warning"') :]
    assert DIVERGED in box[: box.index("</section>")]
    assert "load back" in answer.answer
    assert "load middle" not in answer.answer


@pytest.mark.usefixtures("without_drawing")
def test_all_cases_diverged_still_give_a_page(machine: MachineParameters) -> None:
    bad = case_result(machine, samples=1)
    bad.record.attrs["diverged"] = DIVERGED
    page = spin_answer(spin_result(machine, [bad])).page(Facts())
    assert DIVERGED in page
    assert "<figure" not in page


def test_overlap_is_warned_of(machine: MachineParameters) -> None:
    runs = spin_result(machine, [case_result(machine, gap=-0.003)])
    assert len(warnings_of(runs)) == 1
    gaps = spin_answer(runs).labelled()["gaps"].data
    assert (gaps.touches.item(), gaps.smallest_gap.item()) == (True, pytest.approx(-0.003))
    assert (gaps.moving_part.item(), gaps.part_of_the_housing.item()) == ("tub shell", "wall right")


@pytest.mark.parametrize(("gap", "size"), [(0.0187, "18.7 mm"), (-0.0169, "−16.9 mm")])
def test_a_gap_is_said_with_its_parts_speed_and_time(
    machine: MachineParameters, gap: float, size: str
) -> None:
    text = case_result(machine, gap=gap).gap_text
    assert re.findall(r"−?[\d.]+ [a-z]+", text) == [size, "240 rpm", "0.50 s"]


def test_page_says_the_steps_that_the_runs_took(machine: MachineParameters) -> None:
    cases = [case_result(machine), case_result(machine), case_result(machine)]
    shorter = {"integrator": "multistep", "step_s": 1.25e-3}
    cases[1] = replace(cases[1], record=cases[1].record.assign_attrs(shorter))
    text = dict(spin_answer(spin_result(machine, cases)).details)["Engine"]
    assert re.findall(r"[\d.]+ ms", text) == ["2.5 ms", "5 ms", "1.25 ms", "5 ms"]


def test_names_cannot_inject_markup(machine: MachineParameters) -> None:
    evil = "<script>alert('$x$')</script>"
    parameters = machine.model_copy(
        update={"name": evil, "about": evil, "loads": {evil: machine.loads["middle"]}}
    )
    runs = spin_result(
        parameters, [case_result(parameters, evil), case_result(parameters, evil, gasket=False)]
    )
    page = spin_answer(runs).page(Facts(evil))
    assert "<script>alert" not in page
    assert "<script" not in without_scripts(page)
    assert page.count(html.escape(evil, quote=False).replace("'", "&#39;")) > 5
    assert Tags(page).open == []


def labels(amplitudes: xr.Dataset) -> list[tuple[str, ...]]:
    columns = (amplitudes[name].values.tolist() for name in ("load", "gasket", "source"))
    return [*zip(*columns, strict=True)]


def test_amplitudes_have_only_measured_rows_that_match_a_case(
    result: SpinRuns, machine: MachineParameters
) -> None:
    amplitudes = amplitudes_of(result)
    sources = ("experiment", "Adams model of [B]", "wm_drake")
    assert labels(amplitudes) == [(n, "yes", s) for n in ("middle", "back") for s in sources]
    assert amplitudes.sensor.values.tolist() == list(machine.sensors)
    # half of [B] Table 1, middle load with gasket
    assert amplitudes.amplitude.values[0, 0] == pytest.approx(14.55e-3, rel=1e-12)
    np.testing.assert_array_equal(
        amplitudes.amplitude[2], result.results[0].measures.amplitude.sel(sensor=amplitudes.sensor)
    )


def test_amplitudes_tell_gasket_from_none(machine: MachineParameters) -> None:
    both = [case_result(machine, "counter", gasket) for gasket in (False, True)]
    amplitudes = amplitudes_of(spin_result(machine, both))
    experiment = amplitudes.isel(row=amplitudes.source.values == "experiment")
    assert experiment.gasket.values.tolist() == ["no", "yes"]
    found = experiment.amplitude.sel(sensor="Xr")
    np.testing.assert_allclose(found, [6.3e-3, 4.8e-3])  # half of [B] Table 1


def test_amplitudes_without_measurements_are_ours_alone(machine: MachineParameters) -> None:
    parameters = machine.model_copy(update={"measured": ()})
    amplitudes = amplitudes_of(spin_result(parameters, [case_result(parameters)]))
    assert amplitudes.source.values.tolist() == ["wm_drake"]
    assert differences_of(amplitudes).sizes["row"] == 0


def test_a_written_table_of_amplitudes_can_be_read_as_measurements(
    result: SpinRuns, machine: MachineParameters, tmp_path: Path
) -> None:
    spin_answer(result, files=Files(records=False)).write(tmp_path)
    measured = machine.model_copy(update={"measured": (str(tmp_path / "amplitudes.csv"),)})
    again = amplitudes_of(spin_result(measured, result.results[:1]))
    first = amplitudes_of(result).amplitude.values[2]
    assert [source for *_, source in labels(again)].count("wm_drake") == 2
    np.testing.assert_allclose(again.amplitude.values[2:], [first, first], rtol=1e-8)


def test_differences_from_the_experiment_by_hand(machine: MachineParameters) -> None:
    case = case_result(machine, "middle")
    amplitude = case.measures.amplitude.copy(
        data=1e-3 * np.array([17.46, 4.35, 4.725, 11.95, 2.0, 1.15])
    )
    table = case.measures.table.assign(amplitude=amplitude)
    result = spin_result(machine, [replace(case, measures=replace(case.measures, table=table))])
    # half of 29.1, 8.7, 18.9, 23.9, 8.0, 23.0 mm: 34.92 / 29.1 = 1.2, 9.45 / 18.9 = 0.5, 4 / 8 = 0.5, 2.3 / 23 = 0.1
    differences = differences_of(amplitudes_of(result))
    ours = differences.isel(row=differences.source.values == "wm_drake")
    np.testing.assert_allclose(ours.difference, [[0.2, 0.0, -0.5, 0.0, -0.5, -0.9]], atol=1e-11)
    assert ours.mean_absolute.item() == pytest.approx(0.35)  # 2.1 / 6
    shown = spin_answer(result).labelled()["differences"].table().shown
    assert shown[0].rows[-1].cells[2:] == ("35", "+20", "0", "−50", "0", "−50", "−90")


def test_same_result_gives_the_same_page(result: SpinRuns, page: str) -> None:
    footer = re.compile(r"<footer>.*?</footer>", re.DOTALL)  # has the date
    again = spin_answer(result).page(Facts("wm-drake spin --set 'a=<b>'"))
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
    [(12.34, "+12"), (-3.6, "−4"), (-0.4, "0"), (0.4, "0"), (float("nan"), "–")],
)
def test_difference_is_written_with_its_sign(value: float, text: str) -> None:
    assert signed(value) == text


def test_long_lists_are_shown_by_their_ends() -> None:
    times = tuple(np.linspace(0.0, 2.0, 501).tolist())
    assert readable(times, Unit("s", "s")) == "501 values, 0 s to 2 s"


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
    slack = {case.case.name: slack_springs(case.measures.smallest_tension) for case in cases}
    assert slack == {"middle": ["left", "rear"], "back": ["left"], "front": []}
    springs = spin_answer(result).tables()["springs"].set_index("load")
    assert springs.loc["front", ["left_N", "right_N", "rear_N"]].tolist() == [-5.0, 1.0, 1.0]
    assert springs.is_slack.tolist() == [True, True, False]
    taut = spin_result(machine, [case_result(machine)])
    assert warnings_of(taut) == []


def test_sensors_in_one_plane_have_one_orbit(machine: MachineParameters) -> None:
    record = case_result(machine).record
    apart, together = orbits_figure(record, -0.1, 0.1), orbits_figure(record, 0.1, 0.1)
    assert [len(figure.panels) for figure in (apart, together)] == [2, 1]
    titles = [panel.title for panel in together.panels]
    assert titles == ["y = 100 mm"]
