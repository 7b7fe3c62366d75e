"""Which design gives the most information about the gasket for its number of runs?

The designs are D-optimal with 1000 trials, orthogonal with 243 and 729, random with 1000, and the
full factorial with 6561. The full factorial is run once for both loads. Every design is a part of
it, so the contributions that follow from a design are compared with those of the full factorial,
term by term. The script prints one line per design with its largest errors. The time of a line
includes making the design, its runs, and its analysis. The script takes about three minutes.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

import wm_drake as wm
from wm_drake.parameters import SpinProfile
from wm_drake.studies.doe.design import Design
from wm_drake.studies.gasket.study import LOADS

SMALLEST_SHARE = 0.01
"""Smallest contribution to a response of the full factorial with which a term is compared."""


def designs(names: tuple[str, ...], trials: int) -> dict[str, tuple[Design, float]]:
    """Return the designs by name, with the time that it took to make each. [s]"""
    full = wm.make_design("full", names)
    rows = np.sort(np.random.default_rng(0).choice(full.trials, trials, replace=False))
    makers = {
        f"D-optimal {trials}": lambda: wm.make_design("d-optimal", names, trials=trials),
        "orthogonal 243": lambda: wm.make_design("orthogonal", names, trials=243),
        "orthogonal 729": lambda: wm.make_design("orthogonal", names, trials=729),
        f"random {trials}": lambda: Design("random", names, full.levels[rows], full.model),
        f"full {full.trials}": lambda: full,
    }
    made = {}
    for name, make in makers.items():
        begin = time.perf_counter()
        made[name] = (make(), time.perf_counter() - begin)
    return made


def part_of(full: xr.Dataset, design: Design) -> xr.Dataset:
    """Return the responses of a design, taken from the runs of the full factorial."""
    places = (design.levels.astype(int) + 1) @ 3 ** np.arange(len(design.factors) - 1, -1, -1)
    return full.isel(trial=places)


def main() -> None:
    """Run the full factorial and print one line per design."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="use five factors and runs of 2 s")
    parser.add_argument("--out", type=Path, help="also write the table to this file")
    arguments = parser.parse_args()
    machine, names, trials = wm.load_machine("reference"), (), 1000
    if arguments.quick:
        profile = SpinProfile(time=(0.0, 2.0), speed=(0.0, 9.0))
        machine = wm.with_value(machine, "profile", profile)
        names, trials = ("C_L", "C_T", "K_Lx", "K_Ly", "K_Lz"), 100
    factors = wm.factors(machine, names, tables="linear")
    made = designs(factors.names, trials)
    *_, (full, _) = made.values()
    begin = time.perf_counter()
    with wm.progress_bar(full.trials * len(LOADS)) as progress:
        whole = wm.run_trials(factors, full, LOADS, ("D", "F", "M"), progress=progress)
    each_s = (time.perf_counter() - begin) / full.trials
    reference, rows = wm.anova(whole).table.share, []
    for name, (design, made_s) in made.items():
        begin = time.perf_counter()
        part = replace(whole, design=design, runs=part_of(whole.runs, design))
        error = np.abs(wm.anova(part).table.share - reference)
        largest = 100.0 * error.where(reference > SMALLEST_SHARE).max(["response", "term"])
        seconds = made_s + design.trials * each_s + time.perf_counter() - begin
        errors = {f"largest error, {load}": largest.sel(load=load).item() for load in LOADS}
        efficiency = design.efficiency()
        rows.append(
            {
                "design": name,
                "runs": design.trials * len(LOADS),
                "s": seconds,
                "D-efficiency, %": efficiency,
            }
            | errors
        )
    text = pd.DataFrame(rows).round(2).to_string(index=False)
    smallest = 100.0 * SMALLEST_SHARE
    print(f"contributions above {smallest:g} %, largest error in percentage points\n{text}")
    if arguments.out:
        arguments.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
