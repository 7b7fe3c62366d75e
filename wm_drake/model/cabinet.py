"""A cabinet that moves: loads of its feet at rest."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from wm_drake.elements.cabinet import CabinetOnFeet
from wm_drake.elements.feet import FEET, load_on_feet, packed_feet
from wm_drake.errors import input_error
from wm_drake.laws.feet import normal_loads, tilting_margin
from wm_drake.model.equilibrium import weight_on_cabinet
from wm_drake.model.state_layout import StateLayout
from wm_drake.parameters import MachineParameters


def cabinet_at_rest(
    plant: MultibodyPlant,
    context: Context,
    state_layout: StateLayout,
    parameters: MachineParameters,
) -> CabinetOnFeet | None:
    """Return the cabinet with the loads of its feet at rest; None if it does not move.

    The feet are levelled: at rest the cabinet stands as drawn. Their loads are those of four feet
    of equal stiffness under the weight of the empty machine.

    Raises:
        InputError: the cabinet tips over at rest.
    """
    cabinet = parameters.cabinet
    if cabinet is None or not cabinet.moves:
        return None
    feet = FEET.unpack(packed_feet(cabinet, parameters.gravity))
    load = load_on_feet(tuple(weight_on_cabinet(plant, context, state_layout)), feet)
    down, moments = load[0], load[3:5]
    if not tilting_margin(down, *moments, feet.x, feet.y) > 0.0:
        raise input_error(
            "the cabinet tips over at rest: the centre of mass of the machine is not above the "
            "area between its feet; move the feet outwards",
            key="cabinet.feet",
        )
    return CabinetOnFeet(cabinet, np.array(normal_loads(down, *moments, feet.x, feet.y)))
