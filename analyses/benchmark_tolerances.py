"""What does a run of a tolerance or design study cost, beside the run itself?

The script prepares and runs samples of the shipped files laundry (seven quantities of the load) and
laundry_and_parts (twelve quantities), and designs of the shipped file gasket. It prints the
processor time of each part in ms per run: the sample, its preparation, its run with only D, F and
M, and its run with all measures of the study. The last columns are the processor time of all runs
of the study at its full size, and the least time on two cores. Other programs change
processor times less than times on the clock.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wm_drake import build_machine, load_machine
from wm_drake.batch.runs import Runner
from wm_drake.batch.work_items import Preparation
from wm_drake.model.machine import Machine
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.designs import load_design
from wm_drake.parameters.tolerances import load_tolerances
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import checked_integrator, checked_step
from wm_drake.studies.pareto.problem import machine_designs
from wm_drake.studies.pareto.search import first_population
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studies.tolerance.variables import uncertain_machine

SIZES = {"laundry": 2 * 8192, "laundry_and_parts": 1024 * 14, "gasket": 2 * 5000}
"""Runs of each study at its full size."""

MEASURES = ("extremes", "amplitudes", "gap", "contacts", "mounts", "spring tensions")
"""Measures of a tolerance study that names none."""


def timed(work: Callable[[], Any], runs: int) -> tuple[Any, float]:
    """Return what a function returns, and its processor time. [ms per run]"""
    begin = time.process_time()
    found = work()
    return found, 1e3 * (time.process_time() - begin) / runs


def measured(
    machine: Machine, make: Callable[[], Sequence[Case]], measures: tuple[str, ...], full: int
) -> dict[str, float]:
    """Return the times of the parts of a study. [ms per run, s]"""
    runs = len(make())  # compiles and fills caches
    step = checked_step(machine.parameters, None)
    integrator = checked_integrator(machine.parameters, None)
    for _ in range(2):  # the first pass compiles
        cases, sample = timed(make, runs)
        preparation = Preparation(machine, step, integrator)
        batches, prepared = timed(lambda: list(preparation.batches(cases)), runs)  # noqa: B023
        times = []
        for names in (("extremes",), measures):
            runner = Runner(machine.parameters, names, histories=False)
            runner.run(*batches[0])
            times.append(timed(lambda: [runner.run(*batch) for batch in batches], runs)[1])  # noqa: B023
    total = 1e-3 * full * (sample + prepared + times[1])
    names = ("sample", "prepare", "run", "run and measure", "all runs, s", "on 2 cores, s")
    return dict(zip(names, (sample, prepared, *times, total, 0.5 * total), strict=True))


def main() -> None:
    """Measure the three studies and print one line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="runs of 2 s, 16 of each study")
    parser.add_argument("--out", type=Path, help="also write the table to this file")
    arguments = parser.parse_args()
    reference, count = load_machine("reference"), 512
    profile = reference.profile
    if arguments.quick:
        profile, count = SpinProfile(time=(0.0, 2.0), speed=(0.0, 9.0)), 16
    rows = {}
    for name in ("laundry", "laundry_and_parts"):
        case = Case("laundry", next(iter(reference.loads.values())), profile)
        uncertain = uncertain_machine(reference, load_tolerances(name), case)
        scores, _ = base_samples(uncertain.joint.size, count, 0)
        machine = build_machine(uncertain.parameters)
        rows[name] = measured(
            machine,
            lambda: uncertain.cases(scores),  # noqa: B023
            MEASURES,
            SIZES[name],
        )
    task = load_design("gasket")
    cases = [Case(load, reference.loads[load], profile) for load in task.loads]
    designs = machine_designs(reference, task, cases)
    points = first_population(designs.nominal(), count // 2, 0)

    def of_designs() -> list[Case]:
        return [c for x in points for c in designs.runs_of(designs.machine_at(np.asarray(x)), "d")]

    rows["gasket"] = measured(
        build_machine(reference), of_designs, ("extremes", "gap"), SIZES["gasket"]
    )
    text = pd.DataFrame(rows).T.round(2).to_string()
    print(f"processor time, ms per run\n{text}")
    if arguments.out:
        arguments.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
