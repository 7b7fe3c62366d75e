"""Targets of a calibration that are no amplitudes of sensors, such as the forces of the gasket."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wm_drake.batch import simulate_many
from wm_drake.errors import InputError, Problem, check_known, nearest_names
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import FactorLevels, MachineParameters, at_levels, levels_of, load_factors
from wm_drake.parameters.factors import GASKET_FACTORS
from wm_drake.parameters.measured import DESIGN, MACHINE, NamedValue
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import dimension, from_base, to_base
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures.responses import Response, known_responses
from wm_drake.studies.doe.coding import Levels
from wm_drake.studies.doe.orthogonal import orthogonal_levels

TRIALS = 27
"""Trials of the orthogonal array that stands for the design of a mean.

In it each level of a factor occurs equally often together with each level of another factor. Its
mean is therefore that of the full factorial up to interactions of three factors.
"""

DEVIATION = 0.10
"""Default relative standard deviation of a response that is not an amplitude.

It is twice that of an amplitude: the published forces are those of another model ([B]'s own, whose
amplitudes miss the experiment by 7.8 % in the mean).
"""


EFFECT, CONTRIBUTION = "effect", "contribution"
"""Names of all level effects and of all contributions, for deviations, weights and limits."""

DEVIATIONS = {"": DEVIATION, EFFECT: 0.03, CONTRIBUTION: 0.10}
"""Default deviation of each kind of value: a fraction of the value, of the grand mean for an
effect, and of the variance for a contribution."""


@dataclass(frozen=True)
class ResponseTarget:
    """A value that a response of the machine should have.

    Attributes:
        gasket: Whether the machine has its gasket.
        of_design: Whether the value belongs to a design of gasket factors: its mean, the effect of
            a factor or the contribution of one. Otherwise it belongs to the machine itself.
        value: The value. [unit for reading of the response; % for a contribution]
        weight: Weight of its squared residual; 0 if it is not used.
        deviation: Standard deviation, as a fraction of the value, of the mean for an effect, or of
            the variance for a contribution.
        factor: Factor of an effect or a contribution; "" for a mean.
        level: Level of an effect; None for a contribution.
        mean: Grand mean of which an effect is a fraction. [unit for reading of the response]
    """

    load: str
    gasket: bool
    of_design: bool
    response: Response
    value: float
    weight: float = 1.0
    deviation: float = DEVIATION
    factor: str = ""
    level: int | None = None
    mean: float = np.nan

    @property
    def of(self) -> str:
        """Return what the value belongs to, for tables."""
        if self.factor:
            return f"{self.factor} at {self.level}" if self.level is not None else self.factor
        return DESIGN if self.of_design else MACHINE

    @property
    def statistic(self) -> str:
        """`EFFECT`, `CONTRIBUTION`, or "" for a value that is never below 0."""
        return (EFFECT if self.level is not None else CONTRIBUTION) if self.factor else ""

    @property
    def kind_of_value(self) -> str:
        """Return `effects`, `contributions`, `means` of a design, or `responses` of the machine."""
        if self.statistic:
            return f"{self.statistic}s"
        return "means" if self.of_design else "responses"

    def errors(self, values: FloatArray) -> FloatArray:
        """Return differences from the target, as fractions like `deviation`."""
        if not self.factor:
            return values / self.value - 1.0
        scale = self.mean if self.level is not None else 100.0
        return (values - self.value) / scale

    def misfits(self, values: FloatArray) -> FloatArray:
        """Return the logarithms of the ratios to the target, or `errors` of effects and such."""
        return self.errors(values) if self.factor else np.log(values / self.value)

    def scattered(self, values: FloatArray, misfits: FloatArray) -> FloatArray:
        """Return values that miss by `misfits` more; the inverse of `misfits`."""
        if not self.factor:
            return values * np.exp(misfits)
        return values + misfits * (self.mean if self.level is not None else 100.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Names under which weights and deviations are given, from one target to many."""
        return (
            f"{self.load}:{self.response.name}",
            self.response.name,
            *((self.statistic,) if self.factor else ()),
            self.response.group,
            self.response.kind,
            self.load,
        )


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
        key = (value.load, value.gasket, value.of, value.name, value.factor, value.level)
        if not message and key in targets:
            message = f"'{value.name}' of load '{value.load}' occurs twice"
        if message:
            problems.append(Problem(value.where, "measured", message))
            continue
        response = known[value.name]
        number = value.value
        if value.unit:
            number = from_base(to_base(number, value.unit), response.unit.shown)
        target = ResponseTarget(
            value.load,
            value.gasket,
            value.of == DESIGN,
            response,
            number,
            factor=value.factor,
            level=value.level,
            mean=value.mean,
        )
        targets[key] = replace(target, deviation=DEVIATIONS[target.statistic])
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
        fits = not value.unit or dimension(value.unit) == dimension(shown)
    except ValueError as error:
        return f"column '{value.name}': {error}"
    if not fits:
        return f"column '{value.name}' is in {value.unit}; it needs a unit such as {shown}"
    if value.factor:
        return _problem_of_factor(value)
    if not value.value > 0.0:
        return (
            f"{value.name} of load '{value.load}' is {value.value:g}; it must be above 0, so that "
            "the logarithm of its ratio to the computed one exists"
        )
    if parameters.gasket is None and (value.gasket or value.of == DESIGN):
        return f"load '{value.load}' is with gasket, and the machine has none"
    if value.of == DESIGN and not value.gasket:
        return f"load '{value.load}': a mean over the gasket's design needs the gasket"
    return ""


