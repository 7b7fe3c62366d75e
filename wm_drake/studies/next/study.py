"""Choose measurements by how much surer they make an answer: linear-Gaussian design, and samples.

The scores u of what is known are standard normal (`knowledge`). Near the middle, answers y and
numbers d of measurements, the latter in standard deviations of their errors e, are

    y = y0 + G u,    d = d0 + J u + e,    u ~ N(0, I),  e ~ N(0, I)

so that after the measurements of rows J_c the covariance of y is

    S = G G' - K J_c G',    K = G J_c' (I + J_c J_c')^-1

(Chaloner and Verdinelli, Statistical Science 10 (1995) 273-304, section 2: the expected variance of
linear functions). G and J are central differences over a step of one deviation. An answer is the
worst of several loads, thus not linear: its variance is that of the worst of y, over draws of
N(y0, S). Where y and d themselves are not near linear, the same estimate y0 + K (d - d0) is applied
to machines that are drawn and run, and the variance is that of what it misses; a fit that is not
linear misses less. Derivation and limits: docs/theory/next.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
import xarray as xr

from wm_drake.engines.compiled.step_check import check_step
from wm_drake.errors import InputError, input_error
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.measures.responses import Response
from wm_drake.simulation.steps import checked_step
from wm_drake.studies.experiment import Experiment, quantity_of, response_of
from wm_drake.studies.next.knowledge import Knowledge
from wm_drake.studies.next.measurements import Machines, Measurement

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

SHARE = Quantity("share", Share(), 0)
COST = Quantity("cost", form="{:g}".format)


@dataclass(frozen=True)
class Question:
    """What shall become sure, and how it can be measured.

    Attributes:
        knowledge: What is known.
        measurements: What could be measured.
        answers: Responses, each of its worst load.
        loads: Loads of the answers.
        experiments: Runs with the gasket (True) and without it.
    """

    knowledge: Knowledge
    measurements: tuple[Measurement, ...]
    answers: tuple[Response, ...]
    loads: tuple[str, ...]
    experiments: Mapping[bool, Experiment]

    def at(self, scores: FloatArray, what: str) -> "Observed":
        """Run the machines at scores (k, p), and return their answers and what is measured."""
        kept, machines = self._usable(scores)
        runs = {
            gasket: experiment.at(kept, machines, what)
            for gasket, experiment in self.experiments.items()
        }
        found = Machines(self.knowledge.machine, machines, runs)
        none = np.empty((len(machines), 0))
        answers = [none, *(self._signed(runs[True], response) for response in self.answers)]
        numbers = [m.numbers(found).reshape(len(machines), -1) for m in self.measurements]
        return Observed(
            _placed(np.hstack(answers), kept, len(scores)),
            tuple(_placed(part, kept, len(scores)) for part in numbers),
        )

    def _usable(self, scores: FloatArray) -> tuple[list[int], list[MachineParameters]]:
        """Return the places of scores with a machine that can be run, and these machines."""
        machine, context = self.knowledge.machine, None
        step = checked_step(machine.parameters, None)
        kept, machines = list[int](), list[MachineParameters]()
        for place, score in enumerate(scores):
            try:
                parameters = self.knowledge.at(score)
                setup = machine.set_up(parameters=parameters, context=context)
                check_step(setup, step)
            except InputError:
                continue
            context = setup.context
            kept.append(place)
            machines.append(parameters)
        return kept, machines

    def _signed(self, runs: xr.Dataset, response: Response) -> FloatArray:
        """Return a response of each load, signed so that less is better. (machines, loads)"""
        values = response_of(runs, response).sel(load=list(self.loads))
        return sign_of(response) * values.transpose("point", "load").values

    def worst(self, answers: FloatArray) -> FloatArray:
        """Return each answer of its worst load, with its own sign. (k, answers) [SI]

        Args:
            answers: As of `Observed.answers`.
        """
        of_loads = answers.reshape(len(answers), len(self.answers), len(self.loads))
        return np.array([sign_of(r) for r in self.answers]) * of_loads.max(axis=2)


@dataclass(frozen=True, eq=False)
class Observed:
    """Machines at points; NaN if there is no such machine, or a run failed.

    Attributes:
        answers: Each answer of each load, signed so that less is better. (k, answers loads) [SI]
        numbers: Numbers of each measurement. (k, n)
    """

    answers: FloatArray
    numbers: tuple[FloatArray, ...]


def _placed(values: FloatArray, kept: Sequence[int], count: int) -> FloatArray:
    """Return rows at their places among NaN."""
    rows = np.full((count, values.shape[1]), np.nan)
    rows[list(kept)] = values
    return rows


def sign_of(response: Response) -> float:
    """Return the sign by which less of a response is better."""
    return -1.0 if response.better == "larger" else 1.0


@dataclass(frozen=True, eq=False)
class Model:
    """Answers and measurements near the middle of what is known, and of machines drawn from it.

    Attributes:
        question: What shall become sure; its measurements are those below.
        middle: Answers of each load. (K,) [SI]
        slopes: Their derivatives by the scores. (K, p) [SI]
        data_slopes: Derivatives of the numbers of each measurement, in deviations. (n, p)
        drawn: Answers of drawn machines. (N, K) [SI]
        drawn_data: Distances of their numbers from the middle, with errors, in deviations. (N, n)
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
        """Part of the variance of each answer that the linear model explains. (answers,)"""
        linear = self.question.worst(self.middle + self.scores @ self.slopes.T)
        real = self.question.worst(self.drawn)
        return np.asarray(1.0 - np.var(real - linear, axis=0) / np.var(real, axis=0))

    @property
    def is_linear(self) -> bool:
        """Whether the linear model is used."""
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
        return np.linalg.solve(rows @ rows.T + np.eye(len(rows)), both.T).T, both

    def linear(self, chosen: Sequence[int]) -> FloatArray:
        """Return draws of the answers after measurements that come out as expected. (DRAWS, a)"""
        covariance = self.slopes @ self.slopes.T
        if chosen:
            gain, both = self._gain(chosen)
            covariance = covariance - gain @ both.T
        sizes, directions = np.linalg.eigh(covariance)
        root = directions * np.sqrt(np.maximum(sizes, 0.0))
        return self.question.worst(self.middle + self._normal @ root.T)

    def sampled(self, chosen: Sequence[int]) -> FloatArray:
        """Return the answers plus what the linear estimate misses of drawn machines. (N, a)"""
        missed = self.drawn
        if chosen:
            data = np.hstack([self.drawn_data[k] for k in chosen])
            missed = self.drawn - data @ self._gain(chosen)[0].T
        return self.question.worst(missed)

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
    rng = np.random.default_rng(seed)
    scores = rng.standard_normal((samples, size))
    drawn = question.at(scores, "samples")
    kept = np.isfinite(drawn.answers).all(axis=1)
    if kept.mean() < LEAST_USABLE:
        raise input_error(
            f"only {kept.sum()} of {samples} machines drawn from what is known can be run; allowed "
            "are narrower priors or tolerances"
        )
    chosen, slopes, data = list[Measurement](), list[FloatArray](), list[FloatArray]()
    for measurement, numbers, of_drawn in zip(
        question.measurements, near.numbers, drawn.numbers, strict=True
    ):
        deviation = measurement.deviations(numbers[0])
        slope = _slopes(numbers) / deviation[:, None]
        is_known = np.isfinite(slope).all(axis=1) & np.isfinite(of_drawn[kept]).all(axis=0)
        slope = slope[is_known]
        if not np.any(np.abs(slope) > SEEN):
            continue
        distance = ((of_drawn[kept] - numbers[0]) / deviation)[:, is_known]
        chosen.append(measurement)
        slopes.append(slope)
        data.append(distance + rng.standard_normal(distance.shape))
    return Model(
        replace(question, measurements=tuple(chosen)),
        middle,
        _slopes(near.answers),
        tuple(slopes),
        drawn.answers[kept],
        tuple(data),
        scores[kept],
    )


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
    """Return the measurements that a greedy search takes one after the other."""
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
        taken.append(left[int(np.argmin(remaining))])
    return taken


