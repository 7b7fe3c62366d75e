"""Branches of a rubber bushing on the bench: stretches along a motion, and their force.

Between two samples of the motion both branches are followed in closed form: friction along its
path, a Maxwell element at a constant rate.
"""

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.laws.rubber import dahl_after_path, maxwell_after_path
from wm_drake.parameters.elements import BushingType, RubberBushingType
from wm_drake.parameters.rubber import DAHL_FIELDS, MAXWELL_FIELDS, RUBBER_AXES
from wm_drake.parameters.types import FloatArray

_TRIAL = 1e-3
"""Stretch from which the map of a period is found, which is linear. [m or rad]"""


def axis_branches(bushing: BushingType, axis: str) -> FloatArray | None:
    """Return the numbers of the branches of an axis; None if it uses none.

    Args:
        axis: One of `wm_drake.rigs.AXES`.

    Returns:
        Full force and displacement of the friction, spring and dashpot of the Maxwell element; 0, 1
        for those that are not in use. (4,) [N, m, N/m, N s/m; N m, rad, N m/rad, N m s/rad]
    """
    if not isinstance(bushing, RubberBushingType):
        return None
    k = RUBBER_AXES.index(axis)
    pairs = [
        tuple(getattr(bushing, name) for name in fields[k])
        for fields in (DAHL_FIELDS, MAXWELL_FIELDS)
    ]
    if not any(force > 0.0 for force, _ in pairs):
        return None
    return np.array([n for pair in pairs for n in (pair if pair[0] > 0.0 else (0.0, 1.0))])


def branch_forces(
    branches: FloatArray, step: FloatArray, position: FloatArray, period: int
) -> FloatArray:
    """Return the force of the branches along a motion, > 0 against the displacement (k + 1,).

    Args:
        branches: From `axis_branches`.
        step: Durations between the samples (k,). [s]
        position: Displacement or angle at the samples (k + 1,). [m; rad]
        period: Number of steps of a first period that repeats itself: the branches begin in its
            steady state; 0 to begin relaxed.
    """
    begin = np.zeros(2)
    if period:
        ends = [
            branch_stretches(step[:period], position[: period + 1], branches, np.full(2, start))[-1]
            for start in (0.0, _TRIAL)
        ]
        growth = (ends[1] - ends[0]) / _TRIAL
        lasting = 1.0 - growth < 1e-9  # a motion too small to leave a trace
        begin = np.where(lasting, 0.0, ends[0] / np.where(lasting, 1.0, 1.0 - growth))
    stretches = branch_stretches(step, position, branches, begin)
    force, displacement, stiffness, _ = branches
    return np.asarray(stretches @ [force / displacement, stiffness])


@long_running
def branch_stretches(step, position, branches, begin):  # type: ignore[no-untyped-def]
    """Return the stretches of friction and Maxwell element along a motion (k + 1, 2).

    Args:
        step, position, branches: As for `branch_forces`.
        begin: Stretches at the beginning (2,).
    """
    stretch = np.empty((len(position), 2))
    stretch[0] = begin
    for k in range(len(step)):
        path = position[k + 1] - position[k]
        stretch[k + 1, 0] = dahl_after_path(stretch[k, 0], path, branches[1])
        stretch[k + 1, 1] = maxwell_after_path(
            stretch[k, 1], path, step[k], branches[2], branches[3]
        )
    return stretch
