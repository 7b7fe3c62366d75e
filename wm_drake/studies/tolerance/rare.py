"""Subset simulation: small probabilities of failure from few evaluations.

It is independent of machines: the limit-state function takes standard normal scores and is at most
0 where the system fails.

Source: S.-K. Au, J. L. Beck, Estimation of small failure probabilities in high dimensions by subset
simulation, Probabilistic Engineering Mechanics 16 (2001) 263; the moves of the chains are those of
I. Papaioannou et al., MCMC algorithms for subset simulation, same journal 41 (2015) 89: conditional
sampling with a step that adapts to an acceptance of 0.44.
"""

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import stats

from wm_drake.parameters.types import FloatArray
from wm_drake.studies.tolerance.shares import CONFIDENCE, bound_if_none

LEVEL = 0.1
"""Conditional probability of each level."""

MOST_LEVELS = 7
"""Largest number of levels; a probability below about 1e-7 is not followed."""

ACCEPTANCE = 0.44
"""Share of accepted moves to which the step adapts."""

NEIGHBOURS = 0.3
"""Correlation of the errors of neighbouring levels, whose samples share their seeds.

Measured on linear limit states (probabilities 6e-3 to 3e-6): without it, 95 % intervals contain the
exact probability in 91 % to 93 % of the cases.
"""


@dataclass(frozen=True)
class RareEvent:
    """A small probability.

    Attributes:
        probability: Estimate; 0 if no level reached the failure.
        lower, upper: Ends of the 95 % interval. If no level reached the failure, upper is the bound
            of the rule of three for the first level: only its samples are independent.
        deviation: Coefficient of variation of the estimate; infinite if it is 0.
        thresholds: Values of the limit-state function that separate the levels.
        evaluations: Number of evaluations of the limit-state function.
        failures: Scores of the samples of the last level that fail. (n, d)
        smallest: Smallest value of the limit-state function in the last level.
    """

    probability: float
    lower: float
    upper: float
    deviation: float
    thresholds: tuple[float, ...]
    evaluations: int
    failures: FloatArray
    smallest: float


def subset_simulation(
    limit: Callable[[FloatArray], FloatArray], size: int, *, samples: int = 1000, seed: int = 0
) -> RareEvent:
    """Return the probability that a limit-state function of normal scores is at most 0.

    Args:
        limit: Function of scores (n, size) with n values. NaN counts as failure.
        size: Number of independent standard normal scores.
        samples: Samples of each level, a multiple of 10 and at least 100.
    """
    random = np.random.default_rng(seed)
    chains, length = round(LEVEL * samples), round(1.0 / LEVEL)
    scores = random.standard_normal((samples, size))
    values = _evaluated(limit, scores)
    # the first level has independent samples: chains of length one
    history, probability, errors = values[None, :], 1.0, list[float]()
    thresholds: list[float] = []
    step = 0.6
    for level in range(1, MOST_LEVELS + 1):
        order = np.argsort(values, kind="stable")
        threshold = float(values[order[chains - 1]])
        if threshold <= 0.0 or level == MOST_LEVELS:
            break
        thresholds.append(threshold)
        probability *= LEVEL
        errors.append(_deviation((history <= threshold).astype(float)))
        scores, history, step = _conditional(
            limit, scores[order[:chains]], values[order[:chains]], threshold, length, step, random
        )
        values = history.ravel()
    evaluations = samples + len(thresholds) * (samples - chains)
    failed = values <= 0.0
    share, smallest = float(np.mean(failed)), float(np.min(values))
    seeds = scores[failed]
    if share == 0.0:
        ends = 0.0, bound_if_none(samples)
        return RareEvent(0.0, *ends, math.inf, tuple(thresholds), evaluations, seeds, smallest)
    errors.append(_deviation((history <= 0.0).astype(float)))
    variance = sum(error * error for error in errors)
    variance += 2.0 * NEIGHBOURS * sum(map(operator.mul, errors, errors[1:]))
    estimate, deviation = probability * share, math.sqrt(variance)
    # the estimate is a product, so its logarithm is about normal
    width = float(stats.norm.ppf(0.5 + 0.5 * CONFIDENCE)) * math.sqrt(math.log1p(variance))
    ends = estimate * math.exp(-width), min(1.0, estimate * math.exp(width))
    return RareEvent(estimate, *ends, deviation, tuple(thresholds), evaluations, seeds, smallest)


def _evaluated(limit: Callable[[FloatArray], FloatArray], scores: FloatArray) -> FloatArray:
    values = np.asarray(limit(scores), dtype=float)
    return np.where(np.isnan(values), -np.inf, values)


def _conditional(
    limit: Callable[[FloatArray], FloatArray],
    seeds: FloatArray,
    values: FloatArray,
    threshold: float,
    length: int,
    step: float,
    random: np.random.Generator,
) -> tuple[FloatArray, FloatArray, float]:
    """Return samples of the scores under the condition that the limit is at most a threshold.

    All chains move side by side. A candidate sqrt(1 - s^2) z + s e with a standard normal e has the
    distribution of z without the condition, so it is accepted if it meets the condition.

    Args:
        limit: Limit-state function.
        seeds: First sample of each chain. (chains, size)
        values: Its limit-state function. (chains,)
        threshold: Largest allowed value.
        length: Samples of each chain.
        step: First s.

    Returns:
        Scores (length * chains, size), their limits (length, chains), and the last s.
    """
    states, limits = [seeds], [values]
    for move in range(1, length):
        candidate = math.sqrt(1.0 - step * step) * states[-1] + step * random.standard_normal(
            seeds.shape
        )
        value = _evaluated(limit, candidate)
        accepted = value <= threshold
        states.append(np.where(accepted[:, None], candidate, states[-1]))
        limits.append(np.where(accepted, value, limits[-1]))
        change = (float(np.mean(accepted)) - ACCEPTANCE) / math.sqrt(move)
        step = min(1.0, max(0.05, step * math.exp(change)))
    return np.concatenate(states), np.stack(limits), step


def _deviation(indicator: FloatArray) -> float:
    """Return the coefficient of variation of the mean of correlated indicators.

    Samples of one chain are correlated, those of different chains are not ([Au 2001] Eq. (28)).

    Args:
        indicator: 1 for each sample that fails, else 0. (length of the chains, chains)
    """
    length, chains = indicator.shape
    share = float(np.mean(indicator))
    if share in (0.0, 1.0):
        return 0.0
    centred = indicator - share
    spread = share * (1.0 - share)
    gamma = 0.0
    for lag in range(1, length):
        correlation = float(np.mean(centred[lag:] * centred[:-lag])) / spread
        gamma += 2.0 * (1.0 - lag / length) * correlation
    return math.sqrt((1.0 - share) / (share * length * chains) * max(1.0, 1.0 + gamma))
