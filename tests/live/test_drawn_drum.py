"""What turns with the drum is drawn where Drake and the record have it: masses, balls, liquid."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from drum_rings import with_rings
from exported_machine import NodePage
from pydrake.math import RigidTransform, RollPitchYaw

import wm_drake as wm
from wm_drake.elements.kind import element_kind
from wm_drake.live.exported import STATIC, export_page
from wm_drake.live.machine import OpenMachine, drum_of
from wm_drake.live.state import PageState
from wm_drake.parameters import SpinProfile
from wm_drake.studio.answers import picture, picture_runner_of

BALLS = {
    "kind": "ball_ring", "y": -0.15, "balls": 3, "ball_mass": 0.06, "ball_diameter": 0.025,
    "race_radius": 0.22, "damping": 0.03, "start_angles": (0.3, 1.5, 4.0),
}  # fmt: skip
LIQUID = {
    "kind": "liquid_ring", "y": 0.15, "inner_radius": 0.2, "outer_radius": 0.24, "width": 0.04,
    "fill": 0.5, "lag": 0.1,
}  # fmt: skip
QUICK = SpinProfile(time=(0.0, 1.0), speed=(20.0, 30.0))


def in_drum(turning, frame):
    """Return the balls and circles of a frame, as the pages draw them, in T."""
    if shutil.which("node") is None:
        pytest.skip("no node: install Debian's nodejs")
    code = (
        f"const scene = await import('{STATIC / 'scene.js'}');"
        f"console.log(JSON.stringify(scene.inDrum({json.dumps(turning)}, {json.dumps(frame)})))"
    )
    command = ["node", "--input-type=module", "--eval", code]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def drum_in_tub(machine, pose, angle):
    """Return the pose of the drum in T, from Drake."""
    context = machine.plant.CreateDefaultContext()
    machine.plant.SetPositions(context, [*pose, angle])
    X_WT = RigidTransform(RollPitchYaw(pose[:3]), pose[3:])
    drum = machine.plant.GetBodyByName("drum")
    return X_WT.inverse() @ machine.plant.EvalBodyPoseInWorld(context, drum)


def test_masses_are_where_drake_has_them(machine, reference):
    masses = reference.loads["counter"].unbalances
    frame = {"pose": [0.1, -0.2, 0.3, 0.01, 0.02, 0.03], "angle": 1.2, "balls": []}
    shown = [{**mass.model_dump(include={"mass", "radius", "y", "phase"})} for mass in masses]
    drum = drum_of(machine.set_up(None))
    turning = {"drum": drum, "masses": shown, "rings": [], "density": 1000.0}
    found = in_drum(turning, frame)["balls"]
    X_TD = drum_in_tub(machine, frame["pose"], frame["angle"])
    for ball, mass in zip(found, masses, strict=True):
        np.testing.assert_allclose(ball["place"], X_TD @ np.array(mass.position()), atol=1e-12)
        assert 4.0 / 3.0 * np.pi * 1000.0 * ball["radius"] ** 3 == pytest.approx(mass.mass)


@pytest.fixture(scope="module")
def rings():
    """Return an open machine with both kinds of rings, and the profile of its runs."""
    parameters = with_rings(front=BALLS, rear=LIQUID)
    parameters = parameters.model_copy(update={"profile": QUICK, "step": 2.5e-4, "cabinet": None})
    machine = wm.build_machine(parameters)
    return OpenMachine(parameters, machine, wm.Scene(parameters))


def test_balls_and_liquid_are_where_the_record_has_them(rings):
    answer = picture(rings, picture_runner_of(rings), PageState(machine="", load="middle"))
    shown = rings.for_page()["rings"]
    values = {key: slider.number.nominal for key, slider in rings.sliders.items()}
    drawn = [
        {"y": values[ring["y"]], "across": values[ring["across"]], "isLiquid": ring["isLiquid"],
         "radii": [values[key] for key in ring["radii"]]}
        for ring in shown
    ]  # fmt: skip
    record = wm.simulate(rings.machine, wm.case_of(rings.parameters, "middle"))
    frames, times = answer["motion"]["frames"], answer["motion"]["time"]
    at = len(times) // 2
    turning = {**answer["motion"], "rings": drawn, "density": 1000.0, "masses": []}
    found = in_drum(turning, frames[at])
    sample = record.sel(time=[times[at]], method="nearest")
    X_TD = drum_in_tub(rings.machine, frames[at]["pose"], frames[at]["angle"])
    expected = []
    for name, element in rings.parameters.elements.items():
        kind = element_kind(element.kind)
        outputs = {
            output.name: sample[f"{kind.name}_{output.name}"].sel({kind.name: name}).values
            for output in kind.outputs
        }
        expected += [X_TD @ place for place in kind.ring.places(element, outputs)[0]]
    places = np.array([ball["place"] for ball in found["balls"]])
    # an elastic race gives by some micrometres, and frames are rounded
    np.testing.assert_allclose(places, expected, atol=5e-5)
    assert np.ptp(places[:3], axis=0).max() > 0.1  # the balls are apart
    assert [ball["kind"] for ball in found["balls"]] == ["ball"] * 3 + ["water"]
    radii = [BALLS["race_radius"], LIQUID["outer_radius"], LIQUID["inner_radius"]]
    for circle, radius, y in zip(found["circles"], radii, (-0.15, 0.15, 0.15), strict=True):
        in_d = [X_TD.inverse() @ np.array(point) for point in circle]
        np.testing.assert_allclose([np.hypot(p[0], p[2]) for p in in_d], radius, atol=1e-9)
        np.testing.assert_allclose([p[1] for p in in_d], y, atol=1e-9)


@pytest.mark.hours
def test_an_exported_page_has_the_frames_of_the_studio(rings, tmp_path):
    answer = picture(rings, picture_runner_of(rings), PageState(machine="", load="middle"))
    export_page(rings.parameters, tmp_path / "machine.html")
    page = NodePage(tmp_path / "machine.html")
    found = page.run("middle")
    page.close()
    assert page.data["drum"] == answer["motion"]["drum"]
    expected = answer["gap_points"]["frame"]
    assert found.frame["angle"] == pytest.approx(expected["angle"], abs=1e-4)
    np.testing.assert_allclose(found.frame["pose"], expected["pose"], atol=1e-6)
    for ring, other in zip(found.frame["balls"], expected["balls"], strict=True):
        np.testing.assert_allclose(ring, other, atol=1e-5)