def _problem_of_factor(value: NamedValue) -> str:
    """Return what is wrong with an effect or a contribution; "" if nothing is."""
    factors = load_factors(GASKET_FACTORS)
    if value.factor not in factors:
        return f"no factor '{value.factor}'{nearest_names(value.factor, factors)}"
    if value.level is not None and not value.mean > 0.0:
        return (
            f"{value.name} of load '{value.load}' has effects and no constant above 0; effects are "
            "compared as fractions of it"
        )
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
        targets: The targets; they say which cases are run.
        workers: Number of threads; None for the number of cores.
    """

    machine: Machine
    targets: tuple[ResponseTarget, ...]
    workers: int | None = None

    @cached_property
    def _design(self) -> "_Design":
        """Build the machine of the design's trials when a target is a mean over the design."""
        return _Design.of(self.machine.parameters)

    def __call__(self, machines: Sequence[MachineParameters]) -> FloatArray:
        """Return the responses (machine, target) of machines. [unit for reading]

        They are NaN where a run diverged.
        """
        result = np.full((len(machines), len(self.targets)), np.nan)
        if any(target.of_design for target in self.targets):
            self._fill(result, machines, self._design)
        if not all(target.of_design for target in self.targets):
            self._fill(result, machines, _Design(self.machine))
        return result

    def _fill(
        self, result: FloatArray, machines: Sequence[MachineParameters], way: "_Design"
    ) -> None:
        """Write the responses that are evaluated in one way."""
        is_design = way.levels is not None
        places = [i for i, t in enumerate(self.targets) if t.of_design == is_design]
        evaluated = [self.targets[i] for i in places]
        loads = list(dict.fromkeys((t.load, t.gasket) for t in evaluated))
        cases = (
            Case(load, trial.loads[load], trial.profile, gasket, parameters=trial)
            for parameters in machines
            for trial in way.trials(parameters)
            for load, gasket in loads
        )
        measures = dict.fromkeys(target.response.measure for target in evaluated)
        table = simulate_many(way.machine, cases, measures=measures, workers=self.workers)
        ended = table.diverged.values == ""
        for place, target in zip(places, evaluated, strict=True):
            values = np.where(ended, target.response.values(table), np.nan)
            runs = values.reshape(len(machines), -1, len(loads))
            of_load = runs[..., loads.index((target.load, target.gasket))]
            result[:, place] = way.statistic(target, of_load)


@dataclass(frozen=True)
class _Design:
    """Evaluation of a response over the trials of the gasket study of [B], or at a machine itself.

    Stiffness tables are replaced by the slopes of their first 20 %, as in [B] section 4.

    Attributes:
        levels: Levels of the factors in each trial; None for the machine itself.
    """

    machine: Machine
    levels: Levels | None = None

    @classmethod
    def of(cls, parameters: MachineParameters) -> "_Design":
        levels = orthogonal_levels(len(load_factors(GASKET_FACTORS)), TRIALS)
        middle = at_levels(parameters, cls._factors(parameters), [0] * levels.shape[1])
        return cls(build_machine(middle), levels)

    @staticmethod
    def _factors(parameters: MachineParameters) -> tuple[FactorLevels, ...]:
        return levels_of(parameters, load_factors(GASKET_FACTORS), "linear")

    def trials(self, parameters: MachineParameters) -> Iterable[MachineParameters]:
        if self.levels is None:
            return [parameters]
        factors = self._factors(parameters)
        return (at_levels(parameters, factors, row.tolist()) for row in self.levels)

    def statistic(self, target: ResponseTarget, runs: FloatArray) -> FloatArray:
        """Return mean, effect or contribution [%] of each machine from its runs (machine, trial).

        Of an orthogonal array, the sum of squares of a factor is that of its effects.
        """
        mean = runs.mean(axis=1)
        if not target.factor or self.levels is None:
            return np.asarray(mean)
        levels = self.levels[:, list(load_factors(GASKET_FACTORS)).index(target.factor)]
        effects = [runs[:, levels == level].mean(axis=1) - mean for level in (-1, 0, 1)]
        if target.level is not None:
            return np.asarray(effects[target.level + 1])
        of_factor = np.square(effects).mean(axis=0)
        return np.asarray(100.0 * of_factor / np.square(runs - mean[:, None]).mean(axis=1))
