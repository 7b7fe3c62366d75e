"""Which search finds the gasket's Pareto front with fewer runs?

NSGA-II and the search with response surfaces start from the same first population of the shipped
design file gasket (eight factors of [B], two objectives, one constraint, two loads), for several
seeds. The script prints the hypervolume over the number of evaluated designs: median, smallest and
largest of the seeds, scaled so that the first population reaches from 0 to 1. It also prints the
processor time of each search without its runs.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from wm_drake import build_machine, load_machine, progress_bar
from wm_drake.parameters import SpinProfile, load_vary, varying
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.studies.design.problem import MachineDesigns, machine_designs
from wm_drake.studies.design.search import DesignProblem, SearchResult, SearchSettings
from wm_drake.studies.design.study import SEARCHES
from wm_drake.studies.experiment import Experiment


def searched(
    designs: MachineDesigns, costs: Callable[..., object], evaluations: int, seed: int, name: str
) -> tuple[SearchResult, float]:
    """Return what a search finds, and its processor time without the runs. [s]"""
    running = 0.0

    def evaluate(x: FloatArray) -> object:
        nonlocal running
        begin = time.process_time()
        result = costs(x)
        running += time.process_time() - begin
        return result

    begin = time.process_time()
    goals, limits = len(designs.objectives), len(designs.constraints)
    problem = DesignProblem(evaluate, designs.nominal(), goals, limits)
    result = SEARCHES[name](problem, SearchSettings(evaluations, min(64, evaluations), seed))
    return result, time.process_time() - begin - running


def main() -> None:
    """Search with both methods and print one line per number of designs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one seed, runs of 2 s")
    parser.add_argument("--out", type=Path, help="also write the table to this file")
    parser.add_argument("--evaluations", type=int, default=1024)
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    parameters, file = load_machine("reference"), load_vary("gasket")
    profile, count, seeds = parameters.profile, arguments.evaluations, arguments.seeds
    if arguments.quick:
        profile, count, seeds = SpinProfile(time=(0.0, 2.0), speed=(0.0, 9.0)), 96, 1
    loads = [Case(name, parameters.loads[name], profile) for name in file.loads]
    designs = machine_designs(varying(parameters, file.entries()), file, loads)
    experiment = Experiment(build_machine(parameters), ("extremes", "gap"))
    rows = []
    with progress_bar(len(SEARCHES) * seeds * count) as progress:
        done = 0

        def costs(x: FloatArray) -> object:
            nonlocal done
            result = designs.costs(x, experiment)
            done += len(x)
            progress(done)
            return result

        for name in SEARCHES:
            for seed in range(seeds):
                result, search_s = searched(designs, costs, count, seed, name)
                rows += [
                    {"search": name, "seed": seed, "designs": n, "volume": v, "search_s": search_s}
                    for n, v in result.history
                ]
    table = pd.DataFrame(rows)
    marks = [n for n in 64 * 2 ** np.arange(8) if n <= count] or [count]
    shown = table[table.designs.isin(marks)].groupby(["designs", "search"]).volume
    text = shown.agg(["median", "min", "max"]).unstack("search").round(4).to_string()
    each = table.groupby("search").search_s.mean().round(1).to_dict()
    text = f"hypervolume over designs, {seeds} seeds\n{text}\nsearch without runs, s: {each}"
    print(text)
    if arguments.out:
        arguments.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
