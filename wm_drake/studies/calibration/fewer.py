"""Simpler machines: what the fit loses when quantities keep their expected values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wm_drake.batch.ledger import Ledger
from wm_drake.errors import input_error
from wm_drake.model.machine import Machine
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibration.calibration import ITERATIONS, Calibration, residuals_of
from wm_drake.studies.calibration.computed import Evaluation, StoredValues
from wm_drake.studies.calibration.outcome import mean_and_largest
from wm_drake.studies.calibration.search import Residuals, SearchProblem, least_squares_search


@dataclass(frozen=True)
class Simpler:
    """The best fit with some of the free quantities.

    Attributes:
        count: Number of quantities that stayed free.
        fixed: Names of those that keep their expected values here, but were free in the fit before.
        data_cost, prior_cost: Half the sums of squares of data and prior.
        amplitudes, responses: Mean and largest absolute relative difference of the amplitudes and
            of the other responses. (NaN, NaN) if there are none.
    """

    count: int
    fixed: tuple[str, ...]
    data_cost: float
    prior_cost: float
    amplitudes: tuple[float, float]
    responses: tuple[float, float]

    @property
    def cost(self) -> float:
        """Cost that the search minimizes."""
        return self.data_cost + self.prior_cost


def check_counts(counts: Sequence[int], quantities: int) -> None:
    """Check the numbers of free quantities.

    Raises:
        InputError: a number is not between 1 and the number of free quantities, or they do not
            fall.
    """
    falling = all(a > b for a, b in zip([quantities, *counts], [*counts, 0], strict=True))
    if not falling:
        shown = ", ".join(map(str, counts))
        raise input_error(
            f"{shown}: needs falling numbers from {quantities - 1} to 1; {quantities} quantities "
            "are free",
            where="--fewer",
        )


def fit_with_fewer(
    machine: Machine,
    calibration: Calibration,
    counts: Sequence[int],
    ledger: Ledger,
    *,
    workers: int | None = None,
    report: Callable[[int, int, float], None] = lambda step, evaluations, best: None,
) -> list[Simpler]:
    """Fit the machine again with fewer and fewer free quantities.

    From one fit to the next, those quantities go to their expected values whose loss raises the
    cost least, one after the other in the linearised fit. The others are then searched anew by
    least squares from where the linearised fit puts them.

    Args:
        machine: The built machine of the calibration.
        calibration: Its result; the first fit is its best solution.
        counts: Falling numbers of free quantities.
        ledger: The open ledger of the calibration, which keeps the evaluations.
        workers: Number of threads; None for the number of cores.
        report: Called with the number of the fit, the number of points it has evaluated and its
            lowest cost so far.

    Returns:
        The calibration itself and a fit for each count.

    Raises:
        InputError: the counts do not fall from the number of free quantities.
    """
    mapped, targets, plan = calibration.parameter_map, calibration.targets, calibration.plan
    check_counts(counts, len(mapped.names))
    values = StoredValues(Evaluation(machine, mapped, targets, workers), ledger)
    residuals = residuals_of(mapped, targets, plan, values)
    iterations = plan.iterations or ITERATIONS["least-squares"]
    best = calibration.solutions[0]
    point, slopes, free = best.coordinates, best.all_slopes, np.arange(len(mapped.names))
    fits = [_fit(calibration, residuals, values, point, free, ())]
    for step, count in enumerate(counts):
        kept, start = least_needed_out(slopes, point[free], count)
        gone = [mapped.names[i] for i in np.delete(free, kept)]
        free = free[kept]
        problem = _problem(calibration, residuals, free, start, step, report)
        found = least_squares_search(problem, problem.start(0, plan.seed), iterations)
        point = np.zeros(len(mapped.names))
        point[free] = found.point
        slopes = problem.jacobian(found.point)
        fits.append(_fit(calibration, residuals, values, point, free, gone))
    return fits


def fewer_table(fits: Sequence[Simpler]) -> pd.DataFrame:
    """Return a table with a row for each fit; differences in percent, names separated by blanks."""
    return pd.DataFrame(
        [
            {
                "free_quantities": fit.count,
                "cost": fit.cost,
                "cost_of_data": fit.data_cost,
                "amplitudes_mean_percent": 100.0 * fit.amplitudes[0],
                "amplitudes_largest_percent": 100.0 * fit.amplitudes[1],
                "responses_mean_percent": 100.0 * fit.responses[0],
                "responses_largest_percent": 100.0 * fit.responses[1],
                "set_to_expected": " ".join(fit.fixed),
            }
            for fit in fits
        ]
    )


def least_needed_out(
    slopes: FloatArray, point: FloatArray, count: int
) -> tuple[np.ndarray, FloatArray]:
    """Choose the quantities that stay free, in the linearised fit.

    At its minimum the cost is a quadratic function with the curvature H = J^T J + 1. If coordinate
    i goes to 0 and the others follow, it rises by x_i^2 / (2 (H^-1)_ii). The one with the least
    rise goes first.

    Args:
        slopes: (m, n) derivatives J of the residuals with respect to the coordinates.
        point: (n) coordinates x of the minimum.
        count: Number of coordinates that stay free.

    Returns:
        Indices of those, rising (count), and their values at the minimum without the others
        (count).
    """
    kept, x = np.arange(len(point)), np.array(point)
    curvature = slopes.T @ slopes + np.eye(len(point))
    while len(kept) > count:
        covariance = np.linalg.inv(curvature)
        out = int(np.argmin(x**2 / np.diag(covariance)))
        x = x - covariance[:, out] / covariance[out, out] * x[out]
        kept, x = np.delete(kept, out), np.delete(x, out)
        curvature = np.delete(np.delete(curvature, out, axis=0), out, axis=1)
    return kept, x


def _problem(
    calibration: Calibration,
    residuals: Residuals,
    free: np.ndarray,
    start: FloatArray,
    step: int,
    report: Callable[[int, int, float], None],
) -> SearchProblem:
    """Return the search over some coordinates; the others are 0, their expected values."""
    mapped = calibration.parameter_map
    lower, upper = (
        ((bound - mapped.expected) / mapped.deviation)[free]
        for bound in (mapped.lower, mapped.upper)
    )

    def of_free(coordinates: FloatArray) -> tuple[FloatArray, FloatArray]:
        full = np.zeros((len(coordinates), len(mapped.names)))
        full[:, free] = coordinates
        return residuals(full)

    return SearchProblem(
        of_free, lower, upper, start, lambda evaluations, best: report(step, evaluations, best)
    )


def _fit(
    calibration: Calibration,
    residuals: Residuals,
    values: StoredValues,
    point: FloatArray,
    free: np.ndarray,
    fixed: Sequence[str],
) -> Simpler:
    mapped, targets = calibration.parameter_map, calibration.targets
    squares = residuals(point[None])[0][0] ** 2
    computed = values((mapped.expected + point * mapped.deviation)[None])
    amplitude = np.where(
        targets.weight > 0.0, computed.amplitude[0] / targets.amplitude - 1.0, np.nan
    )
    wanted = np.array([target.value for target in targets.responses])
    others = np.where(targets.response_weight > 0.0, computed.responses[0] / wanted - 1.0, np.nan)
    return Simpler(
        len(free),
        tuple(fixed),
        0.5 * float(np.sum(squares[: targets.count])),
        0.5 * float(np.sum(squares[targets.count :]) + np.sum(point**2)),
        mean_and_largest(amplitude),
        mean_and_largest(others) if len(wanted) else (np.nan, np.nan),
    )
