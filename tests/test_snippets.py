"""Each snippet of the manual and the README is run, or the test says what else runs it.

The Python snippets and YAML blocks of the how-to pages are in test_readme; the cells of tutorials
are executed when the manual is built; the commands of the gallery by analyses/make_gallery.py.
"""

import re
import shlex
import subprocess
import sys
from types import SimpleNamespace

import pytest
from snippets import BLOCKS, FILES, SHELL, prepare

NOT_SHELL = {
    "{code-cell}": "executed when the manual is built; a failure ends the build",
    "mermaid": "compared with the diagram in test_readme",
    "python": "run in test_readme",
    "yaml": "read in test_readme",
    "csv": "read by the commands of its page",
    "{eval-rst}": "no snippet",
    "toml": "metadata of a package of a user: tests/extension",
    "{image}": "no snippet",
    "{include}": "no snippet",
    "{literalinclude}": "a piece of a test",
    "{toctree}": "no snippet",
}
ELSEWHERE = {  # pages whose commands and files something else runs
    "docs/how-to/extend.md": "tests/extension runs what it shows, and test_readme reads its file",
    "docs/gallery.md": "analyses/make_gallery.py runs them and takes pictures of what they write",
}
NOT_RUN = {  # beginning of a command, and why this test does not run it
    "sudo": "installs packages of the system: .ci/fresh",
    "python3 -m venv": "installs into a new environment: .ci/run",
    ".venv/bin/pip": "installs into a new environment: .ci/run",
    "source .venv": "changes the shell only",
    "pip install": "installs into a new environment: .ci/run",
    "python analyses/": "tests/analyses runs it with --quick",
    "sphinx-build": "builds the manual: .ci/run",
    "wm-drake export fmu": "compiles for a minute: tests/export",
    "wm-drake export page": "compiles for a minute: tests/browser",
    "wm-drake studio": "serves until it is stopped: tests/studio",
    "wm-drake study gasket --cluster": "needs a cluster: tests/batch/test_cluster.py and a tutorial",
    "wm-drake study tolerance laundry_and_parts": "minutes: as laundry",
    "wm-drake study tolerance laundry --samples 8192": "minutes: the tutorial will-it-hit runs 128",
    "wm-drake study design mine.yaml --evaluations 5000": "minutes: test_readme reads the file",
    "wm-drake study gasket-damping --mesh 0.05": "minutes: --mesh 4 is in the gallery",
    "wm-drake study next --vary free.yaml": "the tutorial measure-next runs it with a short machine",
    "wm-drake calibrate --vary free.yaml --resume": "continues what was interrupted: test_cli_calibrate",
}
HOURS = (  # commands of more than some five seconds of processor time; the marker `hours` runs them
    "wm-drake verdict", "wm-drake gasket curves folded",
    "wm-drake study cycle", "wm-drake study tolerance", "wm-drake study spin-cycle", "wm-drake study spin-identify",
    "wm-drake study gasket", "wm-drake study drive", "wm-drake study balancer", "wm-drake study design", "wm-drake study detect",
    "wm-drake study next",
    "wm-drake study modes", "wm-drake study response", "wm-drake calibrate",
    "wm-drake spin --engine drake",
    "wm-drake identify damper bench/*.csv --law coulomb", "wm-drake identify damper fit/*.csv",
    "wm-drake spin --compare-gasket --out", "wm-drake spin --machine ball_rings",
    "wm-drake spin --machine liquid_rings", "wm-drake spin --machine heavy_cabinet",
    "wm-drake spin --load middle --figures", "wm-drake identify gasket rubber/*.csv",
    "wm-drake gasket curves one_fold.yaml", "wm-drake spin --machine wm-drake-gasket-curves",
)  # fmt: skip
OVERVIEWS = ("README.md", "docs/how-to/commands.md")
"""Pages whose commands another page may run."""
COMMANDS = {}
for _block in BLOCKS:
    if _block.page not in ELSEWHERE and _block.commands:
        COMMANDS.setdefault(_block.page, []).extend(_block.commands)


