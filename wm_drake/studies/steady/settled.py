"""Periodic motion by time integration: the compiled engine at constant speed until it has settled.

It is an independent check of harmonic balance, and a first guess where no better one is at hand.
"""

import numpy as np

from wm_drake.elements.state_map import CARRIER, ELEMENT, STRETCHES
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.engines.trajectory import Trajectory
from wm_drake.model.machine import Setup
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.steady.balance import HarmonicBalance

REVOLUTIONS = 60
"""Default number of drum revolutions until the motion has settled."""


def settled_trajectory(
    setup: Setup, speed: float, samples: int, revolutions: int = REVOLUTIONS
) -> Trajectory:
    """Return the last drum revolution of a run at constant speed that starts at rest.

    Args:
        setup: Machine at rest with its load.
        speed: Of the drum. [rad/s]
        samples: Number of samples of a revolution.
        revolutions: Number of drum revolutions.

    Returns:
        `samples` samples at equal distances; none if the run diverged.
    """
    period = 2.0 * np.pi / speed
    profile = SpinProfile(time=(0.0, revolutions * period), speed=(speed, speed))
    step = min(setup.parameters.step, period / samples)
    run = run_compiled(setup, profile, step, lambda fraction: None, period / samples)
    kept = slice(-samples - 1, -1) if run.divergence is None else slice(0, 0)
    return run.part(kept)


def settled_coefficients(balance: HarmonicBalance, setup: Setup, speed: float) -> FloatArray:
    """Return the Fourier coefficients of the settled motion; NaN if the run diverged."""
    run = settled_trajectory(setup, speed, balance.series.samples)
    if run.divergence is not None:
        return np.full((balance.series.size, balance.size), np.nan)
    return coefficients_of(balance, run)


def coefficients_of(balance: HarmonicBalance, run: Trajectory) -> FloatArray:
    """Return the Fourier coefficients of a revolution at the samples of a balance."""
    others = {CARRIER: run.carrier, STRETCHES: run.stretches}
    if run.element_states is not None:
        others[ELEMENT] = run.element_states
    layout = balance.derivative.layout
    states = layout.states.joined(run.state, run.deformation, run.tubes, others)
    return np.asarray(balance.series.analysis @ states[:, balance.derivative.free])
