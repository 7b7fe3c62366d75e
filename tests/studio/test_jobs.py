"""Studies that a page starts: options, folders, processes, reports."""

import json
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pytest

from wm_drake.errors import InputError
from wm_drake.live.state import PageState
from wm_drake.parameters import load_machine
from wm_drake.studio import jobs as jobs_module
from wm_drake.studio.answers import picture, picture_runner_of
from wm_drake.studio.jobs import Jobs
from wm_drake.studio.machines import Machines

STATE = PageState(machine="reference", load="middle", values={"gasket.stiffness_x": "4 N/mm"})
PAGE = '<p class="summary">Gap 3 &lt; 4 mm.</p>'
PROGRAM = f"""
import sys, pathlib, time
arguments = sys.argv[3:]
print("runs: 3 of 40, 10 s", flush=True)
if "--samples=16" in arguments:
    time.sleep(60)
pathlib.Path("results").mkdir()
pathlib.Path("results/report.html").write_text({PAGE!r})
"""


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    machines = Machines("reference", tmp_path_factory.mktemp("machines"))
    return machines, machines.open("reference")


@pytest.fixture
def jobs(tmp_path, monkeypatch):
    """Return studies whose command is a small program that behaves like one."""
    program = tmp_path / "program"
    program.write_text(f"#!{sys.executable}\n{PROGRAM}")
    program.chmod(0o755)
    monkeypatch.setattr(jobs_module.sys, "executable", str(program))
    # a shell that starts the tests with & makes them, and what they start, ignore this signal
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    found = Jobs(tmp_path / "studies")
    yield found
    found.end(timeout=5.0)
    signal.signal(signal.SIGINT, before)


def waited(jobs, identifier, wanted):
    end = time.monotonic() + 20.0
    while time.monotonic() < end:
        shown = jobs.shown(identifier)
        if shown["state"] == wanted and shown["progress"]:
            return shown
        time.sleep(0.05)
    raise AssertionError(f"never {wanted}: {shown}")


def test_study_runs_and_its_report_is_found(jobs, opened):
    identifier = jobs.start(*opened, STATE, "gasket", {"trials": "27"})
    shown = waited(jobs, identifier, "finished")
    assert shown["progress"] == (3, 40)
    assert shown["command"].endswith("--machine machine.yaml --out results --trials=27")
    assert jobs.report_file(identifier, "report.html").read_text() == PAGE
    machine = (jobs.folder / identifier / "machine.yaml").read_text()
    assert "set in wm-drake studio" in machine
    # a later server finds it
    assert [job["state"] for job in Jobs(jobs.folder).listed()] == ["finished"]


def test_study_with_the_machine_as_argument_runs_and_its_answer_is_shown(jobs, opened):
    identifier = jobs.start(*opened, STATE, "next", {"budget": "2"})
    shown = waited(jobs, identifier, "finished")
    assert shown["command"] == "wm-drake study next machine.yaml --out results --budget=2"
    assert shown["answer"] == "Gap 3 < 4 mm."


def test_study_is_known_by_its_machine(jobs, opened):
    machines, machine = opened
    written = {"gasket.stiffness_x": "4000 N/m"}
    states = [
        STATE,
        STATE.model_copy(update={"values": written, "load": "front"}),
        STATE.model_copy(update={"values": {}}),
        STATE.model_copy(update={"gasket": False}),
    ]
    started = [jobs.start(machines, machine, state, "gasket", {}) for state in states]
    marks = [jobs.shown(identifier)["mark"] for identifier in started]
    assert marks[0] == marks[1]
    assert len(set(marks)) == 3
    drawn = [picture(machine, picture_runner_of(machine), state)["mark"] for state in states]
    assert drawn == marks
    assert PageState(**jobs.shown(started[0])["chosen"]) == STATE


def test_verdict_is_started_and_a_machine_has_its_own_name(jobs, opened):
    first = jobs.start(*opened, STATE, "verdict", {"samples": "32"})
    as_it_is = STATE.model_copy(update={"values": {}})
    second = jobs.start(*opened, as_it_is, "verdict", {"samples": "32"})
    command = "wm-drake verdict machine.yaml --out results --samples=32"
    assert jobs.shown(first)["command"] == command
    names = [load_machine(jobs.folder / one / "machine.yaml").name for one in (first, second)]
    assert names == ["reference, changed", "reference"]


def test_study_is_cancelled_and_continued(jobs, opened):
    identifier = jobs.start(*opened, STATE, "tolerance", {"samples": "16"})
    waited(jobs, identifier, "running")
    jobs.cancel(identifier)
    waited(jobs, identifier, "not finished")
    path = jobs.folder / identifier / "job.json"
    about = json.loads(path.read_text())
    path.write_text(json.dumps(about | {"command": about["command"][:-1]}))  # a shorter one
    jobs.resume(identifier)
    assert waited(jobs, identifier, "finished")["report"]


def test_studies_wait_for_their_turn(jobs, opened, monkeypatch):
    monkeypatch.setattr(jobs_module, "MOST_RUNNING", 2)
    monkeypatch.setattr(jobs_module, "MOST_WAITING", 3)
    with ThreadPoolExecutor(8) as pool:  # pages ask at the same time
        start = partial(jobs.start, *opened, STATE, "tolerance", {"samples": "16"})
        started = [future.result() for future in [pool.submit(start) for _ in range(4)]]
    shown = [jobs.shown(identifier) for identifier in started]
    assert sorted(one["state"] for one in shown) == ["running"] * 2 + ["waiting"] * 2
    assert sorted(one["place"] for one in shown if one["place"]) == [1, 2]
    start()
    with pytest.raises(InputError, match="3 studies wait already"):
        start()
    running = [one["id"] for one in shown if one["state"] == "running"]
    first, second = sorted((one for one in shown if one["place"]), key=lambda one: one["place"])
    jobs.cancel(first["id"])
    assert jobs.shown(first["id"])["state"] == "not finished"
    assert jobs.shown(second["id"])["place"] == 1
    waited(jobs, running[0], "running")
    jobs.cancel(running[0])
    assert waited(jobs, second["id"], "running")["place"] is None


@pytest.mark.parametrize(
    ("study", "options"),
    [
        ("tolerance", {"load": "--out"}),
        ("tolerance", {"load": "-h"}),
        ("tolerance", {"samples": "--out=x"}),
        ("tolerance", {"quick": "--out"}),
        ("rm", {}),
        ("calibrate", {}),
        ("gasket", {"out": "x"}),
        ("gasket", {"factors": "x.yaml"}),
        ("gasket", {"trials": "1; rm -rf /"}),
        ("gasket", {"load": "--machine=x"}),
        ("gasket", {"design": "../../x.csv"}),
        ("tolerance", {"samples": "-1"}),
        ("tolerance", {"samples": "1"}),
        ("tolerance", {"file": "/etc/passwd"}),
    ],
)
def test_hostile_study_is_not_started(jobs, opened, study, options):
    with pytest.raises(InputError):
        jobs.start(*opened, STATE, study, options)
    assert not jobs.folder.exists()


@pytest.mark.parametrize("name", ["../job.json", "../../x", "/etc/passwd", "missing.html", ""])
def test_report_file_stays_in_the_results(jobs, opened, name):
    identifier = jobs.start(*opened, STATE, "gasket", {})
    waited(jobs, identifier, "finished")
    with pytest.raises(InputError):
        jobs.report_file(identifier, name)
    with pytest.raises(InputError):
        jobs.report_file("../" + identifier, "report.html")
