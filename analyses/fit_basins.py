"""Where does least squares end from the best machines of search_basins.py?

From each start the script fits all free quantities of reference_net.yaml and reference_free.yaml to
the targets of calibrate_reference.py and to the twelve changes by the gasket of [B] Table 1. It
prints what each machine reaches beside the goals and the shipped machine, and writes the free
quantities to a CSV file for each start. Evaluations are kept in a ledger; a second call goes on.

    python analyses/fit_basins.py --net net.sqlite --out fits.md
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from analysis_tools import validation_page as page
from analysis_tools.goals import GOALS, changes_of, goals_of, printed_changes
from analysis_tools.machine_net import free_of_net, machine_of_net
from calibrate_reference import ADAMS_PLAN, REFERENCE, adams_targets
from search_basins import block_of, identity_of, law_of, ranked

from wm_drake.batch.ledger import open_ledger
from wm_drake.parameters import load_machine
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibrate.computed import Evaluation, PointRunner
from wm_drake.studies.calibrate.parameter_map import ParameterMap, parameter_map_of
from wm_drake.studies.calibrate.study import calibration_problem
from wm_drake.studies.calibrate.study import identity_of as identity_of_fit
from wm_drake.studies.fitting.kinks import least_squares_search
from wm_drake.studies.fitting.problem import PriorProblem, Residuals
from wm_drake.studies.fitting.search import Search

CHANGE_DEVIATION = 0.06
"""Standard deviation of a change by the gasket, of the logarithm of its ratio."""

ITERATIONS = 30


def main() -> None:
    """Fit from the best machines of the net, and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="show the shipped machine alone")
    parser.add_argument("--net", type=Path, default=Path("search_basins.sqlite"))
    parser.add_argument("--seed", type=int, default=0, help="seed of the net")
    parser.add_argument("--starts", type=int, default=12)
    parser.add_argument("--first", type=int, default=0, help="rank of the first start")
    parser.add_argument("--iterations", type=int, default=ITERATIONS)
    parser.add_argument("--out", type=Path, default=Path("fit_basins.md"))
    arguments = parser.parse_args()
    reference = load_machine(REFERENCE)
    columns = {"goal": GOALS, REFERENCE: goals_of(reference, reference)}
    if not arguments.quick:
        with open_ledger(arguments.net, identity_of(arguments.seed), resume=True) as net:
            best = ranked(net, arguments.seed)[arguments.first :][: arguments.starts]
            starts = [
                (number, place, block_of(net, arguments.seed, number).points[place])
                for _, number, place in best
            ]
        for number, place, start in starts:
            name = f"{number}.{place} {law_of(number)}"
            columns[name] = _fitted(arguments, law_of(number), f"{number}.{place}", start)
    rows = [[goal, *(column[goal] for column in columns.values())] for goal in GOALS]
    text = page.table_text("Machines from the net", ["", *columns], rows)
    print(text)
    page.write(text, arguments.out, None)


def _fitted(
    arguments: argparse.Namespace, law: str, name: str, start: FloatArray
) -> dict[str, str]:
    """Fit from a start, write the free quantities, and return what the machine reaches."""
    machine, free, reference = machine_of_net(law), free_of_net(law), load_machine(REFERENCE)
    targets = adams_targets(reference)
    parameter_map = parameter_map_of(machine, free)
    identity = identity_of_fit(machine, free, targets, ADAMS_PLAN)
    path = arguments.out.with_name(f"{arguments.out.stem}_{law}.sqlite")
    with open_ledger(path, identity, resume=True) as ledger:
        values = PointRunner(machine, ledger, workers=1).values(parameter_map, targets)
        problem = _with_changes(
            calibration_problem(values, replace(ADAMS_PLAN, starts=1)),
            values,
            printed_changes(reference, targets),
        )
        search = Search(problem, _reporter(name))
        begin = problem.coordinates_of(start)
        end = least_squares_search(search, begin, arguments.iterations)
        point = problem.points_at(end.point)
    table = _quantities(parameter_map, point)
    table.to_csv(arguments.out.with_name(f"{arguments.out.stem}_{name}.csv"), index=False)
    return goals_of(parameter_map.parameters_at(point), reference)


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


def _reporter(name: str) -> Callable[[int, float], None]:
    def report(evaluations: int, least: float) -> None:
        print(f"{name}: {evaluations} evaluations, cost {least:.0f}", file=sys.stderr, flush=True)

    return report


def _quantities(parameter_map: ParameterMap, point: FloatArray) -> pd.DataFrame:
    """Return the free quantities of a machine with bounds and expected values, in their units."""
    m = parameter_map
    columns = {"value": point, "lower": m.lower, "upper": m.upper, "expected": m.expected}
    in_units = {name: m.in_units(column) for name, column in columns.items()}
    return pd.DataFrame({"quantity": m.names, **in_units, "unit": m.units})


if __name__ == "__main__":
    main()
