"""The task of the tolerance study: options and files checked, and runs."""

from collections.abc import Sequence
from typing import Any

from wm_drake.engines.compiled.step_check import check_step
from wm_drake.errors import problems_at
from wm_drake.model.bodies import with_sdf_values
from wm_drake.model.build import build_machine
from wm_drake.model.key_patterns import keys_like
from wm_drake.model.machine import Machine
from wm_drake.parameters.tolerances import (
    TOLERANCES,
    Limit,
    Tolerances,
    check_load,
    load_limits,
    load_tolerances,
)
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.measures.responses import Response, chosen_responses, has_gap, measures_of
from wm_drake.simulation.steps import checked_step
from wm_drake.studies.answer import Answer
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.inputs import existing_file, problems_of_file, profile_of
from wm_drake.studies.run import machine_text
from wm_drake.studies.study import Task
from wm_drake.studies.tolerance.options import ToleranceOptions
from wm_drake.studies.tolerance.page import tolerance_answer
from wm_drake.studies.tolerance.study import (
    CONTACTS,
    DEFAULT,
    ToleranceSettings,
    ToleranceTrials,
    judged,
    limits_of,
)
from wm_drake.studies.tolerance.variables import UncertainMachine, uncertain_machine


class ToleranceTask(Task):
    """The study with checked options."""

    def __init__(self, options: ToleranceOptions, machine: Machine) -> None:
        """Read tolerances and limits, and check the uncertain quantities at their ends."""
        sensitivity = options.sensitivity
        if sensitivity is None:
            sensitivity = min(512, options.samples)
        self.settings = ToleranceSettings(
            options.samples, sensitivity, options.subset, options.seed
        )
        self.tolerances = matched(load_tolerances(options.file), machine)
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
        """Return the built machine and its uncertain quantities, checked at their ends."""
        parameters, tolerances = machine.parameters, self.tolerances
        spin = profile_of(parameters, options.profile)
        path = TOLERANCES.path(options.file)
        check_load(tolerances, parameters, path)
        load = next(iter(parameters.loads.values()))
        if tolerances.load:
            load = parameters.loads[tolerances.load]
        keys = [key for quantity in tolerances.quantities.values() for key in quantity.keys]
        with problems_of_file(path):
            full = with_sdf_values(machine.drawn.plant, parameters, keys)
            case = Case(tolerances.load or "laundry", load, spin)
            uncertain = uncertain_machine(full, tolerances, case)
            built = build_machine(uncertain.parameters)
            step = checked_step(uncertain.parameters, None)
            uncertain.check(lambda case: check_step(built.set_up(parameters=case.parameters), step))
        return built, uncertain

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs."""
        return {
            "machine": machine_text(self.uncertain.parameters),
            "tolerances": self.tolerances,
            "profile": self.uncertain.case.profile,
            "measures": ", ".join(self.measures),
            "seed": str(self.settings.seed),
        }

    def trials(self, executor: Executor) -> ToleranceTrials:
        """Return the runs of the uncertain machine."""
        experiment = Experiment(self.machine, self.measures, executor.simulate)
        about = self.tolerances.about
        return ToleranceTrials(self.uncertain, self.responses, experiment, self.settings, about)

    def run(self, executor: Executor) -> Answer:
        """Run samples, Sobol indices and rare contact, and the loads of the machine."""
        trials = self.trials(executor)
        samples = trials.samples()
        indices, contact = trials.indices(samples), trials.contact(samples)
        if contact:
            contact = contact.assign(gap_of_load=trials.gaps_of_loads())
        limits = judged(samples, self.limits)
        return tolerance_answer(trials, samples, indices, contact, limits)


def matched(tolerances: Tolerances, machine: Machine) -> Tolerances:
    """Return tolerances with the keys of a machine in place of patterns with *.

    A quantity of which no pattern fits a number of the machine is left out.
    """
    keys = {
        name: tuple(dict.fromkeys(k for key in quantity.keys for k in keys_like(machine, key)))
        for name, quantity in tolerances.quantities.items()
    }
    quantities = {
        name: quantity.model_copy(update={"keys": keys[name]})
        for name, quantity in tolerances.quantities.items()
        if keys[name]
    }
    return tolerances.model_copy(update={"quantities": quantities})


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
