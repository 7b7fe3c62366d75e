"""Least squares of a machine to all targets, and to the changes by the gasket of [B] Table 1."""

import sys
from dataclasses import replace
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
from wm_drake.studies.calibrate.computed import Evaluation
from wm_drake.studies.calibrate.parameter_map import ParameterMap, parameter_map_of
from wm_drake.studies.calibrate.study import calibration_problem, identity_of
from wm_drake.studies.experiment import Experiment, kept_in
from wm_drake.studies.fitting.problem import FitProblem, Measurement, ModelValues
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
        experiment = Experiment(machine, (), kept_in(ledger, workers=1))
        values = Evaluation(experiment, parameter_map, targets)
        problem = _with_changes(
            calibration_problem(values, PLAN), values, printed_changes(reference, targets)
        )
        search = Search(problem, _report)
        end = descended(search, problem.coordinates_of(start), iterations)
        return problem.points_at(end.point)


def _with_changes(problem: FitProblem, values: Evaluation, printed: FloatArray) -> FitProblem:
    """Return a problem with the changes of [B] Table 1 as a further measurement."""

    def missed(amplitude: FloatArray) -> FloatArray:
        changes = (changes_of(values.targets, amplitude) - printed) / CHANGE_DEVIATION
        return changes.reshape(len(amplitude), -1)

    def evaluate(points: FloatArray) -> ModelValues:
        computed, parts = values(points), problem.evaluate(points)
        assert isinstance(parts, ModelValues)
        assert parts.smooth is not None
        return parts._replace(
            values=np.hstack([parts.values, missed(computed.amplitude)]),
            smooth=np.hstack([parts.smooth, missed(computed.power_mean)]),
        )

    changes = Measurement("changes", np.zeros(printed.size), errors="known")
    return replace(problem, measurements=(*problem.measurements, changes), evaluate=evaluate)


def _report(evaluations: int, least: float) -> None:
    print(f"{evaluations} evaluations, misfit {least:.3g}", file=sys.stderr, flush=True)


def quantities_of(parameter_map: ParameterMap, point: FloatArray) -> pd.DataFrame:
    """Return the free quantities of a machine with bounds and expected values, in their units."""
    m = parameter_map
    columns = {"value": point, "lower": m.lower, "upper": m.upper, "expected": m.expected}
    in_units = {name: m.in_units(column) for name, column in columns.items()}
    units = [unknown.unit.shown for unknown in m.unknowns]
    return pd.DataFrame({"quantity": m.names, **in_units, "unit": units})
