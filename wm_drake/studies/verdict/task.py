"""Check the options of the verdict, and run it."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from wm_drake.errors import input_error, nearest_names, problems_at
from wm_drake.model.bodies import with_sdf_values
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.model.sdf_names import sdf_names
from wm_drake.parameters import MachineParameters, with_values
from wm_drake.parameters.units import plain_number
from wm_drake.report.quantity import CHANGE
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.measures.responses import (
    GAP,
    Response,
    has_gap,
    known_responses,
    measures_of,
)
from wm_drake.simulation.measures.stops import STOPS
from wm_drake.studies.answer import Answer
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.inputs import (
    build_checked,
    changed_parameters,
    friction_warnings,
    machine_warnings,
    pairs_of,
    profile_of,
    selected_cases,
)
from wm_drake.studies.proposal import MOST_LOSS, command_text
from wm_drake.studies.spin.options import MOST_VARIANTS
from wm_drake.studies.spin.task import file_parts
from wm_drake.studies.study import Task
from wm_drake.studies.tolerance.options import ToleranceOptions
from wm_drake.studies.tolerance.study import CONTACTS, laundry_masses
from wm_drake.studies.tolerance.task import ToleranceTask
from wm_drake.studies.verdict.comparison import comparison_answer
from wm_drake.studies.verdict.options import MOST_EFFORT, VerdictOptions
from wm_drake.studies.verdict.page import verdict_answer
from wm_drake.studies.verdict.search import ProposalSearch, proposed, reasons
from wm_drake.studies.verdict.study import (
    COUNTERWEIGHT,
    FACTOR,
    SMALLEST_GAP,
    STATES,
    Judged,
    VerdictQuestion,
    aim_of,
    changeable,
    influences,
    laundry_of,
    states_of,
)

NO_SHAPES = "the SDF has no shapes on both tub and housing, so no verdict can be given"

LIMITS = {"amplitude": MOST_LOSS, "F": MOST_LOSS, "cabinet_force_peak": MOST_LOSS, GAP: MOST_LOSS}
"""Largest rise of what a change costs: displacement, force of the gasket, force on the cabinet."""

SHOWN_GROUPS = (*LIMITS, "mount_force_peak")
"""Responses that a proposal shows. The force of one mount has no limit by default: that of a damper
is its friction, so that no stronger damper could be proposed."""


class VerdictTask(Task):
    """The verdict with checked options."""

    def __init__(self, options: VerdictOptions, machine: Machine) -> None:
        """Check the options and the laundry."""
        if not has_gap(machine.parameters):
            raise input_error(NO_SHAPES)
        self.options, self.clearance = options, _length(options.clearance)
        self.given = machine
        weights = [name for name in sdf_names(machine.plant).links if COUNTERWEIGHT in name]
        keys = [f"bodies.{name}.mass" for name in weights]
        full = with_sdf_values(machine.drawn.plant, machine.parameters, keys)
        self.machine = build_machine(full)
        self.laundry = self._laundry(self.machine)
        self.cases = selected_cases(full, None, True, options.profile)
        known = known_responses(full, profile_of(full, options.profile))
        self.responses = tuple(r for r in known if {r.group, r.name} & {*SHOWN_GROUPS})
        self.limits = _limits(options.limit, self.responses)
        self.keys = _changeable(options.only, full)
        self.efforts = _efforts(options.effort, self.keys)
        measures = {*measures_of(full, self.responses), CONTACTS}
        measures |= {STOPS.name} if STOPS.applies(full) else set()
        self.measures = tuple(name for name in MEASURES if name in measures)

    @property
    def _command(self) -> str:
        """Return the command of this verdict, without sizes."""
        options = self.options
        (machine,) = options.machine
        more = [f"--clearance '{options.clearance}'"] if self.clearance else []
        more += [f"--limit {limit}" for limit in options.limit]
        more += [f"--only {key}" for key in options.only]
        more += [f"--effort {text}" for text in options.effort]
        if options.most_effort != MOST_EFFORT:
            more.append(f"--most-effort {options.most_effort:g}")
        return command_text(f"wm-drake verdict {machine}", options, *more)

    def _laundry(self, machine: Machine) -> ToleranceTask:
        """Return the tolerance study of a machine, without what a verdict does not show."""
        o = self.options
        with_gap = ToleranceOptions(
            file=o.laundry, samples=o.samples, sensitivity=0, subset=0, response=(GAP,),
            profile=o.profile, seed=o.seed,
        )  # fmt: skip
        return ToleranceTask(with_gap, machine)

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs."""
        options = self.options
        change = {"change": f"{options.change:g} %", "limits": self.limits, "only": options.only}
        efforts = {"efforts": (self.efforts, options.most_effort)}
        return {**self.laundry.identity, **change, **efforts}

    def run(self, executor: Executor) -> Answer:
        """Run, and return the answer."""
        return verdict_answer(self.judged(executor))

    def judged(self, executor: Executor) -> Judged:
        """Run the loads, the changes, and the laundry before and after the proposed change."""
        parameters, change = self.machine.parameters, FACTOR.unit.to_si(self.options.change)
        experiment = Experiment(self.machine, self.measures, executor.simulate, tuple(self.cases))
        base = experiment.at(STATES[:1], [parameters], "loads").isel(point=0, drop=True)
        samples = [self.laundry.trials(executor).samples()]
        tried = influences(experiment, self.keys, change)
        aim = aim_of(base, tried, self.responses, self.limits)
        efforts = self.efforts, self.options.most_effort
        search = ProposalSearch(experiment, aim, self.responses, *efforts)
        changed = proposed(search, tried)
        if changed is not None:
            better = build_machine(with_values(parameters, changed.changes))
            samples.append(self._laundry(better).trials(executor).samples())
        question = VerdictQuestion(
            parameters,
            self.clearance,
            change,
            self.responses,
            self.laundry.file.about,
            self._command,
            {} if changed is None else changed.changes,
        )
        return Judged(
            question,
            states_of(base, changed),
            tried.assign(why_not=("key", reasons(search, tried, changed))),
            laundry_of(samples, self.clearance),
            laundry_masses(samples[0]),
        )


