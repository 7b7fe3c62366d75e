"""The gasket study of [B] section 4.

It computes the effects of stiffness and damping of the gasket on the displacement of the tub and on
the forces and moments of the gasket.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.parameters import TABLES, FactorLevels, MachineParameters, at_levels
from wm_drake.parameters.units import Unit
from wm_drake.simulation.cases import Case, load_of
from wm_drake.simulation.measures.responses import Response, chosen_responses, measures_of
from wm_drake.studies.doe.design import Design
from wm_drake.studies.gasket.screening import Label, Meaning, Responses

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


RunMachine: TypeAlias = Callable[[MachineParameters, Sequence[Case]], xr.Dataset]
"""Function that builds a machine, runs cases and returns their table, as `simulate_many` does."""

MACHINE = "machine"
"""Name of the machine itself beside level 0."""


@dataclass(frozen=True)
class LevelZero:
    """Responses of the machine and of level 0 of all factors with each treatment of tables.

    A stiffness may be a table. The study can scale its forces, and level 0 is the machine; or it
    can replace the table by the slope of its first 20 %, as [B] does, and level 0 is another
    machine where the table hardens.

    Attributes:
        tables: Treatment of tables in the study, one of `TABLES`.
        responses: Responses; a row of each load is a variant of `variants`.
        variants: `MACHINE`, then the treatments of tables.
    """

    tables: str
    responses: Responses
    variants: tuple[str, ...] = (MACHINE, *TABLES)

    def value(self, label: Label, variant: str) -> float:
        """Return a response of a variant; NaN if its run failed. [unit of the response]"""
        load, name = label
        return float(self.responses.values[load][name].iloc[self.variants.index(variant)])

    def difference(self, label: Label, variant: str) -> float:
        """Return by how much a response of a variant differs from that of the machine. [%]

        It is NaN if the machine's is zero.
        """
        machine = self.value(label, MACHINE)
        return 100.0 * (self.value(label, variant) - machine) / machine if machine else np.nan

    def largest(self, variant: str) -> tuple[Label, float]:
        """Return the response that differs most from the machine's, and its difference. [%]"""
        every = {label: self.difference(label, variant) for label in self.labels}
        label = max(every, key=lambda label: abs(np.nan_to_num(every[label])))
        return label, every[label]

    @property
    def labels(self) -> list[Label]:
        """All loads and responses."""
        return [(load, str(n)) for load, frame in self.responses.values.items() for n in frame]

    def frame(self) -> pd.DataFrame:
        """Return one row per load and response: a column per variant and each difference."""
        rows = []
        for load, name in self.labels:
            row: dict[str, object] = {"load": load, "response": name}
            row["unit"] = self.responses.units[name]
            row |= {variant: self.value((load, name), variant) for variant in self.variants}
            for variant in self.variants[1:]:
                row[f"{variant}_difference_percent"] = self.difference((load, name), variant)
            rows.append(row)
        return pd.DataFrame(rows)


def run_level_zero(
    machine: MachineParameters,
    levels: Mapping[str, tuple[FactorLevels, ...]],
    tables: str,
    trials: GasketTrials,
    run: RunMachine,
) -> LevelZero | None:
    """Run the machine and level 0 of all factors with each treatment of tables.

    Args:
        levels: Levels of the factors by treatment of tables, all of `TABLES`.

    Returns:
        The responses; None if no factor has a table, so that both treatments are the same.
    """
    linear, scaled = ([factor.settings for factor in levels[name]] for name in TABLES)
    if linear == scaled:
        return None
    variants = {MACHINE: machine}
    for name in TABLES:
        variants[name] = at_levels(machine, levels[name], [0] * len(levels[name]))
    runs = []
    for name, parameters in variants.items():
        cases = []
        for case in trials.loads:
            load = load_of(case, machine, parameters)
            cases.append(Case(f"{case.name}, {name}", load, case.profile, case.gasket))
        # a table and a number are different structures, so each variant is built
        runs.append(run(parameters, cases))
    table = xr.concat(runs, "run")
    return LevelZero(
        tables, as_responses(table, [case.name for case in trials.loads], trials.chosen)
    )
