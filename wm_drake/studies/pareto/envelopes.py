"""Envelopes of the designs of a front, for the page on which designs are picked."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.displacements import envelopes
from wm_drake.simulation.records import Record, sample_period
from wm_drake.studies.pareto.study import ParetoFront

Histories: TypeAlias = Callable[[Sequence[Case], Callable[[int, Record], None]], None]
"""Function that runs cases and calls its second argument with number and record of each."""

INTERVALS = 120
"""Number of intervals of time, each with the largest value of an envelope in it."""


@dataclass(frozen=True)
class Envelopes:
    """Envelopes of the filtered displacements, the largest over the loads of each design.

    Attributes:
        time: Middle of each interval. (n,) [s]
        designs: (designs, sensors, n) [m] NaN behind the end of a run that failed.
        nominal: Those of the machine itself. (sensors, n) [m]
        of: What was run for each design, in words.
    """

    time: FloatArray
    sensors: tuple[str, ...]
    designs: FloatArray
    nominal: FloatArray
    of: str


def front_envelopes(front: ParetoFront, histories: Histories) -> Envelopes:
    """Return the envelopes of all designs of a front and of the machine itself."""
    designs = front.designs
    points = [*front.search.designs, designs.nominal()]
    runs = [designs.shown_runs(designs.machine_at(p), f"{i}") for i, p in enumerate(points, 1)]
    owners = [number for number, cases in enumerate(runs) for _ in cases]
    sensors = tuple(designs.parameters.sensors)
    largest = np.full((len(points), len(sensors), INTERVALS), np.nan)
    duration = max(case.profile.duration for cases in runs for case in cases)

    def add(number: int, record: Record) -> None:
        owner = owners[number]
        largest[owner] = np.fmax(largest[owner], envelope_of(record, duration))

    histories([case for cases in runs for case in cases], add)
    time = (np.arange(INTERVALS) + 0.5) * duration / INTERVALS
    return Envelopes(time, sensors, largest[:-1], largest[-1], designs.shown)


def envelope_of(record: Record, duration: float) -> FloatArray:
    """Return the largest value of the envelopes in each interval of time. (sensors, n) [m]

    Args:
        duration: Duration that is divided into `INTERVALS`. [s]
    """
    sensors = envelopes(record)
    size = np.maximum(np.abs(sensors.upper.values), np.abs(sensors.lower.values))
    answer = np.full((size.shape[1], INTERVALS), np.nan)
    per_interval = duration / sample_period(record) / INTERVALS
    ends = np.round(np.arange(INTERVALS + 1) * per_interval).astype(int)
    for index, (begin, end) in enumerate(itertools.pairwise(ends)):
        part = size[begin : max(end, begin + 1)]
        if len(part):
            answer[:, index] = part.max(axis=0)
    return answer
