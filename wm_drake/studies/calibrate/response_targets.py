"""Targets of a calibration that are no amplitudes of sensors, such as the forces of the gasket."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from wm_drake.errors import InputError, Problem, check_known, nearest_names
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.measured import MACHINE, NamedValue
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import dimension, from_base, to_base
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures.responses import Response, known_responses
from wm_drake.studies.experiment import Experiment, response_of

DEVIATION = 0.10
"""Default relative standard deviation of a response that is not an amplitude.

It is twice that of an amplitude: the published forces are those of another model ([B]'s own, whose
amplitudes miss the experiment by 7.8 % in the mean).
"""


@dataclass(frozen=True)
class ResponseRuns:
    """Runs from which responses of a machine follow: one for each load."""

    machine: Machine

    def trials(self, parameters: MachineParameters) -> Iterable[MachineParameters]:
        """Return the machines that are run for a machine."""
        return [parameters]

    def statistic(self, target: "ResponseTarget", runs: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return the value of each machine from the response in its runs (machine, trial)."""
        return runs[:, 0]


@dataclass(frozen=True)
class ResponseTarget:
    """A value that a response of the machine should have.

    A subclass may compare it differently, and compute it from other runs.

    Attributes:
        gasket: Whether the machine has its gasket.
        value: The value. [unit for reading of the response]
        weight: Weight of its squared residual; 0 if it is not used.
        deviation: Standard deviation, as a fraction of the value.
    """

    load: str
    gasket: bool
    response: Response
    value: float
    weight: float = 1.0
    deviation: float = DEVIATION

    kind_of_runs: ClassVar[type[ResponseRuns]] = ResponseRuns

    @property
    def of(self) -> str:
        """Return what the value belongs to, for tables."""
        return MACHINE

    @property
    def kind_of_value(self) -> str:
        """Kind of the values whose errors are put together."""
        return "responses"

    @property
    def unit_text(self) -> str:
        """Unit of the value."""
        return self.response.unit_text

    @property
    def is_linear(self) -> bool:
        """Whether differences are compared, and not logarithms: the value may be 0 or below."""
        return False

    def errors(self, values: FloatArray) -> FloatArray:
        """Return differences from the target, as fractions like `deviation`."""
        return values / self.value - 1.0

    def misfits(self, values: FloatArray) -> FloatArray:
        """Return the logarithms of the ratios to the target, or `errors` if it is linear."""
        return self.errors(values) if self.is_linear else np.log(values / self.value)

    def scattered(self, values: FloatArray, misfits: FloatArray) -> FloatArray:
        """Return values that miss by `misfits` more; the inverse of `misfits`."""
        return values * np.exp(misfits)

    @property
    def names(self) -> tuple[str, ...]:
        """Names under which weights and deviations are given, from one target to many."""
        response = self.response
        of_one = f"{self.load}:{response.name}"
        return (of_one, response.name, response.group, response.kind, self.load)


def response_targets_of(
    parameters: MachineParameters, values: Iterable[NamedValue]
) -> tuple[ResponseTarget, ...]:
    """Return the targets for values from files.

    Args:
        values: Named values from `wm_drake.parameters.measured_responses`.

    Raises:
        InputError: the machine does not have a load or a response, a unit does not fit, a value is
            not above 0, or a target occurs twice.
    """
    known = {r.name: r for r in known_responses(parameters, parameters.profile)}
    problems: list[Problem] = []
    targets: dict[tuple[object, ...], ResponseTarget] = {}
    for value in values:
        message = _problem(parameters, known, value)
        key = (value.load, value.gasket, value.name)
        if not message and key in targets:
            message = f"'{value.name}' of load '{value.load}' occurs twice"
        if message:
            problems.append(Problem(value.where, "measured", message))
            continue
        response = known[value.name]
        number = from_base(to_base(value.value, value.unit), response.unit.shown)
        targets[key] = ResponseTarget(value.load, value.gasket, response, number)
    if problems:
        raise InputError(problems)
    return tuple(targets.values())


