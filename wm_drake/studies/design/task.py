"""The task of the design study: options and files checked, and runs."""

from collections.abc import Callable
from typing import Any

from wm_drake.errors import check_known, input_error
from wm_drake.model.bodies import with_sdf_values
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.vary_file import VARY_FILES, VaryFile, check_loads, load_vary
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import MEASURES
from wm_drake.studies.answer import Answer
from wm_drake.studies.design.options import DesignOptions
from wm_drake.studies.design.page import design_answer
from wm_drake.studies.design.problem import MachineDesigns, machine_designs
from wm_drake.studies.design.search import SearchSettings
from wm_drake.studies.design.study import SEARCHES, front_envelopes, promises, run_designs
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.inputs import profile_of, selected_cases
from wm_drake.studies.run import machine_text
from wm_drake.studies.study import Task
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studies.tolerance.task import sampled_case
from wm_drake.studies.tolerance.variables import UncertainMachine, uncertain_machine
from wm_drake.studies.vary import in_vary_file, varying_of


class DesignTask(Task):
    """The study with checked options."""

    def __init__(self, options: DesignOptions, machine: Machine) -> None:
        """Read the file of numbers that vary, and that of the scatter which it names."""
        check_known(options.search, SEARCHES, f"no search '{options.search}'", where="--search")
        self.settings = SearchSettings(options.evaluations, options.population, options.seed)
        self.options, self.file = options, load_vary(options.file)
        with in_vary_file(VARY_FILES.path(options.file), self.file):
            check_goals(self.file)
            self.machine, self.designs = self._designs(machine)
        needed = {response.measure for response in self.designs.responses} or {"extremes"}
        self.measures = tuple(name for name in MEASURES if name in needed)

    def _designs(self, machine: Machine) -> tuple[Machine, MachineDesigns]:
        """Return the built machine and its designs."""
        file, options = self.file, self.options
        full = with_sdf_values(machine.drawn.plant, machine.parameters, _other_keys(file))
        varying = varying_of(machine, file.entries(), file.known, parameters=full)
        if file.robust is None:
            check_loads(file, full)
            cases = selected_cases(full, list(file.loads), True, options.profile)
            return build_machine(varying.machine), machine_designs(varying, file, cases)
        name = file.robust.tolerances
        tolerances = load_vary(name)
        with in_vary_file(VARY_FILES.path(name), tolerances):
            case = sampled_case(full, tolerances, profile_of(full, options.profile))
            scattered = _scattered(machine, tolerances, case)
            uncertain = scattered(varying.machine)
        scores, _ = base_samples(uncertain.joint.size, file.robust.samples, options.seed)
        designs = machine_designs(varying, file, [case], scattered, scores)
        return build_machine(uncertain.parameters), designs

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


def check_goals(file: VaryFile) -> None:
    """Raise an InputError if a file lacks what a design search needs beside numbers that vary."""
    if not file.objectives:
        message = "a design search needs some; add 'objectives: [{quantity: gap, goal: larger}]'"
        raise input_error(message, key="objectives")
    if bool(file.loads) == (file.robust is not None):
        message = "a design search needs either loads, or robust with its tolerances; write one"
        raise input_error(message, key="loads")


def _scattered(
    machine: Machine, tolerances: VaryFile, case: Case
) -> Callable[[MachineParameters], UncertainMachine]:
    """Return a function of some parameters of a machine with the uncertain machine."""

    def uncertain(changed: MachineParameters) -> UncertainMachine:
        entries = tolerances.entries(without=())
        varying = varying_of(machine, entries, tolerances.known, parameters=changed)
        return uncertain_machine(varying, tolerances, case)

    return uncertain


def _other_keys(file: VaryFile) -> list[str]:
    """Return the keys of the SDF that the choices and goals of a file name."""
    keys = [goal.quantity for goal in file.objectives]
    keys += [goal.quantity for goal in file.constraints]
    for choice in file.choices.values():
        keys += [key for values in choice.options.values() for key in values]
    return [key for key in keys if key.startswith(("frames.", "bodies."))]
