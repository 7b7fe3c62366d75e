"""Steady force loops of components on the bench, and their measures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.rigs.bench import Bench, BushingBench, DamperBench, Harmonic
from wm_drake.rigs.forces import damper_tensions, harmonic_loads
from wm_drake.rigs.heavy_sponge import steady_tensions
from wm_drake.rigs.integration import PHASE, steady_states


@dataclass(frozen=True, eq=False)
class ForceLoop:
    """One steady period of a component on the bench, equally spaced, without its closing point.

    Attributes:
        motion: Motion of the driven end.
        rotates: Whether motion and force are angle and moment.
        time: From the passage through the middle, upwards (n,). [s]
        displacement, velocity: Motion of the driven end (n,). [m, m/s; rad, rad/s]
        force: On the component at the driven end, > 0 in the direction of the displacement (n,).
            [N; N m]
    """

    motion: Harmonic
    rotates: bool
    time: FloatArray
    displacement: FloatArray
    velocity: FloatArray
    force: FloatArray


@dataclass(frozen=True)
class LoopMeasures:
    """Measures of a loop; moments and angles in place of forces and displacements in a rotation.

    Attributes:
        peak_force: Largest absolute force. [N; N m]
        energy_per_cycle: Work done on the component in a period, the area of the loop. [J]
        equivalent_damping: Damping of the dashpot that takes the same energy, E / (pi 2 pi f A^2).
            [N s/m; N m s/rad]
        dynamic_stiffness: Amplitude of the fundamental of the force by that of the displacement.
            [N/m; N m/rad]
        loss_angle: By which the fundamental of the force leads that of the displacement. [rad]
    """

    peak_force: float
    energy_per_cycle: float
    equivalent_damping: float
    dynamic_stiffness: float
    loss_angle: float


def force_loop(bench: Bench, motion: Harmonic) -> ForceLoop:
    """Return the steady loop of a component under harmonic motion, after its transient has decayed.

    Raises:
        NotSteadyError: The transient does not decay.
        InputError: The motion is wider than the jig arm is long.
    """
    return force_loops(bench, [motion])[0]


def force_loops(bench: Bench, motions: Sequence[Harmonic]) -> list[ForceLoop]:
    """Return the steady loops of a component under several motions, integrated side by side."""
    phase = PHASE[:-1]
    if isinstance(bench, BushingBench):
        forces = [harmonic_loads(bench, m, phase, *_driven(bench, m, phase)) for m in motions]
    elif bench.sponge_mass > 0.0:
        forces = [steady_tensions(bench, m) for m in motions]
    else:
        amplitude = np.array([m.amplitude for m in motions])
        omega = np.array([m.angular_frequency for m in motions])
        packed = np.tile(bench.packed, (len(motions), 1))
        deformation = steady_deformations(bench, packed, amplitude, omega)[:, :-1]
        forces = [
            damper_tensions(_driven(bench, m, phase)[1], deformations, bench.packed)
            for m, deformations in zip(motions, deformation, strict=True)
        ]
    return [_loop(bench, m, force) for m, force in zip(motions, forces, strict=True)]


def steady_deformations(
    bench: DamperBench, packed: FloatArray, amplitude: FloatArray, omega: FloatArray
) -> FloatArray:
    """Return the deformation of massless sponges over a steady period, at `PHASE`. [m]

    Args:
        bench: A damper of the same law; the deformation is zero if the law has no sponge.
        packed: Law number and parameters of each (r, s).
        amplitude, omega: Amplitude and angular frequency of each motion (r,). [m, rad/s]
    """
    if bench.state_size != 1:
        return np.zeros((len(packed), len(PHASE)))
    return np.asarray(steady_states(packed, amplitude, omega).T * amplitude[:, None])


def measures_of(loop: ForceLoop) -> LoopMeasures:
    """Return the measures of a loop."""
    period = 1.0 / loop.motion.frequency
    energy = float(np.mean(loop.force * loop.velocity)) * period
    fundamental = np.fft.rfft(loop.force)[1] / np.fft.rfft(loop.displacement)[1]
    return LoopMeasures(
        peak_force=float(np.max(np.abs(loop.force))),
        energy_per_cycle=energy,
        equivalent_damping=energy
        / (np.pi * loop.motion.angular_frequency * loop.motion.amplitude**2),
        dynamic_stiffness=float(np.abs(fundamental)),
        loss_angle=float(np.angle(fundamental)),
    )


def _driven(bench: Bench, motion: Harmonic, phase: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return displacement and velocity of the driven end."""
    if isinstance(bench, BushingBench) and bench.arm and motion.amplitude >= bench.arm:
        raise input_error(
            f"is {motion.amplitude:g} m; allowed is less than the arm, {bench.arm:g} m",
            key="amplitude",
        )
    speed = motion.amplitude * motion.angular_frequency
    velocity = speed * np.cos(phase)
    # at its reversals it stands still, where dry friction is zero
    velocity[np.abs(velocity) < 1e-12 * speed] = 0.0
    return motion.amplitude * np.sin(phase), velocity


def _loop(bench: Bench, motion: Harmonic, force: FloatArray) -> ForceLoop:
    displacement, velocity = _driven(bench, motion, PHASE[:-1])
    time = PHASE[:-1] / motion.angular_frequency
    if isinstance(bench, DamperBench) and bench.driven_mass > 0.0:
        force = force - bench.driven_mass * motion.angular_frequency**2 * displacement
    return ForceLoop(motion, bench.rotates, time, displacement, velocity, np.asarray(force))
