"""The gasket study of [B] section 4: how its stiffness and damping act on tub displacement, gasket forces and moments."""

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
"""What is measured of each run."""

VARIABLES = {
    "D": ("detergent_displacement", Unit("m", "mm")),
    "F": ("gasket_force", Unit("N", "N")),
    "M": ("gasket_moment", Unit("N*m", "N*m")),
}
"""By letter of [B]: variable of a table of runs, and the unit it is reported in."""

RESPONSES = [f"{letter}{axis}" for letter in VARIABLES for axis in AXES]

LOADS = ("middle", "counter")
"""Loads of [B] section 4."""

Run: TypeAlias = Callable[[Iterable[Case]], xr.Dataset]
"""Runs cases and gives their table, in their order, as `simulate_many` does."""


@dataclass(frozen=True)
class GasketTrials:
    """The trials of a design, as runs of a machine.

    Attributes:
        parameters: The machine at level 0 of all factors, apart from which only the factors change.
        factors: What the levels are.
        loads: A case for each load to run, without parameters.
    """

    parameters: MachineParameters
    factors: tuple[FactorLevels, ...]
    loads: Sequence[Case]

    def cases(self, design: Design) -> Iterator[Case]:
        """All runs: for each trial, one for each load."""
        for number, levels in enumerate(design.levels, start=1):
            changed = at_levels(self.parameters, self.factors, levels.tolist())
            for case in self.loads:
                own = (
                    self.parameters.loads.get(case.name) == case.load
                )  # a factor may be one of its masses
                load = changed.loads[case.name] if own else case.load
                yield Case(f"{case.name}, trial {number}", load, case.profile, parameters=changed)

    def responses(self, design: Design, run: Run) -> Responses:
        """Runs all trials."""
        return as_responses(run(self.cases(design)), [case.name for case in self.loads])


def as_responses(table: xr.Dataset, loads: Sequence[str]) -> Responses:
    """D, F and M per load from a table of runs, the loads of a trial one after the other."""
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
