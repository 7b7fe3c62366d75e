"""What the compiled functions of a page work on: places of numbers, and for what they are made."""

from collections import namedtuple

BODY_SIZE = 4
"""Numbers of a body that may change: mass, centre of mass in its frame. [kg, m]"""
BODY_CONSTANTS = 24
"""Constants of such a body: 1 if it is in the drum, else 0; 1 if its inertia grows with its mass,
else 0; its mass and centre of mass as exported (4); rotation and position of its frame (12), as
`Constants.drum`; its central inertia in T (6)."""
SUMS = 10
"""Sums of masses: mass, first moment and inertia about O, in T."""
SOLVED, GIVEN, FREE_LENGTH = range(3)
"""What gives the preload of a spring: the equilibrium as drawn, the machine file, a free length."""
PUSHES = 4
"""Added to it for a spring that can push."""
Places = namedtuple(
    "Places",
    "time unbalances of_load speed packed total state rest trial wrenches slopes step rate inputs "
    "stage sum past_rates past_inputs errors length jacobian relaxation extremes sums answer "
    "parameters bodies size",
)
"""Indices in the array of an instance.

unbalances: those of the load, the residual imbalance of the drum last; of_load: what else the load
adds to the harmonics of the drum; speed: of the drum at the start [rad/s]; packed: packed numbers,
then the free length of each spring, the measured points and the numbers of the feet; rest: pose of
the tub at rest; errors: `local_error.Sums` of the
run; length: largest step of the run [s]; relaxation: matrices of the midpoint rule;
extremes, sums: what `measure_samples_lanes` and `measure_mounts_lanes` write; answer: the gap
(`GAP_SIZE`), then the peak force of each mount; parameters: numbers of the machine file by straight
lines; bodies: `BODY_SIZE` each; the others are arrays to work in. What depends on the numbers that
may change is last: the functions of a run are the same for any.
"""
Constants = namedtuple(
    "Constants",
    "packed harmonics drum initial slowest sections settled pairs start entries bodies size",
)
"""Indices in the array of constants.

packed, harmonics, drum, start, entries: as in `wm_drake.export.kernel`; initial: state before a
run; slowest: state at which the machine is linearised for the midpoint rule; sections, settled: of
the filter; pairs: shapes, `PAIR_SIZE` each, then the distance of each pair at the initial pose;
bodies: `BODY_CONSTANTS` each.
"""
Counts = namedtuple(
    "Counts",
    "packed numbers parameters entries bodies unbalances springs points sensors mounts feet pairs",
)
"""How many of each there are; packed: packed numbers, free lengths, points and feet; numbers:
packed numbers alone."""
Plan = namedtuple(
    "Plan", "at of count elements resting springs gasket midpoint limits reach settles"
)
"""What the functions are compiled for.

resting: `Mounts` that act at rest; springs: what gives the preload of each, and whether it pushes;
midpoint: whether runs take the midpoint rule; limits: largest angle and displacement of the rest
pose [rad, m]; reach: largest distance of a point of the tub group from To [m]; settles: whether the
equilibrium is found in the page.
"""
GAP_SIZE = 10
"""Smallest gap, its sample, number of the pair, nearest points of both shapes, number of good
samples."""
