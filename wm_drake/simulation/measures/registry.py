"""All measures by name: those of this package, then those that users register."""

from wm_drake.parameters import MachineParameters
from wm_drake.registry import Registry
from wm_drake.simulation.measures.kind import Measure, Variable

SHIPPED = (
    "extremes:EXTREMES",
    "amplitudes:AMPLITUDES",
    "amplitudes:IN_REGIONS",
    "amplitudes:POWER_MEANS",
    "gap:GAP",
    "gap:CONTACTS",
    "regions:REGIONS",
    "regions:RECORDED",
    "mounts:MOUNTS",
    "drive:DRIVE",
    "feet:FEET",
    "feet:IN_REGIONS",
    "mounts:CABINET",
    "springs:TENSIONS",
    "radial:RADIAL",
    "stops:STOPS",
    "water:WATER",
)
"""Measures of this package: module of this folder, and name. Files of results have their order."""

MEASURES: Registry[Measure] = Registry(
    "measure", "wm_drake.measures", [f"{__package__}.{place}" for place in SHIPPED]
)
"""Measures by name."""


def tabulated(parameters: MachineParameters) -> list[Variable]:
    """Return the variables of a machine's spin runs that are shown by their declaration."""
    shown = (one for one in MEASURES.values() if one.has_table and one.applies(parameters))
    return [one for measure in shown for one in measure.variables if one.is_in_spin]


def measure_named(name: str, key: str = "") -> Measure:
    """Return the measure of a name: its own, or that of one of its variables, as responses have.

    Args:
        key: Key path for messages.

    Raises:
        InputError: there is no such measure.
    """
    owners = (one for one in MEASURES.values() if name in one.names)
    owner = None if name in MEASURES else next(owners, None)
    return owner or MEASURES.find(name, key=key)


def register_measure(measure: Measure) -> Measure:
    """Add a measure to those that every study, page and command knows, and return it.

    Raises:
        ValueError: another measure has this name.

    Example:
        >>> import numpy as np
        >>> import wm_drake as wm
        >>> from wm_drake.parameters.units import Unit
        >>> from wm_drake.simulation.measures import MEASURES, Measure, Variable, each_run
        >>> turns = Variable("turns", (), Unit("rad", "rad"), "angle", "angle at the end")
        >>> at_end = Measure("turns", (turns,), each_run(lambda run: [run.drum_angle[-1]]))
        >>> at_end.names
        ('turns',)
    """
    return MEASURES.register(measure)
