"""What the compiled loops sampled -> the motion that an engine hands over."""

import numpy as np

from wm_drake.kernel.histories import torque_history
from wm_drake.kernel.packing import Layout
from wm_drake.parameters.elements import FloatArray
from wm_drake.schedule import Schedule
from wm_drake.trajectory import Trajectory, ended_where_it_diverged


def trajectory_of(samples: FloatArray, schedule: Schedule, p: FloatArray, layout: Layout) -> Trajectory:
    """Motion up to the last good sample, with the motor's torque.

    Args:
        samples: (rows, size + `Layout.rates_size`) as `kernel.integration` writes them; NaN behind the end of a run.
        schedule: The steps.
        p, layout: From `pack`.
    """
    states, rates = np.split(samples, [-layout.rates_size], axis=1)
    motion, deformation, tubes, carrier = layout.parts(states)
    torque = np.empty((len(samples), 1))
    drum_acceleration = schedule.acceleration[schedule.row >= 0, None]
    torque_history(_of_what_carries_the_drum(motion, carrier), rates[:, -6:], drum_acceleration, p, torque)
    return ended_where_it_diverged(Trajectory(schedule.time, motion, deformation, torque[:, 0], rates[:, :6], tubes, carrier))


def _of_what_carries_the_drum(motion: FloatArray, carrier: FloatArray) -> FloatArray:
    """Motion of the tub or, in a bearing that gives, of the drum's carrier, with that of the drum."""
    if not carrier.shape[1]:
        return motion
    return np.column_stack([carrier[:, :6], motion[:, 6], carrier[:, 6:], motion[:, 13]])
