"""The page of `wm-drake machine check --page` in a real browser."""

import subprocess
import sys
from itertools import combinations

import pytest

pytestmark = [pytest.mark.browser, pytest.mark.slow]

BOXES = """return [...document.querySelectorAll('#machine-view text')].filter((t) => /^[XYZ][fr]$/.test(t.textContent))
  .map((t) => t.getBoundingClientRect()).map((b) => [b.left, b.right, b.top + 3, b.bottom - 3])"""


def test_labels_of_sensors_do_not_lie_over_each_other(browser, tmp_path):
    page = tmp_path / "machine.html"
    command = [sys.executable, "-m", "wm_drake", "machine", "check", "reference", "--page", page]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    browser.open(page)
    buttons = browser.wait("return document.querySelectorAll('.views button').length")
    for number in range(buttons):
        browser.run(f"document.querySelectorAll('.views button')[{number}].click()")
        boxes = browser.run(BOXES)
        assert len(boxes) >= 4
        for a, b in combinations(boxes, 2):
            is_apart = a[1] <= b[0] or b[1] <= a[0] or a[3] <= b[2] or b[3] <= a[2]
            assert is_apart, (number, a, b)
