"""How a run is integrated: the integrator and its step, chosen from the machine and its profile.

The multistep integrator (`wm_drake.engines.compiled.multistep`) takes one derivative a step, the
Runge-Kutta scheme four. The midpoint rule (`wm_drake.engines.compiled.midpoint`) takes one, and
follows the tubes of telescopic dampers. A sampled controller needs the Runge-Kutta scheme: its
torque jumps. A choice depends on the parameters and the profile of a run only, never on other runs
or on its load.
"""

import functools
import math
from dataclasses import dataclass, field, replace

import numpy as np

from wm_drake.engines.compiled.linear import is_followed
from wm_drake.engines.compiled.midpoint_check import (
    midpoint_follows,
    relaxation_matrices,
    tube_jacobians,
)
from wm_drake.engines.compiled.multistep import STEPS_BEFORE
from wm_drake.engines.compiled.packing import Layout
from wm_drake.engines.compiled.step_check import check_sample_time, check_step, linearised
from wm_drake.engines.schedule import Schedule
from wm_drake.errors import input_error
from wm_drake.model.machine import Setup
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.machine import Integrator
from wm_drake.parameters.types import FloatArray

MARGIN = 1.15
"""The linearised machine must be stable at a step this much longer."""

LARGEST_TURN = 0.2
"""Largest turn of the drum in a step with one derivative. [rad] The unbalance drives the tub with
the frequency of the drum. Two integrations then have a relative error of 0.3 turn^4: 0.05 %."""

ACROSS_JUMPS = 1e-5
"""Half a step of the central differences: above the slowest speed of the states, so that friction
that jumps at zero is steep. One derivative a step does not resolve it. [m, rad, m/s, rad/s]"""

LONGEST_STEP = 2.5e-3
"""Longest step with one derivative that "auto" takes. [s] Peaks hold to 0.1 % with it; the edges of
friction laws, and not stability, make longer ones inaccurate (docs/theory/integrator.md)."""

LARGEST_TURN_OF_MIDPOINT = 0.04
"""Largest turn of the drum in a step of the midpoint rule. [rad] At a constant speed its relative
error is turn^2 / 24: 0.007 %."""

LONGEST_STEP_OF_MIDPOINT = 2.5e-4
"""Longest step of the midpoint rule that "auto" takes. [s] Peaks hold to 0.1 % with it; the sponges
of MSTV dampers make twice as long ones inaccurate (docs/theory/integrator.md)."""

PIECES = (1, 2)
"""Into how many steps with one derivative a step may be divided: four take as long as one step of
the Runge-Kutta scheme."""

SHORTER = (1.0, 1.5, 2.0)
"""How much shorter steps of the multistep integrator may be than the step; they end at samples."""


@dataclass(frozen=True)
class Stepping:
    """How a run is integrated.

    Attributes:
        integrator: "multistep", "midpoint" or "runge_kutta".
        step: Step size. [s]
        tubes: Jacobian at rest of the tubes of each telescopic damper, for the midpoint rule; none
            for the others. (dampers, 14, 14) [1/s]
    """

    integrator: Integrator
    step: float
    tubes: FloatArray = field(default_factory=lambda: np.empty(0), compare=False)

    @functools.cached_property
    def relaxation(self) -> FloatArray:
        """Return the matrices R of the midpoint rule, one after the other."""
        return relaxation_matrices(self.tubes, self.step).ravel()

    def one_derivative(self, schedule: Schedule) -> np.ndarray:
        """Return which steps of a schedule take one derivative. (n,) bool

        After a corner of the profile, the Runge-Kutta scheme starts the multistep integrator.
        """
        return (schedule.alike >= STEPS_BEFORE) & (self.integrator == "multistep")

    def halved(self, times: int) -> "Stepping":
        """Return the same with the step halved some times: what is stable stays so."""
        return replace(self, step=self.step / 2**times)


