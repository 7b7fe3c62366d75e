"""Judge a machine by all its loads and random laundry, and try changes of its parts in real runs.

Nothing is interpolated: each gap that the result names is that of a run. Changes are tried one at a
time, more and less; the best ones are then combined one after the other, as long as that helps.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from wm_drake.engines.compiled.step_check import check_step
from wm_drake.errors import InputError
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, with_values
from wm_drake.parameters.elements import Table
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.parameters.variation import value_at
from wm_drake.simulation.cases import Case, load_of
from wm_drake.simulation.steps import checked_step
from wm_drake.studies.executor import Executor
from wm_drake.studies.tolerance.shares import bound_if_none, share_of

MM = Unit("m", "mm")

PARTS = ("spring_types", "damper_types", "bushing_types", "gasket")
"""Tables of the parts that a designer can exchange."""

PHYSICAL = ("N/m", "N*s/m", "N", "N*m/rad", "N*m*s/rad", "N*m")
"""SI units of stiffness, damping and friction; other numbers, such as the velocity at which
friction is full, belong to a law and not to a part."""

MOST_COMBINED = 3
"""Largest number of changes in a combination: more are hard to make."""

MOST_TRIED = 10
"""Number of single changes, the best ones, that a combination may contain."""

LEAST_GAIN = 1e-4
"""Gain of the gap below which a change is not added. [m] Assumption: less cannot be measured."""


@dataclass(frozen=True)
class Outcome:
    """What the runs of all loads with one machine gave.

    Attributes:
        changes: Values as text by key path; empty for the machine as it is.
        table: Runs of the loads, in the order of the loads.
    """

    changes: Mapping[str, str]
    table: xr.Dataset

    @property
    def gaps(self) -> FloatArray:
        """Return the smallest gap of each load; minus infinity for a run that failed. [m]"""
        failed = self.table.diverged.values != ""
        return np.where(failed, -np.inf, self.table.smallest_gap.values)

    @property
    def gap(self) -> float:
        """Return the smallest gap of all loads. [m]"""
        return float(self.gaps.min())

    def place(self, index: int) -> tuple[str, float]:
        """Return the pair of shapes of the smallest gap of a load, and the speed there. [rad/s]"""
        pair = float(self.table.nearest_pair.values[index])
        name = str(self.table.pair.values[int(pair)]) if np.isfinite(pair) else ""
        return name, float(self.table.gap_speed.values[index])


@dataclass(frozen=True)
class Influence:
    """What one number of a part does to the smallest gap of all loads.

    Attributes:
        key: Key path.
        less, more: Runs with less and with more of it.
    """

    key: str
    less: Outcome
    more: Outcome

    @property
    def span(self) -> float:
        """Return by how much the gap differs between more and less. [m]"""
        return abs(self.more.gap - self.less.gap) if np.isfinite(self._ends).all() else np.inf

    @property
    def best(self) -> Outcome:
        """Return the better of the two."""
        return max(self.less, self.more, key=lambda outcome: outcome.gap)

    @property
    def _ends(self) -> tuple[float, float]:
        return self.more.gap, self.less.gap


@dataclass(frozen=True)
class Laundry:
    """Smallest gaps of samples of the laundry.

    Attributes:
        gaps: (n,) [m], minus infinity for a run that failed.
        clearance: Gap that must remain. [m]
    """

    gaps: FloatArray
    clearance: float

    @property
    def probability(self) -> tuple[float, float, float]:
        """Return the share of samples with too small a gap, and the ends of its 95 % interval."""
        share = share_of(self.gaps <= self.clearance)
        upper = share.upper if share.count else bound_if_none(share.samples)
        return share.estimate, share.lower, upper


@dataclass(frozen=True)
class Trials:
    """Runs of all loads with changed machines."""

    machine: Machine
    cases: Sequence[Case]
    measures: tuple[str, ...]
    executor: Executor

    def outcomes(self, changes: Iterable[Mapping[str, str]], what: str) -> list[Outcome]:
        """Return the outcome of each set of changes that the machine and its step allow."""
        usable = [(c, p) for c in changes if (p := self._changed(c)) is not None]
        cases = [
            Case(
                f"machine {number}, {case.name}",
                load_of(case, self.machine.parameters, parameters),
                case.profile,
                parameters=parameters,
            )
            for number, (_, parameters) in enumerate(usable)
            for case in self.cases
        ]
        if not cases:
            return []
        table, size = (
            self.executor.simulate(self.machine, self.measures, cases, what),
            len(self.cases),
        )
        return [
            Outcome(c, table.isel(run=slice(n * size, (n + 1) * size)))
            for n, (c, _) in enumerate(usable)
        ]

    def influences(self, keys: Iterable[str], change: float) -> list[Influence]:
        """Return the influence of each number, the strongest first."""
        pairs = [
            [{key: _text(self.machine.parameters, key, factor)} for factor in _ends(change)]
            for key in keys
        ]
        outcomes = self.outcomes([c for pair in pairs for c in pair], "single changes")
        by_change = {_key(outcome.changes): outcome for outcome in outcomes}
        complete = [pair for pair in pairs if all(_key(c) in by_change for c in pair)]
        influences = [
            Influence(next(iter(less)), by_change[_key(less)], by_change[_key(more)])
            for less, more in complete
        ]
        return sorted(influences, key=lambda influence: -influence.span)

    def combined(self, base: Outcome, influences: Iterable[Influence]) -> list[Outcome]:
        """Return the best single change, the best addition to it, and so on.

        The list ends where an addition gains less than `LEAST_GAIN`.
        """
        useful = sorted((i.best for i in influences), key=lambda outcome: -outcome.gap)[:MOST_TRIED]
        candidates, chosen, last = useful, list[Outcome](), base
        while candidates and len(chosen) < MOST_COMBINED:
            best = max(candidates, key=lambda outcome: outcome.gap)
            if best.gap < last.gap + LEAST_GAIN or not np.isfinite(best.gap):
                break
            chosen.append(best)
            last = best
            more = [
                {**best.changes, **other.changes}
                for other in useful
                if not set(other.changes) <= set(best.changes)
            ]
            if len(chosen) < MOST_COMBINED:
                candidates = self.outcomes(more, "combinations")
        return chosen

    def _changed(self, changes: Mapping[str, str]) -> MachineParameters | None:
        """Return the changed machine; None if it is not allowed."""
        try:
            changed = with_values(self.machine.parameters, changes)
            check_step(self.machine.set_up(parameters=changed), self.step)
        except InputError:
            return None
        return changed

    @property
    def step(self) -> float:
        """Return the step of the machine. [s]"""
        return checked_step(self.machine.parameters, None)


def _key(changes: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    return tuple(changes.items())


def _ends(change: float) -> tuple[float, float]:
    return 1.0 - 0.01 * change, 1.0 + 0.01 * change


def _text(parameters: MachineParameters, key: str, factor: float) -> str:
    """Return a multiple of a number as the text that `--set` takes, so that it is what is run."""
    if isinstance(value_at(parameters, key), Table):
        return f"{100.0 * factor:.4g} %"
    unit = next(unit for name, _, unit in quantities(parameters) if name == key)
    return f"{unit.from_si(factor * value_at(parameters, key)):.4g} {unit.shown}"


def changeable(parameters: MachineParameters) -> Iterator[str]:
    """Yield the key paths of what a designer can change: numbers of parts, counterweights.

    Numbers that are 0 are left out.
    """
    for key, value, unit in quantities(parameters):
        table = key.partition(".")[0]
        is_part = table in PARTS and unit.si in PHYSICAL
        is_weight = table == "bodies" and COUNTERWEIGHT in key and key.endswith(".mass")
        if (is_part or is_weight) and isinstance(value, float) and value != 0.0:
            yield key
        curve = key.rpartition(".")[0]
        if is_part and isinstance(value, tuple) and isinstance(value_at(parameters, curve), Table):
            yield curve


COUNTERWEIGHT = "counterweight"
"""Part of the name of a body whose mass a designer can choose."""
