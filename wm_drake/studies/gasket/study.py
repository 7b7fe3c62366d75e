"""The gasket study of [B] section 4.

It computes the effects of stiffness and damping of the gasket on the displacement of the tub and on
the forces and moments of the gasket.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.parameters import FactorLevels, MachineParameters, at_levels
from wm_drake.parameters.units import Unit
from wm_drake.simulation.cases import Case, load_of
from wm_drake.simulation.measures.responses import Response, chosen_responses, measures_of
from wm_drake.studies.doe.design import Design
from wm_drake.studies.gasket.screening import Meaning, Responses

LOADS = ("middle", "counter")
"""Loads of [B] section 4."""

Run: TypeAlias = Callable[[Iterable[Case]], xr.Dataset]
"""Function that runs cases and returns their table, as `simulate_many` does."""


@dataclass(frozen=True)
class GasketTrials:
    """The trials of a design, as runs of a machine.

    Attributes:
        parameters: The machine; only the factors change.
        factors: Levels of the factors for this machine.
        loads: One case for each load to run, without parameters.
        response_names: Names of the responses, as for `chosen_responses`; empty for the default.
        chosen: The responses.
    """

    parameters: MachineParameters
    factors: tuple[FactorLevels, ...]
    loads: Sequence[Case]
    response_names: Sequence[str] = ()
    chosen: tuple[Response, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Look up the responses.

        Raises:
            InputError: a response is unknown, or the machine does not have it.
        """
        responses = chosen_responses(self.parameters, self.loads[0].profile, self.response_names)
        object.__setattr__(self, "chosen", responses)

    @cached_property
    def measures(self) -> tuple[str, ...]:
        """Measures of each run, as for `simulate_many`."""
        return measures_of(self.parameters, self.chosen)

    def cases(self, design: Design) -> Iterator[Case]:
        """Yield all runs: for each trial, one for each load."""
        for number, levels in enumerate(design.levels, start=1):
            changed = at_levels(self.parameters, self.factors, levels.tolist())
            yield from self.cases_of(changed, f"trial {number}")

    def cases_of(self, changed: MachineParameters, name: str) -> Iterator[Case]:
        """Yield a case of each load for a changed machine."""
        for case in self.loads:
            load = load_of(case, self.parameters, changed)
            yield Case(f"{case.name}, {name}", load, case.profile, parameters=changed)

    def responses(self, design: Design, run: Run) -> Responses:
        """Run all trials and return their responses."""
        table = run(self.cases(design))
        return as_responses(table, [case.name for case in self.loads], self.chosen)


def as_responses(table: xr.Dataset, loads: Sequence[str], chosen: Sequence[Response]) -> Responses:
    """Return the responses for each load from a table of runs.

    Args:
        table: Table of runs; the loads of one trial follow each other.
    """
    columns = {response.name: response.values(table) for response in chosen}
    values = {
        load: pd.DataFrame({name: column[index :: len(loads)] for name, column in columns.items()})
        for index, load in enumerate(loads)
    }
    places = [(index // len(loads), loads[index % len(loads)]) for index in range(table.run.size)]
    reasons = dict(zip(places, map(str, table.diverged.values), strict=True))
    failed = {place: reason for place, reason in reasons.items() if reason}
    for trial, load in failed:
        values[load].loc[trial] = np.nan
    touching = {}
    if "smallest_gap" in table:
        gaps = zip(places, map(float, table.smallest_gap.values), strict=True)
        touching = {
            p: Unit("m", "mm").from_si(gap) for p, gap in gaps if gap <= 0.0 and p not in failed
        }
    springs = zip(places, _slack(table), strict=True)
    slack = {place: names for place, names in springs if names and place not in failed}
    return Responses(
        values,
        {response.name: response.unit_text for response in chosen},
        failed,
        {r.name: Meaning(r.title, r.variable.about, r.kind, r.better) for r in chosen},
        touching,
        slack,
    )


def _slack(table: xr.Dataset) -> list[list[str]]:
    """Return the names of the springs that go slack in each run of a table."""
    if "smallest_spring_tension" not in table:
        return [[]] * table.run.size
    names = np.array(list(map(str, table.spring.values)))
    return [names[slack].tolist() for slack in table.smallest_spring_tension.values == 0.0]
