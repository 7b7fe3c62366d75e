"""Where does least squares end from the best machines of search_basins.py?

All free quantities of reference_net.yaml and reference_free.yaml are fitted to the targets of
calibrate_reference.py and to the twelve changes by the gasket of [B] Table 1. The first fits go by
the steady motion, since one by runs takes minutes an iteration. The ends with the least cost by
runs are fitted by runs. The script prints what each machine reaches beside the goals and the
shipped machine, and writes the free quantities to a CSV file for each start. Evaluations by runs
are kept in a ledger, ends by steady motion in the CSV files; a second call goes on.

    python analyses/fit_basins.py --net net.sqlite --out fits.md
"""

import argparse
import sys
from functools import cache
from pathlib import Path

import pandas as pd
from analysis_tools import validation_page as page
from analysis_tools.goals import GOALS, goals_of
from analysis_tools.machine_fit import FitByRuns, point_of, quantities_of, steady_end
from analysis_tools.machine_net import free_of_net, machine_of_net
from analysis_tools.net_ledger import Name, TwoStages, best_by_runs, identity_of, law_of
from calibrate_reference import REFERENCE

from wm_drake.batch.ledger import open_ledger
from wm_drake.parameters import load_machine
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibrate.parameter_map import parameter_map_of

STEADY_ITERATIONS = 40
"""Limit of iterations by the steady motion."""


def main() -> None:
    """Fit from the best machines of the net, and print a table."""
    arguments = _arguments()
    reference = load_machine(REFERENCE)
    columns = {"goal": GOALS, REFERENCE: goals_of(reference, reference)}
    if not arguments.quick:
        ends = _steady_ends(arguments)
        costs = _costs(arguments.out, ends)
        print(f"costs by runs: {costs}", file=sys.stderr)
        for name in sorted(costs, key=lambda name: costs[name])[: arguments.starts]:
            columns[f"{_words(name)} {law_of(name[0])}"] = _fitted(arguments, name, ends[name])
    rows = [[goal, *(column[goal] for column in columns.values())] for goal in GOALS]
    text = page.table_text("Machines from the net", ["", *columns], rows)
    print(text)
    page.write(text, arguments.out, None)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="show the shipped machine alone")
    parser.add_argument("--net", type=Path, default=Path("search_basins.sqlite"))
    parser.add_argument("--seed", type=int, default=0, help="seed of the net")
    parser.add_argument("--steady", type=int, default=40, help="fits by the steady motion")
    parser.add_argument("--starts", type=int, default=12, help="fits by runs")
    parser.add_argument("--iterations", type=int, default=30, help="limit of a fit by runs")
    parser.add_argument("--out", type=Path, default=Path("fit_basins.md"))
    return parser.parse_args()


def _steady_ends(arguments: argparse.Namespace) -> dict[Name, FloatArray]:
    """Return where fits by the steady motion end, from the best machines of the net."""
    ends = {}
    with open_ledger(arguments.net, identity_of(arguments.seed), resume=True) as ledger:
        stages = TwoStages(ledger, arguments.seed)
        for name, start in best_by_runs(stages)[: arguments.steady]:
            path, steady = _file(arguments, name, "steady"), stages.nets(law_of(name[0])).steady
            known = steady.parameter_map
            if path.exists():
                ends[name] = point_of(known, pd.read_csv(path))
            else:
                ends[name] = steady_end(steady, start, STEADY_ITERATIONS)
                quantities_of(known, ends[name]).to_csv(path, index=False)
                print(f"{len(ends)} fits by the steady motion", file=sys.stderr, flush=True)
    return ends


def _costs(out: Path, ends: dict[Name, FloatArray]) -> dict[Name, float]:
    """Return the cost of each end by runs."""
    return {
        name: float(_fit_of(out, law_of(name[0])).costs(end[None])[0]) for name, end in ends.items()
    }


@cache
def _fit_of(out: Path, law: str) -> FitByRuns:
    ledger_path = out.with_name(f"{out.stem}_{law}.sqlite")
    return FitByRuns(machine_of_net(law), free_of_net(law), ledger_path)


def _words(name: Name) -> str:
    return f"{name[0]}.{name[1]}"


def _file(arguments: argparse.Namespace, name: Name, kind: str) -> Path:
    return arguments.out.with_name(f"{arguments.out.stem}_{kind}_{_words(name)}.csv")


def _fitted(arguments: argparse.Namespace, name: Name, start: FloatArray) -> dict[str, str]:
    """Fit by runs, write the free quantities, and return what the machine reaches."""
    fit = _fit_of(arguments.out, law_of(name[0]))
    point = fit.end(start, arguments.iterations) if arguments.iterations else start
    known = parameter_map_of(fit.machine, fit.free)
    quantities_of(known, point).to_csv(_file(arguments, name, "runs"), index=False)
    return goals_of(known.parameters_at(point), load_machine(REFERENCE))


if __name__ == "__main__":
    main()
