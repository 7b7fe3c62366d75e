"""The task of the study of a spin cycle: options and files checked, and runs."""

from dataclasses import replace
from functools import partial
from typing import Any

from wm_drake.errors import input_error, nearest_names
from wm_drake.model.machine import Machine
from wm_drake.studies.inputs import channels_of, runnable_profile
from wm_drake.studies.run import Executor
from wm_drake.studies.spin_cycle.inputs import MeasuredFiles, cases_of_table
from wm_drake.studies.spin_cycle.options import SpinCycleOptions
from wm_drake.studies.spin_cycle.page import SpinCycleReport
from wm_drake.studies.spin_cycle.runs import drake_runs
from wm_drake.studies.spin_cycle.study import measures_of, run_spin_cycle
from wm_drake.studies.study import Task

ENGINES = ("compiled", "drake")


class SpinCycleTask(Task):
    """The study with checked options."""

    def __init__(self, options: SpinCycleOptions, machine: Machine) -> None:
        """Read profile, cases and measurements."""
        if options.engine not in ENGINES:
            hint = nearest_names(options.engine, ENGINES)
            raise input_error(f"unknown engine '{options.engine}'{hint}", where="--engine")
        self.machine, self.engine = machine, options.engine
        self.profile = runnable_profile(options.profile, machine.parameters)
        self.cases = cases_of_table(options.cases, options.case)
        files = MeasuredFiles(
            options.measured, options.accelerations, channels_of(options.channels)
        )
        self.measured = files.read(machine.parameters, self.cases, self.profile)

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs."""
        return {"profile": self.profile, "engine": self.engine}

    def run(self, executor: Executor) -> SpinCycleReport:
        """Run all cases."""
        parameters = self.machine.parameters
        if self.engine == "drake":
            with executor.progress(len(self.cases), "cases") as progress:
                evaluate = drake_runs(parameters, progress=progress)
                result = run_spin_cycle(parameters, self.cases, self.profile, evaluate)
        else:
            measures = measures_of(parameters)
            evaluate = partial(executor.simulate, self.machine, measures, what="cases")
            result = run_spin_cycle(parameters, self.cases, self.profile, evaluate)
        return SpinCycleReport(replace(result, measured=self.measured), self.engine)
