"""simulate_many(machine, cases): run thousands of cases on all cores, with constant memory."""

import os
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass

import xarray as xr

from wm_drake.batch.run_table import RunTable
from wm_drake.batch.runs import Runner, RunResult
from wm_drake.batch.work_items import BatchKey, Preparation, WorkItem
from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.memory import RECORDS_OF_BATCH
from wm_drake.model.build import AnyMachine, machine_of
from wm_drake.model.machine import Machine
from wm_drake.simulation.cases import Case, case_of, notice_jumping_friction
from wm_drake.simulation.feet import cabinet_of
from wm_drake.simulation.first_call import compile_in_two_processes
from wm_drake.simulation.measures import MEASURES, measure_named
from wm_drake.simulation.steps import checked_integrator, checked_step

AHEAD = 3
"""Batches for each worker that are prepared or run at a time, unless they have records."""

PAUSE = 2e-5
"""Pause after each case that is prepared. [s]"""


class SimulationInterrupted(KeyboardInterrupt):
    """Ctrl-C was pressed during `simulate_many`; `finished` is the table of the finished runs."""

    def __init__(self, finished: xr.Dataset) -> None:
        """Store the table of the finished runs."""
        super().__init__(f"interrupted after {finished.sizes['run']} runs")
        self.finished = finished


def simulate_many(
    machine: AnyMachine,
    cases: Iterable[Case | str],
    *,
    measures: Iterable[str] = ("extremes", "amplitudes"),
    step: float | None = None,
    integrator: str | None = None,
    histories: bool = False,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda done: None,
    finished: Callable[[RunResult], None] = lambda ended: None,
) -> xr.Dataset:
    """Run many cases of one machine with the compiled engine and return a table of their measures.

    Each core runs several cases at once, one per SIMD lane. The results of a run do not depend on
    the number of workers or on the other cases.

    Args:
        machine: A built machine, its parameters, or its name or file.
        cases: Cases to run, or names of loads of the machine. They are taken one by one as needed,
            so memory stays constant if this is a generator.
        measures: Names of measures or of their variables, in
            `wm_drake.simulation.measures.MEASURES`, such as "extremes" (D, F and M of [B]),
            "amplitudes" or "amplitude" (and critical speeds), "gap", "mounts".
        step: Largest step; the output period of 5 ms must be an integer multiple of it. If None,
            that of the machine. Runs that are not accurate with it have shorter ones. [s]
        integrator: Integrator, as in `simulate`; None for that of the machine.
        histories: Whether each `RunResult` contains the record of the run, as from `simulate`.
        workers: Number of threads; None for the number of cores.
        progress: Called with the number of finished runs; `wm_drake.progress_bar` displays it.
        finished: Called with each run when it is finished.

    Returns:
        Table over `run`, the number of the case. The coordinate `case` holds its name. The
        variables are the measures (SI, attrs["units"]) and `diverged`: time and reason if a run
        diverged, else "". The measures of a run that diverged cover the time until then. The
        coordinates `error`, `is_converged`, `step` [s] and `halvings` are those of
        `wm_drake.simulation.convergence.Accuracy`.

    Raises:
        InputError: a case or an argument is wrong. `finished` was called for the runs that had
            ended before.
        SimulationInterrupted: Ctrl-C was pressed.

    Example:
        >>> import wm_drake as wm
        >>> table = wm.simulate_many("reference", ["middle", "counter"])
        >>> dict(table.amplitude.sizes)
        {'run': 2, 'sensor': 6}
    """
    machine = machine_of(machine)
    named = dict.fromkeys(measure_named(name, key="measures") for name in measures)
    chosen = tuple(measure.name for measure in named)
    parameters = machine.parameters
    listed = (case_of(parameters, case) if isinstance(case, str) else case for case in cases)
    table = RunTable(parameters, chosen)
    done = 0

    def collect(runs: list[RunResult]) -> None:
        nonlocal done
        for run in runs:  # fill the table first: the callbacks may raise
            table.put(run.number, run.case.name, run.stored_values, run.diverged)
        done += len(runs)
        for run in runs:
            finished(run)
        progress(done)

    options = BatchOptions(chosen, step, integrator, histories, workers)
    try:
        pairs = run_cases(machine, listed, options, collect)
    except KeyboardInterrupt:
        raise SimulationInterrupted(table.dataset()) from None
    return table.dataset(pairs)


