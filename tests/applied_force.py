"""Force of all elements and gravity on the tub, from Drake's plant at the pose of a Context."""

import numpy as np

from wm_drake.model.placed_elements import AppliedForce


def elastic_and_gravity_force(machine, setup):
    """Return the moment about To and the force on the tub, in W. (6,) [N m, N]"""
    context, layout = setup.plant_context, machine.state_layout
    force = AppliedForce(setup.elements, layout)(machine.plant.GetPositionsAndVelocities(context))
    force += machine.plant.CalcGravityGeneralizedForces(context)
    return np.asarray(force[layout.tub])
