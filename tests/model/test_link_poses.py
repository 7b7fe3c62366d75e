"""Links of an SDF may have any frame; the machine is the same. The axis of the drum is its joint's.

A CAD program writes the frame of each part where the part has it. The same bodies, shapes and
points are written here with links at other places: all rates, distances and descriptions agree.
"""

import re

import numpy as np
import pytest
from both_engines import LOAD, BothEngines
from reposed_links import reposed

import wm_drake as wm
from wm_drake.errors import InputError
from wm_drake.model.bodies import sdf_path
from wm_drake.parameters import Load, Unbalance

TUB, DRUM = (0.03, 0.05, -0.02, 0.3, -0.2, 1.1), (0.02, 0.0, -0.04, 1.57, 0.4, -0.2)
HOUSING, MOTOR = (0.1, -0.3, 0.4, 0.1, 0.2, 0.3), (0.1, 0.1, -0.3, 1.0, 1.0, 1.0)
TUBE = (0.2, 0.1, -0.3, 0.5, -0.3, 0.9)
LINKS = {"tub": TUB, "drum": DRUM, "housing": HOUSING, "motor": MOTOR}


def machine(tmp_path, base, text):
    path = tmp_path / "bodies.sdf"
    path.write_text(text, encoding="utf-8")
    return wm.build_machine(base.model_copy(update={"model": str(path)}))


BASES = {
    "reference": LINKS,
    "ball_rings": LINKS,
    "motor": LINKS,
    "heavy_cabinet": LINKS,
    "free_stroke": LINKS | {"damper_left_outer": TUBE, "damper_left_inner": DRUM},
}


def rates(built):
    """Return rates of both engines at one random state with an unbalance, and the rest pose."""
    engines = BothEngines(built, built.set_up(LOAD))
    numbers = np.random.default_rng(3).uniform(-1.0, 1.0, len(engines.sizes)) * engines.sizes
    return [*engines.rates(numbers, 3.0, 20.0), engines.setup.rest_pose]


def shown(built):
    """Return the numbers of bodies, axis and distances of a machine."""
    described, scene = wm.describe(built), wm.Scene(built.parameters)
    gap = scene.smallest_gap(np.zeros(1), np.zeros((1, 6)), np.zeros(6))
    numbers = [gap.distance, *described["drum_joint"]["axis_T"], described["sag_at_rest"]]
    for body in described["bodies"].values():
        numbers += [*body["centre_of_mass_T"], *body["inertia_about_centre_T"].values()]
    for outline in scene.tub_outlines().values():
        numbers += [*outline.centre, *np.abs(outline.axes).ravel()]
    return numbers


@pytest.mark.parametrize("name", BASES)
def test_frames_of_links_do_not_change_the_machine(tmp_path, name):
    base = wm.load_machine(name).model_copy(update={"bodies": {}})  # its numbers are in the links
    text = sdf_path(base.model).read_text(encoding="utf-8")
    posed = machine(tmp_path, base, reposed(text, BASES[name]))
    built = wm.build_machine(base)
    for found, known in zip(rates(posed), rates(built), strict=True):
        np.testing.assert_allclose(found, known, rtol=1e-8, atol=1e-8 * np.abs(known).max())
    np.testing.assert_allclose(shown(posed), shown(built), atol=2e-5)  # Drake: 1e-5 m


def turned(text, degrees):
    """Return the text of a model that is drawn turned about z, in frames of its own."""
    links = re.findall(r'<link name="(\w+)"', text)
    there = reposed(text, dict.fromkeys(links, (0, 0, 0, 0, 0, np.radians(degrees))))
    return re.sub(r'(<link name="\w+">)\s*<pose>.*?</pose>', r"\1", there)


@pytest.mark.parametrize("degrees", [90, -90])
def test_model_that_is_drawn_turned_is_refused_and_turned_by_its_pose(tmp_path, degrees):
    base = wm.load_machine("reference").model_copy(update={"bodies": {}})
    text = turned(sdf_path(base.model).read_text(encoding="utf-8"), degrees)
    with pytest.raises(InputError, match=r"turns the drum about .* allowed is y") as refused:
        machine(tmp_path, base, text)
    pose = re.search("<pose.*?</pose>", str(refused.value))[0]
    assert pose == f'<pose degrees="true">0 0 0 0 0 {degrees}</pose>'
    back = text.replace("<link", f"{pose}<link", 1)
    expected = rates(wm.build_machine(base))
    for found, known in zip(rates(machine(tmp_path, base, back)), expected, strict=True):
        np.testing.assert_allclose(found, known, rtol=1e-8, atol=1e-8 * np.abs(known).max())


@pytest.mark.parametrize(
    ("axis", "advice"),
    [
        ("0 -1 0", "write the opposite <xyz>"),
        ("0 0 1", ">0 0 0 -90 0 0</pose>"),
        ("0 0 -1", ">0 0 0 90 0 0</pose>"),
        ("1 0.5 0", ">0 0 0 0 0 90</pose>"),
    ],
)
def test_axis_that_does_not_point_to_the_rear_is_refused(tmp_path, axis, advice):
    base = wm.load_machine("reference")
    text = sdf_path(base.model).read_text(encoding="utf-8").replace("0 1 0</xyz>", f"{axis}</xyz>")
    with pytest.raises(InputError, match=re.escape(advice)):
        machine(tmp_path, base, text)


def test_load_turns_about_the_axis_of_the_joint(tmp_path):
    base = wm.load_machine("reference")
    text = sdf_path(base.model).read_text(encoding="utf-8")
    axis = "<pose>0.05 0 0.03 0 0 0.2</pose><axis><xyz>0 1 0</xyz>"
    built = machine(tmp_path, base, text.replace("<axis><xyz>0 1 0</xyz>", axis))
    load = Load(unbalances=(Unbalance(mass=0.5, radius=0.2, y=0.1, phase=0.3),))
    plant, drum = built.plant, built.plant.GetBodyByName("drum")
    empty, loaded = (built.set_up(each).plant_context for each in (None, load))
    moment = [drum.get_mass(c) * drum.CalcCenterOfMassInBodyFrame(c) for c in (empty, loaded)]
    place = (moment[1] - moment[0]) / 0.5 - [0.05, 0.0, 0.03]
    direction = np.array([-np.sin(0.2), np.cos(0.2), 0.0])
    along = place @ direction
    assert np.linalg.norm(place - along * direction) == pytest.approx(0.2)
    from_origin = along - np.array([-0.05, 0.0, -0.03]) @ direction
    assert from_origin == pytest.approx(0.1)
    assert plant.num_velocities() == 7
