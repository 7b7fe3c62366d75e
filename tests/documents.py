"""Documents of the checkout, and functions that read code blocks, links and headings from them."""

import re
from pathlib import Path

CHECKOUT = Path(__file__).parents[1]
README = CHECKOUT / "README.md"
HOW_TO = sorted((CHECKOUT / "docs" / "how-to").glob("*.md"))
DECISIONS = sorted((CHECKOUT / "docs" / "decisions").glob("[0-9]*.md"))
MANUAL = [
    path
    for path in (CHECKOUT / "docs").rglob("*.md")
    if "_build" not in path.relative_to(CHECKOUT).parts
]
PAGES = sorted([*CHECKOUT.glob("*.md"), *MANUAL, CHECKOUT / "sdf" / "README.md"])


def name_of(path):
    """Return the path of a document in the checkout."""
    return path.relative_to(CHECKOUT).as_posix()


def text_of(path):
    """Return the text of a document."""
    return path.read_text(encoding="utf-8")


def blocks(path, language):
    """Return the fenced blocks of a language, in their order."""
    return re.findall(rf"^```{language}\n(.*?)\n```$", text_of(path), re.DOTALL | re.MULTILINE)


def prose(path):
    """Return the lines outside of fenced blocks."""
    return re.sub(r"^```.*?^```$", "", text_of(path), flags=re.DOTALL | re.MULTILINE).splitlines()


def anchors(path):
    """Return the anchors of a Markdown page: its headings in small letters, with hyphens."""
    headings = (line.lstrip("# ") for line in prose(path) if line.startswith("#"))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def commands(path):
    """Return the lines of a page that call wm-drake, without the remark behind them."""
    lines = "\n".join(blocks(path, "text") + blocks(path, "bash")).splitlines()
    written = [line for line in lines if line.startswith("wm-drake ")]
    written += re.findall(r"`(wm-drake [^`]*)`", "\n".join(prose(path)))
    return [re.split(r"\s{3,}", line)[0] for line in written]
