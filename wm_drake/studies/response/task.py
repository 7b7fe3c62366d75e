"""Check the options of the steady response, and compute it."""

import numpy as np

from wm_drake.errors import input_error
from wm_drake.model.machine import Machine
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.studies.executor import Executor
from wm_drake.studies.inputs import quantities_of, selected_cases
from wm_drake.studies.response.balance import SAMPLES
from wm_drake.studies.response.options import ResponseOptions
from wm_drake.studies.response.page import ResponseResult
from wm_drake.studies.response.study import RATES_RPM_S, Settings, run_steady_study
from wm_drake.studies.study import Result, Task


class ResponseTask(Task):
    """The study with checked options."""

    def __init__(self, options: ResponseOptions, machine: Machine) -> None:
        """Check speeds, sweep rates and loads."""
        self.options, self.machine = options, machine
        parameters = machine.parameters
        self.speeds = self._speeds()
        self.rates = tuple(map(_rate, options.rate)) or RATES_RPM_S
        cases = selected_cases(parameters, options.load, True, None)
        self.loads = {case.name: case.load for case in cases}
        if not self.loads:
            raise input_error(f"machine '{parameters.name}' has no loads", key="loads")

    def _speeds(self) -> FloatArray:
        """Return the speeds that the options select. [rad/s]"""
        speed, high = Unit("rad/s", "rpm"), self.options.high
        first = quantities_of(self.options.low, speed, "--from")[0]
        last = self.machine.parameters.profile.highest_speed
        if high is not None:
            last = quantities_of(high, speed, "--to")[0]
        if not 0.0 < first < last:
            raise input_error(
                f"{speed.from_si(first):g} rpm is not above 0 and below the highest speed, "
                f"{speed.from_si(last):g} rpm",
                where="--from",
            )
        return np.linspace(first, last, self.options.points)

    def run(self, executor: Executor) -> Result:
        """Compute responses, runs over the spin profile, and sweeps."""
        options = self.options
        is_without = options.no_gasket or self.machine.parameters.gasket is None
        settings = Settings(
            self.speeds,
            (False,) if is_without else (True, False),
            options.harmonics,
            max(SAMPLES, 8 * options.harmonics),
            () if options.no_sweeps else self.rates,
            options.workers,
        )
        with executor.fraction("response") as progress:
            study = run_steady_study(self.machine, self.loads, settings, progress)
        return ResponseResult(study)


def _rate(text: str) -> float:
    """Return a sweep rate. [rpm/s]"""
    unit = Unit("rad/s^2", "rpm/s")
    rate = unit.from_si(quantities_of(text, unit, "--rate")[0])
    if not 0.1 <= rate <= 1000.0:
        raise input_error(f"'{text}' is not between 0.1 and 1000 rpm/s", where="--rate")
    return rate