def singles_of(model: Model) -> xr.Dataset:
    """Return what each measurement alone does, the best first.

    Returns:
        Over `candidate`: `words`, `remaining`, the part of the variance that remains, by the linear
        model and by samples too, `cost`, and `gain_per_cost`, the part of the width of the first
        answer that it takes per cost; over `answer` too `half_width` of the interval of 95 %.
    """
    measurements = model.question.measurements
    every = [[k] for k in range(len(measurements))]
    widths = np.array([half_widths(model.after(chosen)) for chosen in every])
    before = half_widths(model.after(()))
    remaining = np.array([model.remaining(chosen) for chosen in every])
    order = np.argsort(remaining, kind="stable")
    costs = np.array([m.cost for m in measurements])
    gain = 1.0 - widths[:, 0] / before[0]
    of_answer = {r.name: quantity_of(r) for r in model.question.answers}
    width = Quantity("± after").of_each("answer", of_answer, ("candidate", "answer"), widths)
    data = xr.Dataset(
        {
            "words": ("candidate", [m.words for m in measurements]),
            "half_width": width,
            "gain": SHARE.named("narrower by").variable("candidate", gain),
            "remaining": SHARE.named("variance that remains").variable("candidate", remaining),
            "cost": COST.variable("candidate", costs),
            "gain_per_cost": SHARE.named("narrower per cost").variable("candidate", gain / costs),
        },
        {"candidate": [m.name for m in measurements], "answer": list(of_answer)},
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
    of_answer = {r.name: quantity_of(r) for r in question.answers}
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
