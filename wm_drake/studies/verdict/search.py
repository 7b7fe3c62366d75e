"""Search the change that a verdict proposes, in real runs.

Changes of one number are combined one after the other, as long as that helps; of those beyond a
limit, parts are tried too. The rule of `wm_drake.studies.proposal` chooses among them.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import CHANGE
from wm_drake.simulation.measures.responses import GAP, Response
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.proposal import Aim, worst_of
from wm_drake.studies.verdict.study import ChangedRuns, ratio_of, smallest, text_of, values_of

MOST_TRIED = 10
"""Number of single changes, the best ones, that a combination may contain."""

SMALLER = (0.5, 0.25)
"""Parts of the change that are tried too of these: a limit may allow less of a change only."""

SCALES = np.arange(0.1, 0.95, 0.1)
"""Parts of a change beyond a limit that are tried too."""

MOST_SCALED = 3
"""Number of changes beyond a limit, the best ones, of which parts are tried."""


@dataclass(frozen=True)
class ProposalSearch:
    """What a proposal is searched with.

    Attributes:
        experiment: Runs of the machine with all loads.
        aim: As of `aim_of`.
        chosen: Responses.
        efforts: Effort of the change of each number by its key path.
        most_effort: Largest effort of a proposal, the sum of its changes.
    """

    experiment: Experiment
    aim: Aim
    chosen: Sequence[Response]
    efforts: Mapping[str, float]
    most_effort: float

    def effort(self, changes: Iterable[str]) -> float:
        """Return the effort of changes of some key paths."""
        return sum(map(self.efforts.__getitem__, changes))

    def is_too_hard(self, changes: Iterable[str]) -> bool:
        """Return whether the effort of changes is too large, but for rounding."""
        return self.effort(changes) > self.most_effort * (1.0 + 1e-9)

    def runs_of(self, every: Iterable[Mapping[str, str]], what: str) -> list[ChangedRuns]:
        """Run changes that the machine and its step allow."""
        named = {"; ".join(f"{k}={t}" for k, t in each.items()): each for each in every}
        machines = self.experiment.allowed(named)
        if not machines:
            return []
        data = self.experiment.at(list(machines), machines.values(), what)
        return [ChangedRuns(data.sel(point=name), named[name]) for name in machines]

    def worst(self, every: Iterable[ChangedRuns]) -> FloatArray:
        """Return the responses of changes, each of its worst load. (n, responses)"""
        goals = self.aim.goals
        return np.array([worst_of(values_of(one.runs, self.chosen), goals) for one in every])

    def text(self, key: str, factor: float) -> str:
        """Return a multiple of a number of the machine as text."""
        return text_of(self.experiment.machine.parameters, key, factor)

    def scaled(self, changes: Mapping[str, str], part: float) -> dict[str, str]:
        """Return a part of changes."""
        machine = self.experiment.machine.parameters
        ratios = {key: ratio_of(machine, key, text) for key, text in changes.items()}
        return {key: self.text(key, 1.0 + part * (ratio - 1.0)) for key, ratio in ratios.items()}


def proposed(search: ProposalSearch, tried: xr.Dataset) -> ChangedRuns | None:
    """Return the proposed change, as of `wm_drake.studies.proposal`.

    The candidates are the single changes, the strongest ones also smaller, the best one with the
    best additions to it, and parts of those that would be better without a limit.

    Args:
        search: What it is searched with.
        tried: As of `influences`.

    Returns:
        None if no change is clearly better.
    """
    single = _singles(search, tried) if search.aim.can_choose else []
    if not single:
        return None
    candidates = [*single, *_combined(search, single)]
    candidates += _within_limits(search, candidates)
    efforts = [search.effort(one.changes) for one in candidates]
    number = search.aim.proposed(search.worst(candidates), efforts)
    return None if number is None else candidates[number]


def _singles(search: ProposalSearch, tried: xr.Dataset) -> list[ChangedRuns]:
    """Return the changes of one number that reach most, each as large as is best, best first."""
    aim, keys = search.aim, tried["key"].values.tolist()
    worst = worst_of(values_of(tried, search.chosen), aim.goals)
    reached = np.nan_to_num(
        aim.reached(worst.reshape(-1, len(aim.goals))).reshape(worst.shape[:2]), nan=-np.inf
    )
    ranked = np.argsort(-reached.max(axis=1, initial=-np.inf), kind="stable").tolist()
    ranked = [k for k in ranked if not search.is_too_hard([keys[k]])][:MOST_TRIED]
    sides = {k: int(reached[k].argmax()) for k in ranked if np.isfinite(reached[k]).any()}
    ones = [tried.isel(key=k, side=side) for k, side in sides.items()]
    every = [ChangedRuns(one, {one["key"].item(): one.text.item()}) for one in ones]
    smaller = [search.scaled(one.changes, part) for one in every for part in SMALLER]
    every += search.runs_of(smaller, "smaller changes")
    best: dict[str, ChangedRuns] = {}
    for number in np.argsort(-aim.value(search.worst(every)), kind="stable") if every else ():
        best.setdefault("".join(every[number].changes), every[number])
    return list(best.values())


def _combined(search: ProposalSearch, singles: Sequence[ChangedRuns]) -> list[ChangedRuns]:
    """Return the best single change with each addition, then of the best pair, ...

    They end where no addition is better, or its effort is too large.

    Args:
        search: What they are searched with.
        singles: Single changes, the best one first.
    """
    best, combined = singles[0], list[ChangedRuns]()
    useful = {key: text for one in singles for key, text in one.changes.items()}
    while True:
        made = best.changes
        more = [{**made, key: text} for key, text in useful.items() if key not in made]
        allowed = [each for each in more if not search.is_too_hard(each)]
        added = search.runs_of(allowed, "combinations")
        if not added:
            return combined
        combined += added
        first, *others = search.aim.value(search.worst([best, *added])).tolist()
        if max(others) <= first:
            return combined
        best = added[int(np.argmax(others))]


def _within_limits(search: ProposalSearch, candidates: Sequence[ChangedRuns]) -> list[ChangedRuns]:
    """Return parts of the candidates beyond a limit that reach more than those within it."""
    worst = search.worst(candidates)
    value, reached = search.aim.value(worst), search.aim.reached(worst)
    is_better = (value < 0.0) & (reached > value.max())
    best = [k for k in np.argsort(-reached, kind="stable").tolist() if is_better[k]][:MOST_SCALED]
    parts = [search.scaled(candidates[k].changes, part) for k in best for part in SCALES]
    return search.runs_of(parts, "changes within the limits")


def reasons(search: ProposalSearch, tried: xr.Dataset, changed: ChangedRuns | None) -> list[str]:
    """Return why the better side of each change that was tried is not proposed; "" if it is."""
    aim, chosen = search.aim, search.chosen
    worst = worst_of(values_of(tried, chosen), aim.goals)
    gaps, machine = smallest(tried).values, aim.machine[list(aim.goals).index(GAP)]
    made = {} if changed is None else changed.changes
    texts = []
    for k, key in enumerate(tried["key"].values.tolist()):
        side = int(np.nan_to_num(gaps[k], nan=-np.inf).argmax())
        rise = aim.rises(worst[k])[side]
        beyond = int(np.argmax(rise - aim.limits))
        if key in made:
            texts.append("")
        elif tried.is_refused[k].all():
            texts.append("the machine or its step size does not allow it")
        elif not np.isfinite(rise).all():
            texts.append("a run fails")
        elif gaps[k, side] <= machine:
            texts.append("the gap does not grow")
        elif search.is_too_hard([key]):
            texts.append(f"its effort, {search.efforts[key]:g}, is above {search.most_effort:g}")
        elif rise[beyond] > np.broadcast_to(aim.limits, rise.shape)[beyond]:
            amount = CHANGE.text(rise[beyond])
            texts.append(f"{chosen[beyond].title} ({chosen[beyond].name}) changes by {amount}")
        else:
            texts.append("gains less" if made else "gains too little")
    return texts
