"""simulate_many(machine, cases): run thousands of cases on all cores, with constant memory."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager

import numpy as np
import xarray as xr

from wm_drake.batch.runs import MEASURES, Runner, RunResult
from wm_drake.batch.work_items import Preparation
from wm_drake.errors import input_error, nearest_names
from wm_drake.model.machine import Machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.drive import VARIABLES as DRIVE_VARIABLES
from wm_drake.simulation.feet import BY_FOOT, FOOT_VARIABLES, MARGINS, WORDS, cabinet_of
from wm_drake.simulation.mounts import KINDS, POINT, mount_names
from wm_drake.simulation.outputs import AXES
from wm_drake.simulation.runs import checked_integrator, checked_step

FORCE_KINDS = dict(zip(KINDS, ("largest size", "RMS", "RMS without the mean"), strict=True))
"""Words for each of `KINDS`."""

TURN = 5e-4
"""Longest turn of a Python thread while others wait, in place of Python's 5 ms. [s]"""

_IN_REGIONS = {"regions", "amplitudes in regions", "feet regions"}
"""Measures with a value for each region of the profile."""

_VARIABLES = {
    "detergent_displacement": (
        "axis",
        "m",
        "largest displacement of the tub point nearest to the detergent box, D of [B]",
    ),
    "gasket_force": ("axis", "N", "largest force of the gasket on the housing, F of [B]"),
    "gasket_moment": ("axis", "N m", "largest moment of the gasket on the housing, M of [B]"),
    "amplitude": ("sensor", "m", "largest absolute value of the envelopes"),
    "critical_speed": ("sensor", "rad/s", "drum speed at which the amplitude occurs"),
    "region_amplitude": (
        "region sensor",
        "m",
        "largest absolute value of the envelopes in each region of the spin profile",
    ),
    "region_critical_speed": (
        "region sensor",
        "rad/s",
        "drum speed at which the amplitude of a region occurs",
    ),
    "power_mean": (
        "sensor",
        "m",
        "power mean of order 20 of the filtered displacement; a smooth substitute of the amplitude",
    ),
    "smallest_gap": ("", "m", "smallest distance between tub group and housing"),
    "nearest_pair": ("", "", "number, along pair, of the two shapes with the smallest gap"),
    "contact_gap": (
        "pair",
        "m",
        "smallest distance of each pair of shapes that touches; NaN for the others",
    ),
    "region_displacement": (
        "region accelerometer axis",
        "m",
        "RMS displacement in each region of the spin profile",
    ),
    "region_displacement_integrated": (
        "region accelerometer axis",
        "m",
        "RMS displacement in each region, from the acceleration integrated twice",
    ),
    **{
        f"{name}_{kind}": (dim, unit, f"{FORCE_KINDS[kind]} of the {about}")
        for name, dim, unit, about in (
            ("mount_force", "mount", "N", "force of each mount on the cabinet"),
            ("cabinet_force", "axis", "N", "force of all mounts on the cabinet"),
            ("cabinet_moment", "axis", "N m", f"moment of all mounts on the cabinet about {POINT}"),
        )
        for kind in KINDS
    },
    "smallest_spring_tension": ("spring", "N", "smallest tension; 0 if the spring goes slack"),
    "smallest_spring_elongation": (
        "spring",
        "m",
        "smallest elongation from the free length; negative if the spring goes slack",
    ),
    **DRIVE_VARIABLES,
    **{name: ("foot" if name in BY_FOOT else "", *WORDS[name]) for name in FOOT_VARIABLES},
    **{
        f"region_{name}": ("region", unit, f"{text}; smallest in each region")
        for name, (unit, text) in WORDS.items()
        if name in MARGINS
    },
}


class SimulationInterrupted(KeyboardInterrupt):
    """Ctrl-C was pressed during `simulate_many`; `finished` is the table of the finished runs."""

    def __init__(self, finished: xr.Dataset) -> None:
        """Store the table of the finished runs."""
        super().__init__(f"interrupted after {finished.sizes['run']} runs")
        self.finished = finished


