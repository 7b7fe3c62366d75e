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

from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.problems import problems_of


class Unbalance(Frozen):
    """A point mass that is fixed to the drum at (r sin(phase), y, r cos(phase)) in D.

    At phase 0 and drum angle 0 the mass is at the top.

    Attributes:
        mass: Its mass.
        radius: Distance r from the drum axis.
        y: Position along the drum axis, to the rear, from mid-depth of the drum.
        phase: Angle from the top, positive as the drum turns.
    """

    mass: Annotated[u.Mass, Field(ge=0.0)]
    radius: Annotated[u.Length, Field(ge=0.0)]
    y: u.Length
    phase: u.Angle = 0.0

    def position(self) -> tuple[float, float, float]:
        """Return the position in D. [m]"""
        return self.radius * np.sin(self.phase), self.y, self.radius * np.cos(self.phase)


class Load(Frozen):
    """The laundry, modelled as point masses in the drum.

    Attributes:
        unbalances: The masses.
    """

    unbalances: tuple[Unbalance, ...]


class _Step(Frozen):
    """A step of a spin profile: a ramp to a speed, or a constant speed until a time.

    Attributes:
        ramp_to: Speed at the end of a ramp.
        rate: Acceleration of a ramp.
        hold_until: Time until which the speed is held.
    """

    ramp_to: u.Speed | None = None
    rate: Annotated[u.AngularAcceleration, Field(gt=0.0)] | None = None
    hold_until: u.Duration | None = None

    @model_validator(mode="after")
    def _one_form(self) -> "_Step":
        forms = (
            self.ramp_to is not None and self.rate is not None and self.hold_until is None
        ) or (self.hold_until is not None and self.ramp_to is None and self.rate is None)
        if not forms:
            raise ValueError(
                "a step is either {ramp_to: SPEED, rate: SPEED PER TIME} or {hold_until: TIME}"
            )
        return self

    def after(self, time: float, speed: float) -> tuple[float, float]:
        """Return time and speed at the end of this step, which begins at `time` and `speed`."""
        if self.hold_until is not None:
            return self.hold_until, speed
        assert self.ramp_to is not None  # _one_form has checked this
        assert self.rate is not None
        return time + abs(self.ramp_to - speed) / self.rate, self.ramp_to


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


class SpinProfile(Frozen):
    """Drum speed over time, linear between the points.

    A file may give it as `steps` that start from standstill. The drum follows the profile exactly;
    the motor torque has no limit ([B] section 3).

    Attributes:
        time: Rising times from 0 on. In place of time and speed a file may have
            `steps: [{ramp_to: 400 rpm, rate: 7 rpm/s}, {hold_until: 70 s}]`.
        speed: Drum speed at each of them.
        regions: Time intervals for RMS values.
    """

    time: u.Times
    speed: u.Speeds
    regions: tuple[Region, ...] = ()

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
        steps, others = data.get("steps"), set(data) - {"steps", "regions"}
        if others or not isinstance(steps, list):
            raise ValueError(
                "a profile is either {steps: [...]} or {time: (...) s, speed: (...) rpm}; regions "
                "are optional"
            )
        points = [(0.0, 0.0)]
        for index, entry in enumerate(steps):
            try:
                step = _Step.model_validate(entry, context=info.context)
            except ValidationError as error:
                text = "; ".join(
                    f"{p.key}: {p.message}" if p.key else p.message
                    for p in problems_of(error, _Step)
                )
                raise ValueError(f"steps.{index}: {text}") from None
            points.append(step.after(*points[-1]))
        unit = {name: cls.model_fields[name].metadata[0] for name in ("time", "speed")}
        times, speeds = zip(*points, strict=True)
        # the fields accept numbers as text with a unit; repr keeps all digits
        points_of = {"time": times, "speed": speeds}
        texts = {
            name: f"({', '.join(map(repr, values))}) {unit[name].si}"
            for name, values in points_of.items()
        }
        return {**texts, "regions": data.get("regions", ())}

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

    @property
    def duration(self) -> float:
        """End time of the profile. [s]"""
        return self.time[-1]

    def acceleration(self) -> list[float]:
        """Return the angular acceleration between each two points. [rad/s^2]"""
        return [float(a) for a in np.diff(self.speed) / np.diff(self.time)]

    def speed_at(self, time: Any) -> Any:
        """Return the drum speed at one or more times. [rad/s]"""
        return np.interp(time, self.time, self.speed)
