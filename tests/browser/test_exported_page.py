"""A machine that runs in a page: its numbers are those of `wm-drake spin`, whatever is moved."""

import base64
import json
import re

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.parameters import shipped_machines
from wm_drake.simulation.displacements import amplitudes, filtered_displacement
from wm_drake.studio.exported import export_page
from wm_drake.studio.machines import OpenMachine

pytestmark = [pytest.mark.browser]

DISPLACEMENT, AMPLITUDE, GAP = 1e-6, 1e-3, 1e-4
"""Accuracies: of displacements before the filter, relative to the largest; of amplitudes, relative;
of the gap [m]."""
ANSWER = """
const [job, done] = arguments;
const data = JSON.parse(document.getElementById('machine-data').textContent);
const begin = async () => {
  const url = URL.createObjectURL(new Blob([data.worker], {type: 'text/javascript'}));
  const bytes = Uint8Array.from(atob(data.wasm), (letter) => letter.charCodeAt(0));
  const worker = new Worker(url);
  worker.postMessage({module: await WebAssembly.compile(bytes), model: data.model});
  return worker;
};
const asked = async (kind) => {
  globalThis.tried ??= await begin();
  const found = new Promise((resolve, reject) => {
    globalThis.tried.onmessage = (event) => resolve(event.data);
    globalThis.tried.onerror = (event) => reject(event.message);
  });
  globalThis.tried.postMessage({...job, profile: data.profile, kind});
  return found;
};
const text = (numbers) => {
  const bytes = new Uint8Array(numbers.buffer);
  let letters = '';
  for (let k = 0; k < bytes.length; k += 32768) letters += String.fromCharCode(...bytes.subarray(k, k + 32768));
  return btoa(letters);
};
(async () => {
  const {sizes, gap} = await asked('numbers');
  const {moved} = await asked('samples');
  done({sizes: Array.from(sizes), gap, moved: text(moved)});
})().catch((error) => done({failed: String(error)}));
"""


def data_of(path):
    """Return what a page knows of its machine."""
    text = path.read_text(encoding="utf-8")
    return json.loads(re.search(r'id="machine-data">(.*?)</script>', text, re.DOTALL)[1])


def changes_of_load(data, name):
    """Return the changes of the array of an instance for a load."""
    at, load = data["model"]["at"], data["loads"][name]
    fields = ("mass", "phase", "y", "radius")
    return [
        *(
            [at["unbalances"] + 4 * k + i, mass[field]]
            for k, mass in enumerate(load["unbalances"])
            for i, field in enumerate(fields)
        ),
        *([at["of_load"] + k, value] for k, value in enumerate(load["harmonics"])),
    ]


def of_page(browser, data, load, changes):
    """Return displacements before the filter (n, sensors), amplitudes and gap of the page. [m]"""
    job = {"changes": [*changes, *changes_of_load(data, load)]}
    found = browser.driver.execute_async_script(ANSWER, job)
    assert "failed" not in found, found
    moved = np.frombuffer(base64.b64decode(found["moved"])).reshape(
        data["model"]["count"]["points"], -1
    )
    sensors = data["model"]["count"]["sensors"]
    gap = found["gap"] and found["gap"]["distance"]
    return moved[:sensors].T, np.array(found["sizes"], dtype=float), gap


def check_equal(browser, data, machine, scene, load, changes=(), parameters=None):
    """Check a run of the page against one of the engine with its own choice of steps."""
    moved, sizes, gap = of_page(browser, data, load, changes)
    case = wm.case_of(parameters or machine.parameters, load)
    record = wm.simulate(machine, case)
    expected = record.displacement.values
    assert moved.shape == expected.shape
    largest = np.abs(expected).max(axis=0)
    assert (np.abs(moved - expected).max(axis=0) <= DISPLACEMENT * largest).all()
    np.testing.assert_allclose(
        sizes, amplitudes(filtered_displacement(record).values)[0], AMPLITUDE
    )
    smallest = wm.measure(record, scene).smallest_gap
    assert (gap is None) == (smallest is None)
    if gap is not None:
        assert abs(gap - smallest.distance) <= GAP


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(shipped_machines()))
def test_numbers_are_those_of_spin_after_each_slider_was_moved(browser, tmp_path, name):
    parameters = wm.load_machine(name)
    path = tmp_path / "machine.html"
    export_page(parameters, path)
    data = data_of(path)
    browser.open(path)
    machine, scene = wm.build_machine(parameters), wm.Scene(parameters)
    opened = OpenMachine(parameters, machine, scene)
    load = next(iter(parameters.loads))
    for one in parameters.loads:
        check_equal(browser, data, machine, scene, one)
    for number in data["machine"]["numbers"]:
        key = number["key"]
        if key in data["model"]["places"]:
            value = number["value"] + 0.3 * (number["high"] - number["value"])
            value *= number["units"][number["unit"]]
            step = value - float(opened.sliders[key].number.nominal or 0.0)
            moved = opened.moved_by(parameters, key, step)
            change = [[data["model"]["places"][key], value]]
            check_equal(browser, data, machine, scene, load, change, moved)
