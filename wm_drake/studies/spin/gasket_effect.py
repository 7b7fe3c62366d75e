"""Effect of the gasket on amplitudes: percent differences of [B] Eq. (1), and the steady state."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.parameters import SpinProfile, measured_amplitudes
from wm_drake.parameters.units import Unit
from wm_drake.simulation.displacements import percent_difference, smooth_envelope
from wm_drake.simulation.records import Record
from wm_drake.studies.spin.comparison import Variant
from wm_drake.studies.spin.study import CaseResult, SpinResult

EXPERIMENT = "experiment"
"""Source of the measured amplitudes that computed ones are compared with."""

STEADY_PART = 0.5
"""Part of a stretch of constant speed, at its end, that counts as the steady state.

An assumption: in the first part the motion of the run-up decays. At 400 rpm in [B] it is the last
6.4 of 12.9 s.
"""

SMALL_STEADY = 10.0
"""Largest difference of steady amplitudes for which the gasket is said to matter little. [%]

[B] section 2.2 says it is negligible, without a number; the limit is an assumption.
"""

LARGE_STEADY = 1.0
"""Steady amplitude without gasket from which on its difference in percent is judged. [mm]

An assumption: a part of a smaller one is below what can be seen on a tub.
"""

MM = Unit("m", "mm")


def steady_window(profile: SpinProfile) -> tuple[float, float] | None:
    """Return the time interval of the steady state; None if the profile has none. [s]

    It is the last part of the stretch of constant speed with the highest speed.
    """
    time, speed = np.array(profile.time), np.abs(profile.speed)
    constant = (np.diff(speed) == 0.0) & (speed[1:] > 0.0)
    if not constant.any():
        return None
    first = int(np.argmax(np.where(constant, speed[1:], -1.0)))
    begin, end = float(time[first]), float(time[first + 1])
    return end - STEADY_PART * (end - begin), end


def steady_amplitudes(record: Record, window: tuple[float, float]) -> xr.DataArray:
    """Return the amplitude of each sensor in the steady state: the mean smooth envelope. [m]"""
    return smooth_envelope(record).sel(time=slice(*window)).mean("time")


def effect_table(without: SpinResult, with_gasket: SpinResult) -> pd.DataFrame:
    """Return the amplitudes of each load and sensor without and with gasket.

    Returns:
        Columns load, sensor, without_mm, with_mm, percent ([B] Eq. (1)); experiment_without_mm,
        experiment_with_mm, experiment_percent, which are NaN where nothing was measured or compared
        ([B] Table 1); steady_without_mm, steady_with_mm, steady_percent, which are NaN if the
        profile has no stretch of constant speed.
    """
    rows = []
    for both in zip(without.results, with_gasket.results, strict=True):
        first = both[0]
        window = steady_window(first.case.profile)
        missing = xr.full_like(first.measures.amplitude, np.nan)
        measured = zip((without, with_gasket), both, strict=True)
        columns = {
            "": [case.measures.amplitude for case in both],
            "experiment_": [_experiment(result, case) for result, case in measured],
            "steady_": [steady_amplitudes(c.record, window) if window else missing for c in both],
        }
        for sensor in map(str, first.record.sensor.values):
            row: dict[str, object] = {"load": first.case.name, "sensor": sensor}
            for prefix, values in columns.items():
                one, other = (value.sel(sensor=sensor) for value in values)
                row[f"{prefix}without_mm"] = MM.from_si(float(one))
                row[f"{prefix}with_mm"] = MM.from_si(float(other))
                row[f"{prefix}percent"] = float(percent_difference(other, one))
            rows.append(row)
    return pd.DataFrame(rows)


def effects(variants: Sequence[Variant]) -> pd.DataFrame:
    """Return the effect of the gasket of one machine or several.

    Args:
        variants: With and without gasket, for each machine.

    Returns:
        Result of `effect_table`; of several machines, with a column machine before the others.
    """
    tables = []
    for with_gasket, without in zip(variants[::2], variants[1::2], strict=True):
        table = effect_table(without.result, with_gasket.result)
        if len(variants) > 2:
            table.insert(0, "machine", without.result.parameters.name)
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def _experiment(result: SpinResult, case: CaseResult) -> xr.DataArray:
    """Return the measured amplitude of each sensor; NaN where nothing is compared. [m]"""
    sensors = [str(name) for name in case.record.sensor.values]
    values = np.full(len(sensors), np.nan)
    if result.is_compared(case):
        table = measured_amplitudes(result.parameters)
        gasket = case.record.attrs["gasket"]
        kept = (table["load"] == case.case.name) & (table["gasket"] == gasket)
        rows = table[kept & (table["source"] == EXPERIMENT)]
        if len(rows):
            values = rows.iloc[0][sensors].to_numpy(dtype=float) / MM.from_si(1.0)
    return xr.DataArray(values, {"sensor": sensors}, ["sensor"])
