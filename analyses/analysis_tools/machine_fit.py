"""Least squares of a machine to all targets, and to the changes by the gasket of [B] Table 1."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from calibrate_reference import PLAN, REFERENCE, adams_targets
from choose_damper_law import FREE

from analysis_tools.goals import changes_of, printed_changes
from analysis_tools.ledgers import calibration_identity, kept_in
from analysis_tools.steady_net import SteadyNet
from wm_drake.batch.ledger import open_ledger
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import load_machine
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.vary_file import VaryFile, load_vary
from wm_drake.studies.calibrate.computed import Evaluation
from wm_drake.studies.calibrate.parameter_map import ParameterMap, parameter_map_of
from wm_drake.studies.calibrate.study import calibration_problem
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.fitting.problem import FitProblem, Measurement, ModelValues
from wm_drake.studies.fitting.search import Search, descended

CHANGE_DEVIATION = 0.06
"""Standard deviation of a change by the gasket, of the logarithm of its ratio."""


def steady_end(steady: SteadyNet, start: FloatArray, iterations: int) -> FloatArray:
    """Return the free quantities where least squares by the steady motion end. (quantity,) [SI]

    Args:
        steady: Machines by their steady motion.
        start: Where the search starts. (quantity,) [SI]
        iterations: Limit of iterations.
    """
    search = Search(problem_of(steady))
    end = descended(search, search.problem.coordinates_of(start), iterations)
    return search.problem.points_at(end.point)


@dataclass(frozen=True)
class FitByRuns:
    """Least squares of a machine by runs; runs are kept in a ledger.

    Attributes:
        machine: A machine with the sensors and loads of the reference machine.
        free: Its free quantities.
        ledger_path: File of the runs; a second call goes on from there.
    """

    machine: Machine
    free: VaryFile
    ledger_path: Path

    def costs(self, points: FloatArray) -> FloatArray:
        """Return the misfit of each of some points (point, quantity). (point,)"""
        with self._problem() as problem:
            coordinates = np.array([problem.coordinates_of(point) for point in points])
            return Search(problem).costs(coordinates)

    def end(self, start: FloatArray, iterations: int) -> FloatArray:
        """Return the free quantities where least squares from a start end; see `steady_end`."""
        with self._problem() as problem:
            search = Search(problem, _report)
            end = descended(search, problem.coordinates_of(start), iterations)
            return problem.points_at(end.point)

    @contextmanager
    def _problem(self) -> Iterator[FitProblem]:
        targets = adams_targets(load_machine(REFERENCE))
        identity = calibration_identity(self.machine, self.free, targets, PLAN)
        with open_ledger(self.ledger_path, identity, resume=True) as ledger:
            experiment = Experiment(self.machine, (), kept_in(ledger, workers=1))
            parameter_map = parameter_map_of(self.machine, self.free)
            yield problem_of(Evaluation(experiment, parameter_map, targets))


def problem_of(values: Evaluation | SteadyNet) -> FitProblem:
    """Return the problem of all targets and of the changes by the gasket of [B] Table 1."""
    printed = printed_changes(load_machine(REFERENCE), values.targets)
    return _with_changes(calibration_problem(values, PLAN), values, printed)


def _with_changes(
    problem: FitProblem, values: Evaluation | SteadyNet, printed: FloatArray
) -> FitProblem:
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


def shipped_point(parameter_map: ParameterMap) -> FloatArray:
    """Return the free quantities of the shipped machine, with its gasket alike in x and z.

    Args:
        parameter_map: That of a vary file of the net. A quantity that the file of the shipped
            machine does not have is at its expected value, as the numbers of another damper law.

    Returns:
        (quantity,) [SI]
    """
    shipped = parameter_map_of(build_machine(load_machine(REFERENCE)), load_vary(FREE))
    values = dict(zip(shipped.names, shipped.start.tolist(), strict=True))
    values["gasket_vertical"] = values["gasket_radial"]
    pairs = zip(parameter_map.names, parameter_map.expected.tolist(), strict=True)
    return np.array([values.get(name, expected) for name, expected in pairs])


def _report(evaluations: int, least: float) -> None:
    print(f"{evaluations} evaluations, misfit {least:.3g}", file=sys.stderr, flush=True)


def quantities_of(parameter_map: ParameterMap, point: FloatArray) -> pd.DataFrame:
    """Return the free quantities of a machine with bounds and expected values, in their units."""
    m = parameter_map
    columns = {"value": point, "lower": m.lower, "upper": m.upper, "expected": m.expected}
    in_units = {name: m.in_units(column) for name, column in columns.items()}
    units = [unknown.unit.shown for unknown in m.unknowns]
    return pd.DataFrame({"quantity": m.names, **in_units, "unit": units})


def point_of(parameter_map: ParameterMap, table: pd.DataFrame) -> FloatArray:
    """Return the free quantities of a table of `quantities_of`. (quantity,) [SI]"""
    sizes = [unknown.unit.from_si(1.0) for unknown in parameter_map.unknowns]
    return np.asarray(table.set_index("quantity").value[parameter_map.names] / sizes)
