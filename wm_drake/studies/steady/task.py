"""The study of the steady response: its task, and its result as files, JSON and page."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.model.machine import Machine
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.mounts import KINDS
from wm_drake.studies.inputs import quantities_of, selected_cases
from wm_drake.studies.run import Executor
from wm_drake.studies.steady.balance import SAMPLES
from wm_drake.studies.steady.options import ResponseOptions
from wm_drake.studies.steady.study import RATES_RPM_S, SteadyStudy, run_steady_study
from wm_drake.studies.study import Facts, Result, Task

if TYPE_CHECKING:
    from rich.table import Table


@dataclass(frozen=True)
class ResponseResult(Result):
    """Result of the study."""

    study: SteadyStudy

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the responses and, if computed, the sweeps."""
        from wm_drake.studies.steady.page import response_table, sweeps_table

        shown = {"response": response_table(self.study)}
        return shown if self.study.sweeps is None else shown | {"sweeps": sweeps_table(self.study)}

    def as_json(self) -> dict[str, Any]:
        """Return the responses for JSON."""
        return _as_json(self.study)

    def terminal(self) -> "list[Table | str]":
        """Return the largest amplitudes and a summary."""
        from wm_drake.studies.steady.page import summary, terminal_table

        return [terminal_table(self.study), summary(self.study)]

    def page(self, facts: Facts) -> str:
        """Return the page."""
        from wm_drake.studies.steady.page import response_page

        return response_page(self.study, facts)


class ResponseTask(Task):
    """The study with checked options."""

    def __init__(self, options: ResponseOptions, machine: Machine) -> None:
        """Check speeds, sweep rates and loads.

        Raises:
            InputError: one of them is wrong.
        """
        self.options, self.machine = options, machine
        parameters = machine.parameters
        self.speeds = self._speeds()
        self.rates = tuple(map(_rate, options.rate)) or RATES_RPM_S
        cases = selected_cases(parameters, options.load, True, None)
        self.loads = [(case.name, case.load) for case in cases]
        if not self.loads:
            raise input_error(f"machine '{parameters.name}' has no loads", key="loads")

    def _speeds(self) -> FloatArray:
        """Return the speeds that the options select. [rad/s]"""
        speed, high = Unit("rad/s", "rpm"), self.options.high
        first = quantities_of(self.options.low, speed, "--from")[0]
        last = max(self.machine.parameters.profile.speed)
        if high is not None:
            last = quantities_of(high, speed, "--to")[0]
        if not 0.0 < first < last:
            raise input_error(
                f"{speed.from_si(first):g} rpm is not above 0 and below the highest speed, "
                f"{speed.from_si(last):g} rpm",
                where="--from",
            )
        return np.linspace(first, last, self.options.points)

    def run(self, executor: Executor) -> ResponseResult:
        """Compute responses, runs over the spin profile, and sweeps."""
        options = self.options
        is_without = options.no_gasket or self.machine.parameters.gasket is None
        with executor.fraction("response") as progress:
            study = run_steady_study(
                self.machine,
                self.loads,
                self.speeds,
                gaskets=(False,) if is_without else (True, False),
                harmonics=options.harmonics,
                samples=max(SAMPLES, 8 * options.harmonics),
                rates_rpm_s=() if options.no_sweeps else self.rates,
                workers=options.workers,
                progress=progress,
            )
        return ResponseResult(study)


def _rate(text: str) -> float:
    """Return a sweep rate. [rpm/s]"""
    unit = Unit("rad/s^2", "rpm/s")
    rate = unit.from_si(quantities_of(text, unit, "--rate")[0])
    if not 0.1 <= rate <= 1000.0:
        raise input_error(f"'{text}' is not between 0.1 and 1000 rpm/s", where="--rate")
    return rate


def _as_json(study: SteadyStudy) -> dict[str, Any]:
    millimetre, rpm = Unit("m", "mm").from_si(1.0), Unit("rad/s", "rpm").from_si(1.0)
    degree = Unit("rad/s", "deg/s").from_si(1.0)

    def columns(values: Any, dim: str, factor: float = 1.0) -> dict[str, list[float]]:
        return {
            str(label): (factor * values.sel({dim: label}).values).tolist()
            for label in values[dim].values
        }

    return {
        "machine": study.parameters.name,
        "harmonics": study.cases[0].response.attrs["harmonics"],
        "cases": [
            {
                "load": case.load,
                "gasket": case.gasket,
                "rpm": (rpm * case.response.speed.values).tolist(),
                "amplitudes_mm": columns(case.response.amplitude, "sensor", millimetre),
                "detergent_box_mm": columns(
                    case.response.detergent_displacement, "axis", millimetre
                ),
                "gasket_force_N": columns(case.response.gasket_force, "axis"),
                "gasket_moment_Nm": columns(case.response.gasket_moment, "axis"),
                "spring_tension_N": columns(case.response.spring_tension, "spring"),
                "damper_tension_N": columns(case.response.damper_tension, "damper"),
                "mount_force_N": _mount_forces(case.response),
                "damper_spin_deg_s": columns(case.response.damper_spin, "spinning", degree),
                "stable": case.response.stable.values.tolist(),
                "wall_s": case.wall_s,
            }
            for case in study.cases
        ],
        "wall_s": study.wall_s,
    }


def _mount_forces(response: xr.Dataset) -> dict[str, dict[str, list[float]]]:
    """Return peak and RMS of the force of each mount on the cabinet, over the speeds. [N]"""
    return {
        str(mount): {
            kind: response[f"mount_force_{kind}"].sel(mount=mount).values.tolist() for kind in KINDS
        }
        for mount in response.mount.values
    }
