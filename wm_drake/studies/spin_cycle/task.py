"""Check the options of the study of a spin cycle, and run it."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from wm_drake.model.machine import Machine
from wm_drake.parameters.recorded import ACCELERATION
from wm_drake.simulation.cases import Case
from wm_drake.studies.answer import Answer
from wm_drake.studies.compare.diagnosis import UNLIKE
from wm_drake.studies.compare.options import CompareOptions
from wm_drake.studies.compare.task import doubt_again
from wm_drake.studies.executor import Executor
from wm_drake.studies.inputs import runnable_profile
from wm_drake.studies.spin_cycle.measured import DIMS, RMS, file_of_case
from wm_drake.studies.spin_cycle.options import SpinCycleDataOptions
from wm_drake.studies.spin_cycle.page import spin_cycle_answer
from wm_drake.studies.spin_cycle.study import (
    RECORDED_REGIONS,
    cases_of_table,
    compared_of,
    measured_displacements,
    measures_of,
    run_spin_cycle,
    runs_of,
)
from wm_drake.studies.study import Task


class SpinCycleTask(Task):
    """The study with checked options."""

    def __init__(self, options: SpinCycleDataOptions, machine: Machine) -> None:
        """Read profile, cases and measurements."""
        self.options, self.machine = options, machine
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
        answer = spin_cycle_answer(parameters, self.profile, self.cases, data, executor.engine)
        if not self.options.accelerations or self.measured is None:
            return answer
        apart = abs(compared_of(data) / self.measured - 1.0).max(DIMS[1:])
        runs = runs_of(parameters, self.cases, self.profile)
        unlike = [run for run, off in zip(runs, apart.values, strict=True) if off > UNLIKE]
        doubts = acceleration_doubts(executor, self.machine, self.options, unlike)
        return replace(answer, warned=(*answer.warned, *doubts))


def acceleration_doubts(
    executor: Executor, machine: Machine, options: SpinCycleDataOptions, runs: Sequence[Case]
) -> tuple[str, ...]:
    """Return why records of accelerations are not like their predictions, as `record compare` does.

    Args:
        runs: Cases whose records are judged.
    """
    folder, units = options.accelerations, list(options.unit)
    if folder is None or machine.parameters.cabinet_moves:
        return ()
    if all("=" in unit for unit in units):
        units.append(ACCELERATION.si)
    doubts = []
    for run in runs:
        path = file_of_case(folder, run.name)
        if path is not None:
            compared = CompareOptions(records=(path,), unit=units, channels=options.channels)
            doubts.append(doubt_again(executor, compared, machine, run))
    return tuple(filter(None, doubts))
