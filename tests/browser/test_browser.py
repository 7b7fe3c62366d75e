"""The browser that the other tests of this folder drive: no network, errors are seen."""

import pytest

pytestmark = pytest.mark.browser


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "page.html"
    path.write_text("<style>body{margin:0}</style><p id=a>one</p>", encoding="utf-8")
    return path


def test_page_has_size_and_colour_scheme(browser, page):
    browser.open(page)
    browser.size(800)
    browser.media(dark=True)
    assert browser.run("return document.body.clientWidth") == 800
    assert browser.run("return matchMedia('(prefers-color-scheme: dark)').matches")
    assert browser.find("#a").text == "one"
    assert browser.errors() == []


def test_there_is_no_network(browser, page):
    browser.open(page)
    found = "return fetch('https://example.com/').then(() => 'reached', () => 'refused')"
    assert browser.run(found) == "refused"
    assert any("ERR_" in message for message in browser.errors())


def test_error_of_a_script_is_seen(browser, page):
    browser.open(page)
    browser.run("setTimeout(() => { throw new Error('broken on purpose') })")
    browser.wait("return new Promise(done => setTimeout(() => done(true), 50))")
    assert any("broken on purpose" in message for message in browser.errors())
