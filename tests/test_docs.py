"""The documents keep their form: decisions have their parts, links lead somewhere, numbers repeat."""

import re
import subprocess
import sys
import tomllib
from xml.etree import ElementTree

import pytest
from documents import CHECKOUT, DECISIONS, PAGES, README, anchors, blocks, name_of, prose, text_of
from ruamel.yaml import YAML

from wm_drake.parameters.components import load_component
from wm_drake.rigs import Harmonic, damper_bench, force_loops, measures_of

INDEX = CHECKOUT / "docs" / "decisions" / "README.md"
TUTORIALS = [
    path for path in sorted((CHECKOUT / "docs" / "tutorials").glob("*.md")) if path.stem != "index"
]
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
STATUS = re.compile(r"^- Status: (?:accepted|superseded by)")


def decision_faults(text, number):
    """Return what is wrong with the text of a decision, one text each."""
    lines = text.splitlines()
    faults = [] if len(lines) <= 40 else [f"{len(lines)} lines"]
    if not re.match(rf"# {number} \w", lines[0]):
        faults.append("title")
    if not any(STATUS.match(line) for line in lines):
        faults.append("status")
    if not re.search(r"^- Date: \d{4}-\d\d-\d\d$", text, re.MULTILINE):
        faults.append("date")
    parts = re.split(r"^## (.*)$", text, flags=re.MULTILINE)[1:]
    if parts[::2] != ["Context", "Decision", "Consequences"]:
        faults.append("parts")
    return faults + [
        f"{name} is empty"
        for name, body in zip(parts[::2], parts[1::2], strict=True)
        if not body.strip()
    ]


@pytest.mark.parametrize("path", DECISIONS, ids=lambda path: path.stem)
def test_a_decision_has_its_parts(path):
    assert decision_faults(text_of(path), path.name[:4]) == []


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("- Status: accepted", "- Status: perhaps", "status"),
        ("- Date: 2026", "- Date: ", "date"),
        ("## Context", "## Background", "parts"),
        ("# 0001", "# 0002", "title"),
    ],
)
def test_a_planted_fault_in_a_decision_is_found(old, new, fault):
    assert decision_faults(text_of(DECISIONS[0]).replace(old, new, 1), "0001") == [fault]


def test_decisions_are_numbered_without_gaps_and_listed():
    assert [path.name[:4] for path in DECISIONS] == [
        f"{number:04d}" for number in range(1, len(DECISIONS) + 1)
    ]
    rows = re.findall(
        r"^\| \[(\d{4})\]\((.*?)\) \| (.*?) \| (.*?) \|", text_of(INDEX), re.MULTILINE
    )
    assert rows == [
        (
            path.name[:4],
            path.name,
            text_of(path).splitlines()[0][7:],
            re.search(r"^- Status: (.*)$", text_of(path), re.MULTILINE)[1],
        )
        for path in DECISIONS
    ]


def test_pages_that_the_sources_name_exist():
    """Look for decisions by number, and for pages of the manual, in sources, tests and data."""
    numbers = {path.name[:4] for path in DECISIONS}
    files = [
        path
        for folder in ("wm_drake", "tests", "analyses", "sdf", "docs/extensions")
        for path in (CHECKOUT / folder).rglob("*.*")
        if path.suffix in (".py", ".yaml", ".md", ".sdf")
    ]
    files += [*PAGES, CHECKOUT / "pyproject.toml"]
    named = [
        (path.name, name)
        for path in files
        for name in re.findall(r"\b(?:decisions?[/ ]\[?\d{4}|docs/[\w/-]+\.md)", text_of(path))
    ]
    assert len(named) > 10
    assert [
        (path, name)
        for path, name in named
        if not ((CHECKOUT / name).is_file() or name[-4:] in numbers)
    ] == []


def links():
    """Yield page, target and anchor of each relative link."""
    for path in PAGES:
        for link in LINK.findall(text_of(path)):
            if not re.match(r"[a-z]+:", link):
                name, _, anchor = link.partition("#")
                yield path, (path.parent / name).resolve() if name else path, anchor


def test_relative_links_lead_somewhere():
    missing = [(name_of(path), str(other)) for path, other, _ in links() if not other.exists()]
    assert missing == []
    lost = [
        (name_of(path), str(other), anchor)
        for path, other, anchor in links()
        if anchor and anchor not in anchors(other)
    ]
    assert lost == []


def test_files_named_in_code_exist():
    pattern = re.compile(r"`((?:wm_drake|sdf|tests|analyses|docs)/[\w/.-]*)`")
    named = [(path, name) for path in PAGES for name in pattern.findall("\n".join(prose(path)))]
    assert [(path, name) for path, name in named if not (CHECKOUT / name).exists()] == []


