"""Section of a spin-cycle page about the drive of a machine with a motor."""

import pandas as pd

from wm_drake.report.formatting import MISSING, RPM_PER_RAD_S, number
from wm_drake.report.tables import Table, line
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
    "peak_torque_Nm": 1,
    "mean_torque_Nm": 2,
    "mean_torque_rpm": 0,
    "peak_power_W": 0,
    "speed_ripple_percent": 1,
    "end_rpm": 0,
}
"""Columns of the table and their decimals; where the drum is caught follows."""


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
    """Return the measures of the drive of each case as text; None without a motor."""
    frame = drive_frame(result)
    if frame is None:
        return None
    groups = []
    for case in result.cases:
        values = dict(zip(COLUMNS, frame[frame["case"] == case.name].values[0, 1:], strict=True))
        shown = [number(values[name], places) for name, places in SHOWN.items()]
        caught = values["caught_rpm"] == values["caught_rpm"]
        shown.append(number(values["caught_rpm"], 0) if caught else MISSING)
        groups.append(line(case.name, shown, "alarm" if caught else ""))
    caption = (
        "Drive: largest torque on the drum; largest torque averaged over a revolution, and the "
        "speed there; largest power; speed ripple, the largest coefficient of fluctuation in a "
        "revolution; speed at the end; speed at which the drum stays below the wanted one "
        "(Sommerfeld effect). drive.csv has all numbers."
    )
    header = (
        "case",
        "peak torque, N\u00a0m",
        "mean torque, N\u00a0m",
        "at, rpm",
        "peak power, W",
        "ripple, %",
        "speed at the end, rpm",
        "caught at, rpm",
    )
    return Table(caption, header, tuple(groups))
