"""Identification problem of a component: its rig computes the measured forces."""

from collections.abc import Sequence

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.rigs import Bench, BushingBench, DamperBench, NotSteadyError
from wm_drake.rigs.forces import damper_tensions, harmonic_loads
from wm_drake.rigs.heavy_sponge import steady_tensions
from wm_drake.rigs.integration import PHASE
from wm_drake.rigs.loops import steady_deformations
from wm_drake.rigs.measured import HarmonicMotion, MeasuredMotion, RecordedMotion, sines_of
from wm_drake.rigs.recorded import recorded_forces
from wm_drake.studies.fitting.problem import FitProblem, Measurement
from wm_drake.studies.identify.models import ComponentModel
from wm_drake.studies.rig.quantities import loop_quantities
from wm_drake.studies.rig.study import FREQUENCY

MOST_ROWS = 32
"""Benches that are integrated side by side. More of them share hardly more work, and all step as
the stiffest one needs: at scattered points 256 rows took three times as long."""


def fit_problem(model: ComponentModel, motions: Sequence[MeasuredMotion]) -> FitProblem:
    """Return the problem of finding a component's unknowns from measured loops.

    Offset and drift of each measured force are taken out.
    """
    measurements = tuple(
        Measurement(measured.loop.name, measured.loop.force, measured.baseline, errors="correlated")
        for measured in motions
    )
    return FitProblem(
        model.unknowns, measurements, lambda points: computed_forces(model, motions, points)
    )


def computed_forces(
    model: ComponentModel, motions: Sequence[MeasuredMotion], points: FloatArray
) -> FloatArray:
    """Return the forces at the samples of all tests, at each point (k, n); NaN if not steady."""
    benches = [model.bench(point) for point in points]
    ends = np.cumsum([len(m.position) for m in motions])
    forces = np.empty((len(points), ends[-1]))
    sines = sines_of(motions)
    if sines:
        steady = _steady_forces(benches, sines)
        begin = 0
    for motion, end in zip(motions, ends, strict=True):
        where = slice(end - len(motion.position), end)
        if isinstance(motion, HarmonicMotion):
            forces[:, where] = steady[:, begin : begin + len(motion.position)]
            begin += len(motion.position)
        elif isinstance(motion, RecordedMotion):
            forces[:, where] = [recorded_forces(bench, motion) for bench in benches]
    return forces


def _steady_forces(benches: Sequence[Bench], motions: Sequence[HarmonicMotion]) -> FloatArray:
    """Return the forces of steady loops at their samples, of each bench (k, n)."""
    if isinstance(benches[0], BushingBench):
        return np.array(
            [
                np.concatenate(
                    [harmonic_loads(bench, m.motion, m.phase, m.position, m.rate) for m in motions]
                )
                for bench in benches
                if isinstance(bench, BushingBench)
            ]
        )
    if isinstance(benches[0], DamperBench) and benches[0].sponge_mass > 0.0:
        return np.array([_heavy_sponge_forces(bench, motions) for bench in benches])
    at_once = max(1, MOST_ROWS // len(motions))
    parts = [
        _damper_forces(benches[k : k + at_once], motions) for k in range(0, len(benches), at_once)
    ]
    return np.concatenate(parts)


def _heavy_sponge_forces(bench: Bench, motions: Sequence[HarmonicMotion]) -> FloatArray:
    """Return the forces of a damper whose sponge has a mass at all samples; NaN if not steady."""
    assert isinstance(bench, DamperBench)
    forces = []
    for m in motions:
        try:
            loop = steady_tensions(bench, m.motion)
        except NotSteadyError:
            return np.full(sum(len(each.phase) for each in motions), np.nan)
        forces.append(np.interp(m.phase, PHASE, np.append(loop, loop[0])))
    return np.concatenate(forces)


def _damper_forces(benches: Sequence[Bench], motions: Sequence[HarmonicMotion]) -> FloatArray:
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
            sponge = np.interp(m.phase, PHASE, deformation[index * len(motions) + number])
            forces.append(damper_tensions(m.rate, sponge, bench.packed))
        rows.append(np.concatenate(forces))
    return np.array(rows)


def motion_sentences(motions: Sequence[MeasuredMotion]) -> list[str]:
    """Return a sentence for each test whose own displacement drives the law, on its smoothing."""
    sentences = []
    for m in motions:
        if not isinstance(m, RecordedMotion):
            continue
        motion = loop_quantities(m.loop.rotates)["displacement"]
        smoothing = (
            f"smoothed by a cubic spline that halves a motion at {FREQUENCY.text(m.cutoff)}; "
            f"{motion.text(m.noise)} (root mean square) is taken out as noise"
            if np.isfinite(m.cutoff)
            else "interpolated by a cubic spline without smoothing"
        )
        begin = (
            "a sponge begins in the steady state of the first period"
            if m.repeats
            else "a sponge begins without deformation"
        )
        sentences.append(
            f"{m.loop.name} is no sine: its displacement drives the law as recorded, {smoothing}; "
            f"{begin}."
        )
    return sentences
