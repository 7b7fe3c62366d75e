"""The design study: search, front in units for reading, chosen designs, check of robust designs."""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.pareto.problem import Goal, MachineDesigns, Run
from wm_drake.studies.pareto.search import Problem, SearchResult, SearchSettings, search_front
from wm_drake.studies.pareto.surrogate import search_with_surfaces

SEARCHES = {"genetic": search_front, "surfaces": search_with_surfaces}
"""Searches by name."""

COMPROMISE = "compromise"
"""Name of the chosen design that is nearest to the best of all objectives."""


@dataclass(frozen=True)
class ParetoFront:
    """Result of a design study.

    Attributes:
        objectives, constraints: Values of the front, in units for reading. (n, m) and (n, k)
        nominal_objectives: Those of the machine itself, moved into the bounds. (m,)
        chosen: Numbers of chosen designs, from 0, by name: best Dx, ..., compromise.
    """

    designs: MachineDesigns
    search: SearchResult
    objectives: FloatArray
    constraints: FloatArray
    nominal_objectives: FloatArray
    chosen: dict[str, int]

    def machine(self, number: int) -> MachineParameters:
        """Return the machine of a design of the front."""
        return self.designs.machine_at(self.search.designs[number])

    def goals(self, number: int) -> tuple[list[tuple[Goal, float]], list[tuple[Goal, float]]]:
        """Return objectives and constraints of a design with their values, in units for reading."""
        objectives = zip(self.designs.objectives, self.objectives[number].tolist(), strict=True)
        constraints = zip(self.designs.constraints, self.constraints[number].tolist(), strict=True)
        return list(objectives), list(constraints)

    def variables(self, number: int) -> list[tuple[str, float | str, str]]:
        """Return name, value and unit for reading of each variable of a design."""
        places = zip(self.designs.dimensions, self.search.designs[number].tolist(), strict=True)
        return [(dimension.name, *dimension.shown(place)) for dimension, place in places]


def run_designs(
    designs: MachineDesigns, run: Run, settings: SearchSettings, search: str = "genetic"
) -> ParetoFront:
    """Search the Pareto front of the designs of a machine.

    Args:
        search: Name in `SEARCHES`.
    """
    problem = Problem(
        lambda x: designs.costs(x, run),
        designs.nominal(),
        len(designs.objectives),
        len(designs.constraints),
    )
    result = SEARCHES[search](problem, settings)
    nominal, _ = designs.evaluate(designs.nominal()[None], run)
    return ParetoFront(
        designs,
        result,
        _values(designs.objectives, result.objectives),
        _values(designs.constraints, result.constraints),
        nominal[0],
        chosen_designs(designs.objectives, result.objectives),
    )


def chosen_designs(goals: tuple[Goal, ...], costs: FloatArray) -> dict[str, int]:
    """Return the best design of each objective, and a compromise, by name.

    The compromise has the smallest distance to the best of all objectives, which are scaled to the
    range of the front.
    """
    if not len(costs):
        return {}
    chosen = {
        f"best {g.given.quantity}": int(np.argmin(c)) for g, c in zip(goals, costs.T, strict=True)
    }
    if len(goals) > 1:
        low, high = costs.min(axis=0), costs.max(axis=0)
        scaled = (costs - low) / np.where(high > low, high - low, 1.0)
        chosen[COMPROMISE] = int(np.argmin(np.linalg.norm(scaled, axis=1)))
    return chosen


def _values(goals: tuple[Goal, ...], costs: FloatArray) -> FloatArray:
    """Return values in units for reading from what the search made small."""
    columns = []
    for goal, column in zip(goals, costs.T, strict=True):
        signed = column if goal.is_small_better else -column
        columns.append(signed if np.isnan(goal.limit) else signed + goal.limit)
    return np.column_stack(columns) if columns else np.empty((len(costs), 0))
