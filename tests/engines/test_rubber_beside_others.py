"""Rubber beside tubes, a motor and a moving cabinet: derivatives of the compiled machine and Drake's."""

import numpy as np
import pytest
from machines_of_each_kind import FRICTION, RUBBER, changed
from moving_cabinet import with_moving_cabinet
from telescopic_machine import changed as with_parts
from telescopic_machine import telescopic

from wm_drake.engines.compiled.derivative import StateDerivative
from wm_drake.engines.compiled.mechanics import DRUM_RATE
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, Unbalance, load_machine

pytestmark = pytest.mark.slow
LOAD = Load(
    unbalances=(
        Unbalance(mass=0.6, radius=0.24, y=-0.1, phase=0.7),
        Unbalance(mass=0.4, radius=0.2, y=0.12, phase=2.9),
    )
)
TUB = np.array([1.0, 1.2, 1.0] + [0.15] * 3 + [30.0] + [8.0] * 3 + [3.0] * 3 + [60.0])
TUBES = np.array([1.0, 1.2, 1.0] + [0.15] * 3 + [0.05] + [8.0] * 3 + [3.0] * 3 + [2.0])
CABINET = np.array([2e-3] * 3 + [1e-3] * 3 + [0.0] + [0.05] * 3 + [0.05] * 3 + [0.0])
"""Sizes of the state of a tree. [rad, m, rad/s, m/s]"""
VECTORS = (slice(0, 3), slice(3, 6), slice(7, 10), slice(10, 13))
WITHOUT_JOINT = np.delete(np.arange(14), (6, 13))


def with_rubber(parameters):
    gasket = parameters.gasket.model_dump() | FRICTION | RUBBER
    return with_parts(parameters, gasket=gasket)


def places(context, systems):
    """Return the indices of the continuous states of systems in that of the diagram."""
    context.SetContinuousState(np.arange(context.num_continuous_states(), dtype=float))
    found = [
        system.GetMyContextFromRoot(context).get_continuous_state_vector().CopyToVector()
        for system in systems
    ]
    return np.concatenate([np.zeros(0), *found]).astype(int)


class Both:
    """States of a machine in Drake's order and in that of the compiled machine."""

    def __init__(self, machine):
        self.machine, self.setup = machine, machine.set_up(LOAD)
        self.context, self.derivative = self.setup.context, StateDerivative(self.setup)
        self.trees = machine.state_layout.states()
        self.sponges = places(self.context, machine.dampers.values())
        self.tubes = places(self.context, machine.telescopes.values())
        self.stretches = places(self.context, machine.bushings.values())
        self.feet = places(self.context, [machine.feet] if machine.feet else [])
        known = np.concatenate(
            [*self.trees, self.sponges, self.tubes, self.stretches, self.feet]
        ).astype(int)
        self.motor = np.setdiff1d(np.arange(self.context.num_continuous_states()), known)
        assert len(self.stretches) == self.setup.bushings["gasket"].state_size > 0

    def own(self, numbers, of_motor):
        """Return numbers of Drake's state, or of its rate, in the order of the compiled machine."""
        has_sponge = [damper.has_sponge for damper in self.setup.dampers.values()]
        struts = np.zeros(len(has_sponge))
        struts[has_sponge] = numbers[self.sponges]
        count = len(self.tubes)
        parts = [numbers[self.trees[0]], struts]
        for tree, sponge in zip(self.trees[1 : 1 + count], self.tubes, strict=True):
            parts.append(np.append(numbers[tree], numbers[sponge]))
        parts += [np.append(numbers[self.motor], 0.0)] if of_motor else []
        parts += [numbers[tree][WITHOUT_JOINT] for tree in self.trees[1 + count :]]
        return np.concatenate([*parts, numbers[self.feet], numbers[self.stretches]])

    def worst(self, count):
        """Return the largest relative difference of the time derivatives at random states."""
        rng, worst = np.random.default_rng(3), 0.0
        sizes = [TUB] + [TUBES] * len(self.tubes) + [CABINET] * bool(self.machine.feet)
        for _ in range(count):
            state = rng.uniform(-2e-3, 2e-3, self.context.num_continuous_states())
            for tree, size in reversed(list(zip(self.trees, sizes, strict=True))):
                state[tree] = rng.uniform(-1.0, 1.0, 14) * size  # the drum's are those of the first
            self.context.SetContinuousState(state)
            wanted = rng.uniform(-60.0, 60.0)
            if len(self.motor):
                port = self.machine.diagram.GetInputPort("drum_speed_reference")
                port.FixValue(self.context, [wanted])
            else:
                self.machine.set_drum_acceleration(self.context, rng.uniform(-20.0, 20.0))
            told = self.machine.diagram.EvalTimeDerivatives(self.context).CopyToVector()
            drake = self.own(told, len(self.motor) > 0)
            x = self.own(state, len(self.motor) > 0)
            ours = self.derivative(x, told[self.trees[0]][DRUM_RATE], reference=wanted)
            assert len(ours) == len(drake)
            for part in (*VECTORS, slice(14, None)):
                scale = np.max(np.abs(drake[part]), initial=1e-3)
                worst = max(worst, np.max(np.abs(drake[part] - ours[part])) / scale)
            stretched = slice(len(x) - len(self.stretches), None)
            np.testing.assert_allclose(ours[stretched], drake[stretched], rtol=1e-9, atol=1e-9)
        return worst


@pytest.mark.parametrize("name", ["tubes", "motor", "cabinet"])
def test_derivatives_are_those_of_the_diagram(name):
    parameters = {
        "tubes": telescopic,
        "motor": lambda: load_machine("motor"),
        "cabinet": lambda: with_moving_cabinet(changed()),
    }[name]()
    assert Both(build_machine(with_rubber(parameters))).worst(200) < 1e-10
