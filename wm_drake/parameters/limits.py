"""Limits that a study must meet, and what it makes small or large."""

import math
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.files import read_model
from wm_drake.parameters.units import Share


class OneSided(Frozen):
    """A limit of a quantity on one side.

    Attributes:
        quantity: Name of a response, such as gap or amplitude_Xr.
        at_least, at_most: The limit, with a unit. One of the two.
    """

    quantity: str
    at_least: str | None = None
    at_most: str | None = None

    @model_validator(mode="after")
    def _has_one_side(self) -> Self:
        if (self.at_least is None) == (self.at_most is None):
            raise ValueError("needs either at_least or at_most")
        return self

    @property
    def text(self) -> str:
        """Return the limit as text."""
        return self.at_least or self.at_most or ""


class Limit(OneSided):
    """A limit that the runs have to meet, up to an allowed share of them.

    Attributes:
        allowed_share: Largest allowed share of runs that break the limit. [0 to 1]
    """

    allowed_share: str

    @model_validator(mode="after")
    def _share_is_known(self) -> Self:
        fraction(self.allowed_share, "allowed_share")
        return self


class _Over(Frozen):
    """What one value follows from.

    Attributes:
        over: How the values of several loads or samples become one: the worst, the mean, or a
            quantile such as "95 %", counted towards the worse side.
    """

    over: str = "worst"

    @model_validator(mode="after")
    def _over_is_known(self) -> Self:
        if self.over not in ("worst", "mean"):
            try:
                fraction(self.over, "over")
            except ValueError:
                raise ValueError(
                    f"over: '{self.over}' is not allowed; allowed are worst, mean and a quantile "
                    "such as '95 %'"
                ) from None
        return self


class Objective(_Over):
    """What a design search makes small or large.

    Attributes:
        quantity: Name of a response, such as Dx or gap, or key path of a number, such as
            bodies.motor.mass.
        goal: Direction.
    """

    quantity: str
    goal: Literal["smaller", "larger"] = "smaller"


class Constraint(OneSided, _Over):
    """A limit that a design must meet."""


class _Limits(Frozen):
    limits: tuple[Limit, ...] = Field(min_length=1)


def load_limits(path: Path) -> tuple[Limit, ...]:
    """Read a file of limits: ``limits: [{quantity, at_least or at_most, allowed_share}, ...]``."""
    return read_model(_Limits, path).limits


def fraction(text: str, name: str) -> float:
    """Return a share such as "0.1 %" or "0.001" as a number from 0 to 1.

    Raises:
        ValueError: the text is not such a share.
    """
    try:
        value = Share().number(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"{name}: '{text}' is not a share; write for example '0.1 %'")
    return value
