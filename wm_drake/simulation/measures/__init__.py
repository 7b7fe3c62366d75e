"""What is measured of a run: one declaration a measure, read by every study, page and command.

`kind` has the declaration `Measure`, `registry` all measures by name, `run` what a measure may read
of a run, `record` the measures of a record. The other modules declare one measure each, or a
family. A package of a user adds measures with `wm_drake.register_measure`.
"""

from wm_drake.simulation.measures.kind import Measure, Variable, each_run
from wm_drake.simulation.measures.record import Measures, measure
from wm_drake.simulation.measures.registry import MEASURES, measure_named, register_measure
from wm_drake.simulation.measures.run import Run

__all__ = [
    "MEASURES",
    "Measure",
    "Measures",
    "Run",
    "Variable",
    "each_run",
    "measure",
    "measure_named",
    "register_measure",
]
