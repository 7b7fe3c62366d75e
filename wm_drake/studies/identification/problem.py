"""Identification problem of a component: its rig computes the measured forces."""

from collections.abc import Sequence

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.rigs import Bench, BushingBench, DamperBench, NotSteadyError
from wm_drake.rigs.forces import bushing_loads, damper_tensions
from wm_drake.rigs.integration import PHASE
from wm_drake.rigs.loops import steady_deformations
from wm_drake.rigs.measured import MeasuredMotion
from wm_drake.studies.fitting import FitProblem, Measurement
from wm_drake.studies.identification.models import ComponentModel

MOST_ROWS = 32
"""Benches that are integrated side by side. More of them share hardly more work, and all step as
the stiffest one needs: at scattered points 256 rows took three times as long."""


def fit_problem(model: ComponentModel, motions: Sequence[MeasuredMotion]) -> FitProblem:
    """Return the problem of finding a component's unknowns from measured loops.

    Offset and drift of each measured force are taken out.
    """
    measurements = tuple(
        Measurement(measured.loop.name, measured.loop.force, measured.baseline, correlated=True)
        for measured in motions
    )
    return FitProblem(
        model.unknowns, measurements, lambda points: computed_forces(model, motions, points)
    )


def computed_forces(
    model: ComponentModel, motions: Sequence[MeasuredMotion], points: FloatArray
) -> FloatArray:
    """Return the forces at the samples of all loops, at each point (k, n); NaN if not steady."""
    benches = [model.bench(point) for point in points]
    if isinstance(benches[0], BushingBench):
        return np.array(
            [np.concatenate([_bushing_forces(bench, m) for m in motions]) for bench in benches]
        )
    at_once = max(1, MOST_ROWS // len(motions))
    parts = [
        _damper_forces(benches[k : k + at_once], motions) for k in range(0, len(benches), at_once)
    ]
    return np.concatenate(parts)


def _bushing_forces(bench: Bench, measured: MeasuredMotion) -> FloatArray:
    assert isinstance(bench, BushingBench)
    amplitude, omega = measured.motion.amplitude, measured.motion.angular_frequency
    return bushing_loads(
        bench, amplitude * np.sin(measured.phase), amplitude * omega * np.cos(measured.phase)
    )


def _damper_forces(benches: Sequence[Bench], motions: Sequence[MeasuredMotion]) -> FloatArray:
    dampers = [bench for bench in benches if isinstance(bench, DamperBench)]
    amplitude = np.array([m.motion.amplitude for _ in dampers for m in motions])
    omega = np.array([m.motion.angular_frequency for _ in dampers for m in motions])
    packed = np.array([bench.packed for bench in dampers for _ in motions])
    try:
        deformation = steady_deformations(dampers[0], packed, amplitude, omega)
    except NotSteadyError:
        if len(dampers) == 1:
            return np.full((1, sum(len(m.phase) for m in motions)), np.nan)
        half = len(dampers) // 2
        return np.concatenate(
            [_damper_forces(dampers[:half], motions), _damper_forces(dampers[half:], motions)]
        )
    rows = []
    for index, bench in enumerate(dampers):
        forces = []
        for number, m in enumerate(motions):
            own = np.interp(m.phase, PHASE, deformation[index * len(motions) + number])
            speed = m.motion.amplitude * m.motion.angular_frequency
            forces.append(damper_tensions(speed * np.cos(m.phase), own, bench.packed))
        rows.append(np.concatenate(forces))
    return np.array(rows)
