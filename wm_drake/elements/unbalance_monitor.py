"""Unbalance monitor: the estimate of a controller from the ripple of the drum speed.

It has no mass and no force. Own derivation (docs/theory/detect.md): the ripple u of order one has

    m r g = Z |u|,    u = a + j b

with the impedance Z of drive and drum at the speed of detection. A lock-in filter follows mean w_m
and ripple of the drum speed w, with a window that decays over N turns:

    w_m' = k (w - w_m),  a' = k (2 (w - w_m) cos phi - a),  b' = k (2 (w - w_m) sin phi - b)
    k = |w| / (2 pi N)
"""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sine_cosine, sqrt
from wm_drake.compiler.packed import SCALAR, PackedLayout
from wm_drake.elements.kind import DrumPlace, ElementKind, Output, State
from wm_drake.parameters import units as u
from wm_drake.parameters.element_kinds import DrumElement

NUMBERS = PackedLayout("UnbalanceMonitorNumbers", impedance=SCALAR, turns=SCALAR, gravity=SCALAR)
"""Z [N m s/rad], N, g [m/s^2]."""
read_numbers = NUMBERS.read

SMALLEST = 1e-12
"""Added to the square of the ripple, so that its root has a derivative at rest. [rad^2/s^2]"""


class UnbalanceMonitor(DrumElement):
    """An estimate of the unbalance, mass times radius, from the ripple of the drum speed.

    Attributes:
        impedance: Torque of the weight over the ripple of the speed, at the speed of detection; the
            page of study detect has it.
        turns: Turns of the drum over which the window decays.
    """

    impedance: Annotated[u.RotationalDamping, Field(gt=0.0)]
    turns: Annotated[u.Ratio, Field(gt=0.0)] = 2.0


@law
def unbalance_monitor(motion, state, p, at):
    """Return no force, mean speed and estimate, and the rates of the filter.

    Args:
        motion: `DrumMotion`.
        state: Mean speed and parts of the ripple. [rad/s]
        p, at: Array with the numbers of `NUMBERS`, and where they begin.
    """
    numbers = read_numbers(p, at)
    sine, cosine = sine_cosine(motion.drum_angle)
    speed, zero = motion.drum_rate, 0.0 * motion.drum_rate
    forget = abs(speed) / (2.0 * np.pi * numbers.turns)
    ripple = 2.0 * (speed - state.mean)
    rates = (
        forget * (speed - state.mean),
        forget * (ripple * cosine - state.cosine),
        forget * (ripple * sine - state.sine),
    )
    size = sqrt(state.cosine * state.cosine + state.sine * state.sine + SMALLEST)
    estimate = numbers.impedance / numbers.gravity * size
    return (zero, zero, zero, zero, zero, zero, zero), (estimate, state.mean), rates


def numbers_of(parameters: UnbalanceMonitor, ends: DrumPlace) -> Mapping[str, Any]:
    """Return the packed numbers by name."""
    return {
        "impedance": parameters.impedance,
        "turns": parameters.turns,
        "gravity": max(float(np.linalg.norm(ends.gravity)), SMALLEST),
    }


UNBALANCE_MONITOR = ElementKind(
    name="unbalance_monitor",
    parameters=UnbalanceMonitor,
    layout=NUMBERS,
    numbers=numbers_of,
    evaluate=unbalance_monitor,
    outputs=(
        Output("unbalance_estimate", "kg m", "unbalance that the controller estimates"),
        Output("mean_speed", "rad/s", "mean speed that the controller sees"),
    ),
    states=(State("mean", "rad/s"), State("cosine", "rad/s"), State("sine", "rad/s")),
    acts_at_rest=False,
    words="unbalance monitor",
    picture="points",
)
