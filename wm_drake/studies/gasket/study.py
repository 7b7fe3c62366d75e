"""The gasket study of [B] section 4.

It computes the effects of stiffness and damping of the gasket on the displacement of the tub and on
the forces and moments of the gasket.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np
import xarray as xr

from wm_drake.parameters import TABLES, FactorLevels, MachineParameters, at_levels
from wm_drake.parameters.units import Share
from wm_drake.report.formatting import three_digits
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.cases import Case, load_of
from wm_drake.simulation.measures.responses import Response, chosen_responses, measures_of
from wm_drake.studies.doe.design import Design
from wm_drake.studies.executor import RunCases
from wm_drake.studies.gasket.screening import VALUE, runs_of

LOADS = ("middle", "counter")
"""Loads of [B] section 4."""


@dataclass(frozen=True)
class GasketTrials:
    """The trials of a design, as runs of a machine.

    Attributes:
        parameters: The machine; only the factors change.
        factors: Levels of the factors for this machine.
        loads: One case for each load to run, without parameters.
        response_names: Names of the responses, as for `chosen_responses`; empty for the default.
        chosen: Responses.
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

    def responses(self, design: Design, run: RunCases) -> xr.Dataset:
        """Run all trials and return their responses, as of `screening.runs_of`."""
        return self.of_table(run(self.cases(design)))

    def of_table(self, table: xr.Dataset) -> xr.Dataset:
        """Return the responses of a table of runs, as of `screening.runs_of`.

        Args:
            table: Table of runs; the loads of one trial follow each other.
        """
        return responses_of(table, [case.name for case in self.loads], self.chosen)


def responses_of(table: xr.Dataset, loads: Sequence[str], chosen: Sequence[Response]) -> xr.Dataset:
    """Return the responses of a table of runs, as of `screening.runs_of`.

    Args:
        table: Table of runs; the loads of one trial follow each other.
    """

    def by_load(values: np.ndarray) -> np.ndarray:
        return values.reshape(-1, len(loads)).T

    reasons = by_load(table.diverged.values)
    failed = reasons != ""
    columns = {r.name: np.where(failed, np.nan, by_load(r.of_runs(table))) for r in chosen}
    runs = runs_of(
        {
            load: {name: c[number] for name, c in columns.items()}
            for number, load in enumerate(loads)
        },
        {r.name: Quantity(r.title, r.unit, form=three_digits) for r in chosen},
        {r.name: r.better for r in chosen},
        {r.name: r.kind for r in chosen},
    )
    runs["failed"][:] = reasons
    runs["about"][:] = [r.variable.about for r in chosen]
    if "smallest_gap" in table:
        gaps = by_load(table.smallest_gap.values)
        runs.overlap[:] = np.where((gaps <= 0.0) & ~failed, gaps, np.nan)
    runs["slack"][:] = np.where(failed, "", by_load(_slack(table)))
    return runs


def _slack(table: xr.Dataset) -> np.ndarray:
    """Return the names of the springs that go slack in each run of a table. (runs,)"""
    if "smallest_spring_tension" not in table:
        return np.full(table.run.size, "", dtype=object)
    names = np.array(list(map(str, table.spring.values)))
    is_slack = table.smallest_spring_tension.values == 0.0
    return np.array([", ".join(names[slack]) for slack in is_slack], dtype=object)


RunMachine: TypeAlias = Callable[[MachineParameters, Sequence[Case]], xr.Dataset]
"""Function that builds a machine, runs cases and returns their table, as `simulate_many` does."""

MACHINE = "machine"
"""Name of the machine itself beside level 0."""

DIFFERENCE = Quantity("difference", Share(), 1)


def run_level_zero(
    machine: MachineParameters,
    levels: Mapping[str, tuple[FactorLevels, ...]],
    trials: GasketTrials,
    run: RunMachine,
) -> xr.Dataset:
    """Run the machine and level 0 of all factors with each treatment of tables.

    A stiffness may be a table. The study can scale its forces, and level 0 is the machine; or it
    can replace the table by the slope of its first 20 %, as [B] does, and level 0 is another
    machine where the table hardens.

    Args:
        levels: Levels of the factors by treatment of tables, all of `TABLES`.

    Returns:
        Over `load` and `response`: `machine`, `linear` and `scaled`, and the differences
        `linear_difference` and `scaled_difference` from the machine, as shares of it; NaN where
        that is zero. No variables if no factor has a table, so that both treatments are the same.
    """
    linear, scaled = ([factor.settings for factor in levels[name]] for name in TABLES)
    if linear == scaled:
        return xr.Dataset()
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
    values, zero = trials.of_table(xr.concat(runs, "run")).value, xr.Dataset()
    for number, name in enumerate(variants):
        zero[name] = values.isel(trial=number)
        words = name if name == MACHINE else f"level 0, tables {name}"
        zero[name].attrs |= VALUE.named(words).attributes()
    for name in TABLES:
        difference = (zero[name] - zero[MACHINE]) / zero[MACHINE].where(zero[MACHINE] != 0.0)
        words = f"difference, tables {name}"
        zero[f"{name}_difference"] = DIFFERENCE.named(words).variable(
            ("load", "response"), difference
        )
    return zero.drop_vars("trial", errors="ignore")
