"""Simpler machines: what the fit loses when quantities keep their expected values."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibration.calibration import (
    ITERATIONS,
    Calibration,
    calibration_problem,
    costs_at,
)
from wm_drake.studies.calibration.computed import Runner
from wm_drake.studies.calibration.solutions import Percents, percents_of
from wm_drake.studies.fitting.kinks import least_squares_search, smooth_jacobian
from wm_drake.studies.fitting.posterior import least_needed_out
from wm_drake.studies.fitting.search import Search


@dataclass(frozen=True)
class Simpler:
    """The best fit with some of the free quantities.

    Attributes:
        count: Number of quantities that stayed free.
        fixed: Names of those that keep their expected values here, but were free in the fit before.
        data_cost, prior_cost: Half the sums of squares of data and prior.
        amplitudes, responses: Mean and largest absolute relative difference of the amplitudes and
            of the other responses; NaN if there are none.
    """

    count: int
    fixed: tuple[str, ...]
    data_cost: float
    prior_cost: float
    amplitudes: Percents
    responses: Percents

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
    runner: Runner, calibration: Calibration, counts: Sequence[int]
) -> list[Simpler]:
    """Fit the machine again with fewer and fewer free quantities.

    From one fit to the next, those quantities go to their expected values whose loss raises the
    cost least, one after the other in the linearised fit. The others are then searched anew by
    least squares from where the linearised fit puts them.

    Args:
        runner: The machine of the calibration, and its ledger.
        calibration: Its result; the first fit is its best solution.
        counts: Falling numbers of free quantities.

    Returns:
        The calibration itself and a fit for each count.

    Raises:
        InputError: the counts do not fall from the number of free quantities.
    """
    parameter_map, targets, plan = calibration.parameter_map, calibration.targets, calibration.plan
    names = parameter_map.names
    check_counts(counts, len(names))
    values = runner.values(parameter_map, targets)
    problem = calibration_problem(values, plan)
    iterations = plan.iterations or ITERATIONS["least-squares"]
    best = calibration.solutions[0]

    def simpler(point: FloatArray, free: np.ndarray, fixed: Sequence[str]) -> Simpler:
        computed = values(problem.points_at(point)[None])
        return Simpler(
            len(free),
            tuple(fixed),
            *costs_at(problem, point, targets),
            percents_of(targets.errors(computed.amplitude[0])),
            percents_of(targets.response_errors(computed.responses[0])),
        )

    point, slopes, free = best.coordinates, best.posterior.all_slopes, np.arange(len(names))
    fits = [simpler(point, free, ())]
    for step, count in enumerate(counts):
        kept, start = least_needed_out(slopes, point[free], count)
        fixed = [names[i] for i in np.delete(free, kept)]
        free = free[kept]
        part = problem.restricted(free, np.zeros(len(names)))
        search = Search(part, runner.report_of(step))
        end = least_squares_search(search, search.clipped(start), iterations)
        point = np.zeros(len(names))
        point[free] = end.point
        slopes = smooth_jacobian(search, end.point)
        fits.append(simpler(point, free, fixed))
    return fits
