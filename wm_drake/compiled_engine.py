"""The fast engine: the whole machine as one compiled function, at fixed steps of the classical Runge-Kutta scheme."""

from collections.abc import Callable

import numpy as np

from wm_drake.kernel.alone import Alone
from wm_drake.kernel.packing import initial_state
from wm_drake.kernel.schedule import schedule_of
from wm_drake.machine import OUTPUT_PERIOD, Setup
from wm_drake.parameters import SpinProfile
from wm_drake.trajectory import Trajectory, diverging_coordinate, ended_where_it_diverged

PAUSE_STEPS = 2000
"""Steps between looks at the state and reports of progress: some milliseconds."""


def run_compiled(setup: Setup, profile: SpinProfile, step: float, progress: Callable[[float], None]) -> Trajectory:
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
    machine, schedule, x = Alone(setup), schedule_of(profile, step, OUTPUT_PERIOD), initial_state(setup, profile)
    samples = np.full((len(schedule.time), len(x)), np.nan)
    samples[0] = x
    done = 0
    while done < len(schedule.step) and diverging_coordinate(x) is None:
        begin, done = done, min(done + PAUSE_STEPS, len(schedule.step))
        machine.integrate(schedule, begin, done, x, samples)
        progress(done / len(schedule.step))
    rates = machine.rates(schedule, samples)
    motion, deformation, tubes, carrier = machine.layout.parts(samples)
    return ended_where_it_diverged(Trajectory(schedule.time, motion, deformation, rates[:, 6], rates[:, :6], tubes, carrier))
