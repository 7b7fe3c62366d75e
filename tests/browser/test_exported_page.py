"""A machine that runs in a page: its numbers in a browser, what it writes, how it looks."""

import json
import shlex

import numpy as np
import pytest
from accessibility import serious_faults
from exported_machine import NodePage, changes_of_load, movable, moved_value, page_run

import wm_drake as wm
from wm_drake.live import exported as exported_page
from wm_drake.live.exported import export_page
from wm_drake.parameters import shipped_machines
from wm_drake.simulation.displacements import amplitudes, filtered_displacement
from wm_drake.studies.inputs import load_parameters

pytestmark = [pytest.mark.browser]

ANSWER = """
const [job, done] = arguments;
const data = JSON.parse(document.getElementById('machine-data').textContent);
const text = (numbers) => {
  const bytes = new Uint8Array(numbers.buffer);
  let letters = '';
  for (let k = 0; k < bytes.length; k += 32768) letters += String.fromCharCode(...bytes.subarray(k, k + 32768));
  return btoa(letters);
};
(async () => {
  const worker = new Worker(URL.createObjectURL(new Blob([data.worker], {type: 'text/javascript'})));
  const bytes = Uint8Array.from(atob(data.wasm), (letter) => letter.charCodeAt(0));
  worker.postMessage({module: await WebAssembly.compile(bytes), model: data.model});
  const asked = (kind) => new Promise((resolve, reject) => {
    worker.onmessage = (event) => resolve(event.data);
    worker.onerror = (event) => reject(event.message);
    worker.postMessage({...job, profile: data.profile, kind});
  });
  const {sizes, gap, status} = await asked('numbers');
  const {moved} = await asked('samples');
  done({sizes: Array.from(sizes), gap, status, moved: text(moved)});
})().catch((error) => done({failed: String(error)}));
"""


MACHINES = [
    pytest.param(name, marks=pytest.mark.slow if name == "reference" else pytest.mark.hours)
    for name in sorted(shipped_machines())
]


@pytest.mark.parametrize("name", MACHINES)
def test_a_browser_computes_the_bits_that_node_computes(browser, tmp_path, name):
    # so that tests of the numbers need no browser: tests/live/test_page_numbers.py
    parameters, path = wm.load_machine(name), tmp_path / "machine.html"
    export_page(parameters, path)
    page = NodePage(path)
    load, number = next(iter(parameters.loads)), movable(page.data)[0]
    changes = [[page.data["model"]["places"][number["key"]], moved_value(number)]]
    expected = page.run(load, changes)
    page.close()
    browser.open(path)
    job = {"changes": [*changes, *changes_of_load(page.data, load)]}
    answer = browser.driver.execute_async_script(ANSWER, job)
    assert "failed" not in answer, answer
    found = page_run(page.data, answer)
    np.testing.assert_array_equal(found.moved, expected.moved)
    np.testing.assert_array_equal(found.sizes, expected.sizes)
    assert found.gap == expected.gap


XR = "return document.querySelector('#measures [data-row^=Xr] td.now')?.textContent"
TYPED = """
const [key, text] = arguments;
const field = document.querySelector(`[data-key="${key}"] input.text`);
field.value = text;
field.dispatchEvent(new Event('input', {bubbles: true}));
field.dispatchEvent(new Event('change', {bubbles: true}));
"""
SETTLED = (
    "return document.body.getAttribute('aria-busy') === 'false' && !document.querySelector('.old')"
)
MOVED = {
    "damper_types.friction.friction_force": "30 N",
    "frames.spring_left_tub.position.2": "120 mm",
    "gasket.stiffness_y": "2 N/mm",
    "bodies.motor.mass": "8 kg",
    "loads.middle.unbalances.0.mass": "0.8 kg",
    "profile.speed.1": "380 rpm",
}
"""A number, an entry of a vector, a table, a body, a load and a profile."""


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "machine.html"
    export_page(wm.load_machine("reference"), path)
    return path


@pytest.fixture
def page(browser, exported):
    browser.open(exported)
    browser.wait(XR, timeout=120.0)
    browser.wait(SETTLED, timeout=60.0)
    return browser


