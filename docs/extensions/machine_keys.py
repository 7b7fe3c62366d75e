"""The keys of a machine file as Markdown, for the site and for readers of the repository.

    python docs/extensions/machine_keys.py            write them into docs/reference/machine-file.md
    python docs/extensions/machine_keys.py --check    end with 1 if they are not those of the file

A test holds the file to the types that check a machine file.
"""

import re
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

from wm_drake.parameters.file_keys import FileKey, KeyGroup, key_groups

PAGE = Path(__file__).parents[1] / "reference" / "machine-file.md"
"""Page with the keys."""

BEGIN, END = "<!-- machine file keys -->", "<!-- end of machine file keys -->"
BLOCK = re.compile(f"{BEGIN}.*?{END}", re.DOTALL)


def keys(picture: Callable[[str], str] = lambda _: "") -> Iterator[str]:
    """Yield the lines of all groups of keys.

    Args:
        picture: Returns what is shown below the words of a group of a title; "" for nothing.
    """
    for group in key_groups():
        yield from _section(group, picture(group.title))


def _section(group: KeyGroup, picture: str) -> Iterator[str]:
    yield f"## {group.title}\n"
    # tables are not wrapped; a paragraph of any length is one line of a table of one cell
    yield f"{escaped(group.about)}\n"
    if picture:
        yield f"{picture}\n"
    if group.places:
        yield f"In the file: {', '.join(f'`{place}`' for place in group.places)}.\n"
    if group.also:
        anchor = group.also.lower().replace(" ", "-")
        yield f"It has the keys of [{group.also}](#{anchor}) and these:\n"
    yield "| key | meaning | value | allowed | default |"
    yield "|---|---|---|---|---|"
    yield from map(_row, group.keys)
    yield ""


def _row(key: FileKey) -> str:
    needed = "" if not key.is_required else "required"
    cells = (f"`{key.name}`", escaped(key.meaning), key.form, key.allowed, key.default or needed)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def escaped(text: str) -> str:
    """Return text whose brackets are no links; braces in backticks stay."""
    return text.replace("[", "\\[").replace("]", "\\]")


def filled(text: str) -> str:
    """Return the text of the page with the keys, prose wrapped to 100 characters."""
    lines = [wrapped(line) for line in keys()]
    return BLOCK.sub(lambda _: "\n".join([BEGIN, "", *lines, END]), text)


def wrapped(line: str) -> str:
    """Return a line of prose in lines of at most 100 characters; a table stays as it is."""
    if line.startswith("|") or len(line) <= 100:
        return line
    end = "\n" if line.endswith("\n") else ""
    return "\n".join(textwrap.wrap(line, 100, break_long_words=False)) + end


if __name__ == "__main__":
    written = PAGE.read_text(encoding="utf-8")
    if "--check" in sys.argv:
        sys.exit(written != filled(written))
    PAGE.write_text(filled(written), encoding="utf-8")