@dataclass(frozen=True)
class BatchOptions:
    """How `run_cases` runs; see `simulate_many`."""

    measures: tuple[str, ...]
    step: float | None = None
    integrator: str | None = None
    histories: bool = False
    workers: int | None = None


def run_cases(
    machine: Machine,
    cases: Iterable[Case],
    options: BatchOptions,
    collect: Callable[[list[RunResult]], None],
) -> list[str] | None:
    """Run cases and pass finished runs on; nothing of them is kept.

    Args:
        collect: Called with the runs of a batch when they have ended.

    Returns:
        Names of the pairs of shapes, if they are known.

    Raises:
        InputError: a case or an option is wrong.
        KeyboardInterrupt: Ctrl-C was pressed; `collect` has got what had ended.
    """
    parameters = machine.parameters
    compile_in_two_processes(parameters)
    if any("feet" in MEASURES[name].needs for name in options.measures):
        cabinet_of(parameters)
    step = checked_step(parameters, options.step)
    scheme = checked_integrator(parameters, options.integrator)
    notice_jumping_friction(parameters)
    runner = Runner(parameters, options.measures, options.histories, machine.cache.scenes)
    threads = options.workers or os.cpu_count() or 1
    at_once = threads * (RECORDS_OF_BATCH if options.histories else 1.0)
    preparation = Preparation(machine, step, scheme, at_once)
    _run_all(preparation, runner, cases, threads, collect)
    pairs = runner.scenes[0].pair_names() if runner.scenes else None
    machine.cache.scenes.extend(runner.scenes)
    return pairs


def _with_pauses(cases: Iterable[Case]) -> Iterator[Case]:
    """Yield cases with a pause after each, in which a thread that waits for its turn gets it.

    A thread that returns from compiled code would wait up to 5 ms for the one that prepares cases.
    """
    for case in cases:
        yield case
        time.sleep(PAUSE)


def _run_all(
    preparation: Preparation,
    runner: Runner,
    cases: Iterable[Case],
    workers: int,
    collect: Callable[[list[RunResult]], None],
) -> None:
    """Run all cases in threads and pass finished runs to `collect`.

    Only so many batches are prepared at a time that memory stays constant.
    """
    ahead = 1 if runner.histories else AHEAD
    with ThreadPoolExecutor(workers) as pool:
        batches = _Batches(pool, runner, collect)
        try:
            for key, work_items in preparation.batches(_with_pauses(cases)):
                batches.begin(key, work_items)
                batches.gather(workers * ahead)  # some batches wait while the others run
            batches.finish()
        except BaseException:
            runner.stopped.set()
            pool.shutdown(wait=True, cancel_futures=True)
            batches.collect_ended()
            raise


class _Batches:
    """Batches that run in threads; runs that are not accurate wait until they fill one."""

    def __init__(
        self,
        pool: ThreadPoolExecutor,
        runner: Runner,
        collect: Callable[[list[RunResult]], None],
    ) -> None:
        """Begin without batches."""
        self._pool, self._runner, self._collect = pool, runner, collect
        self._running: set[Future[tuple[list[RunResult], list[WorkItem]]]] = set()
        self._waiting: dict[BatchKey, list[WorkItem]] = {}

    def begin(self, key: BatchKey, items: list[WorkItem]) -> None:
        """Run work items side by side."""
        self._running.add(self._pool.submit(self._runner.attempt, key, items))

    def gather(self, at_most: int) -> None:
        """Pass on the runs that end until at most some batches are running."""
        while len(self._running) > at_most:
            for future in wait(self._running, return_when=FIRST_COMPLETED).done:
                self._running.remove(future)
                ended, again = future.result()
                self._collect(ended)
                for item in again:
                    items = self._waiting.setdefault(item.key, [])
                    items.append(item)
                    if len(items) == WIDTH:
                        self.begin(item.key, self._waiting.pop(item.key))

    def finish(self) -> None:
        """Pass on all runs, those that wait too."""
        self.gather(0)
        while self._waiting:
            for key in list(self._waiting):
                self.begin(key, self._waiting.pop(key))
            self.gather(0)

    def collect_ended(self) -> None:
        """Pass on the runs that have ended without an error, after the pool was shut down."""
        ended = [f for f in self._running if f.done() and not f.cancelled() and not f.exception()]
        self._collect([run for future in ended for run in future.result()[0]])
