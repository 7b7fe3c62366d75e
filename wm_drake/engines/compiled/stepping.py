"""How a run is integrated: the integrator and its step, chosen from the machine and its profile.

The multistep integrator (`wm_drake.engines.compiled.multistep`) takes one derivative a step, the
Runge-Kutta scheme four. A sampled controller needs the Runge-Kutta scheme: its torque jumps.
A choice depends on the parameters and the profile of a run only, never on
other runs or on its load.
"""

from dataclasses import dataclass

import numpy as np

from wm_drake.engines.compiled.linear import is_followed
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
friction laws, and not stability, make longer ones inaccurate (docs/performance.md)."""

PIECES = (1, 2)
"""Into how many steps with one derivative a step may be divided: four take as long as one step of
the Runge-Kutta scheme."""


@dataclass(frozen=True)
class Stepping:
    """How a run is integrated.

    Attributes:
        integrator: "multistep" or "runge_kutta".
        step: Step size. [s]
    """

    integrator: Integrator
    step: float

    def one_derivative(self, schedule: Schedule) -> np.ndarray:
        """Return which steps of a schedule take one derivative. (n,) bool

        After a corner of the profile, the Runge-Kutta scheme starts the multistep integrator.
        """
        return (schedule.alike >= STEPS_BEFORE) & (self.integrator == "multistep")


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
        step: Largest step. [s]
        integrator: "multistep" or "runge_kutta" for steps of this size; "auto" for the multistep
            integrator if the step, or half of it, suits it, else the Runge-Kutta scheme.

    Raises:
        InputError: the step is too long for the integrator, or the sample time of a controller for
            the drum.
    """
    if integrator != "runge_kutta" and not layout.control_period:
        jacobians, internal = linearised(setup, packed, layout, ACROSS_JUMPS)
        fastest = max(abs(speed) for speed in profile.speed)
        lengths = [step]
        if integrator == "auto":
            lengths = [step / n for n in PIECES if step / n < LONGEST_STEP * (1.0 + 1e-9)]
        for length in lengths:
            turn = fastest * length
            if turn <= LARGEST_TURN and is_followed(jacobians, internal, MARGIN * length):
                return Stepping("multistep", length)
    check_step(setup, step)
    check_sample_time(setup)
    if integrator == "multistep":
        raise input_error(
            f"'multistep' does not follow this machine at {1e3 * step:g} ms; "
            "allowed are 'auto', 'runge_kutta' or a shorter step",
            key="integrator",
        )
    return Stepping("runge_kutta", step)
