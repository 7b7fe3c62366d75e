"""Command `wm-drake cite`: how to cite the program, as BibTeX or CFF."""

import re
from collections.abc import Iterator, Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

CITATION = Path(__file__).parents[1] / "data" / "CITATION.cff"
UNKNOWN = "not stated"


class Form(StrEnum):
    """Form of a citation."""

    bibtex = "bibtex"
    cff = "cff"


def cite(
    form: Annotated[Form, typer.Option("--format", help="bibtex or cff.")] = Form.bibtex,
) -> None:
    """Print how to cite the program and its papers."""
    text = CITATION.read_text(encoding="utf-8")
    typer.echo(text if form is Form.cff else bibtex(text), nl=False)


def bibtex(text: str) -> str:
    """Return the citation file as BibTeX: the program, then the papers."""
    from ruamel.yaml import YAML  # slow to import

    from wm_drake.report.provenance import source_revision

    citation = YAML(typ="safe").load(text)
    program = {**citation, "year": citation["date-released"][:4]}
    program["notes"] = f"revision {source_revision()}"
    entries = [_entry("software", "wm_drake", program)]
    for paper in citation["references"]:
        name = re.sub(r"\W", "", paper["notes"].split("]")[0])
        entries.append(_entry(paper["type"], f"wm_drake_{name}", paper))
    return "\n".join(entries)


def _entry(kind: str, key: str, of: Mapping[str, Any]) -> str:
    fields = "".join(f"  {name} = {{{value}}},\n" for name, value in _fields(of))
    return f"@{kind}{{{key},\n{fields}}}\n"


def _fields(of: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield "title", f"{{{of['title']}}}"
    authors = " and ".join(filter(None, map(_author, of["authors"])))
    if authors:
        yield "author", authors
    for name, field in (("journal", "journal"), ("volume", "volume"), ("issue", "number"),
                        ("start", "pages"), ("year", "year"), ("doi", "doi"),
                        ("version", "version"), ("notes", "note")):  # fmt: skip
        if name in of:
            yield field, str(of[name])


def _author(author: Mapping[str, str]) -> str:
    """Return an author; "" if the paper's are not known."""
    if "family-names" in author:
        return f"{author['family-names']}, {author['given-names']}"
    return "" if UNKNOWN in author["name"] else f"{{{author['name']}}}"