def reason_not_to_run(command):
    """Return why a command is not run here, or None."""
    return next((why for begin, why in NOT_RUN.items() if command.startswith(begin)), None)


def is_long(command):
    """Return whether a command takes longer than a slow test may."""
    return command.startswith(HOURS)


def test_every_block_is_of_a_known_kind():
    assert {block.language for block in BLOCKS} <= {*NOT_SHELL, *SHELL}


def test_every_command_line_is_a_command():
    for page, commands in COMMANDS.items():
        for command in commands:
            known = command.startswith(("wm-drake ", "printf ")) or reason_not_to_run(command)
            assert known, f"{page}: {command}"


def test_a_reason_and_a_mark_belong_to_a_command():
    lines = [line for commands in COMMANDS.values() for line in commands]
    for begin in (*NOT_RUN, *HOURS):
        assert any(line.startswith(begin) for line in lines), begin


def test_every_file_block_has_a_name():
    counted = {}
    for block in BLOCKS:
        if block.language in ("yaml", "csv") and block.page not in ELSEWHERE:
            counted[block.page] = counted.get(block.page, 0) + 1
    assert counted == {page: len(names) for page, names in FILES.items()}


def run_all(wm_drake, folder, page, chosen, more=()):
    """Run commands of a page in its folder, one after the other, and return those that failed.

    Args:
        more: Options for commands `spin` without a spin profile of their own.
    """
    prepare(folder, page, chosen)
    failed = []
    for command in chosen:
        if command.startswith("printf "):
            text, target = re.match(r"printf '(.*)' > (\S+)", command).groups()
            (folder / target).write_text(text.replace("\\n", "\n"), encoding="utf-8")
            continue
        words = []
        for word in shlex.split(command.split(" > ")[0])[1:]:
            paths = sorted(path.relative_to(folder).as_posix() for path in folder.glob(word))
            words += paths or [word]  # a word such as N*m names no files
        if words[:2] == ["machine", "new"]:  # never over a file
            (folder / f"{words[2]}.yaml").unlink(missing_ok=True)
        has_folder = words[0] not in ("machine", "cite") and words[:2] != ["record", "channels"]
        if has_folder and "--resume" not in words:
            first = next((n for n, word in enumerate(words) if word.startswith("-")), len(words))
            words.insert(first, "--overwrite")  # before an option that takes several values
        if words[0] == "spin" and "--profile" not in words:
            words += more
        run = in_another_process if "--replay" in words else wm_drake
        result = run(*words)
        if result.code:
            failed.append((command, result.code, result.err))
    return failed


def in_another_process(*words):
    """Run a command alone: Drake's Meshcat ends a process that collects it in another thread."""
    program = [sys.executable, "-c", "from wm_drake.cli import main; main()"]
    done = subprocess.run([*program, *words], capture_output=True, text=True, check=False)
    return SimpleNamespace(code=done.returncode, out=done.stdout, err=done.stderr)


def pages_with(long):
    return [
        pytest.param(page, [line for line in lines if not reason_not_to_run(line)], id=page)
        for page, lines in COMMANDS.items()
        if any(not reason_not_to_run(line) and is_long(line) == long for line in lines)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("page", "lines"), pages_with(False))
def test_the_commands_of_a_page_run(page, lines, wm_drake, tmp_path):
    """Run the short commands; those that read what a long one writes run with the long ones.

    Machines run up to 120 rpm only; whole run-ups are in the tutorials.
    """
    reads_long = ("wm-drake-identify/", "wm-drake-design/")
    others = {line for name, those in COMMANDS.items() if name not in OVERVIEWS for line in those}
    short = [
        line
        for line in lines
        if not is_long(line)
        and not (page in OVERVIEWS and line in others)
        and not (any(word in line for word in reads_long) and any(map(is_long, lines)))
    ]
    assert run_all(wm_drake, tmp_path, page, short, ("--profile", "spin.csv")) == []


@pytest.mark.hours
@pytest.mark.parametrize(("page", "lines"), pages_with(True))
def test_the_long_commands_of_a_page_run(page, lines, wm_drake, tmp_path):
    assert run_all(wm_drake, tmp_path, page, lines) == []
