"""Check the options of the identification from a spin cycle, and run it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from wm_drake.errors import check_known, input_error
from wm_drake.model.machine import Machine
from wm_drake.studies.answer import Answer
from wm_drake.studies.calibrate.blocks import calibrated
from wm_drake.studies.calibrate.records_task import (
    fitted_answer,
    record_model,
    recorded_load,
)
from wm_drake.studies.compare.options import CompareOptions
from wm_drake.studies.compare.recordings import check_distinct
from wm_drake.studies.compare.task import CompareTask
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.inputs import pairs_of, runnable_profile
from wm_drake.studies.spin_cycle.study import cases_of_table, measured_displacements, runs_of
from wm_drake.studies.spin_cycle.task import acceleration_doubts
from wm_drake.studies.spin_identify.options import SpinIdentifyOptions
from wm_drake.studies.spin_identify.page import spin_identify_answer
from wm_drake.studies.spin_identify.study import (
    planted_values,
    spin_model,
    unknowns_of,
    with_virtual_experiment,
)
from wm_drake.studies.study import Task

DEFAULT_CASES = ("2", "5", "29")
"""Cases of [A] Table 9: 400 g in front, at the rear, and both opposite, as in Figs. 24 to 26."""


class SpinIdentifyTask(Task):
    """The study with checked options."""

    def __init__(self, options: SpinIdentifyOptions, machine: Machine) -> None:
        """Check the unknowns, the cases and the profile, and read the measurements."""
        self.options, self.machine = options, machine
        self.profile = runnable_profile(options.profile, machine.parameters)
        names = options.case or (() if options.cases else DEFAULT_CASES)
        self.cases = cases_of_table(options.cases, names)
        self.free = unknowns_of(machine.parameters, options.unknown)
        self.measured, self.tests = None, dict[str, CompareTask]()
        self.measures = ("recorded regions" if options.accelerations else "regions",)
        if options.record:
            self.tests = self._tests()
        else:
            for name in ("test", "by"):
                if name in options.model_fields_set:
                    raise input_error("is about --record, and none is given", where=f"--{name}")
            self.measured = measured_displacements(
                options, machine.parameters, self.cases, self.profile
            )

    def _tests(self) -> dict[str, CompareTask]:
        """Return the records of each case that has some.

        Raises:
            InputError: a record belongs to no case, or is wrong.
        """
        options, parameters = self.options, self.machine.parameters
        for name in ("measured", "accelerations"):
            if getattr(options, name):
                raise input_error("not allowed together with --record", where=f"--{name}")
        runs = {run.name: run for run in runs_of(parameters, self.cases, self.profile)}
        files: dict[str, list[Path]] = {}
        for name, path in pairs_of(options.record, "--record"):
            check_known(name, runs, f"unknown case '{name}'", where="--record")
            files.setdefault(name, []).append(Path(path))
        shared = {"test": options.test, "unit": options.unit, "channels": options.channels}
        tests = {
            name: CompareTask(CompareOptions(records=paths, **shared), self.machine, runs[name])
            for name, paths in files.items()
        }
        check_distinct([one.channels for test in tests.values() for one in test.recordings])
        return tests

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs beside the machine."""
        measured = "none" if self.measured is None else self.measured.values
        return {
            "cases": self.cases,
            "profile": self.profile,
            "measurements": measured,
            "unknowns": [
                {"keys": varied.keys, "unknown": unknown}
                for varied, unknown in zip(self.free.varying.every, self.free.unknowns, strict=True)
            ],
            "noise": f"{self.options.noise:g}, seed {self.options.seed}",
            "records": f"{self.options.by}, {', '.join(self.options.record)}",
        }

    def run(self, executor: Executor) -> Answer:
        """Identify the unknowns, from measurements or from a virtual experiment."""
        if self.tests:
            return self._fitted(executor)
        seed, truth = self.options.seed, None
        runs = runs_of(self.machine.parameters, self.cases, self.profile)
        doubts = acceleration_doubts(executor, self.machine, self.options, runs)
        with executor.fraction("search") as report:
            experiment = Experiment(self.machine, self.measures, executor.simulate)
            model = spin_model(experiment, self.free, self.profile, self.cases, self.measured)
            if self.measured is None:
                planted = planted_values(self.free, seed)
                truth = dict(zip(self.free.names, planted.tolist(), strict=True))
                model = with_virtual_experiment(model, planted, self.options.noise, seed)
            fit, data = calibrated(model, seed, lambda fraction, least: report(fraction), starts=1)
        answer = spin_identify_answer(model, fit, data, truth)
        return replace(answer, warned=(*answer.warned, *doubts))

    def _fitted(self, executor: Executor) -> Answer:
        """Fit the unknowns to the records."""
        parameters, cases = self.machine.parameters, {case.name: case for case in self.cases}
        loads = [
            recorded_load(test, executor, cases[name].load) for name, test in self.tests.items()
        ]
        tests = list(self.tests.values())
        model = record_model(executor, self.free, tests, loads, self.options.by)
        title = f"Parameters of machine {parameters.name} identified from records of a spin cycle"
        return fitted_answer(executor, model, self.options.seed, (title, "identified"), tests)