def _problem(
    parameters: MachineParameters, known: Mapping[str, Response], value: NamedValue
) -> str:
    """Return what is wrong with a value; "" if nothing is."""
    if value.load not in parameters.loads:
        return f"no load '{value.load}' in the machine{nearest_names(value.load, parameters.loads)}"
    if value.name not in known:
        return f"no response '{value.name}'{nearest_names(value.name, known)}"
    shown = known[value.name].unit.shown
    try:
        fits = dimension(value.unit) == dimension(shown)
    except ValueError as error:
        return f"column '{value.name}': {error}"
    if not fits:
        return f"column '{value.name}' is in {value.unit}; it needs a unit such as {shown}"
    if not value.value > 0.0:
        return (
            f"{value.name} of load '{value.load}' is {value.value:g}; it must be above 0, so that "
            "the logarithm of its ratio to the computed one exists"
        )
    if parameters.gasket is None and value.gasket:
        return f"load '{value.load}' is with gasket, and the machine has none"
    return ""


def with_deviations(
    targets: Sequence[ResponseTarget], deviations: Mapping[str, float]
) -> tuple[ResponseTarget, ...]:
    """Return targets with other relative standard deviations.

    Args:
        deviations: Relative deviations by name, one of `ResponseTarget.names`. Where several names
            fit, the one that fits the fewest targets counts.

    Raises:
        InputError: a name fits no target.
    """
    known = {name for target in targets for name in target.names}
    for name in deviations:
        check_known(name, known, f"'{name}' is no response of the targets", key="deviation")
    return tuple(
        replace(t, deviation=next((deviations[n] for n in t.names if n in deviations), t.deviation))
        for t in targets
    )


@dataclass
class ComputedResponses:
    """Function that computes the responses of machines for targets.

    Attributes:
        experiment: Runs of the machine.
        targets: The targets; they say which cases are run.
    """

    experiment: Experiment
    targets: tuple[ResponseTarget, ...]

    @cached_property
    def _runs(self) -> dict[type[ResponseRuns], ResponseRuns]:
        kinds = dict.fromkeys(target.kind_of_runs for target in self.targets)
        return {kind: kind(self.experiment.machine) for kind in kinds}

    def __call__(self, machines: Sequence[MachineParameters]) -> FloatArray:
        """Return the responses (machine, target) of machines. [unit for reading]

        They are NaN where a run diverged.
        """
        result = np.full((len(machines), len(self.targets)), np.nan)
        for runs in self._runs.values():
            self._fill(result, machines, runs)
        return result

    def _fill(
        self, result: FloatArray, machines: Sequence[MachineParameters], runs: ResponseRuns
    ) -> None:
        """Write the responses that follow from runs of one kind."""
        places = [i for i, t in enumerate(self.targets) if t.kind_of_runs is type(runs)]
        evaluated = [self.targets[i] for i in places]
        loads = list(dict.fromkeys((t.load, t.gasket) for t in evaluated))
        cases = (
            Case(load, trial.loads[load], trial.profile, gasket, parameters=trial)
            for parameters in machines
            for trial in runs.trials(parameters)
            for load, gasket in loads
        )
        measures = tuple(dict.fromkeys(target.response.measure for target in evaluated))
        trials = sum(1 for _ in runs.trials(machines[0]))
        sizes = {"machine": len(machines), "trial": trials, "case": len(loads)}
        data = replace(self.experiment, machine=runs.machine, measures=measures).over(
            {name: range(size) for name, size in sizes.items()}, cases
        )
        for place, target in zip(places, evaluated, strict=True):
            of_load = data.isel(case=loads.index((target.load, target.gasket)))
            values = response_of(of_load, target.response).values
            in_unit = target.response.unit.from_si(1.0) * values
            result[:, place] = runs.statistic(target, in_unit)
