"""Forces that the bench measures, from motion and state of the component, by the laws of the machine."""

import numpy as np

from wm_drake.compiler.compilation import long_running
from wm_drake.laws.bushing import bushing_force
from wm_drake.laws.damper import damper_response
from wm_drake.parameters.types import FloatArray
from wm_drake.rigs.bench import AXES, BushingBench


@long_running
def damper_tensions(rate, deformation, packed):  # type: ignore[no-untyped-def]
    """Tension of a damper at rates of elongation (n,) and deformations of its sponge (n,). [m/s, m -> N]"""
    force = np.empty(len(rate))
    for i in range(len(rate)):
        tension, _ = damper_response(int(packed[0]), rate[i], deformation[i], packed, 1)
        force[i] = tension
    return force


@long_running
def bushing_reactions(position, rate, packed, axis):  # type: ignore[no-untyped-def]
    """Force or moment that moves a bushing along or about one axis (n,); the law's own resists. [m, m/s; rad, rad/s]"""
    force = np.empty(len(rate))
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
            f, _ = bushing_force(d, d_rate, zero, zero, packed, 0)
        else:
            _, f = bushing_force(zero, zero, d, d_rate, packed, 0)
        force[i] = -(f[0] + f[1] + f[2])  # the others are zero
    return force


def bushing_loads(bench: BushingBench, position: FloatArray, rate: FloatArray) -> FloatArray:
    """Force or moment at the driven end of a bushing (n,).

    Through a jig arm of radius R the actuator moves by d = R sin(theta), and the moment M asks for the force
    F = M / (R cos(theta)), which does the same work. [A] section 2.2 reckons M = F R, which differs by less than 0.1 % up
    to d = 4 mm at R = 100 mm.

    Args:
        bench: The bushing.
        position, rate: Of the driven end. [m, m/s; rad, rad/s if it rotates]
    """
    axis = AXES.index(bench.axis)
    if not bench.arm:
        return np.asarray(bushing_reactions(position, rate, bench.packed, axis))
    angle = np.arcsin(position / bench.arm)
    lever = bench.arm * np.cos(angle)
    return np.asarray(bushing_reactions(angle, rate / lever, bench.packed, axis) / lever)
