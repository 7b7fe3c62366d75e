"""Results of the gasket study of [B] as targets of a calibration: means, effects, contributions."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np

from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, Varying, varying
from wm_drake.parameters.published import CONSTANT, OF_RESPONSE, published_results
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.simulation.measures.responses import known_responses
from wm_drake.studies.calibrate.response_targets import ResponseRuns, ResponseTarget
from wm_drake.studies.doe.coding import Levels
from wm_drake.studies.doe.orthogonal import orthogonal_levels

TRIALS = 27
"""Trials of the orthogonal array that stands for the design of a mean.

In it each level of a factor occurs equally often together with each level of another factor. Its
mean is therefore that of the full factorial up to interactions of three factors.
"""

EFFECT, CONTRIBUTION = "effect", "contribution"
"""Names of all level effects and of all contributions, for deviations, weights and limits."""

DEVIATIONS = {"mean": 0.10, EFFECT: 0.03, CONTRIBUTION: 0.10}
"""Default deviation of each kind of value: a fraction of the value, of the grand mean for an
effect, and of the variance for a contribution."""


class StudyRuns(ResponseRuns):
    """Runs of the trials of the gasket study of [B].

    Stiffness tables are replaced by the slopes of their first 20 %, as in [B] section 4.
    """

    factors: ClassVar[tuple[str, ...]] = tuple(gasket_entries())
    levels: ClassVar[Levels] = orthogonal_levels(len(factors), TRIALS)
    """Names of the factors, and levels (trial, factor)."""

    def __init__(self, machine: Machine) -> None:
        """Build the machine with all factors at their middle level."""
        middle = _factors(machine.parameters).at_levels([0] * self.levels.shape[1])
        super().__init__(build_machine(middle))

    def trials(self, parameters: MachineParameters) -> Iterable[MachineParameters]:
        """Return the machines of all trials."""
        factors = _factors(parameters)
        return (factors.at_levels(row.tolist()) for row in self.levels)

    def statistic(self, target: ResponseTarget, runs: FloatArray) -> FloatArray:
        """Return mean, effect or contribution [%] of each machine from its runs (machine, trial).

        Of an orthogonal array, the sum of squares of a factor is that of its effects.
        """
        assert isinstance(target, StudyTarget)
        mean = runs.mean(axis=1)
        if not target.factor:
            return np.asarray(mean)
        levels = self.levels[:, self.factors.index(target.factor)]
        effects = [runs[:, levels == level].mean(axis=1) - mean for level in (-1, 0, 1)]
        if target.level is not None:
            return np.asarray(effects[target.level + 1])
        of_factor = np.square(effects).mean(axis=0)
        return np.asarray(100.0 * of_factor / np.square(runs - mean[:, None]).mean(axis=1))


def _factors(parameters: MachineParameters) -> Varying:
    return varying(parameters, gasket_entries(), tables="linear")


@dataclass(frozen=True)
class StudyTarget(ResponseTarget):
    """Mean of a response over the study, effect of a factor at a level, or its contribution.

    Attributes:
        factor: Factor of an effect or a contribution; "" for a mean.
        level: Level of an effect; None for a contribution.
        mean: Grand mean of which an effect is a fraction. [unit for reading of the response]
    """

    factor: str = ""
    level: int | None = None
    mean: float = field(default=np.nan, kw_only=True)

    kind_of_runs: ClassVar[type[ResponseRuns]] = StudyRuns

    @property
    def statistic(self) -> str:
        """`EFFECT`, `CONTRIBUTION` or mean."""
        if not self.factor:
            return "mean"
        return EFFECT if self.level is not None else CONTRIBUTION

    @property
    def of(self) -> str:
        """Return what the value belongs to, for tables."""
        if not self.factor:
            return "design"
        return f"{self.factor} at {self.level}" if self.level is not None else self.factor

    @property
    def kind_of_value(self) -> str:
        """Kind of the values whose errors are put together: means, effects, contributions."""
        return f"{self.statistic}s"

    @property
    def unit_text(self) -> str:
        """Unit of the value."""
        return "%" if self.statistic == CONTRIBUTION else self.response.unit_text

    @property
    def is_linear(self) -> bool:
        """Whether differences are compared, and not logarithms: the value may be 0 or below."""
        return bool(self.factor)

    @property
    def _scale(self) -> float:
        return self.mean if self.level is not None else 100.0

    def errors(self, values: FloatArray) -> FloatArray:
        """Return differences: as fractions of the mean for an effect, of the variance else."""
        return (values - self.value) / self._scale if self.factor else super().errors(values)

    def scattered(self, values: FloatArray, misfits: FloatArray) -> FloatArray:
        """Return values that miss by `misfits` more; the inverse of `misfits`."""
        return values + misfits * self._scale if self.factor else super().scattered(values, misfits)

    @property
    def names(self) -> tuple[str, ...]:
        """Names under which weights and deviations are given, from one target to many."""
        names = super().names
        return (*names[:2], *((self.statistic,) if self.factor else ()), *names[2:])


def study_targets(parameters: MachineParameters) -> tuple[StudyTarget, ...]:
    """Return means, effects at the levels -1 and 0, and contributions of the published study.

    The effect at level 1 is minus the sum of the others. Interactions, sums and ranges are no
    targets.
    """
    return tuple(_targets(parameters))


def _targets(parameters: MachineParameters) -> Iterator[StudyTarget]:
    known = {r.name: r for r in known_responses(parameters, parameters.profile)}
    for (load, name), terms in published_results(parameters.published).items():
        response, mean = known[name], terms[CONSTANT].effects[0]
        of_kind = {
            kind: partial(StudyTarget, load, True, response, deviation=deviation, mean=mean)
            for kind, deviation in DEVIATIONS.items()
        }
        yield of_kind["mean"](mean)
        mains = {k: v for k, v in terms.items() if k not in OF_RESPONSE and ":" not in k}
        for factor, term in mains.items():
            for level, effect in zip((-1, 0), term.effects, strict=False):
                yield of_kind[EFFECT](effect, factor=factor, level=level)
            if term.percent is not None:
                yield of_kind[CONTRIBUTION](term.percent, factor=factor)
