"""Allowed range of a number of a machine, as the types of the machine file declare it."""

import math
import typing
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import annotated_types
from pydantic.fields import FieldInfo

from wm_drake.parameters.keys import field_at
from wm_drake.parameters.machine import MachineParameters


@dataclass(frozen=True)
class AllowedRange:
    """Range of the values that a field accepts, in SI units.

    Attributes:
        low, high: Ends of the range, infinite where there is none.
        low_is_in, high_is_in: Whether the end itself is allowed.
    """

    low: float = -math.inf
    high: float = math.inf
    low_is_in: bool = False
    high_is_in: bool = False

    def holds(self, value: float) -> bool:
        """Return whether a value is in the range."""
        above = value >= self.low if self.low_is_in else value > self.low
        below = value <= self.high if self.high_is_in else value < self.high
        return above and below

    def limits(self) -> Iterator[tuple[str, float]]:
        """Yield sign and value of each end, such as (">=", 0.0)."""
        if math.isfinite(self.low):
            yield ">=" if self.low_is_in else ">", self.low
        if math.isfinite(self.high):
            yield "<=" if self.high_is_in else "<", self.high


def allowed_range(parameters: MachineParameters, key: str) -> AllowedRange:
    """Return the range that the field of a key path allows; unbounded if it declares none.

    Other rules, such as an order of several numbers, are checked when a value is set.
    """
    _, field = field_at(parameters, key)
    return AllowedRange() if field is None else declared_range(field)


def declared_range(field: FieldInfo) -> AllowedRange:
    """Return the range that a field declares, itself or by the types of its alternatives."""
    low, high, low_is_in, high_is_in = -math.inf, math.inf, False, False
    for item in _metadata(field.annotation, field.metadata):
        if isinstance(item, annotated_types.Gt | annotated_types.Ge):
            low_is_in = isinstance(item, annotated_types.Ge)
            low = float(getattr(item, "ge" if low_is_in else "gt"))
        elif isinstance(item, annotated_types.Lt | annotated_types.Le):
            high_is_in = isinstance(item, annotated_types.Le)
            high = float(getattr(item, "le" if high_is_in else "lt"))
    return AllowedRange(low, high, low_is_in, high_is_in)


def _metadata(annotation: Any, metadata: Iterable[Any]) -> Iterator[Any]:
    for item in metadata:
        yield from getattr(item, "metadata", [item])
    for argument in typing.get_args(annotation):
        inner = getattr(argument, "__metadata__", ())
        yield from _metadata(typing.get_args(argument)[0] if inner else argument, inner)
