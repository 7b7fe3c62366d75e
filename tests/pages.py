"""What tests read from a report page: its words without scripts, its pictures."""

import json
import re

SCRIPT = re.compile(r"<script([^>]*)>(.*?)</script>", re.DOTALL)


def without_scripts(page: str) -> str:
    """Return a page without its scripts and data."""
    return SCRIPT.sub("", page)


def data_of(page: str) -> list[dict]:
    """Return the data in a page: descriptions of pictures, and what its scripts show."""
    return [json.loads(text) for kind, text in SCRIPT.findall(page) if "application/json" in kind]


def drawings(page: str) -> list[dict]:
    """Return the descriptions of the pictures of a page."""
    return [one for one in data_of(page) if "layout" in one]
