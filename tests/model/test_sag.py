"""Given preloads and free lengths: the machine sags to the pose where all forces balance."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.model.equilibrium import tensions_at
from wm_drake.parameters import with_value, with_values
from wm_drake.studies.machine_show.description import describe, oscillating_mass

FREE_LENGTH = "spring_types.suspension.free_length"


@pytest.fixture(scope="module")
def bare(reference):
    """Return the reference machine without gasket and without bending resistance of its dampers."""
    stiffness = "damper_types.friction.end_bushing.stiffness"
    return with_value(reference, stiffness, 0.0)


def set_up(machine, parameters):
    return machine.set_up(parameters=parameters, gasket=False)


def lift(setup):
    """Return the vertical force of the springs on the tub at rest. [N]"""
    tensions, total = tensions_at(setup.elements, setup.rest_pose), 0.0
    for name, spring in setup.springs.items():
        tub_point = setup.rest_pose[3:] + np.array(
            setup.machine.plant.GetBodyByName("tub")
            .EvalPoseInWorld(setup.plant_context)
            .rotation()
            .multiply(spring.p_ToA_T)
        )
        line = spring.p_WH - tub_point
        total += tensions[name] * line[2] / np.linalg.norm(line)
    return total


def test_preloads_of_the_equilibrium_give_no_sag(machine, bare):
    solved = set_up(machine, bare)
    given = {f"springs.{name}.preload": s.preload for name, s in solved.springs.items()}
    again = set_up(machine, with_values(bare, given))
    np.testing.assert_allclose(again.rest_pose, solved.rest_pose, atol=1e-9)


def test_free_lengths_of_the_equilibrium_give_no_sag(machine, bare):
    """Give each spring a type of its own."""
    solved = set_up(machine, bare)
    plain = bare.model_dump()
    kind = plain["spring_types"]["suspension"]
    plain["spring_types"] |= {
        name: kind | {"free_length": s.free_length} for name, s in solved.springs.items()
    }
    for name in solved.springs:
        plain["springs"][name]["type"] = name
    again = set_up(machine, type(bare).model_validate(plain))
    np.testing.assert_allclose(again.rest_pose, solved.rest_pose, atol=1e-8)


@pytest.mark.parametrize("change", [-8e-3, 5e-3, 10e-3])  # m
def test_springs_carry_the_weight_where_the_machine_rests(machine, bare, change):
    middle = np.mean([spring.free_length for spring in set_up(machine, bare).springs.values()])
    setup = set_up(machine, with_value(bare, FREE_LENGTH, float(middle + change)))
    weight = oscillating_mass(setup) * setup.parameters.gravity
    assert np.max(np.abs(setup.residual)) < 1e-9
    assert lift(setup) == pytest.approx(weight, rel=1e-9)


def test_less_preload_lets_the_machine_sag_by_force_over_stiffness(machine, bare):
    """Check sag = force over stiffness of the generalized coordinates, for small changes."""
    solved = set_up(machine, bare)
    loss = 0.02  # N in each spring
    less = {f"springs.{name}.preload": s.preload - loss for name, s in solved.springs.items()}
    sagged = set_up(machine, with_values(bare, less))
    more = {f"springs.{name}.preload": s.preload + loss for name, s in solved.springs.items()}
    raised = set_up(machine, with_values(bare, more))
    down, up = sagged.rest_pose - solved.rest_pose, raised.rest_pose - solved.rest_pose
    np.testing.assert_allclose(down, -up, rtol=2e-2, atol=1e-8)
    assert down[5] < -1e-7


def test_some_preloads_can_be_given(machine, bare):
    left = set_up(machine, bare).springs["left"].preload
    setup = set_up(machine, with_value(bare, "springs.left.preload", left + 5.0))
    assert setup.springs["left"].preload == left + 5.0
    assert np.max(np.abs(setup.residual)) < 1e-9


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({FREE_LENGTH: 0.32}, r"springs: with the given preloads .* allowed are 100 mm and 15 deg"),
        ({"springs.left.preload": -150.0}, r"springs\.left: is slack at rest"),
        ({FREE_LENGTH: 0.15, "springs.left.preload": 9.0}, "give only one of them"),
        ({FREE_LENGTH: -0.1}, "out of range"),
    ],
)
def test_impossible_numbers_are_refused(machine, reference, values, message):
    with pytest.raises(InputError, match=message):
        machine.set_up(parameters=with_values(reference, values))


def test_sag_is_described(upright):
    plain = describe(build_machine(upright))
    assert abs(plain["sag_at_rest"]) < 1e-9
    for spring in plain["springs"].values():
        assert spring["tension_at_rest"] == pytest.approx(spring["preload"])


def test_described_sag_is_that_of_the_centre_of_mass(machine, reference):
    longest = max(spring.free_length for spring in machine.set_up().springs.values())
    longer = build_machine(with_value(reference, FREE_LENGTH, longest + 5e-3))
    plain, setup = describe(longer), longer.set_up()
    centre = sum(
        body["mass"] * np.array(body["centre_of_mass_T"]) for body in plain["bodies"].values()
    ) / sum(body["mass"] for body in plain["bodies"].values())
    pose = plain["rest_pose"]
    rotation = Rotation.from_euler("xyz", [pose[name] for name in ("roll", "pitch", "yaw")])
    height = pose["z"] + rotation.apply(centre)[2]
    assert plain["sag_at_rest"] == pytest.approx(centre[2] - height, rel=1e-9)
    assert plain["sag_at_rest"] > 1e-3
    tensions = tensions_at(setup.elements, setup.rest_pose)
    assert {n: s["tension_at_rest"] for n, s in plain["springs"].items()} == tensions
