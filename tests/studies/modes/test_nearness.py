"""Which mode brings the tub to the housing, and words for modes that nothing damps."""

from types import SimpleNamespace

import numpy as np
import pytest

from wm_drake.model.scene import Scene
from wm_drake.parameters import load_machine
from wm_drake.studies.modes.linearisation import SLIDING, STUCK
from wm_drake.studies.modes.page import about_damping
from wm_drake.studies.modes.quantities import DAMPING
from wm_drake.studies.modes.shapes import ANGLE_ARM, NAMES, Mode, nearness


def mode(name, shape=(0.0,) * 6, damping=0.1):
    none = np.zeros(0)
    return Mode(name, 1.0, damping, np.array(shape, complex), none, none, none)


def pure_modes():
    """Return modes in which one coordinate moves."""
    weight = np.repeat([ANGLE_ARM, 1.0], 3)
    return [mode(name, np.eye(6)[i] / weight[i]) for i, name in enumerate(NAMES.values())]


@pytest.fixture(scope="module")
def scene():
    return Scene(load_machine("reference"))


def test_gap_in_a_mode_is_that_of_the_nearest_end_of_its_motion(scene):
    amplitude, rest = 5e-3, np.zeros(6)
    near = nearness(scene, rest, pure_modes(), amplitude)
    for place, name in enumerate(NAMES.values()):
        reach = amplitude / (ANGLE_ARM if place < 3 else 1.0)
        ends = np.outer([reach, -reach], np.eye(6)[place])
        expected = scene.smallest_gap(np.arange(2.0), ends, rest)
        # an angle may have its smallest gap before the end of the motion
        assert near.of_mode[name].distance == pytest.approx(expected.distance, abs=2e-5), name
    gaps = {name: gap.distance for name, gap in near.of_mode.items()}
    assert max(gaps.values()) <= near.at_rest.distance + 1e-6
    assert gaps[near.nearest] == min(gaps.values())


def test_damping_of_rounding_errors_is_said_in_words():
    assert [DAMPING.text(x) for x in (3e-16, -2e-15, 0.0684)] == ["undamped", "undamped", "0.0684"]
    damped, none = mode("sway"), mode("roll", damping=3e-16)

    def said(sliding, stuck):
        return about_damping(SimpleNamespace(modes={SLIDING: sliding, STUCK: stuck}))

    assert said([damped], [damped]) == ""
    assert "roll" in said([damped, none], [damped])
    assert "sway" not in said([damped, none], [damped])
