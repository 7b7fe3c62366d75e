"""Holds at a speed of detection, and the spin in ranges of speed, as profiles with regions."""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.spin import Region
from wm_drake.parameters.types import FloatArray
from wm_drake.report.figure import nice_step
from wm_drake.report.quantity import SPEED

OF_PROFILE = "profile"
"""Speed of detection that stands for the first hold of the spin profile."""

DISTRIBUTION = SPEED.unit.to_si(90.0)
"""Speed of detection of a profile without a hold: laundry at 0.24 m lies at the wall with 2.2 g."""

SHORTEST = 2.0
"""Shortest constant part of a profile that is a hold. [s]"""

MOST_LIMITS = 16
"""Largest number of speed limits."""


@dataclass(frozen=True)
class Hold:
    """A run to the speed of detection, and windows at its end.

    Attributes:
        speed: Wanted speed. [rad/s]
        profile: Run that ends with the hold.
        turns: Length of the window that the user chose.
    """

    speed: float
    ramp: SpinProfile
    length: float
    turns: int

    @property
    def turn(self) -> float:
        """Return the duration of a turn. [s]"""
        return 2.0 * np.pi / self.speed

    @property
    def windows(self) -> tuple[int, ...]:
        """Return the windows that fit into the hold: half, the chosen one, twice. [turns]"""
        fits = (n for n in (self.turns // 2, self.turns, 2 * self.turns) if n)
        return tuple(n for n in fits if n * self.turn <= self.length)

    @cached_property
    def profile(self) -> SpinProfile:
        """Return the profile with a region for each part of the windows, the last part last."""
        end = self.ramp.time[-1]
        edges = [end - n * self.turn for n in reversed((0, *self.windows))]
        regions = tuple(
            Region(name=f"part_{k}", begin=max(0.0, begin), end=stop)
            for k, (begin, stop) in enumerate(itertools.pairwise(edges), start=1)
        )
        return self.ramp.model_copy(update={"regions": regions})

    def weights(self, turns: int) -> FloatArray:
        """Return the share of each region in a window. (regions,)"""
        lengths = np.diff((0, *self.windows))[::-1]
        first = len(lengths) - 1 - self.windows.index(turns)
        return np.where(np.arange(len(lengths)) >= first, lengths, 0) / turns


def hold_of(text: str | None, profile: SpinProfile, duration: float, turns: int) -> Hold:
    """Return a hold.

    Args:
        text: A speed, `profile` for the first hold of the profile, or None for that one and, if the
            profile has none, for `DISTRIBUTION`.
        profile: Profile of the spin.
        duration: Duration of a hold at a speed. [s]

    Raises:
        InputError: there is no such hold, or it is shorter than the window.
    """
    first = first_hold(profile) if text in (None, OF_PROFILE) else None
    if text == OF_PROFILE and first is None:
        raise input_error(
            f"the spin profile has no hold of {SHORTEST:g} s below its highest speed, "
            f"{SPEED.text(profile.highest_speed)}; give a speed, such as '90 rpm'",
            where="--at",
        )
    if first is not None:
        begin, end = profile.time[first], profile.time[first + 1]
        ramp, length = profile.until(end).model_copy(update={"regions": ()}), end - begin
    else:
        speed = DISTRIBUTION if text in (None, OF_PROFILE) else _speed(str(text), profile)
        ramp, length = ramp_to(speed, profile, duration), duration
    hold = Hold(ramp.speed[-1], ramp, length, turns)
    if turns not in hold.windows:
        raise input_error(
            f"the hold at {SPEED.text(hold.speed)} has {length / hold.turn:.1f} turns, fewer than "
            f"--turns {turns}; choose fewer, or a longer --hold",
            where="--at",
        )
    return hold


def _speed(text: str, profile: SpinProfile) -> float:
    try:
        speed = SPEED.unit.number(text)
    except ValueError as error:
        raise input_error(str(error), where="--at") from None
    if not 0.0 < speed < profile.highest_speed:
        raise input_error(
            f"there is no hold at {SPEED.text(speed)}; allowed are speeds above 0 and below the "
            f"highest of the profile, {SPEED.text(profile.highest_speed)}",
            where="--at",
        )
    return speed


def first_hold(profile: SpinProfile) -> int | None:
    """Return the number of the point at which the first hold below the top begins, or None."""
    time, speed = np.array(profile.time), np.array(profile.speed)
    is_hold = (np.diff(speed) == 0.0) & (np.diff(time) >= SHORTEST)
    places = np.flatnonzero(is_hold & (speed[:-1] > 0.0) & (speed[:-1] < profile.highest_speed))
    return int(places[0]) if len(places) else None


def ramp_to(speed: float, profile: SpinProfile, duration: float) -> SpinProfile:
    """Return a ramp as steep as the first one of a profile, and a hold. [rad/s, s]"""
    time, speeds = np.array(profile.time), np.array(profile.speed)
    rising = np.flatnonzero(np.diff(speeds) > 0.0)
    rate = np.diff(speeds)[rising[0]] / np.diff(time)[rising[0]] if len(rising) else speed / 10.0
    top = (speed - speeds[0]) / rate if speeds[0] < speed else 0.0
    points = [(0.0, float(speeds[0])), (top, speed), (top + duration, speed)]
    times, held = zip(*(points if top else [(0.0, speed), (duration, speed)]), strict=True)
    return profile.model_copy(update={"time": times, "speed": held, "regions": ()})


def in_ranges(profile: SpinProfile) -> tuple[SpinProfile, FloatArray]:
    """Return a profile with a region up to each speed limit, and the limits. (regions,) [rad/s]

    A region begins when the wanted speed exceeds a limit for the first time.
    """
    highest = SPEED.unit.from_si(profile.highest_speed)
    step = SPEED.unit.to_si(nice_step(highest, MOST_LIMITS))
    count = int(np.ceil(profile.highest_speed / step * (1.0 - 1e-9)))
    limits = np.minimum(step * np.arange(1, count + 1), profile.highest_speed)
    time, speed = np.array(profile.time), np.maximum.accumulate(profile.speed)
    last = np.append(True, np.diff(speed) > 0.0)  # where a plateau begins, its end is no crossing
    crossed = np.interp(limits[:-1], speed[last], time[last])
    begins = np.concatenate([[0.0], crossed, [profile.duration]])
    kept = np.append(np.diff(begins)[:-1] > 0.0, True)
    regions = tuple(
        Region(name=f"to_{number}", begin=begin, end=end)
        for number, (begin, end) in enumerate(itertools.pairwise(begins))
        if end > begin
    )
    return profile.model_copy(update={"regions": regions}), limits[kept]
