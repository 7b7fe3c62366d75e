"""The gasket study of [B] section 4.

It computes the effects of stiffness and damping of the gasket on the displacement of the tub and on
the forces and moments of the gasket.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.parameters import FactorLevels, MachineParameters, at_levels
from wm_drake.parameters.units import Unit
from wm_drake.simulation.cases import Case
from wm_drake.simulation.outputs import AXES
from wm_drake.studies.doe import Design
from wm_drake.studies.gasket.screening import Responses

MEASURES = ("extremes",)
"""Measures of each run, as for `simulate_many`."""

VARIABLES = {
    "D": ("detergent_displacement", Unit("m", "mm")),
    "F": ("gasket_force", Unit("N", "N")),
    "M": ("gasket_moment", Unit("N*m", "N*m")),
}
"""By the letter in [B]: variable of the table of runs, and the unit of the report."""

RESPONSES = [f"{letter}{axis}" for letter in VARIABLES for axis in AXES]

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
    """

    parameters: MachineParameters
    factors: tuple[FactorLevels, ...]
    loads: Sequence[Case]

    def cases(self, design: Design) -> Iterator[Case]:
        """Yield all runs: for each trial, one for each load."""
        for number, levels in enumerate(design.levels, start=1):
            changed = at_levels(self.parameters, self.factors, levels.tolist())
            for case in self.loads:
                # a factor may be a mass of one of the machine's own loads
                is_own = self.parameters.loads.get(case.name) == case.load
                load = changed.loads[case.name] if is_own else case.load
                yield Case(f"{case.name}, trial {number}", load, case.profile, parameters=changed)

    def responses(self, design: Design, run: Run) -> Responses:
        """Run all trials and return their responses."""
        return as_responses(run(self.cases(design)), [case.name for case in self.loads])


def as_responses(table: xr.Dataset, loads: Sequence[str]) -> Responses:
    """Return the responses D, F and M for each load from a table of runs.

    Args:
        table: Table of runs; the loads of one trial follow each other.
        loads: Names of the loads, in the order of the runs.
    """
    blocks = [unit.from_si(1.0) * table[name].values for name, unit in VARIABLES.values()]
    numbers = np.hstack(blocks)
    values = {
        load: pd.DataFrame(numbers[index :: len(loads)], columns=RESPONSES)
        for index, load in enumerate(loads)
    }
    failed = {}
    for index, reason in enumerate(table.diverged.values):
        if reason:
            trial, load = index // len(loads), loads[index % len(loads)]
            failed[trial, load] = str(reason)
            values[load].loc[trial] = np.nan
    units = {
        f"{letter}{axis}": unit.shown.replace("*", " ")
        for letter, (_, unit) in VARIABLES.items()
        for axis in AXES
    }
    return Responses(values, units, failed)
