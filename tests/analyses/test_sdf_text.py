"""Numbers written into the text of an SDF come back out of the machine built from it."""

import re

import numpy as np
import pytest
from analysis_tools.sdf_text import sdf_with

from wm_drake.model.bodies import sdf_path, with_sdf_values
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, with_value


@pytest.fixture(scope="module")
def changed(machine):
    keys = (
        "frames.sensor_Xr.position",
        "bodies.motor.centre_of_mass",
        "bodies.tub.inertia",
        "bodies.tub.mass",
    )
    parameters = with_sdf_values(machine.drawn.plant, machine.parameters, keys)
    parameters = with_value(parameters, "frames.sensor_Xr.position", (0.01, 0.02, -0.03))
    parameters = with_value(parameters, "bodies.motor.centre_of_mass", (0.04, 0.05, -0.26))
    parameters = with_value(parameters, "bodies.tub.mass", 10.5)
    parameters = with_value(parameters, "bodies.tub.inertia.yy", 0.6)
    sources = {
        **parameters.sources,
        "frames.sensor_Xr.position": "fit: place <x> ± 1 mm",
        "bodies.tub.mass": "fit: heavy",
    }
    return parameters.model_copy(update={"sources": sources})


@pytest.fixture(scope="module")
def text(changed):
    return sdf_with(sdf_path(changed.model).read_text(encoding="utf-8"), changed)


def test_machine_built_from_the_text_is_the_overridden_one(changed, text, machine, tmp_path):
    (tmp_path / "written.sdf").write_text(text, encoding="utf-8")
    (tmp_path / "machine.yaml").write_text("extends: reference\nmodel: written.sdf\n")
    written = build_machine(load_machine(tmp_path / "machine.yaml")).set_up()
    wanted = machine.set_up(parameters=changed)
    assert np.allclose(written.sensor_points["Xr"], wanted.sensor_points["Xr"], atol=1e-6)
    inertias = [
        setup.machine.plant.GetBodyByName(name)
        .CalcSpatialInertiaInBodyFrame(setup.plant_context)
        .CopyToFullMatrix6()
        for name in ("tub", "motor")
        for setup in (written, wanted)
    ]
    assert np.allclose(inertias[0], inertias[1], atol=1e-5)
    assert np.allclose(inertias[2], inertias[3], atol=1e-5)


def test_sources_stand_beside_the_numbers_once(changed, text):
    again = sdf_with(text, changed)
    assert again == text
    assert re.search(r'name="sensor_Xr"[^\n]*<!-- fit: place <x> ± 1 mm -->', text)
    assert text.count("<!-- fit: heavy -->") == 1


def test_block_goes_with_its_centre_of_mass(text):
    link = text[text.index('<link name="motor">') : text.index("motor_to_tub")]
    assert link.count("<pose>0.04 0.05 -0.26 0 0 0</pose>") == 3


def test_all_else_stays(machine, text):
    original = sdf_path(machine.parameters.model).read_text(encoding="utf-8")
    changed_lines = set(original.splitlines()) - set(text.splitlines())
    assert 0 < len(changed_lines) < 12
