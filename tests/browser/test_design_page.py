"""The page of the design study in a real browser: a design is picked by a click and by a key."""

import numpy as np
import pytest
from every_page import write_page
from pages import data_of

pytestmark = [pytest.mark.browser, pytest.mark.slow]

PICKED = """return document.querySelector('#plot .plot').data
    .filter(trace => trace.meta && trace.meta.name === 'picked design').map(trace => [trace.x[0], trace.y[0]])[0]"""
ENVELOPE = """return [...document.querySelector('#envelopes .plot').data
    .filter(trace => trace.meta && trace.meta.name === 'picked design')[0].y]"""


def test_picked_design_shows_its_numbers_and_envelopes(browser, tmp_path):
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    page = write_page("design", tmp_path)
    given = next(one for one in data_of(page.read_text("utf-8")) if "envelopes" in one)
    browser.open(page)
    browser.wait("return document.documentElement.dataset.pictures === 'ready'", timeout=90.0)
    browser.run("Pictures.all()")
    first = given["picked"]
    assert browser.run(PICKED) == pytest.approx(given["objectives"][first][:2])
    browser.run("document.getElementById('plot').focus()")
    wanted = first - 1 if first else 1
    key = Keys.ARROW_LEFT if first else Keys.ARROW_RIGHT
    ActionChains(browser.driver).send_keys(key).perform()
    assert browser.run("return Picked.number()") == wanted
    assert browser.run(PICKED) == pytest.approx(given["objectives"][wanted][:2])
    drawn = np.array(browser.run(ENVELOPE), dtype=float)
    assert drawn == pytest.approx(np.array(given["envelopes"][wanted][0], dtype=float))
    shown = browser.find("#picked").text
    assert all(text in shown for _, _, text in given["rows"][wanted])
    # a point far from the picked one, clicked where it is drawn
    x = np.array(given["objectives"])[:, 0]
    far = int(np.argmax(np.abs(x - x[wanted])))
    place = """const plot = document.querySelector('#plot .plot'), f = plot._fullLayout;
        plot.scrollIntoView({block: 'center'}); const c = plot.getBoundingClientRect();
        return [c.left + f.xaxis._offset + f.xaxis.d2p(arguments[0]), c.top + f.yaxis._offset + f.yaxis.d2p(arguments[1])]"""
    at = browser.run(place, *given["objectives"][far][:2])
    mouse = ActionChains(browser.driver)
    mouse.w3c_actions.pointer_action.move_to_location(*map(int, np.round(at)))
    mouse.w3c_actions.pointer_action.click()
    mouse.perform()
    browser.wait("return Picked.number() === arguments[0]", far)
    assert browser.find("#picked-title").text == f"Design {far + 1}"
    assert browser.errors() == []
