"""Functions that run the cases of a spin-cycle study with the compiled or the Drake engine."""

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
import xarray as xr

from wm_drake.batch import simulate_many
from wm_drake.batch.many import as_table
from wm_drake.model.machine import Machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import measure
from wm_drake.studies.spin.study import run_spin
from wm_drake.studies.spin_cycle.study import Evaluate, measures_of


def compiled_runs(machine: Machine) -> Evaluate:
    """Return a function that runs cases of a built machine with the compiled engine."""
    return partial(simulate_many, machine, measures=measures_of(machine.parameters))


def drake_runs(
    parameters: MachineParameters, *, progress: Callable[[int], None] = lambda done: None
) -> Evaluate:
    """Return a function that runs cases with the Drake engine in processes; a case takes minutes.

    Args:
        progress: Called with the number of finished cases.
    """

    def evaluate(cases: Iterable[Case]) -> xr.Dataset:
        runs = list(cases)
        done = np.zeros(len(runs))

        def report(index: int, fraction: float) -> None:
            done[index] = fraction
            progress(int(done.sum()))

        results = run_spin(parameters, runs, "drake", progress=report).results
        measures, scene = measures_of(parameters), Scene(parameters)
        rows = {
            number: (
                result.case.name,
                str(result.record.attrs["diverged"]),
                measure(result.record, scene, measures).values,
            )
            for number, result in enumerate(results)
        }
        return as_table(parameters, measures, rows)

    return evaluate
