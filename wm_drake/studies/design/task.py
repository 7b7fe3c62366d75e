"""The task of the design study: options and files checked, and runs."""

from typing import Any

from wm_drake.errors import check_known
from wm_drake.model.bodies import with_sdf_values
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters import designs as design_files
from wm_drake.parameters.tolerances import TOLERANCES, Tolerances, check_load, load_tolerances
from wm_drake.simulation.measures import MEASURES
from wm_drake.studies.answer import Answer
from wm_drake.studies.design.options import DesignOptions
from wm_drake.studies.design.page import design_answer
from wm_drake.studies.design.problem import MachineDesigns, machine_designs
from wm_drake.studies.design.search import SearchSettings
from wm_drake.studies.design.study import SEARCHES, front_envelopes, promises, run_designs
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.inputs import problems_of_file, selected_cases
from wm_drake.studies.run import machine_text
from wm_drake.studies.study import Task
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studies.tolerance.variables import UncertainMachine, uncertain_machine


class DesignTask(Task):
    """The study with checked options."""

    def __init__(self, options: DesignOptions, machine: Machine) -> None:
        """Read the design file and the tolerances that it names."""
        check_known(options.search, SEARCHES, f"no search '{options.search}'", where="--search")
        self.settings = SearchSettings(options.evaluations, options.population, options.seed)
        self.options, self.file = options, design_files.load_design(options.file)
        with problems_of_file(design_files.DESIGNS.path(options.file)):
            self.machine, self.designs = self._designs(machine)
        needed = {response.measure for response in self.designs.responses} or {"extremes"}
        self.measures = tuple(name for name in MEASURES if name in needed)

    def _designs(self, machine: Machine) -> tuple[Machine, MachineDesigns]:
        """Return the built machine and its designs."""
        task, profile = self.file, self.options.profile
        tolerances = load_tolerances(task.robust.tolerances) if task.robust else None
        keys = [key for key in self._keys(tolerances) if key.startswith(("frames.", "bodies."))]
        full = with_sdf_values(machine.drawn.plant, machine.parameters, keys)
        if tolerances is None or task.robust is None:
            design_files.check_loads(task, full)
            cases = selected_cases(full, list(task.loads), True, profile)
            return build_machine(full), machine_designs(full, task, cases)
        check_load(tolerances, full, TOLERANCES.path(task.robust.tolerances))
        load = tolerances.load or next(iter(full.loads))
        (case,) = selected_cases(full, [load], True, profile)

        def scattered(changed: MachineParameters) -> UncertainMachine:
            return uncertain_machine(changed, tolerances, case)

        uncertain = scattered(full)
        scores, _ = base_samples(uncertain.joint.size, task.robust.samples, self.options.seed)
        designs = machine_designs(full, task, [case], scattered, scores)
        return build_machine(uncertain.parameters), designs

    def _keys(self, tolerances: Tolerances | None) -> list[str]:
        """Return the keys of all numbers that the study changes or reads."""
        task = self.file
        keys = [key for variable in task.variables.values() for key in variable.keys]
        keys += [
            key
            for choice in task.choices.values()
            for values in choice.options.values()
            for key in values
        ]
        keys += [goal.quantity for goal in task.objectives]
        keys += [goal.quantity for goal in task.constraints]
        if tolerances:
            keys += [key for quantity in tolerances.quantities.values() for key in quantity.keys]
        return keys

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs."""
        return {
            "machine": machine_text(self.designs.parameters),
            "design": self.file,
            "measures": ", ".join(self.measures),
            "seed": str(self.options.seed),
        }

    def run(self, executor: Executor) -> Answer:
        """Search the front, check a robust one on fresh samples, and run it with histories."""
        options = self.options
        experiment = Experiment(
            self.machine, self.measures, executor.simulate, record=executor.records
        )
        total = (options.evaluations + 1) * self.designs.scenarios  # and the machine itself
        with executor.progress(total):
            front = run_designs(self.designs, experiment, self.settings, options.search)
        checked = promises(self.designs, front, experiment, options.seed)
        envelopes = None
        if front.sizes["design"]:
            envelopes = front_envelopes(self.designs, front, experiment)
        return design_answer(self.designs, front, checked, envelopes, self.file.about)
