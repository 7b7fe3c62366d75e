"""Make the gallery of the manual: run each command, and take a picture of the page it writes.

It needs Chromium and its driver (Debian: chromium, chromium-driver) and the extra `test`.

    python analyses/make_gallery.py --out docs/gallery.md
"""

import argparse
import io
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from selenium import webdriver
from selenium.webdriver.remote.webdriver import WebDriver
from selenium.webdriver.support.ui import WebDriverWait

WIDTH, HEIGHT, SHOWN, PLOT = 1200, 900, 480, 300
"""Size of the window, and width of a thumbnail of a page and of a plot. [pixels]"""

SETTLED = 5.0
"""Time that a page has to draw its pictures. [s]"""

PLOTS = "plots.json"
"""File beside the pictures with the titles of the plots of each page."""

FREE = """\
vary:
  friction:
    bounds: (10, 60) N
    prior: (30, 10) N
    sets: damper_types.friction.friction_force
    source: "data sheet: 20 to 40 N"
  radius:
    bounds: (200, 250) mm
    prior: (240, 10) mm
    sets: loads.middle.unbalances.0.radius
    source: laundry at the drum wall
"""
BENCH = 'wm-drake rig damper --component mstv_damper -f "1,3,10 Hz" -a "0.3,1 mm" --out bench'
RUBBER = (
    'wm-drake rig gasket --axis axial --set "gasket.dahl_displacement_y=0.5 mm" '
    '--set "gasket.dahl_force_y=4 N" -f "1,3,5 Hz" -a "1,5,10 mm" --out rubber'
)


@dataclass(frozen=True)
class Entry:
    """A page of the gallery.

    Attributes:
        name: Name of its picture.
        title: What it shows.
        command: Command that writes it.
        page: Path of the page in the result folder.
        before: Commands that write what it reads.
        files: Files that it reads, by name.
    """

    name: str
    title: str
    command: str
    page: str = "report.html"
    before: tuple[str, ...] = ()
    files: tuple[tuple[str, str], ...] = ()


