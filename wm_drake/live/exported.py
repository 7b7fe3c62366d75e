"""Write a machine as one file that runs it in a browser: `wm-drake export page`.

The page is that of the studio. Its engine is the compiled machine (`wm_drake.export.page_kernel`)
in place of the server.
"""

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wm_drake.errors import check_known, input_error
from wm_drake.live.page_data import page_data
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case, is_as_measured, notice_jumping_friction
from wm_drake.written_files import check_new, write_files

STATIC = Path(__file__).parent / "static"
POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; worker-src blob:; "
    "script-src 'wasm-unsafe-eval' '{hash}'; base-uri 'none'; form-action 'none'"
)
"""What the page may do: run its own script and the machine, nothing else; it reaches nothing."""
WORKER = """
onmessage = ({data: first}) => {
  modules.worker.begin(first);
  onmessage = ({data: job}) => postMessage(modules.worker.answer(job));
};
"""
_IMPORT = re.compile(r"^import \{(.*?)\} from '\./(\w+)\.js';$", re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async function|function|class|const) (\w+))", re.MULTILINE)


@dataclass(frozen=True)
class ExportedPage:
    """A page that was written.

    Attributes:
        size: Size of the file. [byte]
        movable, fixed: How many numbers can be moved on it, and how many are shown only.
    """

    path: Path
    size: int
    movable: int
    fixed: int


def export_page(
    parameters: MachineParameters,
    out: str | Path,
    loads: Sequence[str] = (),
    given: str = "",
    sets: Sequence[str] = (),
) -> ExportedPage:
    """Write a machine as one HTML file that runs it.

    Args:
        out: File to write; it is replaced if it exists.
        loads: Names of the loads that run; all if empty.
        given, sets: As for `page_text`.

    Raises:
        InputError: a load is unknown, the compiled engine does not represent the machine, or the
            file cannot be written. Nothing is written then.
    """
    for name in loads:
        message = f"no load '{name}' in machine '{parameters.name}'"
        check_known(name, parameters.loads, message, key="loads")
    if loads:
        chosen = {name: parameters.loads[name] for name in loads}
        parameters = parameters.model_copy(update={"loads": chosen})
    path = Path(out)
    _check_place(path)
    notice_jumping_friction(parameters)
    text, data = page_text(parameters, given, sets)
    write_files({path: text}, replace=True)
    numbers = data["machine"]["numbers"]
    fixed = sum(1 for number in numbers if number["needs"])
    return ExportedPage(path, len(text.encode()), len(numbers) - fixed, fixed)


def page_text(
    parameters: MachineParameters, given: str = "", sets: Sequence[str] = (), *, gasket: bool = True
) -> tuple[str, dict[str, Any]]:
    """Return the page of a machine, and what it knows of the machine.

    Args:
        given: Name or path of the machine at the command line, for the commands that the page
            writes; its name if empty.
        sets: Changes of that machine in these parameters, as `--set` has them.
        gasket: Whether the page begins with the gasket.

    Raises:
        InputError: the machine has no load or one that dries, or the compiled engine does not
            represent it.
    """
    if not parameters.loads:
        raise input_error("the machine has no load, so there is nothing to run", key="loads")
    for name, load in parameters.loads.items():
        if load.wet:
            raise input_error(
                "its water leaves during a run, which the functions of a page do not follow; name "
                "other loads by --load, or leave water out",
                key=f"loads.{name}",
            )
    begin = {"gasket": gasket and parameters.gasket is not None}
    data = page_data(parameters)
    data |= {"given": given or parameters.name, "sets": [*sets], "begin": begin}
    return _page(data), data


def page_of_cases(
    parameters: MachineParameters, cases: Sequence[Case], given: str, sets: Sequence[str]
) -> str:
    """Return the page that runs cases of a machine, all with the profile and gasket of the first.

    It has measured values only if all cases are as measured.

    Args:
        given, sets: As for `page_text`.
    """
    first = cases[0]
    shown: dict[str, Any] = {
        "loads": {case.name: case.load for case in cases},
        "profile": first.profile,
    }
    if sets or not all(is_as_measured(parameters, case) for case in cases):
        shown["measured"] = ()
    return page_text(parameters.model_copy(update=shown), given, sets, gasket=first.gasket)[0]


def bundled(first: str, replaced: Mapping[str, str]) -> str:
    """Return a module of the page and all that it imports as one script.

    Args:
        first: Name of the module.
        replaced: Names of modules in whose place others are taken.
    """
    order: dict[str, str] = {}

    def add(name: str) -> None:
        if name in order:
            return
        text = (STATIC / f"{replaced.get(name, name)}.js").read_text(encoding="utf-8")
        for _, imported in _IMPORT.findall(text):
            add(imported)
        names = _EXPORT.findall(text)
        text = _IMPORT.sub(
            lambda m: f"const {{{m[1].replace(' as ', ': ')}}} = modules.{m[2]};", text
        )
        order[name] = f"{{\n{_EXPORT.sub('', text)}\nmodules.{name} = {{{', '.join(names)}}};\n}}\n"

    add(first)
    return "const modules = {};\n" + "".join(order.values())


def _page(data: Mapping[str, Any]) -> str:
    """Return the text of the page."""
    template = (STATIC / "index.html").read_text(encoding="utf-8")
    style = (STATIC / "studio.css").read_text(encoding="utf-8")
    worker = f"'use strict';\n{bundled('worker', {})}{WORKER}"
    content = json.dumps({**data, "worker": worker}, allow_nan=False)
    script = "\n" + bundled("main", {"server": "page_engine"})
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = html.escape(POLICY.format(hash=f"sha256-{digest}"))
    head = f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<style>{style}</style>'
    text = re.sub(r'<link rel="stylesheet".*?>', lambda _: head, template)
    text = text.replace("<h1>wm-drake studio</h1>", "<h1>wm-drake</h1>")
    text = re.sub(r"<script type=\"module\".*?</script>\n", "", text)
    body = (
        f'<script type="application/json" id="machine-data">{_in_html(content)}</script>\n'
        f'<script type="module">{script}</script>\n</body>'
    )
    return text.replace("</body>", body).replace("<html ", '<html data-engine="page" ')


def _in_html(text: str) -> str:
    """Return JSON that may stand in a script element: it cannot end it."""
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _check_place(path: Path) -> None:
    """Check before the work that a file can be written there."""
    if path.suffix not in (".html", ".htm"):
        raise input_error(f"'{path.name}' must end with .html", where="out")
    if not path.parent.is_dir():
        raise input_error(f"there is no folder '{path.parent}'", where="out")
    check_new([path], replace=True)
