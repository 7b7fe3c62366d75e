"""Functions that run the cases of a spin-cycle study with the compiled or the Drake engine."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial

import numpy as np
import xarray as xr

from wm_drake.batch import MEASURES as KNOWN_MEASURES
from wm_drake.batch import simulate_many, simulate_remembered
from wm_drake.batch.ledger import Ledger
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.vibration import record_region_displacements
from wm_drake.studies.spin.study import CaseResult, run_spin
from wm_drake.studies.spin_cycle.study import FEET, FORCES, Evaluate, measures_of


def compiled_runs(
    machine: Machine,
    ledger: Ledger | None = None,
    *,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> Evaluate:
    """Return a function that runs cases with the compiled engine.

    Args:
        machine: A built machine.
        ledger: An open ledger; cases whose results it has are not run. None for no ledger.
        workers: Number of threads; None for the number of cores.
        progress: Called with the number of finished cases.
    """
    measures = measures_of(machine.parameters)
    if ledger is None:
        return partial(
            simulate_many, machine, measures=measures, workers=workers, progress=progress
        )
    return partial(
        simulate_remembered,
        machine,
        ledger=ledger,
        measures=measures,
        workers=workers,
        progress=progress,
    )


def drake_runs(
    parameters: MachineParameters, *, progress: Callable[[int], None] = lambda done: None
) -> Evaluate:
    """Return a function that runs cases with the Drake engine in processes; a case takes minutes.

    Args:
        parameters: The machine.
        progress: Called with the number of finished cases.
    """

    def evaluate(cases: Iterable[Case]) -> xr.Dataset:
        runs = list(cases)
        done = np.zeros(len(runs))

        def report(index: int, fraction: float) -> None:
            done[index] = fraction
            progress(int(done.sum()))

        return _table(run_spin(parameters, runs, "drake", progress=report).results)

    return evaluate


def _table(results: Iterable[CaseResult]) -> xr.Dataset:
    """Return results as a table in the form of `simulate_many`."""
    results = list(results)
    direct, integrated, gaps, tensions, diverged = [], [], [], [], []
    for result in results:
        points = result.record.accelerometer_point.values
        first, second = record_region_displacements(result.record, points, result.case.profile)
        direct.append(first)
        integrated.append(second)
        gaps.append(
            result.measures.smallest_gap.distance if result.measures.smallest_gap else np.nan
        )
        tensions.append(result.measures.smallest_tension.values)
        diverged.append(result.record.attrs["diverged"])
    dims = ("run", "region", "accelerometer", "axis")
    return xr.Dataset(
        {
            "region_displacement": (dims, np.array(direct)),
            "region_displacement_integrated": (dims, np.array(integrated)),
            "smallest_gap": ("run", np.array(gaps)),
            "smallest_spring_tension": (("run", "spring"), np.array(tensions)),
            "diverged": ("run", np.array(diverged, dtype=object)),
        }
        | _forces(results)
    )


def _forces(results: Sequence[CaseResult]) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Return the variables of the forces of the mounts and of the loads of the feet."""
    found: dict[str, list[xr.DataArray]] = {}
    for result in results:
        for measure in (*FORCES, *(FEET if result.measures.feet is not None else ())):
            own = result.measures.feet if measure in FEET else result.measures
            for name in KNOWN_MEASURES[measure]:
                found.setdefault(name, []).append(getattr(own, name))
    return {
        name: (("run", *map(str, values[0].dims)), np.array([value.values for value in values]))
        for name, values in found.items()
    }