ENTRIES = (
    Entry("verdict", "Does the tub touch?", "wm-drake verdict"),
    Entry("spin", "A run-up, beside measured amplitudes", "wm-drake spin --load middle"),
    Entry("detail", "Spectra and forces of every mount", "wm-drake spin --load middle --detail"),
    Entry(
        "spin-comparison", "With and without gasket", "wm-drake spin --compare-gasket --load middle"
    ),
    Entry(
        "machines",
        "Two machines on one page",
        "wm-drake spin --machine reference --machine heavy_cabinet --load middle",
    ),
    Entry(
        "replay",
        "The machine in motion",
        "wm-drake spin --load middle --replay",
        "replay_middle.html",
    ),
    Entry("motor", "Driven by a motor", "wm-drake spin --drive motor --load middle"),
    Entry("drive", "How weak may the motor be?", "wm-drake study drive --load middle"),
    Entry("cabinet", "A cabinet that walks", "wm-drake spin --machine light_cabinet --load middle"),
    Entry(
        "studio", "Curves while a slider moves", "wm-drake studio --no-browser --port 8765", page=""
    ),
    Entry("gasket", "Which number of the gasket matters?", "wm-drake study gasket --trials 200"),
    Entry(
        "gasket-effect",
        "What does the gasket do?",
        "wm-drake spin --compare-gasket --load middle --load counter",
    ),
    Entry(
        "gasket-damping",
        "Damping of the gasket from records",
        "wm-drake study gasket-damping --mesh 4",
    ),
    Entry(
        "spin-cycle", "RMS displacement per region", "wm-drake study spin-cycle --case 2 --case 29"
    ),
    Entry(
        "spin-identify",
        "Numbers of a machine from RMS displacements",
        "wm-drake study spin-identify --case 2 --case 29",
    ),
    Entry("modes", "Modes and critical speeds", "wm-drake study modes"),
    Entry("response", "Steady response over speed", "wm-drake study response --load middle"),
    Entry(
        "orders",
        "Orders of a record",
        "wm-drake record orders run-up/record_middle.nc",
        before=("wm-drake spin --load middle --out run-up",),
    ),
    Entry(
        "tolerance",
        "How often will it hit?",
        "wm-drake study tolerance laundry --samples 256 --sensitivity 64 --subset 0",
    ),
    Entry("balancer", "Do rings of balls pay?", "wm-drake study balancer --quick"),
    Entry("gasket-curves", "A gasket from its drawing", "wm-drake gasket curves folded"),
    Entry(
        "design", "What can be reached at once?", "wm-drake study design gasket --evaluations 400"
    ),
    Entry(
        "calibrate",
        "Calibrated to measured amplitudes",
        "wm-drake calibrate --vary free.yaml --starts 1",
        files=(("free.yaml", FREE),),
    ),
    Entry(
        "rig",
        "Force loops of a damper",
        'wm-drake rig damper --component mstv_damper -f "1,10 Hz" -a "1 mm"',
    ),
    Entry(
        "rig-gasket",
        "Force loops of a gasket",
        'wm-drake rig gasket --axis tilt -f "3 Hz" -a "2 deg"',
    ),
    Entry(
        "identify",
        "Numbers of a damper law from loops",
        "wm-drake identify damper bench/loop*.csv --law mstv",
        before=(BENCH,),
    ),
    Entry(
        "rivals",
        "Which law do the loops support?",
        "wm-drake identify damper bench/loop*.csv --law coulomb,stv_sponge,mstv",
        before=(BENCH,),
    ),
    Entry(
        "identify-gasket",
        "Rubber of a gasket from loops",
        "wm-drake identify gasket rubber/loop*.csv --axis axial --law voigt,voigt_dahl",
        before=(RUBBER,),
    ),
    Entry(
        "identify-bushing",
        "A table of stiffness from loops",
        "wm-drake identify bushing ends/loop*.csv --machine free_stroke --axis axial --law table",
        before=(
            "wm-drake rig bushing --machine free_stroke --axis axial "
            '-f "1,3 Hz" -a "0.4,0.8 mm" --out ends',
        ),
    ),
    Entry(
        "static",
        "Tables of a gasket from quasi-static tests",
        "wm-drake identify gasket --static radial=radial/loop_0.01Hz_10mm.csv "
        "axial=axial/loop_0.01Hz_10mm.csv",
        before=tuple(
            f'wm-drake rig gasket --axis {axis} -f "0.01 Hz" -a "10 mm" --out {axis}'
            for axis in ("radial", "axial")
        ),
    ),
)


