"""Every study does what the driver promises: JSON, files, resumption, interruption, refusals."""

import json
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from every_page import KINDS, write_inputs_of_studies

import wm_drake as wm
from wm_drake.batch.ledger import Ledger
from wm_drake.errors import InputError
from wm_drake.studies import run
from wm_drake.studies.result_folder import LEDGER
from wm_drake.studies.run import options_of_driver
from wm_drake.studies.study import STUDIES

REQUIRED = {"calibrate": KINDS["calibration"].commands[0][1:]}
"""Options of studies that cannot run without any."""
SHORTER = {
    "gasket-damping": KINDS["gasket_damping"].commands,
    "next": KINDS["next"].commands,
    "spin-identify": KINDS["spin_identify"].commands,
    "verdict": KINDS["verdict"].commands,
}
"""Commands of studies that take minutes even with `--quick`: those of their pages."""
SLOWLY = [
    pytest.param(
        name, marks=[pytest.mark.slow] if name in {*REQUIRED, *SHORTER, "gasket-geometry"} else []
    )
    for name in STUDIES
]
SHORTER["tolerance"] = [(*KINDS["tolerance"].commands[0], "--samples", "32", "--subset", "0")]
SHORTER["gasket"] = [("study", "gasket", "--response", "D", "--profile", "short_cycle.yaml")]
SHORTER["gasket-geometry"] = [("study", "gasket-geometry", "--profile", "short_cycle.yaml")]
SHORTER["spin-cycle"] = [("study", "spin-cycle", "--profile", "eight_regions.yaml")]
SHORTER["balancer"] = [(
    "study", "balancer", "--place", "0 mm", "--damping", "100 %",
    "--release", "80 rpm", "--to", "110 rpm", "--rate", "80 rpm/s",
)]  # fmt: skip


@pytest.fixture
def study(wm_drake):
    """Return a function that runs a study with `--quick` and more arguments."""
    write_inputs_of_studies(Path())

    def command(name, *arguments, out="out"):
        words = [*STUDIES[name].command.split(), *REQUIRED.get(name, ()), "--quick"]
        return wm_drake(*words, "--out", out, *arguments)

    return command


def files():
    return {path.name for path in Path("out").iterdir()}


def interrupted(*_, **__):
    raise KeyboardInterrupt


@pytest.mark.parametrize("name", SLOWLY)
def test_interrupted_at_the_end_it_keeps_its_runs_and_writes_what_it_promises(
    study, name, monkeypatch, wm_drake
):
    *first, last = SHORTER.get(name, [()])
    assert all(wm_drake(*command).code == 0 for command in first)
    words = len(STUDIES[name].command.split())
    study, resume = partial(study, name, *last[words:]), []
    if STUDIES[name].has_runs:
        with monkeypatch.context() as patched:
            patched.setattr(Ledger, "mark_finished", interrupted)
            ended = study()
        assert (ended.code, ended.out) == (130, "")
        assert "finished runs are kept in out/ledger.sqlite; continue with --resume" in ended.err
        assert files() == {LEDGER}
        refused = study()
        assert refused.code == 2
        assert "go on from there with --resume" in refused.err
        resume = ["--resume"]
        monkeypatch.setattr(Ledger, "put_all", None)  # whoever stores a run now, runs it again
    ended = study("--json", *resume)
    assert ended.code == 0, ended.err
    assert json.loads(ended.out, parse_constant=pytest.fail)["wall_s"] > 0.0
    made = json.loads(Path("out/run.json").read_text())
    assert made["command"] == STUDIES[name].folder_owner
    assert {"report.html", *made["files"], "run.json"} == files() - {LEDGER}
    assert any(file.endswith(".csv") for file in made["files"])
    options = STUDIES[name].all_options(**made["options"])
    assert options.model_dump(mode="json") == made["options"]
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert "<code>wm-drake " in page
    if not STUDIES[name].has_runs:
        ended = study()
        assert ended.code == 2
        assert "add --overwrite to replace it" in ended.err


@pytest.mark.parametrize("name", STUDIES)
def test_interrupted_before_a_run_it_leaves_nothing(study, name, monkeypatch):
    before = set(Path().iterdir())
    monkeypatch.setattr(run.Executor, "__init__", interrupted)
    ended = study(name)
    assert (ended.code, ended.out) == (130, "")
    assert ended.messages[-1] == "interrupted; nothing was written"
    assert set(Path().iterdir()) == before


@pytest.mark.parametrize("name", STUDIES)
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--machine", "nosuch"), "no such file, and no shipped machine"),
        (("--set", "gravty=9.8 m/s^2"), "did you mean 'gravity'"),
        (("--out", ""), "--out: is empty; name a folder"),
        (("--out", "free.yaml/out"), "free.yaml/out: cannot be written to: Not a directory"),
        (("--nonsense",), "--nonsense"),
    ],
)
def test_bad_options_are_refused_before_any_work(study, name, arguments, message):
    before, options = set(Path().iterdir()), STUDIES[name].options.model_fields
    if arguments[0] == "--machine" and options["machine"].json_schema_extra.get("flag"):
        arguments = arguments[1:]  # the machine is an argument of the command
    ended = study(name, *arguments)
    assert (ended.code, ended.out) == (2, "")
    assert message in ended.err
    assert set(Path().iterdir()) == before


@pytest.mark.parametrize("name", STUDIES)
def test_results_of_another_command_are_never_touched(study, name):
    Path("out").mkdir()
    Path("out/run.json").write_text(
        '{"command": "rig damper", "date": "", "identity": {}, "files": ["a.csv"]}'
    )
    ended = study(name, "--overwrite")
    assert ended.code == 2
    assert "holds results of 'wm-drake rig damper'" in ended.err
    assert files() == {"run.json"}


@pytest.mark.parametrize("name", STUDIES)
def test_each_option_is_described_in_help_and_schema(study, name):
    declared = STUDIES[name]
    shown = study(name, "--help").out
    for model in (declared.options, options_of_driver(declared)):
        schema = model.model_json_schema()
        for field, described in schema["properties"].items():
            assert len(described["description"]) > 10, field
            if described.get("flag") != "argument":
                assert described.get("flag", f"--{field.replace('_', '-')}") in shown
    assert set(declared.quick) <= set(declared.options.model_fields)


@pytest.mark.parametrize("name", STUDIES)
def test_python_refuses_an_unknown_option(name):
    with pytest.raises(InputError, match="nonsense"):
        wm.run_study(name, nonsense=1)


def test_declarations_do_not_import_what_is_slow():
    code = (
        "import sys; from wm_drake.studies.study import STUDIES; list(STUDIES); "
        "print({'pydrake', 'pandas', 'scipy', 'plotly', 'matplotlib'} & set(sys.modules))"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout == "set()\n"
