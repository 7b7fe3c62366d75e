"""calibrate(machine, free, targets): search from several starts, with each evaluation stored."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wm_drake.batch.ledger import Ledger, key_of
from wm_drake.batch.remembered import model_version, sources_version
from wm_drake.errors import input_error, nearest_names
from wm_drake.model.machine import Machine
from wm_drake.parameters.free import FreeFile
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibration.computed import Evaluation, StoredValues
from wm_drake.studies.calibration.parameter_map import ParameterMap, parameter_map_of
from wm_drake.studies.calibration.search import METHODS, Residuals, SearchProblem
from wm_drake.studies.calibration.solutions import Solution, distinct
from wm_drake.studies.calibration.targets import Targets

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

ITERATIONS = {"least-squares": 60, "basin-hopping": 12, "evolution": 300}
"""Default limit of iterations for each method."""


@dataclass(frozen=True)
class Plan:
    """Settings of the search.

    Attributes:
        method: Name of a method, key of `METHODS`.
        starts: Number of starts. The first is the one in the free file; the others are drawn at
            random around it.
        seed: Seed of the random numbers.
        iterations: Limit of iterations from each start; number of hops for basin hopping. 0 for the
            default of the method.
        deviation: Relative standard deviation of an amplitude.
        resolution: Resolution of the measured amplitudes. Rounding adds the standard deviation
            resolution / sqrt(12). [m]
    """

    method: str = "least-squares"
    starts: int = 8
    seed: int = 0
    iterations: int = 0
    deviation: float = RELATIVE_DEVIATION
    resolution: float = RESOLUTION

    def check(self) -> None:
        """Check the settings.

        Raises:
            InputError: the method is unknown or a number is out of range.
        """
        if self.method not in METHODS:
            raise input_error(
                f"no method '{self.method}'{nearest_names(self.method, METHODS)}", key="method"
            )
        if self.starts < 1:
            raise input_error(f"{self.starts} starts; allowed is 1 or more", key="starts")
        if self.iterations < 0:
            raise input_error(f"{self.iterations} is not allowed; must be >= 0", key="iterations")
        if self.seed < 0:
            raise input_error(f"{self.seed} is not allowed; must be >= 0", key="seed")
        if not 0.0 < self.deviation < np.inf:
            raise input_error(
                f"{self.deviation:g} is not allowed; must be > 0 and finite", key="deviation"
            )
        if not 0.0 <= self.resolution < np.inf:
            raise input_error(
                f"{self.resolution:g} is not allowed; must be >= 0 and finite", key="resolution"
            )

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
    plan: Plan
    solutions: tuple[Solution, ...]
    ended: tuple[Solution, ...]


def identity_of(machine: Machine, free: FreeFile, targets: Targets, plan: Plan) -> dict[str, str]:
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
    machine: Machine,
    free: FreeFile,
    targets: Targets,
    plan: Plan,
    ledger: Ledger,
    *,
    workers: int | None = None,
    report: Callable[[int, int, float], None] = lambda start, evaluations, best: None,
) -> Calibration:
    """Search for machines with the measured amplitudes.

    Each evaluation is stored in the ledger before it is used. A search that is started again takes
    the same path, reads stored evaluations and continues where it stopped. The result does not
    depend on the number of workers.

    Args:
        machine: A built machine. Numbers that the free file does not name keep its values.
        free: Quantities that may change, with bounds and priors.
        targets: Measured amplitudes.
        plan: Settings of the search.
        ledger: The open ledger of this calibration.
        workers: Number of threads; None for the number of cores.
        report: Called with the number of the start, the number of points it has evaluated and its
            lowest cost so far.

    Raises:
        InputError: the free file does not fit the machine, or a setting of the plan is not allowed.
    """
    plan.check()
    parameter_map = parameter_map_of(machine, free)
    values = StoredValues(Evaluation(machine, parameter_map, targets, workers), ledger)
    ended = [
        _search(number, parameter_map, targets, plan, values, report)
        for number in range(plan.starts)
    ]
    return Calibration(parameter_map, targets, plan, tuple(distinct(ended, targets)), tuple(ended))


def residuals_of(
    parameter_map: ParameterMap, targets: Targets, plan: Plan, values: StoredValues
) -> Residuals:
    """Return the residuals as a function of points in units of the prior.

    The first `targets.count` residuals are those of the data. Those of values that have a limit
    follow, then those of what is known beside the priors of the quantities.
    """
    spread = plan.spread(targets.amplitude)

    def residuals(coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        points = parameter_map.expected + coordinates * parameter_map.deviation
        found = values(points)
        known = parameter_map.prior_residuals(points, found.preload, found.elongation)
        beyond = BEYOND_LIMIT * targets.excesses(found.amplitude, found.responses, spread)
        exact, smooth = (
            np.hstack([targets.residuals(amplitude, found.responses, spread), beyond, known])
            for amplitude in (found.amplitude, found.power_mean)
        )
        return exact, smooth

    return residuals


def _search(
    number: int,
    parameter_map: ParameterMap,
    targets: Targets,
    plan: Plan,
    values: StoredValues,
    report: Callable[[int, int, float], None],
) -> Solution:
    residuals = residuals_of(parameter_map, targets, plan, values)
    lower, upper = (
        (bound - parameter_map.expected) / parameter_map.deviation
        for bound in (parameter_map.lower, parameter_map.upper)
    )
    first = (parameter_map.start - parameter_map.expected) / parameter_map.deviation
    problem = SearchProblem(
        residuals, lower, upper, first, lambda evaluations, best: report(number, evaluations, best)
    )
    iterations = plan.iterations or ITERATIONS[plan.method]
    found = METHODS[plan.method](
        problem, problem.start(number, plan.seed), iterations, plan.seed + number
    )
    point = parameter_map.expected + found.point * parameter_map.deviation
    # the residuals after those of the data belong to the prior
    squares = residuals(found.point[None])[0][0] ** 2
    data, prior = (
        0.5 * float(np.sum(squares[: targets.count])),
        0.5 * float(np.sum(squares[targets.count :]) + np.sum(found.point**2)),
    )
    computed = values(point[None])
    # a limit is a wish: it does not make a quantity more certain
    limited = int(np.isfinite(targets.limit_of_each()).sum())
    limits = slice(targets.count, targets.count + limited)
    return Solution(
        number,
        point,
        found.point,
        computed.amplitude[0],
        computed.responses[0],
        data,
        prior,
        np.delete(problem.jacobian(found.point), limits, axis=0),
        targets.count,
        problem.evaluations,
    )
