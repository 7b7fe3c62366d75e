"""What the drum does and carries: spin profiles and loads."""

from typing import Annotated, Any

import numpy as np
from pydantic import Field, StringConstraints, ValidationError, ValidationInfo, model_validator

from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.problems import problems_of


class Unbalance(Frozen):
    """A point mass fixed to the drum, at (r sin(phase), y, r cos(phase)) in D: phase 0 is up while the drum angle is 0."""

    mass: Annotated[u.Mass, Field(ge=0.0)]
    radius: Annotated[u.Length, Field(ge=0.0)]
    y: u.Length
    phase: u.Angle = 0.0

    def position(self) -> tuple[float, float, float]:
        """In the drum frame. [m]"""
        return self.radius * np.sin(self.phase), self.y, self.radius * np.cos(self.phase)


class Load(Frozen):
    """Laundry, as point masses in the drum."""

    unbalances: tuple[Unbalance, ...]


class _Step(Frozen):
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
        """Time and speed at the end of the step that begins at (time, speed)."""
        if self.hold_until is not None:
            return self.hold_until, speed
        assert self.ramp_to is not None  # _one_form has seen to it
        assert self.rate is not None
        return time + abs(self.ramp_to - speed) / self.rate, self.ramp_to


class Region(Frozen):
    """A named stretch of a spin profile, over which vibrations are summed up ([A] section 4.1: R1 to R8)."""

    name: Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_-]*$")]
    begin: Annotated[u.Duration, Field(ge=0.0)]
    end: u.Duration


class SpinProfile(Frozen):
    """Drum speed over time, linear between the points; in a file also as `steps` from standstill.

    The drum follows it exactly, whatever torque that takes ([B] section 3).
    """

    time: u.Times
    speed: u.Speeds
    regions: tuple[Region, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _from_steps(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict) or "steps" not in data:
            return data
        if not set(data) <= {"steps", "regions"} or not isinstance(data["steps"], list):
            raise ValueError(
                "a profile is either {steps: [...]} or {time: (...) s, speed: (...) rpm}, each with regions or not"
            )
        points = [(0.0, 0.0)]
        for index, entry in enumerate(data["steps"]):
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
        # as text again, for the door of the fields: repr keeps every digit
        points_of = {"time": times, "speed": speeds}
        texts = {
            name: f"({', '.join(map(repr, values))}) {unit[name].si}"
            for name, values in points_of.items()
        }
        return {**texts, "regions": data.get("regions", ())}

    @model_validator(mode="after")
    def _usable(self) -> "SpinProfile":
        if len(self.time) != len(self.speed):
            raise ValueError(f"has {len(self.time)} times but {len(self.speed)} speeds")
        if len(self.time) < 2:
            raise ValueError("is empty: a profile needs at least two points, or one step")
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
                raise ValueError(f"regions: '{region.name}' is there twice")
            if not before <= region.begin < region.end <= self.time[-1] * (1.0 + 1e-12):
                raise ValueError(
                    f"regions: {region.name} from {region.begin:g} s to {region.end:g} s is not a stretch after the one before "
                    f"it and within the {self.time[-1]:g} s of the profile"
                )
            before = region.end
        return self

    @property
    def duration(self) -> float:
        """End of the profile. [s]"""
        return self.time[-1]

    def acceleration(self) -> list[float]:
        """Angular acceleration between the points. [rad/s^2]"""
        return [float(a) for a in np.diff(self.speed) / np.diff(self.time)]

    def speed_at(self, time: Any) -> Any:
        """Drum speed at a time or times. [rad/s]"""
        return np.interp(time, self.time, self.speed)