def test_lines_of_prose_are_short_and_no_comments():
    """Look also for lines that the site would leave out: MyST takes a % at the start as a comment."""
    lines = [(path.parent.name, path.name, line) for path in PAGES for line in prose(path)]
    assert [at for at in lines if re.match(r"\s*(%|\+\+\+)", at[2])] == []
    long = [at for at in lines if len(at[2]) > 100 and not at[2].startswith(("|", "!["))]
    assert [at for at in long if at[0] != "sdf"] == []


@pytest.mark.parametrize("path", TUTORIALS, ids=name_of)
def test_a_tutorial_is_short(path):
    """Check the lengths that docs/tutorials/index.md states."""
    cells = "\n".join(blocks(path, r"\{code-cell\}[^\n]*"))
    assert 5 < len(cells.splitlines()) <= 70
    assert 50 < len(re.findall(r"\w+", "\n".join(prose(path)))) <= 250


def test_the_readme_is_short_and_begins_with_a_picture():
    lines = text_of(README).splitlines()
    assert len(lines) < 155
    assert lines[2].startswith("![")
    picture = CHECKOUT / re.search(r"!\[[^\]]*\]\((.*?)\)", text_of(README))[1]
    assert picture.stat().st_size < 150_000


def test_the_citation_has_the_fields_of_its_format():
    citation = YAML(typ="safe").load(CHECKOUT / "CITATION.cff")
    assert str(citation["cff-version"]) == "1.2.0"
    assert citation["type"] in ("software", "dataset")
    for work in (citation, *citation["references"]):
        assert {"title", "authors"} <= set(work)
        for author in work["authors"]:
            assert set(author) in ({"name"}, {"family-names", "given-names"})
    assert all("type" in work for work in citation["references"])
    assert len(citation["references"]) == 3


def test_the_table_on_friction_over_frequency_repeats():
    """Repeat docs/misprints.md, C11: energy per cycle and peak force of the damper of [C]."""
    printed = load_component("mstv_damper").parameters
    rows = re.findall(
        r"^\| ([\d.]+) mm, (energy|peak force) \| ([\d.]+).*?\| (.*) \|$",
        text_of(CHECKOUT / "docs" / "misprints.md"),
        re.MULTILINE,
    )
    assert len(rows) == 7
    for amplitude, what, air, cells in rows:
        damper = printed.model_copy(update={"slider_damping": 1e3 * float(air)})
        motions = [Harmonic(f, 1e-3 * float(amplitude)) for f in (1.0, 3.0, 6.67, 10.0)]
        measures = [measures_of(loop) for loop in force_loops(damper_bench(damper), motions)]
        computed = [
            1e3 * m.energy_per_cycle if what == "energy" else m.peak_force for m in measures
        ]
        expected = [float(cell.split()[0]) for cell in cells.split(" | ")]
        assert computed == pytest.approx(expected, abs=0.06), (amplitude, what, air)


def test_upper_bounds_of_the_compiler_allow_what_is_installed():
    import importlib.metadata

    text = (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
    for name in ("numba", "llvmlite"):
        bound = re.search(rf'"{name}>=[\d.]+,<(\d+)\.(\d+)"', text)
        installed = tuple(map(int, importlib.metadata.version(name).split(".")[:2]))
        assert installed < (int(bound[1]), int(bound[2]))


def test_changelog_and_citation_have_the_version_of_the_package():
    project = tomllib.loads(text_of(CHECKOUT / "pyproject.toml"))["project"]
    citation = YAML().load(CHECKOUT / "CITATION.cff")
    unreleased, *closed = re.findall(
        r"^## \[(.+?)\](?: - (\S+))?$", text_of(CHECKOUT / "CHANGELOG.md"), re.MULTILINE
    )
    assert unreleased == ("Unreleased", "")
    assert closed[0] == (project["version"], citation["date-released"])
    assert citation["version"] == project["version"]
    assert closed == sorted(closed, key=lambda release: release[1], reverse=True)


@pytest.mark.parametrize("name", ["machine_keys.py", "sdf_elements.py"])
def test_pages_of_keys_and_of_elements_have_those_of_the_program(name):
    """Run in a process of its own: other tests register kinds of elements."""
    script = CHECKOUT / "docs" / "extensions" / name
    done = subprocess.run([sys.executable, script, "--check"], cwd=CHECKOUT, check=False)
    assert done.returncode == 0, f"run: python {script.relative_to(CHECKOUT)}"


def test_the_picture_of_the_architecture_has_all_rooms_and_their_imports(monkeypatch):
    monkeypatch.syspath_prepend(CHECKOUT / "docs" / "extensions")
    import architecture

    picture = ElementTree.fromstring(architecture.svg())
    rooms = {path.parent.name for path in (CHECKOUT / "wm_drake").glob("*/__init__.py")}
    assert {text.text for text in picture.iter("text")} >= rooms
    arcs = [title.text for title in picture.iter("title")]
    assert any(arc.startswith("laws imports compiler ") for arc in arcs)
    assert not any(arc.startswith("compiler imports") for arc in arcs)
    imports = architecture.imports()
    assert all(imports[arc.split()[0]][arc.split()[2]] for arc in arcs)
