"""Prediction of held-out loads: calibrate without some loads, then compute their values.

An interval says how far the data and the priors determine a predicted value. It comes from
machines that are drawn from the posterior of the calibration, and from the scatter of the values
that this calibration has seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.errors import check_known, input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.vary_file import VaryFile
from wm_drake.studies.calibrate.computed import Evaluation
from wm_drake.studies.calibrate.response_targets import ResponseTarget
from wm_drake.studies.calibrate.solutions import Solution
from wm_drake.studies.calibrate.study import Calibration, SearchPlan, calibrate
from wm_drake.studies.calibrate.targets import AMPLITUDE, Targets
from wm_drake.studies.experiment import Experiment

FITS = ("calibrated", "predicted", "seen")
"""Errors of a kind of values in a prediction, by the names of its attributes."""


@dataclass(frozen=True)
class KindErrors:
    """Errors of the values of one kind in a prediction; each is a fraction.

    Attributes:
        name: `AMPLITUDE`, or `ResponseTarget.kind_of_value` of other responses.
        calibrated: (n) errors of the held-out values in the calibration with all loads.
        predicted: (n) errors of the held-out values in the calibration without them.
        seen: Errors of the other values in the calibration without the held-out ones.
        is_covered: (n) whether the 95 % interval of a prediction contains the value.
    """

    name: str
    calibrated: FloatArray
    predicted: FloatArray
    seen: FloatArray
    is_covered: np.ndarray


@dataclass(frozen=True)
class Prediction:
    """What a calibration without some loads says of them.

    Attributes:
        loads: Names of the held-out loads.
        with_all: Best solution of the calibration with all loads.
        without: Best solution of the calibration without the held-out loads; its targets are the
            others.
        amplitude: (3, case, sensor) amplitudes of `without`, and lower and upper limits of their
            95 % intervals. [m]
        responses: (3, response) the same of the other responses. [unit for reading]
        scatter: Standard deviation of the logarithms of an amplitude that the intervals assume
            beside the uncertainty of the machine.
    """

    loads: tuple[str, ...]
    with_all: Solution
    without: Solution
    amplitude: FloatArray
    responses: FloatArray
    scatter: float

    @property
    def cases(self) -> np.ndarray:
        """Whether the load of each case is held out. (case,)"""
        return self.with_all.targets.of(*self.loads)

    @property
    def covered(self) -> float:
        """Fraction of the held-out values that the intervals contain."""
        return float(np.mean(np.concatenate([kind.is_covered for kind in self.kinds()])))

    def kinds(self) -> tuple[KindErrors, ...]:
        """Return the errors of each kind of held-out values, amplitudes first."""
        targets, cases = self.with_all.targets, self.cases
        measured = targets.amplitude
        predicted, lower, upper = self.amplitude
        amplitudes = KindErrors(
            AMPLITUDE,
            (self.with_all.amplitude / measured - 1.0)[cases].ravel(),
            (predicted / measured - 1.0)[cases].ravel(),
            self.without.errors.ravel(),
            ((lower <= measured) & (measured <= upper))[cases].ravel(),
        )
        names = dict.fromkeys(target.kind_of_value for target in targets.responses)
        others = map(self._kind, names)
        return amplitudes, *(kind for kind in others if kind.predicted.size)

    def _kind(self, name: str) -> KindErrors:
        """Return the errors of the responses of one kind."""
        targets, others = self.with_all.targets.responses, self.without.targets.responses
        held = [
            k for k, t in enumerate(targets) if t.kind_of_value == name and t.load in self.loads
        ]
        seen = [k for k, target in enumerate(others) if target.kind_of_value == name]

        def errors(values: FloatArray) -> FloatArray:
            return np.array([float(targets[k].errors(values[k])) for k in held])

        predicted, lower, upper = self.responses
        covered = [bool(lower[k] <= targets[k].value <= upper[k]) for k in held]
        return KindErrors(
            name,
            errors(self.with_all.responses),
            errors(predicted),
            self.without.response_errors[seen],
            np.array(covered, dtype=bool),
        )


LEVEL = 0.95
"""Probability of an interval."""


def predict(
    experiment: Experiment,
    free: VaryFile,
    calibration: Calibration,
    held_out: Sequence[Sequence[str]],
    plan: SearchPlan | None = None,
) -> list[Prediction]:
    """Repeat a calibration once for each group of held-out loads.

    These searches start at or around the expected values. The start values of the vary file are not
    used, because they may come from a calibration with all loads.

    Args:
        experiment: Runs of the machine.
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
        others = calibrate(experiment, free.without_starts(), seen, plan)
        values = Evaluation(experiment, others.parameter_map, targets)
        predicted = _predicted(others, values)
        best = others.solutions[0]
        predictions.append(Prediction(loads, calibration.solutions[0], best, *predicted))
    return predictions


def _predicted(
    calibration: Calibration, values: Evaluation
) -> tuple[FloatArray, FloatArray, float]:
    """Return `amplitude`, `responses` and `scatter` of a prediction.

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
                solution.fit.linear.covariance(scatter / plan.deviation),
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
    best, computed = values(calibration.solutions[0].point[None]), values(points)
    amplitude = computed.amplitude * np.exp(
        generator.normal(0.0, scatter, computed.amplitude.shape)
    )
    noise = generator.normal(0.0, 1.0, computed.responses.shape)
    responses = _scattered(calibration, values.targets.responses, computed.responses, noise)
    tails = [50.0 * (1.0 - LEVEL), 50.0 * (1.0 + LEVEL)]
    pairs = (best.amplitude, amplitude), (best.responses, responses)
    ends = [np.vstack([at, np.nanpercentile(drawn, tails, axis=0)]) for at, drawn in pairs]
    return ends[0], ends[1], scatter


def _scattered(
    calibration: Calibration,
    targets: Sequence[ResponseTarget],
    drawn: FloatArray,
    noise: FloatArray,
) -> FloatArray:
    """Return drawn responses (machine, response) with the scatter that this calibration has seen.

    The scatter of a response is its deviation, or the root mean square error of the used ones of
    its kind if that is larger.

    Args:
        calibration: The calibration without the held-out loads.
        targets: Targets of all responses.
        drawn: Responses of drawn machines (machine, response). [unit for reading]
        noise: Random numbers of unit deviation (machine, response).
    """
    seen, errors = calibration.targets.responses, calibration.solutions[0].response_errors
    result = np.empty_like(drawn)
    for place, target in enumerate(targets):
        of_kind = [
            error / other.deviation
            for error, other in zip(errors, seen, strict=True)
            if other.kind_of_value == target.kind_of_value and np.isfinite(error)
        ]
        root = float(np.sqrt(np.mean(np.square(of_kind)))) if of_kind else 1.0
        scatter = target.deviation * max(1.0, root) * noise[:, place]
        result[:, place] = target.scattered(drawn[:, place], scatter)
    return result


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
            check_known(name, known, f"no measured load '{name}'", key="leave-out")
        if known <= set(loads):
            raise input_error("leaves no load to calibrate with; name fewer loads", key="leave-out")
