"""A cabinet that moves on its feet: the compiled machine against the Drake diagram."""

import numpy as np
import pytest
from machine_with_bearing import with_bearing
from machines_of_each_kind import machines_of_each_kind
from moving_cabinet import with_moving_cabinet

from wm_drake.engines.compiled.derivative import StateDerivative
from wm_drake.engines.compiled.mechanics import DRUM_RATE
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, Unbalance

LOAD = Load(
    unbalances=(
        Unbalance(mass=0.6, radius=0.24, y=-0.1, phase=0.7),
        Unbalance(mass=0.4, radius=0.2, y=0.12, phase=2.9),
    )
)
SIZES = np.array([1.0, 1.2, 1.0] + [0.15] * 3 + [30.0] + [8.0] * 3 + [3.0] * 3 + [150.0])
"""Sizes of the state of a tree. [rad, m, rad/s, m/s]"""
CABINET_SIZES = np.array([2e-3] * 3 + [1e-3] * 3 + [0.0] + [0.05] * 3 + [0.05] * 3 + [0.0])
"""Sizes at which some feet are lifted and some slide, and others stick. [rad, m, rad/s, m/s]"""
VECTORS = (slice(0, 3), slice(3, 6), slice(7, 10), slice(10, 13))
WITHOUT_JOINT = np.delete(np.arange(14), (6, 13))


def machines():
    kinds = machines_of_each_kind()
    found = {"reference": kinds["reference"], "springs only": kinds["springs only"]}
    found["three laws"] = kinds["two bushings, five dampers of three laws"]
    found["compliant bearing"] = with_bearing(kinds["reference"])
    return {name: with_moving_cabinet(parameters) for name, parameters in found.items()}


MACHINES = machines()


def compared(machine, setup, count, seed=5):
    """Return the largest relative difference of the time derivatives, and what the feet did.

    The states of feet are between stuck and sliding, on the floor and lifted.
    """
    rng, context, trees = np.random.default_rng(seed), setup.context, machine.state_layout.states()
    derivative, worst, did = StateDerivative(setup), 0.0, set()
    sponges = sum(damper.has_sponge for damper in setup.dampers.values())
    has_sponge = [damper.has_sponge for damper in setup.dampers.values()]
    for _ in range(count):
        blocks = [rng.uniform(-1.0, 1.0, 14) * SIZES for _ in trees]
        blocks[-1] = rng.uniform(-1.0, 1.0, 14) * CABINET_SIZES
        own = np.append(rng.uniform(-0.01, 0.01, sponges), rng.uniform(-2e-3, 2e-3, 8))
        state = np.zeros(context.num_continuous_states())
        for tree, block in reversed(list(zip(trees, blocks, strict=True))):
            state[tree] = block  # the drum's are those of the first
        state[-len(own) :] = own
        context.SetContinuousState(state)
        machine.set_drum_acceleration(context, rng.uniform(-20.0, 20.0))
        told = machine.diagram.EvalTimeDerivatives(context).CopyToVector()
        struts = np.zeros(len(has_sponge))
        struts[has_sponge] = own[:sponges]
        others = [block[WITHOUT_JOINT] for block in blocks[1:]]
        dx = derivative(
            np.concatenate([blocks[0], struts, *others, own[sponges:]]), told[trees[0]][DRUM_RATE]
        )
        parts = np.split(dx, np.cumsum([14, len(struts)] + [12] * len(others))[:-1])
        mine = [parts[0], *(np.insert(p[:12], (6, 12), 0.0) for p in parts[2:])]
        for a, tree in zip(mine, trees, strict=True):
            for part in VECTORS:
                scale = np.max(np.abs(told[tree][part]), initial=1e-3)
                worst = max(worst, np.max(np.abs(a[part] - told[tree][part])) / scale)
        slips = told[-8:]
        worst = max(worst, np.max(np.abs(dx[-8:] - slips)) / max(1e-3, np.max(np.abs(slips))))
        floor = machine.outputs["feet_floor_force"]
        force = floor.Eval(machine.feet.GetMyContextFromRoot(context)).reshape(4, 3)
        did |= {"lifted" if f[2] == 0.0 else "pressed" for f in force}
        did |= {"sticks" if not np.any(w) else "slides" for w in slips.reshape(4, 2)}
    return worst, did


@pytest.mark.parametrize("name", MACHINES)
def test_derivatives_are_those_of_the_diagram_at_random_states(name):
    machine = build_machine(MACHINES[name])
    worst, did = compared(machine, machine.set_up(LOAD), 1000 if name == "reference" else 200)
    assert worst < 1e-10
    assert did == {"lifted", "pressed", "sticks", "slides"}
