"""Section of a spin-cycle page about the drive of a machine with a motor."""

import pandas as pd

from wm_drake.report.formatting import RPM_PER_RAD_S
from wm_drake.report.table import Column, Table, table_of
from wm_drake.studies.spin_cycle.study import SpinCycleResult

COLUMNS = {
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

SHOWN = {
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
                for column, (name, factor) in COLUMNS.items()
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
    return table_of(frame[list(SHOWN)], caption, SHOWN, kinds)
