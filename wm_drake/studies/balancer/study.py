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
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from wm_drake.elements.ball_ring import BallRing
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import Load, MachineParameters, SpinProfile, Unbalance, with_values
from wm_drake.parameters.spin import Region
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.balance import in_planes, rings_of
from wm_drake.simulation.cases import Case
from wm_drake.studies.executor import Executor

MEASURES = ("amplitudes in regions",)
"""Measures of `simulate_many` that the study needs."""

WINDOW = 25.0 * np.pi / 30.0
"""Width of the ranges of speed. [rad/s]"""

HOLD = 10.0
"""Time at the highest speed; the second half of it is the level there. [s]"""

SWING, SETTLE = 2.0, 5.0
"""Time after a release in which the tub, at rest before, swings and is not measured; time at the
speed of the release before the run-up goes on. [s]"""

RPM, PART = Unit("rad/s", "rpm"), Unit("dimensionless", "percent")


@dataclass(frozen=True)
class AmplitudeCurve:
    """Amplitude over drum speed in a run-up.

    Attributes:
        speeds: Begin of each range of speed. (n,) [rad/s]
        amplitudes: Largest of all sensors in each range. (n,) [m]
        level: The same at the highest speed. [m]
    """

    speeds: FloatArray
    amplitudes: FloatArray
    level: float

    @property
    def peak(self) -> float:
        """Return the largest amplitude of all ranges. [m]"""
        return float(self.amplitudes.max())

    @property
    def peak_speed(self) -> float:
        """Return the begin of its range of speed. [rad/s]"""
        return float(self.speeds[int(np.argmax(self.amplitudes))])


@dataclass(frozen=True)
class Pair:
    """One case with free and with locked balls.

    Attributes:
        mass: Unbalance mass. [kg]
        y: Its place along the drum. [m]
        free, locked: Curves.
        ball_mass, damping: Factors on the numbers of the rings.
    """

    mass: float
    y: float
    free: AmplitudeCurve
    locked: AmplitudeCurve
    ball_mass: float = 1.0
    damping: float = 1.0

    @property
    def worst(self) -> tuple[float, float]:
        """Return the largest quotient of free over locked, and its range of speed. [1, rad/s]"""
        quotients = self.free.amplitudes / self.locked.amplitudes
        at = int(np.nanargmax(quotients))
        return float(quotients[at]), float(self.free.speeds[at])

    @property
    def pays_from(self) -> float:
        """Return the speed from which free balls pay; infinity if they do not. [rad/s]"""
        free, locked = (np.append(c.amplitudes, c.level) for c in (self.free, self.locked))
        worse = np.flatnonzero(~(free < locked))
        first = worse[-1] + 1 if len(worse) else 0
        return float(self.free.speeds[first]) if first < len(self.free.speeds) else float("inf")


@dataclass(frozen=True)
class Release:
    """A run that begins at a speed, at which balls that were locked and evenly spread are released.

    Attributes:
        speed: Speed of the release. [rad/s]
        free, locked: Largest amplitude after the first swing, free and still locked. [m]
        free_level, locked_level: The same at the highest speed. [m]
    """

    speed: float
    free: float
    locked: float
    free_level: float
    locked_level: float


