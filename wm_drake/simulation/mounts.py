"""Forces of the mounts on the cabinet: over time, and their peaks and RMS values over a run."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from wm_drake.elements.motion import PLANT_STATE_SIZE
from wm_drake.elements.mount import WRENCH_SIZE, Mounts, mount_wrench_history
from wm_drake.elements.rubber import branches_of
from wm_drake.engines.compiled.mechanics import STATE_SIZE
from wm_drake.engines.compiled.packing import Layout
from wm_drake.engines.compiled.tubes import TUBES_AND_DAMPER, TUBES_STATE_SIZE
from wm_drake.engines.trajectory import Trajectory
from wm_drake.model.machine import Setup
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.mount_histories import (
    SIGNAL_SIZE,
    SIGNAL_SUMS,
    VECTOR_SIZE,
    VECTOR_SUMS,
)

POINT = "the origin of W: the drum axis at drum mid-depth, as drawn"
"""The point about which moments on the cabinet are taken."""

KINDS = ("peak", "rms", "dynamic_rms")
"""What is measured of a force over a run: largest size, RMS, RMS without the mean."""


def mount_names(parameters: MachineParameters) -> tuple[str, ...]:
    """Return the mounts of a machine by their key paths in the machine file, such as springs.left.

    The order is that of `wm_drake.elements.mount.Mounts`.
    """
    bushings = (
        name if name == "gasket" else f"bushings.{name}" for name in parameters.all_bushings()
    )
    return (
        *(f"springs.{name}" for name in parameters.springs),
        *(f"dampers.{name}" for name in parameters.dampers),
        *bushings,
        *(f"telescopic_dampers.{name}" for name in parameters.telescopic_dampers),
    )


def mounts_of(layout: Layout) -> Mounts:
    """Return the indices of the mounts in packed numbers and states of the compiled engine."""
    springs, dampers, bushings, telescopes = (
        np.array(indices, dtype=np.int64)
        for indices in (layout.springs, layout.dampers, layout.bushings, layout.telescopes)
    )
    begin = STATE_SIZE + len(dampers)
    tubes = begin + TUBES_STATE_SIZE * np.arange(len(telescopes), dtype=np.int64)
    numbers = telescopes + TUBES_AND_DAMPER.offsets["damper"]
    parts = (numbers, tubes) if len(telescopes) else (None, None)
    branches = layout.elements.branches
    return Mounts(springs, dampers, bushings, parts[0], STATE_SIZE, parts[1], branches)


def mount_wrenches(setup: Setup, trajectory: Trajectory) -> FloatArray:
    """Return the wrench of each mount on the cabinet over time.

    Args:
        setup: Machine as it was set up for the run.
        trajectory: Motion of the machine.

    Returns:
        (n, mounts, 6) moment about the origin of W and force, in W. [N m, N]
    """
    p, indices = setup.elements.packed_on_tub()
    begins, parts = [], [p]
    for telescope in setup.telescopes.values():
        begins.append(sum(map(len, parts)))
        parts.append(telescope.packed())
    dampers, size = len(indices["dampers"]), PLANT_STATE_SIZE + len(indices["dampers"])
    n, telescopes = len(trajectory.time), len(begins)
    tubes = np.arange(telescopes, dtype=np.int64) * PLANT_STATE_SIZE + size
    springs, on_dampers, bushings = (
        np.array(indices[kind], dtype=np.int64) for kind in ("springs", "dampers", "bushings")
    )
    parts_of_tubes = (np.array(begins, dtype=np.int64), tubes) if begins else (None, None)
    first = size + telescopes * PLANT_STATE_SIZE
    branches = branches_of(setup.bushings, indices["bushings"], first)
    mounts = Mounts(
        springs,
        on_dampers,
        bushings,
        parts_of_tubes[0],
        PLANT_STATE_SIZE,
        parts_of_tubes[1],
        branches,
    )
    deformation = trajectory.deformation[:, :dampers]
    states = np.hstack(
        [
            trajectory.state,
            deformation,
            trajectory.tubes.reshape(n, telescopes * PLANT_STATE_SIZE),
            trajectory.stretches,
        ]
    )
    count = sum(map(len, indices.values())) + telescopes
    wrenches = np.empty((n, count * WRENCH_SIZE), order="F")  # measures read columns
    mount_wrench_history(states, np.concatenate(parts), mounts, wrenches)
    return wrenches.reshape(n, count, WRENCH_SIZE)


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
        nothing = np.full(len(rows), np.nan)
        return nothing, nothing, nothing
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
        nothing = np.full(vectors.shape[1], np.nan)
        return nothing, nothing, nothing
    square = np.square(vectors).sum(axis=2)
    deviation = np.square(vectors - vectors.mean(axis=0)).sum(axis=2)
    return (
        np.sqrt(square.max(axis=0)),
        np.sqrt(square.mean(axis=0)),
        np.sqrt(deviation.mean(axis=0)),
    )
