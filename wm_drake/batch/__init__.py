"""Many runs of one machine: cases -> work_items -> ended runs -> a table."""

from wm_drake.batch.many import SimulationInterrupted, simulate_many
from wm_drake.batch.remembered import run_keys, simulate_remembered, sources_version
from wm_drake.batch.runs import MEASURES, RunResult

__all__ = [
    "MEASURES",
    "RunResult",
    "SimulationInterrupted",
    "run_keys",
    "simulate_many",
    "simulate_remembered",
    "sources_version",
]
