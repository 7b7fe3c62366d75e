"""Runs that a ledger keeps from one call of a script to the next."""

from collections.abc import Iterable

import xarray as xr

from wm_drake.batch import simulate_remembered
from wm_drake.batch.ledger import Ledger
from wm_drake.model.machine import Machine
from wm_drake.simulation.cases import Case
from wm_drake.studies.experiment import Simulate


def kept_in(ledger: Ledger, workers: int | None = None) -> Simulate:
    """Return a function that runs cases on this computer if a ledger does not have them."""

    def simulate(
        machine: Machine, measures: tuple[str, ...], cases: Iterable[Case], what: str
    ) -> xr.Dataset:
        del what
        return simulate_remembered(machine, cases, ledger, measures=measures, workers=workers)

    return simulate
