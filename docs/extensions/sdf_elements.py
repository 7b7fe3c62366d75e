"""The elements of an SDF file as Markdown, for the site and for readers of the repository.

    python docs/extensions/sdf_elements.py            write them into docs/reference/sdf-elements.md
    python docs/extensions/sdf_elements.py --check    end with 1 if they are not those of the file

A test holds the file to the declaration that checks an SDF.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from wm_drake.model.sdf_elements import Empty, Refused, kinds

PAGE = Path(__file__).parents[1] / "reference" / "sdf-elements.md"
"""Page with the elements."""

BEGIN, END = "<!-- sdf elements -->", "<!-- end of sdf elements -->"
BLOCK = re.compile(f"{BEGIN}.*?{END}", re.DOTALL)


def rows() -> Iterator[str]:
    """Yield the lines of both tables. Elements of which the same is said share a row."""
    honoured, refused = dict[str, list[str]](), dict[str, list[str]]()
    for path, kind in kinds():
        if isinstance(kind, Refused):
            refused.setdefault(kind.why, []).append(_place(path))
            continue
        text = "" if isinstance(kind.value, Empty) else kind.value.allowed
        names = ", ".join(f"`{name}`" for name in kind.attributes)
        honoured.setdefault(f"{kind.meaning} | {text} | {names}", []).append(_place(path))
    yield "## Honoured\n"
    yield "| element | what becomes of it | text | attributes |"
    yield "|---|---|---|---|"
    yield from _table(honoured)
    yield "\n## Refused\n"
    yield "| element | what to do |"
    yield "|---|---|"
    yield from _table(refused)
    yield ""


def _table(places: dict[str, list[str]]) -> Iterator[str]:
    for cells, at in places.items():
        marked = re.sub(r"(<[^>]*>)", r"`\1`", cells)
        yield f"| {', '.join(dict.fromkeys(at))} | {marked} |"


def _place(path: tuple[str, ...]) -> str:
    """Return the last two names of a path, which tell elements of one name apart."""
    return f"`{'/'.join(path[-2:])}`" if len(path) > 2 else f"`<{path[-1]}>`"


def filled(text: str) -> str:
    """Return the text of the page with the elements."""
    return BLOCK.sub(lambda _: "\n".join([BEGIN, "", *rows(), END]), text)


if __name__ == "__main__":
    written = PAGE.read_text(encoding="utf-8")
    if "--check" in sys.argv:
        sys.exit(written != filled(written))
    PAGE.write_text(filled(written), encoding="utf-8")
