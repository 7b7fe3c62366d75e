"""Tables of the drive study: CSV files and plain data for JSON."""

from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import GM_PER_KGM, plain
from wm_drake.studies.drive.study import DriveResult, motor_with_limit

rpm = Unit("rad/s", "rpm").from_si


def thresholds_table(result: DriveResult) -> pd.DataFrame:
    """Return the smallest torque limit of each load, at the motor's shaft and at the drum."""
    ratio = motor_with_limit(result.parameters)[0].belt_ratio
    return pd.DataFrame(
        [
            {
                "load": t.load,
                "caught_below_Nm": t.caught_below,
                "passes_from_Nm": t.passes_from,
                "passes_from_at_drum_Nm": ratio * t.passes_from,
                "caught_rpm": rpm(t.caught_speed),
                "caught_mean_torque_at_drum_Nm": t.caught_torque,
            }
            for t in result.thresholds
        ]
    )


def map_table(result: DriveResult) -> pd.DataFrame:
    """Return the map over torque limit and unbalance, a row for each run.

    The unbalance is the sum of the sizes of mass times radius, so masses that balance each other
    count.
    """
    torque_map = result.map
    rows = [
        {
            "load": torque_map.load,
            "mass_factor": factor,
            "sum_of_mass_times_radius_gm": GM_PER_KGM * torque_map.unbalance[u],
            "torque_limit_Nm": torque,
            "end_rpm": rpm(float(torque_map.end_speed[u, t])),
            "caught_rpm": rpm(float(torque_map.caught_speed[u, t])),
        }
        for u, factor in enumerate(torque_map.factors)
        for t, torque in enumerate(torque_map.torques)
    ]
    return pd.DataFrame(rows)


def estimation_table(result: DriveResult) -> pd.DataFrame:
    """Return planted and estimated unbalance of each random load. [g m]"""
    estimation = result.estimation
    if estimation is None:
        return pd.DataFrame()
    return pd.DataFrame(
        {
            "planted_gm": GM_PER_KGM * estimation.planted,
            "estimated_gm": GM_PER_KGM * estimation.estimated,
            "error_gm": GM_PER_KGM * estimation.errors,
            "from_torque_alone_gm": GM_PER_KGM * estimation.from_torque,
            "from_speed_alone_gm": GM_PER_KGM * estimation.from_speed,
        }
    )


def error_measures(result: DriveResult) -> dict[str, float] | None:
    """Return bias, RMS and 95 % quantile of the error of the estimated unbalance. [g m]"""
    if result.estimation is None:
        return None
    errors = GM_PER_KGM * result.estimation.errors
    return {
        "loads": float(len(errors)),
        "bias_gm": float(np.mean(errors)),
        "rms_gm": float(np.sqrt(np.mean(errors**2))),
        "p95_gm": float(np.quantile(np.abs(errors), 0.95)),
        "mean_planted_gm": float(np.mean(GM_PER_KGM * result.estimation.planted)),
    }


def as_plain_data(result: DriveResult) -> dict[str, Any]:
    """Return the result for JSON."""
    errors = error_measures(result)
    shown = {
        "machine": result.parameters.name,
        "runs": result.runs,
        "thresholds": thresholds_table(result).to_dict("records"),
        "map": map_table(result).to_dict("records"),
        "estimation": errors,
    }
    return plain(shown)
