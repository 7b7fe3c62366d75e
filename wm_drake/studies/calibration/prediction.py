"""Prediction of held-out loads: calibrate without some loads, then compute their amplitudes.

An interval says how far the data and the priors determine a predicted amplitude. It comes from
machines that are drawn from the posterior of the calibration, and from the scatter of the
amplitudes that this calibration has seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters.free import FreeFile
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibration.calibration import Calibration, Plan, calibrate
from wm_drake.studies.calibration.computed import Runner, StoredValues
from wm_drake.studies.calibration.targets import Targets


@dataclass(frozen=True)
class Prediction:
    """Errors of a group of held-out loads.

    Attributes:
        loads: Names of the held-out loads.
        calibrated: (case, sensor) relative errors of their amplitudes in the calibration with all
            loads.
        predicted: (case, sensor) relative errors of their amplitudes in the calibration without
            them.
        seen: (case, sensor) relative errors of the other loads in the calibration without them.
        interval: (2, case, sensor) limits of the 95 % intervals of the predicted amplitudes,
            relative to the measured ones: (limit - measured) / measured.
        scatter: Standard deviation of the logarithms of an amplitude that the intervals assume
            beside the uncertainty of the machine.
    """

    loads: tuple[str, ...]
    calibrated: FloatArray
    predicted: FloatArray
    seen: FloatArray
    interval: FloatArray
    scatter: float

    @property
    def covered(self) -> float:
        """Fraction of the measured amplitudes that the intervals contain."""
        lower, upper = self.interval
        return float(np.mean((lower <= 0.0) & (upper >= 0.0)))


LEVEL = 0.95
"""Probability of an interval."""


def predict(
    runner: Runner,
    free: FreeFile,
    calibration: Calibration,
    held_out: Sequence[Sequence[str]],
    plan: Plan | None = None,
) -> list[Prediction]:
    """Repeat a calibration once for each group of held-out loads.

    These searches start at or around the expected values. The start values of the free file are not
    used, because they may come from a calibration with all loads.

    Args:
        runner: The machine, and the ledger of this calibration.
        free: Quantities that may change, with bounds and priors.
        calibration: Calibration with all loads.
        held_out: Groups of names of loads.
        plan: Settings of these searches; None for those of the calibration.

    Returns:
        One prediction for each group.

    Raises:
        InputError: a load was not measured, or a group contains all loads.
    """
    check_held_out(calibration.targets, held_out)
    targets, plan, predictions = calibration.targets, plan or calibration.plan, []
    for loads in map(tuple, held_out):
        seen = targets.without(*loads)
        others = calibrate(runner, free.without_starts(), seen, plan)
        cases, best = targets.of(*loads), others.solutions[0]
        limits, scatter = _interval(others, runner.values(others.parameter_map, targets))
        predictions.append(
            Prediction(
                loads,
                calibration.solutions[0].amplitude[cases] / targets.amplitude[cases] - 1.0,
                best.amplitude[cases] / targets.amplitude[cases] - 1.0,
                best.errors[~cases],
                limits[:, cases] / targets.amplitude[cases] - 1.0,
                scatter,
            )
        )
    return predictions


def _interval(calibration: Calibration, values: StoredValues) -> tuple[FloatArray, float]:
    """Return the limits (2, case, sensor) of predicted amplitudes [m], and the scatter.

    Machines are drawn in equal numbers from the normal distributions around all distinct good
    solutions, because the data cannot tell these apart.
    """
    plan, parameter_map = calibration.plan, calibration.parameter_map
    generator = np.random.default_rng([plan.seed, plan.draws])
    logarithms = np.log1p(calibration.solutions[0].errors)
    scatter = max(plan.deviation, float(np.sqrt(np.nanmean(logarithms**2))))
    each = -(-plan.draws // len(calibration.solutions))
    drawn = np.concatenate(
        [
            generator.multivariate_normal(
                solution.coordinates,
                solution.posterior.covariance(scatter / plan.deviation),
                each,
            )
            for solution in calibration.solutions
        ]
    )
    points = np.clip(
        parameter_map.expected + drawn * parameter_map.deviation,
        parameter_map.lower,
        parameter_map.upper,
    )
    amplitude = np.log(values(points).amplitude)
    amplitude += generator.normal(0.0, scatter, amplitude.shape)
    tail = 50.0 * (1.0 - LEVEL)
    return np.exp(np.nanpercentile(amplitude, [tail, 100.0 - tail], axis=0)), scatter


def check_held_out(targets: Targets, held_out: Sequence[Sequence[str]]) -> None:
    """Check that each group of loads can be held out.

    Raises:
        InputError: a load was not measured, or a group contains all loads.
    """
    known = {name for name, _ in targets.loads}
    for loads in held_out:
        for name in loads:
            if list(loads).count(name) > 1:
                raise input_error(f"'{name}' is given twice", key="leave-out")
            if name not in known:
                raise input_error(
                    f"no measured load '{name}'{nearest_names(name, known)}", key="leave-out"
                )
        if known <= set(loads):
            raise input_error("leaves no load to calibrate with; name fewer loads", key="leave-out")
