"""Tests of the parts that all report pages share."""

import re

from wm_drake.report.page import render, sections

SECTIONS = """
<section id="one">
<h2>First &amp; foremost</h2>
</section>
<section id="two"><h2>Case 2: front 0.2 kg</h2></section>
<section class="warning"><h2>Warning</h2></section>
"""


def test_contents_are_the_sections_that_can_be_linked_to():
    assert sections(SECTIONS) == [("one", "First &amp; foremost"), ("two", "Case 2")]


def test_page_escapes_what_it_is_given_and_short_ones_have_no_contents():
    page = render("page.html", title="a < b", about="", warnings=["1 < 2"], summary="c & d")
    assert "<h1>a &lt; b</h1>" in page
    assert "1 &lt; 2" in page
    assert "c &amp; d" in page
    assert "<nav" not in page
    assert len(re.findall("<section", page)) == 2  # warning, references
