"""Tables of a spin-cycle study: numbers for files, text for a page."""

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.report.formatting import MISSING, MM_PER_M, RPM_PER_RAD_S, number
from wm_drake.report.tables import Group, Row, Table
from wm_drake.studies.spin_cycle.study import (
    SpinCycleResult,
    average_errors,
    disagreement,
    largest,
    mean_and_deviation,
    region_errors,
)


def case_table(result: SpinCycleResult) -> pd.DataFrame:
    """Return one row per case as [A] Table 9, with largest RMS displacement and smallest gap."""
    errors = (
        average_errors(result.displacement, result.measured)
        if result.measured is not None
        else None
    )
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


def cases(result: SpinCycleResult) -> Table:
    """Return the cases with their results as a table of text."""
    table = case_table(result)
    heads = {
        "front_g": "front mass, g",
        "rear_g": "rear mass, g",
        "phase_deg": "phase, deg",
        "region": "in region",
        "sensor_axis": "sensor, axis",
        "largest_rms_mm": "largest RMS, mm",
        "smallest_gap_mm": "smallest gap, mm",
        "smallest_tension_N": "smallest spring tension, N",
        "average_error_percent": "average error, %",
        "published_error_percent": "[A] Table 9, %",
    }
    decimals = {
        "largest_rms_mm": 2,
        "smallest_gap_mm": 1,
        "smallest_tension_N": 1,
        "average_error_percent": 1,
        "published_error_percent": 1,
    }
    shown = [name for name in heads if name in table]
    groups = []
    for _, row in table.iterrows():
        cells = [
            row[name] if isinstance(row[name], str) else number(row[name], decimals.get(name, 0))
            for name in shown
        ]
        slack = bool((result.smallest_tension.sel(case=row["case"]) == 0.0).any())
        alarm = row["smallest_gap_mm"] <= 0.0 or slack
        groups.append(Group(str(row["case"]), (Row(tuple(cells), "alarm" if alarm else ""),)))
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
    return Table(caption, ("case", *(heads[name] for name in shown)), tuple(groups))


def regions(result: SpinCycleResult) -> Table:
    """Return limits and results of each region, and its errors if there is a measurement.

    One column compares RMS displacements computed directly and by integrating the acceleration.
    """
    apart = disagreement(result).max("case")
    header = [
        "region",
        "time, s",
        "drum speed, rpm",
        "largest RMS, mm",
        "in case",
        "direct vs. integrated, %",
    ]
    if result.measured is not None:
        mean, deviation = mean_and_deviation(region_errors(result.displacement, result.measured))
        header += ["mean error, [A] Eq. (9), %", "standard deviation, %"]
    groups = []
    for region in result.profile.regions:
        corners = [
            region.begin,
            *(t for t in result.profile.time if region.begin < t < region.end),
            region.end,
        ]
        speeds = [
            number(RPM_PER_RAD_S * float(speed), 0) for speed in result.profile.speed_at(corners)
        ]
        worst = largest(result.displacement.sel(region=[region.name]))
        cells = [
            f"{number(region.begin, 2)} – {number(region.end, 2)}",
            " – ".join(
                speed
                for speed, before in zip(speeds, ["", *speeds], strict=False)
                if speed != before
            ),
            number(MM_PER_M * worst.value, 2) if worst else MISSING,
            worst.case if worst else MISSING,
            number(100.0 * float(apart.sel(region=region.name)), 2),
        ]
        if result.measured is not None:
            cells += [
                number(100.0 * float(values.sel(region=region.name)), 1)
                for values in (mean, deviation)
            ]
        groups.append(Group(region.name, (Row(tuple(cells)),)))
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
    return Table(caption, tuple(header), tuple(groups))


def displacements(result: SpinCycleResult, case: str) -> Table:
    """Return the RMS displacements of one case by region (rows), sensor and axis (columns)."""
    values = result.displacement.sel(case=case)
    header = [
        f"{sensor} {axis}" for sensor in values.accelerometer.values for axis in values.axis.values
    ]
    groups = tuple(
        Group(
            str(region),
            (
                Row(
                    tuple(number(v, 3) for v in MM_PER_M * values.sel(region=region).values.ravel())
                ),
            ),
        )
        for region in values.region.values
    )
    return Table(f"RMS displacement of case {case}, in mm.", ("region", *header), groups)


def worst_of_all(displacement: xr.DataArray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest value over the cases, and the index of the case in which it occurs.

    Both have the shape (regions, sensors * axes). A value without any number is -1. [m]
    """
    values = displacement.values.reshape(*displacement.shape[:2], -1)
    filled = np.where(np.isfinite(values), values, -1.0)
    return filled.max(axis=0), filled.argmax(axis=0)
