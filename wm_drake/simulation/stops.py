"""Hits of the tub against its stops, from the motion of the tub."""

import numpy as np

from wm_drake.compiler.compilation import generic
from wm_drake.elements.motion import tub_motion
from wm_drake.elements.stop import NUMBERS, STOP, stop_approach
from wm_drake.model.machine import Setup
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray


def stop_names(parameters: MachineParameters) -> tuple[str, ...]:
    """Return the names of the stops of a machine."""
    elements = parameters.elements.items()
    return tuple(name for name, element in elements if element.kind == STOP.name)


def approaches(setup: Setup, states: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how the tub moves towards each stop.

    Args:
        setup: The machine.
        states: (n, >= 14) states of tub and drum, seen from the cabinet.

    Returns:
        Compression of each stop, below 0 where the tub does not touch it, and its rate.
        (n, stops) [m, m/s]
    """
    names = stop_names(setup.parameters)
    answer = np.empty((2, len(states), len(names)))
    motion = generic(tub_motion)(states.T) if names else None
    for column, name in enumerate(names):
        numbers = NUMBERS.unpack(setup.elements.others[name].packed_numbers)
        answer[:, :, column] = generic(stop_approach)(motion, numbers)[2:]
    return answer[0], answer[1]


def hits_of(
    compression: FloatArray, rate: FloatArray, period: float
) -> tuple[FloatArray, FloatArray]:
    """Return number of hits and largest velocity of a hit of each stop.

    A hit begins between a sample without contact and one with it. The velocity at the face follows
    from the last sample before it, at d < 0 with the rate v, and the acceleration a since the
    sample before that one:

        w^2 = v^2 - 2 a d      own derivation, constant acceleration

    A contact that is shorter than the time between samples may be missed.

    Args:
        compression, rate: (n, stops), as of `approaches`. [m, m/s]
        period: Time between samples. [s]

    Returns:
        Numbers (stops,), and velocities (stops,) [m/s], 0 without a hit. NaN without samples.
    """
    if not len(compression):
        return (np.full(compression.shape[1], np.nan),) * 2
    touches = compression > 0.0
    begins = touches[1:] & ~touches[:-1]
    acceleration = np.zeros_like(begins, dtype=float)
    acceleration[1:] = np.where(touches[:-2], 0.0, np.diff(rate[:-1], axis=0) / period)
    square = np.square(rate[:-1]) - 2.0 * acceleration * compression[:-1]
    velocity = np.sqrt(np.maximum(square, 0.0))
    largest = np.max(velocity, axis=0, where=begins, initial=0.0)
    return begins.sum(axis=0).astype(float), largest
