"""Calibrate a machine: search from several starts, store each evaluation."""

from dataclasses import dataclass

import numpy as np

from wm_drake.batch.ledger import key_of
from wm_drake.batch.remembered import model_version, sources_version
from wm_drake.model.machine import Machine
from wm_drake.parameters.free import FreeFile
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibrate.computed import Evaluation, PointRunner
from wm_drake.studies.calibrate.parameter_map import ParameterMap, parameter_map_of
from wm_drake.studies.calibrate.solutions import Solution, distinct
from wm_drake.studies.calibrate.targets import Targets
from wm_drake.studies.fitting.posterior import Posterior
from wm_drake.studies.fitting.problem import PriorProblem, Residuals
from wm_drake.studies.fitting.search import Search, descended, smooth_slopes
from wm_drake.studies.fitting.starts import DRAWS, start_number

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

ITERATIONS = 60
"""Default limit of iterations of a search."""


@dataclass(frozen=True)
class SearchPlan:
    """Settings of the search.

    Attributes:
        starts: Number of starts. The first is the one in the free file; the others are drawn at
            random around it.
        iterations: Limit of iterations from each start; 0 for `ITERATIONS`.
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


def identity_of(
    machine: Machine, free: FreeFile, targets: Targets, plan: SearchPlan
) -> dict[str, str]:
    """Return the texts that identify a calibration in its ledger."""
    return {
        "study": "calibration",
        "machine": key_of(
            machine=machine.parameters.model_dump(exclude={"sources"}),
            model=model_version(machine.parameters),
        )[:8],
        "free": key_of(free=free)[:8],
        "targets": key_of(targets=targets)[:8],
        "plan": key_of(plan=plan)[:8],
        "sources": sources_version(),
    }


def calibrate(
    runner: PointRunner, free: FreeFile, targets: Targets, plan: SearchPlan
) -> Calibration:
    """Search for machines with the measured amplitudes.

    Each evaluation is stored in the ledger before it is used. A search that is started again takes
    the same path, reads stored evaluations and continues where it stopped. The result does not
    depend on the number of workers.

    Args:
        runner: The machine, and the ledger of this calibration. Numbers that the free file does not
            name keep their values.
        free: Quantities that may change, with bounds and priors.
        targets: Measured amplitudes.
        plan: Settings of the search.

    Raises:
        InputError: the free file does not fit the machine, the machine of the first start cannot be
            run, or a setting of the plan is not allowed.
    """
    parameter_map = parameter_map_of(runner.machine, free)
    values = runner.values(parameter_map, targets)
    if np.isnan(values(parameter_map.start[None]).amplitude).all():
        values.check(parameter_map.start)
    problem = calibration_problem(values, plan)
    ended = []
    for number in range(plan.starts):
        search = Search(problem, runner.report_of(number))
        start = start_number(search, number, plan.seed, plan.start_draws)
        end = descended(search, start, plan.iterations or ITERATIONS)
        ended.append(_solution(number, search, end.point, values))
    return Calibration(parameter_map, targets, plan, tuple(distinct(ended)), tuple(ended))


def calibration_problem(values: Evaluation, plan: SearchPlan) -> PriorProblem:
    """Return the problem of the free quantities of an evaluation.

    The first `targets.count` residuals are those of the data. Those of values that have a limit
    follow, then those of what is known beside the priors of the quantities.
    """
    parameter_map, targets = values.parameter_map, values.targets
    spread = plan.spread(targets.amplitude)

    def residuals(points: FloatArray) -> Residuals:
        computed = values(points)
        known = parameter_map.prior_residuals(points, computed.preload, computed.elongation)
        beyond = BEYOND_LIMIT * targets.excesses(computed.amplitude, computed.responses, spread)
        exact, smooth = (
            np.hstack([targets.residuals(amplitude, computed.responses, spread), beyond, known])
            for amplitude in (computed.amplitude, computed.power_mean)
        )
        return Residuals(exact, smooth)

    return PriorProblem(parameter_map.unknowns, residuals)


def costs_at(problem: PriorProblem, point: FloatArray, targets: Targets) -> tuple[float, float]:
    """Return half the sums of squares of the data and of the priors at a point, in coordinates."""
    squares = problem.residuals(point[None])[0] ** 2
    # the residuals after those of the data belong to the prior
    return (
        0.5 * float(np.sum(squares[: targets.count])),
        0.5 * float(np.sum(squares[targets.count :]) + np.sum(point**2)),
    )


def _solution(
    number: int, search: Search[PriorProblem], coordinates: FloatArray, values: Evaluation
) -> Solution:
    """Return the end of a search as a solution."""
    problem, targets = search.problem, values.targets
    point = problem.points_at(coordinates)
    data, prior = costs_at(problem, coordinates, targets)
    computed = values(point[None])
    # a limit is a wish: it does not make a quantity more certain
    limited = int(np.isfinite(targets.limit_of_each()).sum())
    limits = slice(targets.count, targets.count + limited)
    here = search.evaluated(coordinates[None]).smooth
    slopes = smooth_slopes(search, coordinates, here, problem.descent.steps[0])
    slopes = np.delete(slopes[: here.shape[1]], limits, axis=0)
    return Solution(
        parameter_map=values.parameter_map,
        targets=targets,
        start=number,
        point=point,
        amplitude=computed.amplitude[0],
        responses=computed.responses[0],
        data_cost=data,
        prior_cost=prior,
        posterior=Posterior(coordinates, slopes, targets.count, problem.unknowns),
        evaluations=search.evaluations,
    )
