"""The 3D replay: a page of its own, and parts that are where the elements are."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from wm_drake.model import replay as replay_module
from wm_drake.model.replay import (
    COIL_RADIUS,
    GASKET_DEPTH,
    GASKET_RADIUS,
    STAVES,
    WIRE_RADIUS,
    Motion,
    _Frame,
    _parts,
    _unbalances,
    coil,
    replay_page,
    ring,
)
from wm_drake.model.scene import Scene
from wm_drake.parameters import Load, load_machine


class Recorder:
    """Stand-in for Meshcat that keeps the last transform and scale of each path."""

    def __init__(self):
        self.poses, self.scales = {}, {}

    def SetTransform(self, path, pose, _moment):
        self.poses[path] = pose

    def SetProperty(self, path, name, value, _moment):
        assert name == "scale"
        self.scales[path] = value


POSE = RigidTransform(RollPitchYaw(0.03, -0.02, 0.05), [0.02, -0.01, 0.03])


@pytest.fixture(scope="module")
def scene():
    return Scene(load_machine("reference"))


@pytest.fixture(scope="module")
def drawn(scene):
    """Return the recorded poses and scales of all parts at a pose, with the drum turned by 90 deg."""
    parameters = load_machine("reference")
    recorder = Recorder()
    drum = POSE @ RigidTransform(RollPitchYaw(0.0, np.pi / 2.0, 0.0), [0.0, 0.0, 0.0])
    frame = _Frame(0.5, POSE, drum)
    load = parameters.loads["counter"]
    for part in [*_parts(scene, parameters, gasket=True), *_unbalances(load, None)]:
        part.move(recorder, frame)
    return recorder


def ends_of(scene, kind, name):
    from wm_drake.model.frame_poses import FramePoses
    from wm_drake.model.placed_elements import placed_elements

    parameters = load_machine("reference")
    placed = placed_elements(scene.plant, FramePoses(scene.plant, parameters), parameters)
    element = getattr(placed, kind)[name]
    return POSE @ element.p_ToA_T, element.p_WH, np.linalg.norm(element.p_ToA_T - element.p_WH)


@pytest.mark.parametrize("name", ["left", "right", "rear"])
def test_spring_reaches_from_hook_to_hook(scene, drawn, name):
    tub_end, housing_end, rest_length = ends_of(scene, "springs", name)
    path = f"/elements/springs/{name}"
    factor = drawn.scales[path][2]
    np.testing.assert_allclose(drawn.poses[path].translation(), housing_end, atol=1e-12)
    np.testing.assert_allclose(
        drawn.poses[path] @ [0.0, 0.0, factor * rest_length], tub_end, atol=1e-12
    )
    assert factor != pytest.approx(1.0, abs=1e-3)
    assert drawn.scales[path][:2] == [1.0, 1.0]


@pytest.mark.parametrize("name", ["left", "right_rear", "right_front"])
def test_tubes_of_a_damper_lie_on_one_line_and_overlap(scene, drawn, name):
    tub_end, housing_end, _ = ends_of(scene, "dampers", name)
    tube, rod = (drawn.poses[f"/elements/dampers/{name}/{part}"] for part in ("tube", "rod"))
    np.testing.assert_allclose(tube.translation(), tub_end, atol=1e-12)
    np.testing.assert_allclose(rod.translation(), housing_end, atol=1e-12)
    along = (tub_end - housing_end) / np.linalg.norm(tub_end - housing_end)
    for pose in (tube, rod):
        np.testing.assert_allclose(pose.rotation().matrix()[:, 2], along, atol=1e-12)


def test_gasket_hose_ends_at_both_rings(drawn):
    rings = {end: drawn.poses[f"/elements/gasket/{end}"] for end in ("tub", "housing")}
    assert not rings["tub"].IsExactlyEqualTo(rings["housing"])
    for index in range(STAVES):
        path = f"/elements/gasket/stave_{index}"
        turn = 2.0 * np.pi * index / STAVES
        at = GASKET_RADIUS * np.array([np.cos(turn), 0.0, np.sin(turn)])
        length = drawn.scales[path][2] * GASKET_DEPTH
        pose = drawn.poses[path]
        np.testing.assert_allclose(pose.translation(), rings["housing"] @ at, atol=1e-12)
        np.testing.assert_allclose(pose @ [0.0, 0.0, length], rings["tub"] @ at, atol=1e-12)


def test_unbalances_turn_with_the_drum(drawn):
    first, second = (drawn.poses[f"/elements/unbalance/{k}"].translation() for k in (0, 1))
    parameters = load_machine("reference")
    masses = parameters.loads["counter"].unbalances
    # a mass at the top is at the right (+x) once the drum has turned by 90 deg about +y
    np.testing.assert_allclose(first, POSE @ [masses[0].radius, masses[0].y, 0.0], atol=1e-9)
    np.testing.assert_allclose(second, POSE @ [-masses[1].radius, masses[1].y, 0.0], atol=1e-9)


def test_gasket_that_is_taken_out_is_not_drawn(scene):
    parameters = load_machine("reference")
    kinds = [part.kind for part in _parts(scene, parameters, gasket=False)]
    assert kinds == ["spring"] * 3 + ["damper"] * 3


def test_a_mass_that_dries_shrinks_and_loses_its_blue():
    water = {"share": 0.6, "speed": (0.0, 60.0), "left": (1.0, 0.3), "time_constant": 20.0}
    mass = {"mass": 1.0, "radius": 0.24, "y": 0.0}
    load = Load.model_validate({"unbalances": [{**mass, "water": water}, mass]})
    wet, dry = ([*_unbalances(load, np.array([left]))] for left in (1.0, 0.0))
    assert (dry[0].radius / wet[0].radius) ** 3 == pytest.approx(0.4)
    assert wet[0].colour.b() > 0.5 > dry[0].colour.b()
    assert wet[1].colour == dry[1].colour == dry[0].colour
    assert wet[1].radius == dry[1].radius == wet[0].radius


def test_coil_and_ring_have_the_sizes_that_were_asked_for():
    for vertices, faces in (coil(0.2), ring(0.15, 0.006)):
        assert faces.min() == 0
        assert faces.max() == vertices.shape[1] - 1
        corners = vertices[:, faces]  # (3, 3, m): no triangle is degenerate
        area = np.linalg.norm(
            np.cross((corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T), axis=1
        )
        assert area.min() > 1e-8
    vertices, _ = coil(0.2)
    assert np.hypot(*vertices[:2]).max() == pytest.approx(COIL_RADIUS + WIRE_RADIUS)
    assert np.ptp(vertices[2]) == pytest.approx(0.2, abs=3 * WIRE_RADIUS)
    vertices, _ = ring(0.15, 0.006)
    assert np.hypot(vertices[0], vertices[2]).max() == pytest.approx(0.156)


def motion(positions):
    return Motion(np.array([40.0, 40.1]), positions, np.array([29.0, 30.0]))


@pytest.fixture(scope="module")
def page():
    positions = np.zeros((2, 7))
    positions[1, 3] = 0.02
    parameters = load_machine("reference")
    return replay_page(
        parameters,
        motion(positions),
        title="Machine </script><script>alert(1)</script>",
        load=parameters.loads["middle"],
    )


def test_replay_is_one_page_that_needs_nothing_else(page):
    still = replay_page(load_machine("reference"), motion(np.zeros((2, 7))))
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert len(page) > 1_000_000  # the viewer and the scene are inside
    assert 'src="http' not in page
    assert page != still
    assert "<title>Machine reference</title>" in still
    assert "unbalance</span>" not in still  # no load is given


def test_caption_has_title_times_and_speeds(page):
    data = json.loads(re.search(r"const motion = (\{.*?\}), begin", page)[1])
    assert data == {"time": [40.0, 40.1], "rpm": [276.9, 286.5]}
    shown = "Machine &lt;/script&gt;&lt;script&gt;alert(1)&lt;/script&gt;"
    assert f"<title>{shown}</title>" in page
    assert f">{shown}</div>" in page
    assert "alert(1)</script>" not in page
    assert all(f"</span> {kind}" in page for kind in ("spring", "damper", "gasket", "unbalance"))


def test_replay_is_served_to_this_computer_only(monkeypatch, reference):
    hosts = []

    def meshcat(params):
        hosts.append(params.host)
        raise KeyboardInterrupt

    monkeypatch.setattr(replay_module, "Meshcat", meshcat)
    with pytest.raises(KeyboardInterrupt):
        replay_page(reference, Motion(np.zeros(1), np.zeros((1, 7)), np.zeros(1)))
    assert hosts == ["localhost"]


COLLECTED = """
import gc, threading
import numpy as np
from wm_drake.model.replay import Motion, replay_page
from wm_drake.parameters import load_machine
gc.disable()
replay_page(load_machine("reference"), Motion(np.zeros(1), np.zeros((1, 7)), np.zeros(1)))
thread = threading.Thread(target=gc.collect)
thread.start()
thread.join()
"""


def test_garbage_of_a_replay_may_be_collected_in_any_thread():
    """A Meshcat that another thread collects ends the process, as in a study after a replay."""
    ended = subprocess.run([sys.executable, "-c", COLLECTED], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
