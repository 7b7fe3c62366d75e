"""Do the 95 % intervals of a calibration to recordings contain planted values?

For each seed the script plants a machine: friction of the dampers and mass of the unbalance that
differ from those of the reference machine by up to a quarter. Its accelerometers are not ideal:
gravity, an offset that drifts, noise, and a gain and a tilt with the deviations that the fit
states, 1 % and 2 degrees about each axis. Three repeats start late by other times. The calibration
knows none of it.

    python analyses/check_record_coverage.py --seeds 50 --rows build/coverage.csv

The file of `--rows` keeps each finished machine: repeat the command to go on, or to do more seeds.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, SpinProfile, load_machine, with_values
from wm_drake.parameters.recorded import Synchronous
from wm_drake.parameters.recorded_sensors import RecordedSensor, recorded_test_of
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.records import Record
from wm_drake.studies.calibrate.blocks import calibrated
from wm_drake.studies.calibrate.recorded import RecordedLoad, without_edges
from wm_drake.studies.calibrate.records import GAIN_SD, TILT_SD, RecordModel
from wm_drake.studies.compare.pairs import paired, predicted_signals
from wm_drake.studies.compare.recordings import TestRecording
from wm_drake.studies.experiment import Experiment, record_here
from wm_drake.studies.fitting.free_numbers import free_numbers_of_texts
from wm_drake.studies.tolerance.shares import share_of

UNKNOWNS = ("damper_types.friction.friction_force", "loads.middle.unbalances.0.mass")
SENSORS = ("S1_x", "S1_z", "S2_x", "S2_z", "S3_x", "S3_z")
SPAN = np.log(1.25)
OFFSET, DRIFT, NOISE, LATE = 0.1, 0.1, 0.02, (0.5, 2.0)
"""Deviations of offset, of its drift over a record, and of noise [m/s^2], and range of starts [s].
"""
PROFILE = SpinProfile(time=(0.0, 25.0, 30.0), speed=(0.0, 36.0, 36.0))
COLUMNS = ["by", "seed", "unknown", "holds", "error", "half_width"]


def main() -> None:
    """Calibrate to planted machines and print the coverage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one seed")
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--by", default="envelope", help="envelope, order, rms or history")
    parser.add_argument("--rows", type=Path, help="CSV of the finished machines, to go on with")
    parser.add_argument("--out", type=Path, help="also write the result to this file")
    arguments = parser.parse_args()
    machine = build_machine(load_machine("reference"))
    kept, by = arguments.rows, arguments.by
    lines = pd.read_csv(kept).values.tolist() if kept and kept.exists() else []
    count = 1 if arguments.quick else arguments.seeds
    for seed in range(arguments.first, arguments.first + count):
        if [by, seed] in [line[:2] for line in lines]:
            continue
        found = _found(machine, seed, by).tolist()
        lines += [[by, seed, name, *row] for name, row in zip(UNKNOWNS, found, strict=True)]
        print(f"seed {seed}: {found}", file=sys.stderr, flush=True)
        if kept:
            kept.parent.mkdir(parents=True, exist_ok=True)
            pd.DataFrame(lines, columns=COLUMNS).to_csv(kept, index=False)
    rows = pd.DataFrame([line for line in lines if line[0] == by], columns=COLUMNS)
    text = "\n".join([*(_line(n, rows[rows.unknown == n]) for n in UNKNOWNS), _line("both", rows)])
    print(text)
    if arguments.out:
        arguments.out.write_text(text + "\n", encoding="utf-8")


def _line(name: str, rows: pd.DataFrame) -> str:
    """Return how many intervals of some rows hold the planted value, and how wide they are."""
    hits, error = rows.holds.to_numpy() > 0.0, 100.0 * rows.error.to_numpy(dtype=float)
    share, half = share_of(hits), 100.0 * rows.half_width.median()
    return (
        f"{name}: {hits.sum()} of {len(hits)} intervals hold the planted value; probability "
        f"{100 * share.lower:.0f} to {100 * share.upper:.0f} %; RMS of the errors "
        f"{np.sqrt(np.mean(error**2)):.2f} %, median half-width {half:.2f} %"
    )


def _found(machine: Machine, seed: int, by: Any) -> FloatArray:
    """Return for each unknown whether its interval holds the planted value, error, half-width."""
    parameters, generator = machine.parameters, np.random.default_rng(seed)
    free = free_numbers_of_texts(parameters, UNKNOWNS, "calibrated")
    truth = free.guesses * np.exp(generator.uniform(-SPAN, SPAN, 2))
    planted = with_values(parameters, dict(zip(UNKNOWNS, truth.tolist(), strict=True)))
    sensors = {name: recorded_test_of(parameters).sensors[name] for name in SENSORS}
    points = machine.set_up().accelerometer_points
    places = {name: points[name[:2]] for name in SENSORS}
    recordings = _recordings(_record(machine, planted), sensors, places, generator)
    run = _record(machine, parameters)
    predicted = predicted_signals(run, sensors, places)
    pairs = tuple(without_edges(paired(r, run, predicted)) for r in recordings)
    load = RecordedLoad("middle", lambda changed: changed.loads["middle"], pairs)
    model = RecordModel(Experiment(machine, ()), free, sensors, (load,), places, by)
    fit, _ = calibrated(model, seed, starts=1)
    return np.array(
        [
            [e.lower <= true <= e.upper, e.value / true - 1.0, (e.upper - e.lower) / 2.0 / e.value]
            for e, true in zip(fit.estimates, truth, strict=False)
        ],
        dtype=float,
    )


def _record(machine: Machine, parameters: MachineParameters) -> Record:
    """Return the record of a run of a machine with other numbers."""
    case = Case("middle", parameters.loads["middle"], PROFILE, parameters=parameters)
    records: list[Record] = []
    record_here(machine, [case], lambda number, record: records.append(record), "runs")
    return records[0]


def _recordings(
    record: Record,
    sensors: dict[str, RecordedSensor],
    places: dict[str, FloatArray],
    generator: np.random.Generator,
) -> list[TestRecording]:
    """Return three repeats as sensors that are not ideal would have written them."""
    signals = {}
    for name, sensor in sensors.items():
        tilt = tuple((TILT_SD * generator.standard_normal(3)).tolist())
        gain = float(1.0 + GAIN_SD * generator.standard_normal())
        faulty = sensor.model_copy(update={"tilt": tilt, "gain": gain})
        signal = predicted_signals(record, {name: faulty}, places)[:, 0]
        slope = DRIFT * generator.standard_normal() * np.linspace(-0.5, 0.5, len(signal))
        signals[name] = signal + OFFSET * generator.standard_normal() + slope
    recordings, time = [], record.time.values
    for _ in range(3):
        late = int(np.searchsorted(time, generator.uniform(*LATE)))
        values = {
            name: signal[late:] + NOISE * generator.standard_normal(len(signal) - late)
            for name, signal in signals.items()
        }
        clock = Synchronous(Path("planted"), time[late:] - time[late], values)
        recordings.append(TestRecording(clock))
    return recordings


if __name__ == "__main__":
    main()
