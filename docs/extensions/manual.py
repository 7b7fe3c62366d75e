"""Sphinx extension of the manual: what is written from the program, and links out of `docs`.

A page asks for a text by a mark:

- `<!-- machine file keys -->`: the keys of a machine file;
- `<!-- command options -->`: the commands with their options;
- `<!-- measures -->`: the measures of a run;
- `<!-- public names -->`: the public names of the package;
- `<!-- pages of decisions -->`: the decisions, below their list in the navigation;
- `<!-- functions of MODULE -->`: the functions of a module of laws, or `MODULE: NAME NAME` of them;
- `<!-- picture NAME -->`: a picture that is drawn from the code (`pictures.py`, `schematics.py`);
- `<!-- machine NAME -->`: a page, folded, in which a shipped machine runs;
- `<!-- architecture -->`: the rooms of the package and their imports (`architecture.py`).
"""

import contextlib
import importlib
import inspect
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import architecture
import machine_keys
import schematics  # noqa: F401  (registers its pictures)
import typer
from equations import mathml_of, with_indices
from jupyter_cache import get_cache
from jupyter_cache.cache.db import create_db
from machine_keys import escaped
from pictures import svg_of
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

import wm_drake
from wm_drake.live.exported import export_page
from wm_drake.simulation.measures import MEASURES

