"""What tests read from a report page: its words without scripts, its pictures."""

import json
import re

SCRIPT = re.compile(r"<script([^>]*)>(.*?)</script>", re.DOTALL)


def without_scripts(page: str) -> str:
    """Return a page without its scripts and data."""
    return SCRIPT.sub("", page)


def drawings(page: str) -> list[dict]:
    """Return the descriptions of the pictures of a page."""
    found = [json.loads(text) for kind, text in SCRIPT.findall(page) if kind.endswith('json"')]
    return [one for one in found if "panels" in one]
