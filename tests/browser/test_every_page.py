"""Every kind of page in a real browser: order of its parts, layout on screens and on paper."""

from pathlib import Path

import pytest
from every_page import KINDS, write_page

pytestmark = [pytest.mark.browser, pytest.mark.slow]

FOLDER = Path(__file__).parent
LAYOUT, ORDER = ((FOLDER / f"{name}.js").read_text("utf-8") for name in ("layout", "order"))
READY = """return document.documentElement.dataset.pictures === 'ready'
    || !document.querySelector('figure[data-picture]')"""
CAN_OPEN = """return Boolean(document.querySelector('a[href="#everything"]'))"""
DRAW = "if (document.querySelector('figure[data-picture]')) Pictures.all()"
HEIGHT = "return document.documentElement.scrollHeight"
A4, A4_HEIGHT = 688, 1017
"""Width and height of A4 between its margins. [pixels]"""
MOST_SHEETS = 12
"""Largest number of sheets of a page as it opens."""


@pytest.mark.parametrize("name", KINDS)
def test_page_is_in_order_and_nothing_is_cut_off(browser, tmp_path, name):
    browser.open(write_page(name, tmp_path))
    browser.wait(READY, timeout=90.0)
    assert browser.run(ORDER) == []
    for width, is_dark in ((1400, False), (800, True)):
        browser.size(width)
        browser.media(dark=is_dark)
        browser.run(DRAW)
        assert browser.run(LAYOUT) == [], f"{width} pixels"
    browser.size(A4)
    browser.media(media="print")
    browser.run("dispatchEvent(new Event('beforeprint'))")
    assert browser.run(HEIGHT) / A4_HEIGHT <= MOST_SHEETS  # only what is open is printed
    if browser.run(CAN_OPEN):
        browser.run("location.hash = '#everything'")
        browser.wait("return !document.querySelector('details:not([open])')")
        browser.run("dispatchEvent(new Event('beforeprint'))")
    assert browser.run(LAYOUT) == [], "on paper"
    loaded = browser.run("return performance.getEntriesByType('resource').map(one => one.name)")
    assert all(name.startswith(("blob:", "data:")) for name in loaded)
    assert browser.errors() == []
