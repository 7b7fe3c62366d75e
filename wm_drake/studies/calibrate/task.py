"""Check the options of a calibration, and run it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from wm_drake.errors import input_error, problems_at
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.measured import measured_amplitudes, measured_responses
from wm_drake.parameters.units import plain_number
from wm_drake.parameters.vary_file import VARY_FILES, load_vary
from wm_drake.simulation.cases import case_of
from wm_drake.simulation.records import Record
from wm_drake.studies.answer import Answer
from wm_drake.studies.calibrate.options import CalibrateOptions
from wm_drake.studies.calibrate.page import calibrate_answer
from wm_drake.studies.calibrate.parameter_map import read_parameter_map
from wm_drake.studies.calibrate.prediction import check_held_out, predict
from wm_drake.studies.calibrate.records_task import CalibrateRecordsTask
from wm_drake.studies.calibrate.response_targets import with_deviations
from wm_drake.studies.calibrate.solutions import DIFFERENCE, solved_machine
from wm_drake.studies.calibrate.study import (
    RELATIVE_DEVIATION,
    Calibration,
    SearchPlan,
    calibrate,
)
from wm_drake.studies.calibrate.targets import AMPLITUDE, MEASURED, Targets, targets_of
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.inputs import pairs_of, with_measured
from wm_drake.studies.modes.natural import natural_modes
from wm_drake.studies.study import Task

OF_RECORDS = ("unknown", "by", "test", "load", "profile", "speed", "unit", "channels")
"""Options that are about records, not about targets."""


def calibrate_task(options: CalibrateOptions, machine: Machine) -> Task:
    """Return the calibration to records, if there are any, or that to targets."""
    if options.records:
        return CalibrateRecordsTask(options, machine)
    return CalibrateTask(options, machine)


class CalibrateTask(Task):
    """A calibration to targets with checked options; `calibration` is what it found."""

    calibration: Calibration

    def __init__(self, options: CalibrateOptions, machine: Machine) -> None:
        """Read targets and vary file, and check the settings of the searches.

        Raises:
            InputError: an option or a file is wrong.
        """
        for name in OF_RECORDS:
            if name in options.model_fields_set:
                raise input_error("is about records, and none is given", where=f"--{name}")
        if options.vary is None:
            raise input_error("is missing; name a vary file", where="--vary")
        self.options, self.held_out = options, _groups(options.leave_out)
        measured = with_measured(machine.parameters, options.targets, "--targets")
        deviations = _fractions(options.deviation, "--deviation")
        amplitude = deviations.pop(AMPLITUDE, RELATIVE_DEVIATION)
        targets = _targets(measured, deviations).weighted(_numbers(options.weight, "--weight"))
        with problems_at("--limit", ""):
            self.targets = targets.limited(_fractions(options.limit, "--limit"))
        # the calibrated machine names the targets as its measurements
        self.machine = build_machine(measured) if options.targets else machine
        resolution = float(MEASURED.unit.to_si(options.resolution))
        self.plan = SearchPlan(
            options.starts, options.seed, options.iterations, amplitude, resolution
        )
        self.free = load_vary(options.vary)
        check_held_out(self.targets, self.held_out)
        read_parameter_map(self.machine, VARY_FILES.path(options.vary), self.free)

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the searches beside the machine."""
        return {
            "free": self.free,
            "targets": self.targets,
            "plan": self.plan,
            "leave_out": "; ".join(map(",".join, self.held_out)),
        }

    def run(self, executor: Executor) -> Answer:
        """Calibrate, predict the held-out loads, and run the best machine."""
        experiment = Experiment(self.machine, (), executor.simulate)
        with executor.fraction("searches") as report:
            calibration = calibrate(
                experiment, self.free, self.targets, self.plan, lambda done, least: report(done)
            )
        predictions = []
        for group in self.held_out:
            with executor.fraction(f"without {', '.join(group)}"):
                predictions += predict(experiment, self.free, calibration, [group])
        best = build_machine(solved_machine(calibration.solutions[0]))
        parameters, records = best.parameters, dict[int, Record]()
        cases = [case_of(parameters, name, gasket=gasket) for name, gasket in self.targets.loads]
        executor.records(best, cases, records.__setitem__)
        titles = {False: "without gasket", True: "with gasket"}
        states = titles if parameters.gasket else {False: "modes"}
        modes = {title: natural_modes(best, gasket=gasket) for gasket, title in states.items()}
        runs = [records[number] for number in range(len(cases))]
        self.calibration = calibration
        return calibrate_answer(calibration, predictions, parameters, runs, modes)


def _targets(parameters: MachineParameters, deviations: Mapping[str, float]) -> Targets:
    if not parameters.measured:
        raise input_error(
            f"machine '{parameters.name}' names no measured amplitudes of its own; name a CSV file",
            where="--targets",
        )
    targets = targets_of(
        parameters,
        measured_amplitudes(parameters),
        ", ".join(Path(name).name for name in parameters.measured),
        measured_responses(parameters),
    )
    with problems_at("--deviation", ""):
        return replace(targets, responses=with_deviations(targets.responses, deviations))


def _fractions(entries: Sequence[str], option: str) -> dict[str, float]:
    """Return the numbers of NAME=PERCENT entries; one without a name is that of all amplitudes."""
    plain = [entry for entry in entries if "=" not in entry]
    if len(plain) > 1:
        raise input_error(
            f"{' and '.join(plain)} are given; one number without a name is allowed, that of the "
            "amplitudes",
            where=option,
        )
    named = [entry for entry in entries if "=" in entry]
    named += [f"{AMPLITUDE}={entry}" for entry in plain]
    numbers = _numbers(named, option, zero=False)
    return {name: DIFFERENCE.unit.to_si(number) for name, number in numbers.items()}


def _numbers(entries: Sequence[str], option: str, zero: bool = True) -> dict[str, float]:
    """Return the numbers of NAME=NUMBER entries, each finite and above 0, or 0 where allowed."""
    numbers: dict[str, float] = {}
    for name, text in pairs_of(entries, option):
        try:
            number = plain_number(text)
        except ValueError as error:
            raise input_error(str(error), where=option, key=name) from None
        if not 0.0 <= number < math.inf or (number == 0.0 and not zero):
            allowed = ">= 0" if zero else "> 0"
            raise input_error(
                f"'{text}' is not allowed; must be {allowed} and finite", where=option, key=name
            )
        if name in numbers:
            raise input_error("is given twice", where=option, key=name)
        numbers[name] = number
    return numbers


def _groups(entries: Sequence[str]) -> list[list[str]]:
    """Return the groups of loads that `--leave-out` names."""
    groups = [[name.strip() for name in entry.split(",")] for entry in entries]
    for names in groups:
        for name in names:
            if names.count(name) > 1:
                raise input_error(f"'{name}' is given twice", where="--leave-out")
    return groups
