"""Comparison of spin results: machines or variants of one, with the differences of all measures."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import (
    MachineParameters,
    SpinProfile,
    measured_amplitudes,
    measured_changes,
)
from wm_drake.parameters.measured import EXPERIMENT
from wm_drake.parameters.units import Unit
from wm_drake.simulation.displacements import percent_difference, smooth_envelope
from wm_drake.simulation.measures import MEASURES, Variable
from wm_drake.simulation.measures.as_json import labelled_values
from wm_drake.simulation.measures.registry import tabulated
from wm_drake.simulation.records import Record
from wm_drake.studies.spin.study import CaseResult, SpinRuns

MOST_VARIANTS = 6
"""Largest number of variants that a figure can tell apart."""


GROUPS = {
    "amplitude": "amplitude",
    "critical_speed": "critical speed",
    "detergent_displacement": "detergent box displacement",
    "smallest_gap": "smallest gap",
    "gasket_force": "gasket force",
    "gasket_moment": "gasket moment",
    "mount_force_peak": "largest mount force",
}
"""Names of the variables in a table of differences, in its order; others have their kind."""

DIFFERENCE_COLUMNS = [
    "load",
    "measure",
    "name",
    "unit",
    "reference",
    "variant",
    "reference_value",
    "value",
    "difference",
    "percent",
]
"""Columns of `difference_table`."""


@dataclass(frozen=True)
class Variant:
    """One of the results that are compared: a machine, with or without gasket.

    Attributes:
        name: Name in figures and tables.
        result: Its spin result. All variants of a comparison have the same loads in the same order.
    """

    name: str
    result: SpinRuns

    @property
    def page(self) -> str:
        """Name of the file with its own page."""
        return f"report_{self.result.files.part}.html"


def compared_variables() -> dict[str, Variable]:
    """Return the variables of a table of differences by their name there, in its order."""
    known = {v.name: v for measure in MEASURES.values() for v in measure.variables}
    return {title: known[name] for name, title in GROUPS.items()} | {
        variable.kind: variable for variable in tabulated()
    }


def measures_of(case: CaseResult) -> dict[tuple[str, str, str], float]:
    """Return the measures of a case by group, name and unit; NaN for forces of an absent gasket.

    A group is what is measured, such as "amplitude"; a name is a sensor, an axis or a mount, or
    empty if there is only one.
    """
    has_gasket, measured = case.record.attrs["gasket"] == "yes", {}
    for title, variable in compared_variables().items():
        is_known = has_gasket or not variable.name.startswith("gasket_")
        for labels, value in labelled_values(case.measures.table, variable):
            if has_gasket or labels != ("gasket",):
                key = title, " ".join(labels), variable.unit.shown
                measured[key] = np.nan if value is None or not is_known else value
    return measured


def difference_table(variants: Sequence[Variant]) -> pd.DataFrame:
    """Return the differences of all measures between each variant and the first one.

    Returns:
        Columns load, measure, name, unit, reference and variant (names of variants),
        reference_value, value, difference (value - reference_value) and percent (of the absolute
        reference value; NaN if that is zero). Values are NaN where a variant lacks the measure, for
        example a gasket force without gasket. A measure that only some variants have, such as the
        force of a mount, has a row for each variant.
    """
    rows, order = [], list(compared_variables())
    for index, case in enumerate(variants[0].result.results):
        of_variants = [measures_of(variant.result.results[index]) for variant in variants]
        keys = list(dict.fromkeys(key for values in of_variants for key in values))
        keys.sort(key=lambda key: order.index(key[0]))  # a stable sort
        for key in keys:
            reference = of_variants[0].get(key, np.nan)
            for variant, values in zip(variants[1:], of_variants[1:], strict=True):
                value = values.get(key, np.nan)
                percent = 100.0 * (value - reference) / abs(reference) if reference else np.nan
                names = (case.case.name, *key, variants[0].name, variant.name)
                rows.append((*names, reference, value, value - reference, percent))
    return pd.DataFrame(rows, columns=DIFFERENCE_COLUMNS)


def check_comparable(machines: Sequence[MachineParameters], where: str) -> None:
    """Raise an InputError if machines cannot be compared on one page.

    Their names must differ and they need at least one sensor of the same name.

    Args:
        where: Option that named the machines, for the message.
    """
    names = [machine.name for machine in machines]
    for name in names:
        if names.count(name) > 1:
            raise input_error(
                f"{names.count(name)} machines have the name '{name}'; give each machine file its "
                "own 'name'",
                where=where,
            )
    if not common_sensors(machines):
        sensors = "; ".join(f"'{m.name}' has {', '.join(m.sensors)}" for m in machines)
        raise input_error(f"the machines have no sensor of the same name: {sensors}", where=where)


def common_sensors(machines: Sequence[MachineParameters]) -> list[str]:
    """Return the names of the sensors that all machines have, in the order of the first one."""
    return [name for name in machines[0].sensors if all(name in m.sensors for m in machines)]


def remarks(variants: Sequence[Variant]) -> list[str]:
    """Return what a reader must know about variants whose conditions differ, as sentences."""
    sentences = []
    first = variants[0]
    for variant in variants[1:]:
        for a, b in zip(first.result.results, variant.result.results, strict=True):
            both = f"'{first.name}' and '{variant.name}'"
            if a.case.load != b.case.load:
                sentences.append(f"Load {a.case.name} is not the same in {both}.")
        if first.result.results[0].case.profile != variant.result.results[0].case.profile:
            sentences.append(f"{both} follow different spin profiles.")
    machines = [variant.result.parameters for variant in variants]
    shared = common_sensors(machines)
    for machine in machines:
        unshared = [name for name in machine.sensors if name not in shared]
        if unshared:
            sentences.append(
                f"Not all machines have the sensors {', '.join(unshared)} of '{machine.name}'; the "
                "figures leave them out."
            )
        for name in shared:
            axes = machines[0].sensors[name].axis, machine.sensors[name].axis
            if axes[0] != axes[1]:
                sentences.append(
                    f"Sensor {name} measures along {axes[0]} in '{machines[0].name}' and along "
                    f"{axes[1]} in '{machine.name}'."
                )
    return list(dict.fromkeys(sentences))


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


def effect_table(without: SpinRuns, with_gasket: SpinRuns) -> pd.DataFrame:
    """Return the amplitudes of each load and sensor without and with gasket.

    Returns:
        Columns load, sensor, without_mm, with_mm, percent ([B] Eq. (1)); experiment_without_mm,
        experiment_with_mm, experiment_percent, which are NaN where nothing was measured or compared
        ([B] Table 1, percentages as printed); steady_without_mm, steady_with_mm, steady_percent,
        which are NaN if the profile has no stretch of constant speed.
    """
    rows = []
    changes = measured_changes(with_gasket.parameters)
    changes = changes[changes["source"] == EXPERIMENT].set_index("load")
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
            row: dict[str, Any] = {"load": first.case.name, "sensor": sensor}
            for prefix, values in columns.items():
                one, other = (value.sel(sensor=sensor) for value in values)
                row[f"{prefix}without_mm"] = MM.from_si(float(one))
                row[f"{prefix}with_mm"] = MM.from_si(float(other))
                row[f"{prefix}percent"] = float(percent_difference(other, one))
            if np.isfinite(row["experiment_percent"]):
                row["experiment_percent"] = changes.loc[first.case.name, sensor]
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


def _experiment(result: SpinRuns, case: CaseResult) -> xr.DataArray:
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
