"""Many runs of one machine: cases -> jobs -> ended runs -> a table."""

from wm_drake.batch.many import SimulationInterrupted, simulate_many
from wm_drake.batch.runs import MEASURES, Ended

__all__ = ["MEASURES", "Ended", "SimulationInterrupted", "simulate_many"]
