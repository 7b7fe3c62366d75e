"""Propose one change of a machine: the rule that the studies share, and what its runs confirm.

Candidates are whatever a study can change: factors of the gasket, variables of a design, any number
of a part. Of each response the worst load counts. The rule:

1. A candidate may raise no response by more than its limit, `MOST_LOSS` of that of the machine
   unless the study says otherwise.
2. The aim is the largest smallest gap. Without a gap among the responses it is the largest
   desirability (Derringer and Suich): the geometric mean over the responses of a number from 0 at
   the worst to 1 at the best value that any run had.
3. The best candidate must gain `LEAST_GAIN` of the range of the aim. Of those that keep all but
   `SMALL_SHARE` of its gain, the one with the fewest changes, or the least effort, is proposed.
4. It is proposed only if runs confirm it (`is_confirmed`): models may choose, and runs decide.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.parameters.types import FloatArray
from wm_drake.report.formatting import three_digits
from wm_drake.report.quantity import CHANGE, Quantity
from wm_drake.simulation.measures.kind import Better
from wm_drake.simulation.measures.responses import GAP

MOST_LOSS = 0.1
"""Largest rise of a response above that of the machine, as a share of it. Choice of the project."""

SMALL_SHARE = 0.1
"""Share of the gain that a change must have to be made. Choice of the project."""

LEAST_GAIN = 0.02
"""Gain of the aim, as a share of its range over the runs, from which a candidate is proposed.
Choice of the project."""

SIGNS: Mapping[Better, float] = {"smaller": 1.0, "larger": -1.0, "": 1.0}
"""Sign of a response with which less is better, by which change is an improvement; of one without
such a change, more is called worse."""


def worst_of(values: FloatArray, goals: Mapping[str, Better]) -> FloatArray:
    """Return each response of its worst load; NaN if a run failed. (..., responses)

    Args:
        values: Responses of the runs. (..., loads, responses)
        goals: Which change of each response is an improvement.
    """
    signs = np.array([SIGNS[goal] for goal in goals.values()])
    return np.asarray(signs * (signs * values).max(axis=-2))


@dataclass(frozen=True)
class Aim:
    """What a proposed candidate shall reach.

    Attributes:
        goals: Which change of each response is an improvement, by the names of those that have one.
        runs: Responses of the runs that give the ranges; NaN of a failed run. (n, responses)
        machine: Responses of the machine as it is, each of the worst load. (responses,)
        limits: Largest rise of each response, a share of that of the machine; infinite without one.
            (responses,), or one number for all.
    """

    goals: Mapping[str, Better]
    runs: FloatArray
    machine: FloatArray
    limits: FloatArray | float = MOST_LOSS

    @cached_property
    def _signs(self) -> FloatArray:
        return np.array([SIGNS[goal] for goal in self.goals.values()])

    @cached_property
    def _ends(self) -> FloatArray:
        """Best and worst value of each response over the runs, signed so that less is better."""
        signed = self._signs * self.runs
        best = np.fmin.reduce(signed, axis=0, initial=np.inf)
        return np.array([best, np.fmax.reduce(signed, axis=0, initial=-np.inf)])

    @cached_property
    def _varies(self) -> np.ndarray:
        """Whether each response varies."""
        return np.asarray(self._ends[1] > self._ends[0])

    @cached_property
    def _gap(self) -> int | None:
        """Place of the gap among the responses that vary; None without it."""
        names = [name for name, varies in zip(self.goals, self._varies, strict=True) if varies]
        return names.index(GAP) if GAP in names else None

    @property
    def can_choose(self) -> bool:
        """Whether a response varies, and those of the machine are known."""
        return bool(self._varies.any() and np.isfinite(self.machine[self._varies]).all())

    def value(self, values: FloatArray) -> FloatArray:
        """Return how good candidates are: 0 to about 1, below 0 with a loss elsewhere. (n,)

        A candidate with a failed run has minus infinity.

        Args:
            values: Responses of the candidates, each of the worst load. (n, responses)
        """
        excess = (self.rises(values) - self.limits)[..., self._varies].max(axis=1)
        value = np.where(excess > 1e-9, -1.0 - excess, self.reached(values))
        return np.nan_to_num(value, nan=-np.inf)

    def rises(self, values: FloatArray) -> FloatArray:
        """Return by how much responses are worse than those of the machine. (n, responses) [1]"""
        rise = self._signs * (values - self.machine)
        return np.asarray(rise / np.maximum(np.abs(self.machine), 1e-12))

    def reached(self, values: FloatArray) -> FloatArray:
        """Return how far candidates reach the aim, whatever they lose: 0 to about 1. (n,)"""
        signed, (best, worst) = self._signs * values, self._ends[:, self._varies]
        parts = (worst - signed[:, self._varies]) / (worst - best)
        if self._gap is not None:
            return np.asarray(parts[:, self._gap])
        return np.asarray(np.exp(np.mean(np.log(np.clip(parts, 1e-6, 1.0)), axis=1)))

    def gain(self, values: FloatArray) -> FloatArray:
        """Return by how much candidates are better than the machine. (n,)"""
        return self.value(values) - self.value(self.machine[None])

    def proposed(self, values: FloatArray, changes: Sequence[float]) -> int | None:
        """Return the number of the proposed candidate; None if none is clearly better.

        Args:
            values: Responses of the candidates, as of `value`.
            changes: How many numbers or factors each changes, or its effort.
        """
        if not self.can_choose or not len(values):
            return None
        gains = self.gain(values)
        most = float(gains.max())
        if not most >= LEAST_GAIN:
            return None
        good = np.flatnonzero(gains >= (1.0 - SMALL_SHARE) * most).tolist()
        return int(min(good, key=lambda number: (changes[number], -gains[number])))


BEFORE, AFTER = "before", "after"
"""Labels of runs of the machine as it is, and with the proposed change."""


def compared(values: xr.DataArray, goals: Mapping[str, Better]) -> xr.Dataset:
    """Return each response that has a goal before and after a change, of its worst load.

    Args:
        values: Runs over `setting`, `BEFORE` and perhaps `AFTER`, `response`, and `load` if there
            are loads.
        goals: As of `aim_of`.

    Returns:
        Over `response`: `before`, `after`, `change`, a share of the size before, and `loss`, the
        same for the worse; `load_before` and `load_after` if there are loads.
    """
    values, responses = values.sel(response=list(goals)), xr.Dataset()
    signs = xr.DataArray([SIGNS[goal] for goal in goals.values()], dims="response")
    if "load" in values.dims:
        # a failed run is the worst
        values = values.isel(load=(signs * values).fillna(np.inf).argmax("load"))
    for setting in values.setting.values.tolist():
        one = values.sel(setting=setting, drop=True)
        quantity = Quantity(f"{setting}, by a run", form=three_digits)
        responses[setting] = quantity.on(one.drop_vars("load", errors="ignore"))
        if "load" in one.coords:
            responses[f"load_{setting}"] = ("response", one["load"].values)
    if AFTER in responses:
        change = (responses[AFTER] - responses[BEFORE]) / np.abs(responses[BEFORE])
        responses["change"] = CHANGE.variable("response", change)
        responses["loss"] = CHANGE.named("loss").hidden("response", signs * change)
    return responses


def command_text(begin: str, options: Any, *more: str) -> str:
    """Return a command line with the changes of the machine and the profile of some options.

    Args:
        begin: What it begins with.
        options: Options of a study of runs.
        more: More options, before the profile.
    """
    sets = [f'--set "{text}"' for text in options.sets]
    profile = [f"--profile {options.profile}"] if options.profile else []
    return " ".join([begin, *sets, *more, *profile])


def is_confirmed(aim: Aim, runs: xr.Dataset) -> bool:
    """Return whether runs reach the aim better with a change than without it.

    Args:
        runs: As of `compared`.
    """
    if AFTER not in runs:
        return False
    before, after = (
        runs[setting].sel(response=list(aim.goals)).values for setting in (BEFORE, AFTER)
    )
    return bool(aim.reached(after[None])[0] > aim.reached(before[None])[0])


def proposal_of(
    runs: xr.Dataset, changes: Sequence[tuple[str, str, str]], *, is_confirmed: bool, command: str
) -> xr.Dataset:
    """Return a proposal.

    Args:
        runs: As of `compared`.
        changes: Of each change: name in words, new value in words, keys of the machine; none if
            nothing is proposed.
        is_confirmed: Whether the runs confirm it.
        command: Command that runs the machine with it; "" if there is none.

    Returns:
        The variables of `runs`; over `changed`, names in words: `value` and `keys`; `is_confirmed`
        and `line_to_copy`.
    """
    names, values, keys = zip(*changes, strict=True) if changes else ((), (), ())
    texts = {"value": values, "keys": keys}
    of_changes = {name: ("changed", np.array(t, dtype=object)) for name, t in texts.items()}
    line = command if is_confirmed else ""
    numbers = {"is_confirmed": is_confirmed, "line_to_copy": line}
    return runs.assign({**of_changes, **numbers}).assign_coords(
        changed=np.array(names, dtype=object)
    )
