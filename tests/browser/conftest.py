"""A real browser for tests of pages: Debian's headless Chromium, without a network.

Tests that use it have the marker `browser`. They are skipped where there is no browser.
"""

import base64
import re
import shutil
from pathlib import Path

import pytest

PROGRAMS = ("chromium", "chromedriver")
OPTIONS = (
    "--headless=new",
    "--no-sandbox",  # a container has no user namespaces
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--force-device-scale-factor=1",
    "--hide-scrollbars",
    "--no-first-run",
    # this computer is all there is: no other name is found, no other address is reached
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost",
    "--proxy-server=http://127.0.0.1:9",
    "--proxy-bypass-list=127.0.0.1;localhost",
)


class Browser:
    """A browser that tests drive; `driver` is selenium's."""

    def __init__(self, driver):
        self.driver = driver

    def open(self, page):
        """Open a file or an address."""
        self.driver.get(page.resolve().as_uri() if isinstance(page, Path) else page)

    def run(self, script, *arguments):
        """Return what a script in the page returns."""
        return self.driver.execute_script(script, *arguments)

    def size(self, width, height=1000):
        """Give the page a width and a height. [pixel]"""
        self._command(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
        )

    def media(self, *, dark=False, media="screen"):
        """Show the page dark or light, on a screen or in print."""
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._command("Emulation.setEmulatedMedia", {"media": media, "features": [scheme]})

    def sheets(self):
        """Return the number of sheets of A4 on which the page is printed."""
        a4 = {"paperWidth": 8.27, "paperHeight": 11.69, "preferCSSPageSize": True}
        data = self.driver.execute_cdp_cmd("Page.printToPDF", a4)["data"]
        return len(re.findall(rb"/Type\s*/Page\b", base64.b64decode(data)))

    def errors(self):
        """Return the errors of scripts and of requests since the last call."""
        return [e["message"] for e in self.driver.get_log("browser") if e["level"] == "SEVERE"]

    def find(self, selector):
        """Return the first element of a CSS selector."""
        return self.driver.find_element("css selector", selector)

    def mouse(self, kind, element, part):
        """Press, move or release the mouse over an element, at a part of its width.

        Selenium's chains lose a pressed button between two calls.
        """
        box = "const b = arguments[0].getBoundingClientRect(); return [b.left, b.width, b.top + b.height / 2]"
        left, width, y = self.run(box, element)
        place = {"x": left + part * width, "y": y, "button": "left", "clickCount": 1}
        held = 0 if kind == "mouseReleased" else 1
        self._command("Input.dispatchMouseEvent", {"type": kind, "buttons": held, **place})

    def wait(self, script, *arguments, timeout=20.0):
        """Wait until a script in the page returns something true, and return it."""
        from selenium.webdriver.support.ui import WebDriverWait

        return WebDriverWait(self.driver, timeout, 0.02).until(
            lambda _: self.run(script, *arguments), f"never true: {script}"
        )

    def picture(self, path):
        """Write a picture of the whole page and return its path."""
        height = self.run("return document.documentElement.scrollHeight")
        self.size(self.run("return window.innerWidth"), height)
        self.driver.save_screenshot(str(path))
        return path

    def _command(self, name, arguments):
        self.driver.execute_cdp_cmd(name, arguments)


@pytest.fixture(scope="session")
def started_browser(tmp_path_factory):
    """Start the browser once."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    missing = [name for name in PROGRAMS if shutil.which(name) is None]
    if missing:
        pytest.skip(f"no {', no '.join(missing)}: install Debian's chromium and chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for option in (*OPTIONS, f"--user-data-dir={tmp_path_factory.mktemp('browser')}"):
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(shutil.which("chromedriver"))
    driver = webdriver.Chrome(options=options, service=service)
    driver.set_script_timeout(120.0)  # on a computer that has other work
    yield driver
    driver.quit()


@pytest.fixture
def browser(started_browser):
    """Return the browser with an empty page of 1400 pixels, light, without earlier errors."""
    browser = Browser(started_browser)
    browser.open("about:blank")
    browser.size(1400)
    browser.media()
    browser.errors()
    return browser
