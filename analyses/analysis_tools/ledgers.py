"""Runs of scripts, and what a ledger needs to keep them from one call to the next."""

from collections.abc import Iterable
from functools import partial

import xarray as xr

from wm_drake.batch import simulate_many, simulate_remembered
from wm_drake.batch.ledger import Ledger, key_of
from wm_drake.batch.remembered import model_version, sources_version
from wm_drake.model.machine import Machine
from wm_drake.parameters.vary_file import VaryFile
from wm_drake.simulation.cases import Case
from wm_drake.studies.calibrate.study import SearchPlan
from wm_drake.studies.calibrate.targets import Targets
from wm_drake.studies.experiment import Simulate
from wm_drake.studies.spin_cycle.study import RunCases, measures_of


def calibration_identity(
    machine: Machine, free: VaryFile, targets: Targets, plan: SearchPlan
) -> dict[str, str]:
    """Return the texts that identify a calibration in its ledger."""
    return {
        "study": "calibration",
        "machine": key_of(
            machine=machine.parameters.model_dump(exclude={"sources"}),
            model=model_version(machine.parameters),
        )[:8],
        "free": key_of(free=free)[:8],
        "targets": key_of(targets=targets)[:8],
        "plan": key_of(plan=plan)[:8],
        "sources": sources_version(),
    }


def spin_cycle_runs(machine: Machine) -> RunCases:
    """Return a function that runs cases of a spin cycle with the compiled engine."""
    return partial(simulate_many, machine, measures=measures_of(machine.parameters))


def kept_in(ledger: Ledger, workers: int | None = None) -> Simulate:
    """Return a function that runs cases on this computer if a ledger does not have them."""

    def simulate(
        machine: Machine, measures: tuple[str, ...], cases: Iterable[Case], what: str
    ) -> xr.Dataset:
        del what
        return simulate_remembered(machine, cases, ledger, measures=measures, workers=workers)

    return simulate
