"""Time derivatives of a machine by both engines, at random states, and machines with another SDF."""

import re

import numpy as np

from wm_drake.elements import state_map
from wm_drake.engines.compiled.derivative import StateDerivative
from wm_drake.engines.compiled.mechanics import DRUM_RATE
from wm_drake.model.bodies import sdf_path
from wm_drake.parameters import Load, Unbalance

LOAD = Load(
    unbalances=(
        Unbalance(mass=0.6, radius=0.24, y=-0.1, phase=0.7),
        Unbalance(mass=0.4, radius=0.2, y=0.12, phase=2.9),
        Unbalance(mass=0.2, radius=0.1, y=0.0, phase=-1.0),
    )
)
TREE = np.array([1.0, 1.2, 1.0] + [0.15] * 3 + [30.0] + [8.0] * 3 + [3.0] * 3 + [150.0])
TUBES = np.array([1.0, 1.2, 1.0] + [0.15] * 3 + [0.05] + [8.0] * 3 + [3.0] * 3 + [2.0])
"""Sizes of random states of tub and drum, or of tubes. [rad, m, rad/s, m/s]"""
CABINET = np.array([2e-3] * 3 + [1e-3] * 3 + [0.0] + [0.05] * 3 + [0.05] * 3 + [0.0])
"""Sizes at which some feet are lifted and some slide, and others stick. [rad, m, rad/s, m/s]"""
SPONGE, SLIP, INTEGRAL = 0.01, 2e-3, 2.0  # m, m, rad
BODY = np.delete(np.arange(14), (6, 13))
"""Numbers of a tree without those of its joint."""


def places(context, systems):
    """Return the indices of the continuous states of systems in those of the diagram."""
    context.SetContinuousState(np.arange(context.num_continuous_states(), dtype=float))
    indices = [
        system.GetMyContextFromRoot(context).get_continuous_state_vector().CopyToVector()
        for system in systems
    ]
    return np.concatenate([np.zeros(0), *indices]).astype(int)


STATES = 80
"""Number of random states; an entry that is wrong is wrong at most of them."""