def begin(options: VerdictOptions, *machines: Machine) -> "VerdictTask | VerdictComparisonTask":
    """Return the task of the verdict on a machine, or of the comparison of several ones."""
    if len(machines) == 1 and not options.variant:
        return VerdictTask(options, machines[0])
    return VerdictComparisonTask(options, machines)


class VerdictComparisonTask(Task):
    """Verdicts on several machines, or variants of one, with checked options."""

    def __init__(self, options: VerdictOptions, machines: Sequence[Machine]) -> None:
        """Check the options, and build the variants."""
        if options.variant and len(machines) > 1:
            raise input_error("needs a single machine", where="--variant")
        count = len(machines) + len(options.variant)
        if count > MOST_VARIANTS:
            message = f"{count} are too many for one page; at most {MOST_VARIANTS} can be compared"
            raise input_error(message, where="--variant" if options.variant else "MACHINE")
        self.options = options
        self.tasks: dict[str, VerdictTask] = {}
        self.warned: list[str] = []
        for given, machine in zip(options.machine, machines, strict=True):
            self._add(options, given, machine)
        for variant in options.variant:
            sets = tuple(re.split(r";\s+", variant.strip()))
            with problems_at("--variant"):
                changed = changed_parameters(machines[0].parameters, sets)
                named = changed.model_copy(update={"name": variant.strip()})
                built = build_checked(options.machine[0], named)
            texts = (*machine_warnings(named, profile=options.profile), *friction_warnings(named))
            self.warned += [f"{variant}: {text}" for text in texts]
            more = options.model_copy(update={"sets": (*options.sets, *sets)})
            self._add(more, options.machine[0], built)

    def _add(self, options: VerdictOptions, given: str, machine: Machine) -> None:
        name = machine.parameters.name
        if name in self.tasks:
            message = f"two have the name '{name}'; give each machine file its own 'name'"
            raise input_error(message, where="--variant" if options.variant else "MACHINE")
        one = options.model_copy(update={"machine": (given,), "variant": ()})
        self.tasks[name] = VerdictTask(one, machine)

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs."""
        each = [task.identity for task in self.tasks.values()]
        numbers = [task.machine.parameters.model_dump(mode="json") for task in self.tasks.values()]
        return {"compared": [list(self.tasks), numbers, each]}

    def run(self, executor: Executor) -> Answer:
        """Judge one after the other."""
        judged = {name: task.judged(executor) for name, task in self.tasks.items()}
        parts = file_parts(list(judged))
        pages = {name: f"report_{part}.html" for name, part in zip(judged, parts, strict=True)}
        return replace(comparison_answer(judged, pages), warned=tuple(self.warned))


def _limits(entries: Sequence[str], chosen: Sequence[Response]) -> tuple[float, ...]:
    """Return the largest rise of each response, infinite without a limit. [1]"""
    names = {name for response in chosen for name in (response.name, response.group)}
    given = dict(LIMITS)
    for name, text in pairs_of(entries, "--limit"):
        if name not in names:
            message = f"unknown response{nearest_names(name, names)}"
            raise input_error(message, where="--limit", key=name)
        try:
            given[name] = CHANGE.unit.to_si(plain_number(text.removesuffix("%").strip()))
        except ValueError as error:
            raise input_error(str(error), where="--limit", key=name) from None
        if given[name] < 0.0:
            raise input_error("is negative; allowed is 0 and above", where="--limit", key=name)
    return tuple(given.get(r.name, given.get(r.group, math.inf)) for r in chosen)


def _changeable(parts: Sequence[str], parameters: MachineParameters) -> list[str]:
    """Return the key paths of what may change, below the given ones if there are any."""
    every = list(changeable(parameters))
    below = {key for part in parts for key in _below(part, every, "--only")}
    return [key for key in every if not parts or key in below]


def _below(part: str, every: Sequence[str], option: str) -> list[str]:
    """Return the key paths that begin with some parts."""
    keys = [key for key in every if f"{key}.".startswith(f"{part}.")]
    if not keys:
        hint = nearest_names(part, every)
        raise input_error(f"nothing that can change{hint}", where=option, key=part)
    return keys


def _efforts(entries: Sequence[str], keys: Sequence[str]) -> dict[str, float]:
    """Return the effort of the change of each key path."""
    efforts: dict[str, float] = {}
    for part, text in pairs_of(entries, "--effort"):
        try:
            effort = plain_number(text)
        except ValueError as error:
            raise input_error(str(error), where="--effort", key=part) from None
        if not effort >= 0.0:
            raise input_error(f"is {effort:g}; allowed is >= 0", where="--effort", key=part)
        for key in _below(part, keys, "--effort"):
            efforts.setdefault(key, effort)
    return {key: efforts.get(key, 1.0) for key in keys}


def _length(text: str) -> float:
    """Return a clearance. [m]"""
    with problems_at("--clearance", ""):
        try:
            clearance = SMALLEST_GAP.unit.number(text)
        except ValueError as error:
            raise input_error(str(error)) from None
        if not 0.0 <= clearance < 1.0:
            raise input_error(f"'{text}' is not allowed; allowed are 0 mm to below 1 m")
    return clearance
