"""Hits of the tub against its stops: how often, and how fast."""

from wm_drake.parameters.units import PureNumber, Unit
from wm_drake.simulation.measures.kind import Measure, Variable, each_run
from wm_drake.simulation.stops import hits_of, stop_names

STOPS = Measure(
    "stops",
    (
        Variable(
            "stop_hits",
            ("stop",),
            PureNumber(),
            "hits of a stop",
            "number of times that the tub meets each stop",
            title="hits of stop {}",
            studio=0,
        ),
        Variable(
            "stop_hit_velocity",
            ("stop",),
            Unit("m/s", "m/s"),
            "velocity of a hit",
            "largest velocity with which the tub meets each stop, 0 if it does not",
            title="velocity at stop {}",
        ),
    ),
    each_run(lambda run: hits_of(*run.approaches, run.period)),
    ("stops",),
    applies=lambda machine: bool(stop_names(machine)),
)
