"""Do the 95 % intervals of a calibration contain planted values, and do the default starts suffice?

For each seed the script draws a machine from the priors of four quantities of the reference
machine, computes its amplitudes with four loads, multiplies them by a noise of 5 %, the deviation
that a calibration assumes, and calibrates with the default number of starts. It counts how often
the interval of each quantity contains the planted value, and how often a start ends in a minimum
worse than the best one.

    python analyses/check_coverage.py
"""

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from analysis_tools.ledgers import calibration_identity, kept_in

from wm_drake.batch.ledger import open_ledger
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import load_machine
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.vary_file import VaryFile, load_vary
from wm_drake.studies.calibrate.computed import Evaluation
from wm_drake.studies.calibrate.options import CalibrateOptions
from wm_drake.studies.calibrate.parameter_map import ParameterMap, parameter_map_of
from wm_drake.studies.calibrate.study import Calibration, SearchPlan, calibrate
from wm_drake.studies.calibrate.targets import Targets
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.tolerance.shares import share_of

LOADS = tuple((name, True) for name in ("middle", "counter", "back", "front"))
QUANTITIES = ("spring_stiffness", "damper_friction", "damper_lean", "gasket_radial")
NOISE = 0.05
Z = 1.96
"""Half width of a 95 % interval, in standard deviations."""
WORSE = 0.5
"""Difference of the cost above which a start counts as ended in another minimum."""


def main() -> None:
    """Calibrate to planted machines and print the coverage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one seed and one start")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--out", type=Path, help="also write the result to this file")
    arguments = parser.parse_args()
    starts = 1 if arguments.quick else CalibrateOptions.model_fields["starts"].default
    seeds = range(1 if arguments.quick else arguments.seeds)
    machine = build_machine(load_machine("reference"))
    free = _few(load_vary(Path(__file__).with_name("reference_free.yaml")))
    parameter_map = parameter_map_of(machine, free)
    inside, worse = [], []
    for seed in seeds:
        truth, targets = _planted(machine, parameter_map, seed)
        calibration = _calibrated(machine, free, targets, SearchPlan(starts=starts, seed=seed))
        best = calibration.solutions[0]
        spread = best.fit.remaining * parameter_map.deviation
        inside.append(np.abs(best.point - truth) <= Z * spread)
        costs = np.array([end.cost for end in calibration.ended])
        worse.append(np.mean(costs > best.cost + WORSE))
        print(f"seed {seed}: {int(inside[-1].sum())} of {len(QUANTITIES)}", file=sys.stderr)
    lines = []
    for name, hits in zip(parameter_map.names, np.transpose(inside), strict=True):
        share = share_of(hits)
        lines.append(
            f"{name}: {hits.sum()} of {len(hits)} intervals hold the planted value; probability "
            f"{100 * share.lower:.0f} to {100 * share.upper:.0f} %"
        )
    share = 100.0 * np.mean(inside)
    lines.append(f"all: {np.sum(inside)} of {np.size(inside)}, {share:.0f} %")
    lines.append(f"starts that end in a worse minimum: {100.0 * np.mean(worse):.0f} %")
    text = "\n".join(lines)
    print(text)
    if arguments.out:
        arguments.out.write_text(text + "\n", encoding="utf-8")


def _few(free: VaryFile) -> VaryFile:
    """Return a vary file of `QUANTITIES`, each searched from its expected value."""
    quantities = {name: free.vary[name].model_copy(update={"start": None}) for name in QUANTITIES}
    return VaryFile(vary=quantities)


def _planted(
    machine: Machine, parameter_map: ParameterMap, seed: int
) -> tuple[FloatArray, Targets]:
    """Return a machine drawn from the priors, within the bounds, and its noisy amplitudes."""
    rng = np.random.default_rng(seed)
    drawn = parameter_map.expected + parameter_map.deviation * rng.normal(size=len(QUANTITIES))
    margin = 0.02 * (parameter_map.upper - parameter_map.lower)
    truth = np.clip(drawn, parameter_map.lower + margin, parameter_map.upper - margin)
    sensors = tuple(machine.parameters.sensors)
    ones = np.ones((len(LOADS), len(sensors)))
    targets = Targets(LOADS, sensors, ones, ones)
    exact = Evaluation(Experiment(machine, ()), parameter_map, targets)(truth[None]).amplitude[0]
    return truth, replace(targets, amplitude=exact * np.exp(NOISE * rng.normal(size=ones.shape)))


def _calibrated(
    machine: Machine, free: VaryFile, targets: Targets, plan: SearchPlan
) -> Calibration:
    with tempfile.TemporaryDirectory() as folder:
        identity = calibration_identity(machine, free, targets, plan)
        with open_ledger(Path(folder) / "ledger.sqlite", identity) as ledger:
            return calibrate(Experiment(machine, (), kept_in(ledger)), free, targets, plan)


if __name__ == "__main__":
    main()
