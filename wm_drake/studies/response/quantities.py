"""Quantities of the steady response: words, unit and digits of each, once."""

from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import SPEED, Quantity, of_measure
from wm_drake.simulation.mounts import KINDS

MM, NEWTON = Unit("m", "mm"), Unit("N", "N")

AMPLITUDE = Quantity("amplitude", MM, 1)
FORCE = Quantity("force", NEWTON, 1)
GAP = of_measure("smallest_gap")
LARGEST_AT = SPEED.named("largest at")
MULTIPLIER = Quantity("largest multiplier")
RUN_SPEED = Quantity("speed in the run", SPEED.unit, 0)
RUN_AMPLITUDE = Quantity("amplitude in the run", MM, 1)
DIFFERENCE = Quantity("run less steady", Unit("", "%"), 0)
RATE = Quantity("sweep rate", Unit("rad/s^2", "rpm/s"), form="{:g}".format)
SHIFT = Quantity("speed of the peak less that of the steady peak", SPEED.unit, 0)
HEIGHT = Quantity("peak over the steady peak", Unit("", "%"), 0)
TURN = Quantity("spin in a revolution", Unit("rad", "deg"), 1)

OF_BRANCH = {
    "amplitude": ("sensor", AMPLITUDE),
    "detergent_displacement": ("axis", Quantity("detergent box", MM, 1)),
    "gasket_force": ("axis", Quantity("gasket force", NEWTON, 1)),
    "gasket_moment": ("axis", Quantity("gasket moment", Unit("N*m", "N*m"), 1)),
    "spring_tension": ("spring", Quantity("half the range of the tension", NEWTON, 1)),
    "damper_tension": ("damper", Quantity("half the range of the tension", NEWTON, 1)),
    **{
        f"mount_force_{kind}": ("mount", Quantity(f"force on the cabinet, {kind}", NEWTON, 1))
        for kind in KINDS
    },
    "smallest_gap": ("", GAP),
    "damper_spin": ("spinning", Quantity("rate of spin", Unit("rad/s", "deg/s"))),
    "multiplier": ("", MULTIPLIER),
}
"""Dimension along a branch, beside its points, and quantity of each variable of a response."""
