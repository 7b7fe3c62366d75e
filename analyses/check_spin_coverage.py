"""Do the 95 % intervals of an identification from the spin cycle contain the planted values?

For each seed the script plants the six numbers of [A] Table 8 in `free_stroke`, adds the noise of
`wm-drake study spin-identify`, and identifies them from its three cases, over a spin cycle that is
four times as fast by default. It counts how often each number is determined and how often its
interval contains the planted value. Fits are kept in a ledger; a second call goes on.

    python analyses/check_spin_coverage.py --ledger coverage.sqlite
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from analysis_tools import validation_page as page
from analysis_tools.spin_profiles import faster_profile

from wm_drake.batch import sources_version
from wm_drake.batch.ledger import LedgerEntry, key_of, open_ledger
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, load_profile
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.unbalance_cases import load_unbalance_cases
from wm_drake.studies.calibrate.blocks import calibrated
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.spin_identify.options import SpinIdentifyOptions
from wm_drake.studies.spin_identify.study import (
    SpinModel,
    planted_values,
    spin_model,
    unknowns_of,
    with_virtual_experiment,
)
from wm_drake.studies.spin_identify.task import DEFAULT_CASES

QUICK = ("gasket.rotational_stiffness_y",)
"""Unknown of --quick."""


def main() -> None:
    """Identify planted numbers and print the coverage."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="one seed, one unknown, one case")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--faster", type=float, default=4.0, help="factor of the spin cycle")
    parser.add_argument("--ledger", type=Path, default=Path("check_spin_coverage.sqlite"))
    parser.add_argument("--out", type=Path, help="also write the result to this file")
    arguments = parser.parse_args()
    model = _model(16.0 if arguments.quick else arguments.faster, quick=arguments.quick)
    identity = {"study": "coverage of spin-identify", "sources": sources_version()}
    rows: list[FloatArray] = []
    with open_ledger(arguments.ledger, identity, resume=True) as ledger:
        for seed in range(1 if arguments.quick else arguments.seeds):
            key = key_of(
                seed=seed,
                unknowns=[one.keys for one in model.free.varying.every],
                profile=model.profile,
            )
            if key not in ledger:
                ledger.put_all({key: LedgerEntry({"row": _identified(model, seed)})})
                print(f"seed {seed}", file=sys.stderr, flush=True)
            rows.append(ledger.get(key).values["row"])
    text = _table([unknown.name for unknown in model.unknowns], np.array(rows))
    print(text)
    page.write(text, arguments.out, None)


def _model(faster: float, *, quick: bool) -> SpinModel:
    machine = build_machine(load_machine("free_stroke"))
    parameters = machine.parameters
    names = DEFAULT_CASES[:1] if quick else DEFAULT_CASES
    cases = tuple(case for case in load_unbalance_cases() if case.name in names)
    free = unknowns_of(parameters, QUICK if quick else ())
    experiment = Experiment(machine, ("regions",))
    profile = faster_profile(load_profile("spin_cycle"), faster)
    return spin_model(experiment, free, profile, cases)


def _identified(model: SpinModel, seed: int) -> FloatArray:
    """Return planted value, estimate, and ends of its interval, NaN without one. (unknown, 4)"""
    planted = planted_values(model.free, seed)
    noise = SpinIdentifyOptions.model_fields["noise"].default
    fit, _ = calibrated(with_virtual_experiment(model, planted, noise, seed), seed, starts=1)
    rows = zip(planted, fit.estimates, strict=True)
    return np.array([[true, e.value, e.lower, e.upper] for true, e in rows])


def _table(names: list[str], rows: FloatArray) -> str:
    """Return the coverage as a table; `rows` (seed, unknown, 4) from `_identified`."""
    true, value, lower, upper = np.moveaxis(rows, -1, 0)
    determined = np.isfinite(lower)
    holds = determined & (lower <= true) & (true <= upper)
    lines = []
    for k, name in enumerate(names):
        half = 50.0 * (upper - lower)[:, k] / np.abs(value[:, k])
        off = 100.0 * np.abs(value / true - 1.0)[:, k]
        known = determined[:, k]
        width = f"{np.median(half[known]):.2g} %" if known.any() else "none"
        counts = [f"{known.sum()} of {len(known)}", f"{holds[:, k].sum()} of {known.sum()}"]
        lines.append([f"`{name}`", *counts, width, f"{np.median(off):.2g} %", f"{off.max():.2g} %"])
    total = f"{holds.sum()} of {determined.sum()} intervals contain the planted value"
    heads = ["unknown", "determined", "interval contains it", "median half-width", "median error"]
    return page.table_text(total, [*heads, "largest error"], lines)


if __name__ == "__main__":
    main()
