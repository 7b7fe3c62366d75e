"""The form of the variables of a record."""

from typing import TypeAlias

from wm_drake.parameters.types import FloatArray

Variables: TypeAlias = dict[str, tuple[tuple[str, ...], FloatArray, str, str]]
"""For each variable name: dimensions, values, unit and description."""
