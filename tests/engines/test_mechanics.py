"""The compiled machine against the Drake diagram: derivatives at random states, and what it refuses."""

import re

import pytest
from both_engines import difference, redrawn
from machines_of_each_kind import changed, machines_beside_rubber, machines_of_each_kind, names_of

from wm_drake.engines.compiled.run import run_compiled
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile

MACHINES = machines_of_each_kind() | machines_beside_rubber()
SDF = "oscillating_group.sdf"


@pytest.mark.parametrize("name", names_of(MACHINES))
def test_derivatives_are_those_of_the_diagram_at_random_states(name):
    assert difference(build_machine(MACHINES[name])) < 1e-10


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
    assert difference(machine, gasket=False) < 1e-10
    assert difference(machine, dampers=False) < 1e-10
    assert difference(machine, parameters=heavy) < 1e-10
    assert difference(machine, load=None) < 1e-10


def test_a_drum_that_turns_about_another_axis_is_represented(tmp_path):
    axis = (
        r'(<joint name="drum_axis" type="revolute">)(.*?)<xyz>0 1 0</xyz>',
        r"\1<pose>0.02 0.1 -0.03 0.2 0.1 -0.3</pose>\2<xyz>0.1 0.9 -0.2</xyz>",
    )
    damping = (
        r"(<xyz>0.1 0.9 -0.2</xyz><limit>.*?</limit>)",
        r"\1<dynamics><damping>0.3</damping></dynamics>",
    )
    machine = build_machine(changed(model=redrawn(tmp_path, SDF, axis, damping)))
    assert difference(machine) < 1e-10


REVERSED = (
    (
        r'(<joint name="drum_axis" type="revolute">\s*)<parent>tub</parent>\s*<child>drum</child>',
        r"\1<parent>drum</parent><child>tub</child>",
    ),
)
SLIDING = (
    (r'<joint name="drum_axis" type="revolute">', r'<joint name="drum_axis" type="prismatic">'),
)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        (REVERSED, "joint 'drum_axis' has the tub as its child"),
        (SLIDING, "joint 'drum_axis' is prismatic, not revolute"),
    ],
    ids=["reversed joint", "sliding drum"],
)
def test_what_it_cannot_represent_is_refused_by_name(changes, named, tmp_path):
    setup = build_machine(changed(model=redrawn(tmp_path, SDF, *changes))).set_up()
    with pytest.raises(InputError, match=re.escape(named)) as refused:
        run_compiled(
            setup, SpinProfile(time=(0.0, 1.0), speed=(0.0, 1.0)), 2.5e-3, lambda fraction: None
        )
    assert "use the drake engine" in str(refused.value)