def simulate_many(
    machine: Machine,
    cases: Iterable[Case],
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
        machine: A built machine.
        cases: Cases to run. They are taken one by one as needed, so memory stays constant if this
            is a generator.
        measures: Names of measures, keys of `MEASURES`:
            "extremes": D, F and M of [B];
            "amplitudes": amplitudes and critical speeds as in `Measures`;
            "amplitudes in regions": the same in each region of the profile;
            "power means": smooth substitutes for the amplitudes (`measures.power_means`);
            "gap": smallest distance between tub group and housing, NaN if the SDF has no shapes;
            "contacts": number of the nearest pair of shapes; distance of each pair that touches;
            "regions": RMS displacements of the accelerometers in the regions of the profile
            (`wm_drake.simulation.vibration`);
            "mounts": peak, RMS and dynamic RMS of the force of each mount on the cabinet;
            "cabinet": the same of force and moment of all mounts on the cabinet, for each axis;
            "spring tensions": smallest tension of each spring, 0 if it goes slack, and smallest
            elongation from its free length;
            "drive": torque, power, work, speed ripple and capture of the drive, speed at the end,
            and parts of torque and acceleration that go round with the drum;
            "feet": loads of the feet, and margins of sliding, turning and tilting;
            "feet regions": the smallest of them in each region of the profile.
        step: Step size; the output period of 5 ms must be an integer multiple of it. If None, the
            step size of the machine is used. [s]
        integrator: Integrator, as in `simulate`; None for that of the machine.
        histories: Whether each `RunResult` contains the record of the run, as from `simulate`.
        workers: Number of threads; None for the number of cores.
        progress: Called with the number of finished runs; `wm_drake.progress_bar` displays it.
        finished: Called with each run when it is finished.

    Returns:
        Table over `run`, the number of the case. The coordinate `case` holds its name. The
        variables are the measures (SI, attrs["units"]) and `diverged`: time and reason if a run
        diverged, else "". The measures of a run that diverged cover the time until then.

    Raises:
        InputError: a case or an argument is wrong. `finished` was called for the runs that had
            ended before.
        SimulationInterrupted: Ctrl-C was pressed.

    Example:
        >>> import wm_drake as wm
        >>> machine = wm.build_machine(wm.load_machine("reference"))
        >>> cases = [wm.case_of(machine.parameters, load) for load in ("middle", "counter")]
        >>> table = wm.simulate_many(machine, cases)
        >>> dict(table.amplitude.sizes)
        {'run': 2, 'sensor': 6}
    """
    wanted = tuple(dict.fromkeys(measures))
    for name in wanted:
        if name not in MEASURES:
            raise input_error(f"no measure '{name}'{nearest_names(name, MEASURES)}", key="measures")
    if {"feet", "feet regions"} & set(wanted):
        cabinet_of(machine.parameters)
    step = checked_step(machine.parameters, step)
    chosen = checked_integrator(machine.parameters, integrator)
    results: dict[int, tuple[str, str, list[FloatArray]]] = {}

    def collect(runs: list[RunResult]) -> None:
        for run in runs:  # fill the table first: the callbacks may raise
            results[run.number] = (run.case.name, run.diverged, list(run.values.values()))
        for run in runs:
            finished(run)
        progress(len(results))

    try:
        runner = Runner(machine.parameters, wanted, histories, machine.scenes)
        preparation = Preparation(machine, step, chosen)
        _run_all(preparation, runner, cases, workers or os.cpu_count() or 1, collect)
    except KeyboardInterrupt:
        raise SimulationInterrupted(as_table(machine.parameters, wanted, results)) from None
    pairs = runner.scenes[0].pair_names() if runner.scenes else None
    machine.scenes.extend(runner.scenes)
    return as_table(machine.parameters, wanted, results, pairs)


def as_table(
    parameters: MachineParameters,
    measures: tuple[str, ...],
    results: dict[int, tuple[str, str, list[FloatArray]]],
    pairs: Sequence[str] | None = None,
) -> xr.Dataset:
    """Return the table of runs that `simulate_many` describes.

    Args:
        parameters: Machine, for the names of the sensors.
        measures: Names of measures, keys of `MEASURES`.
        results: For each number of a run: name of the case, text of `diverged`, and the values of
            the variables that the measures have in `MEASURES`, in this order.
        pairs: Names of the pairs of shapes, if they are known already.

    Raises:
        InputError: the runs have different numbers of regions.
    """
    numbers = sorted(results)
    labels = {
        "run": numbers,
        "case": ("run", [results[number][0] for number in numbers]),
        "axis": list(AXES),
        "sensor": list(parameters.sensors),
        "mount": list(mount_names(parameters)),
    }
    if "spring tensions" in measures:
        labels["spring"] = list(parameters.springs)
    if parameters.cabinet:
        labels["foot"] = list(parameters.cabinet.corners)
    if "drive" in measures:
        labels["order"] = ["cosine", "sine"]
    if "regions" in measures:
        labels["accelerometer"] = list(parameters.accelerometer_frames())
    if _IN_REGIONS & set(measures):
        labels["region"] = range(_region_count(measures, results))
    if "contacts" in measures:
        labels["pair"] = list(pairs) if pairs is not None else Scene(parameters).pair_names()
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
    """Return the number of regions, which must be the same for all runs.

    Raises:
        InputError: the runs have different numbers of regions.
    """
    names = [name for measure in measures for name in MEASURES[measure]]
    first = next(at for at, name in enumerate(names) if _VARIABLES[name][0].startswith("region"))
    counts = {len(values[first]) for _, _, values in results.values()}
    if len(counts) > 1:
        raise input_error(
            f"the profiles have {' and '.join(map(str, sorted(counts)))} regions; "
            "all runs of one table need the same number",
            key="profile",
        )
    return counts.pop() if counts else 0


@contextmanager
def _short_turns() -> Iterator[None]:
    """Let Python's threads take turns more often.

    A thread that returns from compiled code waits for the turn of the thread that prepares cases.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(TURN)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def _run_all(
    preparation: Preparation,
    runner: Runner,
    cases: Iterable[Case],
    workers: int,
    collect: Callable[[list[RunResult]], None],
) -> None:
    """Run all cases in threads and pass finished runs to `collect`.

    At most one batch more than there are workers is prepared at a time, so that memory stays
    constant.
    """
    running: set[Future[list[RunResult]]] = set()

    def gather(at_most: int) -> None:
        while len(running) > at_most:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                running.remove(future)
                collect(future.result())

    with ThreadPoolExecutor(workers) as pool, _short_turns():
        try:
            for key, work_items in preparation.batches(cases):
                running.add(pool.submit(runner.run, key, work_items))
                gather(workers)  # one batch waits while the others run
            gather(0)
        except BaseException:
            runner.stopped.set()
            pool.shutdown(wait=True, cancel_futures=True)
            # collect the runs that finished in the meantime
            good = [f for f in running if f.done() and not f.cancelled() and f.exception() is None]
            collect([run for future in good for run in future.result()])
            raise
