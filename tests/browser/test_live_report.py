"""Reports with a machine that runs in them: folded, loaded when opened, the same numbers."""

import pytest

import wm_drake as wm
from wm_drake.studies.facts import Facts

pytestmark = [pytest.mark.browser, pytest.mark.slow]

XR = "return document.querySelector('#measures [data-row^=Xr] td.now')?.textContent"


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """Return result and report of a short run of one load."""
    folder = tmp_path_factory.mktemp("report")
    result = wm.run_study("spin", load=["middle"], live=True, quiet=True)
    (folder / "report.html").write_text(result.page(Facts()), encoding="utf-8")
    return result, folder / "report.html"


def test_machine_in_a_report_runs_when_it_is_opened(browser, report):
    result, path = report
    browser.open(path)
    assert browser.run("return document.querySelector('details.live iframe').src") == ""
    browser.run("document.querySelector('details.live').open = true")
    frame = browser.wait(
        "const f = document.querySelector('details.live iframe'); return f.src && f"
    )
    browser.driver.switch_to.frame(frame)
    shown = float(browser.wait(XR, timeout=120.0))
    browser.driver.switch_to.default_content()
    row = next(r for r in result.as_json()["sensors"] if r["sensor"] == "Xr")
    assert row["amplitude_mm"] == pytest.approx(shown, abs=6e-3)
    assert not browser.errors()
