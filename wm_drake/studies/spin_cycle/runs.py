"""Functions that run the cases of a spin-cycle study with the compiled or the Drake engine."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

import numpy as np
import xarray as xr

from wm_drake.batch import MEASURES as KNOWN_MEASURES
from wm_drake.batch import simulate_many, simulate_remembered
from wm_drake.batch.ledger import Ledger
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.drive import drive_variables
from wm_drake.simulation.vibration import record_region_displacements
from wm_drake.studies.spin.study import CaseResult, run_spin
from wm_drake.studies.spin_cycle.study import DRIVE, FEET, Evaluate, forces_measured, measures_of


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

        results = run_spin(parameters, runs, "drake", progress=report).results
        return _table(results, forces_measured(parameters))

    return evaluate


def _table(results: Iterable[CaseResult], measures: Sequence[str]) -> xr.Dataset:
    """Return results as a table in the form of `simulate_many`, with measures of the forces."""
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
        | _forces(results, measures)
    )


def _measured(result: CaseResult, measure: str) -> Mapping[str, xr.DataArray]:
    """Return the variables of a measure of the forces of a run, by name."""
    if measure in DRIVE:
        return drive_variables(result.record, result.case.profile)
    own = result.measures.feet if measure in FEET else result.measures
    return {name: getattr(own, name) for name in KNOWN_MEASURES[measure]}


def _forces(
    results: Sequence[CaseResult], measures: Sequence[str]
) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """Return the variables of the forces of mounts and feet, and of the drive with a motor."""
    found: dict[str, list[xr.DataArray]] = {}
    for result in results:
        for measure in measures:
            own = _measured(result, measure)
            for name in KNOWN_MEASURES[measure]:
                found.setdefault(name, []).append(own[name])
    return {
        name: (("run", *map(str, values[0].dims)), np.array([value.values for value in values]))
        for name, values in found.items()
    }
