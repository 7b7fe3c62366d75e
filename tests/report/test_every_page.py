"""The list of all kinds of pages is complete."""

from pathlib import Path

from every_page import KINDS

import wm_drake

PACKAGE = Path(wm_drake.__file__).parent


def test_each_template_of_a_page_has_a_kind():
    """Find all files that extend page.html: each is a kind, drawn in the browser tests."""
    templates = {
        path.relative_to(PACKAGE / room).as_posix()
        for room in ("report", "studies")
        for path in (PACKAGE / room).rglob("*.html")
        if '{% extends "page.html" %}' in path.read_text(encoding="utf-8")
    }
    assert {kind.template for kind in KINDS.values()} == templates