NAMES = "<!-- public names -->"
COMMANDS, MEASURED = "<!-- command options -->", "<!-- measures -->"
BELOW, ROOMS = "<!-- pages of decisions -->", "<!-- architecture -->"
TREE_BELOW = "```{toctree}\n:hidden:\n:glob:\n\n0*\n```"
FUNCTIONS = re.compile(r"<!-- functions of ([\w.]+)(?:: ([\w ]+))? -->")
PICTURE = re.compile(r"<!-- picture ([\w-]+) -->")
MACHINE = re.compile(r"<!-- machine ([\w-]+) -->")
LIVE = "_static/machine-{}.html"
"""Where the page of a machine is in the manual."""
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)\s]+?)(#[^)\s]*)?\)")
PAGE_OF_MANUAL = re.compile(r"`?docs/([\w/-]+)\.md`?")
SECTION = re.compile(r"(Args|Returns|Raises|Yields|Attributes|Example):$")
NAME_OF_FIELD = re.compile(r" {4}(?! )[\w*, ]+:")
PAGES_OUTSIDE = {
    "README.md": "about/sources",
    "CHANGELOG.md": "about/changelog",
    "CONTRIBUTING.md": "about/contributing",
    "sdf/README.md": "reference/bodies",
    "analyses/README.md": "about/analyses",
}
"""Pages of the manual that include documents of the checkout outside of `docs`."""
PICTURES_OF_KEYS = {
    "Frame override": "geometry",
    "Force table": "table",
    "Telescopic damper": "tubes",
    "Cabinet": "cabinet",
    "Unbalance": "load",
    "Spin profile": "profile",
    "Torque limit": "drive",
}
"""Picture of a group of keys, drawn from the models."""


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the extension."""
    app.add_lexer("csv", TextLexer)
    app.connect("builder-inited", _open_cache)
    app.connect("env-before-read-docs", _spread)
    app.connect("source-read", _complete)
    app.connect("include-read", _complete_included)
    app.connect("build-finished", _export_machines)
    app.connect("autodoc-process-docstring", _plain_docstring, priority=400)  # before napoleon
    return {"parallel_read_safe": True}


def _open_cache(app: Sphinx) -> None:
    """Make the database of executed notebooks before processes that read pages race to make it."""
    create_db(get_cache(app.config.nb_execution_cache_path).path).dispose()


def _spread(_app: Sphinx, _env: Any, names: list[str]) -> None:
    """Spread the notebooks evenly over the pages: processes read pages in blocks, in this order."""
    notebooks = [name for name in names if name.startswith("tutorials/")]
    others = [name for name in names if name not in notebooks]
    step = len(others) / max(1, len(notebooks))
    for number, name in reversed(list(enumerate(notebooks))):
        others.insert(round(number * step), name)
    names[:] = others


def _complete(app: Sphinx, docname: str, source: list[str]) -> None:
    """Fill the marks of a page, and lead its links to pages of the manual."""
    text = source[0]
    if machine_keys.BEGIN in text:
        text = machine_keys.BLOCK.sub(lambda _: "\n".join(_keys()), text)
    if COMMANDS in text:
        text = text.replace(COMMANDS, "\n".join(_commands()))
    if MEASURED in text:
        text = text.replace(MEASURED, "\n".join(_measures()))
    if NAMES in text:
        text = text.replace(NAMES, _documented(_public_names()))
    text = text.replace(BELOW, TREE_BELOW)
    if ROOMS in text:
        text = text.replace(ROOMS, f"```{{raw}} html\n{architecture.svg()}\n```")
    text = FUNCTIONS.sub(lambda match: _documented(_functions(match[1], match[2])), text)
    text = PICTURE.sub(lambda match: _drawn(match[1]), text)
    text = MACHINE.sub(lambda match: _live(match[1], docname), text)
    source[0] = _relinked(text, Path(app.srcdir), Path(app.srcdir, docname).parent, docname)


def _live(name: str, docname: str) -> str:
    """Return a frame, folded, with the page of a machine; the browser loads it when it opens."""
    source = "../" * docname.count("/") + LIVE.format(name)
    return (
        f"```{{raw}} html\n<details class='live'><summary>Run the machine {name} here</summary>\n"
        f"<iframe loading='lazy' title='the machine {name}' src='{source}'></iframe></details>\n```"
    )


def _export_machines(app: Sphinx, error: Exception | None) -> None:
    """Write the page of each machine that a page of the manual shows."""
    if error is not None or app.builder.format != "html":
        return
    pages = (path.read_text(encoding="utf-8") for path in Path(app.srcdir).rglob("*.md"))
    for name in sorted({name for text in pages for name in MACHINE.findall(text)}):
        out = Path(app.outdir, LIVE.format(name))
        export_page(wm_drake.load_machine(name), out)


def _complete_included(app: Sphinx, path: Path, _docname: str, content: list[str]) -> None:
    """Lead the links of an included document to pages of the manual.

    MyST gives the last part of the page's name only, so the name is that of the environment.
    """
    folder = Path(app.srcdir, path).resolve().parent
    content[0] = _relinked(content[0], Path(app.srcdir), folder, app.env.docname)


def _relinked(text: str, docs: Path, folder: Path, docname: str) -> str:
    """Return a text whose links to files of the checkout work in the manual.

    Args:
        text: Markdown.
        docs: Folder of the manual.
        folder: Folder that the links start from.
        docname: Page that the text becomes a part of.
    """
    checkout, here = docs.parent, Path(docname).parent
    up = "../" * (len(here.parts))

    def replaced(link: re.Match[str]) -> str:
        label, target, anchor = link[1], link[2], link[3] or ""
        if ":" in target:
            return link[0]
        path = (folder / target).resolve()
        if not path.is_relative_to(checkout):
            return link[0]
        name = path.relative_to(checkout).as_posix()
        if name in PAGES_OUTSIDE:
            return f"[{label}]({up}{PAGES_OUTSIDE[name]}.md)"
        if name == "docs/README.md":
            return f"[{label}]({up}index.md)"
        if path.is_relative_to(docs) and path.suffix == ".md":
            return f"[{label}]({up}{path.relative_to(docs).as_posix()}{anchor})"
        if path.is_relative_to(docs) and path.is_file():
            return link[0]
        return f"{label} (`{name}`)" if label.strip("`") != name else f"`{name}`"

    return LINK.sub(replaced, text)


def _plain_docstring(
    _app: Sphinx, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]
) -> None:
    """Turn a docstring in plain text into reStructuredText.

    An indented block before the sections of arguments is an equation, which is typeset; of formulas
    in sentences, indices and powers are. Bars and stars are no markup.
    """
    new: list[str] = []
    block: list[str] = []
    section = ""
    for line in lines:
        match = SECTION.match(line)
        section = match[1] if match else section
        if (line.startswith("    ") and not section) or (block and not line):
            block.append(line)
            continue
        new += _typeset(block)
        block = []
        name = NAME_OF_FIELD.match(line) if section in ("Args", "Attributes") else None
        head = name[0] if name else ""
        text = line[len(head) :].replace("|", "\\|").replace("*", "\\*")
        text = text if section == "Example" else with_indices(text)
        new.append(PAGE_OF_MANUAL.sub(r":doc:`/\1`", head.replace("*", "\\*") + text))
    lines[:] = new + _typeset(block)


def _typeset(block: list[str]) -> list[str]:
    """Return an indented block as an equation; what is no equation stays as it is."""
    if not block:
        return []
    html = mathml_of(block)
    if html is None:
        return ["::", "", *block, ""]
    return [".. raw:: html", "", f'    <div class="equation">{html}</div>', ""]


def _public_names() -> Iterator[tuple[str, str]]:
    for name in wm_drake.__all__:
        kind = "autoclass" if inspect.isclass(getattr(wm_drake, name)) else "autofunction"
        yield kind, f"wm_drake.{name}"


def _drawn(name: str) -> str:
    """Return a picture as a block of HTML."""
    return f"```{{raw}} html\n{svg_of(name)}\n```"


def _functions(module: str, chosen: str | None) -> Iterator[tuple[str, str]]:
    for name in (chosen or "").split():
        yield "autofunction", f"{module}.{name}"
    if chosen:
        return
    for name, value in vars(importlib.import_module(module)).items():
        function = getattr(value, "py_func", value)
        if (
            inspect.isfunction(function)
            and function.__module__ == module
            and not name.startswith("_")
        ):
            yield "autofunction", f"{module}.{name}"


def _documented(names: Iterator[tuple[str, str]]) -> str:
    directives = "\n\n".join(f".. {kind}:: {name}" for kind, name in names)
    return f"```{{eval-rst}}\n{directives}\n```"


def _commands() -> Iterator[str]:
    """Yield a section for each command: its help, and a table of its arguments and options."""
    app = typer.main.get_command(importlib.import_module("wm_drake.cli").app)
    contexts = [type(app).context_class(app, info_name="wm-drake")]
    while contexts:
        context = contexts.pop()
        command: Any = context.command
        if hasattr(command, "list_commands"):
            for name in reversed(command.list_commands(context)):
                below = command.get_command(context, name)
                contexts.append(type(below).context_class(below, parent=context, info_name=name))
            continue
        with contextlib.redirect_stdout(io.StringIO()):
            command.get_help(context)  # completes the help of its options
        yield f"## {context.command_path.removeprefix('wm-drake ')}\n\n{escaped(command.help)}\n"
        yield "| option | meaning |\n|---|---|"
        for option in command.params:
            names, meaning = option.get_help_record(context)
            cells = (f"`{names}`", escaped(meaning).replace("<", "&lt;").replace("*", "\\*"))
            yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
        yield ""


def _measures() -> Iterator[str]:
    """Yield the rows of a table of the variables of all measures."""
    yield "| measure | variable | for each | unit | what it is | response |"
    yield "|---|---|---|---|---|---|"
    for measure in MEASURES.values():
        for variable in measure.variables:
            places = ", ".join(variable.dims)
            cells = (f"`{measure.name}`", f"`{variable.name}`", places, variable.units)
            response = f"`{variable.group_name}`" if variable.is_response else ""
            yield f"| {' | '.join(cells)} | {escaped(variable.about)} | {response} |"


def _keys() -> Iterator[str]:
    return machine_keys.keys(
        lambda title: _drawn(PICTURES_OF_KEYS[title]) if title in PICTURES_OF_KEYS else ""
    )
