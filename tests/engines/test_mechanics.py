"""The compiled machine against the Drake diagram: derivatives at random states, and what it refuses."""

import re

import numpy as np
import pytest
from machines_of_each_kind import changed, machines_of_each_kind, names_of_each_kind

from wm_drake.engines.compiled.derivative import StateDerivative
from wm_drake.engines.compiled.mechanics import DRUM_RATE
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.errors import InputError
from wm_drake.model.bodies import sdf_path
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, Unbalance

MACHINES = machines_of_each_kind()
LOAD = Load(
    unbalances=(
        Unbalance(mass=1.3, radius=0.24, y=-0.1, phase=0.7),
        Unbalance(mass=0.4, radius=0.2, y=0.12, phase=2.9),
        Unbalance(mass=0.2, radius=0.1, y=0.0, phase=-1.0),
    )
)
SIZES = np.array(
    [1.0, 1.2, 1.0] + [0.15] * 3 + [30.0] + [8.0] * 3 + [3.0] * 3 + [150.0]
)  # rad, m, rad/s, m/s
SPONGE = 0.01  # m


def both_derivatives(machine, setup, compiled, state, acceleration):
    """Return the time derivatives of the diagram and of the compiled machine, at the drum acceleration of the diagram."""
    context = setup.context
    context.SetContinuousState(state)
    machine.set_drum_acceleration(context, acceleration)
    by_drake = machine.diagram.EvalTimeDerivatives(context).CopyToVector()
    # sponges of laws that have one are Drake's states; the compiled machine keeps a number for each damper
    sponges = [index for index, damper in enumerate(setup.dampers.values()) if damper.has_sponge]
    # the stretches of rubber bushings come last in both
    end = 14 + len(setup.dampers)
    x = np.concatenate([state[:14], np.zeros(len(setup.dampers)), state[14 + len(sponges) :]])
    x[14 + np.array(sponges, dtype=int)] = state[14 : 14 + len(sponges)]
    dx = compiled(x, by_drake[DRUM_RATE])
    assert not dx[14:end][~np.isin(np.arange(len(setup.dampers)), sponges)].any()
    return by_drake, np.concatenate([dx[:14], dx[14 + np.array(sponges, dtype=int)], dx[end:]])


def worst_difference(machine, setup, count=1000, seed=5):
    """Return the largest relative difference, per vector: angle rates, velocity, angular acceleration, acceleration, sponges."""
    rng = np.random.default_rng(seed)
    states, derivative = setup.context.num_continuous_states(), StateDerivative(setup)
    worst = 0.0
    for _ in range(count):
        state = rng.uniform(-1.0, 1.0, states) * np.append(SIZES, np.full(states - 14, SPONGE))
        acceleration = rng.uniform(-20.0, 20.0)
        drake, compiled = both_derivatives(machine, setup, derivative, state, acceleration)
        assert drake[DRUM_RATE] == pytest.approx(
            acceleration, abs=1e-4
        )  # torques of some kN m over 1e8 kg m2
        for part in (
            slice(0, 3),
            slice(3, 6),
            slice(6, 7),
            slice(7, 10),
            slice(10, 13),
            slice(14, None),
        ):
            scale = np.max(np.abs(drake[part]), initial=1e-3)
            worst = max(worst, np.max(np.abs(drake[part] - compiled[part]), initial=0.0) / scale)
    return worst


@pytest.mark.parametrize("name", names_of_each_kind())
def test_derivatives_are_those_of_the_diagram_at_1000_random_states(name):
    machine = build_machine(MACHINES[name])
    assert worst_difference(machine, machine.set_up(LOAD)) < 1e-10


def test_derivatives_agree_without_gasket_and_dampers_and_with_other_bodies():
    reference = MACHINES["reference"]
    heavy = changed(
        bodies={
            "drum": {"mass": 11.0, "centre_of_mass": (0.03, 0.05, -0.02)},
            "motor": {"mass": 3.0},
        },
        frames={"damper_left_tub": {"position": (-0.12, 0.03, -0.2)}},
    )
    machine = build_machine(reference)
    assert worst_difference(machine, machine.set_up(LOAD, gasket=False), 200) < 1e-10
    assert worst_difference(machine, machine.set_up(LOAD, dampers=False), 200) < 1e-10
    assert worst_difference(machine, machine.set_up(LOAD, parameters=heavy), 200) < 1e-10
    assert worst_difference(machine, machine.set_up(), 200) < 1e-10


def redrawn(tmp_path, *changes):
    """Write the SDF of the reference machine with pieces of its text replaced; frames and shapes stay."""
    text = sdf_path("oscillating_group.sdf").read_text()
    for pattern, replacement in changes:
        text, count = re.subn(pattern, replacement, text, count=1, flags=re.DOTALL)
        assert count == 1
    (tmp_path / "redrawn.sdf").write_text(text)
    return changed(model=str(tmp_path / "redrawn.sdf"))


def test_a_drum_that_turns_about_another_axis_is_represented(tmp_path):
    axis = (
        r'(<joint name="drum_axis" type="revolute">)(.*?)<xyz>0 1 0</xyz>',
        r"\1<pose>0.02 0.1 -0.03 0.2 0.1 -0.3</pose>\2<xyz>0.1 0.9 -0.2</xyz>",
    )
    damping = (
        r"(<xyz>0.1 0.9 -0.2</xyz><limit>.*?</limit>)",
        r"\1<dynamics><damping>0.3</damping></dynamics>",
    )
    machine = build_machine(redrawn(tmp_path, axis, damping))
    assert worst_difference(machine, machine.set_up(LOAD), 300) < 1e-10


REVERSED = (
    (
        r'(<joint name="drum_axis" type="revolute">\s*)<parent>tub</parent>\s*<child>drum</child>',
        r"\1<parent>drum</parent><child>tub</child>",
    ),
)
SLIDING = (
    (r'<joint name="drum_axis" type="revolute">', r'<joint name="drum_axis" type="prismatic">'),
)
EXTRA_FORCE = (
    (
        r"</model>",
        """<drake:linear_bushing_rpy xmlns:drake="drake.mit.edu"><drake:bushing_frameA>gasket_tub</drake:bushing_frameA>
        <drake:bushing_frameC>gasket_housing</drake:bushing_frameC>
        <drake:bushing_torque_stiffness>1 1 1</drake:bushing_torque_stiffness>
        <drake:bushing_torque_damping>1 1 1</drake:bushing_torque_damping>
        <drake:bushing_force_stiffness>1 1 1</drake:bushing_force_stiffness>
        <drake:bushing_force_damping>1 1 1</drake:bushing_force_damping></drake:linear_bushing_rpy></model>""",
    ),
)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        (REVERSED, "joint 'drum_axis' has the tub as its child"),
        (SLIDING, "joint 'drum_axis' is prismatic, not revolute"),
        (EXTRA_FORCE, "force element LinearBushingRollPitchYaw of the SDF"),
    ],
    ids=["reversed joint", "sliding drum", "force element"],
)
def test_what_it_cannot_represent_is_refused_by_name(changes, named, tmp_path):
    machine = build_machine(redrawn(tmp_path, *changes))
    setup = machine.set_up()
    with pytest.raises(InputError, match=re.escape(named)) as refused:
        run_compiled(
            setup, SpinProfile(time=(0.0, 1.0), speed=(0.0, 1.0)), 2.5e-3, lambda fraction: None
        )
    assert "use the drake engine" in str(refused.value)
