"""Stability of periodic motions by Floquet multipliers.

A small departure from a periodic motion obeys d' = J(t) d, with the slopes J of the compiled
right-hand side along the motion. Over a period it becomes Phi d; the eigenvalues of Phi are the
Floquet multipliers. The motion is stable if all are inside the unit circle. Phi is the product of
the steps of the midpoint rule, which is stable for every motion that decays:

    Phi = product of (1 - h/2 J_j)^-1 (1 + h/2 J_j) = product of 2 (1 - h/2 J_j)^-1 - 1

The trapezoidal rule has the same factors in another order, and the same eigenvalues.
"""

import numpy as np

from wm_drake.parameters.types import FloatArray

UNIT_CIRCLE = 1e-3
"""How far outside the unit circle a multiplier may be of a motion that is called stable.

The spin of a damper's tube has the multiplier 1 exactly; rounding moves it."""


def floquet_multipliers(slopes: FloatArray, period: float) -> FloatArray:
    """Return the Floquet multipliers of a periodic motion. (n,) complex

    Args:
        slopes: (samples, n, n) slopes of the time derivative at equal distances over the period,
            by each number k.
        period: [s]
    """
    samples, n, _ = slopes.shape
    matrices = np.eye(n) - (0.5 * period / samples) * slopes.transpose(0, 2, 1)
    steps = 2.0 * np.linalg.inv(matrices)
    steps -= np.eye(n)
    while len(steps) > 1:
        if len(steps) % 2:
            steps = np.concatenate([steps[:-2], (steps[-1] @ steps[-2])[None]])
        else:
            steps = steps[1::2] @ steps[0::2]
    return np.linalg.eigvals(steps[0])


def is_stable(multipliers: FloatArray) -> bool:
    """Return whether a motion with these multipliers is stable."""
    return bool(np.max(np.abs(multipliers)) < 1.0 + UNIT_CIRCLE)
