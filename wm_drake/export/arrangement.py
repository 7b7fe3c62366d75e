"""Arrays of an exported machine: where their parts begin, and parts that FMU and page share."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from wm_drake.engines.compiled.packing import DrawnBodies
from wm_drake.model.scene import Scene
from wm_drake.parameters.types import FloatArray


def places_of(names: Any, sizes: Mapping[str, int], first: int = 0) -> Any:
    """Return where each part of an array begins, and the size of the array.

    Args:
        names: Class of a named tuple whose last field is the size.
        sizes: Size of each part, in order.
        first: Index at which the first part begins.
    """
    begins = [first, *(first + np.cumsum(list(sizes.values()))).tolist()]
    return names(**dict(zip((*sizes, "size"), begins, strict=True)))


def joined(names: Any, parts: Mapping[str, Any]) -> tuple[Any, FloatArray]:
    """Return where each part of an array begins, as `places_of`, and the array.

    Args:
        parts: Numbers of each part, in order; of any shape.
    """
    flat = {name: np.asarray(part, dtype=float).ravel() for name, part in parts.items()}
    return places_of(names, {n: len(part) for n, part in flat.items()}), np.concatenate(
        [*flat.values()]
    )


def entries_of(numbers: Iterable[tuple[np.ndarray, FloatArray]]) -> FloatArray:
    """Return row, number, slope of each packed number that depends on one of the file. (n, 3)

    Args:
        numbers: Rows and slopes of each number of the file.
    """
    entries = [
        (row, number, slope)
        for number, (rows, slopes) in enumerate(numbers)
        for row, slope in zip(rows, slopes, strict=True)
    ]
    return np.array(entries, dtype=float).reshape(-1, 3)


def drum_parts(bodies: DrawnBodies) -> dict[str, FloatArray]:
    """Return the constants with which point masses enter the drum: `harmonics` and `drum`."""
    harmonics, rotation, origin = bodies.of_point_masses
    return {"harmonics": harmonics, "drum": np.concatenate([rotation.ravel(), origin])}


def pair_parts(scene: Scene, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the numbers (n, k) and the distance (n,) of each pair of shapes of tub and housing.

    The direction of a pair is that in which it is separated at a pose.
    """
    pairs = scene.separations(pose)
    numbers = [
        np.concatenate([moving.numbers, fixed.numbers, [moving.is_round, fixed.is_round], away])
        for moving, fixed, away, _ in pairs
    ]
    return np.array(numbers), np.array([distance for *_, distance in pairs])