class BothEngines:
    """A machine as it is set up, in Drake's diagram and compiled.

    Attributes:
        of_drake: Index in Drake's state of each number of the compiled state; -1 for numbers that
            Drake does not integrate: sponges of laws without one.
        sizes: Size of each number of random states of Drake.
    """

    def __init__(self, machine, setup):
        self.machine, self.setup, self.context = machine, setup, setup.context
        self.derivative = StateDerivative(setup)
        self.states = self.derivative.layout.states
        self._trees = machine.state_layout.states()
        feet = places(self.context, [machine.feet] if machine.feet else [])
        sponges = places(self.context, machine.dampers.values())
        tube_sponges = places(self.context, machine.telescopes.values())
        stretches = places(self.context, machine.bushings.values())
        own = places(self.context, machine.others.values())
        self._water = water = places(self.context, [machine.water] if machine.water else [])
        count = self.context.num_continuous_states()
        known = np.concatenate([*self._trees, feet, sponges, tube_sponges, stretches, own, water])
        self._motor = np.setdiff1d(np.arange(count), known)
        rest = {
            state_map.STRUT_SPONGE: iter(sponges),
            state_map.TUBES: iter(tube_sponges),
            state_map.STRETCHES: iter(stretches),
            state_map.ELEMENT: iter(own),
            state_map.WATER: iter(water),
        }
        has_sponge = iter([damper.has_sponge for damper in setup.dampers.values()])
        trees, index, sizes = iter(self._trees), [], np.full(count, SPONGE)
        for part in self.states.parts:
            others = rest.get(part.kind)
            if part.kind == state_map.TUB:
                indices, tub = next(trees), TREE
                sizes[indices] = tub
            elif part.kind == state_map.STRUT_SPONGE:
                indices = [next(others) if next(has_sponge) else -1]
            elif part.kind == state_map.TUBES:
                tree = next(trees)
                sizes[tree] = TUBES
                indices = [*tree, next(others)]
            elif part.kind == state_map.DRIVE:
                indices = [*self._motor, -1]
                sizes[self._motor] = INTEGRAL
            elif part.kind in (state_map.STRETCHES, state_map.ELEMENT, state_map.WATER):
                indices = [next(others) for _ in part.roles]
            else:
                tree = next(trees)
                cabinet = part.kind == state_map.CABINET
                sizes[np.asarray(tree)[BODY]] = (CABINET if cabinet else TREE)[BODY]
                indices = [*np.asarray(tree)[BODY], *(feet if cabinet else [])]
            index.extend(indices)
        sizes[feet] = SLIP
        sizes[water] = 1.0
        self.of_drake, self.sizes = np.array(index, dtype=int), sizes

    def compiled_order(self, numbers):
        """Return numbers of Drake's state, or of its rate, in the order of the compiled state."""
        return np.where(self.of_drake < 0, 0.0, numbers[self.of_drake])

    def rates(self, state, acceleration=0.0, speed=0.0):
        """Return the rates by Drake and by the compiled machine, in the order of the latter.

        Args:
            state: State of Drake's diagram.
            acceleration: Acceleration of the drum, without a motor. [rad/s^2]
            speed: Speed of the drum that the controller of a motor gets. [rad/s]
        """
        self.context.SetContinuousState(state)
        self.setup.follow_water()
        if len(self._motor):
            port = self.machine.diagram.GetInputPort("drum_speed_reference")
            port.FixValue(self.context, [speed])
        else:
            self.machine.set_drum_acceleration(self.context, acceleration)
        drake = self.machine.diagram.EvalTimeDerivatives(self.context).CopyToVector()
        drum = drake[self._trees[0]][DRUM_RATE]
        if not len(self._motor):  # but for the torque on the drum over its large rotor inertia
            np.testing.assert_allclose(drum, acceleration, atol=0.01)
        compiled = self.derivative(self.compiled_order(state), drum, reference=speed)
        return self.compiled_order(drake), compiled

    def largest_difference(self, count, seed=5, visit=lambda: None):
        """Return the largest relative difference of the rates at random states.

        Each vector of each part, such as the acceleration of the tub, has a scale of its own. The
        acceleration of a joint is a small difference of large ones and has a scale of at least 10.

        Args:
            count: Number of states.
            seed: Seed of the random numbers.
            visit: Is called at each state, which the context has then.
        """
        rng, worst = np.random.default_rng(seed), 0.0
        groups = [
            (part.indices(role), 10.0 if role == state_map.JOINT_VELOCITY else 1e-3)
            for part in self.states.parts
            for role in set(part.roles)
        ]
        for _ in range(count):
            state = rng.uniform(-1.0, 1.0, len(self.sizes)) * self.sizes
            state[self._water] = np.abs(state[self._water])  # shares
            drake, compiled = self.rates(state, rng.uniform(-20.0, 20.0), rng.uniform(-60.0, 60.0))
            visit()
            for group, smallest in groups:
                scale = np.max(np.abs(drake[group]), initial=smallest)
                worst = max(worst, np.max(np.abs(drake[group] - compiled[group])) / scale)
        return worst


def difference(machine, *, load=LOAD, **options):
    """Return the largest relative difference of the rates of a machine at random states."""
    return BothEngines(machine, machine.set_up(load, **options)).largest_difference(STATES)


def check_alike(found, expected, variables, part):
    """Check that variables of a record are those of another, up to a part of the largest value."""
    assert list(found.data_vars) == list(expected.data_vars)
    found = found.sel(time=expected.time, method="nearest")  # a record may have more samples
    for name in variables:
        size = float(np.abs(expected[name]).max())
        np.testing.assert_allclose(found[name], expected[name], atol=part * size, err_msg=name)


def redrawn(tmp_path, sdf, *changes):
    """Return the path of a shipped SDF with pieces of its text replaced; frames and shapes stay.

    Args:
        tmp_path: Folder.
        sdf: Name of the file.
        changes: Regular expression and replacement of each piece.
    """
    text = sdf_path(sdf).read_text()
    for pattern, replacement in changes:
        text, count = re.subn(pattern, replacement, text, count=1, flags=re.DOTALL)
        assert count == 1
    (tmp_path / "redrawn.sdf").write_text(text)
    return str(tmp_path / "redrawn.sdf")
