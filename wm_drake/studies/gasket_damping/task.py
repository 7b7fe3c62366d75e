"""Check the options of the study of the gasket damping, and identify it."""

from wm_drake.model.machine import Machine
from wm_drake.report.terminal import say
from wm_drake.studies.executor import Executor
from wm_drake.studies.gasket_damping.options import GasketDampingOptions
from wm_drake.studies.gasket_damping.page import GasketDampingResult
from wm_drake.studies.gasket_damping.study import (
    identify_damping,
    planted_damping,
    read_records,
    run_up_of,
    virtual_experiment,
)
from wm_drake.studies.study import Task


class GasketDampingTask(Task):
    """The study with checked options."""

    def __init__(self, options: GasketDampingOptions, machine: Machine) -> None:
        """Check the machine, and read the records or the true values of the virtual experiment."""
        self.options, self.machine = options, machine
        run_up_of(machine.parameters)
        self.records, self.truth = read_records(machine.parameters, options.record), None
        if not options.record:
            self.truth = planted_damping(
                machine.parameters, options.planted_linear, options.planted_torsional
            )

    def run(self, executor: Executor) -> GasketDampingResult:  # noqa: ARG002
        """Identify the damping, from the records or from a virtual experiment."""
        records = self.records
        if self.truth is not None:
            say(
                "No measured records were given. The Drake engine runs a virtual experiment with "
                "other damping values and noise.",
                err=True,
            )
            records = virtual_experiment(self.machine.parameters, self.truth, self.options.seed)
        mesh = self.options.mesh / 100.0
        return GasketDampingResult(identify_damping(self.machine, records, self.truth, mesh))
