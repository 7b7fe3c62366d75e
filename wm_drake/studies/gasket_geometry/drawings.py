"""Drawings of a design: a drawing with changed wall, folds and hardness."""

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
