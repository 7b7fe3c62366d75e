"""Spin profiles and loads of the drum."""

from typing import Annotated, Any

import numpy as np
from pydantic import (
    Field,
    GetJsonSchemaHandler,
    StringConstraints,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic_core import CoreSchema

from wm_drake.errors import shortened
from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.types import FloatArray


class Water(Frozen):
    """Water in a mass of laundry, which leaves it while the drum spins.

    Water above the share that a speed leaves goes with a time constant. None comes back.

    Attributes:
        share: Share of the mass that is water at the start.
        speed: Drum speeds, in either direction, rising from 0.
        left: Share of this water that is left after a long time at each speed, never rising.
        time_constant: Time constant with which the water leaves.
    """

    share: Annotated[float, u.Fraction(), Field(gt=0.0, lt=1.0)]
    speed: u.Speeds
    left: u.Ratios
    time_constant: Annotated[u.Duration, Field(gt=0.0)]

    @model_validator(mode="after")
    def _left_falls_with_speed(self) -> "Water":
        if len(self.speed) != len(self.left) or len(self.speed) < 2:
            raise ValueError(
                "needs as many values of left as of speed, at least two; "
                f"has {len(self.left)} and {len(self.speed)}"
            )
        if self.speed[0] != 0.0 or np.any(np.diff(self.speed) <= 0.0):
            raise ValueError("speed must rise from point to point and begin at 0")
        if np.any(np.diff(self.left) > 0.0) or not 0.0 <= self.left[-1] <= self.left[0] <= 1.0:
            raise ValueError("left must be between 0 and 1 and never rise from point to point")
        return self


class Unbalance(Frozen):
    """A point mass that is fixed to the drum at (r sin(phase), y, r cos(phase)) in D.

    At phase 0 and drum angle 0 the mass is at the top.

    Attributes:
        mass: Its mass.
        radius: Distance r from the drum axis.
        y: Position along the drum axis, to the rear, from mid-depth of the drum.
        phase: Angle from the top, positive as the drum turns.
        water: Water in the mass, which leaves while the drum spins; None if the mass stays.
    """

    mass: Annotated[u.Mass, Field(ge=0.0)]
    radius: Annotated[u.Length, Field(ge=0.0)]
    y: u.Length
    phase: u.Angle = 0.0
    water: Water | None = None

    def position(self) -> tuple[float, float, float]:
        """Return the position in D. [m]"""
        return self.radius * np.sin(self.phase), self.y, self.radius * np.cos(self.phase)


class StaticUnbalance(Frozen):
    """Static unbalance of a rotor: its centre of mass lies beside the drum axis (ISO 21940).

    It adds no mass to the drum.

    Attributes:
        moment: Mass times distance from the drum axis.
        y: Position along the drum axis, to the rear, from mid-depth of the drum.
        phase: Angle from the top, positive as the drum turns.
    """

    moment: Annotated[u.StaticMoment, Field(ge=0.0)]
    y: u.Length = 0.0
    phase: u.Angle = 0.0

    def vector(self) -> tuple[float, float, float]:
        """Return the first moment of mass in D. [kg m]"""
        return self.moment * np.sin(self.phase), 0.0, self.moment * np.cos(self.phase)


class CoupleUnbalance(Frozen):
    """Couple unbalance of a rotor: a principal axis of inertia is inclined to the drum axis.

    It adds no mass to the drum. Two masses m at the radius r and at y and -y, on opposite sides of
    the drum axis, have the moment 2 m r y.

    Attributes:
        moment: Sum of mass times radius times y.
        phase: Angle from the top of the side on which mass lies to the rear.
    """

    moment: Annotated[u.CoupleMoment, Field(ge=0.0)]
    phase: u.Angle = 0.0

    def products(self) -> tuple[float, float]:
        """Return the sums of m x y and of m z y in D. [kg m^2]"""
        return self.moment * np.sin(self.phase), self.moment * np.cos(self.phase)


class Load(Frozen):
    """The laundry, modelled as point masses in the drum, or the unbalance of a rotor.

    Attributes:
        unbalances: The masses.
        static, couple: Unbalance without mass, as balancing machines measure it.
    """

    unbalances: tuple[Unbalance, ...] = ()
    static: StaticUnbalance | None = None
    couple: CoupleUnbalance | None = None

    @model_validator(mode="after")
    def _has_an_unbalance(self) -> "Load":
        if not (self.model_fields_set & {"unbalances", "static", "couple"}):
            raise ValueError("needs unbalances, static or couple; no unbalance is `unbalances: []`")
        return self

    @property
    def mass(self) -> float:
        """Mass of the laundry, with all its water. [kg]"""
        return sum(unbalance.mass for unbalance in self.unbalances)

    @property
    def wet(self) -> tuple[int, ...]:
        """Numbers of the masses whose water leaves."""
        return tuple(k for k, unbalance in enumerate(self.unbalances) if unbalance.water)

    def masses(self, left: FloatArray) -> FloatArray:
        """Return the masses with the water that is left.

        Args:
            left: Share of the water of each wet mass. (..., wet)

        Returns:
            (..., masses) [kg]
        """
        masses = np.tile([unbalance.mass for unbalance in self.unbalances], (*left.shape[:-1], 1))
        for column, k in enumerate(self.wet):
            water = self.unbalances[k].water
            assert water is not None  # it is wet
            masses[..., k] *= 1.0 - water.share * (1.0 - left[..., column])
        return np.asarray(masses)

    def with_masses(self, masses: FloatArray) -> "Load":
        """Return the load with other masses (masses,), which stay. [kg]"""
        pairs = zip(self.unbalances, masses.tolist(), strict=True)
        each = tuple(u.model_copy(update={"mass": mass, "water": None}) for u, mass in pairs)
        return self.model_copy(update={"unbalances": each})


class _Step(Frozen):
    """A step of a spin profile: a ramp, a constant speed until a time, or a staircase of holds.

    Attributes:
        ramp_to: Speed at the end of a ramp.
        rate: Acceleration of a ramp, and between the holds of a staircase.
        hold_until: Time until which the speed is held.
        stairs_to: Speed of the last hold of a staircase, which goes up or down to it.
        stair: Difference of speed between two holds. The last one may be smaller.
        settle: Time after the ramp to a hold before the measurement begins.
        measure: Duration of the measurement at each hold. It is a region of the profile, `up_1020`
            or `down_1020` at 1020 rpm.
    """

    ramp_to: u.Speed | None = None
    rate: Annotated[u.AngularAcceleration, Field(gt=0.0)] | None = None
    hold_until: u.Duration | None = None
    stairs_to: u.Speed | None = None
    stair: Annotated[u.Speed, Field(gt=0.0)] | None = None
    settle: Annotated[u.Duration, Field(ge=0.0)] | None = None
    measure: Annotated[u.Duration, Field(gt=0.0)] | None = None

    @model_validator(mode="after")
    def _one_form(self) -> "_Step":
        given = {name for name, value in self if value is not None}
        stairs = {"stairs_to", "stair", "rate", "settle", "measure"}
        if given not in ({"ramp_to", "rate"}, {"hold_until"}, stairs):
            raise ValueError(
                "a step is {ramp_to: SPEED, rate: SPEED PER TIME}, {hold_until: TIME} or "
                "{stairs_to: SPEED, stair: SPEED, rate: SPEED PER TIME, settle: TIME, measure: "
                "TIME}"
            )
        return self

    def after(
        self, time: float, speed: float
    ) -> tuple[list[tuple[float, float]], list[tuple[str, float, float]]]:
        """Return the points behind the beginning of this step, and name, begin, end of regions.

        Args:
            time, speed: Where the step begins. [s, rad/s]
        """
        if self.hold_until is not None:
            return [(self.hold_until, speed)], []
        assert self.rate is not None  # _one_form has checked this
        if self.ramp_to is not None:
            return [(time + abs(self.ramp_to - speed) / self.rate, self.ramp_to)], []
        assert self.stairs_to is not None
        assert self.stair is not None
        assert self.settle is not None
        assert self.measure is not None
        points, regions = list[tuple[float, float]](), list[tuple[str, float, float]]()
        count = int(np.ceil(abs(self.stairs_to - speed) / self.stair * (1.0 - 1e-9)))
        sign = 1.0 if self.stairs_to > speed else -1.0
        for number in range(1, count + 1):
            target = speed + sign * number * self.stair if number < count else self.stairs_to
            before = points[-1][1] if points else speed
            time += abs(target - before) / self.rate
            begin, end = time + self.settle, time + self.settle + self.measure
            points += [(time, target), (end, target)]
            rpm = f"{target * 30.0 / np.pi:.6g}".replace(".", "_")
            regions.append((f"{'up' if sign > 0.0 else 'down'}_{rpm}", begin, end))
            time = end
        return points, regions


class Region(Frozen):
    """A named time interval of a spin profile, such as R1 to R8 in [A] section 4.1.

    The RMS of vibrations is computed over each region.

    Attributes:
        name: Name in tables and pictures.
        begin, end: Times at which it begins and ends.
    """

    name: Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_-]*$")]
    begin: Annotated[u.Duration, Field(ge=0.0)]
    end: u.Duration


