"""Effect of the gasket on amplitudes: percent differences of [B] Eq. (1), and the steady state."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, SpinProfile, measured_amplitudes
from wm_drake.parameters.units import Unit
from wm_drake.simulation.cases import Case
from wm_drake.simulation.displacements import percent_difference, smooth_envelope
from wm_drake.simulation.records import Record, save_record
from wm_drake.simulation.runs import DEFAULT_ENGINE
from wm_drake.studies.gasket_effect.options import GasketEffectOptions
from wm_drake.studies.inputs import selected_cases, with_measured
from wm_drake.studies.run import Executor
from wm_drake.studies.spin.comparison import Variant
from wm_drake.studies.spin.study import (
    CaseResult,
    Comparison,
    SpinResult,
    compared_cases,
    run_spin,
)
from wm_drake.studies.study import Facts, Result, Task

if TYPE_CHECKING:
    from rich.table import Table

WITHOUT, WITH = "without gasket", "with gasket"
"""Names of the two variants; differences are in percent of the first."""

LOADS = ("middle", "counter")
"""Loads of [B] section 2.1."""

EXPERIMENT = "experiment"
"""Source of the measured amplitudes."""

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


@dataclass(frozen=True)
class GasketEffect:
    """Results without and with gasket, with the same cases in the same order."""

    without: SpinResult
    with_gasket: SpinResult

    @property
    def variants(self) -> tuple[Variant, Variant]:
        """The two results in the form of a comparison."""
        return Variant(WITHOUT, self.without), Variant(WITH, self.with_gasket)

    @property
    def pairs(self) -> list[tuple[CaseResult, CaseResult]]:
        """The case without and with gasket, for each load."""
        return list(zip(self.without.results, self.with_gasket.results, strict=True))


def run_gasket_effect(
    parameters: MachineParameters,
    cases: Sequence[Case],
    engine: str = DEFAULT_ENGINE,
    *,
    progress: Callable[[int, float], None] = lambda index, fraction: None,
    comparison: Comparison = Comparison.AS_MEASURED,
) -> GasketEffect:
    """Run cases without and with gasket.

    Args:
        parameters: The machine.
        cases: One case per load; whether they have the gasket does not matter.
        engine: Name of the engine.
        progress: Called with the index of a run and the fraction of it that is done. The runs
            without gasket come first.
        comparison: Which cases are compared with measured amplitudes.

    Raises:
        InputError: the machine has no gasket.
    """
    _check_gasket(parameters)
    both = []
    for index, gasket in enumerate((False, True)):
        first = index * len(cases)
        chosen = [replace(case, gasket=gasket) for case in cases]

        def report(number: int, fraction: float, first: int = first) -> None:
            progress(first + number, fraction)

        both.append(run_spin(parameters, chosen, engine, progress=report, comparison=comparison))
    return GasketEffect(*both)


def _check_gasket(parameters: MachineParameters) -> None:
    if parameters.gasket is None:
        raise input_error(
            f"machine '{parameters.name}' has no gasket; this study needs one", key="gasket"
        )


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


def effect_table(effect: GasketEffect) -> pd.DataFrame:
    """Return the amplitudes of each load and sensor without and with gasket.

    Returns:
        Columns load, sensor, without_mm, with_mm, percent ([B] Eq. (1)); experiment_without_mm,
        experiment_with_mm, experiment_percent, which are NaN where nothing was measured or compared
        ([B] Table 1); steady_without_mm, steady_with_mm, steady_percent, which are NaN if the
        profile has no stretch of constant speed.
    """
    rows = []
    for without, with_gasket in effect.pairs:
        both = (without, with_gasket)
        columns = {"": xr.concat([case.measures.amplitude for case in both], "gasket")}
        columns["experiment_"] = xr.concat(
            [
                _experiment(r, c)
                for r, c in zip((effect.without, effect.with_gasket), both, strict=True)
            ],
            "gasket",
        )
        window = steady_window(without.case.profile)
        missing = xr.full_like(without.measures.amplitude, np.nan)
        columns["steady_"] = xr.concat(
            [steady_amplitudes(c.record, window) if window else missing for c in both], "gasket"
        )
        for sensor in map(str, without.record.sensor.values):
            row: dict[str, object] = {"load": without.case.name, "sensor": sensor}
            for prefix, values in columns.items():
                first, second = values.sel(sensor=sensor)
                row[f"{prefix}without_mm"] = MM.from_si(float(first))
                row[f"{prefix}with_mm"] = MM.from_si(float(second))
                row[f"{prefix}percent"] = float(percent_difference(second, first))
            rows.append(row)
    return pd.DataFrame(rows)


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


@dataclass(frozen=True)
class GasketEffectResult(Result):
    """Result of the study: both runs, and the table of amplitudes."""

    effect: GasketEffect
    table: pd.DataFrame

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the amplitudes."""
        return {"effect": self.table}

    def write(self, folder: Path) -> None:
        """Write the amplitudes, and the record of each run."""
        super().write(folder)
        for variant in self.effect.variants:
            for result in variant.result.results:
                name = f"record_{variant.name.replace(' ', '_')}_{result.case.name}.nc"
                save_record(result.record, folder / name)

    def as_json(self) -> dict[str, Any]:
        """Return the amplitudes for JSON, which has no NaN."""
        without = self.effect.without
        return {
            "machine": without.parameters.name,
            "steady_window_s": steady_window(without.results[0].case.profile),
            "amplitudes": [
                {str(key): None if value != value else value for key, value in row.items()}
                for row in self.table.to_dict("records")
            ],
        }

    def terminal(self) -> "list[Table | str]":
        """Return the amplitudes and a summary."""
        from wm_drake.studies.gasket_effect.page import summary, terminal_table

        return [terminal_table(self.effect, self.table), summary(self.table)]

    def page(self, facts: Facts) -> str:
        """Return the page."""
        from wm_drake.studies.gasket_effect.page import gasket_effect_page

        return gasket_effect_page(self, facts)

    def failures(self) -> list[str]:
        """Return a line for each run that diverged."""
        return [
            f"{case.case.name}, {variant.name}: {case.record.attrs['diverged']}"
            for variant in self.effect.variants
            for case in variant.result.results
            if case.record.attrs["diverged"]
        ]


class GasketEffectTask(Task):
    """The study with checked options."""

    def __init__(self, options: GasketEffectOptions, machine: Machine) -> None:
        """Check gasket, measured amplitudes and loads.

        Raises:
            InputError: the machine has no gasket, or a file or a load is wrong.
        """
        self.options = options
        self.parameters = with_measured(machine.parameters, options.measured, "--measured")
        measured_amplitudes(self.parameters)
        _check_gasket(self.parameters)
        default = [name for name in LOADS if name in self.parameters.loads]
        loads = options.load or default
        self.cases = selected_cases(self.parameters, loads, True, options.profile)

    def run(self, executor: Executor) -> GasketEffectResult:
        """Run all loads without and with the gasket."""
        comparison = compared_cases(self.options.measured, self.options.sets)
        names = [f"{c.name}, {text}" for text in (WITHOUT, WITH) for c in self.cases]
        with executor.fractions(names) as progress:
            effect = run_gasket_effect(
                self.parameters, self.cases, progress=progress, comparison=comparison
            )
        return GasketEffectResult(effect, effect_table(effect))
