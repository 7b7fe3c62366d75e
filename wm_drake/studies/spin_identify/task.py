"""Check the options of the identification from a spin cycle, and run it."""

from typing import Any

from wm_drake.model.machine import Machine
from wm_drake.studies.answer import Answer
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.inputs import runnable_profile
from wm_drake.studies.spin_cycle.study import cases_of_table, measured_displacements
from wm_drake.studies.spin_identify.options import SpinIdentifyOptions
from wm_drake.studies.spin_identify.page import spin_identify_answer
from wm_drake.studies.spin_identify.study import (
    SpinModel,
    identify_from_spin,
    planted_values,
    unknowns_of,
    virtual_experiment,
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
        self.measured = measured_displacements(
            options, machine.parameters, self.cases, self.profile
        )
        self.sought = unknowns_of(machine.parameters, options.unknown)

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs beside the machine."""
        measured = "none" if self.measured is None else self.measured.values
        return {
            "cases": self.cases,
            "profile": self.profile,
            "measurements": measured,
            "unknowns": [{"keys": s.keys, "unknown": s.unknown} for s in self.sought],
            "noise": f"{self.options.noise:g}, seed {self.options.seed}",
        }

    def run(self, executor: Executor) -> Answer:
        """Identify the unknowns, from measurements or from a virtual experiment."""
        seed, measured, planted = self.options.seed, self.measured, None
        with executor.fraction("search") as report:
            experiment = Experiment(self.machine, ("regions",), executor.simulate)
            model = SpinModel(
                experiment, self.machine.parameters, self.profile, tuple(self.cases), self.sought
            )
            if measured is None:
                planted = planted_values(self.sought, seed)
                measured = virtual_experiment(model, planted, self.options.noise, seed)
            fit, identified = identify_from_spin(
                model,
                measured,
                planted=planted,
                seed=seed,
                progress=lambda fraction, least: report(fraction),
            )
        return spin_identify_answer(model, fit, identified, planted)
