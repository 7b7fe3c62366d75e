"""Studies that a page starts: the very command as a process, its output, its report.

Each study has a folder of its own with the machine file, the output and the results. A server that
starts finds the studies of earlier ones there.
"""

import html
import json
import re
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wm_drake.errors import WmDrakeError, input_error
from wm_drake.live.machine import OpenMachine
from wm_drake.live.state import PageState
from wm_drake.report.provenance import now
from wm_drake.studies.study import STUDIES
from wm_drake.studio.forms import arguments
from wm_drake.studio.machines import Machines
from wm_drake.studio.saving import chosen, mark_of, write_machine
from wm_drake.written_files import unwritable, write_files

MOST_RUNNING = 4
"""Largest number of studies that run at a time."""

MOST_WAITING = 20
"""Largest number of studies that wait for their turn."""

LONGEST_OUTPUT = 20_000
"""Number of characters at the end of the output that a page gets."""

_IDENTIFIER = re.compile(r"[a-z0-9_-]{1,60}-[0-9]{1,6}")
_PROGRESS = re.compile(r"([0-9]+) of ([0-9]+)")


@dataclass
class Jobs:
    """Studies of a folder.

    Attributes:
        folder: Where each study has its folder.
    """

    folder: Path
    _running: dict[str, "subprocess.Popen[bytes]"] = field(default_factory=dict)
    _waiting: dict[str, Sequence[str]] = field(default_factory=dict)
    _lock: threading.RLock = field(default_factory=threading.RLock)

    def start(
        self,
        machines: Machines,
        machine: OpenMachine,
        state: PageState,
        study: str,
        options: dict[str, str],
    ) -> str:
        """Start a study of what a page has chosen, or let it wait, and return its identifier.

        Raises:
            InputError: there is no such study or option, a number is wrong, too many studies wait,
                or the folder cannot be written.
        """
        words = arguments(study, options)
        if len(self._waiting) >= MOST_WAITING:
            raise input_error(f"{MOST_WAITING} studies wait already; cancel one", key=study)
        parameters = chosen(machine, state)
        base = machines.name_or_path(state.machine)
        identifier = self._new_folder(study)
        folder = self.folder / identifier
        try:
            name = machine.parameters.name
            is_other = bool(state.values or state.masses or not state.gasket)
            title = f"{name}, changed" if is_other else name
            write_machine(folder / "machine.yaml", base, parameters, machine, title)
            given = ["machine.yaml"] if _takes_machine(study) else ["--machine", "machine.yaml"]
            command = [*STUDIES[study].command.split(), *given, "--out", "results", *words]
            about = {
                "study": study,
                "command": command,
                "started": now(),
                "machine": state.machine,
                "mark": mark_of(machine.moved(state.values), state),
                "chosen": state.model_dump(),
            }
            write_files({folder / "job.json": json.dumps(about, indent=1) + "\n"}, replace=False)
            self._enqueue(identifier, command)
        except WmDrakeError:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        return identifier

    def resume(self, identifier: str) -> None:
        """Continue a study that was cancelled or whose server was killed.

        Raises:
            InputError: there is no such study, or it runs.
        """
        about = self._about(identifier)
        if self._runs(identifier) or identifier in self._waiting:
            raise input_error("runs already", key=identifier)
        again = ["--resume"] if STUDIES[about["study"]].has_runs else []
        self._enqueue(identifier, [*about["command"], *again])

    def cancel(self, identifier: str) -> None:
        """Interrupt a study as Ctrl-C does; what it has finished is kept."""
        self._about(identifier)
        with self._lock:
            self._waiting.pop(identifier, None)
        process = self._running.get(identifier)
        if process is not None and process.poll() is None:
            process.send_signal(signal.SIGINT)

    def listed(self) -> list[dict[str, Any]]:
        """Return all studies of the folder, the latest first."""
        names = [p.parent.name for p in self.folder.glob("*/job.json")]
        known = [name for name in names if _IDENTIFIER.fullmatch(name)]
        shown = [self.shown(identifier) for identifier in known]
        return sorted(shown, key=lambda job: (job["started"], job["number"]), reverse=True)

    def shown(self, identifier: str) -> dict[str, Any]:
        """Return what a page shows of a study: its state, progress, and the end of its output."""
        about = self._about(identifier)
        folder = self.folder / identifier
        output = _end_of(folder / "output.txt")
        progress = [(int(done), int(of)) for done, of in _PROGRESS.findall(output)]
        runs, waiting = self._runs(identifier), list(self._waiting)
        place = waiting.index(identifier) + 1 if identifier in waiting else None
        has_report = (folder / "results" / "report.html").is_file()
        return {
            "id": identifier,
            "number": int(identifier.rpartition("-")[2]),
            "study": about["study"],
            "machine": about["machine"],
            "started": about["started"],
            "mark": about.get("mark", ""),
            "chosen": about.get("chosen"),
            "command": " ".join(["wm-drake", *about["command"]]),
            "state": _state(runs, place, has_report),
            "place": place,
            "progress": progress[-1] if progress else None,
            "output": output,
            "answer": _answer_of(folder / "results" / "report.html") if has_report else "",
            "report": has_report and not runs and not place,
        }

    def report_file(self, identifier: str, name: str) -> Path:
        """Return a file of the results of a study.

        Raises:
            InputError: there is no such study or file, or it is outside of the results.
        """
        self._about(identifier)
        results = (self.folder / identifier / "results").resolve()
        try:
            path = (results / name).resolve()
            is_inside = path.is_relative_to(results) and path.is_file()
        except (OSError, ValueError):
            is_inside = False
        if not is_inside:
            raise input_error(f"has no file '{name}'", key=identifier)
        return path

    def end(self, timeout: float = 10.0) -> None:
        """Interrupt all studies and wait for them; those that do not end in time are killed."""
        with self._lock:
            self._waiting.clear()
            running = [process for process in self._running.values() if process.poll() is None]
        for process in running:
            process.send_signal(signal.SIGINT)
        for process in running:
            try:
                process.wait(timeout)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def _new_folder(self, study: str) -> str:
        with self._lock:
            number = 1
            while (self.folder / f"{study}-{number}").exists():
                number += 1
            folder = self.folder / f"{study}-{number}"
            try:
                folder.mkdir(parents=True)
            except OSError as error:
                raise unwritable(self.folder, error) from None
            return folder.name

    def _enqueue(self, identifier: str, command: Sequence[str]) -> None:
        """Let a study wait for its turn, which may come at once."""
        with self._lock:
            self._waiting[identifier] = command
            self._advance()

    def _advance(self) -> None:
        """Launch the studies whose turn it is, in the order in which they came."""
        with self._lock:
            while self._waiting and sum(map(self._runs, self._running)) < MOST_RUNNING:
                identifier = next(iter(self._waiting))
                self._launch(identifier, self._waiting.pop(identifier))

    def _launch(self, identifier: str, command: Sequence[str]) -> None:
        folder = self.folder / identifier
        try:
            with (folder / "output.txt").open("wb") as output:
                process = self._running[identifier] = subprocess.Popen(
                    [sys.executable, "-m", "wm_drake", *command],
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,  # Ctrl-C at the server reaches it through `end` only
                )
        except OSError as error:
            raise unwritable(folder, error) from None
        threading.Thread(target=self._next_after, args=(process,), daemon=True).start()

    def _next_after(self, process: "subprocess.Popen[bytes]") -> None:
        """Wait for the end of a study, and launch the next one."""
        process.wait()
        self._advance()

    def _runs(self, identifier: str) -> bool:
        process = self._running.get(identifier)
        return process is not None and process.poll() is None

    def _about(self, identifier: str) -> dict[str, Any]:
        try:
            if _IDENTIFIER.fullmatch(identifier):
                text = (self.folder / identifier / "job.json").read_text(encoding="utf-8")
                about = json.loads(text)
                if about["study"] in STUDIES and {"command", "started", "machine"} <= set(about):
                    return dict(about)
        except (OSError, ValueError, KeyError, TypeError):
            pass
        raise input_error(f"no study '{identifier}'", key="study")


def _takes_machine(study: str) -> bool:
    """Return whether the command of a study has the machine as an argument, without an option."""
    extra = STUDIES[study].options.model_fields["machine"].json_schema_extra
    return isinstance(extra, dict) and extra.get("flag") == "argument"


def _answer_of(report: Path) -> str:
    """Return the answer of a report, which is the first paragraph of its page; "" without one."""
    text = report.read_text(encoding="utf-8", errors="replace")
    summary = re.search(r'<p class="summary">(.*?)</p>', text, re.DOTALL)
    return html.unescape(summary[1]) if summary else ""


def _state(runs: bool, place: int | None, has_report: bool) -> str:
    """Return the state of a study in words."""
    if runs or place:
        return "running" if runs else "waiting"
    return "finished" if has_report else "not finished"


def _end_of(path: Path) -> str:
    try:
        with path.open("rb") as file:
            file.seek(0, 2)
            file.seek(max(0, file.tell() - LONGEST_OUTPUT))
            return file.read().decode("utf-8", errors="replace")
    except OSError:
        return ""
