"""Frames that a machine file attaches to links of its SDF."""

import numpy as np
import pytest
from analysis_tools.sdf_text import sdf_with
from pydrake.math import RollPitchYaw

from wm_drake.errors import InputError
from wm_drake.model.bodies import sdf_path
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, with_value

NEW = """
extends: reference
name: four_springs
frames:
  spring_front_tub: {attached_to: tub, position: "(120, -120, 200) mm"}
  spring_front_housing: {attached_to: housing, position: "(120, -120, 400) mm"}
  gasket_ring: {attached_to: housing, position: "(0, -300, 0) mm", angles: "(0, 0, 30) deg"}
  gasket_ring_tub: {attached_to: tub, position: "(0, -300, 0) mm", angles: "(0, 0, 30) deg"}
springs:
  front: {type: suspension, tub_frame: spring_front_tub, housing_frame: spring_front_housing}
gasket: {housing_frame: gasket_ring, tub_frame: gasket_ring_tub}
"""


def machine_of(text, folder):
    path = folder / "file.yaml"
    path.write_text(text)
    return load_machine(path)


@pytest.fixture(scope="module")
def four(tmp_path_factory):
    parameters = machine_of(NEW, tmp_path_factory.mktemp("machine"))
    return parameters, build_machine(parameters)


def test_elements_attach_to_new_frames(four):
    _, machine = four
    setup = machine.set_up()
    np.testing.assert_allclose(setup.springs["front"].p_ToA_T, [0.12, -0.12, 0.2])
    np.testing.assert_allclose(setup.springs["front"].p_WH, [0.12, -0.12, 0.4])
    assert setup.springs["front"].preload > 0.0
    ring = setup.bushings["gasket"]
    np.testing.assert_allclose(ring.ground_side_point, [0.0, -0.3, 0.0])
    turned = RollPitchYaw(0.0, 0.0, np.deg2rad(30.0)).ToRotationMatrix().matrix()
    np.testing.assert_allclose(ring.ground_side_rotation, turned, atol=1e-15)
    assert np.max(np.abs(setup.residual)) < 1e-9


def test_a_new_frame_moves_in_the_context(four):
    parameters, machine = four
    moved = with_value(parameters, "frames.spring_front_housing.position", "(110, -120, 420) mm")
    in_context = machine.set_up(parameters=moved)
    rebuilt = build_machine(moved).set_up()
    np.testing.assert_array_equal(in_context.springs["front"].p_WH, [0.11, -0.12, 0.42])
    assert in_context.springs["front"].preload == rebuilt.springs["front"].preload
    for key, value in {"attached_to": "tub", "angles": (0.0, 0.1, 0.0)}.items():
        changed = with_value(parameters, f"frames.gasket_ring.{key}", value)
        with pytest.raises(InputError, match=r"frames.gasket_ring: .* rebuild the machine"):
            machine.set_up(parameters=changed)


def test_a_written_sdf_has_the_new_frames(four, tmp_path):
    parameters, machine = four
    model = tmp_path / "model.sdf"
    model.write_text(sdf_with(sdf_path(parameters.model).read_text(encoding="utf-8"), parameters))
    known = parameters.model_copy(update={"frames": {}, "model": str(model)})
    for name, spring in build_machine(known).set_up().springs.items():
        np.testing.assert_allclose(spring.p_ToA_T, machine.set_up().springs[name].p_ToA_T)


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ("a: {attached_to: tubb, position: '(0, 0, 0) mm'}", r"frames.a.attached_to: no link 'tubb' in the SDF .did you mean 'tub'"),
        ("spring_left_tub: {attached_to: tub, position: '(0, 0, 0) mm'}", "frames.spring_left_tub: is a frame of the SDF"),
        ("a: {position: '(0, 0, 0) mm'}", r"no frame 'a' in the SDF.*attached_to: LINK"),
        ("a: {position: '(0, 0, 0) mm', angles: '(0, 0, 9) deg'}", "only a new frame has them"),
        ("a: {attached_to: tub, position: '(0, 0, 0) mm', angles: '(0, 9) deg'}", "has 2 values"),
    ],
)  # fmt: skip
def test_frames_that_cannot_be_are_refused(tmp_path, frames, message):
    with pytest.raises(InputError, match=message):
        build_machine(machine_of(f"extends: reference\nframes:\n  {frames}\n", tmp_path))
