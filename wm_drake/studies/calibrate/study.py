"""Calibrate a machine: search from several starts."""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.vary_file import VaryFile
from wm_drake.studies.calibrate.computed import Evaluation
from wm_drake.studies.calibrate.parameter_map import ParameterMap, parameter_map_of
from wm_drake.studies.calibrate.solutions import Solution, distinct
from wm_drake.studies.calibrate.targets import Targets
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.fitting.assessment import assess
from wm_drake.studies.fitting.fit import Fit, SearchLog
from wm_drake.studies.fitting.methods import descents
from wm_drake.studies.fitting.problem import (
    KINKED,
    FitProblem,
    Measurement,
    ModelValues,
    Progress,
)
from wm_drake.studies.fitting.search import Optimum, Search, silent
from wm_drake.studies.fitting.starts import DRAWS, starts_of

RELATIVE_DEVIATION = 0.05
"""Relative standard deviation of a measured amplitude from the computed one.

It covers the scatter between machines and the error of a rigid-body model. It determines the weight
of the data against the priors.
"""

BEYOND_LIMIT = 30.0
"""Factor of the residual of a value beyond its limit.

One standard deviation beyond the limit costs as much as 30 standard deviations of other values, so
that a limit gives way only where no machine within the bounds keeps it.
"""

RESOLUTION = 1e-4
"""Resolution of the published amplitudes. [m]"""


@dataclass(frozen=True)
class SearchPlan:
    """Settings of the search.

    Attributes:
        starts: Number of starts. The first is the one in the vary file; the others are drawn at
            random around it.
        iterations: Limit of iterations from each start; 0 for that of `KINKED`.
        deviation: Relative standard deviation of an amplitude.
        resolution: Resolution of the measured amplitudes. Rounding adds the standard deviation
            resolution / sqrt(12). [m]
        draws: Number of machines that are drawn from the posterior for the interval of a
            prediction.
        start_draws: Number of machines that are drawn for each random start, which is the best of
            them.
    """

    starts: int = 8
    seed: int = 0
    iterations: int = 0
    deviation: float = RELATIVE_DEVIATION
    resolution: float = RESOLUTION
    draws: int = 200
    start_draws: int = DRAWS

    def spread(self, amplitude: FloatArray) -> FloatArray:
        """Return the standard deviations of the logarithms of measured amplitudes."""
        return np.hypot(self.deviation, self.resolution / np.sqrt(12.0) / amplitude)


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration.

    Attributes:
        parameter_map: Map from the free quantities to the machine.
        targets: Measured amplitudes.
        plan: Settings of the search.
        solutions: The distinct good solutions, best first.
        ended: The point where the search from each start ended, in the order of the starts.
    """

    parameter_map: ParameterMap
    targets: Targets
    plan: SearchPlan
    solutions: tuple[Solution, ...]
    ended: tuple[Solution, ...]


def calibrate(
    experiment: Experiment,
    free: VaryFile,
    targets: Targets,
    plan: SearchPlan,
    progress: Progress = silent,
) -> Calibration:
    """Search for machines with the measured amplitudes.

    If the runs of the experiment are stored in a ledger, a search that is started again takes the
    same path, reads stored runs and continues where it stopped. The result does not depend on the
    number of workers.

    Args:
        experiment: Runs of the machine. Numbers that the vary file does not name keep their values.
        free: Quantities that may change, with bounds and priors.
        targets: Measured amplitudes.
        plan: Settings of the search.
        progress: Called with the fraction done and the least misfit so far.

    Raises:
        InputError: the vary file does not fit the machine, the machine of the first start cannot be
            run, or a setting of the plan is not allowed.
    """
    parameter_map = parameter_map_of(experiment.machine, free)
    values = Evaluation(experiment, parameter_map, targets)
    values.check(parameter_map.start)
    search = Search(calibration_problem(values, plan))
    begins = starts_of(search, plan.seed, plan.starts, plan.start_draws)
    ends = list(descents(search, begins, plan.starts, plan.iterations, progress))
    ended = [
        _solution(number, assess(search.problem, end.point, _log(plan, end)), values)
        for number, end in enumerate(ends)
    ]
    return Calibration(parameter_map, targets, plan, tuple(distinct(ended)), tuple(ended))


def _log(plan: SearchPlan, end: Optimum) -> SearchLog:
    return SearchLog("least squares", plan.seed, end.evaluations)


def calibration_problem(values: Evaluation, plan: SearchPlan) -> FitProblem:
    """Return the problem of the free quantities of an evaluation.

    The measured values are the logarithms of ratios, so 0. What is known are preloads, relations
    and elongations; a limit of a value is a wish.
    """
    parameter_map, targets = values.parameter_map, values.targets
    spread = plan.spread(targets.amplitude)

    def evaluate(points: FloatArray) -> ModelValues:
        computed = values(points)
        exact, smooth = (
            targets.residuals(amplitude, computed.responses, spread)
            for amplitude in (computed.amplitude, computed.power_mean)
        )
        return ModelValues(
            exact,
            smooth,
            parameter_map.prior_residuals(points, computed.preload, computed.elongation),
            BEYOND_LIMIT * targets.excesses(computed.amplitude, computed.responses, spread),
        )

    data = Measurement("targets", np.zeros(targets.count), errors="known")
    return FitProblem(parameter_map.unknowns, (data,), evaluate, KINKED)


def _solution(number: int, fit: Fit, values: Evaluation) -> Solution:
    """Return the end of a search as a solution."""
    problem = fit.problem
    squares = 0.5 * problem.evaluated(fit.linear.point[None]).exact[0] ** 2
    computed = values(fit.values[None])
    return Solution(
        parameter_map=values.parameter_map,
        targets=values.targets,
        start=number,
        fit=fit,
        amplitude=computed.amplitude[0],
        responses=computed.responses[0],
        data_cost=float(np.sum(squares[: problem.count])),
        prior_cost=float(np.sum(squares[problem.count :])),
    )
