"""Check of a robust front: what its designs promised, on samples that the search never saw."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from wm_drake.parameters.tolerances import fraction
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.pareto.problem import Goal, Run
from wm_drake.studies.pareto.study import ParetoFront
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studies.tolerance.shares import CONFIDENCE, Percentile, percentile_of

FRESH = 4
"""Fresh samples for each sample of the search."""

OTHER_SEED = 1_000_003
"""Added to the seed of the search for the fresh samples."""


@dataclass(frozen=True)
class Promise:
    """One goal of a chosen design, as the search saw it and on fresh samples.

    Attributes:
        promised: Its value over the samples of the search, with the 95 % interval. [unit for
            reading]
        fresh: The same over fresh samples.
        is_kept: Whether the fresh value is not worse than the worse end of the promised interval;
            None for the worst of the samples, which grows with their number and has no interval.
    """

    design: str
    goal: Goal
    promised: Percentile
    fresh: Percentile
    is_kept: bool | None


def promises(front: ParetoFront, run: Run, seed: int) -> list[Promise]:
    """Return the promises of the chosen designs of a robust front; none of a nominal one."""
    designs, scores = front.designs, front.designs.scores
    if scores is None or not front.chosen:
        return []
    numbers = sorted(set(front.chosen.values()))
    points = front.search.designs[numbers]
    count, size = scores.shape
    fresh, _ = base_samples(size, FRESH * count, seed + OTHER_SEED)
    before = designs.scenario_values(points, run)
    after = designs.with_scores(fresh).scenario_values(points, run)
    promises = []
    for name, number in front.chosen.items():
        row = numbers.index(number)
        for goal, old, new in zip(designs.goals, before, after, strict=True):
            if goal.response is not None:
                promised, kept = summary_of(goal, old[row]), summary_of(goal, new[row])
                promises.append(Promise(name, goal, promised, kept, _is_kept(goal, promised, kept)))
    return promises


def _is_kept(goal: Goal, promised: Percentile, fresh: Percentile) -> bool | None:
    if goal.given.over == "worst":
        return None
    if goal.is_small_better:
        return bool(fresh.value <= promised.upper)
    return bool(fresh.value >= promised.lower)


def summary_of(goal: Goal, values: FloatArray) -> Percentile:
    """Return the value of a goal over samples of one design, with its 95 % interval.

    A run that failed has NaN, and so has then the value.

    Args:
        values: By sample. (n,) [unit for reading]
    """
    how = goal.given.over
    value = float(goal.over(values[None])[0])
    if not np.isfinite(values).all() or how == "worst":
        return Percentile(value, np.nan, np.nan)
    if how == "mean":
        quantile = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, len(values) - 1))
        width = quantile * float(np.std(values, ddof=1)) / np.sqrt(len(values))
        return Percentile(value, value - width, value + width)
    share = fraction(how, "over")
    estimate = percentile_of(values, 100.0 * (share if goal.is_small_better else 1.0 - share))
    return Percentile(value, estimate.lower, estimate.upper)
