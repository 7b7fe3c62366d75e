"""Report pages in a real browser: controls work, names are text, print and dark colours."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from accessibility import serious_faults
from hand_made_records import case_result, spin_result

from wm_drake import build_machine
from wm_drake.parameters import load_machine, varying
from wm_drake.parameters.units import Unit
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.report.figure import MARK, MEASURED, Axis, Figure, Line, Panel, Rule, Span, in_grid
from wm_drake.report.page import picture, render
from wm_drake.report.quantity import Quantity, shown
from wm_drake.simulation.cases import Case
from wm_drake.studies.doe.design import make_design
from wm_drake.studies.facts import Facts
from wm_drake.studies.gasket.page import gasket_answer
from wm_drake.studies.gasket.screening import at, run_screening, runs_of
from wm_drake.studies.gasket.study import GasketTrials
from wm_drake.studies.gasket.surface import models_of, predicted
from wm_drake.studies.machine_show.page import machine_answer
from wm_drake.studies.spin.page import spin_answer

pytestmark = [pytest.mark.browser, pytest.mark.slow]

READY = "return document.documentElement.dataset.pictures === 'ready'"
HOSTILE = "<b>b</b><a href='javascript:1'>x</a> %{x} $y$"


@pytest.fixture(scope="module")
def machine():
    return load_machine("reference")


@pytest.fixture(scope="module")
def screening(machine):
    factors = varying(machine, gasket_entries())
    loads = ("middle", "counter")
    cases = [Case(name, machine.loads[name], machine.profile, True) for name in loads]
    trials = GasketTrials(factors, cases)
    quantities = {
        "Dx": Quantity("displacement x", Unit("m", "mm")),
        "Fz": Quantity("force z", Unit("N", "N")),
        "Mx": Quantity("moment x", Unit("N*m", "N*m")),
    }

    def evaluate(design):
        x = design.levels.astype(float)
        noise = 0.05 * np.random.default_rng(0).normal(size=len(x))
        one = {
            "Dx": 1e-3 * (20.0 - 2.0 * x[:, 0] + x[:, 2] ** 2 + noise),
            "Fz": 30.0 + x[:, 2] * x[:, 3] + noise,
            "Mx": 5.0 + x[:, 0] - 0.5 * x[:, 4] + noise,
        }
        more = {name: 1.2 * values for name, values in one.items()}
        return runs_of({"middle": one, "counter": more}, quantities)

    names = factors.names
    design = make_design("d-optimal", names, trials=200, model="main+2fi", seed=1)
    return run_screening(design, evaluate), trials


def spin_page(machine, _):
    runs = spin_result(machine, [case_result(machine, "middle", samples=4000)])
    return spin_answer(runs).page(Facts())


def gasket_page(_, screening):
    data, trials = screening
    return gasket_answer(data, models_of(data), trials).page(Facts())


@pytest.fixture(scope="module")
def pages(machine, screening, tmp_path_factory):
    """Return a function that writes a kind of page once and returns its file."""
    folder, made = tmp_path_factory.mktemp("pages"), {}

    def of(kind):
        if kind not in made:
            made[kind] = folder / f"{kind.__name__}.html"
            made[kind].write_text(kind(machine, screening), encoding="utf-8")
        return made[kind]

    return of


def opened(browser, path, width=1400, *, dark=False):
    browser.size(width)
    browser.media(dark=dark)
    browser.open(path)
    browser.wait(READY, timeout=60.0)
    browser.run("Pictures.all()")


@pytest.mark.parametrize("kind", [spin_page, gasket_page])
def test_page_has_no_serious_fault_of_accessibility(browser, pages, kind):
    opened(browser, pages(kind))
    assert serious_faults(browser) == []


def test_a_page_that_is_only_loaded_shows_every_picture(browser, pages):
    """Programs that print a page or take a picture of it do so when it is loaded."""
    browser.size(1400)
    browser.open(pages(spin_page))  # waits for the event load
    missing = "return document.querySelectorAll('figure[data-picture]:not([data-drawn])').length"
    assert browser.run(missing) == 0
    assert browser.run("return document.querySelectorAll('iframe').length") == 0


def test_folded_sections_open_by_a_link(browser, pages):
    opened(browser, pages(gasket_page))
    closed = "return document.querySelectorAll('details:not([open])').length"
    count = browser.run(closed)
    browser.run("location.hash = '#load-middle'")
    browser.wait(f"return document.querySelectorAll('details:not([open])').length === {count - 1}")
    drawn = "return !!document.querySelector('#load-middle figure[data-drawn] .main-svg')"
    browser.wait(drawn)
    browser.find("a[href='#everything']").click()
    browser.wait("return !document.querySelector('details:not([open])')")
    assert count > 3


def test_what_is_folded_is_not_printed_and_the_paper_says_so(browser, pages):
    opened(browser, pages(gasket_page))
    few = browser.sheets()
    visible = "return getComputedStyle(document.querySelector(arguments[0])).display !== 'none'"
    browser.media(media="print")
    parts = (".on-paper", "#load-middle", "#explore", "#contributions")
    assert [browser.run(visible, part) for part in parts] == [True, False, False, True]
    browser.run("location.hash = '#load-middle'")
    browser.wait(visible, "#load-middle")
    browser.run("location.hash = '#everything'")
    browser.wait("return !document.querySelector('details:not([open])')")
    assert [browser.run(visible, part) for part in parts] == [False, True, True, True]
    browser.media()
    assert few <= 12 < browser.sheets()


def test_machine_page_turns_and_names_parts(browser, tmp_path):
    page = tmp_path / "machine.html"
    answer = machine_answer(build_machine("reference"), [])
    page.write_text(answer.page(Facts()), encoding="utf-8")
    browser.open(page)
    assert serious_faults(browser) == []
    spring = "document.querySelector('g[data-name=left] path.spring')"
    before = browser.run(f"return {spring}.getAttribute('d')")
    browser.run("document.querySelectorAll('.views button')[1].click()")
    assert before != browser.run(f"return {spring}.getAttribute('d')")
    browser.run(f"{spring}.parentNode.dispatchEvent(new PointerEvent('pointerenter'))")
    assert browser.run("return document.querySelector('.pointed').textContent").startswith("spring")
    assert browser.errors() == []


def test_print_draws_every_picture_on_a4_in_light_colours(browser, pages):
    browser.size(1400)
    browser.media(dark=True)
    browser.open(pages(spin_page))
    browser.wait(READY, timeout=60.0)
    browser.driver.execute_cdp_cmd("Page.printToPDF", {"paperWidth": 8.27, "paperHeight": 11.69})
    missing = "return document.querySelectorAll('figure[data-picture]:not([data-drawn])').length"
    assert browser.run(missing) == 0
    browser.size(690)
    browser.media(media="print")
    browser.run("dispatchEvent(new Event('beforeprint'))")
    wide = (
        "return [...document.querySelectorAll('.plot')].map(p => p.getBoundingClientRect().width)"
    )
    assert max(browser.run(wide)) <= 690
    ink = "return getComputedStyle(document.querySelector('.plot .xtick text')).fill"
    assert browser.run(ink) == "rgb(82, 96, 109)"
    browser.run("dispatchEvent(new Event('afterprint'))")


def test_dark_scheme_has_light_words_and_axes(browser, pages):
    opened(browser, pages(spin_page), dark=True)
    assert (
        browser.run("return getComputedStyle(document.body).backgroundColor") == "rgb(20, 24, 29)"
    )
    ink = "return getComputedStyle(document.querySelector('.plot .xtick text')).fill"
    assert browser.run(ink) == "rgb(154, 165, 177)"


def small_page(title):
    marks = (
        Span(0.5, 0.75, color="#e2e5ea"),
        Line([0.0, 1.0, 2.0], [0.0, 1.0, 4.0], key="computed"),
        Line([0.0, 2.0], [1.0, 1.0], color=MEASURED, dash="dashed", key="measured"),
        Rule(3.0, color=MARK),
    )
    x, y = Axis(label="time, s", range=(0.0, 2.0)), Axis(range=(-0.2, 4.2))
    named = replace(x, ticks=((0.0, "start"), (2.0, "the end of the run")))
    panels = [
        Panel(title=title, marks=marks, x=x, y=y),
        Panel(title="second", marks=marks, x=named),
    ]
    figure = Figure(panels=in_grid(panels, 2))
    body = {"title": "t", "about": "", "warnings": [], "summary": "s"}
    return body, picture(figure, "Two panels.", "Caption.")


@pytest.fixture
def small(tmp_path, monkeypatch):
    from jinja2 import DictLoader

    import wm_drake.report.page as module

    own = module.FileSystemLoader

    class Both(DictLoader):
        def get_source(self, environment, name):
            try:
                return super().get_source(environment, name)
            except Exception:
                return own(Path(module.__file__).parent).get_source(environment, name)

    text = (
        '{% extends "page.html" %}{% from "macros.html" import picture %}'
        "{% block pictures %}{{ picture(p) }}{% endblock %}"
    )
    monkeypatch.setattr(module, "FileSystemLoader", lambda _: Both({"small.html": text}))

    def write(title):
        body, shown = small_page(title)
        path = tmp_path / "small.html"
        path.write_text(render("small.html", **body, p=shown), encoding="utf-8")
        return path

    return write


def test_markup_in_a_name_is_text(browser, small):
    opened(browser, small(HOSTILE))
    texts = browser.run(
        "return [...document.querySelectorAll('.plot text')].map(t => t.textContent)"
    )
    assert HOSTILE.replace(" ", "") in [text.replace(" ", "") for text in texts]  # in two lines
    assert browser.run("return document.querySelectorAll('.plot a').length") == 0
    assert (
        browser.run("return document.querySelector('.panels button:nth-child(2)').textContent")
        == HOSTILE
    )
    assert browser.errors() == []


def test_bands_lines_and_the_last_tick_are_where_they_belong(browser, small):
    opened(browser, small("first"))
    box = """const box = n => { const r = n.getBoundingClientRect(); return [r.left, r.right, r.top, r.bottom]; };
        const plot = document.querySelector('.plot'), shown = selector => [...plot.querySelectorAll(selector)].map(box);
        return [box(plot), shown('.nsewdrag'), shown('.shapelayer path'), shown('.xtick text')]"""
    plot, panels, shapes, ticks = browser.run(box)
    left, right, top, bottom = panels[0]
    band = next(s for s in shapes if s[1] - s[0] < 0.5 * (right - left))
    at = [(edge - left) / (right - left) for edge in band[:2]]
    assert at == pytest.approx([0.25, 0.375], abs=0.01)
    assert band[2:] == pytest.approx([top, bottom], abs=2.0)
    rule = next(s for s in shapes if s[1] - s[0] > 0.9 * (right - left))
    assert (bottom - rule[2]) / (bottom - top) == pytest.approx(3.2 / 4.4, abs=0.02)
    assert "the end of the run" in browser.run("return document.querySelector('.plot').textContent")
    assert max(tick[1] for tick in ticks) <= plot[1]


def test_curves_and_panels_are_switched_and_zoomed(browser, small):
    from selenium.webdriver.common.action_chains import ActionChains

    opened(browser, small("first"))
    lines = "return document.querySelectorAll('.plot .scatterlayer .js-line').length"
    assert browser.run(lines) == 4
    browser.find(".legend button:nth-child(2)").click()
    assert browser.run(lines) == 2
    assert browser.find(".legend button:nth-child(2)").get_attribute("aria-pressed") == "false"
    browser.find(".legend button:nth-child(2)").click()
    browser.find(".panels button:nth-child(3)").click()
    assert browser.run(lines) == 2
    assert browser.run("return document.querySelectorAll('.plot .subplot').length") == 1
    limits = "return document.querySelector('.plot').layout.xaxis2.range.slice()"
    before = browser.run(limits)
    area = browser.find(".plot .nsewdrag")
    ActionChains(browser.driver).move_to_element(area).click_and_hold().move_by_offset(
        150, 60
    ).release().perform()
    browser.wait(
        "return document.querySelector('.plot').layout.xaxis2.range[0] > arguments[0] + 0.5",
        before[0],
    )
    after = browser.run(limits)
    assert before[0] < after[0] < after[1] < before[1]


def test_profiler_shows_the_fitted_model(browser, pages, screening):
    opened(browser, pages(gasket_page))
    places = [0.3, -0.7, 0.5, 0.0, -1.0, 0.25, 1.0, -0.2]
    expected = predicted(models_of(screening[0]), [places]).isel(setting=0)
    for label in (("middle", "Dx"), ("counter", "Fz")):
        call = f"return Explore.{{}}('{label[0]}', '{label[1]}', arguments[0])"
        value, half = (browser.run(call.format(f), places) for f in ("predict", "halfWidth"))
        assert value == pytest.approx(shown(at(expected.predicted, label)).item(), rel=1e-5)
        assert half == pytest.approx(shown(at(expected.half_width, label)).item(), rel=1e-4)
    before = browser.run("return document.querySelector('.profiler .line').getAttribute('d')")
    browser.run(
        "const s = document.getElementById('factor-1'); s.value = 1;"
        "s.dispatchEvent(new Event('input'));"
    )
    assert "C_T=90 N*mm*s/deg" in browser.find(".setting code").text
    assert (
        browser.run("return document.querySelector('.profiler .line').getAttribute('d')") != before
    )
