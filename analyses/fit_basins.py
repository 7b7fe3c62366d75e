"""Where does least squares end from the best machines of search_basins.py?

From each start the script fits all free quantities of reference_net.yaml and reference_free.yaml to
the targets of calibrate_reference.py and to the twelve changes by the gasket of [B] Table 1. It
prints what each machine reaches beside the goals and the shipped machine, and writes the free
quantities to a CSV file for each start. Evaluations are kept in a ledger; a second call goes on.

    python analyses/fit_basins.py --net net.sqlite --out fits.md
"""

import argparse
from pathlib import Path

from analysis_tools import validation_page as page
from analysis_tools.goals import GOALS, goals_of
from analysis_tools.machine_fit import fitted_point, quantities_of
from analysis_tools.machine_net import free_of_net, machine_of_net
from analysis_tools.net_ledger import block_of, identity_of, law_of, ranked
from calibrate_reference import REFERENCE

from wm_drake.batch.ledger import open_ledger
from wm_drake.parameters import load_machine
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibrate.parameter_map import parameter_map_of

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
            starts = {
                (number, place): block_of(net, arguments.seed, number).points[place]
                for _, number, place in best
            }
        for (number, place), start in starts.items():
            law, name = law_of(number), f"{number}.{place}"
            columns[f"{name} {law}"] = _fitted(arguments, law, name, start)
    rows = [[goal, *(column[goal] for column in columns.values())] for goal in GOALS]
    text = page.table_text("Machines from the net", ["", *columns], rows)
    print(text)
    page.write(text, arguments.out, None)


def _fitted(
    arguments: argparse.Namespace, law: str, name: str, start: FloatArray
) -> dict[str, str]:
    """Fit from a start, write the free quantities, and return what the machine reaches."""
    machine, free = machine_of_net(law), free_of_net(law)
    stem = arguments.out.stem
    ledger_path = arguments.out.with_name(f"{stem}_{law}.sqlite")
    point = fitted_point(machine, free, start, arguments.iterations, ledger_path)
    parameter_map = parameter_map_of(machine, free)
    table = quantities_of(parameter_map, point)
    table.to_csv(arguments.out.with_name(f"{stem}_{name}.csv"), index=False)
    return goals_of(parameter_map.parameters_at(point), load_machine(REFERENCE))


if __name__ == "__main__":
    main()
