"""How a spin-cycle study runs its cases: side by side with the compiled engine, or one by one with Drake's."""

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
import xarray as xr

from wm_drake.batch import simulate_many, simulate_remembered
from wm_drake.batch.ledger import Ledger
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.vibration import record_region_displacements
from wm_drake.studies.spin.study import CaseResult, run_spin
from wm_drake.studies.spin_cycle.study import MEASURES, Evaluate


def compiled_runs(
    machine: Machine,
    ledger: Ledger | None = None,
    *,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> Evaluate:
    """Runs cases with the compiled engine; those that a ledger holds are not run again.

    Args:
        machine: A built machine.
        ledger, workers, progress: As for `simulate_remembered`.
    """
    if ledger is None:
        return partial(
            simulate_many, machine, measures=MEASURES, workers=workers, progress=progress
        )
    return partial(
        simulate_remembered,
        machine,
        ledger=ledger,
        measures=MEASURES,
        workers=workers,
        progress=progress,
    )


def drake_runs(
    parameters: MachineParameters, *, progress: Callable[[int], None] = lambda done: None
) -> Evaluate:
    """Runs cases by the Drake engine, in a process each; they take minutes."""

    def evaluate(cases: Iterable[Case]) -> xr.Dataset:
        runs = list(cases)
        done = np.zeros(len(runs))

        def tell(index: int, fraction: float) -> None:
            done[index] = fraction
            progress(int(done.sum()))

        return _table(run_spin(parameters, runs, "drake", progress=tell).results)

    return evaluate


def _table(results: Iterable[CaseResult]) -> xr.Dataset:
    """As `simulate_many` gives it."""
    direct, integrated, gaps, diverged = [], [], [], []
    for result in results:
        points = result.record.accelerometer_point.values
        first, second = record_region_displacements(result.record, points, result.case.profile)
        direct.append(first)
        integrated.append(second)
        gaps.append(
            result.measures.smallest_gap.distance if result.measures.smallest_gap else np.nan
        )
        diverged.append(result.record.attrs["diverged"])
    dims = ("run", "region", "accelerometer", "axis")
    return xr.Dataset(
        {
            "region_displacement": (dims, np.array(direct)),
            "region_displacement_integrated": (dims, np.array(integrated)),
            "smallest_gap": ("run", np.array(gaps)),
            "diverged": ("run", np.array(diverged, dtype=object)),
        }
    )
