"""Loops as a bench would record them, from a component whose numbers are known."""

import numpy as np

from wm_drake.parameters import MeasuredLoop
from wm_drake.rigs import Harmonic, force_loops
from wm_drake.rigs.measured import measured_motion


def motions_mm(*pairs):
    return [Harmonic(frequency, 1e-3 * amplitude) for frequency, amplitude in pairs]


def measured(bench, motions, *, noise=0.0, seed=0, samples=150, periods=3.2):
    """Return loops as a bench records them: uneven times, any start, offset and drift of both instruments."""
    place, rng, found = np.random.default_rng(5), np.random.default_rng(seed), []
    for k, (motion, loop) in enumerate(zip(motions, force_loops(bench, motions), strict=True)):
        t = np.sort(place.uniform(0.0, periods / motion.frequency, samples))
        phase = 2.0 * np.pi * motion.frequency * t + 1.0
        force = np.interp(
            phase % (2.0 * np.pi),
            np.append(loop.time * motion.angular_frequency, 2.0 * np.pi),
            np.append(loop.force, loop.force[0]),
        )
        largest = np.max(np.abs(force))
        force = force + largest * (0.1 - 0.05 * t / t[-1] + noise * rng.normal(size=samples))
        displacement = motion.amplitude * (np.sin(phase) + 0.3 + 0.2 * t / t[-1])
        found.append(
            measured_motion(
                MeasuredLoop(f"loop {k}", f"{k}.csv", t + 7.0, displacement, force, loop.rotates)
            )
        )
    return found
