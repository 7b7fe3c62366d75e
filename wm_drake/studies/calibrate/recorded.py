"""Data of recordings for a fit: signals over time, or their amplitudes, with their deviations."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from wm_drake.parameters import Load, MachineParameters
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import TIME, quantity_of
from wm_drake.simulation.mount_forces import speed_ranges
from wm_drake.simulation.records import profile_of
from wm_drake.studies.calibrate.blocks import Block
from wm_drake.studies.compare.pairs import Pair
from wm_drake.studies.compare.signals import (
    band_passed,
    envelope_sizes,
    order_one_sizes,
    places_of,
    rms_of,
)
from wm_drake.studies.compare.study import LEAST_TOLERANCE, SINGLE_TOLERANCE

By: TypeAlias = Literal["envelope", "order", "rms", "history"]
"""What is fitted: amplitudes over the drum speed, those of order 1, RMS of regions, or signals."""

EDGE = 2.0
"""Time at both ends of a recording that is left out: filters have not settled there. [s]"""

LEAST_NOISE = 1e-3
"""Smallest deviation of a sample of a signal, by the RMS of the signal."""


@dataclass(frozen=True, eq=False)
class RecordedLoad:
    """Recordings of one load, repeats of each other.

    Attributes:
        load_at: Function of a machine with the load.
        pairs: Recordings on the times of runs of the machine at the start.
    """

    name: str
    load_at: Callable[[MachineParameters], Load]
    pairs: tuple[Pair, ...]

    @cached_property
    def places(self) -> list[str]:
        """Names of the drum speeds or times at which amplitudes are compared."""
        places = places_of([pair.run for pair in self.pairs])
        return [quantity_of(places).text(value) for value in places.values]


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedBlock(Block):
    """Data of one load, or of one recording.

    Attributes:
        load: The load.
        pairs: Recordings whose mean the values are.
    """

    load: RecordedLoad
    pairs: tuple[Pair, ...]


def amplitude_block(load: RecordedLoad, by: By) -> RecordedBlock:
    """Return the amplitudes of a load, means of its repeats."""
    each = np.stack([reduced(load, pair, pair.measured, by) for pair in load.pairs])
    places = load.places
    if by == "rms":
        run = load.pairs[0].run
        places = [part.name for part in speed_ranges(run, profile_of(run))]
    values = mean_of(each), deviations_of(each)
    return RecordedBlock(load.name, places, *values, load=load, pairs=load.pairs)


def reduced(load: RecordedLoad, pair: Pair, signals: FloatArray, by: By) -> FloatArray:
    """Return what is fitted of signals (n, k) of a recording: amplitudes (m, k), or all."""
    if by == "history":
        return signals
    if by == "rms":
        masks = [part.samples for part in speed_ranges(pair.run, profile_of(pair.run))]
        return rms_of(band_passed(signals, pair.run)[None], masks)[0]
    sizes = order_one_sizes if by == "order" else envelope_sizes
    return sizes(signals, pair.run, places_of([one.run for one in load.pairs]))


def without_edges(pair: Pair) -> Pair:
    """Return a recording without its first and last two seconds."""
    time = pair.run.time.values
    known = np.isfinite(pair.measured)
    inside = np.flatnonzero(known.any(axis=1))
    if not len(inside):
        return pair
    begin, end = time[inside[0]] + EDGE, time[inside[-1]] - EDGE
    kept = (time >= begin) & (time <= end)
    return replace(pair, measured=np.where(kept[:, None], pair.measured, np.nan))


def until_last_sample(pairs: Sequence[Pair]) -> tuple[Pair, ...]:
    """Return repeats whose runs end with the last measured sample of all of them.

    Further runs at other numbers of the machine are as long. Repeats keep a common end, since those
    of one profile share their runs.
    """
    known = [np.flatnonzero(np.isfinite(pair.measured).any(axis=1)) for pair in pairs]
    count = max((int(places[-1]) + 1 for places in known if len(places)), default=2)
    shortened = []
    for pair in pairs:
        run = pair.run.isel(time=slice(count))
        profile = profile_of(pair.run).until(float(run.time[-1]))
        run = run.assign_attrs(profile=profile.model_dump_json())
        measured, predicted = pair.measured[:count], pair.predicted[:count]
        shortened.append(replace(pair, run=run, measured=measured, predicted=predicted))
    return tuple(shortened)


def mean_of(values: FloatArray) -> FloatArray:
    """Return the mean over the first axis of those that are finite; NaN where none is."""
    valid = np.isfinite(values)
    count = valid.sum(axis=0)
    sums = np.where(valid, values, 0.0).sum(axis=0)
    return np.where(count > 0, sums / np.maximum(count, 1), np.nan)


def deviations_of(measured: FloatArray) -> FloatArray:
    """Return the standard deviations of the means of repeats (place, sensor). [SI]

    Args:
        measured: (repeat, place, sensor) [SI]
    """
    mean, count = mean_of(measured), len(measured)
    scatter = 0.5 * SINGLE_TOLERANCE * mean
    if count > 1:
        scatter = np.sqrt(mean_of((measured - mean) ** 2) / (count - 1.0))
    least = LEAST_TOLERANCE * np.nanmax(mean, axis=0)
    return np.asarray(np.hypot(scatter, least))


def history_block(
    load: RecordedLoad, pair: Pair, sensors: Mapping[str, RecordedSensor]
) -> RecordedBlock:
    """Return the signals of a recording, of which offset and drift may be those of the sensors."""
    time = pair.run.time.values
    baseline = np.column_stack([np.ones(len(time)), time / time[-1] - 0.5])
    deviations = [
        noise_of(signal, sensor)
        for signal, sensor in zip(pair.measured.T, sensors.values(), strict=True)
    ]
    places = list(map(TIME.text, time))
    deviation = np.broadcast_to(deviations, pair.measured.shape)
    values = pair.measured, deviation, baseline
    name = pair.recording.path.name
    return RecordedBlock(name, places, *values, load=load, pairs=(pair,))


def noise_of(signal: FloatArray, sensor: RecordedSensor) -> float:
    """Return the deviation of the noise of a recorded signal (n,). [SI]

    It is the declared one, or that of second differences, which a smooth signal does not have.
    """
    known = signal[np.isfinite(signal)]
    if not len(known):
        return 0.0
    noise = sensor.noise
    if not noise and len(known) > 2:
        noise = 1.4826 * float(np.median(np.abs(np.diff(known, 2)))) / np.sqrt(6.0)
    return float(np.hypot(noise, LEAST_NOISE * np.std(known)))
