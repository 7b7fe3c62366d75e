"""Check the options of the steady response, and compute it."""

import numpy as np

from wm_drake.errors import input_error
from wm_drake.model.machine import Machine
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import SPEED
from wm_drake.studies.answer import Answer
from wm_drake.studies.executor import Executor
from wm_drake.studies.inputs import quantities_of, selected_cases
from wm_drake.studies.response.balance import SAMPLES
from wm_drake.studies.response.options import ResponseOptions
from wm_drake.studies.response.page import response_answer
from wm_drake.studies.response.quantities import RATE
from wm_drake.studies.response.study import RATES, ResponseSettings, run_response_study
from wm_drake.studies.study import Task

ALLOWED_RATES = (0.1, 1000.0)
"""Least and largest sweep rate, in the unit for reading."""


class ResponseTask(Task):
    """The study with checked options."""

    def __init__(self, options: ResponseOptions, machine: Machine) -> None:
        """Check speeds, sweep rates and loads."""
        self.options, self.machine = options, machine
        parameters = machine.parameters
        self.speeds = self._speeds()
        self.rates = tuple(map(_rate, options.rate)) or RATES
        cases = selected_cases(parameters, options.load, True, None)
        self.loads = {case.name: case.load for case in cases}
        if not self.loads:
            raise input_error(f"machine '{parameters.name}' has no loads", key="loads")

    def _speeds(self) -> FloatArray:
        """Return the speeds that the options select. [rad/s]"""
        speed, high = SPEED.unit, self.options.high
        first = quantities_of(self.options.low, speed, "--from")[0]
        last = self.machine.parameters.profile.highest_speed
        if high is not None:
            last = quantities_of(high, speed, "--to")[0]
        if not 0.0 < first < last:
            raise input_error(
                f"{speed.from_si(first):g} {speed.label} is not above 0 and below the highest "
                f"speed, {speed.from_si(last):g} {speed.label}",
                where="--from",
            )
        return np.linspace(first, last, self.options.points)

    def run(self, executor: Executor) -> Answer:
        """Compute responses, runs over the spin profile, and sweeps."""
        options = self.options
        is_without = options.no_gasket or self.machine.parameters.gasket is None
        settings = ResponseSettings(
            self.speeds,
            (False,) if is_without else (True, False),
            options.harmonics,
            max(SAMPLES, 8 * options.harmonics),
            () if options.no_sweeps else self.rates,
            options.workers,
        )
        with executor.fraction("response") as progress:
            cases, sweeps = run_response_study(
                self.machine, self.loads, settings, progress, executor.steps
            )
        return response_answer(self.machine.parameters, cases, sweeps)


def _rate(text: str) -> float:
    """Return a sweep rate. [rad/s^2]"""
    rate = quantities_of(text, RATE.unit, "--rate")[0]
    least, most = ALLOWED_RATES
    if not least <= RATE.values(rate) <= most:
        raise input_error(
            f"'{text}' is not between {least:g} and {most:g} {RATE.unit_text}", where="--rate"
        )
    return rate
