"""The task of the tolerance study: options and files checked, and runs."""

from collections.abc import Sequence
from typing import Any

from wm_drake.engines.compiled.step_check import check_step
from wm_drake.errors import input_error, problems_at
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.limits import Limit, load_limits
from wm_drake.parameters.vary_file import VARY_FILES, VaryFile, check_loads, load_vary
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.measures.responses import Response, chosen_responses, has_gap, measures_of
from wm_drake.simulation.steps import checked_step
from wm_drake.studies.answer import Answer
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.inputs import existing_file, profile_of
from wm_drake.studies.run import machine_text
from wm_drake.studies.study import Task
from wm_drake.studies.tolerance.options import ToleranceOptions
from wm_drake.studies.tolerance.page import tolerance_answer
from wm_drake.studies.tolerance.study import (
    CONTACTS,
    DEFAULT,
    ToleranceSettings,
    ToleranceTrials,
    limits_of,
)
from wm_drake.studies.tolerance.variables import UncertainMachine, uncertain_machine
from wm_drake.studies.vary import in_vary_file, varying_of


class ToleranceTask(Task):
    """The study with checked options."""

    def __init__(self, options: ToleranceOptions, machine: Machine) -> None:
        """Read numbers and limits, and check the uncertain numbers at their ends."""
        sensitivity = options.sensitivity
        if sensitivity is None:
            sensitivity = min(512, options.samples)
        self.settings = ToleranceSettings(
            options.samples, sensitivity, options.subset, options.seed
        )
        self.file = load_vary(options.file)
        limits: tuple[Limit, ...] = ()
        if options.limits is not None:
            limits = load_limits(existing_file(options.limits, "--limits"))
        self.machine, self.uncertain = self._uncertain(options, machine)
        self.responses, self.measures = _measures(self.uncertain, options.response)
        with problems_at(str(options.limits)):
            self.limits = limits_of(limits, self.responses)

    def _uncertain(
        self, options: ToleranceOptions, machine: Machine
    ) -> tuple[Machine, UncertainMachine]:
        """Return the built machine and its uncertain numbers, checked at their ends."""
        spin = profile_of(machine.parameters, options.profile)
        with in_vary_file(VARY_FILES.path(options.file), self.file):
            case = sampled_case(machine.parameters, self.file, spin)
            varying = varying_of(machine, self.file.entries(without=()), self.file.known)
            uncertain = uncertain_machine(varying, self.file, case)
            built = build_machine(uncertain.parameters)
            step = checked_step(uncertain.parameters, None)
            uncertain.check(lambda case: check_step(built.set_up(parameters=case.parameters), step))
        return built, uncertain

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs."""
        return {
            "machine": machine_text(self.uncertain.parameters),
            "tolerances": self.file,
            "profile": self.uncertain.case.profile,
            "measures": ", ".join(self.measures),
            "seed": str(self.settings.seed),
        }

    def trials(self, executor: Executor) -> ToleranceTrials:
        """Return the runs of the uncertain machine."""
        experiment = Experiment(self.machine, self.measures, executor.simulate)
        about = self.file.about
        return ToleranceTrials(self.uncertain, self.responses, experiment, self.settings, about)

    def run(self, executor: Executor) -> Answer:
        """Run samples, Sobol indices and rare contact, and the loads of the machine."""
        trials = self.trials(executor)
        samples = trials.samples()
        indices, contact = trials.indices(samples), trials.contact(samples)
        if contact:
            contact = contact.assign(gap_of_load=trials.gaps_of_loads())
        return tolerance_answer(trials, samples, indices, contact, self.limits)


def sampled_case(parameters: MachineParameters, file: VaryFile, profile: SpinProfile) -> Case:
    """Return the case that samples change: a load of the machine, or any if laundry is drawn.

    Raises:
        InputError: the file has neither laundry nor one load of the machine.
    """
    check_loads(file, parameters)
    if file.has_laundry:
        return Case("laundry", next(iter(parameters.loads.values())), profile)
    if len(file.loads) != 1:
        named = ", ".join(file.loads or parameters.loads)
        message = f"samples need one load, or laundry; write 'loads: NAME' with one of {named}"
        raise input_error(message, key="loads")
    return Case(file.loads[0], parameters.loads[file.loads[0]], profile)


def _measures(
    uncertain: UncertainMachine, names: Sequence[str]
) -> tuple[tuple[Response, ...], tuple[str, ...]]:
    """Return the responses and the measures of `simulate_many`."""
    parameters, profile = uncertain.parameters, uncertain.case.profile
    listed = list(names) or [n for n in DEFAULT if n != "gap" or has_gap(parameters)]
    with problems_at("--response", ""):
        chosen = chosen_responses(parameters, profile, listed)
    if names and not any(r.name == "gap" for r in chosen) and has_gap(parameters):
        chosen += chosen_responses(parameters, profile, ["gap"])
    measures = set(measures_of(parameters, chosen))
    measures |= {CONTACTS} if "gap" in measures else set()
    return chosen, tuple(name for name in MEASURES if name in measures)
