"""Faults of accessibility that axe-core finds in an open page."""

import importlib.util
from pathlib import Path

import pytest

RUN = """const done = arguments[0];
document.querySelectorAll('.plot').forEach((plot, n) => n && plot.setAttribute('data-alike', ''));
axe.run({exclude: [['[data-alike]']]}, {resultTypes: ['violations']}).then(
  found => done(found.violations.filter(one => ['serious', 'critical'].includes(one.impact))
    .map(one => `${one.id}: ${one.nodes[0].html.slice(0, 200)}`)),
  error => done([String(error)]))"""


def serious_faults(browser):
    """Return the serious and critical faults; the test is skipped without axe-core.

    Of the drawings, which one function draws, the first is looked at: axe-core takes 20 s for all.
    """
    package = importlib.util.find_spec("axe_selenium_python")
    if package is None:
        pytest.skip("needs axe-selenium-python, which brings axe-core")
    (script,) = Path(package.origin).parent.rglob("axe.min.js")
    browser.run(script.read_text(encoding="utf-8"))
    browser.driver.set_script_timeout(120)
    return browser.driver.execute_async_script(RUN)