def run_up(high: float, rate: float) -> SpinProfile:
    """Return a run-up from standstill with a region for each range of speed and one at its end.

    Args:
        high, rate: [rad/s, rad/s^2]
    """
    edges = np.append(np.arange(WINDOW, high - 0.5 * WINDOW, WINDOW), high)
    regions = [
        Region(name=f"from_{RPM.from_si(low):.0f}", begin=low / rate, end=top / rate)
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


def without_rings(parameters: MachineParameters) -> MachineParameters:
    """Return the machine without its rings of balls."""
    others = {n: e for n, e in parameters.elements.items() if not isinstance(e, BallRing)}
    return parameters.model_copy(update={"elements": others})


def locked(load: Load, parameters: MachineParameters) -> Load:
    """Return a load with all balls of a machine as point masses, evenly spread in their races."""
    balls = [
        Unbalance(mass=r.ball_mass, radius=r.race_radius, y=r.y, phase=angle)
        for r in rings_of(parameters).values()
        for angle in spread(r)
    ]
    return load.model_copy(update={"unbalances": (*load.unbalances, *balls)})


def spread(ring: BallRing) -> tuple[float, ...]:
    """Return the angles of balls that are evenly spread in their race. [rad]"""
    return tuple((2.0 * np.pi / ring.balls * np.arange(ring.balls)).tolist())


def capacity_of(ring: BallRing) -> float:
    """Return the first moment of the balls of a ring, side by side. [kg m]"""
    touching = 2.0 * np.arcsin(0.5 * ring.ball_diameter / ring.race_radius)
    angles = touching * (np.arange(ring.balls) - 0.5 * (ring.balls - 1))
    return float(ring.ball_mass * ring.race_radius * np.cos(angles).sum())


def capacities_of(parameters: MachineParameters) -> dict[float, float]:
    """Return the first moment of the balls in the planes of the outermost rings. [kg m by m]

    The balls of a ring between them count in both, by the lever rule.
    """
    rings = rings_of(parameters).values()
    planes = np.unique([min(r.y for r in rings), max(r.y for r in rings)])
    total = np.zeros(len(planes))
    for ring in rings:
        moment = np.array([capacity_of(ring), 0.0])
        total += np.abs(in_planes(moment, ring.y * moment, planes)[:, 0])
    return dict(zip(planes.tolist(), total.tolist(), strict=True))


def is_within(capacities: dict[float, float], moment: float, y: float) -> bool:
    """Return whether the share of an unbalance in each plane is below the capacity there.

    Args:
        capacities: As of `capacities_of`.
        moment, y: Mass times radius, and its place. [kg m, m]
    """
    size, planes = np.array([moment, 0.0]), np.array(list(capacities))
    shares = np.abs(in_planes(size, y * size, planes)[:, 0])
    return bool((shares <= list(capacities.values())).all())


def picked_up_from(parameters: MachineParameters) -> float:
    """Return the speed from which the drum carries all balls round, m g R/d. [rad/s]

    Below it, a ball whose drag against the drum is d W stays in the lower half of its race, at
    rest. It is infinite without damping.
    """
    speeds = [
        r.ball_mass * parameters.gravity * r.race_radius / r.damping if r.damping else np.inf
        for r in rings_of(parameters).values()
    ]
    return float(max(speeds))


def with_factors(
    parameters: MachineParameters, ball_mass: float, damping: float
) -> MachineParameters:
    """Return a machine with factors on the mass of all balls and on the damping of all races."""
    values = {
        key: value
        for name, ring in rings_of(parameters).items()
        for key, value in (
            (f"elements.{name}.ball_mass", ball_mass * ring.ball_mass),
            (f"elements.{name}.damping", damping * ring.damping),
        )
    }
    return with_values(parameters, values)


def curve_of(table: xr.Dataset, run: int, speeds: FloatArray) -> AmplitudeCurve:
    """Return the curve of a run.

    Args:
        table: Runs with the regions of `run_up`.
        speeds: Begin of each range. [rad/s]
    """
    sizes = table.region_amplitude.values[run].max(axis=-1)
    failed = table.diverged.values[run] != ""
    sizes = np.where(failed | np.isnan(sizes), np.inf, sizes)
    return AmplitudeCurve(speeds, sizes[:-1], float(sizes[-1]))


@dataclass(frozen=True)
class BalancerTrials:
    """Runs of loads with free and with locked balls.

    Attributes:
        high, rate: Of the run-up. [rad/s, rad/s^2]
        radius: Radius at which the unbalance lies. [m]
    """

    machine: Machine
    executor: Executor
    high: float
    rate: float
    radius: float

    def load(self, mass: float, y: float) -> Load:
        """Return one point mass at the wall. [kg, m]"""
        return Load(unbalances=(Unbalance(mass=mass, radius=self.radius, y=y),))

    def pairs(self, points: Sequence[tuple[float, float, float, float]], what: str) -> list[Pair]:
        """Return the pair of each point: mass [kg], place [m], factors on ball mass and damping."""
        parameters, profile = self.machine.parameters, run_up(self.high, self.rate)
        free, held = list[Case](), dict[str, Case]()
        names = []
        for mass, y, ball_mass, damping in points:
            changed = with_factors(parameters, ball_mass, damping)
            load, name = self.load(mass, y), f"{mass:g} kg at {1e3 * y:g} mm"
            free.append(
                Case(f"{name}, balls {ball_mass:g}, {damping:g}", load, profile, True, changed)
            )
            names.append(f"{name}, locked {ball_mass:g}")
            held[names[-1]] = Case(names[-1], locked(load, changed), profile)
        plain = build_machine(without_rings(parameters))
        of_free = self.executor.simulate(self.machine, MEASURES, free, f"{what}, free balls")
        of_held = self.executor.simulate(plain, MEASURES, held.values(), f"{what}, locked balls")
        speeds = np.array([profile.speed_at(region.begin) for region in profile.regions[:-1]])
        place = {name: at for at, name in enumerate(held)}
        return [
            Pair(
                mass,
                y,
                curve_of(of_free, run, speeds),
                curve_of(of_held, place[names[run]], speeds),
                ball_mass,
                damping,
            )
            for run, (mass, y, ball_mass, damping) in enumerate(points)
        ]

    def plain(self, mass: float, y: float) -> AmplitudeCurve:
        """Return the curve of a load in the machine without rings. [kg, m]"""
        profile = run_up(self.high, self.rate)
        machine = build_machine(without_rings(self.machine.parameters))
        cases = [Case("without rings", self.load(mass, y), profile)]
        table = self.executor.simulate(machine, MEASURES, cases, "without rings")
        speeds = np.array([profile.speed_at(region.begin) for region in profile.regions[:-1]])
        return curve_of(table, 0, speeds)

    def releases(self, mass: float, y: float, speeds: Iterable[float]) -> list[Release]:
        """Return the releases of a load at speeds. [kg, m, rad/s]"""
        parameters, load, speeds = self.machine.parameters, self.load(mass, y), list(speeds)
        angles = {
            f"elements.{name}.start_angles": spread(ring)
            for name, ring in rings_of(parameters).items()
        }
        begun = with_values(parameters, angles)
        plain = build_machine(without_rings(parameters))
        profiles = [from_release(speed, self.high, self.rate) for speed in speeds]
        free = [
            Case(f"released {RPM.from_si(s):g}", load, p, True, begun)
            for s, p in zip(speeds, profiles, strict=True)
        ]
        held = [
            Case(f"locked {RPM.from_si(s):g}", locked(load, parameters), p)
            for s, p in zip(speeds, profiles, strict=True)
        ]
        tables = (
            self.executor.simulate(self.machine, MEASURES, free, "releases"),
            self.executor.simulate(plain, MEASURES, held, "still locked"),
        )
        sizes = [table.region_amplitude.values.max(axis=-1) for table in tables]
        return [
            Release(s, float(a.max()), float(b.max()), float(a[-1]), float(b[-1]))
            for s, a, b in zip(speeds, *sizes, strict=True)
        ]
