"""Check the options of the balancer study, and run it."""

from typing import Any

from wm_drake.engines.compiled.step_check import check_step
from wm_drake.errors import input_error
from wm_drake.model.machine import Machine
from wm_drake.parameters.units import Unit
from wm_drake.simulation.balance import rings_of
from wm_drake.simulation.steps import checked_step
from wm_drake.studies.balancer.options import BalancerOptions
from wm_drake.studies.balancer.page import BalancerResult
from wm_drake.studies.balancer.study import (
    PART,
    RPM,
    WINDOW,
    BalancerTrials,
    capacities_of,
    is_within,
    with_factors,
)
from wm_drake.studies.executor import Executor
from wm_drake.studies.inputs import quantities_of
from wm_drake.studies.study import Result, Task

MOST_VALUES = 24
"""Largest number of values of an option."""


class BalancerTask(Task):
    """The study with checked options."""

    def __init__(self, options: BalancerOptions, machine: Machine) -> None:
        """Check the rings, the values and the speeds."""
        self.options, self.machine = options, machine
        parameters = machine.parameters
        self.rings = rings_of(parameters)
        if not self.rings:
            raise input_error(
                f"machine '{parameters.name}' has no element of kind ball_ring; allowed is a "
                "machine with rings of balls, such as the shipped machine 'ball_rings'",
                key="elements",
            )
        radii = [u.radius for load in parameters.loads.values() for u in load.unbalances]
        if not radii:
            raise input_error("has no load with a point mass, whose radius is used", key="loads")
        self.radius = radii[0]
        self.masses = _values(options.mass, Unit("kg", "kg"), "--mass")
        self.places = _values(options.place, Unit("m", "mm"), "--place", True)
        self.ball_masses = _values(options.ball_mass, PART, "--ball-mass")
        self.dampings = _values(options.damping, PART, "--damping")
        self.rate = _values(options.rate, Unit("rad/s^2", "rpm/s"), "--rate")[0]
        self.high = max(parameters.profile.speed)
        if options.high is not None:
            self.high = _values(options.high, RPM, "--to")[0]
        if self.high < 4.0 * WINDOW * (1.0 - 1e-9):  # 100 rpm, in rad/s, is rounded
            raise input_error(f"is below {RPM.from_si(4.0 * WINDOW):g} rpm", where="--to")
        self.release = _values(options.release, RPM, "--release")
        if max(self.release) >= self.high:
            raise input_error(
                f"is not below the highest speed, {RPM.from_si(self.high):g} rpm", where="--release"
            )
        step = checked_step(parameters, None)
        for ball_mass in self.ball_masses:
            for damping in self.dampings:
                changed = with_factors(parameters, ball_mass, damping)
                check_step(machine.set_up(parameters=changed), step)

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs beside the machine."""
        high, rate = RPM.from_si(self.high), RPM.from_si(self.rate)
        return {"run-up": f"to {high:g} rpm at {rate:g} rpm/s"}

    def run(self, executor: Executor) -> Result:
        """Run loads, rings and releases."""
        parameters = self.machine.parameters
        trials = BalancerTrials(self.machine, executor, self.high, self.rate, self.radius)
        points = [(mass, y, 1.0, 1.0) for mass in self.masses for y in self.places]
        loads = trials.pairs(points, "loads")
        capacities = capacities_of(parameters)
        y = self.places[len(self.places) // 2]
        possible = [m for m in self.masses if is_within(capacities, m * self.radius, y)]
        mass = max(possible, default=min(self.masses))  # of the load with which rings are varied
        base = next(pair for pair in loads if (pair.mass, pair.y) == (mass, y))
        grid = [(mass, y, b, d) for b in self.ball_masses for d in self.dampings]
        rings = trials.pairs(grid, "rings")
        releases = trials.releases(mass, y, self.release)
        plain = trials.plain(mass, y)
        return BalancerResult(
            parameters,
            self.rate,
            self.high,
            tuple(loads),
            base,
            tuple(rings),
            tuple(releases),
            plain,
            capacities,
            self.radius,
            executor.runs,
        )


def _values(text: str, unit: Unit, option: str, is_place: bool = False) -> tuple[float, ...]:
    """Return different values of an option, rising.

    Args:
        text, unit, option: As for `quantities_of`.
        is_place: Whether the values may be 0 and below.
    """
    values = tuple(sorted(set(quantities_of(text, unit, option))))
    if len(values) > MOST_VALUES:
        raise input_error(f"has {len(values)} values; allowed are {MOST_VALUES}", where=option)
    if not is_place and not values[0] > 0.0:
        raise input_error(f"'{text}' is not above 0", where=option)
    return values
