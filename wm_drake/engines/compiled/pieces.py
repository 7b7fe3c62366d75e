"""Run a machine through a long spin profile piece by piece, in the memory of one piece."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from wm_drake.compiler.lane_memory import aligned, fill_lanes
from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.local_error import SUMS_SIZE, estimates_of
from wm_drake.engines.compiled.packing import initial_state
from wm_drake.engines.compiled.run import RunLanes, advance_of
from wm_drake.engines.compiled.samples import trajectory_of
from wm_drake.engines.compiled.stepping import Stepping
from wm_drake.engines.compiled.water import pack_run
from wm_drake.engines.schedule import Schedule, schedule_of
from wm_drake.engines.trajectory import Trajectory
from wm_drake.model.machine import Setup
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray


def run_pieces(
    setup: Setup, profile: SpinProfile, stepping: Stepping, period: float, rows: int
) -> Iterator[Trajectory]:
    """Run a machine through a spin profile and yield its motion piece by piece.

    The pieces together are the motion of `wm_drake.engines.compiled.run.run_compiled`. They end at
    the first sample out of bounds. The estimated errors of a piece are those of the run up to its
    end.

    Args:
        setup: Machine at rest in its Context, which is not changed.
        profile: Drum speed over time.
        stepping: How to integrate.
        period: Time between two samples. [s]
        rows: Number of samples of a piece; the last one may have fewer.

    Raises:
        InputError: the machine has something that the compiled engine does not represent.
    """
    p, layout, water = pack_run(setup)
    begin = np.concatenate([initial_state(setup, profile), water])
    schedule = schedule_of(profile, stepping.step, period, layout.control_period)
    size = len(begin) + layout.states.begins.rates
    relaxation = stepping.relaxation if stepping.integrator == "midpoint" else None
    lanes = RunLanes(
        _in_lanes(p),
        _in_lanes(begin),
        aligned(rows * size * WIDTH),
        aligned(SUMS_SIZE * WIDTH),
        None if relaxation is None else _in_lanes(relaxation),
    )
    # each piece writes its samples from the first place on
    wrapped = replace(schedule, row=np.where(schedule.row < 0, -1, schedule.row % rows))
    advance = advance_of(wrapped, stepping.one_derivative(schedule), layout, lanes)
    starts = np.flatnonzero((schedule.row >= 0) & (schedule.row % rows == 0)).tolist()
    for first, end in zip(starts, [*starts[1:], len(schedule.step)], strict=True):
        advance(first, end)
        piece = _part(schedule, first, end)
        samples = lanes.samples.reshape(rows, size, WIDTH)[: len(piece.time), :, 0].copy()
        estimates = estimates_of(lanes.sums)[0]
        trajectory = replace(trajectory_of(samples, piece, p, layout), estimates=estimates)
        yield trajectory
        if trajectory.divergence:
            return


def _in_lanes(values: FloatArray) -> FloatArray:
    return fill_lanes(aligned(len(values) * WIDTH), [values])


def _part(schedule: Schedule, first: int, end: int) -> Schedule:
    """Return the steps of a schedule from one number to another."""
    row = schedule.row[first:end]
    numbers = row[row >= 0]
    return Schedule(
        step=schedule.step[first:end],
        acceleration=schedule.acceleration[first:end],
        drum=schedule.drum[2 * first : 2 * end + 1],
        row=row,
        time=schedule.time[numbers[0] : numbers[-1] + 1],
        controls=schedule.controls[first:end],
        alike=schedule.alike[first:end],
    )
