"""Check the options of the study of balancers, and run it."""

from typing import Any

import xarray as xr

from wm_drake.engines.compiled.step_check import check_step
from wm_drake.errors import input_error
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import load_machine
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import MASS, SPEED
from wm_drake.simulation.steps import checked_step
from wm_drake.studies.answer import Answer
from wm_drake.studies.balancer.candidates import (
    BALLS,
    KINDS,
    LAGS,
    LIQUID,
    NONE,
    WORDS,
    by_lag,
    candidate_proposal,
    is_machine,
    responses_of,
    with_lag,
    with_rings,
)
from wm_drake.studies.balancer.options import BalancerOptions
from wm_drake.studies.balancer.page import balancer_answer, load_text
from wm_drake.studies.balancer.rings import with_factors, without_rings
from wm_drake.studies.balancer.study import (
    PLACE,
    RATE,
    WINDOW,
    BalancerTrials,
    number_of_base,
    numbers_of,
)
from wm_drake.studies.executor import Executor
from wm_drake.studies.inputs import quantities_of
from wm_drake.studies.study import Task

PART = Unit("dimensionless", "percent")
MOST_VALUES = 24
"""Largest number of values of an option."""


class BalancerTask(Task):
    """The study with checked options."""

    def __init__(self, options: BalancerOptions, machine: Machine) -> None:
        """Check the rings, the values and the speeds."""
        self.options, parameters = options, machine.parameters
        self.sources = {BALLS: load_machine(options.balls), LIQUID: load_machine(options.liquid)}
        self.candidates = {
            kind: with_rings(parameters, kind, source) for kind, source in self.sources.items()
        }
        self.machine = machine
        if self.candidates[BALLS] != parameters:
            self.machine = machine = build_machine(self.candidates[BALLS])
            parameters = machine.parameters
        radii = [u.radius for load in parameters.loads.values() for u in load.unbalances]
        if not radii:
            raise input_error("has no load with a point mass, whose radius is used", key="loads")
        self.radius = radii[0]
        self.masses = _values(options.mass, MASS.unit, "--mass")
        self.places = _values(options.place, PLACE.unit, "--place", True)
        self.ball_masses = _values(options.ball_mass, PART, "--ball-mass")
        self.dampings = _values(options.damping, PART, "--damping")
        self.rate = _values(options.rate, RATE.unit, "--rate")[0]
        self.high = parameters.profile.highest_speed
        if options.high is not None:
            self.high = _values(options.high, SPEED.unit, "--to")[0]
        if self.high < 4.0 * WINDOW * (1.0 - 1e-9):  # 100 rpm, in rad/s, is rounded
            raise input_error(f"is below {SPEED.text(4.0 * WINDOW)}", where="--to")
        self.release = _values(options.release, SPEED.unit, "--release")
        if max(self.release) >= self.high:
            raise input_error(
                f"is not below the highest speed, {SPEED.unit.reading(self.high)}",
                where="--release",
            )
        step = checked_step(parameters, None)
        for ball_mass in self.ball_masses:
            for damping in self.dampings:
                changed = with_factors(parameters, ball_mass, damping)
                check_step(machine.set_up(parameters=changed), step)

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs beside the machine."""
        high, rate = SPEED.unit.reading(self.high), RATE.unit.reading(self.rate)
        rings = {kind: repr(self.candidates[kind].elements) for kind in KINDS}
        return {"run-up": f"to {high} at {rate}", **rings}

    def run(self, executor: Executor) -> Answer:
        """Run loads, rings and releases, and the machine without balls."""
        trials = BalancerTrials(self.machine, executor.simulate, self.high, self.rate, self.radius)
        loads = trials.loads(self.masses, self.places)
        without = {
            NONE: without_rings(self.machine.parameters),
            LIQUID: self.candidates[LIQUID],
        }
        curves = {
            name: trials.of(build_machine(one), loads, WORDS[name]) for name, one in without.items()
        }
        at = number_of_base(loads)
        of_balls = loads.rename(free="amplitude", level_free="level")[["amplitude", "level"]]
        of_lags = {f: self._with_lag(trials, loads.isel(run=[at]), f) for f in LAGS}
        names = [load_text(loads.isel(run=run)) for run in range(loads.sizes["run"])]
        runs = responses_of({NONE: curves[NONE], BALLS: of_balls, LIQUID: curves[LIQUID]}, names)
        loads = loads.assign(
            without_rings=curves[NONE].amplitude.isel(run=at),
            liquid=curves[LIQUID].amplitude.isel(run=at),
        )
        data = {
            "numbers": numbers_of(trials, loads, curves[NONE].isel(run=at)),
            "loads": loads,
            "rings": trials.rings(loads.isel(run=at), self.ball_masses, self.dampings),
            "releases": trials.releases(loads.isel(run=at), self.release),
            "lags": by_lag(of_lags),
            "proposal": candidate_proposal(runs, {kind: self._command(kind) for kind in KINDS}),
        }
        return balancer_answer(self.machine.parameters, data, runs)

    def _with_lag(self, trials: BalancerTrials, load: xr.Dataset, factor: float) -> xr.Dataset:
        """Return the curves of a load with rings of liquid of another lag."""
        machine = build_machine(with_lag(self.candidates[LIQUID], factor))
        return trials.of(machine, load, f"{WORDS[LIQUID]}, lag times {factor:.2g}")

    def _command(self, kind: str) -> str:
        """Return the command that runs the machine with rings of a kind; "" if there is none."""
        files = {BALLS: self.options.balls, LIQUID: self.options.liquid}
        is_source = is_machine(self.candidates[kind], self.sources[kind])
        return f"wm-drake spin --machine {files[kind]}" if is_source else ""


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
