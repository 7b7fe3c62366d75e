"""Run machines through a spin profile with the compiled engine, at fixed steps."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from wm_drake.compiler.lane_memory import aligned, fill_lanes
from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.integration import integrate_lanes, work_arrays
from wm_drake.engines.compiled.local_error import SUMS_SIZE, estimates_of
from wm_drake.engines.compiled.midpoint import integrate_midpoint_lanes, midpoint_work
from wm_drake.engines.compiled.packing import Layout, initial_state
from wm_drake.engines.compiled.samples import trajectory_of
from wm_drake.engines.compiled.stepping import Stepping
from wm_drake.engines.compiled.water import pack_run
from wm_drake.engines.memory import check_size
from wm_drake.engines.schedule import Schedule, schedule_of
from wm_drake.engines.trajectory import Trajectory, diverging_coordinate
from wm_drake.model.machine import Setup
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.machine import Integrator
from wm_drake.parameters.types import FloatArray

PAUSE_STEPS = 4000
"""Steps between two checks for divergence and reports of progress: some milliseconds."""


@dataclass(frozen=True)
class RunLanes:
    """Flat arrays of lanes of `WIDTH` runs side by side.

    Attributes:
        p: Packed numbers.
        x: States; the integration advances them.
        samples: The samples, as `integrate_lanes` writes them.
        sums: `wm_drake.engines.compiled.local_error.Sums`, zero before the first step.
        relaxation: Matrices of the midpoint rule; None for other integrators.
    """

    p: FloatArray
    x: FloatArray
    samples: FloatArray
    sums: FloatArray
    relaxation: FloatArray | None = None


def run_compiled(
    setup: Setup,
    profile: SpinProfile,
    step: float,
    progress: Callable[[float], None],
    period: float | None = None,
    integrator: Integrator = "runge_kutta",
    relaxation: FloatArray | None = None,
) -> Trajectory:
    """Run a machine through a spin profile with the compiled engine.

    Steps end at every output time and at every corner of the profile, so no step contains a jump of
    the acceleration. The run is a batch of one: idle lanes repeat it.

    Args:
        setup: Machine at rest in its Context, which is not changed.
        profile: Drum speed over time; followed exactly.
        step: Step size. [s]
        progress: Called with the fraction done.
        period: Time between two samples; None for that of the machine and the profile. [s]
        integrator: "multistep", "midpoint" or "runge_kutta".
        relaxation: As in the `Stepping`, for "midpoint".

    Returns:
        The sampled motion; up to the last good sample if it diverged.

    Raises:
        InputError: the machine has something that the compiled engine does not represent.
    """
    period = period or profile.sample_period(setup.parameters.output_period)
    check_size(profile, step, period)
    schedule, layout, lanes = one_run(setup, profile, step, period, integrator, relaxation)
    one_derivative = Stepping(integrator, step).one_derivative(schedule)
    for done in integrate_runs(schedule, one_derivative, layout, lanes):
        progress(done)
    samples = lanes.samples.reshape(len(schedule.time), -1, WIDTH)[..., 0].copy()
    p, estimates = lanes.p.reshape(-1, WIDTH)[:, 0].copy(), estimates_of(lanes.sums)
    return replace(trajectory_of(samples, schedule, p, layout), estimates=estimates[0])


def one_run(
    setup: Setup,
    profile: SpinProfile,
    step: float,
    period: float,
    integrator: Integrator,
    relaxation: FloatArray | None,
) -> tuple[Schedule, Layout, RunLanes]:
    """Return the steps of a single run and its lanes before the first; see `run_compiled`."""
    p, layout, water = pack_run(setup)
    begin = np.concatenate([initial_state(setup, profile), water])
    schedule = schedule_of(profile, step, period, layout.control_period)
    size = len(begin) + layout.states.begins.rates
    relaxed = None
    if integrator == "midpoint" and relaxation is not None:
        relaxed = _in_lanes(relaxation)
    sums, history = aligned(SUMS_SIZE * WIDTH), aligned(len(schedule.time) * size * WIDTH)
    return schedule, layout, RunLanes(_in_lanes(p), _in_lanes(begin), history, sums, relaxed)


def _in_lanes(values: FloatArray) -> FloatArray:
    return fill_lanes(aligned(len(values) * WIDTH), [values])


def integrate_runs(
    schedule: Schedule, one_derivative: np.ndarray, layout: Layout, lanes: RunLanes
) -> Iterator[float]:
    """Integrate `WIDTH` runs side by side until the schedule ends or all of them have diverged.

    A run has diverged at the first sample out of bounds. Samples up to there do not depend on the
    other runs, nor on where the integration pauses.

    Args:
        schedule: The steps.
        one_derivative: Whether each step takes one derivative; see `Stepping`.
        layout: What the runs have in common.
        lanes: Their numbers; samples behind the last one that was reached become NaN.

    Yields:
        The fraction done, after each `PAUSE_STEPS` steps.
    """
    advance = advance_of(schedule, one_derivative, layout, lanes)
    by_sample = lanes.samples.reshape(len(schedule.time), -1, WIDTH)
    done, steps, last, diverged = 0, len(schedule.step), 0, False
    while done < steps and not diverged:
        begin, done = done, min(done + PAUSE_STEPS, steps)
        advance(begin, done)
        last = max(last, int(schedule.row[begin:done].max()))
        diverged = all(diverging_coordinate(positions) for positions in by_sample[last, :6].T)
        yield done / steps
    by_sample[last + 1 :] = float("nan")


def advance_of(
    schedule: Schedule, one_derivative: np.ndarray, layout: Layout, lanes: RunLanes
) -> Callable[[int, int], None]:
    """Return the function that integrates from one number of a step to another.

    Arguments as for `integrate_runs`.
    """
    p, x, samples, elements = lanes.p, lanes.x, lanes.samples, layout.elements
    sums = lanes.sums
    sizes = len(x) // WIDTH, layout.states.begins.inputs
    if lanes.relaxation is None:
        work, steps = work_arrays(*sizes), (*schedule.steps, one_derivative)
        return lambda begin, end: integrate_lanes(
            steps, begin, end, p, elements, x, work, sums, samples
        )
    middle = midpoint_work(*sizes)
    return lambda begin, end: integrate_midpoint_lanes(
        schedule.steps[:4], begin, end, p, elements, lanes.relaxation, x, middle, sums, samples
    )