def main() -> None:
    """Run the commands and write the pictures and the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("gallery.md"),
        help="the page; its pictures go to pictures/gallery beside it",
    )
    parser.add_argument("--only", action="append", help="name of an entry; repeatable")
    parser.add_argument("--quick", action="store_true", help="write the page without the pictures")
    arguments = parser.parse_args()
    pictures = arguments.out.parent / "pictures" / "gallery"
    if not arguments.quick:
        _write_pictures(pictures, arguments.only)
    text = "\n".join(_lines(_plots(pictures), {path.stem for path in pictures.glob("*.png")}))
    print(text)
    arguments.out.write_text(text + "\n", encoding="utf-8")


def _write_pictures(pictures: Path, only: list[str] | None) -> None:
    pictures.mkdir(parents=True, exist_ok=True)
    os.environ |= {"SE_OFFLINE": "true", "SE_AVOID_STATS": "true"}  # the browser of the system
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", f"--window-size={WIDTH},{HEIGHT}"):
        options.add_argument(argument)
    titles = _plots(pictures)
    with tempfile.TemporaryDirectory() as folder, webdriver.Chrome(options=options) as browser:
        for entry in ENTRIES:
            if only is None or entry.name in only:
                print(entry.command, file=sys.stderr)
                entry_folder = Path(folder).resolve() / entry.name
                entry_folder.mkdir()
                with _page(entry, entry_folder) as address:
                    browser.get(address)
                    if not entry.page:  # the first run compiles the laws
                        WebDriverWait(browser, 600.0).until(_is_open)
                    time.sleep(SETTLED)
                    _thumbnail(browser.get_screenshot_as_png(), SHOWN).save(
                        pictures / f"{entry.name}.png", optimize=True
                    )
                titles[entry.name] = _write_plots(entry, entry_folder / "figures", pictures)
                (pictures / PLOTS).write_text(json.dumps(titles, indent=1) + "\n", encoding="utf-8")


def _is_open(browser: WebDriver) -> bool:
    """Return whether the page of the studio shows its first run."""
    text = browser.find_element("css selector", "body").text
    return "opening" not in text and "starting" not in text


@contextmanager
def _page(entry: Entry, folder: Path) -> Iterator[str]:
    """Run the commands of an entry and yield the address of its page."""
    for name, text in entry.files:
        (folder / name).write_text(text, encoding="utf-8")
    for command in entry.before:
        subprocess.run([*_words(command, folder), "--quiet"], check=True, cwd=folder)
    words = _words(entry.command, folder)
    if not entry.page:
        server = subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, text=True)
        try:
            assert server.stdout is not None
            yield server.stdout.readline().split(": ", 1)[1].strip()
        finally:
            server.terminate()
            server.wait()
        return
    options = ["--quiet", "--out", "result", "--figures", "figures"]
    subprocess.run([*words, *options], check=True, cwd=folder)
    yield (folder / "result" / entry.page).as_uri()


def _words(command: str, folder: Path) -> list[str]:
    """Return the arguments of a command; patterns of file names are those in a folder."""
    words = [sys.executable, "-c", "from wm_drake.cli import main; main()"]
    for word in shlex.split(command)[1:]:
        files = sorted(path.relative_to(folder).as_posix() for path in folder.glob(word))
        words += files if "*" in word else [word]
    return words


def _write_plots(entry: Entry, figures: Path, pictures: Path) -> list[str]:
    """Write a thumbnail of each plot of a page, and return their titles."""
    for old in pictures.glob(f"{entry.name}_[0-9]*.png"):
        old.unlink()
    titles = []
    for number, path in enumerate(sorted(figures.glob("*.png")), start=1):
        _thumbnail(path.read_bytes(), PLOT).save(
            pictures / f"{entry.name}_{number}.png", optimize=True
        )
        titles.append(re.sub(r"^\d+_", "", path.stem).replace("_", " "))
    return titles


def _thumbnail(screenshot: bytes, width: int) -> Image.Image:
    picture = Image.open(io.BytesIO(screenshot)).convert("RGB")
    height = round(picture.height * width / picture.width)
    return picture.resize((width, height), Image.Resampling.LANCZOS).quantize(64)


def _plots(pictures: Path) -> dict[str, list[str]]:
    path = pictures / PLOTS
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _lines(plots: dict[str, list[str]], made: set[str]) -> list[str]:
    """Return the page; it shows the pictures that are made."""
    lines = [
        "# Gallery",
        "",
        "The top of every page, its plots, and the commands that write it. A plot is a picture of",
        "the page; `--figures DIR` writes it for a publication. The pictures are made by",
        "`analyses/make_gallery.py`.",
    ]
    for entry in ENTRIES:
        lines += ["", f"## {entry.title}", ""]
        for name, text in entry.files:
            lines += [f"`{name}`:", "", "```yaml", *text.splitlines(), "```", ""]
        lines += ["```text", *entry.before, entry.command, "```", ""]
        if entry.name in made:
            lines.append(f"![{entry.title}](pictures/gallery/{entry.name}.png)")
        titles = plots.get(entry.name, [])
        if titles:
            lines.append("")
            lines += [
                f"![{title}](pictures/gallery/{entry.name}_{number}.png)"
                for number, title in enumerate(titles, start=1)
            ]
    return lines


if __name__ == "__main__":
    main()
