"""Steps of a page whose numbers are moved: from which value of a number on `spin` takes others."""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from wm_drake.engines.compiled.stepping import Stepping
from wm_drake.errors import InputError
from wm_drake.export.page_contents import Contents
from wm_drake.export.page_model import Candidates

PRECISION = 1e-6
"""How near such a value is found, relative to the way from the exported value to the end."""
FARTHEST = 1e300
"""In place of an infinite number, which JSON does not have."""


def other_steps(
    contents: Contents, candidates: Candidates, places: Mapping[str, int]
) -> tuple[list[dict[str, Any]], dict[str, list[float]]]:
    """Return how runs with a moved number are stepped, if not as exported; and limits of numbers.

    Behind a limit, `spin` takes steps that the compiled functions do not have, or refuses to run.

    Args:
        candidates, places: As for `page_model`: ranges of numbers, and those that may change.
    """
    steps, limits = list[dict[str, Any]](), dict[str, list[float]]()
    for key in (key for key in places if key in candidates):
        value, ends = candidates[key].value, candidates[key].ends
        limits[key] = [-FARTHEST, FARTHEST]

        def stepping_at(number: float, key: str = key) -> Stepping | None:
            try:
                return contents.stepping_of(contents.set_up({key: number}))
            except InputError:
                return None

        for side, end in enumerate(ends):
            pieces = [*_pieces(stepping_at, contents.stepping, value, end)]
            pieces.append((math.copysign(FARTHEST, end - value), None))
            for (at, stepping), (border, _) in itertools.pairwise(pieces):
                if stepping is None or _is_midpoint(stepping) != _is_midpoint(contents.stepping):
                    limits[key][side] = at - PRECISION * (end - value)
                    break
                low, high = sorted((at, border))
                how = {"integrator": stepping.integrator, "step": stepping.step}
                steps.append({"place": places[key], "low": low, "high": high} | how)
    return steps, limits


def _is_midpoint(stepping: Stepping) -> bool:
    """Return whether steps need the functions of the midpoint rule; all others have the same."""
    return stepping.integrator == "midpoint"


def _pieces(
    stepping_at: Callable[[float], Stepping | None], start: Stepping, value: float, end: float
) -> Iterator[tuple[float, Stepping | None]]:
    """Yield from which values on, from one towards an end, runs are stepped otherwise, and how."""
    at, last = value, stepping_at(end)
    now: Stepping | None = start
    while now != last:
        near, far = at, end
        while abs(far - near) > PRECISION * abs(end - value):
            middle = 0.5 * (near + far)
            near, far = (middle, far) if stepping_at(middle) == now else (near, middle)
        at, now = far, stepping_at(far)
        yield at, now
