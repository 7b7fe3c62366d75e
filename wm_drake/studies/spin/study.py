"""Spin runs: cases, each with its measures."""

import multiprocessing
import os
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from queue import Empty
from typing import Any

from wm_drake.model.machine import Machine, build_machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import Measures, measure
from wm_drake.simulation.records import Record
from wm_drake.simulation.runs import DEFAULT_ENGINE, DivergenceWarning, checked_step, simulate

_IN_PROCESSES = {"drake"}
"""Engines whose cases run in processes of their own: seconds each, and Drake's Python callbacks take turns in one."""


@dataclass(frozen=True)
class CaseResult:
    """A case that was run. `wall_s` is the time of simulation and measures together."""

    case: Case
    record: Record
    measures: Measures
    wall_s: float


@dataclass(frozen=True)
class SpinResult:
    """All cases of one spin command, in the order they were asked for."""

    parameters: MachineParameters
    engine: str
    step: float
    results: tuple[CaseResult, ...]


@dataclass(frozen=True)
class _Job:
    """All that a process needs to make one run."""

    parameters: MachineParameters
    case: Case
    engine: str
    step: float


def run_spin(
    parameters: MachineParameters,
    cases: Sequence[Case],
    engine: str = DEFAULT_ENGINE,
    *,
    step: float | None = None,
    progress: Callable[[int, float], None] = lambda index, fraction: None,
    workers: int | None = None,
) -> SpinResult:
    """Runs cases; results do not depend on the number of workers.

    Args:
        parameters: The machine.
        cases: What to run.
        engine, step: As for `simulate`.
        progress: Called with the number of the case and the fraction of it done.
        workers: Processes for an engine that needs them; as many as cores by default. One case runs in this process.
    """
    step = checked_step(parameters, step)
    count = min(workers or os.cpu_count() or 1, len(cases))
    jobs = [_Job(parameters, case, engine, step) for case in cases]
    if engine in _IN_PROCESSES and count > 1:
        results = _run_in_processes(jobs, count, progress)
    else:
        machine, scene = build_machine(parameters), Scene(parameters)
        results = [
            _run(job, machine, scene, partial(progress, index)) for index, job in enumerate(jobs)
        ]
    return SpinResult(parameters, engine, step, tuple(results))


def _run_in_processes(
    jobs: list[_Job], count: int, progress: Callable[[int, float], None]
) -> list[CaseResult]:
    # Drake diagrams do not pickle and forked Drake processes are not safe: fresh interpreters, plain parameters
    method = multiprocessing.get_context("spawn")
    with method.Manager() as manager, ProcessPoolExecutor(count, mp_context=method) as pool:
        reports = manager.Queue()
        futures: list[Future[CaseResult]] = [
            pool.submit(_run_and_report, job, i, reports) for i, job in enumerate(jobs)
        ]
        try:
            unfinished = set(futures)
            while unfinished:
                unfinished = wait(unfinished, timeout=0.2, return_when=FIRST_COMPLETED).not_done
                _pass_on(reports, progress)
            _pass_on(reports, progress)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            raise
        return [future.result() for future in futures]


def _pass_on(reports: Any, progress: Callable[[int, float], None]) -> None:
    try:
        while True:
            progress(*reports.get_nowait())
    except Empty:
        pass


def _run_and_report(job: _Job, index: int, reports: Any) -> CaseResult:
    machine, scene = build_machine(job.parameters), Scene(job.parameters)
    return _run(job, machine, scene, lambda fraction: reports.put((index, fraction)))


def _run(
    job: _Job, machine: Machine, scene: Scene, progress: Callable[[float], None]
) -> CaseResult:
    begin = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DivergenceWarning)  # the record carries it to the report
        record = simulate(machine, job.case, job.engine, step=job.step, progress=progress)
    measures = measure(record, scene)
    return CaseResult(job.case, record, measures, time.perf_counter() - begin)
