"""Study of the steady response: all loads, with and without gasket, and the influence of sweep."""

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from wm_drake.batch import simulate_many
from wm_drake.batch.runs import RunResult
from wm_drake.errors import problems_at
from wm_drake.model.machine import Machine
from wm_drake.parameters import Load, SpinProfile
from wm_drake.parameters.spin import Region
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import SPEED
from wm_drake.simulation.cases import Case
from wm_drake.simulation.convergence import StepSummary
from wm_drake.simulation.displacements import envelopes
from wm_drake.simulation.records import Record
from wm_drake.studies.response.balance import HARMONICS, SAMPLES
from wm_drake.studies.response.quantities import (
    AMPLITUDE,
    DIFFERENCE,
    RATE,
    RUN_AMPLITUDE,
    RUN_SPEED,
)
from wm_drake.studies.response.response import response_of

RATES = tuple(map(RATE.unit.to_si, (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)))
"""Default sweep rates. [rad/s^2]"""

GASKET = {True: "yes", False: "no"}
"""Labels of cases with and without gasket."""

HOLD = 8.0
"""Time at the first speed of a sweep, so that the start has decayed. It is not measured. [s]"""

RESPONSE_SHARE, RUN_SHARE = 1.0, 3.0
"""Parts of the progress: one for each response, one for all runs of the engine."""


