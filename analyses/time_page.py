"""How soon does an exported page show a picture, and how soon does a slider change it?

    python analyses/time_page.py --machine reference --repeats 3

The page is opened in Chromium (Debian: chromium, chromium-driver) and in Firefox (firefox-esr),
each as often as `--repeats` says; the table has the least of these, since other work on the
computer only adds to them. Beside them stand processor time and load of the computer.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

import numpy as np
from selenium import webdriver
from websocket import create_connection

import wm_drake as wm
from wm_drake.live.exported import export_page

Evaluate = Callable[[str], object]
"""Function that returns what a promise in the page resolves to; JSON."""
HEADLESS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")
MOVES = """(async () => {
  const pictures = () => performance.getEntriesByName('picture');
  const later = (count) => new Promise((resolve) => {
    const look = () => (pictures().length > count ? resolve() : setTimeout(look, 1));
    look();
  });
  const pause = (time) => new Promise((resolve) => setTimeout(resolve, time));
  await later(0);
  const first = pictures()[0].startTime;
  while (document.body.getAttribute('aria-busy') !== 'false') await pause(50);
  const slider = document.querySelector('#numbers [data-key="KEY"] input[type=range]');
  const times = [];
  for (let move = 0; move < COUNT; move += 1) {
    const [before, begin] = [pictures().length, performance.now()];
    slider.value = String(450 + 2 * ((37 * move) % 101));
    slider.dispatchEvent(new Event('input', {bubbles: true}));
    await later(before);
    times.push(pictures().at(-1).startTime - begin);
    await pause(100 + 200 * Math.random());
  }
  return {first, times};
})()"""
"""Moves a slider as a hand does, each move after the picture of the one before."""


@contextmanager
def in_chromium(folder: str, page: Path) -> Iterator[Evaluate]:
    """Open a page in Chromium."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for option in (*HEADLESS, f"--user-data-dir={folder}"):
        options.add_argument(option)
    driver = webdriver.Chrome(options, webdriver.ChromeService(shutil.which("chromedriver")))
    driver.set_script_timeout(600.0)
    driver.get(page.as_uri())
    yield lambda script: driver.execute_async_script(f"{script}.then(arguments[0])")
    driver.quit()


@contextmanager
def in_firefox(folder: str, page: Path) -> Iterator[Evaluate]:
    """Open a page in Firefox, which is driven by WebDriver BiDi: it needs no other program."""
    command = ["firefox-esr", "--headless", "--remote-debugging-port", "0", "--profile", folder]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert process.stderr
    address = next(m[0] for line in process.stderr if (m := re.search(r"ws://\S+", line)))
    socket = create_connection(f"{address}/session", timeout=600.0)

    def ask(method: str, **params: object) -> dict[str, object]:
        socket.send(json.dumps({"id": 1, "method": method, "params": params}))
        while "id" not in (answer := json.loads(socket.recv())):
            pass  # an event
        return answer["result"]

    ask("session.new", capabilities={})
    context = ask("browsingContext.getTree")["contexts"][0]["context"]
    ask("browsingContext.navigate", context=context, url=page.as_uri(), wait="complete")

    def evaluate(script: str) -> object:
        expression = f"{script}.then(JSON.stringify)"
        found = ask(
            "script.evaluate", expression=expression, target={"context": context}, awaitPromise=True
        )
        return json.loads(found["result"]["value"])

    yield evaluate
    ask("browser.close")
    process.wait()


BROWSERS = {"chromium": in_chromium, "firefox-esr": in_firefox}


def measured(browser: str, page: Path, key: str, count: int) -> list[float]:
    """Return time to the first picture, median and 95 % of the moves, processor time. [s]"""
    before = getrusage(RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder, BROWSERS[browser](folder, page) as evaluate:
        found = evaluate(MOVES.replace("KEY", key).replace("COUNT", str(count)))
    after = getrusage(RUSAGE_CHILDREN)
    busy = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return [1e-3 * found["first"], *(1e-3 * np.quantile(found["times"], [0.5, 0.95])), busy]


def main() -> None:
    """Export the page and print a row for each browser."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machine", default="reference")
    parser.add_argument("--key", default="spring_types.suspension.stiffness")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    count, repeats = (3, 1) if given.quick else (60, given.repeats)
    lines = [
        f"{given.machine}, {count} moves of {given.key}, least of {repeats}:",
        "| browser | first picture, s | slider, median, ms | 95 %, ms | processor, s | load |",
        "|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "machine.html"
        export_page(wm.load_machine(given.machine), page)
        for browser in filter(shutil.which, BROWSERS):
            runs = [measured(browser, page, given.key, count) for _ in range(repeats)]
            first, median, slow, busy = np.min(runs, axis=0)
            times = f"{first:.2f} | {1e3 * median:.0f} | {1e3 * slow:.0f} | {busy:.0f}"
            lines.append(f"| {browser} | {times} | {os.getloadavg()[0]:.1f} |")
    text = "\n".join(lines)
    print(text)
    if given.out:
        given.out.write_text(f"{text}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
