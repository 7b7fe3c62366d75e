"""Check the options of the study of a spin cycle, and run it."""

from functools import partial
from typing import Any

from wm_drake.model.machine import Machine
from wm_drake.studies.answer import Answer
from wm_drake.studies.executor import Executor
from wm_drake.studies.inputs import runnable_profile
from wm_drake.studies.spin_cycle.measured import DIMS, RMS
from wm_drake.studies.spin_cycle.options import SpinCycleDataOptions
from wm_drake.studies.spin_cycle.page import spin_cycle_answer
from wm_drake.studies.spin_cycle.study import (
    RECORDED_REGIONS,
    cases_of_table,
    measured_displacements,
    measures_of,
    run_spin_cycle,
)
from wm_drake.studies.study import Task


class SpinCycleTask(Task):
    """The study with checked options."""

    def __init__(self, options: SpinCycleDataOptions, machine: Machine) -> None:
        """Read profile, cases and measurements."""
        self.machine = machine
        self.profile = runnable_profile(options.profile, machine.parameters)
        self.cases = cases_of_table(options.cases, options.case)
        self.more = (RECORDED_REGIONS,) if options.accelerations else ()
        self.measured = measured_displacements(
            options, machine.parameters, self.cases, self.profile
        )

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs."""
        return {"profile": self.profile}

    def run(self, executor: Executor) -> Answer:
        """Run all cases."""
        parameters = self.machine.parameters
        measures = measures_of(parameters, *self.more)
        evaluate = partial(executor.simulate, self.machine, measures, what="cases")
        data = run_spin_cycle(parameters, self.cases, self.profile, evaluate)
        if self.measured is not None:
            data["measured"] = RMS.variable(DIMS, self.measured)
        return spin_cycle_answer(parameters, self.profile, self.cases, data, executor.engine)
