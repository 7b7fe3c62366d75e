"""simulate_many(machine, cases): run thousands of cases on all cores, with constant memory."""

import os
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait

import xarray as xr

from wm_drake.batch.drake_runs import drake_pool
from wm_drake.batch.run_table import RunTable
from wm_drake.batch.runs import Advance, BatchJobs, BatchOptions, Runner, RunResult
from wm_drake.batch.work_items import BatchKey, Preparation, WorkItem
from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines import DEFAULT_ENGINE
from wm_drake.engines.memory import RECORDS_OF_BATCH
from wm_drake.errors import check_known
from wm_drake.model.build import AnyMachine, machine_of
from wm_drake.model.machine import Machine
from wm_drake.simulation.cases import Case, case_of, notice_jumping_friction
from wm_drake.simulation.feet import cabinet_of
from wm_drake.simulation.first_call import compile_in_two_processes
from wm_drake.simulation.measures import MEASURES, measure_named
from wm_drake.simulation.runs import ENGINES
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
    engine: str = DEFAULT_ENGINE,
    progress: Callable[[int], None] = lambda done: None,
    finished: Callable[[RunResult], None] = lambda ended: None,
) -> xr.Dataset:
    """Run many cases of one machine and return a table of their measures.

    With the compiled engine, each core runs several cases at once, one per SIMD lane. The results
    of a run do not depend on the number of workers or on the other cases.

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
        workers: Number of threads, or of processes for the Drake engine; None for the number of
            cores.
        engine: Name of the engine, as in `simulate`.
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

    options = BatchOptions(chosen, step, integrator, histories, workers, engine)
    try:
        pairs = run_cases(machine, listed, options, collect)
    except KeyboardInterrupt:
        raise SimulationInterrupted(table.dataset()) from None
    return table.dataset(pairs)


def run_cases(
    machine: Machine,
    cases: Iterable[Case],
    options: BatchOptions,
    collect: Callable[[list[RunResult]], None],
    advance: Advance = lambda number, fraction: None,
) -> list[str] | None:
    """Run cases and pass finished runs on; nothing of them is kept.

    Args:
        collect: Called with the runs of a batch when they have ended.
        advance: Called with the number of a case and the fraction of its run that is done; not for
            runs in other processes.

    Returns:
        Names of the pairs of shapes, if they are known.

    Raises:
        InputError: a case or an option is wrong.
        KeyboardInterrupt: Ctrl-C was pressed; `collect` has got what had ended.
    """
    check_known(options.engine, ENGINES, f"no engine '{options.engine}'", key="engine")
    parameters = machine.parameters
    compile_in_two_processes(parameters, batch=not options.histories)
    if any("feet" in MEASURES[name].needs for name in options.measures):
        cabinet_of(parameters)
    workers = options.workers or os.cpu_count() or 1
    ahead = workers * (1 if options.histories else AHEAD)
    if options.engine != DEFAULT_ENGINE:
        with drake_pool(machine, cases, options, advance) as (pool, jobs, stop):
            _run_all(pool, jobs, ahead, stop, collect)
        return None
    step = checked_step(parameters, options.step)
    scheme = checked_integrator(parameters, options.integrator)
    notice_jumping_friction(parameters)
    runner = Runner(parameters, options.measures, options.histories, machine.cache.scenes)
    runner.compared = options.compared
    at_once = workers * (RECORDS_OF_BATCH if options.histories else 1.0)
    batches = Preparation(machine, step, scheme, at_once).batches(_with_pauses(cases))
    with ThreadPoolExecutor(workers) as threads:
        jobs = _jobs(runner, batches, advance)
        while True:
            _run_all(threads, jobs, ahead, runner.stopped.set, collect)
            left = list(runner.postponed(1))
            if not left:
                break
            jobs = _jobs(runner, left, advance)
    pairs = runner.scenes[0].pair_names() if runner.scenes else None
    machine.cache.scenes.extend(runner.scenes)
    return pairs


def _jobs(
    runner: Runner, batches: Iterable[tuple[BatchKey, list[WorkItem]]], advance: Advance
) -> BatchJobs:
    """Yield the jobs of batches, and of full batches of runs that must be repeated meanwhile."""
    for key, items in batches:
        yield runner.run_or_postpone, key, items, _of_batch(advance, items)
        for finer, again in runner.postponed(WIDTH):
            yield runner.run_or_postpone, finer, again, _of_batch(advance, again)


def _of_batch(advance: Advance, items: list[WorkItem]) -> Callable[[float], None]:
    """Return the function of the fraction that is done of all runs of a batch."""

    def report(fraction: float) -> None:
        for item in items:
            advance(item.number, fraction)

    return report


def _with_pauses(cases: Iterable[Case]) -> Iterator[Case]:
    """Yield cases with a pause after each, in which a thread that waits for its turn gets it.

    A thread that returns from compiled code would wait up to 5 ms for the one that prepares cases.
    """
    for case in cases:
        yield case
        time.sleep(PAUSE)


def _run_all(
    pool: Executor,
    jobs: BatchJobs,
    ahead: int,
    stop: Callable[[], None],
    collect: Callable[[list[RunResult]], None],
) -> None:
    """Run all jobs in the workers of a pool and pass finished runs to `collect`.

    Args:
        ahead: Number of jobs that run or wait, so that memory stays constant.
        stop: Function that ends what runs.
    """
    running: set[Future[list[RunResult]]] = set()

    def gather(at_most: int) -> None:
        while len(running) > at_most:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                running.remove(future)
                collect(future.result())

    try:
        for job in jobs:
            running.add(pool.submit(*job))
            gather(ahead)  # some wait while the others run
        gather(0)
    except BaseException:
        stop()
        pool.shutdown(wait=True, cancel_futures=True)
        # collect the runs that finished in the meantime
        good = [f for f in running if f.done() and not f.cancelled() and f.exception() is None]
        collect([run for future in good for run in future.result()])
        raise