@dataclass(frozen=True)
class ResponseSettings:
    """What the study computes.

    Attributes:
        speeds: Rising speeds. [rad/s]
        gaskets: True for a machine with its gasket, False for one without.
        harmonics, samples: See `steady_response`.
        rates: Sweep rates, up and down; none for no sweeps. [rad/s^2]
        workers: Number of threads; None for the number of cores. The results do not depend on it.
    """

    speeds: FloatArray
    gaskets: Sequence[bool] = (True, False)
    harmonics: int = HARMONICS
    samples: int = SAMPLES
    rates: Sequence[float] = RATES
    workers: int | None = None

    @property
    def threads(self) -> int:
        """Return the number of threads."""
        return self.workers or os.cpu_count() or 1

    @property
    def run_threads(self) -> int:
        """Return the number of threads of the runs; the responses use the others meanwhile."""
        return max(1, self.threads // 2)


def run_response_study(
    machine: Machine,
    loads: Mapping[str, Load],
    settings: ResponseSettings,
    progress: Callable[[float], None] = lambda fraction: None,
    steps: StepSummary | None = None,
) -> tuple[list[xr.Dataset], xr.Dataset | None]:
    """Compute the steady response to loads, runs over the spin profile, and sweeps.

    Args:
        machine, loads, settings, progress: What is computed.
        steps: Summary to which the steps and errors of all runs are added.

    Returns:
        The cases, each a dataset as of `steady_response` with the labels `load` and `gasket` (yes
        or no), with `reachable`: whether a machine moves so, in a stable motion without contact.
        The run over the machine's spin profile at the speeds of the response is `run_speed`
        [rad/s], `upper` and `lower` (sensor) [m] over `time`; they are missing if it diverged.
        The sweeps: largest `amplitude` [m] and its `speed` [rad/s] over load, gasket, rate
        [rad/s^2], direction (up, down) and sensor; None if not computed.

    Raises:
        InputError: an argument is wrong, or no periodic motion is found for a load.
    """
    summary = steps or StepSummary()
    pairs = [(name, load, gasket) for gasket in settings.gaskets for name, load in loads.items()]
    setups = [machine.set_up(load, gasket=gasket) for _, load, gasket in pairs]
    done = _Progress(progress, [RESPONSE_SHARE] * len(pairs) + [RUN_SHARE])

    def run() -> tuple[list[Record | None], xr.Dataset | None]:
        cases = [Case(*pair[:2], machine.parameters.profile, pair[2]) for pair in pairs]
        runs, sweeps = _records(machine, cases, settings.run_threads, summary), None
        if len(settings.rates):
            sweeps = _sweeps(machine, loads, settings, done.of(-1), summary)
        done.of(-1)(1.0)
        return runs, sweeps

    def solve(index: int) -> xr.Dataset:
        numbers = settings.speeds, settings.harmonics, settings.samples
        with problems_at(f"load '{pairs[index][0]}'"):
            return response_of(setups[index], *numbers, done.of(index))

    # the matrices are small: several threads each would be slower
    with threadpool_limits(1, "blas"), ThreadPoolExecutor(settings.threads) as pool:
        try:
            ran = pool.submit(run)
            responses = list(pool.map(solve, range(len(pairs))))
            runs, sweeps = ran.result()
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    cases = [
        case_of_response(response, name, gasket).merge(_run_up(run, settings.speeds))
        for (name, _, gasket), response, run in zip(pairs, responses, runs, strict=True)
    ]
    return cases, sweeps


def case_of_response(response: xr.Dataset, load: str, gasket: bool) -> xr.Dataset:
    """Return a response with its labels, and with what a machine reaches of it."""
    touches = response.smallest_gap.values <= 0.0  # false for NaN
    return response.assign(reachable=("point", response.stable.values & ~touches)).assign_coords(
        load=load, gasket=GASKET[gasket]
    )


def largest_of(case: xr.Dataset) -> xr.Dataset:
    """Return the largest reachable `amplitude` of each sensor [m], and its `speed` [rad/s].

    Both are NaN if no motion is reachable.
    """
    at = case.amplitude.where(case.reachable, -np.inf).argmax("point")
    largest = case[["amplitude"]].isel(point=at).reset_coords("speed")
    return largest.where(case.reachable.any())


def peaks_of(case: xr.Dataset) -> xr.Dataset:
    """Return the largest amplitude of each sensor and its speed: steady, and in the run.

    Returns:
        As of `largest_of`, with `run_amplitude` [m], `run_speed` [rad/s], and the relative
        `difference` of both amplitudes; NaN without a run.
    """
    peaks = largest_of(case).drop_vars(("load", "gasket"))
    size, speed = np.full((2, peaks.sizes["sensor"]), np.nan)
    if "time" in case.sizes:
        envelope = run_amplitude(case)
        size, speed = envelope.max(axis=0), case.run_speed.values[envelope.argmax(axis=0)]
    return peaks.assign(
        run_amplitude=RUN_AMPLITUDE.variable("sensor", size),
        run_speed=RUN_SPEED.variable("sensor", speed),
        difference=DIFFERENCE.variable("sensor", size / peaks.amplitude.values - 1.0),
    )


def run_amplitude(case: xr.Dataset) -> FloatArray:
    """Return the larger one of both envelopes of the run. (time, sensor) [m]"""
    return np.maximum(np.abs(case.upper.values), np.abs(case.lower.values))


class _Progress:
    """Reports the fraction done of parts that are worked on at the same time."""

    def __init__(self, report: Callable[[float], None], weights: Sequence[float]) -> None:
        self._report, self._weights = report, np.array(weights) / np.sum(weights)
        self._done = np.zeros(len(weights))

    def of(self, part: int) -> Callable[[float], None]:
        """Return what is called with the fraction done of a part."""

        def report(fraction: float) -> None:
            self._done[part] = fraction
            self._report(float(self._weights @ self._done))

        return report


def _records(
    machine: Machine, cases: list[Case], workers: int | None, steps: StepSummary
) -> list[Record | None]:
    """Return the records of cases; None for a run that diverged."""
    records: dict[int, Record | None] = {}

    def keep(run: RunResult) -> None:
        records[run.number] = None if run.diverged else run.record
        steps.add(run.case.name, run.accuracy)

    simulate_many(machine, cases, measures=[], histories=True, workers=workers, finished=keep)
    return [records[index] for index in range(len(cases))]


def _run_up(record: Record | None, speeds: FloatArray) -> xr.Dataset:
    """Return the variables of the run of a case; none without samples at these speeds."""
    if record is None:
        return xr.Dataset()
    edges, speed = envelopes(record).reset_coords(drop=True), record.drum_speed.values
    inside = (speed >= speeds.min()) & (speed <= speeds.max())
    if not inside.any() or np.isnan(edges.upper.values).all():
        return xr.Dataset()
    return edges.assign(run_speed=RUN_SPEED.variable("time", speed)).isel(time=inside)


def sweep_profile(first: float, last: float, rate: float) -> SpinProfile:
    """Return a profile that holds the first speed, then goes to the last one at a rate.

    Its only region is the sweep.

    Args:
        first, last: [rad/s]
        rate: > 0. [rad/s^2]
    """
    end = HOLD + abs(last - first) / rate
    sweep = Region(name="sweep", begin=HOLD, end=end)
    return SpinProfile(time=(0.0, HOLD, end), speed=(first, first, last), regions=(sweep,))


def _sweeps(
    machine: Machine,
    loads: Mapping[str, Load],
    settings: ResponseSettings,
    progress: Callable[[float], None],
    steps: StepSummary,
) -> xr.Dataset:
    """Return the largest amplitudes of sweeps and their speeds."""
    low, high = float(min(settings.speeds)), float(max(settings.speeds))
    gaskets, rates = settings.gaskets, settings.rates
    directions = {"up": (low, high), "down": (high, low)}
    cases, places = [], []
    for r, rate in enumerate(rates):
        for d, ends in enumerate(directions.values()):
            profile = sweep_profile(*ends, rate)
            for g, gasket in enumerate(gaskets):
                for k, (name, load) in enumerate(loads.items()):
                    cases.append(Case(name, load, profile, gasket))
                    places.append((k, g, r, d))
    shape = (len(loads), len(gaskets), len(rates), 2, len(machine.parameters.sensors))
    amplitude, speed = np.full(shape, np.nan), np.full(shape, np.nan)
    table = simulate_many(
        machine,
        cases,
        measures=["amplitudes in regions"],
        workers=settings.run_threads,
        progress=lambda done: progress(done / len(cases)),
    )
    steps.add_table(table)
    complete = table.diverged.values == ""
    for place, kept, run in zip(places, complete, table.run.values, strict=True):
        if kept:
            amplitude[place] = table.region_amplitude.values[run, 0]
            speed[place] = table.region_critical_speed.values[run, 0]
    dims = ("load", "gasket", "rate", "direction", "sensor")
    return xr.Dataset(
        {"amplitude": AMPLITUDE.variable(dims, amplitude), "speed": SPEED.variable(dims, speed)},
        {
            "load": list(loads),
            "gasket": [GASKET[gasket] for gasket in gaskets],
            "rate": RATE.variable("rate", rates),
            "direction": list(directions),
            "sensor": list(machine.parameters.sensors),
        },
    )
