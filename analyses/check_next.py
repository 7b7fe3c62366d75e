"""Does a measurement narrow an answer as `wm-drake study next` predicts, with real refits?

The script ranks measurements by the study. For the first five and each seed it draws a machine from
what is known, makes up the measurement with its errors, and fits the quantities to it by least
squares with real runs, as a calibration does. The interval of the smallest gap then comes from runs
of machines drawn from the posterior (Laplace). It prints the predicted and the achieved half width
of this interval of 95 %, and how often it holds the gap of the planted machine.

    python analyses/check_next.py
"""

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import norm

from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.experiment import run_here
from wm_drake.studies.fitting.assessment import assess
from wm_drake.studies.fitting.problem import KINKED, FitProblem, Measurement, Unknown
from wm_drake.studies.fitting.search import Search, descended
from wm_drake.studies.next.options import NextOptions
from wm_drake.studies.next.question import Question
from wm_drake.studies.next.study import Model, half_widths, model_of, singles_of
from wm_drake.studies.next.task import NextTask, question_of
from wm_drake.studies.tolerance.shares import share_of

FIRST = 5
"""Number of measurements that are checked, the first ones of the ranking."""

FARTHEST = 4.0
"""Bound of the scores of a fit, in deviations of what is known."""

DRAWS = 32
"""TriedMachines drawn from a posterior, whose gaps give mean and deviation."""

ITERATIONS = 8


@dataclass(frozen=True)
class Here:
    """Runs on this computer, in place of the executor of a command."""

    simulate = staticmethod(run_here)


def main() -> None:
    """Rank, refit, and print what was predicted and what was achieved."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one measurement and one seed")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--machine", default="reference")
    parser.add_argument("--vary", default="laundry_and_parts")
    parser.add_argument("--out", type=Path, help="also write the result to this file")
    given = parser.parse_args()
    seeds, count = (1, 1) if given.quick else (given.seeds, FIRST)
    model = _model(given.machine, given.vary, 32 if given.quick else 256)
    names = singles_of(model)["name"].values.tolist()[:count]
    known = [m.name for m in model.question.measurements]
    before = half_widths(model.after(()))[0]
    lines = [
        "| measurement | predicted, mm | achieved, mm | intervals that hold the gap |",
        "|---|---|---|---|",
        f"| none | {1e3 * before:.2f} | | |",
    ]
    held = list[bool]()
    for name in names:
        place = known.index(name)
        results = [_refitted(model, place, seed) for seed in range(seeds)]
        widths, hits = np.array(results).T
        held += (hits > 0.0).tolist()
        predicted = half_widths(model.after([place]))[0]
        words = model.question.measurements[place].words
        lines.append(
            f"| {words} | {1e3 * predicted:.2f} | {1e3 * widths.mean():.2f} "
            f"({1e3 * widths.min():.2f} to {1e3 * widths.max():.2f}) | "
            f"{int(hits.sum())} of {seeds} |"
        )
        print(lines[-1], file=sys.stderr)
    share = share_of(np.array(held))
    lines.append("")
    lines.append(
        f"All: {share.count} of {share.samples} intervals of 95 % hold the gap of the "
        f"planted machine; probability {100 * share.lower:.0f} to {100 * share.upper:.0f} %."
    )
    text = "\n".join(lines)
    print(text)
    if given.out:
        given.out.write_text(text + "\n", encoding="utf-8")


def _model(machine: str, vary: str, samples: int) -> Model:
    """Return the model of the study."""
    options = NextOptions(machine=machine, vary=vary)
    task = NextTask(options, build_machine(load_machine(machine)))
    question = question_of(Here(), task.knowledge, task.measurements, task.answers, task.cases)
    return model_of(question, samples, options.seed)


def _refitted(model: Model, place: int, seed: int) -> tuple[float, bool]:
    """Return half the width of the interval after a refit, and whether it holds the truth."""
    question, measurement = model.question, model.question.measurements[place]
    of_data = _part(question, place)
    of_answer = replace(question, measurements=(), experiments={True: question.experiments[True]})
    size = len(question.knowledge.names)
    rng = np.random.default_rng([seed, place])
    truth = rng.standard_normal((1, size))
    exact, middle = of_data.at(np.vstack([truth, 0.0 * truth]), "truth").numbers[0]
    deviation = measurement.deviations(middle)
    data = exact + deviation * rng.standard_normal(len(exact))

    def evaluate(points: FloatArray) -> FloatArray:
        return np.asarray(of_data.at(points, "fit").numbers[0] / deviation)

    unknowns = tuple(
        Unknown(name, -FARTHEST, FARTHEST, prior=(0.0, 1.0)) for name in question.knowledge.names
    )
    measured = Measurement(measurement.name, data / deviation, errors="known")
    problem = FitProblem(unknowns, (measured,), evaluate, KINKED)
    search = Search(problem)
    end = descended(search, np.zeros(size), ITERATIONS)
    fit = assess(problem, end.point, search.log("least squares", seed))
    drawn = rng.multivariate_normal(fit.values, fit.covariance, DRAWS)
    gaps = question.worst(of_answer.at(np.vstack([truth, drawn]), "gaps").answers)[:, 0]
    half = norm.ppf(0.975) * float(np.nanstd(gaps[1:], ddof=1))
    return half, bool(abs(gaps[0] - np.nanmean(gaps[1:])) <= half)


def _part(question: Question, place: int) -> Question:
    """Return a question of one measurement and no answer, with its run only."""
    measurement = question.measurements[place]
    experiments = {}
    if measurement.run is not None:
        load, gasket = measurement.run
        experiment = question.experiments[gasket]
        cases = tuple(case for case in experiment.loads if case.name == load)
        experiments = {gasket: replace(experiment, measures=("amplitudes",), loads=cases)}
    return replace(question, measurements=(measurement,), answers=(), experiments=experiments)


if __name__ == "__main__":
    main()