SAMPLES_OF_TURN = 30
"""Smallest number of samples of a run in a turn of the drum at its highest speed.

A peak of order one then exceeds the nearest sample by up to 1 - cos(pi / 30) = 0.55 % of it."""


class SpinProfile(Frozen):
    """Drum speed over time, linear between the points.

    A file may give it as `steps` that start from standstill. The drum follows the profile exactly;
    the motor torque has no limit ([B] section 3).

    Attributes:
        time: Rising times from 0 on. In place of time and speed a file may have
            `steps: [{ramp_to: 400 rpm, rate: 7 rpm/s}, {hold_until: 70 s}]`. A staircase of
            holds, `{stairs_to: 900 rpm, stair: 10 rpm, rate: 100 rpm/s, settle: 1 s, measure: 1 s}`
            is measured at each of them.
        speed: Drum speed at each of them.
        regions: Time intervals for RMS values.
        band: Pass band of displacements, `(0.5, 20) Hz`, such as that of a measurement to compare
            with. Without it, the second order of the highest speed passes.
    """

    time: u.Times
    speed: u.Speeds
    regions: tuple[Region, ...] = ()
    band: u.Frequencies | None = None

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the JSON schema, in a file with the steps."""
        schema = handler(core)
        if handler.mode == "validation":
            step = handler(_Step.__pydantic_core_schema__)
            steps = {"type": "array", "items": step, "description": "In place of time and speed."}
            handler.resolve_ref_schema(schema)["properties"]["steps"] = steps
        return schema

    @model_validator(mode="before")
    @classmethod
    def _from_steps(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict) or ("steps" not in data and {"time", "speed"} & set(data)):
            return data
        steps, others = data.get("steps"), set(data) - {"steps", "regions", "band"}
        if others or not isinstance(steps, list):
            unknown = sorted(str(key) for key in others - {"time", "speed"})
            named = f"unknown key '{shortened(unknown[0], 40)}'; " if unknown else ""
            raise ValueError(
                f"{named}a profile is either {{steps: [...]}} or {{time: (...) s, speed: (...) "
                "rpm}; regions and band are optional"
            )
        points, stairs = [(0.0, 0.0)], list[dict[str, str]]()
        for index, entry in enumerate(steps):
            try:
                step = _Step.model_validate(entry, context=info.context)
            except ValidationError as error:
                text = "; ".join(
                    f"{p.key}: {p.message}" if p.key else p.message
                    for p in problems_of(error, _Step)
                )
                raise ValueError(f"steps.{index}: {text}") from None
            further, holds = step.after(*points[-1])
            points += further
            stairs += [
                {"name": name, "begin": f"{begin!r} s", "end": f"{end!r} s"}
                for name, begin, end in holds
            ]
        unit = {name: cls.model_fields[name].metadata[0] for name in ("time", "speed")}
        times, speeds = zip(*points, strict=True)
        # the fields accept numbers as text with a unit; repr keeps all digits
        points_of = {"time": times, "speed": speeds}
        texts = {
            name: f"({', '.join(map(repr, values))}) {unit[name].si}"
            for name, values in points_of.items()
        }
        rest = {key: data[key] for key in ("band",) if key in data}
        return {**texts, **rest, "regions": [*stairs, *data.get("regions", ())]}

    @model_validator(mode="after")
    def _usable(self) -> "SpinProfile":
        if len(self.time) != len(self.speed):
            raise ValueError(
                f"has {len(self.time)} times but {len(self.speed)} speeds; each point needs both"
            )
        if len(self.time) < 2:
            raise ValueError("is empty; a profile needs at least two points or one step")
        if self.time[0] != 0.0:
            raise ValueError(f"must begin at time 0 s, begins at {self.time[0]:g} s")
        if np.any(np.diff(self.time) <= 0.0):
            raise ValueError("times must rise from point to point")
        return self

    @model_validator(mode="after")
    def _regions_in_order(self) -> "SpinProfile":
        before = 0.0
        names = [region.name for region in self.regions]
        for region in self.regions:
            if names.count(region.name) > 1:
                raise ValueError(f"regions: '{region.name}' occurs twice; names must differ")
            if not before <= region.begin < region.end <= self.time[-1] * (1.0 + 1e-12):
                raise ValueError(
                    f"regions: {region.name} is from {region.begin:g} s to {region.end:g} s; it "
                    f"must begin at {before:g} s or later, end after its begin, and end at the end "
                    f"of the profile ({self.time[-1]:g} s) or before"
                )
            before = region.end
        return self

    @model_validator(mode="after")
    def _band_is_a_range(self) -> "SpinProfile":
        if self.band is not None and not (
            len(self.band) == 2 and 0.0 < self.band[0] < self.band[1]
        ):
            raise ValueError("band: needs a lower and a higher frequency, for example (0.5, 20) Hz")
        return self

    @property
    def duration(self) -> float:
        """End time of the profile. [s]"""
        return self.time[-1]

    @property
    def highest_speed(self) -> float:
        """Largest speed of the drum, in either direction. [rad/s]"""
        return max(map(abs, self.speed))

    def sample_period(self, longest: float) -> float:
        """Return the time between samples of a run. [s]

        A drum that turns once in a few samples is met at the same few angles in every turn, and its
        peaks lie between them. So the longest time is halved until a turn at the highest speed has
        `SAMPLES_OF_TURN` samples. Halves keep the step, which divides the longest time.

        Args:
            longest: Longest time between samples, `output_period` of a machine. [s]
        """
        in_turn = SAMPLES_OF_TURN * self.highest_speed * longest / (2.0 * np.pi)
        halvings = np.ceil(np.log2(max(1.0, in_turn)) - 1e-9)
        return float(longest / 2.0**halvings)

    def until(self, end: float) -> "SpinProfile":
        """Return the profile up to a time, with the regions that end by then.

        Args:
            end: Later than the first point. [s]
        """
        if end >= self.duration:
            return self
        time = (*(t for t in self.time if t < end), end)
        speed = tuple(np.interp(time, self.time, self.speed).tolist())
        regions = tuple(region for region in self.regions if region.end <= end)
        return self.model_copy(update={"time": time, "speed": speed, "regions": regions})

    def acceleration(self) -> list[float]:
        """Return the angular acceleration between each two points. [rad/s^2]"""
        return [float(a) for a in np.diff(self.speed) / np.diff(self.time)]

    def speed_at(self, time: Any) -> Any:
        """Return the drum speed at one or more times. [rad/s]"""
        return np.interp(time, self.time, self.speed)
