"""Forces of the mounts on the cabinet: over time, and their peaks and RMS values over a run."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from wm_drake.elements.mount import WRENCH_SIZE, Mounts, mount_wrench_history
from wm_drake.elements.state_map import CARRIER, ELEMENT, STRETCHES
from wm_drake.engines.trajectory import Trajectory
from wm_drake.model.machine import Setup
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.element_kinds import DrumElement
from wm_drake.parameters.sections import SECTIONS
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.mount_histories import SIGNAL_SIZE, SIGNAL_SUMS, VECTOR_SIZE, VECTOR_SUMS

POINT = "the origin of W: the drum axis at drum mid-depth, as drawn"
"""The point about which moments on the cabinet are taken."""

KINDS = ("peak", "rms", "dynamic_rms")
"""What is measured of a force over a run: largest size, RMS, RMS without the mean."""


def mount_names(parameters: MachineParameters) -> tuple[str, ...]:
    """Return the mounts of a machine by their key paths in the machine file, such as springs.left.

    The order is that of `wm_drake.elements.mount.Mounts`. Elements on the drum are no mounts.
    """
    return tuple(
        section.key(name)
        for section in SECTIONS.values()
        for name, element in section.elements(parameters).items()
        if not isinstance(element, DrumElement)
    )


def mount_wrenches(setup: Setup, trajectory: Trajectory) -> FloatArray:
    """Return the wrench of each mount on the cabinet over time.

    Returns:
        (n, mounts, 6) moment about the origin of W and force, in W. [N m, N]
    """
    states, p, mounts = mounts_along(setup, trajectory)
    count = len(mount_names(setup.parameters))
    # measures read columns
    wrenches = np.empty((len(trajectory.time), count * WRENCH_SIZE), order="F")
    mount_wrench_history(states, p, mounts, wrenches)
    return wrenches.reshape(len(wrenches), count, WRENCH_SIZE)


def mounts_along(setup: Setup, trajectory: Trajectory) -> tuple[FloatArray, FloatArray, Mounts]:
    """Return what compiled functions of the mounts need along a motion.

    Returns:
        States of the mounts (n, size), their packed numbers, and the indices in both.
    """
    states = setup.elements.states()
    packed, indices = setup.elements.packed_on_tub()
    telescopes = [telescope.packed() for telescope in setup.telescopes.values()]
    ends = np.cumsum([len(packed), *map(len, telescopes)])
    begins = {**indices, "telescopes": tuple(ends[:-1])}
    others = {CARRIER: trajectory.carrier, STRETCHES: trajectory.stretches}
    if trajectory.element_states is not None:
        others[ELEMENT] = trajectory.element_states
    motion = trajectory.state, trajectory.deformation, trajectory.tubes
    return (
        states.joined(*motion, others),
        np.concatenate([packed, *telescopes]),
        setup.elements.mounts(begins, states),
    )


def sums_size(count: int) -> int:
    """Return the size of the sums that `measure_mounts_lanes` writes for some mounts."""
    return count * VECTOR_SIZE + WRENCH_SIZE * SIGNAL_SIZE + 1


def mount_measures(sums: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return peak, RMS and dynamic RMS of the force of each mount on the cabinet.

    Args:
        sums: The sums of one run, from `measure_mounts_lanes`.

    Returns:
        Three arrays (mounts,): largest absolute value; RMS; RMS of the force without its mean. [N]
        NaN without samples.
    """
    samples, count = sums[-1], (len(sums) - sums_size(0)) // VECTOR_SIZE
    return _statistics(
        (VECTOR_SUMS.unpack(sums, i * VECTOR_SIZE) for i in range(count)), float(samples)
    )


def cabinet_measures(sums: FloatArray) -> tuple[FloatArray, ...]:
    """Return peaks and RMS values of the resultant wrench on the cabinet.

    Args:
        sums: The sums of one run, from `measure_mounts_lanes`.

    Returns:
        Peak, RMS and dynamic RMS (RMS without the mean) of the force (axis,) [N], then of the
        moment about the origin of W (axis,) [N m]. NaN without samples.
    """
    first = len(sums) - sums_size(0)
    size, rms, dynamic = _statistics(
        (SIGNAL_SUMS.unpack(sums, first + k * SIGNAL_SIZE) for k in range(WRENCH_SIZE)),
        float(sums[-1]),
    )
    return size[3:], rms[3:], dynamic[3:], size[:3], rms[:3], dynamic[:3]


def _statistics(
    signals: Iterator[Any], samples: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return peak, RMS, and RMS without the mean, of signals from their sums."""
    rows = [(s.largest, s.square, s.change_square, *np.atleast_1d(s.change)) for s in signals]
    if not samples:
        undefined = np.full(len(rows), np.nan)
        return undefined, undefined, undefined
    largest, square, change_square, *change = np.array(rows).T
    variance = change_square / samples - sum(np.square(c / samples) for c in change)
    return np.sqrt(largest), np.sqrt(square / samples), np.sqrt(np.maximum(variance, 0.0))


def force_measures(history: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return peak, RMS, and RMS without the mean, of the size of vectors over time.

    It computes from a record what `mount_measures` and `cabinet_measures` compute in a batch.

    Args:
        history: (n, k, 3) vectors over time, or (n, k) signals.

    Returns:
        Three arrays (k,) in the unit of the history. NaN without samples.
    """
    vectors = history if history.ndim == 3 else history[:, :, None]
    if not len(vectors):
        undefined = np.full(vectors.shape[1], np.nan)
        return undefined, undefined, undefined
    square = np.square(vectors).sum(axis=2)
    deviation = np.square(vectors - vectors.mean(axis=0)).sum(axis=2)
    return (
        np.sqrt(square.max(axis=0)),
        np.sqrt(square.mean(axis=0)),
        np.sqrt(deviation.mean(axis=0)),
    )
