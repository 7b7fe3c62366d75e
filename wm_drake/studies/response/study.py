"""Study of the steady response: all loads, with and without gasket, and the influence of sweep."""

import os
import time
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
from wm_drake.parameters import Load, MachineParameters, SpinProfile
from wm_drake.parameters.spin import Region
from wm_drake.parameters.types import BoolArray, FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.displacements import envelopes
from wm_drake.simulation.records import Record
from wm_drake.studies.response.balance import HARMONICS, SAMPLES
from wm_drake.studies.response.response import response_of

RATES_RPM_S = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
"""Default sweep rates. [rpm/s]"""

HOLD = 8.0
"""Time at the first speed of a sweep, so that the start has decayed. It is not measured. [s]"""

RESPONSE_SHARE, RUN_SHARE = 1.0, 3.0
"""Parts of the progress: one for each response, one for all runs of the engine."""

RAD_S_PER_RPM = np.pi / 30.0


@dataclass(frozen=True)
class ResponseCase:
    """Steady response to a load.

    Attributes:
        load: Name of the load.
        gasket: Whether the gasket is in place.
        response: As `steady_response` returns it.
        run_up: Speed and upper and lower envelope of the run over the machine's spin profile, at
            the speeds of the response: dataset over time with `speed`, `upper` and `lower` (time,
            sensor). SI
        wall_s: Time that the response took.
    """

    load: str
    gasket: bool
    response: xr.Dataset
    run_up: xr.Dataset | None
    wall_s: float

    @property
    def stable(self) -> BoolArray:
        """Whether each motion of the branch attracts its neighbours. (points,)"""
        return np.asarray(self.response.stable.values, dtype=bool)

    @property
    def touches(self) -> BoolArray:
        """Whether the tub touches the housing in each motion of the branch. (points,)"""
        return np.asarray(self.response.smallest_gap.values <= 0.0)  # false for NaN

    @property
    def reachable(self) -> BoolArray:
        """Whether a machine moves so: in a stable motion without contact. (points,)"""
        return self.stable & ~self.touches

    def largest(self) -> tuple[FloatArray, FloatArray]:
        """Return the largest reachable amplitude of each sensor [m], and its speed [rad/s].

        Both are NaN if no motion is reachable.
        """
        values = np.where(self.reachable[:, None], self.response.amplitude.values, -np.inf)
        at = values.argmax(axis=0)
        size = values[at, np.arange(values.shape[1])]
        none = np.isinf(size)
        speed = self.response.speed.values[at]
        return np.where(none, np.nan, size), np.where(none, np.nan, speed)


@dataclass(frozen=True)
class ResponseStudy:
    """Results of the study.

    Attributes:
        sweeps: Largest `amplitude` and its `speed` over load, gasket, rate, direction (up, down)
            and sensor, coordinate `rate` in rad/s^2. None if not computed.
    """

    parameters: MachineParameters
    cases: list[ResponseCase]
    sweeps: xr.Dataset | None
    wall_s: float


