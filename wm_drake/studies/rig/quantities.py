"""Quantities of a loop: displacement and force, or angle and moment."""

from collections.abc import Mapping

from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import Quantity

LINEAR = {
    "displacement": Quantity("displacement", Unit("m", "mm"), form="{:.3g}".format),
    "velocity": Quantity("velocity", Unit("m/s", "mm/s"), form="{:.3g}".format),
    "load": Quantity("force", Unit("N", "N"), 2),
    "damping": Quantity("equivalent damping", Unit("N*s/m", "N*s/mm"), 3),
    "stiffness": Quantity("dynamic stiffness", Unit("N/m", "N/mm"), 2),
}
ANGULAR = {
    "displacement": Quantity("angle", Unit("rad", "deg"), form="{:.3g}".format),
    "velocity": Quantity("rate", Unit("rad/s", "deg/s"), form="{:.3g}".format),
    "load": Quantity("moment", Unit("N*m", "N*m"), 2),
    "damping": Quantity("equivalent damping", Unit("N*m*s/rad", "N*m*s/rad"), 3),
    "stiffness": Quantity("dynamic stiffness", Unit("N*m/rad", "N*m/rad"), 2),
}

PREFIXES = {False: "", True: "rotational_"}
"""Beginning of the names of tables, by whether their curves are about an axis."""


def loop_quantities(rotates: bool) -> Mapping[str, Quantity]:
    """Return the quantities of a loop by name; `rotates`: whether its motion is an angle."""
    return ANGULAR if rotates else LINEAR
