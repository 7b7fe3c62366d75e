"""Runs side by side, and each of their cases alone."""

import xarray as xr

from wm_drake.batch import simulate_many
from wm_drake.parameters import with_value
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate


def recorded(machine, cases):
    """Run cases side by side; return their records in the order of the cases, and the table."""
    ended = []
    table = simulate_many(machine, cases, histories=True, finished=ended.append)
    return [run.record for run in sorted(ended, key=lambda run: run.number)], table


def check_runs_alone(machine, cases):
    """Check that each record of a batch is that of a single run, bit by bit; return the table."""
    records, table = recorded(machine, cases)
    for case, record in zip(cases, records, strict=True):
        xr.testing.assert_identical(record, simulate(machine, case))
    return table


def cases_with(machine, key, values, profile):
    """Return a case with the load "middle" for each value of a number of a machine."""
    parameters = machine.parameters
    return [
        Case(
            f"{value:g}",
            parameters.loads["middle"],
            profile,
            parameters=with_value(parameters, key, value),
        )
        for value in values
    ]