@dataclass(frozen=True)
class ResponseSettings:
    """What the study computes.

    Attributes:
        speeds: Rising speeds. [rad/s]
        gaskets: True for a machine with its gasket, False for one without.
        harmonics, samples: See `steady_response`.
        rates_rpm_s: Sweep rates, up and down; none for no sweeps. [rpm/s]
        workers: Number of threads; None for the number of cores. The results do not depend on it.
    """

    speeds: FloatArray
    gaskets: Sequence[bool] = (True, False)
    harmonics: int = HARMONICS
    samples: int = SAMPLES
    rates_rpm_s: Sequence[float] = RATES_RPM_S
    workers: int | None = None

    @property
    def threads(self) -> int:
        """Number of threads."""
        return self.workers or os.cpu_count() or 1

    @property
    def run_threads(self) -> int:
        """Number of threads of the runs; the responses use the other ones meanwhile."""
        return max(1, self.threads // 2)


def run_response_study(
    machine: Machine,
    loads: Mapping[str, Load],
    settings: ResponseSettings,
    progress: Callable[[float], None] = lambda fraction: None,
) -> ResponseStudy:
    """Compute the steady response to loads, runs over the spin profile, and sweeps.

    Raises:
        InputError: an argument is wrong, or no periodic motion is found for a load.
    """
    begin = time.perf_counter()
    pairs = [(name, load, gasket) for gasket in settings.gaskets for name, load in loads.items()]
    setups = [machine.set_up(load, gasket=gasket) for _, load, gasket in pairs]
    done = _Progress(progress, [RESPONSE_SHARE] * len(pairs) + [RUN_SHARE])

    def run() -> tuple[list[Record | None], xr.Dataset | None]:
        cases = [Case(*pair[:2], machine.parameters.profile, pair[2]) for pair in pairs]
        runs, sweeps = _records(machine, cases, settings.run_threads), None
        if len(settings.rates_rpm_s):
            sweeps = _sweeps(machine, loads, settings, done.of(-1))
        done.of(-1)(1.0)
        return runs, sweeps

    def solve(index: int) -> tuple[xr.Dataset, float]:
        start, name = time.perf_counter(), pairs[index][0]
        numbers = settings.speeds, settings.harmonics, settings.samples
        with problems_at(f"load '{name}'"):
            response = response_of(setups[index], *numbers, done.of(index))
        return response, time.perf_counter() - start

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
        ResponseCase(name, gasket, response, _envelopes(run, settings.speeds), wall)
        for (name, _, gasket), (response, wall), run in zip(pairs, responses, runs, strict=True)
    ]
    return ResponseStudy(machine.parameters, cases, sweeps, time.perf_counter() - begin)


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


def _records(machine: Machine, cases: list[Case], workers: int | None) -> list[Record | None]:
    """Return the records of cases; None for a run that diverged."""
    records: dict[int, Record | None] = {}

    def keep(run: RunResult) -> None:
        records[run.number] = None if run.diverged else run.record

    simulate_many(machine, cases, measures=[], histories=True, workers=workers, finished=keep)
    return [records[index] for index in range(len(cases))]


def _envelopes(record: Record | None, speeds: FloatArray) -> xr.Dataset | None:
    """Return the `run_up` of a `ResponseCase`; None without samples at these speeds."""
    if record is None:
        return None
    edges = envelopes(record)
    if np.isnan(edges.upper.values).all():
        return None
    speed = record.drum_speed.values
    inside = (speed >= speeds.min()) & (speed <= speeds.max())
    if not inside.any():
        return None
    return edges.assign(speed=("time", speed)).isel(time=inside)


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
) -> xr.Dataset:
    """Return the largest amplitudes of sweeps and their speeds."""
    low, high = float(min(settings.speeds)), float(max(settings.speeds))
    gaskets, rates_rpm_s = settings.gaskets, settings.rates_rpm_s
    directions = {"up": (low, high), "down": (high, low)}
    cases, places = [], []
    for r, rate in enumerate(rates_rpm_s):
        for d, ends in enumerate(directions.values()):
            profile = sweep_profile(*ends, rate * RAD_S_PER_RPM)
            for g, gasket in enumerate(gaskets):
                for k, (name, load) in enumerate(loads.items()):
                    cases.append(Case(name, load, profile, gasket))
                    places.append((k, g, r, d))
    shape = (len(loads), len(gaskets), len(rates_rpm_s), 2, len(machine.parameters.sensors))
    amplitude, speed = np.full(shape, np.nan), np.full(shape, np.nan)
    table = simulate_many(
        machine,
        cases,
        measures=["amplitudes in regions"],
        workers=settings.run_threads,
        progress=lambda done: progress(done / len(cases)),
    )
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
            "load": list(loads),
            "gasket": list(gaskets),
            "rate": ("rate", np.array(rates_rpm_s) * RAD_S_PER_RPM, {"units": "rad/s^2"}),
            "direction": list(directions),
            "sensor": list(machine.parameters.sensors),
        },
    )
