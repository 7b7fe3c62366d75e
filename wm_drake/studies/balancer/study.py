"""What rings of balls do to amplitudes: below resonances they hurt, above they help.

Each case runs up from standstill to the highest speed at a constant rate and stays there. It runs
twice: with free balls, and with the same balls locked, evenly spread around the drum, where they
balance each other. Locked balls are point masses of the load in the machine without rings. The
amplitude in a range of speed is the largest of all sensors.

The speed from which free balls pay is the begin of the first range from which on, in every range
up to the highest speed, free balls have the smaller amplitude. A real machine that locks its balls
must release them somewhere: further runs begin at such a speed, with the balls evenly spread.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import Load, SpinProfile, Unbalance, with_values
from wm_drake.parameters.spin import Region
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share, Unit
from wm_drake.report.formatting import number
from wm_drake.report.quantity import HIDDEN, MASS, SPEED, Quantity
from wm_drake.simulation.cases import Case
from wm_drake.studies.balancer.rings import (
    balls_of,
    capacities_of,
    is_within,
    locked,
    picked_up_from,
    spread,
    with_factors,
    without_rings,
)
from wm_drake.studies.experiment import Experiment, Simulate

MEASURES = ("amplitudes in regions",)
"""Measures of `simulate_many` that the study needs."""

WINDOW = SPEED.unit.to_si(25.0)
"""Width of the ranges of speed. [rad/s]"""

HOLD = 10.0
"""Time at the highest speed; the second half of it is the level there. [s]"""

SWING, SETTLE = 2.0, 5.0
"""Time after a release in which the tub, at rest before, swings and is not measured; time at the
speed of the release before the run-up goes on. [s]"""

MM, MOMENT = Unit("m", "mm"), Unit("kg*m", "g*m")
RATE = Quantity("rate of the run-up", Unit("rad/s^2", "rpm/s"), 0)
OF_LOAD = MASS.named("mass", form="{:g}".format)
PLACE = Quantity("place", MM, 0)
UNBALANCE = Quantity("unbalance", MOMENT, 0)
CAPACITY = Quantity("first moment of all balls, side by side", MOMENT, 0)
BALL_MASS = Quantity("ball mass", Share(), form="{:g}".format)
DAMPING = Quantity("race damping", Share(), form="{:g}".format)
AMPLITUDE = Quantity("amplitude", MM, form=lambda value: number(value, 1 if value >= 1.0 else 2))
PEAK = Quantity("largest amplitude of the run-up", MM, 1)
LEVEL = Quantity("amplitude at the highest speed", MM, 2)
QUOTIENT = Quantity("worst quotient", decimals=1)
PAYS_FROM = SPEED.named("free balls pay from")
PICKED_UP = SPEED.named("drum carries the balls round from")


def run_up(high: float, rate: float) -> SpinProfile:
    """Return a run-up from standstill with a region for each range of speed and one at its end.

    Args:
        high, rate: [rad/s, rad/s^2]
    """
    edges = np.append(np.arange(WINDOW, high - 0.5 * WINDOW, WINDOW), high)
    regions = [
        Region(name=f"from_{SPEED.number(low)}", begin=low / rate, end=top / rate)
        for low, top in itertools.pairwise(edges)
    ]
    return _held([(0.0, 0.0), (high / rate, high)], regions)


def from_release(speed: float, high: float, rate: float) -> SpinProfile:
    """Return a profile that begins at the speed of a release; its regions: run-up, its end."""
    top = SETTLE + (high - speed) / rate
    return _held(
        [(0.0, speed), (SETTLE, speed), (top, high)], [Region(name="release", begin=SWING, end=top)]
    )


def _held(points: list[tuple[float, float]], regions: list[Region]) -> SpinProfile:
    """Return a profile through points (time, speed) with a hold and the region of its end."""
    end, speed = points[-1]
    last = Region(name="highest_speed", begin=end + 0.5 * HOLD, end=end + HOLD)
    times, speeds = zip(*points, (end + HOLD, speed), strict=True)
    return SpinProfile(time=times, speed=speeds, regions=(*regions, last))


def curves_of(runs: xr.Dataset, profile: SpinProfile) -> xr.Dataset:
    """Return the largest amplitude of all sensors in each range of speed, and at the end.

    Args:
        runs: Runs of the profile over `run`, as of `Experiment.over`. The profile has a region for
            each range and a last one for its end.

    Returns:
        Over `run` and the begin of each range, `from` [rad/s]: `amplitude`; over `run`: `level` at
        the highest speed [m]. Both are infinite for a run that diverged.
    """
    sizes = runs.region_amplitude.max("sensor", skipna=False).fillna(np.inf).values
    begins = [profile.speed_at(region.begin) for region in profile.regions[:-1]]
    return xr.Dataset(
        {
            "amplitude": AMPLITUDE.variable(("run", "from"), sizes[:, :-1]),
            "level": LEVEL.variable("run", sizes[:, -1]),
        },
        {"from": SPEED.named("from").variable("from", begins)},
    )


def compared(free: xr.Dataset, held: xr.Dataset) -> xr.Dataset:
    """Return free balls against locked ones.

    Args:
        free, held: As of `curves_of`, of the same number of runs.

    Returns:
        Over `run`: the largest amplitudes of the run-up, `peak_free` and `peak_locked` [m];
        `worst_quotient` of free over locked in a range, and the begin of that range, `worst`
        [rad/s]; the speed from which free balls pay, `pays_from`, NaN if they do not [rad/s];
        `level_free` and `level_locked` at the highest speed [m]; `is_larger_at_highest_speed`.
    """
    speeds, (levels, amplitudes) = (
        free["from"].values,
        ([curves[name].values for curves in (free, held)] for name in ("level", "amplitude")),
    )
    with np.errstate(invalid="ignore"):  # both runs diverged
        quotients = amplitudes[0] / amplitudes[1]
    runs, worst = np.arange(len(quotients)), np.nan_to_num(quotients, nan=-1.0).argmax(axis=1)
    sizes = [np.column_stack(pair) for pair in zip(amplitudes, levels, strict=True)]
    numbers = {
        "peak_free": (PEAK.named("largest, free"), amplitudes[0].max(axis=1)),
        "peak_locked": (PEAK.named("largest, locked"), amplitudes[1].max(axis=1)),
        "worst_quotient": (QUOTIENT, quotients[runs, worst]),
        "worst": (SPEED.named("at"), speeds[worst]),
        "pays_from": (PAYS_FROM, [pays_from(speeds, *pair) for pair in zip(*sizes, strict=True)]),
        "level_free": (LEVEL.named("highest speed, free"), levels[0]),
        "level_locked": (LEVEL.named("highest speed, locked"), levels[1]),
    }
    data = xr.Dataset({name: q.variable("run", values) for name, (q, values) in numbers.items()})
    return data.assign(is_larger_at_highest_speed=("run", ~(levels[0] < levels[1])))


def pays_from(speeds: FloatArray, free: FloatArray, held: FloatArray) -> float:
    """Return the speed from which free balls pay; NaN if they do not. [rad/s]

    Args:
        speeds: Begin of each range.
        free, held: Amplitudes in the ranges, and at the highest speed. [m]
    """
    worse = np.flatnonzero(~(free < held))
    first = worse[-1] + 1 if len(worse) else 0
    return float(speeds[first]) if first < len(speeds) else np.nan


@dataclass(frozen=True)
class BalancerTrials:
    """Runs of loads with free and with locked balls.

    Attributes:
        high, rate: Of the run-up. [rad/s, rad/s^2]
        radius: Radius at which the unbalance lies. [m]
    """

    machine: Machine
    simulate: Simulate
    high: float
    rate: float
    radius: float

    def load(self, mass: float, y: float) -> Load:
        """Return one point mass at the wall. [kg, m]"""
        return Load(unbalances=(Unbalance(mass=mass, radius=self.radius, y=y),))

    def loads(self, masses: Sequence[float], places: Sequence[float]) -> xr.Dataset:
        """Return free against locked balls over unbalance masses and places. [kg, m]

        Returns:
            As of `compared`, with `mass`, `place`, `unbalance`, and whether it `is_within_capacity`
            of the balls; `free` and `locked`, amplitudes over `from`. [kg, m, kg m, m]
        """
        points = [(mass, y, 1.0, 1.0) for mass in masses for y in places]
        capacities = capacities_of(self.machine.parameters)
        mass, y, *_ = np.array(points).T
        within = [is_within(capacities, m * self.radius, p) for m, p, *_ in points]
        names = xr.Dataset(
            {
                "mass": OF_LOAD.variable("run", mass),
                "place": PLACE.variable("run", y),
                "unbalance": UNBALANCE.variable("run", mass * self.radius),
                "is_within_capacity": ("run", within, {HIDDEN: True}),
            }
        )
        return names.merge(self._pairs(points, "loads"))

    def rings(
        self, load: xr.Dataset, ball_masses: Sequence[float], dampings: Sequence[float]
    ) -> xr.Dataset:
        """Return free against locked balls over factors on the mass of balls and on the damping.

        Args:
            load: One of `loads`.

        Returns:
            As of `compared`, with `ball_mass` and `damping`.
        """
        mass, y = load.mass.item(), load.place.item()
        points = [(mass, y, b, d) for b in ball_masses for d in dampings]
        *_, ball_mass, damping = np.array(points).T
        names = xr.Dataset(
            {
                "ball_mass": BALL_MASS.variable("run", ball_mass),
                "damping": DAMPING.variable("run", damping),
            }
        )
        return names.merge(self._pairs(points, "rings").drop_dims("from"))

    def _pairs(self, points: Sequence[tuple[float, float, float, float]], what: str) -> xr.Dataset:
        """Return free against locked balls at points, with their curves.

        Args:
            points: Mass [kg], place [m], factors on ball mass and damping.
        """
        parameters, profile = self.machine.parameters, run_up(self.high, self.rate)
        free, held = list[Case](), dict[str, Case]()
        names = []
        for mass, y, ball_mass, damping in points:
            changed = with_factors(parameters, ball_mass, damping)
            load, name = self.load(mass, y), f"{OF_LOAD.text(mass)} at {PLACE.text(y)}"
            free.append(
                Case(f"{name}, balls {ball_mass:g}, {damping:g}", load, profile, True, changed)
            )
            names.append(f"{name}, locked {ball_mass:g}")
            held[names[-1]] = Case(names[-1], locked(load, changed), profile)
        plain = build_machine(without_rings(parameters))
        curves = self.curves(self.machine, free, f"{what}, free balls")
        of_held = self.curves(plain, [*held.values()], f"{what}, locked balls")
        place = {name: at for at, name in enumerate(held)}
        of_locked = of_held.isel(run=[place[name] for name in names])
        return compared(curves, of_locked).assign(free=curves.amplitude, locked=of_locked.amplitude)

    def curves(self, machine: Machine, cases: Sequence[Case], what: str) -> xr.Dataset:
        """Return the curves of cases whose profiles have the same ranges, as of `curves_of`."""
        experiment = Experiment(machine, MEASURES, self.simulate)
        runs = experiment.over({"run": range(len(cases))}, cases, what)
        return curves_of(runs, cases[0].profile)

    def of(self, machine: Machine, loads: xr.Dataset, what: str) -> xr.Dataset:
        """Return the curves of `loads` in another machine, as of `curves_of`.

        Args:
            loads: As of `loads`.
            what: Words beside the progress bar.
        """
        profile = run_up(self.high, self.rate)
        pairs = zip(loads.mass.values.tolist(), loads.place.values.tolist(), strict=True)
        cases = [
            Case(f"{OF_LOAD.text(mass)} at {PLACE.text(y)}, {what}", self.load(mass, y), profile)
            for mass, y in pairs
        ]
        return self.curves(machine, cases, what)

    def releases(self, load: xr.Dataset, speeds: Sequence[float]) -> xr.Dataset:
        """Return runs that begin at a speed, at which balls locked before are released.

        Args:
            load: One of `loads`.
            speeds: Speeds of the releases. [rad/s]

        Returns:
            Over the runs: speed of the `release` [rad/s], largest amplitude after the first swing,
            `after_free` and still locked, `after_locked`, the same at the highest speed,
            `level_free` and `level_locked` [m], and whether it `is_larger`.
        """
        parameters, at = self.machine.parameters, self.load(load.mass.item(), load.place.item())
        angles = {
            f"elements.{name}.start_angles": spread(ring)
            for name, ring in balls_of(parameters).items()
        }
        begun = with_values(parameters, angles)
        plain = build_machine(without_rings(parameters))
        profiles = {
            SPEED.values(speed).item(): from_release(speed, self.high, self.rate)
            for speed in speeds
        }
        free = [Case(f"released {s:g}", at, p, True, begun) for s, p in profiles.items()]
        held = [Case(f"locked {s:g}", locked(at, parameters), p) for s, p in profiles.items()]
        of_free = self.curves(self.machine, free, "releases")
        return released(speeds, of_free, self.curves(plain, held, "still locked"))


def released(speeds: Sequence[float], free: xr.Dataset, held: xr.Dataset) -> xr.Dataset:
    """Return releases, as of `BalancerTrials.releases`.

    Args:
        speeds: Speeds of the releases. [rad/s]
        free, held: As of `curves_of`, with one range.
    """
    levels = [curves.level.values for curves in (free, held)]
    after = [np.maximum(c.amplitude.values[:, 0], c.level.values) for c in (free, held)]
    numbers = {
        "release": (SPEED.named("released at"), speeds),
        "after_free": (PEAK.named("largest after it, free"), after[0]),
        "after_locked": (PEAK.named("largest after it, locked"), after[1]),
        "level_free": (LEVEL.named("highest speed, free"), levels[0]),
        "level_locked": (LEVEL.named("highest speed, locked"), levels[1]),
    }
    data = xr.Dataset({name: q.variable("run", values) for name, (q, values) in numbers.items()})
    return data.assign(is_larger=("run", after[0] > after[1]))


def number_of_base(loads: xr.Dataset) -> int:
    """Return the number of the load with which rings are varied.

    It is the largest mass that the balls can balance in the middle of the places; the smallest one
    if they can balance none.
    """
    places = np.unique(loads.place)
    is_middle, mass = loads.place.values == places[len(places) // 2], loads.mass.values
    possible = is_middle & loads.is_within_capacity.values
    if possible.any():
        return int(np.where(possible, mass, -np.inf).argmax())
    return int(np.where(is_middle, mass, np.inf).argmin())


def base_of(loads: xr.Dataset) -> xr.Dataset:
    """Return the load with which rings are varied."""
    return loads.isel(run=number_of_base(loads))


def lock_below(loads: xr.Dataset) -> float:
    """Return the speed from which free balls pay with each load that they can balance. [rad/s]

    It is NaN if they do not pay with one of them, or can balance none.
    """
    speeds = loads.pays_from.values[loads.is_within_capacity.values]
    return float(speeds.max()) if len(speeds) else np.nan


def numbers_of(trials: BalancerTrials, loads: xr.Dataset, plain: xr.Dataset) -> xr.Dataset:
    """Return the run-up, what the balls can do, and the machine without rings, as single numbers.

    Args:
        loads: As of `BalancerTrials.loads`.
        plain: Run of `base_of(loads)` in the machine without rings, as of `curves_of`.

    Returns:
        `rate` [rad/s^2], `highest_speed`, `picked_up_from`, `lock_below` [rad/s], `capacity`
        [kg m], `heaviest`, the unbalance mass at the wall of that moment [kg]; `peak_without_rings`
        and `level_without_rings` [m].
    """
    parameters = trials.machine.parameters
    capacity = sum(capacities_of(parameters).values())
    numbers = {
        "rate": (RATE, trials.rate),
        "highest_speed": (SPEED.named("highest speed"), trials.high),
        "capacity": (CAPACITY, capacity),
        "heaviest": (MASS.named("mass of it at the wall", decimals=2), capacity / trials.radius),
        "picked_up_from": (PICKED_UP, picked_up_from(parameters)),
        "lock_below": (SPEED.named("lock the balls below"), lock_below(loads)),
        "peak_without_rings": (AMPLITUDE, plain.amplitude.max()),
        "level_without_rings": (AMPLITUDE, plain.level),
    }
    return xr.Dataset({name: q.variable((), value) for name, (q, value) in numbers.items()})
