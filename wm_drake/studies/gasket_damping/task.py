"""Check the options of the gasket-damping study, and run it."""

from wm_drake.errors import input_error
from wm_drake.model.machine import Machine
from wm_drake.report.terminal import say
from wm_drake.studies.answer import Answer
from wm_drake.studies.calibrate.blocks import calibrated
from wm_drake.studies.executor import Executor
from wm_drake.studies.gasket_damping.options import GasketDampingOptions
from wm_drake.studies.gasket_damping.page import gasket_damping_answer
from wm_drake.studies.gasket_damping.study import (
    STARTS,
    envelope_model,
    grid_of_paper,
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
        if options.mesh is not None and options.paper_mesh:
            raise input_error("has its own end; leave --mesh out", where="--paper-mesh")
        self.records, self.truth = read_records(machine.parameters, options.record), None
        if not options.record:
            self.truth = planted_damping(
                machine.parameters, options.planted_linear, options.planted_torsional
            )

    def run(self, executor: Executor) -> Answer:
        """Identify the damping, from the records or from a virtual experiment."""
        machine, records, mesh = self.machine, self.records, self.options.mesh
        if self.truth is not None:
            say(
                "No measured records were given. The Drake engine runs a virtual experiment with "
                "other damping values and noise.",
                err=True,
            )
            records = virtual_experiment(machine.parameters, self.truth, self.options.seed)
        model = envelope_model(machine, records)
        problem = model.problem()
        with executor.fraction("fit") as progress:
            fit, data = calibrated(
                model,
                self.options.seed,
                lambda fraction, _: progress(fraction),
                starts=STARTS,
                problem=problem,
            )
        grids = None
        if mesh is not None or self.options.paper_mesh:
            grids = grid_of_paper(problem, None if mesh is None else mesh / 100.0)
        return gasket_damping_answer(model, fit, data, self.truth, grids)
