"""Elements on the drum: machines with them, and both engines at random states."""

import numpy as np

from wm_drake.elements.state_map import ELEMENT
from wm_drake.engines.compiled.derivative import StateDerivative
from wm_drake.parameters import MachineParameters, load_machine
from wm_drake.parameters.drive import Drive

SIZES = np.array([0.2] * 3 + [0.05] * 3 + [30.0] + [1.0] * 6 + [30.0])
"""Sizes of random states of tub and drum. [rad, m, rad/s, m/s]"""


def with_rings(parameters=None, **rings):
    """Return a machine with rings."""
    tree = (parameters or load_machine("reference")).model_dump(exclude_unset=True)
    return MachineParameters.model_validate(tree | {"elements": rings})


def check_both_engines(machine, moved):
    """Compare the accelerations of tub and drum, and the rates of the elements, of both engines.

    Args:
        machine: Built machine with a load `middle`; its drum is prescribed or turned by a motor.
        moved: Function of a random generator that returns the states of each element.
    """
    setup = machine.set_up("middle")
    derivative, context = StateDerivative(setup), setup.context
    rng, states = np.random.default_rng(3), derivative.layout.states
    own, state = states.span(ELEMENT), np.zeros(states.size)
    parts = [system.GetMyContextFromRoot(context) for system in machine.others.values()]
    reference = setup.parameters.profile.speed[0]
    for _ in range(20):
        state[:14] = SIZES * rng.uniform(-1.0, 1.0, 14)
        moves = moved(rng)
        state[own] = np.concatenate(moves)
        machine.plant.SetPositionsAndVelocities(setup.plant_context, state[:14])
        for part, values in zip(parts, moves, strict=True):
            part.SetContinuousState(values)
        if isinstance(setup.parameters.drive, Drive):  # prescribed
            machine.set_drum_acceleration(context, 3.0)
        plant = machine.plant.get_generalized_acceleration_output_port().Eval(setup.plant_context)
        pairs = zip(machine.others.values(), parts, strict=True)
        drake = np.concatenate([s.EvalTimeDerivatives(c).CopyToVector() for s, c in pairs])
        ours = derivative(state, plant[6], reference=reference)
        for part in (slice(0, 3), slice(3, 6), slice(6, 7)):
            scale = np.abs(plant[part]).max()
            np.testing.assert_allclose(ours[7:14][part], plant[part], rtol=0, atol=1e-9 * scale)
        np.testing.assert_allclose(ours[own], drake, rtol=0, atol=1e-10 * np.abs(drake).max())
