"""Allowed range of a number of a machine, as the types of the machine file declare it."""

import math
import typing
from dataclasses import dataclass
from typing import Any

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from wm_drake.parameters.keys import is_index


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


def allowed_range(parameters: BaseModel, key: str) -> AllowedRange:
    """Return the range that the field of a key path allows; unbounded if it declares none.

    Other rules, such as an order of several numbers, are checked when a value is set.

    Args:
        parameters: The machine, or a part of one.
        key: Key path of a number in it.
    """
    node: Any = parameters
    found = AllowedRange()
    for part in key.split("."):
        if isinstance(node, BaseModel):
            field = type(node).model_fields[part]
            found = _declared([*field.metadata, *_inner(field.annotation)])
            node = getattr(node, part)
        else:
            node = node[int(part)] if isinstance(node, tuple) and is_index(part) else node[part]
    return found


def _inner(annotation: Any) -> list[Any]:
    """Return the metadata in the alternatives of a type, such as ``Annotated[...] | None``."""
    found = []
    if hasattr(annotation, "__metadata__"):
        found += list(annotation.__metadata__)
        annotation = typing.get_args(annotation)[0]
    for member in typing.get_args(annotation):
        found += _inner(member)
    return found


def _declared(metadata: list[Any]) -> AllowedRange:
    low, high, low_is_in, high_is_in = -math.inf, math.inf, False, False
    for item in metadata:
        if isinstance(item, FieldInfo):
            inner = _declared(item.metadata)
            low, low_is_in = max((low, low_is_in), (inner.low, inner.low_is_in))
            high, high_is_in = min((high, high_is_in), (inner.high, inner.high_is_in))
        elif isinstance(item, annotated_types.Gt | annotated_types.Ge):
            low_is_in = isinstance(item, annotated_types.Ge)
            low = float(getattr(item, "ge" if low_is_in else "gt"))
        elif isinstance(item, annotated_types.Lt | annotated_types.Le):
            high_is_in = isinstance(item, annotated_types.Le)
            high = float(getattr(item, "le" if high_is_in else "lt"))
    return AllowedRange(low, high, low_is_in, high_is_in)
