"""D, F and M of [B]: largest displacement near the detergent box, and gasket force and moment."""

from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures.kind import Measure, Variable, each_run

EXTREMES = Measure(
    "extremes",
    (
        Variable(
            "detergent_displacement",
            ("axis",),
            Unit("m", "mm"),
            "displacement",
            "largest displacement, from the rest position of the run's own machine, of the tub "
            "point nearest to the detergent box",
            group="D",
            short="D{}",
        ),
        Variable(
            "gasket_force",
            ("axis",),
            Unit("N", "N"),
            "force",
            "largest force of the gasket on the housing",
            group="F",
            short="gasket F{}",
            studio=1,
        ),
        Variable(
            "gasket_moment",
            ("axis",),
            Unit("N*m", "N*m"),
            "moment",
            "largest moment of the gasket on the housing",
            group="M",
            short="gasket M{}",
        ),
    ),
    each_run(lambda run: [*run.largest]),
    has_table=False,
)
