"""simulate_many(machine, cases): thousands of cases on all cores, measured as they end, in flat memory."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

import numpy as np
import xarray as xr

from wm_drake.batch.runs import MEASURES, Runner, RunResult
from wm_drake.batch.work_items import Preparation
from wm_drake.errors import input_error, nearest_names
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.outputs import AXES
from wm_drake.simulation.runs import checked_step

_VARIABLES = {
    "detergent_displacement": (
        "axis",
        "m",
        "largest displacement of the tub point nearest the detergent box, D of [B]",
    ),
    "gasket_force": ("axis", "N", "largest force of the gasket on the housing, F of [B]"),
    "gasket_moment": ("axis", "N m", "largest moment of the gasket on the housing, M of [B]"),
    "amplitude": ("sensor", "m", "largest absolute value of the envelopes"),
    "critical_speed": ("sensor", "rad/s", "drum speed where it occurs"),
    "power_mean": (
        "sensor",
        "m",
        "mean of order 20 of the filtered displacement: a smooth stand-in for the amplitude",
    ),
    "smallest_gap": ("", "m", "smallest distance between tub group and housing"),
    "region_displacement": (
        "region accelerometer axis",
        "m",
        "RMS displacement in each region of the spin profile",
    ),
    "region_displacement_integrated": (
        "region accelerometer axis",
        "m",
        "the same from acceleration, integrated twice",
    ),
}


class SimulationInterrupted(KeyboardInterrupt):
    """Ctrl-C during `simulate_many`; `finished` is the table of the runs that had ended."""

    def __init__(self, finished: xr.Dataset) -> None:
        """Keeps the table of what had ended."""
        super().__init__(f"interrupted after {finished.sizes['run']} runs")
        self.finished = finished


def simulate_many(
    machine: Machine,
    cases: Iterable[Case],
    *,
    measures: Iterable[str] = ("extremes", "amplitudes"),
    step: float | None = None,
    histories: bool = False,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda done: None,
    finished: Callable[[RunResult], None] = lambda ended: None,
) -> xr.Dataset:
    """Runs many cases of one machine with the compiled engine, several side by side in the vector units of each core.

    The numbers of a run do not depend on how many workers there are or what it runs beside.

    Args:
        machine: A built machine.
        cases: What to run; taken one by one as they are needed, so a generator keeps memory flat.
        measures: Keys of `MEASURES`: "extremes" are D, F, M of [B], "amplitudes" those of `measure` with their speeds, "power
            means" are smooth stand-ins for them (`measures.power_means`), "gap"
            is the smallest distance between tub group and housing (NaN if the SDF has no shapes), "regions" the RMS
            displacements of the accelerometers in the regions of the profile, by number (`wm_drake.simulation.vibration`).
        step: As for `simulate`.
        histories: Whether each run handed to `finished` shall carry its record, as `simulate` gives it.
        workers: Threads; as many as cores by default.
        progress: Called with the number of runs that have ended; `outputs.progress_bar` shows them with an estimate.
        finished: Called with each run as it ends.

    Returns:
        Table over `run`, the number of the case: coordinate `case` with its name; the measures as in `Measures` (SI,
        attrs["units"]); `diverged`: when and why a run stopped early, "" if it did not; its measures are those up to there.

    Raises:
        InputError: a case or an argument at fault; runs that had ended were handed to `finished`.
        SimulationInterrupted: Ctrl-C.
    """
    wanted = tuple(dict.fromkeys(measures))
    for name in wanted:
        if name not in MEASURES:
            raise input_error(f"no measure '{name}'{nearest_names(name, MEASURES)}", key="measures")
    step = checked_step(machine.parameters, step)
    results: dict[int, tuple[str, str, list[FloatArray]]] = {}

    def collect(runs: list[RunResult]) -> None:
        for run in runs:  # first of all into the table, whatever the callbacks do
            results[run.number] = (run.case.name, run.diverged, list(run.values.values()))
        for run in runs:
            finished(run)
        progress(len(results))

    try:
        runner = Runner(machine.parameters, step, wanted, histories)
        _run_all(Preparation(machine, step), runner, cases, workers or os.cpu_count() or 1, collect)
    except KeyboardInterrupt:
        raise SimulationInterrupted(as_table(machine.parameters, wanted, results)) from None
    return as_table(machine.parameters, wanted, results)


def as_table(
    parameters: MachineParameters,
    measures: tuple[str, ...],
    results: dict[int, tuple[str, str, list[FloatArray]]],
) -> xr.Dataset:
    """The table of runs by number: name of the case, when and why it diverged, its measures in the order of `MEASURES`."""
    numbers = sorted(results)
    labels = {
        "run": numbers,
        "case": ("run", [results[number][0] for number in numbers]),
        "axis": list(AXES),
        "sensor": list(parameters.sensors),
    }
    if "regions" in measures:
        labels |= {
            "accelerometer": list(parameters.accelerometer_frames()),
            "region": range(_region_count(measures, results)),
        }
    variables = {}
    for index, name in enumerate(name for measure in measures for name in MEASURES[measure]):
        dim, unit, text = _VARIABLES[name]
        dims = ("run", *dim.split())
        values = np.reshape(
            [results[number][2][index] for number in numbers], [len(labels[d]) for d in dims]
        )
        variables[name] = (dims, values, {"units": unit, "long_name": text})
    diverged = np.array([results[number][1] for number in numbers], dtype=object)
    return xr.Dataset({**variables, "diverged": ("run", diverged)}, labels)


def _region_count(
    measures: tuple[str, ...], results: dict[int, tuple[str, str, list[FloatArray]]]
) -> int:
    """How many regions the profile of all runs has.

    Raises:
        InputError: not all have equally many.
    """
    names = [name for measure in measures for name in MEASURES[measure]]
    counts = {len(values[names.index("region_displacement")]) for _, _, values in results.values()}
    if len(counts) > 1:
        raise input_error(
            f"have {' and '.join(map(str, sorted(counts)))} regions; runs of one table need equally many",
            key="profile",
        )
    return counts.pop() if counts else 0


def _run_all(
    preparation: Preparation,
    runner: Runner,
    cases: Iterable[Case],
    workers: int,
    collect: Callable[[list[RunResult]], None],
) -> None:
    """Feeds batches to threads, no more of them than keeps those busy, and hands on what ends."""
    running: set[Future[list[RunResult]]] = set()

    def gather(at_most: int) -> None:
        while len(running) > at_most:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                running.remove(future)
                collect(future.result())

    with ThreadPoolExecutor(workers) as pool:
        try:
            for kind, work_items in preparation.batches(cases):
                running.add(pool.submit(runner.run, kind, work_items))
                gather(workers)  # one waits while the others run
            gather(0)
        except BaseException:
            runner.stopped.set()
            pool.shutdown(wait=True, cancel_futures=True)
            # what had ended meanwhile is not lost
            good = [f for f in running if f.done() and not f.cancelled() and f.exception() is None]
            collect([run for future in good for run in future.result()])
            raise
