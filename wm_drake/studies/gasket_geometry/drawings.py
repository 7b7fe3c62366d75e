"""Drawings of a design: a drawing with changed wall, folds and hardness."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError

from wm_drake.errors import input_error
from wm_drake.parameters.gasket_drawing import GasketDrawing, MeridianPoint, Rubber
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share
from wm_drake.report.quantity import Quantity

FOLDS, MOST_FOLDS = "folds", 6
"""Name of the factor that repeats the folds, and its largest value."""

HARDNESS = Quantity("Shore A hardness", form="{:.3g}".format)
REPEATED = Quantity("times that the folds of the drawing are repeated", decimals=0)


@dataclass(frozen=True)
class DrawingFactor:
    """A number of the drawing that varies.

    Attributes:
        name: Name in tables.
        quantity: Words, unit and digits of its values.
        middle, half: Value of the drawing, and half the range.
        values: The only values that it may have; empty if it has all of its range.
    """

    name: str
    quantity: Quantity
    middle: float
    half: float
    values: tuple[float, ...] = ()

    def levels(self, evenly: FloatArray) -> FloatArray:
        """Return the levels of evenly distributed numbers from 0 to 1."""
        if not self.values:
            return 2.0 * evenly - 1.0
        chosen = np.array(self.values)[(evenly * len(self.values)).astype(int)]
        return np.asarray((chosen - self.middle) / self.half)

    def value(self, coded: Any) -> Any:
        """Return the value at a level from -1 to 1, or the values at several."""
        return self.middle + coded * self.half


def factors_of(drawing: GasketDrawing, folds: Sequence[int] = (1,)) -> tuple[DrawingFactor, ...]:
    """Return the factors of a drawing.

    Args:
        folds: Numbers of repetitions of its folds; a factor if there are several.

    Raises:
        InputError: the rubber is not given by its hardness, or a number is not allowed.
    """
    numbers = sorted(set(folds))
    if not numbers or not 1 <= numbers[0] <= numbers[-1] <= MOST_FOLDS:
        raise input_error(f"allowed are numbers from 1 to {MOST_FOLDS}", where="--folds")
    repeated: tuple[DrawingFactor, ...] = ()
    if len(numbers) > 1:
        ends = numbers[0], numbers[-1]
        middle, half, values = (
            0.5 * sum(ends),
            0.5 * (ends[1] - ends[0]),
            tuple(map(float, numbers)),
        )
        repeated = (DrawingFactor(FOLDS, REPEATED, middle, half, values),)
    if drawing.rubber.shore_a is None:
        raise input_error(
            "needs shore_a: the hardness is a factor of this study", key="rubber.shore_a"
        )
    return (
        DrawingFactor("thickness", _part("wall thickness"), 1.0, 0.15),
        DrawingFactor("depth", _part("depth of folds"), 1.0, 0.12),
        DrawingFactor("fillet", _part("radius of folds"), 0.92, 0.08),
        DrawingFactor("hardness", HARDNESS, drawing.rubber.shore_a, 6.0),
        *repeated,
    )


def _part(words: str) -> Quantity:
    """Return the quantity of a part of a number of the drawing."""
    return Quantity(f"{words}, of that of the drawing", Share(), form="{:.3g}".format)


def with_folds(drawing: GasketDrawing, times: int) -> GasketDrawing:
    """Return a drawing whose folds are repeated, each narrower, in the room of the drawn ones.

    The folds are the corners between the rims. They are repeated along the radius or along y:
    where the first and the last of these corners are farther apart. Each has the depth of the
    drawing; width and fillets are divided by the number.

    Raises:
        InputError: the drawing has fewer than two corners between its rims, or cannot be built.
    """
    if times == 1:
        return drawing
    first, *inner, last = drawing.meridian
    if len(inner) < 2:
        raise input_error(
            f"has {len(inner)} corners between its rims; folds to repeat need two", key="meridian"
        )
    spans = {name: getattr(inner[-1], name) - getattr(inner[0], name) for name in ("radius", "y")}
    along = max(spans, key=lambda name: abs(spans[name]))
    begin, points = getattr(inner[0], along), [first]
    for number in range(times):
        for point in inner:
            at = begin + (getattr(point, along) - begin + number * spans[along]) / times
            moved = point.model_copy(update={along: at, "fillet": point.fillet / times})
            if math.hypot(moved.radius - points[-1].radius, moved.y - points[-1].y) > 1e-6:
                points.append(moved)
    try:
        return GasketDrawing.model_validate({**dict(drawing), "meridian": (*points, last)})
    except ValidationError as error:
        message = f"with folds repeated {times} times: {error.errors()[0]['msg']}"
        raise input_error(message, key="meridian") from None


def values_at(factors: Sequence[DrawingFactor], levels: FloatArray) -> dict[str, float]:
    """Return the values of factors by name, at levels from -1 to 1. (factors,)"""
    return {f.name: f.value(float(level)) for f, level in zip(factors, levels, strict=True)}


def text_at(factors: Sequence[DrawingFactor], levels: FloatArray) -> str:
    """Return the values of factors at levels from -1 to 1 as text."""
    values = values_at(factors, levels)
    return ", ".join(f"{f.name} {f.quantity.text(values[f.name])}" for f in factors)


def changed(
    drawing: GasketDrawing, factors: tuple[DrawingFactor, ...], coded: FloatArray
) -> GasketDrawing:
    """Return a drawing at levels of the factors.

    The depth of folds is the distance of the inner corners from the straight line between the rims.

    Args:
        coded: Levels from -1 to 1. (factors,)

    Raises:
        InputError: the drawing cannot be built there.
    """
    values = values_at(factors, coded)
    if FOLDS in values:
        drawing = with_folds(drawing, round(values[FOLDS]))
    thickness, depth, fillet = (values[name] for name in ("thickness", "depth", "fillet"))
    places = np.array([(point.radius, point.y) for point in drawing.meridian])
    along = places[-1] - places[0]
    along /= np.linalg.norm(along)
    across = np.array([-along[1], along[0]])
    distance = (places - places[0]) @ across
    places += (depth - 1.0) * distance[:, None] * across
    points = tuple(
        MeridianPoint(
            radius=float(radius),
            y=float(y),
            thickness=thickness * point.thickness,
            fillet=fillet * point.fillet,
        )
        for (radius, y), point in zip(places, drawing.meridian, strict=True)
    )
    try:
        rubber = Rubber.model_validate({**dict(drawing.rubber), "shore_a": values["hardness"]})
        return GasketDrawing.model_validate({**dict(drawing), "meridian": points, "rubber": rubber})
    except ValidationError as error:
        where = text_at(factors, coded)
        raise input_error(f"at {where}: {error.errors()[0]['msg']}", key="meridian") from None
