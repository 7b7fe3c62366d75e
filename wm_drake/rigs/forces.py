"""Forces on the bench, from motion and state of the component, with the laws of the machine."""

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.elements.bushing import read_bushing_law
from wm_drake.elements.damper_law import damper_response
from wm_drake.laws.bushing import bushing_force
from wm_drake.parameters.types import FloatArray
from wm_drake.rigs.bench import AXES, BushingBench, Harmonic
from wm_drake.rigs.integration import PHASE
from wm_drake.rigs.measured import RecordedMotion
from wm_drake.rigs.rubber import branch_forces


@long_running
def damper_tensions(rate, deformation, packed):  # type: ignore[no-untyped-def]
    """Return the tension of a damper (n,). [N]

    Args:
        rate: Rates of elongation. [m/s]
        deformation: Deformations of the sponge. [m]
        packed: Packed law.
    """
    force = np.empty(len(rate))
    for i in range(len(rate)):
        tension, _ = damper_response(rate[i], deformation[i], packed, 0)
        force[i] = tension
    return force


@long_running
def bushing_reactions(position, rate, packed, axis):  # type: ignore[no-untyped-def]
    """Return the force or moment that moves a bushing along or about one axis (n,). [N; N m]

    Args:
        position, rate: Displacement or angle, and its rate (n,). [m, m/s; rad, rad/s]
        packed: Packed law.
        axis: Index in `AXES`.
    """
    force, bushing = np.empty(len(rate)), read_bushing_law(packed, 0)
    zero = (0.0, 0.0, 0.0)
    for i in range(len(rate)):
        x, v = position[i], rate[i]
        if axis % 3 == 0:
            d, d_rate = (x, 0.0, 0.0), (v, 0.0, 0.0)
        elif axis % 3 == 1:
            d, d_rate = (0.0, x, 0.0), (0.0, v, 0.0)
        else:
            d, d_rate = (0.0, 0.0, x), (0.0, 0.0, v)
        if axis < 3:
            f, _ = bushing_force(d, d_rate, zero, zero, bushing)
        else:
            _, f = bushing_force(zero, zero, d, d_rate, bushing)
        force[i] = -(f[0] + f[1] + f[2])  # the others are zero
    return force


def harmonic_loads(
    bench: BushingBench, motion: Harmonic, phase: FloatArray, position: FloatArray, rate: FloatArray
) -> FloatArray:
    """Return force or moment at the driven end of a bushing under steady harmonic motion (n,).

    Args:
        phase: Phases, from 0 to 2 pi (n,). [rad]
        position, rate: Motion at these phases. [m, m/s; rad, rad/s if it rotates]
    """
    force = bushing_loads(bench, position, rate)
    if bench.branches is None:
        return force
    step = np.diff(PHASE) / motion.angular_frequency
    of_branches = _of_branches(bench, step, motion.amplitude * np.sin(PHASE), len(step))
    return force + np.interp(phase, PHASE, of_branches)


def recorded_loads(bench: BushingBench, motion: RecordedMotion) -> FloatArray:
    """Return force or moment at the samples of a recorded motion (n,). [N; N m]

    Branches begin relaxed, or in the steady state of the first period of a motion that repeats.
    """
    force = bushing_loads(bench, motion.position, motion.rate)
    if bench.branches is None:
        return force
    paths = 0.5 * motion.step * (motion.step_rate[1:] + motion.step_rate[:-1])
    place = np.append(0.0, np.cumsum(paths))
    place += motion.position[0] - place[motion.samples[0]]
    return force + _of_branches(bench, motion.step, place, motion.repeats)[motion.samples]


def ramped_loads(bench: BushingBench, time: FloatArray, position: FloatArray) -> FloatArray:
    """Return force or moment at the samples of a motion of straight pieces (n,). [N; N m]

    Branches begin relaxed.
    """
    step = np.diff(time)
    rate = np.append(0.0, np.diff(position) / step)
    force = bushing_loads(bench, position, rate)
    return force if bench.branches is None else force + _of_branches(bench, step, position, 0)


def _of_branches(
    bench: BushingBench, step: FloatArray, position: FloatArray, period: int
) -> FloatArray:
    """Return the force of the branches at the driven end (k + 1,); see `branch_forces`."""
    assert bench.branches is not None
    if not bench.arm:
        return branch_forces(bench.branches, step, position, period)
    angle = np.arcsin(position / bench.arm)
    moment = branch_forces(bench.branches, step, angle, period)
    return np.asarray(moment / (bench.arm * np.cos(angle)))


def bushing_loads(bench: BushingBench, position: FloatArray, rate: FloatArray) -> FloatArray:
    """Return force or moment at the driven end of a bushing without its branches (n,). [N; N m]

    Through a jig arm of radius R the actuator moves by d = R sin(theta), and the moment M needs the
    force F = M / (R cos(theta)), which does the same work. [A] section 2.2 takes M = F R, which
    differs by less than 0.1 % up to d = 4 mm at R = 100 mm.

    Args:
        position, rate: Motion of the driven end. [m, m/s; rad, rad/s if it rotates]
    """
    axis = AXES.index(bench.axis)
    if not bench.arm:
        return np.asarray(bushing_reactions(position, rate, bench.packed, axis))
    angle = np.arcsin(position / bench.arm)
    lever = bench.arm * np.cos(angle)
    return np.asarray(bushing_reactions(angle, rate / lever, bench.packed, axis) / lever)
