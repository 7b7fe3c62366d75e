"""Study of the steady response: all loads, with and without gasket, and the influence of sweep."""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import xarray as xr

from wm_drake.batch import simulate_many
from wm_drake.batch.runs import RunResult
from wm_drake.errors import InputError, Problem
from wm_drake.model.machine import Machine, Setup
from wm_drake.parameters import Load, MachineParameters, SpinProfile
from wm_drake.parameters.spin import Region
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import envelopes
from wm_drake.simulation.records import Record
from wm_drake.studies.steady.balance import HARMONICS, SAMPLES
from wm_drake.studies.steady.response import response_of

RATES_RPM_S = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
"""Default sweep rates. [rpm/s]"""

HOLD = 8.0
"""Time at the first speed of a sweep, so that the start has decayed. It is not measured. [s]"""

RAD_S_PER_RPM = np.pi / 30.0


@dataclass(frozen=True)
class SteadyCase:
    """Steady response to a load.

    Attributes:
        load: Name of the load.
        gasket: Whether the gasket is in place.
        response: As `steady_response` returns it.
        run_up: Speed and upper and lower envelope of the run over the machine's spin profile:
            dataset over time with `speed`, `upper` and `lower` (time, sensor). SI
        wall_s: Time that the response took.
    """

    load: str
    gasket: bool
    response: xr.Dataset
    run_up: xr.Dataset | None
    wall_s: float


@dataclass(frozen=True)
class SteadyStudy:
    """Results of the study.

    Attributes:
        parameters: The machine.
        cases: Each load with and without gasket.
        sweeps: Largest `amplitude` and its `speed` over load, gasket, rate, direction (up, down)
            and sensor, coordinate `rate` in rad/s^2. None if not computed.
        wall_s: Time of all.
    """

    parameters: MachineParameters
    cases: list[SteadyCase]
    sweeps: xr.Dataset | None
    wall_s: float


def run_steady_study(
    machine: Machine,
    loads: Sequence[tuple[str, Load]],
    speeds: FloatArray,
    *,
    gaskets: Sequence[bool] = (True, False),
    harmonics: int = HARMONICS,
    samples: int = SAMPLES,
    rates_rpm_s: Sequence[float] = RATES_RPM_S,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> SteadyStudy:
    """Compute the steady response to loads, runs over the spin profile, and sweeps.

    Args:
        machine: A built machine.
        loads: Names and loads.
        speeds: Rising speeds. [rad/s]
        gaskets: True for a machine with its gasket, False for one without.
        harmonics, samples: See `steady_response`.
        rates_rpm_s: Sweep rates, up and down; none for no sweeps. [rpm/s]
        workers: Number of threads; None for the number of cores. The results do not depend on it.
        progress: Called with the fraction done.

    Raises:
        InputError: an argument is wrong, or no periodic motion is found for a load.
    """
    begin = time.perf_counter()
    pairs = [(name, load, gasket) for gasket in gaskets for name, load in loads]
    setups = [machine.set_up(load, gasket=gasket) for _, load, gasket in pairs]
    done = [0.0] * len(pairs)
    share = 0.6 if len(rates_rpm_s) else 0.9

    def solve(index: int, setup: Setup) -> tuple[xr.Dataset, float]:
        start = time.perf_counter()

        def report(fraction: float) -> None:
            done[index] = fraction
            progress(share * sum(done) / len(done))

        try:
            found = response_of(setup, speeds, harmonics, samples, report)
        except InputError as error:
            raise InputError(
                Problem(f"load '{pairs[index][0]}'", p.key, p.message) for p in error.problems
            ) from None
        return found, time.perf_counter() - start

    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        responses = list(pool.map(solve, range(len(pairs)), setups))
    profile = machine.parameters.profile
    runs = _records(machine, [Case(*pair[:2], profile, pair[2]) for pair in pairs], workers)
    begun = share + (0.1 if len(rates_rpm_s) else 0.0)
    progress(begun)
    cases = [
        SteadyCase(name, gasket, response, _envelopes(run), wall)
        for (name, _, gasket), (response, wall), run in zip(pairs, responses, runs, strict=True)
    ]
    sweeps = None
    if len(rates_rpm_s):
        count = 2 * len(rates_rpm_s) * len(pairs)

        def report_sweeps(finished: int) -> None:
            progress(begun + (1.0 - begun) * finished / count)

        sweeps = _sweeps(machine, loads, gaskets, speeds, rates_rpm_s, workers, report_sweeps)
    progress(1.0)
    return SteadyStudy(machine.parameters, cases, sweeps, time.perf_counter() - begin)


def _records(machine: Machine, cases: list[Case], workers: int | None) -> list[Record | None]:
    """Return the records of cases; None for a run that diverged."""
    records: dict[int, Record | None] = {}

    def keep(run: RunResult) -> None:
        records[run.number] = None if run.diverged else run.record

    simulate_many(machine, cases, measures=[], histories=True, workers=workers, finished=keep)
    return [records[index] for index in range(len(cases))]


def _envelopes(record: Record | None) -> xr.Dataset | None:
    if record is None:
        return None
    found = envelopes(record)
    if np.isnan(found.upper.values).all():
        return None
    return found.assign(speed=("time", record.drum_speed.values))


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
    loads: Sequence[tuple[str, Load]],
    gaskets: Sequence[bool],
    speeds: FloatArray,
    rates_rpm_s: Sequence[float],
    workers: int | None,
    done: Callable[[int], None],
) -> xr.Dataset:
    """Return the largest amplitudes of sweeps and their speeds."""
    low, high = float(min(speeds)), float(max(speeds))
    directions = {"up": (low, high), "down": (high, low)}
    cases, places = [], []
    for r, rate in enumerate(rates_rpm_s):
        for d, ends in enumerate(directions.values()):
            profile = sweep_profile(*ends, rate * RAD_S_PER_RPM)
            for g, gasket in enumerate(gaskets):
                for k, (name, load) in enumerate(loads):
                    cases.append(Case(name, load, profile, gasket))
                    places.append((k, g, r, d))
    shape = (len(loads), len(gaskets), len(rates_rpm_s), 2, len(machine.parameters.sensors))
    amplitude, speed = np.full(shape, np.nan), np.full(shape, np.nan)
    measure = ["amplitudes in regions"]
    table = simulate_many(machine, cases, measures=measure, workers=workers, progress=done)
    complete = table.diverged.values == ""
    for place, kept, run in zip(places, complete, table.run.values, strict=True):
        if kept:
            amplitude[place] = table.region_amplitude.values[run, 0]
            speed[place] = table.region_critical_speed.values[run, 0]
    dims = ("load", "gasket", "rate", "direction", "sensor")
    return xr.Dataset(
        {
            "amplitude": (dims, amplitude, {"units": "m"}),
            "speed": (dims, speed, {"units": "rad/s"}),
        },
        {
            "load": [name for name, _ in loads],
            "gasket": list(gaskets),
            "rate": ("rate", np.array(rates_rpm_s) * RAD_S_PER_RPM, {"units": "rad/s^2"}),
            "direction": list(directions),
            "sensor": list(machine.parameters.sensors),
        },
    )
