"""Tables of a spin-cycle study."""

import itertools

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.report.formatting import MISSING, MM_PER_M, RPM_PER_RAD_S, number
from wm_drake.report.table import Column, Columns, Table, line, table_of
from wm_drake.studies.spin_cycle.study import (
    SpinCycleResult,
    average_errors,
    disagreement,
    largest,
    mean_and_deviation,
    region_errors,
)


def case_frame(result: SpinCycleResult) -> pd.DataFrame:
    """Return one row per case as [A] Table 9, with largest RMS displacement and smallest gap."""
    measured = result.measured
    errors = None if measured is None else average_errors(result.displacement, measured)
    rows = []
    for case in result.cases:
        worst = largest(result.displacement.sel(case=[case.name]))
        row: dict[str, object] = {
            "case": case.name,
            "front_g": 1e3 * case.front,
            "rear_g": 1e3 * case.rear,
            "phase_deg": float(np.rad2deg(case.phase)),
            "largest_rms_mm": MM_PER_M * worst.value if worst else np.nan,
            "region": worst.region if worst else MISSING,
            "sensor_axis": f"{worst.accelerometer} {worst.axis}" if worst else MISSING,
            "smallest_gap_mm": MM_PER_M * float(result.smallest_gap.sel(case=case.name)),
            "smallest_tension_N": float(result.smallest_tension.sel(case=case.name).min()),
        }
        if errors is not None:
            row["average_error_percent"] = 100.0 * float(errors.sel(case=case.name))
        if case.published_error_percent is not None:
            row["published_error_percent"] = case.published_error_percent
        rows.append(row)
    return pd.DataFrame(rows)


COLUMNS = {
    "case": Column("case"),
    "front_g": Column("front mass", "g", 0),
    "rear_g": Column("rear mass", "g", 0),
    "phase_deg": Column("phase", "deg", 0),
    "region": Column("in region"),
    "sensor_axis": Column("sensor, axis"),
    "largest_rms_mm": Column("largest RMS", "mm", 2),
    "smallest_gap_mm": Column("smallest gap", "mm", 1),
    "smallest_tension_N": Column("smallest spring tension", "N", 1),
    "average_error_percent": Column("average error", "%", 1),
    "published_error_percent": Column("[A] Table 9", "%", 1),
}
"""Columns of the table of cases."""


def cases(result: SpinCycleResult) -> Table:
    """Return the cases with their results; a collision or a slack spring is an alarm."""
    table = case_frame(result)
    alarms = (table["smallest_gap_mm"] <= 0.0) | (table["smallest_tension_N"] == 0.0)
    caption = (
        "Cases in the order of the input table, with the largest RMS displacement of any sensor "
        "and axis in any region, the smallest gap between tub and housing, and the smallest "
        "tension of any spring; a spring goes slack at 0."
    )
    if "average_error_percent" in table:
        caption += (
            " Average error: mean over regions, sensors and axes of |measured − computed| / "
            "measured."
        )
    if "published_error_percent" in table:
        caption += (
            " [A] Table 9: average error of the model of [A] against the experiment of [A], with "
            "its own machine."
        )
    shown = table[[name for name in COLUMNS if name in table]]
    return table_of(shown, caption, COLUMNS, ["alarm" if alarm else "" for alarm in alarms])


def regions(result: SpinCycleResult) -> Table:
    """Return limits and results of each region, and its errors if there is a measurement.

    One column compares RMS displacements computed directly and by integrating the acceleration.
    """
    errors = {"direct vs. integrated": (disagreement(result).max("case"), 2)}
    if result.measured is not None:
        mean, deviation = mean_and_deviation(region_errors(result.displacement, result.measured))
        errors |= {"mean error, [A] Eq. (9)": (mean, 1), "standard deviation": (deviation, 1)}
    groups = []
    for region in result.profile.regions:
        inner = (t for t in result.profile.time if region.begin < t < region.end)
        speeds = result.profile.speed_at([region.begin, *inner, region.end])
        texts = (number(RPM_PER_RAD_S * float(speed), 0) for speed in speeds)
        worst = largest(result.displacement.sel(region=[region.name]))
        cells = [
            f"{number(region.begin, 2)} – {number(region.end, 2)}",
            " – ".join(text for text, _ in itertools.groupby(texts)),
            MM_PER_M * worst.value if worst else None,
            worst.case if worst else None,
            *(100.0 * float(values.sel(region=region.name)) for values, _ in errors.values()),
        ]
        groups.append(line(region.name, cells))
    columns: Columns = (
        "region",
        Column("time", "s"),
        Column("drum speed", "rpm"),
        Column("largest RMS", "mm", 2),
        "in case",
        *(Column(name, "%", decimals) for name, (_, decimals) in errors.items()),
    )
    caption = (
        "Regions of the spin profile. Direct vs. integrated: difference between the RMS "
        "displacements computed directly and by integrating the acceleration twice, with norms "
        "over all sensors and axes, for the worst case."
    )
    if result.measured is not None:
        caption += (
            " Error: |measured − computed| / |measured| with norms over sensors and axes, [A] Eq. "
            "(9); mean and standard deviation over the cases."
        )
    return Table(caption, columns, tuple(groups))


def displacements(result: SpinCycleResult, case: str, title: str) -> Table:
    """Return the RMS displacements of one case by region (rows), sensor and axis (columns)."""
    values = MM_PER_M * result.displacement.sel(case=case)
    columns = tuple(Column(name, decimals=3) for name in channels(values))
    rows = (
        line(str(r), values.sel(region=r).values.ravel().tolist()) for r in values.region.values
    )
    caption = f"{title}: RMS displacement, in mm."
    return Table(caption, ("region", *columns), tuple(rows))


def channels(values: xr.DataArray) -> list[str]:
    """Return the names of sensor and axis of each channel, in the order of the values."""
    return [f"{s} {axis}" for s in values.accelerometer.values for axis in values.axis.values]


def worst_of_all(displacement: xr.DataArray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest value over the cases, and the index of the case in which it occurs.

    Both have the shape (regions, sensors * axes). A value without any number is -1. [m]
    """
    values = displacement.values.reshape(*displacement.shape[:2], -1)
    filled = np.where(np.isfinite(values), values, -1.0)
    return filled.max(axis=0), filled.argmax(axis=0)
