"""Quasi-static tests: a component goes to both ends of its way at a constant rate, and back."""

import itertools

import numpy as np

from wm_drake.parameters import MeasuredLoop
from wm_drake.rigs.bench import BushingBench
from wm_drake.rigs.forces import ramped_loads

SAMPLES = 200
"""Samples of the way from the rest position to an end."""

TURNS = (0.0, 1.0, -1.0, 1.0, 0.0)
"""Rest position, ends and reversals of a test, by the amplitude: each side is loaded and unloaded
where friction has developed."""


def static_test(
    bench: BushingBench, amplitude: float, rate: float, preload: float = 0.0
) -> MeasuredLoop:
    """Return a quasi-static test, as a laboratory would record it ([B] section 3.1.1).

    Args:
        bench: Component on the bench.
        amplitude: Way of the driven end to each side, > 0. [m; rad]
        rate: Its rate, > 0. [m/s; rad/s]
        preload: Displacement from the free shape at which the component is clamped. The test
            begins there, counts its displacement from there, and has the force of the free shape
            as its zero. Branches of rubber have relaxed. [m; rad]
    """
    ways = [int(SAMPLES * abs(b - a)) for a, b in itertools.pairwise(TURNS)]
    turns = np.cumsum([0, *ways])
    sample = np.arange(turns[-1] + 1)
    time = sample * (amplitude / SAMPLES / rate)
    displacement = amplitude * np.interp(sample, turns, TURNS)
    force = ramped_loads(bench, time, preload + displacement)
    return MeasuredLoop("static", "static", time, displacement, force, bench.rotates)
