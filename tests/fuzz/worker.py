"""Process that runs the cases of a campaign: numbers on standard input, outcomes on output, as JSON lines."""

import functools
import json
import os
import resource
import shutil
import sys
import tempfile
import time
import traceback
from pathlib import Path
from pkgutil import resolve_name
from unittest import mock

import typer
from fuzz.cases import REQUESTS, STATE, case_of
from fuzz.faults import faults
from starlette.testclient import TestClient

from wm_drake.cli import main
from wm_drake.parameters import load_machine
from wm_drake.parameters.files import shipped_machines
from wm_drake.studies.inputs import build_checked
from wm_drake.studio.server import Studio, application

TOKEN, PORT = "token", 8765
MEMORY_LIMIT = 2 << 30
COMPUTATIONS = (
    "wm_drake.studies.spin.study.run_spin",
    "wm_drake.studies.gasket.screening.run_screening",
    "wm_drake.studies.spin_cycle.study.run_spin_cycle",
    "wm_drake.studies.spin_identify.task.calibrated",
    "wm_drake.studies.gasket_damping.task.virtual_experiment",
    "wm_drake.studies.gasket_damping.task.calibrated",
    "wm_drake.studies.fitting.methods.identify",
    "wm_drake.solid.curves.Gasket.curve",
    "wm_drake.studies.calibrate.study.calibrate",
    "wm_drake.studies.tolerance.study.ToleranceTrials.samples",
    "wm_drake.studies.design.study.run_designs",
    "wm_drake.studies.response.study.run_response_study",
    "wm_drake.studies.modes.study.modes",
    "wm_drake.studies.orders.study.orders_of",
    "wm_drake.rigs.run_rig",
    "wm_drake.studies.machine_show.description.describe",
)
"""What the commands do once the input is accepted; here they end instead."""


def accepted(*_, **__):
    """End the command: its input was accepted."""
    raise typer.Exit(0)


@functools.cache
def shipped_machine(name: str):
    """Return a shipped machine; reading one takes longer than most cases."""
    return load_machine(name)


def load_machine_once(name_or_path="reference"):
    """Read a machine as `load_machine` does, a shipped one only once."""
    if str(name_or_path) in shipped_machines():
        return shipped_machine(str(name_or_path))
    return load_machine(name_or_path)


@functools.cache
def shipped_and_built(name: str):
    """Return a shipped machine as it is built and checked; this takes longer than most cases."""
    return build_checked(name, shipped_machine(name))


def build_checked_once(file, parameters, **options):
    """Build a machine as `build_checked` does, a shipped one that nothing changed only once."""
    if file in shipped_machines() and parameters == shipped_machine(file):
        return shipped_and_built(file)
    return build_checked(file, parameters, **options)


def files(folder: Path) -> dict[str, tuple[int, int]]:
    """Return size and time of each file and folder, by path."""
    return {
        str(path.relative_to(folder)): (path.lstat().st_size, path.lstat().st_mtime_ns)
        for path in folder.rglob("*")
        if path.is_symlink() or path.is_file() or path.is_dir()
    }


@functools.cache
def studio() -> TestClient:
    """Return a client of a studio whose studies do not start; it saves beside the cases."""
    folder = Path(os.environ["FUZZ_STUDIO"])
    mock.patch("wm_drake.studio.jobs.Jobs._launch").start()
    app = application(Studio("reference", folder), TOKEN, PORT)
    base = f"http://127.0.0.1:{PORT}/{TOKEN}/"
    return TestClient(app, base_url=base, raise_server_exceptions=True)


def answered(method: str, path: str, body: str) -> tuple[int, str, str]:
    """Return the answer to a request: 2 for a refusal, with its messages as standard error."""
    text = body.encode("utf-8", errors="surrogatepass")
    headers = {"content-type": "application/json"}
    try:
        answer = studio().request(method, path, content=text, headers=headers)
    except Exception:
        return 1, "", traceback.format_exc()
    if answer.status_code < 400:
        return 0, "", ""
    problems = answer.text
    if answer.headers.get("content-type") == "application/json":
        problems = "\n".join(problem["message"] for problem in answer.json()["problems"])
    return (2 if answer.status_code < 500 else 1), "", problems


def run(arguments: list[str]) -> tuple[int, str, str]:
    """Run a command in this process and return exit code, standard output and standard error."""
    if arguments[0] == "http":
        return answered(*arguments[1:])
    kept = os.dup(1), os.dup(2)
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        os.dup2(out.fileno(), 1)
        os.dup2(err.fileno(), 2)
        try:
            sys.argv = ["wm-drake", *arguments]
            try:
                main()
                code = 0
            except SystemExit as ended:
                code = ended.code or 0
            except BaseException:
                traceback.print_exc()
                code = 1
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os.dup2(kept[0], 1)
            os.dup2(kept[1], 2)
            os.close(kept[0])
            os.close(kept[1])
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read().decode(errors="replace"))
    return int(code), texts[0], texts[1]


def outcome(number: int, top: Path) -> dict:
    """Run one case in a new folder and return what happened."""
    around = top / "around"
    folder = around / "work"
    folder.mkdir(parents=True)
    case = case_of(number, folder)
    before = files(around)
    os.chdir(folder)
    begin = time.process_time()  # other programs may have the processor meanwhile
    code, out, err = run(case.arguments)
    seconds = time.process_time() - begin
    os.chdir(top)
    after = files(around)
    changed = sorted(
        p for p in before.keys() | after.keys() if before.get(p) != after.get(p) and p != "work"
    )
    shutil.rmtree(around)
    result = {
        "number": number,
        "door": case.door,
        "arguments": case.arguments,
        "names": case.names,
        "keys": case.keys,
        "code": code,
        "out": out,
        "err": err,
        "changed": changed,
        "seconds": seconds,
    }
    return result | {"faults": faults(result)}


def limit_memory() -> None:
    """Limit the memory that a case may take, on top of what the package itself takes."""
    size = (
        int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0])
        * resource.getpagesize()
    )
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY_LIMIT, resource.RLIM_INFINITY))


def serve() -> None:
    """Run each case whose number arrives, until the input ends."""
    os.environ["COLUMNS"] = "200"
    # a server would not end by itself
    mock.patch("uvicorn.Server.run", accepted).start()
    with tempfile.TemporaryDirectory() as name:
        top = Path(name)
        os.chdir(top)
        os.environ["FUZZ_STUDIO"] = str(top / "studio")
        for name_of_machine in ("reference", "free_stroke"):  # imports and compiles
            run(["machine", "check", name_of_machine])
        for name in ("run", "ranking"):  # an accepted run compiles too, for longer than a case may
            answered("POST", f"api/{name}", json.dumps({**REQUESTS[name], "state": STATE}))
        for place in COMPUTATIONS:
            owner, _, function = place.rpartition(".")
            mock.patch.object(resolve_name(owner), function, accepted).start()
        mock.patch("wm_drake.parameters.load_machine", load_machine_once).start()
        mock.patch("wm_drake.studies.run.build_checked", build_checked_once).start()
        if sys.platform == "linux":
            limit_memory()
        print("ready", flush=True)  # noqa: T201
        for line in sys.stdin:
            print(json.dumps(outcome(int(line), top)), flush=True)  # noqa: T201


if __name__ == "__main__":
    serve()