@pytest.mark.slow
def test_command_and_file_give_the_machine_of_the_page(page, tmp_path):
    for key, text in MOVED.items():
        page.run(TYPED, key, text)
    page.wait(SETTLED, timeout=60.0)
    shown = page.run("return document.getElementById('problems').textContent")
    assert shown == ""
    page.run("document.getElementById('load').value = 'middle'")
    page.run("document.getElementById('load').dispatchEvent(new Event('change'))")
    page.wait(SETTLED, timeout=60.0)
    page.run("document.getElementById('copy-command').click()")
    command = page.wait("return document.getElementById('command').textContent")
    program, study, *options = shlex.split(command)
    assert [program, study, *options[:4]] == [
        "wm-drake", "spin", "--machine", "reference", "--load", "middle"
    ]  # fmt: skip
    parameters = load_parameters("reference", options[5::2])
    record = wm.simulate(wm.build_machine(parameters), "middle")
    largest = 1e3 * amplitudes(filtered_displacement(record).values)[0]
    rows = page.run(
        "return [...document.querySelectorAll('#measures td.now')].map((cell) => cell.textContent)"
    )
    np.testing.assert_allclose([float(text) for text in rows[: len(largest)]], largest, atol=6e-3)
    page.run(
        "URL.createObjectURL = (blob) => { blob.text().then((text) => { window.saved = text; });"
        " return 'data:,'; }"
    )
    page.run("document.getElementById('download').click()")
    path = tmp_path / "changed.yaml"
    path.write_text(page.wait("return window.saved"), encoding="utf-8")
    read, expected = (
        machine.model_dump(exclude={"name", "about", "sources", "measured", "published"})
        for machine in (wm.load_machine(path), parameters)
    )
    for section, values in expected.items():
        found, wanted = flat(read[section]), flat(values)
        assert found.keys() == wanted.keys(), section
        for key, value in wanted.items():
            is_number = isinstance(value, float)
            assert found[key] == (pytest.approx(value, rel=1e-9) if is_number else value), key


def flat(node, key=""):
    """Return the numbers and texts of a tree by key path."""
    if isinstance(node, dict):
        items = node.items()
    elif isinstance(node, list | tuple):
        items = enumerate(node)
    else:
        return {key: node}
    return {k: v for name, value in items for k, v in flat(value, f"{key}.{name}").items()}


@pytest.mark.slow
def test_what_is_wrong_is_said_and_the_last_run_stays(page):
    before = page.run(XR)
    page.run(TYPED, "damper_types.friction.friction_force", "30 kg")
    wrong = page.wait(
        "const row = document.querySelector('[data-key=\"damper_types.friction.friction_force\"]');"
        "return row.classList.contains('wrong') && row.querySelector('.problem').textContent"
    )
    assert "N" in wrong
    page.run(TYPED, "damper_types.friction.friction_force", "-1 N")
    page.wait(
        "return document.querySelector('.problem:not([hidden])')?.textContent.includes('allowed')"
    )
    assert page.run(XR) == before


@pytest.mark.slow
def test_texts_of_a_machine_are_never_markup(browser, tmp_path, monkeypatch):
    bad = "</script><b class='bad'>x</b>"
    text = json.dumps(exported_page.page_data(wm.load_machine("reference")))
    text = text.replace('"middle"', json.dumps(bad)).replace("detergent box", bad.replace('"', ""))
    data = json.loads(text)
    data["machine"]["about"] = bad + "a" * 10_000
    monkeypatch.setattr(exported_page, "page_data", lambda parameters: data)
    export_page(wm.load_machine("reference"), tmp_path / "machine.html")
    browser.open(tmp_path / "machine.html")
    browser.wait(XR, timeout=120.0)
    assert browser.run("return document.querySelectorAll('.bad').length") == 0
    assert bad in browser.run("return document.getElementById('load').textContent")
    assert not browser.errors()


@pytest.mark.slow
def test_a_phone_shows_all_without_scrolling_sideways(page):
    page.size(390)
    assert page.run("return document.documentElement.scrollWidth <= window.innerWidth")
    assert serious_faults(page) == []


@pytest.mark.slow
def test_paper_has_the_verdict_and_no_empty_side_bar(page):
    left = "return document.querySelector('main').getBoundingClientRect().left"
    on_screen = page.run(left)
    page.media(media="print")
    try:
        assert page.run(left) < 0.2 * on_screen
        assert page.find("#verdict").is_displayed()
        assert not page.find("#search").is_displayed()
        assert (
            page.run("return getComputedStyle(document.querySelector('tr')).breakInside") == "avoid"
        )
    finally:
        page.media()


@pytest.mark.slow
def test_texts_of_the_profile_are_as_large_as_the_others(page):
    size = (
        "const svg = document.querySelector(arguments[0]);"
        "return svg.getBoundingClientRect().width / svg.viewBox.baseVal.width"
    )
    profile, envelope = page.run(size, "#profile svg"), page.run(size, "#envelopes svg")
    assert profile == pytest.approx(envelope, rel=0.25)


@pytest.mark.slow
def test_search_lists_what_the_machine_has_first(page):
    page.find("#search").send_keys("friction")
    parts = (
        "return [...document.querySelectorAll('#numbers > .part:not([hidden])')]"
        ".sort((a, b) => a.getBoundingClientRect().top - b.getBoundingClientRect().top)"
        ".map((part) => part.querySelector('summary').textContent)"
    )
    shown = page.run(parts)
    assert "gasket" in shown
    assert shown.index("dampers") < shown.index("gasket")
