"""Smallest tension of each spring over a run; it is 0 if the spring goes slack."""

from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures.kind import Measure, Variable, detail, each_run

TENSIONS = Measure(
    "spring tensions",
    (
        Variable(
            "smallest_spring_tension",
            ("spring",),
            Unit("N", "N"),
            "spring tension",
            "smallest tension; the spring goes slack at 0",
            better="larger",
            group="spring_tension",
            title="smallest tension {}",
            studio=None,
        ),
        detail(
            "smallest_spring_elongation",
            ("spring",),
            Unit("m", "mm"),
            "spring elongation",
            "smallest elongation from the free length; negative if the spring goes slack",
            better="larger",
        ),
    ),
    each_run(lambda run: (run.smallest_tensions, run.smallest_elongations)),
    ("springs",),
    has_table=False,
)
