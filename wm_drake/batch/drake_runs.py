"""Cases -> results with the Drake engine: one run after the other in each worker.

Systems of Drake that are written in Python block other threads, so that several workers are
processes. Each builds the machine once.
"""

import itertools
import multiprocessing
import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from multiprocessing.process import BaseProcess
from typing import Any

from wm_drake.batch.runs import Advance, BatchJobs, BatchOptions, RunResult
from wm_drake.errors import InputError, WmDrakeError
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.convergence import accuracy_in
from wm_drake.simulation.measures import MEASURES, measure
from wm_drake.simulation.runs import DivergenceWarning, simulate


class _StoppedError(Exception):
    """The run is not needed any more."""


class DrakeRunner:
    """Runs cases of one machine, one after the other, with the Drake engine."""

    def __init__(self, machine: Machine, options: BatchOptions, stopped: Any = None) -> None:
        """Prepare for a machine.

        Args:
            machine: The machine.
            options: Measures, step, whether results have records, and the engine.
            stopped: Event of threads or of processes: once it is set, a run ends without a result.
        """
        self.machine, self.options = machine, options
        self.stopped = threading.Event() if stopped is None else stopped
        needs = {need for name in options.measures for need in MEASURES[name].needs}
        self._scene = Scene(machine.parameters) if "shapes" in needs else None

    def run(
        self, number: int, case: Case, progress: Callable[[float], None] = lambda fraction: None
    ) -> list[RunResult]:
        """Run a case and measure it.

        Args:
            number: Number of the case, in the given order.
            case: The case.
            progress: Called with the fraction of the run that is done.

        Returns:
            The result; none if `stopped` was set meanwhile.
        """

        def report(fraction: float) -> None:
            if self.stopped.is_set():
                raise _StoppedError
            progress(fraction)

        chosen = self.options
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DivergenceWarning)  # the result says so
                record = simulate(
                    self.machine,
                    case,
                    chosen.engine,
                    step=chosen.step,
                    integrator=chosen.integrator,
                    progress=report,
                )
        except _StoppedError:
            return []
        except InputError as error:
            where = f"case {number} '{case.name}'"
            raise InputError(replace(p, where=where) for p in error.problems) from None
        measures = measure(record, self._scene, chosen.measures)
        values = {str(name): array.values for name, array in measures.table.items()}
        kept = record if chosen.histories else None
        return [
            RunResult(
                number,
                case,
                values,
                record.attrs["diverged"],
                kept,
                measures.smallest_gap,
                accuracy=accuracy_in(record.attrs),
            )
        ]


@contextmanager
def drake_pool(
    machine: Machine, cases: Iterable[Case], options: BatchOptions, advance: Advance
) -> Iterator[tuple[Executor, BatchJobs, Callable[[], None]]]:
    """Yield workers, their jobs, and the function that stops them.

    A single case, or a single worker, runs in this process. So do all cases in a daemon process,
    which cannot start others.

    Raises:
        WmDrakeError: a process ended before its time, such as for lack of memory.
    """
    numbered = enumerate(cases)
    first = list(itertools.islice(numbered, 2))
    jobs = itertools.chain(first, numbered)
    workers = options.workers or os.cpu_count() or 1
    if min(workers, len(first)) < 2 or multiprocessing.current_process().daemon:
        runner = DrakeRunner(machine, options)
        with ThreadPoolExecutor(1) as thread:
            ours = ((runner.run, *job, partial(advance, job[0])) for job in jobs)
            yield thread, ours, runner.stopped.set
        return
    # a fork of a process with threads or with Drake is not safe
    spawn = multiprocessing.get_context("spawn")
    stopped = spawn.Event()
    at_begin = machine.parameters, options, stopped
    others, started = set(multiprocessing.active_children()), set[BaseProcess]()
    try:
        with ProcessPoolExecutor(workers, spawn, _begin, at_begin) as processes:
            # Ctrl-C waits until they have begun: imports would end with tracebacks
            before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            for _ in range(workers):  # each starts one
                processes.submit(os.getpid)
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            started = set(multiprocessing.active_children()) - others
            yield processes, ((_run, *job) for job in jobs), stopped.set
    except BrokenProcessPool:
        raise WmDrakeError(_why_ended(started)) from None


def _why_ended(workers: Iterable[BaseProcess]) -> str:
    """Return why a worker process ended before its result; the pool ends the others by SIGTERM."""
    codes = [code for code in (w.exitcode for w in workers) if code not in (None, -signal.SIGTERM)]
    if any(code < 0 for code in codes):
        name = signal.Signals(-min(codes)).name
        return f"a worker process was ended by {name}; if memory is short, take fewer workers"
    return (
        "a worker process ended before its result; a script that uses several workers needs "
        '`if __name__ == "__main__":`'
    )


_RUNNER: list[DrakeRunner] = []
"""The runner of a worker process."""


def _begin(parameters: MachineParameters, options: BatchOptions, stopped: Any) -> None:
    """Build the machine of a worker process, which ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent stops it
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _RUNNER.append(DrakeRunner(build_machine(parameters), options, stopped))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _run(number: int, case: Case) -> list[RunResult]:
    return _RUNNER[0].run(number, case)
