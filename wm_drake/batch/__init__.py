"""Run many cases of one machine.

Enters: a built `Machine` and cases. Leaves: a table over the runs with the measures of each run.
On the way, cases become work items with packed parameters, and work items become `RunResult`s.
`many` runs cases on the cores of this computer, `cluster` on a dask cluster. `ledger` stores
results on disk, and `remembered` runs only cases whose results are not stored yet.
May import: `simulation` and the rooms before it.
"""

from wm_drake.batch.many import SimulationInterrupted, simulate_many
from wm_drake.batch.remembered import run_keys, simulate_remembered, sources_version
from wm_drake.batch.runs import RunResult

__all__ = [
    "RunResult",
    "SimulationInterrupted",
    "run_keys",
    "simulate_many",
    "simulate_remembered",
    "sources_version",
]
