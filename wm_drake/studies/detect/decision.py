"""Thresholds, their risk and their cost. It is independent of machines.

A load has a score, the larger the worse: the ripple, or the estimated gap with its sign turned. It
spins if the score is at most the threshold; else the laundry is distributed again, so that loads of
washes are those that spin. The risk is therefore the share of touching loads among those that spin.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from wm_drake.parameters.types import FloatArray
from wm_drake.report.formatting import significant
from wm_drake.report.quantity import SHARE, SPEED, Quantity
from wm_drake.studies.tolerance import shares
from wm_drake.studies.tolerance.shares import SampleShare

IN_TABLE = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0)
"""Shares of loads that spin, of the thresholds in the table beside the chosen one."""

LINES = (0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0)
"""Shares of loads up to each line of the table of speed limits."""

share_of = partial(shares.share_of, method="wilson")
"""Return a share with the interval of Wilson. A threshold keeps the risk by its own rule, so its
interval has to hold in 95 of 100 studies, not in 95 at least."""

OF_LOADS = SHARE.named("share", form=lambda value: significant(value, 3 if value >= 10.0 else 2))
DISTRIBUTIONS = Quantity("distributions per wash", decimals=2)
LOADS = Quantity("loads", decimals=0)
MINUTES = Quantity("minutes per wash", decimals=1)


class NoThresholdError(Exception):
    """No threshold reaches the tolerated risk; the text has the best that can be had."""


@dataclass(frozen=True)
class Verdict:
    """What a threshold does with loads.

    Attributes:
        spins: Share of loads that spin at once.
        refused: Share of loads that are refused though they would not touch.
        touches: Share of touching loads among those that spin; None if none spins.
    """

    spins: SampleShare
    refused: SampleShare
    touches: SampleShare | None

    @property
    def distributions(self) -> float:
        """Return the expected number of distributions: each one draws the laundry anew."""
        return 1.0 / self.spins.estimate if self.spins.count else np.inf


def verdict_of(score: FloatArray, touches: NDArray[np.bool_], threshold: float) -> Verdict:
    """Return what a threshold does; a load without a score is refused."""
    spins = score <= threshold
    of_spinning = share_of(touches[spins]) if spins.any() else None
    return Verdict(share_of(spins), share_of(~spins & ~touches), of_spinning)


def threshold_for(score: FloatArray, touches: NDArray[np.bool_], risk: float) -> float:
    """Return the largest threshold whose risk is tolerated.

    Of the n loads with the smallest scores t touch. The next load like them touches with the
    probability (t + 1) / (n + 1) at most, on average over draws (rule of succession; the same bound
    as in conformal risk control), so a threshold needs

        (t + 1) / (n + 1) <= risk

    and lies in the middle between the n-th and the next score.

    Raises:
        NoThresholdError: none does.
    """
    known = np.isfinite(score)
    order = np.argsort(score[known], kind="stable")
    scores, count = score[known][order], np.arange(1, int(known.sum()) + 1)
    bounds = (np.cumsum(touches[known][order]) + 1) / (count + 1)
    reached = np.flatnonzero(bounds <= risk)
    if not len(reached):
        raise NoThresholdError(_best(scores, bounds, touches[known][order]))
    last = int(reached[-1])
    return float(scores[last : last + 2].mean())


def _best(scores: FloatArray, bounds: FloatArray, touches: NDArray[np.bool_]) -> str:
    """Return the best that can be had in words."""
    if not len(scores):
        return "no hold could be measured"
    best = int(np.argmin(bounds))
    count, touching = best + 1, int(touches[: best + 1].sum())
    text = (
        f"at best {SHARE.named('', form='{:.2g}'.format).text(bounds[best])}, where {count} of "
        f"{len(scores)} loads spin and {touching} of them touch"
    )
    return text if touching else f"{text}; with more draws none touching could show less"


def table_of(
    thresholds: FloatArray,
    quantity: Quantity,
    score: FloatArray,
    touches: NDArray[np.bool_],
    retry: float,
) -> xr.Dataset:
    """Return what thresholds do with the loads that judge them.

    Args:
        thresholds: In the sense of the score.
        quantity: Of the score.
        retry: Duration of a distribution. [s]

    Returns:
        Over `threshold`: `spins`, `refused`, `touches` with the ends of their 95 % intervals,
        `_lower` and `_upper`; `distributions` and `minutes` per wash.
    """
    verdicts = [verdict_of(score, touches, value) for value in thresholds]
    heads = {
        "spins": "spin at once",
        "refused": "refused though safe",
        "touches": "touch, of those that spin",
    }
    columns = dict[str, xr.Variable]()
    for name, words in heads.items():
        shares = [getattr(verdict, name) for verdict in verdicts]
        for end, more in (("estimate", words), ("lower", "95 % from"), ("upper", "to")):
            values = [np.nan if s is None else getattr(s, end) for s in shares]
            key = name if end == "estimate" else f"{name}_{end}"
            columns[key] = OF_LOADS.named(more).variable("threshold", values)
    expected = np.array([verdict.distributions for verdict in verdicts])
    columns["distributions"] = DISTRIBUTIONS.variable("threshold", expected)
    columns["minutes"] = MINUTES.variable("threshold", expected * retry / 60.0)
    return xr.Dataset(columns, {"threshold": quantity.variable("threshold", thresholds)})


def speed_limits(
    score: FloatArray, highest: FloatArray, is_fitted: NDArray[np.bool_], quantity: Quantity
) -> xr.Dataset:
    """Return the highest spin speed by score, which never rises with it.

    Args:
        score: Of each load.
        highest: Highest speed up to which each load keeps the clearance, 0 if none. [rad/s]
        is_fitted: Loads that make the table; the others judge it.
        quantity: Of the score.

    Returns:
        Over `line`: `up_to`, largest score of the line; `limit`, the lowest `highest` of its loads
        and of those with smaller scores [rad/s]; number of `loads` that judge it, and the share of
        them that `touches` below the limit, with `touches_lower` and `touches_upper`.
    """
    known = np.isfinite(score)
    edges = np.unique(np.quantile(score[known & is_fitted], LINES))
    line = np.searchsorted(edges, score)
    made, judge = known & is_fitted, known & ~is_fitted
    lowest = [highest[made & (line == k)].min(initial=np.inf) for k in range(len(edges))]
    limit = np.minimum.accumulate(lowest)
    judged = [highest[judge & (line == k)] < limit[k] for k in range(len(edges))]
    shares = [share_of(each) if len(each) else None for each in judged]
    ends = {"touches": "estimate", "touches_lower": "lower", "touches_upper": "upper"}
    heads = {"touches": "touch below it", "touches_lower": "95 % from", "touches_upper": "to"}
    columns = {
        name: OF_LOADS.named(heads[name]).variable(
            "line", [np.nan if s is None else getattr(s, end) for s in shares]
        )
        for name, end in ends.items()
    }
    return xr.Dataset(
        {
            "up_to": quantity.named(f"{quantity.words} up to").variable("line", edges),
            "limit": SPEED.named("highest speed").variable("line", limit),
            "loads": LOADS.variable("line", [len(each) for each in judged]),
            **columns,
        }
    )
