"""Drawings of a design: a drawing with changed wall, folds and hardness."""

import math
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from wm_drake.errors import input_error
from wm_drake.parameters.gasket_drawing import GasketDrawing, MeridianPoint, Rubber
from wm_drake.parameters.types import FloatArray


@dataclass(frozen=True)
class Factor:
    """A number of the drawing that varies.

    Attributes:
        name: Name in tables.
        words: Words for reading.
        unit: Unit of its values.
        middle, half: Value of the drawing, and half the range.
    """

    name: str
    words: str
    unit: str
    middle: float
    half: float

    def value(self, coded: float) -> float:
        """Return the value at a level from -1 to 1."""
        return self.middle + coded * self.half


def factors_of(drawing: GasketDrawing) -> tuple[Factor, ...]:
    """Return the factors of a drawing.

    Raises:
        InputError: the rubber is not given by its hardness.
    """
    if drawing.rubber.shore_a is None:
        raise input_error(
            "needs shore_a: the hardness is a factor of this study", key="rubber.shore_a"
        )
    return (
        Factor("thickness", "wall thickness, of that of the drawing", "%", 100.0, 15.0),
        Factor("depth", "depth of folds, of that of the drawing", "%", 100.0, 12.0),
        Factor("fillet", "radius of folds, of that of the drawing", "%", 92.0, 8.0),
        Factor("hardness", "hardness", "Shore A", drawing.rubber.shore_a, 6.0),
    )


def with_folds(drawing: GasketDrawing, times: int) -> GasketDrawing:
    """Return a drawing whose folds are repeated, each narrower, in the room of the drawn ones.

    The folds are the corners between the rims. They are repeated along the radius or along y:
    where the first and the last of these corners are farther apart. Each has the depth of the
    drawing; width and fillets are divided by the number.

    Args:
        drawing: The drawing.
        times: Number of repetitions.

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


def changed(
    drawing: GasketDrawing, factors: tuple[Factor, ...], coded: FloatArray
) -> GasketDrawing:
    """Return a drawing at levels of the factors.

    The depth of folds is the distance of the inner corners from the straight line between the rims.

    Args:
        drawing: The drawing.
        factors: Factors from `factors_of`.
        coded: Levels from -1 to 1. (factors,)

    Raises:
        InputError: the drawing cannot be built there.
    """
    values = [factor.value(float(level)) for factor, level in zip(factors, coded, strict=True)]
    thickness, depth, fillet = (0.01 * value for value in values[:3])
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
        rubber = Rubber.model_validate({**dict(drawing.rubber), "shore_a": values[3]})
        return GasketDrawing.model_validate({**dict(drawing), "meridian": points, "rubber": rubber})
    except ValidationError as error:
        texts = ", ".join(
            f"{factor.name} {value:.3g} {factor.unit}"
            for factor, value in zip(factors, values, strict=True)
        )
        raise input_error(f"at {texts}: {error.errors()[0]['msg']}", key="meridian") from None
