"""Least squares of a machine to all targets, and to the changes by the gasket of [B] Table 1."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from calibrate_reference import PLAN, REFERENCE, adams_targets

from analysis_tools.goals import changes_of, printed_changes
from wm_drake.batch.ledger import open_ledger
from wm_drake.model.machine import Machine
from wm_drake.parameters import load_machine
from wm_drake.parameters.free import FreeFile
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibrate.computed import Evaluation, PointRunner
from wm_drake.studies.calibrate.parameter_map import ParameterMap, parameter_map_of
from wm_drake.studies.calibrate.study import calibration_problem, identity_of
from wm_drake.studies.fitting.problem import PriorProblem, Residuals
from wm_drake.studies.fitting.search import Search, descended

CHANGE_DEVIATION = 0.06
"""Standard deviation of a change by the gasket, of the logarithm of its ratio."""


def fitted_point(
    machine: Machine, free: FreeFile, start: FloatArray, iterations: int, ledger_path: Path
) -> FloatArray:
    """Return the free quantities (quantity,) where least squares from a start end. [SI]

    Args:
        machine: A machine with the sensors and loads of the reference machine.
        free: Its free quantities.
        start: Where the search starts. (quantity,) [SI]
        iterations: Limit of iterations.
        ledger_path: File of the evaluations; a second call goes on from there.
    """
    reference = load_machine(REFERENCE)
    targets = adams_targets(reference)
    parameter_map = parameter_map_of(machine, free)
    identity = identity_of(machine, free, targets, PLAN)
    with open_ledger(ledger_path, identity, resume=True) as ledger:
        values = PointRunner(machine, ledger, workers=1).values(parameter_map, targets)
        problem = _with_changes(
            calibration_problem(values, PLAN), values, printed_changes(reference, targets)
        )
        search = Search(problem, _report)
        end = descended(search, problem.coordinates_of(start), iterations)
        return problem.points_at(end.point)


def _with_changes(problem: PriorProblem, values: Evaluation, printed: FloatArray) -> PriorProblem:
    """Return a problem with the changes of [B] Table 1 as further residuals."""

    def residuals(points: FloatArray) -> Residuals:
        computed = values(points)
        parts = problem.evaluate(points)
        exact, smooth = (
            np.hstack(
                [
                    part,
                    (changes_of(values.targets, a) - printed).reshape(len(points), -1)
                    / CHANGE_DEVIATION,
                ]
            )
            for part, a in zip(parts, (computed.amplitude, computed.power_mean), strict=True)
        )
        return Residuals(exact, smooth)

    return PriorProblem(problem.unknowns, residuals)


def _report(evaluations: int, least: float) -> None:
    print(f"{evaluations} evaluations, cost {least:.0f}", file=sys.stderr, flush=True)


def quantities_of(parameter_map: ParameterMap, point: FloatArray) -> pd.DataFrame:
    """Return the free quantities of a machine with bounds and expected values, in their units."""
    m = parameter_map
    columns = {"value": point, "lower": m.lower, "upper": m.upper, "expected": m.expected}
    in_units = {name: m.in_units(column) for name, column in columns.items()}
    units = [unknown.unit.shown for unknown in m.unknowns]
    return pd.DataFrame({"quantity": m.names, **in_units, "unit": units})
