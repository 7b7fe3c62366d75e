"""The gasket study of [B] section 4.

It computes the effects of stiffness and damping of the gasket on the displacement of the tub and on
the forces and moments of the gasket.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import xarray as xr

from wm_drake.model.build import build_machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.units import Share
from wm_drake.parameters.varying import TABLES, Varied, Varying
from wm_drake.report.formatting import three_digits
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.cases import Case, load_of
from wm_drake.simulation.measures.responses import Response, chosen_responses, measures_of
from wm_drake.studies.doe.design import Design
from wm_drake.studies.doe.polynomial import PolynomialDesign
from wm_drake.studies.experiment import Experiment, Simulate, responses
from wm_drake.studies.gasket.screening import VALUE, runs_of

DEFAULT_LEVELS = "50 %..150 %"
"""Levels of a factor that is named without any: those of [B]."""

LOADS = ("middle", "counter")
"""Loads of [B] section 4."""


@dataclass(frozen=True)
class GasketTrials:
    """The trials of a design, as runs of a machine.

    Attributes:
        varying: The machine, and its factors with three levels.
        loads: One case for each load to run, without parameters.
        response_names: Names of the responses, as for `chosen_responses`; empty for the default.
        chosen: Responses.
    """

    varying: Varying
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
    def parameters(self) -> MachineParameters:
        """Machine at level 0 of all factors; only the factors change."""
        return self.varying.at_levels([0] * len(self.factors))

    @property
    def factors(self) -> tuple[Varied, ...]:
        """Return the factors."""
        return self.varying.every

    @cached_property
    def measures(self) -> tuple[str, ...]:
        """Measures of each run, as for `simulate_many`."""
        return measures_of(self.parameters, self.chosen)

    def experiment(self, simulate: Simulate) -> Experiment:
        """Return the runs of the machine with the loads.

        Args:
            simulate: Function that runs cases.
        """
        machine = build_machine(self.parameters)
        return Experiment(machine, self.measures, simulate, tuple(self.loads))

    def responses(self, design: Design | PolynomialDesign, experiment: Experiment) -> xr.Dataset:
        """Run all trials and return their responses, as of `screening.runs_of`.

        Args:
            design: The trials.
            experiment: Runs of the machine with the loads of the study.
        """
        names = [f"trial {number}" for number in range(1, design.trials + 1)]
        machines = (self.varying.at_levels(levels) for levels in design.levels.tolist())
        return responses_of(experiment.at(names, machines), self.chosen)


def responses_of(data: xr.Dataset, chosen: Sequence[Response]) -> xr.Dataset:
    """Return the responses of an experiment, as of `screening.runs_of`; a trial is a point.

    Args:
        data: As of `Experiment.at`.
        chosen: The responses.
    """
    data = data.transpose("load", "point", ...)
    values = responses(data, chosen)
    runs = runs_of(
        {
            load: {r.name: values[r.name].sel(load=load).values for r in chosen}
            for load in data["load"].values.tolist()
        },
        {r.name: Quantity(r.title, r.unit, form=three_digits) for r in chosen},
        {r.name: r.better for r in chosen},
        {r.name: r.kind for r in chosen},
    )
    runs["failed"][:] = data.diverged.values
    runs["about"][:] = [r.variable.about for r in chosen]
    if "smallest_gap" in data:
        gaps = data.smallest_gap.values
        runs.overlap[:] = np.where(gaps <= 0.0, gaps, np.nan)
    if "smallest_spring_tension" in data:
        names, is_slack = data.spring.values, data.smallest_spring_tension.values == 0.0
        runs["slack"][:] = [[", ".join(names[one]) for one in of_load] for of_load in is_slack]
    return runs


MACHINE = "machine"
"""Name of the machine itself beside level 0."""

DIFFERENCE = Quantity("difference", Share(), 1)


def run_level_zero(
    machine: MachineParameters,
    every: Mapping[str, Varying],
    trials: GasketTrials,
    simulate: Simulate,
) -> xr.Dataset:
    """Run the machine and level 0 of all factors with each treatment of tables.

    A stiffness may be a table. The study can scale its forces, and level 0 is the machine; or it
    can replace the table by the slope of its first 20 %, as [B] does, and level 0 is another
    machine where the table hardens.

    Args:
        machine: The machine.
        every: The factors by treatment of tables, all of `TABLES`.
        trials: Loads and responses.
        simulate: Function that runs cases.

    Returns:
        Over `load` and `response`: `machine`, `linear` and `scaled`, and the differences
        `linear_difference` and `scaled_difference` from the machine, as shares of it; NaN where
        that is zero. No variables if no factor has a table, so that both treatments are the same.
    """
    linear, scaled = (every[name].every for name in TABLES)
    if linear == scaled:
        return xr.Dataset()
    variants = {MACHINE: machine}
    for name in TABLES:
        variants[name] = every[name].at_levels([0] * len(every[name].every))
    runs = []
    for name, parameters in variants.items():
        # a table and a number are different structures, so each variant is built
        experiment = Experiment(build_machine(parameters), trials.measures, simulate)
        loads = [replace(case, load=load_of(case, machine, parameters)) for case in trials.loads]
        cases = [replace(case, name=f"{case.name}, {name}") for case in loads]
        labels = {"point": [name], "load": [case.name for case in trials.loads]}
        runs.append(experiment.over(labels, cases, "level 0"))
    values, zero = responses_of(xr.concat(runs, "point"), trials.chosen).value, xr.Dataset()
    for number, name in enumerate(variants):
        zero[name] = values.isel(trial=number)
        words = name if name == MACHINE else f"level 0, tables {name}"
        zero[name] = VALUE.named(words).on(zero[name])
    for name in TABLES:
        difference = (zero[name] - zero[MACHINE]) / zero[MACHINE].where(zero[MACHINE] != 0.0)
        words = f"difference, tables {name}"
        zero[f"{name}_difference"] = DIFFERENCE.named(words).variable(
            ("load", "response"), difference
        )
    return zero.drop_vars("trial", errors="ignore")
