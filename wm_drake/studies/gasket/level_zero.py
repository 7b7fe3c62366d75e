"""Level 0 of all factors beside the machine itself.

A stiffness may be a table. The study can scale its forces, and level 0 is the machine; or it can
replace the table by its slope at rest, as [B] does, and level 0 is another machine where the table
hardens. The responses of both show how much that matters.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.parameters import TABLES, FactorLevels, MachineParameters, at_levels
from wm_drake.simulation.cases import Case, load_of
from wm_drake.studies.gasket.screening import Label, Responses
from wm_drake.studies.gasket.study import GasketTrials, as_responses

RunMachine: TypeAlias = Callable[[MachineParameters, Sequence[Case]], xr.Dataset]
"""Function that builds a machine, runs cases and returns their table, as `simulate_many` does."""

MACHINE = "machine"
"""Name of the machine itself in the tables of this module."""


@dataclass(frozen=True)
class LevelZero:
    """Responses of the machine and of level 0 of all factors with each treatment of tables.

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
