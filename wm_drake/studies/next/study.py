"""Choose measurements by how much surer they make an answer: linear-Gaussian design, and samples.

The scores u of what is known are standard normal (`knowledge`). Near the middle, answers y and
numbers d of measurements, the latter in standard deviations of their errors e, are

    y = y0 + G u,    d = d0 + J u + e,    u ~ N(0, I),  e ~ N(0, I)

so that after the measurements of rows J_c the covariance of y is

    S = G G' - K J_c G',    K = G J_c' (I + J_c J_c')^-1

(Chaloner and Verdinelli, Statistical Science 10 (1995) 273-304, section 2: the expected variance of
linear functions). G and J are central differences over a step of one deviation. An answer is the
worst of several loads, thus not linear: its variance is that of the worst of y, over draws of
N(y0, S). Where y and d themselves are not near linear, machines are drawn and run, their answers
are regressed on the worst of y0 + K (d - d0) of their own data, and the variance is that of what
the regression misses; a fit that is not linear misses less. Derivation and limits:
docs/theory/next.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import HIDDEN, SHARE, Quantity
from wm_drake.studies.experiment import in_three_digits
from wm_drake.studies.next.measurements import CandidateMeasurement
from wm_drake.studies.next.question import Question

STEP = 1.0
"""Step of the central differences, in standard deviations of what is known."""

DRAWS = 4096
"""Draws of the worst of several loads."""

NEAR_LINEAR = 0.9
"""Least part of the variance of an answer that the linear model explains, for its use."""

ENDS = (2.5, 97.5)
"""Percentiles at the ends of an interval of 95 %."""

LEAST_GAIN = 0.02
"""Part of the width of an interval from which a measurement is worth making."""

LEAST_USABLE = 0.5
"""Least part of the drawn machines that can be run."""

SEEN = 1e-3
"""Change of a number by a deviation of what is known, in deviations of its error, from which the
measurement says something."""

MOST_PAIRS = 10
"""Number of pairs that are shown."""

COST = Quantity("cost", form="{:g}".format)


@dataclass(frozen=True, eq=False)
class Model:
    """Answers and measurements near the middle of what is known, and of machines drawn from it.

    Attributes:
        question: What shall become sure; its measurements are those below.
        middle: Answers of each load. (K,) [SI]
        slopes: Their derivatives by the scores. (K, p) [SI]
        data_slopes: Derivatives of the numbers of each measurement, in deviations. (n, p)
        drawn: Answers of drawn machines. (N, K) [SI]
        drawn_data: Distances of their numbers from the middle, with errors, in deviations (N, n);
            empty if the answers are near linear.
        scores: Scores of the drawn machines. (N, p)
    """

    question: Question
    middle: FloatArray
    slopes: FloatArray
    data_slopes: tuple[FloatArray, ...]
    drawn: FloatArray
    drawn_data: tuple[FloatArray, ...]
    scores: FloatArray

    @cached_property
    def explained(self) -> FloatArray:
        """Return the part of each answer's variance that the linear model explains. (answers,)"""
        linear = self.question.worst(self.middle + self.scores @ self.slopes.T)
        real = self.question.worst(self.drawn)
        return np.asarray(1.0 - np.var(real - linear, axis=0) / np.var(real, axis=0))

    @property
    def is_linear(self) -> bool:
        """Return whether the linear model is used."""
        return bool(np.all(self.explained >= NEAR_LINEAR))

    @cached_property
    def _normal(self) -> FloatArray:
        rng = np.random.default_rng(0)
        half = rng.standard_normal((DRAWS // 2, len(self.middle)))
        return np.concatenate([half, -half])  # the mean is exact

    def _gain(self, chosen: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Return the matrix K of the estimate, and G J'. (K, n)"""
        rows = np.vstack([self.data_slopes[k] for k in chosen])
        both = self.slopes @ rows.T
        gain = np.linalg.solve(rows @ rows.T + np.eye(len(rows)), both.T).T
        return np.asarray(gain, dtype=float), both

    def linear(self, chosen: Sequence[int]) -> FloatArray:
        """Return draws of the answers after measurements that come out as expected. (DRAWS, a)"""
        covariance = self.slopes @ self.slopes.T
        if chosen:
            gain, both = self._gain(chosen)
            covariance = covariance - gain @ both.T
        sizes, directions = np.linalg.eigh(covariance)
        # the symmetric root: a small change of the covariance changes the draws little
        root = (directions * np.sqrt(np.maximum(sizes, 0.0))) @ directions.T
        return self.question.worst(self.middle + self._normal @ root.T)

    def missed(self, chosen: Sequence[int]) -> FloatArray:
        """Return what estimates from the data of drawn machines miss of the answers. (N, answers)

        Each estimate is the line through the real answers over the worst of y0 + K (d - d0).
        """
        real = self.question.worst(self.drawn)
        missed = real - real.mean(axis=0)
        if not chosen:
            return missed
        data = np.hstack([self.drawn_data[k] for k in chosen])
        estimated = self.question.worst(self.middle + data @ self._gain(chosen)[0].T)
        estimated -= estimated.mean(axis=0)
        size = np.maximum(np.sum(estimated**2, axis=0), np.finfo(float).tiny)
        return np.asarray(missed - np.sum(estimated * missed, axis=0) / size * estimated)

    def sampled(self, chosen: Sequence[int]) -> FloatArray:
        """Return the answers of the drawn machines, drawn together as measurements do. (N, a)

        They are drawn to the answers of the machine in the middle, to which measurements point that
        come out as expected.
        """
        real, middle = self.question.worst(self.drawn), self.question.worst(self.middle[None])
        share = np.mean(self.missed(chosen) ** 2, axis=0) / np.var(real, axis=0)
        return np.asarray(middle + np.sqrt(share) * (real - middle))

    def gain_error(self, chosen: Sequence[int], known: Sequence[int] = ()) -> float:
        """Return the standard error, by the drawn machines, of a gain of the first answer.

        Args:
            chosen: Measurements.
            known: Those of them that are made already.
        """
        if self.is_linear:
            return 0.0
        before, after = (self.missed(some)[:, 0] ** 2 for some in (known, chosen))
        share = after.mean() / before.mean()
        error = np.std(after - share * before) / (before.mean() * np.sqrt(len(before)))
        return float(0.5 * error / np.sqrt(share))

    def after(self, chosen: Sequence[int]) -> FloatArray:
        """Return draws of the answers after measurements, by the method that holds. (k, a)"""
        return self.linear(chosen) if self.is_linear else self.sampled(chosen)

    def remaining(self, chosen: Sequence[int]) -> float:
        """Return the part of the variance of the answers that remains, in the mean over them."""
        return float(np.mean(np.var(self.after(chosen), axis=0) / self._before))

    @cached_property
    def _before(self) -> FloatArray:
        return np.asarray(np.var(self.after(()), axis=0))


def model_of(question: Question, samples: int, seed: int) -> Model:
    """Run the machines of the differences and those that are drawn, and return the model.

    Measurements that say nothing about what is uncertain are left out.

    Raises:
        InputError: the machine in the middle cannot be run, or too many machines cannot.
    """
    size = len(question.knowledge.names)
    steps = STEP * np.eye(size)
    near = question.at(np.concatenate([np.zeros((1, size)), steps, -steps]), "differences")
    middle = near.answers[0]
    if not np.isfinite(middle).all():
        raise input_error("the machine in the middle of what is known cannot be run")
    slopes_of_answers = _slopes(near.answers)
    if not np.isfinite(slopes_of_answers).all():
        lost = np.flatnonzero(~np.isfinite(slopes_of_answers).all(axis=0)).tolist()
        names = ", ".join(question.knowledge.names[k] for k in lost)
        raise input_error(f"machines with more and with less of {names} cannot be run")
    if not slopes_of_answers.any():
        raise input_error("nothing that is uncertain changes the answer")
    scores = np.random.default_rng(seed).standard_normal((samples, size))
    plain = replace(question, measurements=(), experiments={True: question.experiments[True]})
    drawn = plain.at(scores, "samples").answers
    kept = np.isfinite(drawn).all(axis=1)
    if kept.mean() < LEAST_USABLE:
        raise input_error(
            f"only {kept.sum()} of {samples} machines drawn from what is known can be run; allowed "
            "are narrower priors or tolerances"
        )
    model = Model(question, middle, slopes_of_answers, (), drawn[kept], (), scores[kept])
    return _with_data(model, near.numbers, seed)


def _with_data(model: Model, near: Sequence[FloatArray], seed: int) -> Model:
    """Return a model with the measurements that say something about what is uncertain.

    Only if the answer is not near linear, the drawn machines are measured too.

    Args:
        near: Numbers of each measurement in the middle and beside it, as of `_slopes`.
    """
    question, rng = model.question, np.random.default_rng([seed, 1])
    drawn = None if model.is_linear else question.at(model.scores, "samples measured").numbers
    if drawn is not None:  # some may not run without their gasket
        kept = np.all([np.isfinite(numbers).any(axis=1) for numbers in drawn], axis=0)
        drawn = tuple(numbers[kept] for numbers in drawn)
        model = replace(model, drawn=model.drawn[kept], scores=model.scores[kept])
    chosen, slopes, data = list[CandidateMeasurement](), list[FloatArray](), list[FloatArray]()
    for number, (measurement, numbers) in enumerate(zip(question.measurements, near, strict=True)):
        deviation = measurement.deviations(numbers[0])
        slope = _slopes(numbers) / deviation[:, None]
        is_known = np.isfinite(slope).all(axis=1)
        if drawn is not None:
            is_known &= np.isfinite(drawn[number]).all(axis=0)
        if not np.any(np.abs(slope[is_known]) > SEEN):
            continue
        chosen.append(measurement)
        slopes.append(slope[is_known])
        if drawn is not None:
            distance = ((drawn[number] - numbers[0]) / deviation)[:, is_known]
            data.append(distance + rng.standard_normal(distance.shape))
    measured = replace(question, measurements=tuple(chosen))
    return replace(model, question=measured, data_slopes=tuple(slopes), drawn_data=tuple(data))


def _slopes(values: FloatArray) -> FloatArray:
    """Return derivatives by the scores, central where both sides are known. (n, p)

    Args:
        values: In the middle, a step above, and a step below, for each score. (1 + 2 p, n)
    """
    above, below = np.split(values[1:], 2)
    sides = (
        np.where(np.isfinite(above), above, values[0]),
        np.where(np.isfinite(below), below, values[0]),
    )
    width = STEP * (np.isfinite(above).astype(float) + np.isfinite(below))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(((sides[0] - sides[1]) / width).T)


def sequence_of(model: Model, budget: int) -> list[int]:
    """Return the measurements that a greedy search takes one after the other.

    It ends where no gain can be told from the scatter of drawn machines.
    """
    taken, measurements = list[int](), model.question.measurements
    for _ in range(budget):
        left = [
            k
            for k, measurement in enumerate(measurements)
            if k not in taken and not any(measurement.repeats(measurements[t]) for t in taken)
        ]
        if not left:
            break
        remaining = [model.remaining([*taken, k]) for k in left]
        best = left[int(np.argmin(remaining))]
        gain = 1.0 - np.sqrt(min(remaining) / model.remaining(taken))
        if not model.is_linear and gain < least_gain(model.gain_error([*taken, best], taken)):
            break
        taken.append(best)
    return taken


def least_gain(error: Any) -> Any:
    """Return the gain from which a measurement is worth making, with the error of gains."""
    return np.maximum(LEAST_GAIN, 2.0 * error)


def singles_of(model: Model) -> xr.Dataset:
    """Return what each measurement alone does, the best first.

    In the mean over its outcomes, no measurement makes an answer less sure. At the expected outcome
    the worst of several loads may scatter more; that counts as no gain.

    Returns:
        Over `candidate`, in words: its `name` in the file; `gain`, the part by which the interval
        of the first answer becomes narrower, and its standard `error` by the drawn machines, 0 if
        the linear model is used; `remaining`, the part of the variance that remains; `cost`, and
        `gain_per_cost`. Over `answer` too `half_width` of the interval of 95 %.
    """
    measurements = model.question.measurements
    every = [[k] for k in range(len(measurements))]
    widths = np.array([half_widths(model.after(chosen)) for chosen in every])
    before = half_widths(model.after(()))
    widths = np.minimum(widths.reshape(len(every), len(before)), before)
    remaining = np.array([model.remaining(chosen) for chosen in every])
    order = np.argsort(remaining, kind="stable")
    costs = np.array([m.cost for m in measurements])
    gain = 1.0 - widths[:, 0] / before[0]
    error = [model.gain_error(chosen) for chosen in every]
    of_answer = in_three_digits(model.question.answers)
    width = Quantity("± after").of_each("answer", of_answer, ("candidate", "answer"), widths)
    data = xr.Dataset(
        {
            "name": ("candidate", [m.name for m in measurements], {HIDDEN: True}),
            "half_width": width,
            "gain": SHARE.named("narrower by").variable("candidate", gain),
            "error": SHARE.named("± by sampling").variable("candidate", error),
            "remaining": SHARE.named("variance that remains").variable("candidate", remaining),
            "cost": COST.variable("candidate", costs),
            "gain_per_cost": SHARE.named("narrower per cost").variable("candidate", gain / costs),
        },
        {"candidate": [m.words for m in measurements], "answer": list(of_answer)},
    )
    return data.isel(candidate=order)


def half_widths(draws: FloatArray) -> FloatArray:
    """Return half the widths of the intervals of 95 %. (answers,)"""
    low, high = np.percentile(draws, ENDS, axis=0)
    return np.asarray(0.5 * (high - low))


def pairs_of(model: Model) -> xr.Dataset:
    """Return the variance that remains after each pair of measurements, the best first.

    Returns:
        Over `pair`: names `first` and `second`, and `remaining`.
    """
    measurements = model.question.measurements
    both = combinations(range(len(measurements)), 2)
    pairs = [(a, b) for a, b in both if not measurements[a].repeats(measurements[b])]
    remaining = np.array([model.remaining(pair) for pair in pairs])
    order = np.argsort(remaining, kind="stable")[:MOST_PAIRS]
    names = [[measurements[k].words for k in pairs[place]] for place in order.tolist()]
    first, second = np.reshape(names, (-1, 2)).T
    share = SHARE.named("variance that remains").variable("pair", remaining[order])
    return xr.Dataset({"first": ("pair", first), "second": ("pair", second), "remaining": share})


def steps_of(model: Model, taken: Sequence[int]) -> xr.Dataset:
    """Return the answers before and after each measurement of a sequence.

    Returns:
        Over `step`, from 0: `words` of what was measured; over `answer` too `value` of the machine
        in the middle, and the ends `low` and `high` of its interval of 95 %.
    """
    question = model.question
    of_answer = in_three_digits(question.answers)
    draws = [model.after(taken[:count]) for count in range(len(taken) + 1)]
    low, high = np.array([np.percentile(d, ENDS, axis=0) for d in draws]).swapaxes(0, 1)
    value = np.tile(question.worst(model.middle[None])[0], (len(draws), 1))
    dims = ("step", "answer")
    each = {"value": value, "low": low, "high": high}
    heads = {"value": "value", "low": "95 % from", "high": "to"}
    return xr.Dataset(
        {
            "words": ("step", ["", *(question.measurements[k].words for k in taken)]),
            **{
                n: Quantity(heads[n]).of_each("answer", of_answer, dims, v) for n, v in each.items()
            },
        },
        {"step": range(len(draws)), "answer": list(of_answer)},
    )