def choose_stepping(
    setup: Setup,
    packed: FloatArray,
    layout: Layout,
    profile: SpinProfile,
    step: float,
    integrator: Integrator = "auto",
) -> Stepping:
    """Return how to integrate the runs of a machine through a profile.

    Args:
        setup: The machine as it is set up, without load.
        packed, layout: From `pack`.
        profile: Spin profile of the runs.
        step: Largest step; shorter where the samples of a fast profile are closer. [s]
        integrator: "multistep", "midpoint" or "runge_kutta" for steps of this size; "auto" for the
            midpoint rule with telescopic dampers if a step of 0.25 ms or half of it suits it, else
            for the multistep integrator if the step, or one down to half of it, suits it, else for
            the Runge-Kutta scheme.

    Raises:
        InputError: the step is too long for the integrator, or the sample time of a controller for
            the drum.
    """
    period = profile.sample_period(setup.parameters.output_period)
    step = min(step, period / np.ceil(period / step * (1.0 - 1e-9)))  # steps end at samples
    moving = setup.cabinet or setup.motor or layout.rubber
    only_tubes = bool(setup.telescopes) and not moving
    if integrator == "midpoint" and not only_tubes:
        raise input_error(
            "'midpoint' needs telescopic dampers, a cabinet at rest, a prescribed drum speed and "
            "bushings without branches; allowed are 'auto', 'multistep' or 'runge_kutta'",
            key="integrator",
        )
    if integrator != "runge_kutta" and not layout.control_period:
        linear = linearised(setup, packed, layout, ACROSS_JUMPS)
        fastest = profile.highest_speed
        if only_tubes and integrator != "multistep":
            midpoint = _midpoint(setup, layout, linear.jacobians, fastest, step, integrator)
            if midpoint:
                return midpoint
        if integrator != "midpoint":
            for length in _lengths(step, integrator, period):
                turn = fastest * length
                if turn <= LARGEST_TURN and is_followed(
                    linear.jacobians,
                    linear.kinds,
                    MARGIN * length,
                    linear.cabinet,
                    may_grow=any(kind.on_drum for kind in layout.kinds),
                ):
                    return Stepping("multistep", length)
    check_step(setup, step)
    check_sample_time(setup)
    if integrator in ("multistep", "midpoint"):
        raise input_error(
            f"'{integrator}' does not follow this machine at {1e3 * step:g} ms; "
            "allowed are 'auto', 'runge_kutta' or a shorter step",
            key="integrator",
        )
    return Stepping("runge_kutta", step)


def _midpoint(
    setup: Setup,
    layout: Layout,
    jacobians: FloatArray,
    fastest: float,
    step: float,
    integrator: Integrator,
) -> Stepping | None:
    """Return how to integrate with the midpoint rule; None if it does not suit the machine.

    Args:
        setup, layout, step, integrator: As for `choose_stepping`.
        jacobians: Of the machine, from `linearised`.
        fastest: Highest speed of the drum. [rad/s]
    """
    lengths = [step]
    if integrator == "auto":
        fewest = int(np.ceil(step / LONGEST_STEP_OF_MIDPOINT * (1.0 - 1e-9)))
        lengths = [step / (n * fewest) for n in PIECES]
    for length in lengths:
        if fastest * length > LARGEST_TURN_OF_MIDPOINT:
            continue
        if midpoint_follows(setup, layout, jacobians, MARGIN * length):
            return Stepping("midpoint", length, tube_jacobians(setup, layout, jacobians))
    return None


def _lengths(step: float, integrator: Integrator, period: float) -> list[float]:
    """Return the steps that may be taken with one derivative, each a part of the period. [s]"""
    if integrator != "auto":
        return [step]
    first = round(period / step)
    lengths = [step * (first / math.ceil(first * n)) for n in SHORTER]
    return [length for length in lengths if length < LONGEST_STEP * (1.0 + 1e-9)]
