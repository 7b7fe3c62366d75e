"""Where does least squares end from the best machines of search_basins.py?

All free quantities of reference_net.yaml and reference_free.yaml are fitted to the targets of
calibrate_reference.py and to the twelve changes by the gasket of [B] Table 1. The first fits go by
the steady motion, since one by runs takes minutes an iteration. The ends with the least cost by
runs are fitted by runs, and so is the shipped machine, whose gasket moves to that of a ring there.
Runs of fits are those of the net, with steps of 5 ms. The script prints what each machine reaches
at the default step beside the goals and the shipped machine, and writes the free quantities to a
CSV file for each start. Evaluations by runs are kept in a ledger, ends by steady motion in the CSV
files; a second call goes on.

    python analyses/fit_basins.py --net net.sqlite --out fits.md
"""

import argparse
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from analysis_tools import validation_page as page
from analysis_tools.goals import GOALS, goals_of
from analysis_tools.machine_fit import (
    FitByRuns,
    point_of,
    quantities_of,
    shipped_point,
    steady_end,
)
from analysis_tools.machine_net import LAWS, SHORT, free_of_net, machine_of_net
from analysis_tools.net_ledger import TwoStages, best_by_runs, identity_of, law_of
from calibrate_reference import REFERENCE

from wm_drake.batch.ledger import open_ledger
from wm_drake.parameters import load_machine
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibrate.parameter_map import parameter_map_of

SPONGE = "reference_sponge"
"""Shipped machine that this script has found, with a friction sponge."""

STEADY_ITERATIONS = 40
"""Limit of iterations by the steady motion."""


class Begin(NamedTuple):
    """Where a fit by runs begins.

    Attributes:
        words: Number of the machine in the net, or "shipped".
        law: Damper law.
        point: Free quantities. (quantity,) [SI]
    """

    words: str
    law: str
    point: FloatArray


def main() -> None:
    """Fit from the best machines of the net and from the shipped one, and print a table."""
    arguments = _arguments()
    reference = load_machine(REFERENCE)
    columns = {"goal": GOALS, REFERENCE: goals_of(reference, reference)}
    columns[SPONGE] = goals_of(load_machine(SPONGE), reference)
    if not arguments.quick:
        for begin in [*_shipped(arguments), *_best_ends(arguments)]:
            columns[f"{begin.words}, `{begin.law}`"] = _fitted(arguments, begin)
    rows = [[goal, *(column[goal] for column in columns.values())] for goal in GOALS]
    text = page.table_text("Machines from the net", ["", *columns], rows)
    print(text)
    page.write(text, arguments.out, None)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="show the shipped machines alone")
    parser.add_argument("--net", type=Path, default=Path("search_basins.sqlite"))
    parser.add_argument("--seed", type=int, default=0, help="seed of the net")
    parser.add_argument("--steady", type=int, default=40, help="fits by the steady motion")
    parser.add_argument(
        "--also", nargs="*", default=[], metavar="MACHINE", help="fit from these, such as 223.75"
    )
    parser.add_argument("--starts", type=int, default=12, help="fits by runs from their ends")
    parser.add_argument(
        "--shipped",
        nargs="*",
        choices=LAWS,
        default=["havsin", "free_stroke"],
        help="damper laws of fits by runs from the shipped machine",
    )
    parser.add_argument("--iterations", type=int, default=30, help="limit of a fit by runs")
    parser.add_argument("--out", type=Path, default=Path("fit_basins.md"))
    return parser.parse_args()


def _shipped(arguments: argparse.Namespace) -> list[Begin]:
    return [
        Begin(
            "shipped", law, shipped_point(parameter_map_of(machine_of_net(law), free_of_net(law)))
        )
        for law in arguments.shipped
    ]


def _best_ends(arguments: argparse.Namespace) -> list[Begin]:
    """Return the ends of fits by the steady motion with the least cost by runs."""
    costs = {}
    for end in _steady_ends(arguments) if arguments.starts else ():
        cost = _fit_of(arguments.out, end.law).costs(end.point[None])[0]
        costs[end.words] = float(cost), end
    shown = {words: round(cost, 2) for words, (cost, _) in costs.items()}
    print(f"costs by runs: {shown}", file=sys.stderr, flush=True)
    order = sorted(costs.values(), key=lambda of: of[0])
    return [end for _, end in order[: arguments.starts]]


def _steady_ends(arguments: argparse.Namespace) -> list[Begin]:
    """Return where fits by the steady motion end, from the best machines of the net."""
    ends: list[Begin] = []
    with open_ledger(arguments.net, identity_of(arguments.seed), resume=True) as ledger:
        stages = TwoStages(ledger, arguments.seed)
        best = {f"{block}.{place}": of for (block, place), of in best_by_runs(stages)}
        for words in dict.fromkeys([*arguments.also, *list(best)[: arguments.steady]]):
            start, law = best[words], law_of(int(words.split(".")[0]))
            path, steady = _file(arguments, words, "steady"), stages.nets(law).steady
            known = steady.parameter_map
            if path.exists():
                point = point_of(known, pd.read_csv(path))
            else:
                point = steady_end(steady, start, STEADY_ITERATIONS)
                quantities_of(known, point).to_csv(path, index=False)
                print(f"{len(ends) + 1} fits by the steady motion", file=sys.stderr, flush=True)
            ends.append(Begin(words, law, point))
    return ends


@cache
def _fit_of(out: Path, law: str) -> FitByRuns:
    ledger_path = out.with_name(f"{out.stem}_{law}.sqlite")
    return FitByRuns(machine_of_net(law, SHORT), free_of_net(law), ledger_path)


def _file(arguments: argparse.Namespace, words: str, kind: str) -> Path:
    return arguments.out.with_name(f"{arguments.out.stem}_{kind}_{words}.csv")


def _fitted(arguments: argparse.Namespace, begin: Begin) -> dict[str, str]:
    """Fit by runs, write the free quantities, and return what the machine reaches."""
    fit = _fit_of(arguments.out, begin.law)
    point = fit.end(begin.point, arguments.iterations) if arguments.iterations else begin.point
    known = parameter_map_of(machine_of_net(begin.law), fit.free)
    words = f"{begin.words}_{begin.law}"
    quantities_of(known, point).to_csv(_file(arguments, words, "runs"), index=False)
    return goals_of(known.parameters_at(point), load_machine(REFERENCE))


if __name__ == "__main__":
    main()
