"""Tables of a spin-cycle study: cases, regions, drive, feet; and warnings about the feet."""

import itertools
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.report.formatting import MISSING, MM_PER_M, RPM_PER_RAD_S, number
from wm_drake.report.table import Column, Columns, Table, line, table_of
from wm_drake.simulation.feet import MARGINS
from wm_drake.simulation.measures.as_json import as_json
from wm_drake.simulation.vibration import MOST_MISSING
from wm_drake.studies.spin_cycle.study import (
    SpinCycleResult,
    average_errors,
    disagreement,
    largest,
    mean_and_deviation,
    missing_regions,
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


def missing_warnings(computed: xr.DataArray, measured: xr.DataArray) -> list[str]:
    """Return a warning of the regions that the errors leave out, or none."""
    missing = missing_regions(computed, measured)
    if not missing:
        return []
    parts = [f"{region} in case {', '.join(cases)}" for region, cases in missing.items()]
    return [
        f"The errors leave regions out, which have no measured value or were not completed by the "
        f"run: {'; '.join(parts)}. A record counts for a region if at most "
        f"{number(100.0 * MOST_MISSING, 0)} % of it is missing at its end."
    ]


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


DRIVE = {
    "peak_torque_Nm": ("drive_peak_torque", 1.0),
    "mean_torque_Nm": ("drive_mean_torque", 1.0),
    "mean_torque_rpm": ("drive_mean_torque_speed", RPM_PER_RAD_S),
    "peak_power_W": ("drive_peak_power", 1.0),
    "energy_J": ("drive_energy", 1.0),
    "speed_ripple_percent": ("drive_speed_ripple", 100.0),
    "end_rpm": ("drive_end_speed", RPM_PER_RAD_S),
    "caught_rpm": ("drive_caught_speed", RPM_PER_RAD_S),
    "caught_mean_torque_Nm": ("drive_caught_torque", 1.0),
}
"""Columns of `drive_frame`: the measure, and its factor from SI units."""

SHOWN_DRIVE = {
    "case": Column("case"),
    "peak_torque_Nm": Column("peak torque", "N\u00a0m", 1),
    "mean_torque_Nm": Column("mean torque", "N\u00a0m", 2),
    "mean_torque_rpm": Column("at", "rpm", 0),
    "peak_power_W": Column("peak power", "W", 0),
    "speed_ripple_percent": Column("ripple", "%", 1),
    "end_rpm": Column("speed at the end", "rpm", 0),
    "caught_rpm": Column("caught at", "rpm", 0),
}
"""Columns on the page."""


def drive_frame(result: SpinCycleResult) -> pd.DataFrame | None:
    """Return a row for each case with the measures of the drive; None without a motor."""
    if "drive_peak_torque" not in result.forces:
        return None
    return pd.DataFrame(
        [
            {"case": case.name}
            | {
                column: factor * float(result.forces[name].sel(case=case.name))
                for column, (name, factor) in DRIVE.items()
            }
            for case in result.cases
        ]
    )


def drive_table(result: SpinCycleResult) -> Table | None:
    """Return the measures of the drive of each case; None without a motor."""
    frame = drive_frame(result)
    if frame is None:
        return None
    caption = (
        "Drive: largest torque on the drum; largest torque averaged over a revolution, and the "
        "speed there; largest power; speed ripple, the largest coefficient of fluctuation in a "
        "revolution; speed at the end; speed at which the drum stays below the wanted one "
        "(Sommerfeld effect). drive.csv has all numbers."
    )
    kinds = ["alarm" if caught else "" for caught in frame["caught_rpm"].notna()]
    return table_of(frame[list(SHOWN_DRIVE)], caption, SHOWN_DRIVE, kinds)


SHOWN_FEET = {
    "case": Column("case"),
    "smallest_normal_force_N": Column("smallest load of a foot", "N", 1),
    "slide_margin_N": Column("margin of sliding", "N", 1),
    "turn_margin_Nm": Column("margin of turning", "N\u00a0m", 1),
    "tilt_margin_Nm": Column("margin of tilting", "N\u00a0m", 1),
    "where": Column("turning smallest in"),
}
"""Columns of the feet on the page."""

MARGIN_COLUMNS = list(SHOWN_FEET)[1:-1]
"""Columns of loads and margins."""


def feet_frame(result: SpinCycleResult) -> pd.DataFrame:
    """Return a row for each case and region, and one for the whole run: loads and margins."""
    rows: list[dict[str, Any]] = []
    for case in result.cases:
        feet = as_json(result.forces.sel(case=case.name))["feet"]
        parts = {"run": feet, **feet.pop("regions")}
        rows += [{"case": case.name, "part": part, **values} for part, values in parts.items()]
    return pd.DataFrame(rows).astype(dict.fromkeys(MARGIN_COLUMNS, float))


def floor_table(result: SpinCycleResult) -> Table | None:
    """Return the smallest loads and margins of each case; None without a cabinet."""
    if "turn_margin" not in result.forces:
        return None
    frame = feet_frame(result)
    regions = frame[frame["part"] != "run"].dropna(subset="turn_margin_Nm")
    lowest = regions.loc[regions.groupby("case")["turn_margin_Nm"].idxmin()].set_index("case")
    whole = frame[frame["part"] == "run"].drop(columns="part")
    whole = whole.assign(where=whole["case"].map(lowest["part"]))
    kinds = ["alarm" if low <= 0.0 else "" for low in whole[MARGIN_COLUMNS].min(axis=1)]
    which, below = "which the model keeps in its place", "Below 0 the cabinet would slide, turn"
    if result.parameters.cabinet_moves:
        which, below = "which moves on them", "At 0 the cabinet slides or turns, or is about to"
    caption = (
        f"Feet of the rigid cabinet, {which}: smallest normal load of any foot; horizontal force "
        "that friction can still take; vertical moment that friction can still take beside it, "
        "and the region where this is smallest; moment that still keeps the cabinet down. "
        f"{below} or tip. feet.csv has each region."
    )
    return table_of(whole, caption, SHOWN_FEET, kinds)


def floor_warnings(result: SpinCycleResult) -> list[str]:
    """Return a warning that names the cases in which the cabinet would slide, turn or tip."""
    if "turn_margin" not in result.forces:
        return []
    margins = np.min([result.forces[name].values for name in MARGINS[1:]], axis=0)
    moving = [
        case.name
        for case, margin, diverged in zip(result.cases, margins, result.diverged, strict=True)
        if margin <= 0.0 and not diverged
    ]
    if not moving:
        return []
    if result.parameters.cabinet_moves:
        return [f"The cabinet slides, turns or lifts a side in case {', '.join(moving)}."]
    return [
        f"The cabinet would slide, turn or tip over in case {', '.join(moving)}. The model keeps "
        "it in its place."
    ]
