"""The four feet of the cabinet: loads and margins under the forces of the mounts and its weight."""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.packed import ARRAY, SCALAR, VECTOR, PackedLayout
from wm_drake.parameters.cabinet import Cabinet
from wm_drake.parameters.types import FloatArray

FEET = PackedLayout(
    "FeetNumbers",
    weight=SCALAR,
    centre=VECTOR,
    floor=SCALAR,
    friction=SCALAR,
    x=ARRAY(4),
    y=ARRAY(4),
)
"""Weight of the cabinet [N] and its centre of mass in W [m], z of the floor [m], friction
coefficient, positions of the feet, counterclockwise from above [m]."""
read_feet = FEET.read


def packed_feet(cabinet: Cabinet, gravity: float) -> FloatArray:
    """Return the numbers of `FEET`.

    Args:
        gravity: [m/s^2]
    """
    feet = [cabinet.feet[name] for name in cabinet.corners]
    return FEET.pack(
        weight=cabinet.mass * gravity,
        centre=cabinet.centre_of_mass,
        floor=cabinet.floor,
        friction=cabinet.friction,
        x=[foot.x for foot in feet],
        y=[foot.y for foot in feet],
    )


@law
def load_on_feet(wrench, feet):
    """Return the load of the cabinet on its feet, about the point of the floor below Wo.

    The cabinet does not accelerate, so the load is the wrench of the mounts and the weight.

    Args:
        wrench: Moment about the origin of W and force of all mounts on the cabinet, in W (six
            numbers). [N m, N]
        feet: Numbers of `FEET`, by name.

    Returns:
        Vertical load down, horizontal force x and y [N], moments about x, y and z [N m].
    """
    f_x, f_y, weight, centre = wrench[3], wrench[4], feet.weight, feet.centre
    moment_x = wrench[0] + feet.floor * f_y - centre[1] * weight
    moment_y = wrench[1] - feet.floor * f_x + centre[0] * weight
    return weight - wrench[5], f_x, f_y, moment_x, moment_y, wrench[2]
