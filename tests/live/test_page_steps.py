"""Steps of a page whose numbers are moved: where they change, and which of them a run takes."""

import json
import shutil
import subprocess

import pytest

from wm_drake.engines.compiled.stepping import Stepping
from wm_drake.export.page_steps import PRECISION, _pieces
from wm_drake.live.exported import bundled

FULL, HALF, FOUR = (
    Stepping("multistep", 2e-3),
    Stepping("multistep", 1e-3),
    Stepping("runge_kutta", 2e-3),
)


def test_each_value_is_found_from_which_on_a_run_is_stepped_otherwise():
    def stepping_at(value):
        return FULL if value < 1.2 else HALF if value < 1.7 else FOUR if value < 1.9 else None

    (half, first), (four, second), (none, third) = _pieces(stepping_at, FULL, 1.0, 2.0)
    assert (first, second, third) == (HALF, FOUR, None)
    assert [half, four, none] == pytest.approx([1.2, 1.7, 1.9], abs=PRECISION)
    assert not [*_pieces(stepping_at, FULL, 1.0, 0.5)]
    assert [how for _, how in _pieces(lambda value: stepping_at(-value), FULL, -1.0, -1.5)] == [
        HALF
    ]


CALL = """
const exported = {step: 2e-3, integrator: 'multistep', stepsBefore: 5, largestTurns: {multistep: 0.2, runge_kutta: 1e300}};
const moved = [
  {place: 7, low: 1, high: 2, integrator: 'multistep', step: 1e-3},
  {place: 8, low: 1, high: 2, integrator: 'runge_kutta', step: 2e-3},
  {place: 9, low: 1, high: 2, integrator: 'multistep', step: 4e-3},
];
const model = {at: {parameters: 6}, stepping: {...exported, moved}};
const steps = (changes, speed) => {
  const {integrator, step, stepsBefore} = modules.machine.steppingOf({speed}, model, changes);
  return [integrator, step, stepsBefore];
};
console.log(JSON.stringify(CASES.map((one) => steps(...one))));
"""
SLOW, FAST = [0.0, 10.0], [0.0, 150.0]


def test_a_run_takes_the_shortest_steps_of_the_moved_numbers():
    cases = {
        "as exported": [[], SLOW],
        "a number with others": [[[7, 1.5]], SLOW],
        "beyond them": [[[7, 2.5]], SLOW],
        "two numbers": [[[7, 1.5], [8, 1.5]], SLOW],
        "a longer step": [[[9, 1.5], [2, 1.0]], SLOW],  # place 2 is of the load
        "with a number that keeps the step": [[[9, 1.5], [10, 1.0]], SLOW],
        "a faster drum": [[[10, 1.0]], FAST],
    }
    expected = [
        ["multistep", 2e-3, 5],
        ["multistep", 1e-3, 5],
        ["multistep", 2e-3, 5],
        ["runge_kutta", 2e-3, -1],
        ["multistep", 4e-3, 5],
        ["multistep", 2e-3, 5],
        ["multistep", 1e-3, 5],
    ]
    if shutil.which("node") is None:
        pytest.skip("no node: install Debian's nodejs")
    call = CALL.replace("CASES", json.dumps([*cases.values()]))
    text = f"{bundled('machine', {})}{call}"
    ended = subprocess.run(["node", "-"], input=text, capture_output=True, text=True, check=True)
    assert dict(zip(cases, json.loads(ended.stdout), strict=True)) == dict(
        zip(cases, expected, strict=True)
    )
