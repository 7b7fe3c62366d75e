"""Make the gallery of the manual: run each command, and take a picture of the page it writes.

It needs Chromium and its driver (Debian: chromium, chromium-driver) and the extra `test`.

    python analyses/make_gallery.py --out docs/gallery.md
"""

import argparse
import io
import shlex
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

WIDTH, HEIGHT, SHOWN = 1200, 900, 480
"""Size of the window, and width of a thumbnail. [pixels]"""

SETTLED = 2.0
"""Time that a page has to draw its pictures. [s]"""


@dataclass(frozen=True)
class Entry:
    """A page of the gallery.

    Attributes:
        name: Name of its picture.
        title: What it shows.
        command: Command that writes it.
        page: Path of the page in the result folder.
    """

    name: str
    title: str
    command: str
    page: str = "report.html"


ENTRIES = (
    Entry("spin", "A run-up, beside measured amplitudes", "wm-drake spin --load middle"),
    Entry(
        "spin-comparison", "With and without gasket", "wm-drake spin --compare-gasket --load middle"
    ),
    Entry("gasket", "Which number of the gasket matters?", "wm-drake study gasket --trials 200"),
    Entry("gasket-effect", "What does the gasket do?", "wm-drake study gasket-effect"),
    Entry(
        "gasket-damping",
        "Damping of the gasket from records",
        "wm-drake study gasket-damping --mesh 4",
    ),
    Entry(
        "spin-cycle", "RMS displacement per region", "wm-drake study spin-cycle --case 2 --case 29"
    ),
    Entry("modes", "Modes and critical speeds", "wm-drake study modes"),
    Entry("response", "Steady response over speed", "wm-drake study response --load middle"),
    Entry(
        "tolerance",
        "How often will it hit?",
        "wm-drake study tolerance laundry --samples 256 --sensitivity 64 --subset 0",
    ),
    Entry(
        "design", "What can be reached at once?", "wm-drake study design gasket --evaluations 400"
    ),
    Entry(
        "rig",
        "Force loops of a damper",
        'wm-drake rig damper --component mstv_damper -f "1,10 Hz" -a "1 mm"',
    ),
    Entry("table2", "Table 2 of [C]", "wm-drake identify table2"),
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
    if not arguments.quick:
        _write_pictures(arguments.out.parent / "pictures" / "gallery", arguments.only)
    text = "\n".join(_lines())
    print(text)
    arguments.out.write_text(text + "\n", encoding="utf-8")


def _write_pictures(pictures: Path, only: list[str] | None) -> None:
    from selenium import webdriver

    pictures.mkdir(parents=True, exist_ok=True)
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", f"--window-size={WIDTH},{HEIGHT}"):
        options.add_argument(argument)
    with tempfile.TemporaryDirectory() as folder, webdriver.Chrome(options=options) as browser:
        for entry in ENTRIES:
            if only is None or entry.name in only:
                print(entry.command, file=sys.stderr)
                browser.get(_page(entry, Path(folder) / entry.name).resolve().as_uri())
                time.sleep(SETTLED)
                _thumbnail(browser.get_screenshot_as_png()).save(
                    pictures / f"{entry.name}.png", optimize=True
                )


def _page(entry: Entry, folder: Path) -> Path:
    """Run a command and return the path of its page."""
    program = "from wm_drake.cli import main; main()"
    words = shlex.split(entry.command)[1:]
    subprocess.run(
        [sys.executable, "-c", program, *words, "--quiet", "--out", str(folder)], check=True
    )
    return folder / entry.page


def _thumbnail(screenshot: bytes) -> Image.Image:
    picture = Image.open(io.BytesIO(screenshot)).convert("RGB")
    height = round(picture.height * SHOWN / picture.width)
    return picture.resize((SHOWN, height), Image.Resampling.LANCZOS).quantize(64)


def _lines() -> list[str]:
    lines = [
        "# Gallery",
        "",
        "The top of every page, and the command that writes it. The pictures are made by",
        "`analyses/make_gallery.py`.",
    ]
    for entry in ENTRIES:
        lines += [
            "",
            f"## {entry.title}",
            "",
            "```text",
            entry.command,
            "```",
            "",
            f"![{entry.title}](pictures/gallery/{entry.name}.png)",
        ]
    return lines


if __name__ == "__main__":
    main()
