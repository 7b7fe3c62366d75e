"""Designs of a machine as points of the unit cube, and their objectives and constraints."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters import MachineParameters, quantities, with_values
from wm_drake.parameters.limits import Constraint, Objective, fraction
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.parameters.variation import value_at
from wm_drake.parameters.vary_file import Choice, VaryFile
from wm_drake.parameters.varying import Varied, Varying
from wm_drake.report.quantity import Quantity, text_of
from wm_drake.simulation.cases import Case, load_of
from wm_drake.simulation.measures.responses import Response, chosen_responses
from wm_drake.studies.experiment import Experiment, response_of
from wm_drake.studies.tolerance.variables import UncertainMachine


@dataclass(frozen=True)
class Range:
    """A number that the search may choose between its ends.

    Attributes:
        varied: What it changes.
    """

    varied: Varied

    @property
    def name(self) -> str:
        """Name of the entry."""
        return self.varied.name

    @property
    def nominal(self) -> float:
        """Place from 0 to 1 nearest to the machine itself."""
        low, high = self.varied.at["low"], self.varied.at["high"]
        return float(np.clip((self.varied.nominal - low) / (high - low), 0.0, 1.0))

    @property
    def keys(self) -> tuple[str, ...]:
        """Key paths of what it changes."""
        return self.varied.keys

    def text(self, value: xr.DataArray) -> str:
        """Return the value of a design as text."""
        return text_of(value)

    def variable(self, places: FloatArray) -> xr.Variable:
        """Return the values of designs at places from 0 to 1."""
        quantity = Quantity(self.name, self.varied.unit)
        return quantity.variable("design", self.varied.at_place(places))


@dataclass(frozen=True)
class OptionVariable:
    """A choice among options.

    Attributes:
        options: Values by key path, by name of the option.
    """

    name: str
    options: dict[str, dict[str, str]]

    @property
    def nominal(self) -> float:
        """Place of the first option."""
        return 0.5 / len(self.options)

    @property
    def keys(self) -> tuple[str, ...]:
        """Key paths of what it changes."""
        return tuple(dict.fromkeys(key for values in self.options.values() for key in values))

    def text(self, value: xr.DataArray) -> str:
        """Return the value of a design as text."""
        return str(value.item())

    def changes(self, place: float) -> dict[str, Any]:
        """Return new values of the machine by key path, at a place from 0 to 1."""
        return self.options[self._option(place)]

    def variable(self, places: FloatArray) -> xr.Variable:
        """Return the names of the options of designs at places from 0 to 1."""
        return xr.Variable("design", [self._option(place) for place in places.tolist()])

    def _option(self, place: float) -> str:
        names = list(self.options)
        return names[min(int(place * len(names)), len(names) - 1)]


@dataclass(frozen=True)
class DesignGoal:
    """An objective or a constraint with what it is computed from.

    Attributes:
        given: As in the vary file.
        response: Response of the runs; None if it is a number of the machine.
        unit: Unit.
        limit: Limit of a constraint. [SI] NaN for an objective.
    """

    given: Objective | Constraint
    response: Response | None
    unit: Unit
    limit: float = float("nan")

    @property
    def name(self) -> str:
        """Name in datasets; a quantity may be an objective and have a limit."""
        is_objective = isinstance(self.given, Objective)
        return self.given.quantity if is_objective else f"constrained_{self.given.quantity}"

    @property
    def quantity(self) -> Quantity:
        """Words and unit."""
        return Quantity(self.given.quantity, self.unit)

    @property
    def is_small_better(self) -> bool:
        """Whether smaller values are better."""
        if isinstance(self.given, Objective):
            return self.given.goal == "smaller"
        return self.given.at_most is not None

    def cost(self, value: FloatArray) -> FloatArray:
        """Return what is to be small, or at most 0 for a constraint."""
        if isinstance(self.given, Objective):
            return value if self.is_small_better else -value
        return value - self.limit if self.is_small_better else self.limit - value

    def over(self, values: FloatArray) -> FloatArray:
        """Return one value for each design from those of its scenarios. (designs, scenarios)"""
        how = self.given.over
        if how == "mean":
            return np.asarray(values.mean(axis=1))
        share = 1.0 if how == "worst" else fraction(how, "over")
        return np.quantile(values, share if self.is_small_better else 1.0 - share, axis=1)


@dataclass(frozen=True)
class MachineDesigns:
    """The designs of a machine.

    Attributes:
        varying: The machine, and the numbers that the search may choose.
        choices: What else the search may choose.
        cases: One case for each load, without parameters; empty for a robust design.
        scattered: Returns the uncertain machine of some parameters; None for a nominal design.
        scores: Samples of a robust design, the same for every design.
    """

    varying: Varying
    choices: tuple[OptionVariable, ...]
    objectives: tuple[DesignGoal, ...]
    constraints: tuple[DesignGoal, ...]
    cases: tuple[Case, ...]
    scattered: Callable[[MachineParameters], UncertainMachine] | None = None
    scores: FloatArray | None = None

    @property
    def parameters(self) -> MachineParameters:
        """Return the machine."""
        return self.varying.machine

    @cached_property
    def dimensions(self) -> tuple[Range | OptionVariable, ...]:
        """Return what the search may change: numbers, then choices."""
        return (*map(Range, self.varying.every), *self.choices)

    @property
    def goals(self) -> tuple[DesignGoal, ...]:
        """Objectives, then constraints."""
        return (*self.objectives, *self.constraints)

    @property
    def responses(self) -> tuple[Response, ...]:
        """Responses that the goals need."""
        responses = [g.response for g in self.goals if g.response]
        return tuple(dict.fromkeys(responses))

    @property
    def scenarios(self) -> int:
        """Number of runs of each design."""
        return len(self.cases) if self.scores is None else len(self.scores)

    def machine_at(self, design: FloatArray) -> MachineParameters:
        """Return the machine of a design."""
        places, every = list(map(float, design)), self.varying.every
        numbers = zip(every, places, strict=False)
        changes = self.varying.changes(varied.at_place(place) for varied, place in numbers)
        for choice, place in zip(self.choices, places[len(every) :], strict=True):
            changes |= choice.changes(place)
        return with_values(self.parameters, changes)

    def nominal(self) -> FloatArray:
        """Return the design nearest to the machine itself; choices have their first option."""
        return np.array([dimension.nominal for dimension in self.dimensions])

    def runs_of(self, parameters: MachineParameters, name: str) -> list[Case]:
        """Return the cases of a design."""
        if self.scattered is not None and self.scores is not None:
            cases = self.scattered(parameters).cases(self.scores)
            return [replace(case, name=f"{name}, {case.name}") for case in cases]
        runs = []
        for case in self.cases:
            load = load_of(case, self.parameters, parameters)
            changed = replace(case, name=f"{name}, {case.name}", load=load, parameters=parameters)
            runs.append(changed)
        return runs

    @property
    def shown(self) -> str:
        """Return in words what `shown_runs` runs."""
        if self.scattered is not None:
            return "every uncertain quantity at its median"
        return f"loads {', '.join(case.name for case in self.cases)}"

    def shown_runs(self, parameters: MachineParameters, name: str) -> list[Case]:
        """Return the cases whose histories represent a design: all loads, or the median sample."""
        if self.scattered is None or self.scores is None:
            return self.runs_of(parameters, name)
        return list(self.scattered(parameters).cases(np.zeros((1, self.scores.shape[1]))))

    def evaluate(
        self, designs: FloatArray, experiment: Experiment
    ) -> tuple[FloatArray, FloatArray]:
        """Return values of all objectives, then of all constraints. [SI]

        Args:
            designs: (n, dimensions) in [0, 1]

        Returns:
            (n, objectives) and (n, constraints); NaN for a design of which a run failed.
        """
        values = self.scenario_values(designs, experiment)
        columns = np.column_stack(
            [goal.over(value) for goal, value in zip(self.goals, values, strict=True)]
        )
        return columns[:, : len(self.objectives)], columns[:, len(self.objectives) :]

    def scenario_values(self, designs: FloatArray, experiment: Experiment) -> list[FloatArray]:
        """Return the values of each goal by design and scenario. [SI]

        Args:
            designs: (n, dimensions) in [0, 1]

        Returns:
            For each of `goals` (n, scenarios); NaN for a run that failed.
        """
        machines = [self.machine_at(design) for design in designs]
        labels = {"design": range(1, len(designs) + 1), "scenario": range(self.scenarios)}
        cases = (
            case
            for number, machine in enumerate(machines, start=1)
            for case in self.runs_of(machine, f"design {number}")
        )
        runs = experiment.over(labels, cases)
        by_goal: list[FloatArray] = []
        for goal in self.goals:
            if goal.response is None:
                numbers = [value_at(machine, goal.given.quantity) for machine in machines]
                has_ended = runs.diverged.values == ""
                values = np.where(has_ended, np.array(numbers)[:, None], np.nan)
            else:
                values = response_of(runs, goal.response).values
            by_goal.append(values)
        return by_goal

    def costs(self, designs: FloatArray, experiment: Experiment) -> tuple[FloatArray, FloatArray]:
        """Return what the search makes small, and constraints that are met at 0 and below."""
        objectives, constraints = self.evaluate(designs, experiment)
        f = [g.cost(column) for g, column in zip(self.objectives, objectives.T, strict=True)]
        g = [c.cost(column) for c, column in zip(self.constraints, constraints.T, strict=True)]
        return np.column_stack(f), np.column_stack(g) if g else np.empty((len(designs), 0))


def machine_designs(
    varying: Varying,
    file: VaryFile,
    cases: Sequence[Case],
    scattered: Callable[[MachineParameters], UncertainMachine] | None = None,
    scores: FloatArray | None = None,
) -> MachineDesigns:
    """Return the designs of a machine that a file describes.

    Args:
        varying: The machine, with the numbers of the SDF that the file names
            (`wm_drake.model.bodies.with_sdf_values`), and its numbers that vary.
        file: Choices, objectives and constraints.
        cases: One case for each load; one for the profile of a robust design.
        scattered: As in `MachineDesigns`.
        scores: As in `MachineDesigns`.

    Raises:
        InputError: the machine does not have a key or a response, or a number has no ends.
    """
    problems, parameters = _problems_of_choices(varying.machine, file.choices), varying.machine
    for varied in varying.every:
        try:
            varied.needed("low", "high", study="a design search")
        except InputError as error:
            problems += error.problems
    goals: dict[str, list[DesignGoal]] = {"objectives": [], "constraints": []}
    known = {key: (value, unit) for key, value, unit in quantities(parameters)}
    for kind, listed in goals.items():
        for place, given in enumerate(getattr(file, kind)):
            try:
                listed.append(_goal(parameters, cases[0], given, known))
            except InputError as error:
                problems += [Problem("", f"{kind}.{place}", p.message) for p in error.problems]
    if problems:
        raise InputError(problems)
    return MachineDesigns(
        varying,
        tuple(OptionVariable(name, choice.options) for name, choice in file.choices.items()),
        tuple(goals["objectives"]),
        tuple(goals["constraints"]),
        () if scattered else tuple(cases),
        scattered,
        scores,
    )


def _problems_of_choices(
    parameters: MachineParameters, choices: Mapping[str, Choice]
) -> list[Problem]:
    """Return what is wrong with the options of choices."""
    problems = []
    for name, choice in choices.items():
        for option, values in choice.options.items():
            try:
                with_values(parameters, values)
            except InputError as error:
                key = f"choices.{name}.options.{option}"
                problems += [Problem("", key, f"{p.key}: {p.message}") for p in error.problems]
    return problems


def _goal(
    parameters: MachineParameters,
    case: Case,
    given: Objective | Constraint,
    known: dict[str, tuple[Any, Unit]],
) -> DesignGoal:
    limit_text = None if isinstance(given, Objective) else given.text
    response, unit = None, Unit("", "")
    if given.quantity in known:
        value, unit = known[given.quantity]
        if not isinstance(value, float):
            raise input_error(f"'{given.quantity}' is not one number")
    else:
        chosen = chosen_responses(parameters, case.profile, [given.quantity])
        if len(chosen) != 1:
            names = ", ".join(r.name for r in chosen[:8])
            raise input_error(f"'{given.quantity}' is several responses; name one of {names}")
        (response,) = chosen
        unit = response.unit
    try:
        limit = float("nan") if limit_text is None else unit.number(limit_text)
    except ValueError as error:
        raise input_error(str(error)) from None
    return DesignGoal(given, response, unit, limit)
