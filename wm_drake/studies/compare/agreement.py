"""Where a recorded machine and its model agree, and where they differ most."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from wm_drake.report.quantity import quantity_of
from wm_drake.studies.compare.study import DIFFERENCE

LEAST_SHOWN = 0.1
"""Smallest amplitude, by the largest one of the sensor, whose difference is named in percent."""

LEAST_RANGE = 0.1
"""Smallest part of the places that is called a range in which all sensors agree."""


def agreement_of(amplitudes: Sequence[xr.Dataset], place: xr.DataArray) -> xr.Dataset:
    """Return the longest range of places in which all sensors agree, and what differs elsewhere.

    A single place that differs between places that agree, two on each side, counts as agreeing.

    Args:
        amplitudes: As of `amplitudes_of`, of each quantity.

    Returns:
        `from_place` and `to_place`, NaN if there is no range of `LEAST_RANGE` of the places;
        `first_place` and `last_place` of all. Of the largest difference outside of the range, by
        the largest amplitude of its sensor: the `sensor`, `at`, the `difference` by the amplitude
        measured there, and whether that is a maximum over the places (`is_peak`); NaN and "" if
        all agree. Amplitudes below `LEAST_SHOWN` of the largest one of the sensor are left out.
    """
    agrees, known, difference, measured, computed = (
        np.hstack([values.values for values in part])
        for part in zip(
            *(
                (a.agrees, a.measured.notnull(), a.difference, a.measured, a.computed)
                for a in amplitudes
            ),
            strict=True,
        )
    )
    names = [name for a in amplitudes for name in a.sensor.values.tolist()]
    rows = np.flatnonzero(known.any(axis=1))
    begin, end = _longest(np.all(agrees | ~known, axis=1)[rows])
    has_range = end - begin >= LEAST_RANGE * len(rows)
    inside = rows[begin:end] if has_range else rows[:0]
    is_large = measured >= LEAST_SHOWN * np.nanmax(measured, axis=0)
    outside = np.where(known & ~agrees & is_large, np.abs(difference), -1.0)
    outside[inside] = -1.0
    at, k = np.unravel_index(np.argmax(outside), outside.shape)
    differs = bool(outside[at, k] > 0.0)
    near = measured[max(0, at - 2) : at + 3, k]
    quantity = quantity_of(place)
    values = place.values
    places = {
        "from_place": values[inside[0]] if has_range else np.nan,
        "to_place": values[inside[-1]] if has_range else np.nan,
        "first_place": values[rows[0]],
        "last_place": values[rows[-1]],
        "at": values[at] if differs else np.nan,
    }
    part = computed[at, k] / measured[at, k] - 1.0 if differs else np.nan
    is_peak = differs and bool(measured[at, k] == np.nanmax(near)) and 0 < at < len(measured) - 1
    return xr.Dataset(
        {name: quantity.variable((), value) for name, value in places.items()}
        | {
            "difference": DIFFERENCE.variable((), part),
            "sensor": ((), names[k] if differs else ""),
            "is_peak": ((), is_peak),
        }
    )


def _longest(agrees: np.ndarray) -> tuple[int, int]:
    """Return begin and end of the longest row of places that agree, single others among them."""
    padded = np.concatenate([[False] * 2, agrees, [False] * 2])
    filled = padded.copy()
    filled[2:-2] |= padded[:-4] & padded[1:-3] & padded[3:-1] & padded[4:]
    changes = np.flatnonzero(np.diff(filled[1:-1].astype(int)))
    if not len(changes):
        return 0, 0
    begins, ends = changes[::2], changes[1::2]
    best = int(np.argmax(ends - begins))
    return int(begins[best]), int(ends[best])
