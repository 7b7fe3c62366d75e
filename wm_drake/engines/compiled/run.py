"""The fast engine: the whole machine as one compiled function, at fixed steps of the classical Runge-Kutta scheme."""

from collections.abc import Callable

import numpy as np

from wm_drake.engines.compiled.alone import Alone
from wm_drake.engines.compiled.packing import initial_state
from wm_drake.engines.compiled.samples import trajectory_of
from wm_drake.engines.schedule import schedule_of
from wm_drake.engines.trajectory import Trajectory, diverging_coordinate
from wm_drake.model.machine import OUTPUT_PERIOD, Setup
from wm_drake.parameters import SpinProfile

PAUSE_STEPS = 2000
"""Steps between looks at the state and reports of progress: some milliseconds."""


def run_compiled(
    setup: Setup, profile: SpinProfile, step: float, progress: Callable[[float], None]
) -> Trajectory:
    """Runs a machine through a spin profile without Drake, with its numbers and its laws.

    Steps end at every output time and at every corner of the profile, so no step sees the acceleration jump.

    Args:
        setup: Machine at rest in its Context, which stays as it is.
        profile: Drum speed over time; followed exactly.
        step: Integration step. [s]
        progress: Called with the fraction done.

    Returns:
        The motion sampled at the output period; up to the last good sample if it diverged.

    Raises:
        InputError: the machine has something that this engine does not represent.
    """
    machine, schedule, x = (
        Alone(setup),
        schedule_of(profile, step, OUTPUT_PERIOD),
        initial_state(setup, profile),
    )
    samples = np.full((len(schedule.time), len(x) + machine.layout.rates_size), np.nan)
    done, steps, over = 0, len(schedule.step), False
    while done < steps and not over:
        over = diverging_coordinate(x) is not None
        begin, done = (
            done,
            done + 1 if over else min(done + PAUSE_STEPS, steps),
        )  # one more: writes the state out of bounds
        machine.integrate(schedule, begin, done, x, samples)
        progress(done / steps)
    return trajectory_of(samples, schedule, machine.p, machine.layout)
