"""Mass of the load at the end of a run, with the water left in it."""

import numpy as np

from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures.kind import Measure, Variable, each_run

WATER = Measure(
    "water",
    (
        Variable(
            "mass_left",
            (),
            Unit("kg", "kg"),
            "mass of the load at the end",
            "mass of the load at the end of the run, with the water left in it",
            better="",
            studio=3,
        ),
    ),
    each_run(lambda run: [run.mass_left[-1] if len(run.time) else np.array(np.nan)]),
    applies=lambda machine: machine.most_wet > 0,
)
