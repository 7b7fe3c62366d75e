"""Properties that an expert doubts: each planted one is found, an ordinary machine has none."""

import numpy as np
import pytest
from ordinary_machine import ORDINARY
from scipy.integrate import quad

from wm_drake.model.build import build_machine
from wm_drake.model.expectations import LARGEST_RING_RADIUS, bounce_frequency, unexpected
from wm_drake.model.scene import Scene
from wm_drake.parameters import load_machine, with_values


@pytest.fixture(scope="module")
def ordinary(tmp_path_factory):
    path = tmp_path_factory.mktemp("machine") / "ordinary.yaml"
    path.write_text(ORDINARY)
    parameters = load_machine(path)
    return parameters, build_machine(parameters)


def found(ordinary, values):
    parameters, machine = ordinary
    changed = with_values(parameters, values)
    return unexpected(machine.set_up(parameters=changed), Scene(changed))


def test_an_ordinary_machine_has_none(ordinary):
    assert found(ordinary, {}) == []


GASKET = "frames.gasket_{}.position"
PLANTED = {
    "stiff springs": ({"spring_types.suspension.stiffness": "9 N/mm"}, "spring_types"),
    "soft springs": ({"spring_types.suspension.stiffness": "1.2 N/mm"}, "spring_types"),
    "end bushing": ({"damper_types.friction.end_bushing.stiffness": "6600 N*mm/rad"}, "damper_types.friction.end_bushing.stiffness"),
    "torsion": ({"gasket.rotational_stiffness_y": "600000 N*mm/rad"}, "gasket.rotational_stiffness_y"),
    "gasket in the wall": ({GASKET.format(end): "(0, -311, 0) mm" for end in ("tub", "housing")}, "gasket.housing_frame"),
    "gasket in the tub": ({GASKET.format(end): "(0, -100, 0) mm" for end in ("tub", "housing")}, "gasket.housing_frame"),
    "unbalance": ({"loads.middle.unbalances.0.radius": "245 mm"}, "loads.middle.unbalances.0.radius"),
    "concrete": ({"bodies.upper_counterweight.mass": "15 kg"}, "bodies.upper_counterweight.mass"),
    "steel": ({"bodies.motor.mass": "60 kg", "spring_types.suspension.action": "tension-compression"}, "bodies.motor.mass"),
}  # fmt: skip


@pytest.mark.parametrize("name", PLANTED)
def test_what_is_planted_is_found(ordinary, name):
    values, key = PLANTED[name]
    problems = found(ordinary, values)
    assert key in [problem.key for problem in problems]
    if name != "steel":  # a heavy motor changes the bounce too
        assert len(problems) == 1
    assert all("unusual" in problem.message for problem in problems)
    assert all(len(str(problem)) < 300 for problem in problems)


def test_bounce_of_vertical_springs_follows_from_their_stiffness(ordinary):
    _, machine = ordinary
    setup = machine.set_up()
    weight = sum(spring.preload for spring in setup.springs.values())
    vertical = all(
        abs(spring.p_WH - spring.p_ToA_T)[:2].max() < 1e-9 for spring in setup.springs.values()
    )
    expected = np.sqrt(3 * 5000.0 * 9.81 / weight) / (2.0 * np.pi)
    assert bounce_frequency(setup) == pytest.approx(expected, rel=1e-6 if vertical else 0.05)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_no_ring_is_stiffer_about_its_axis_than_the_bound(share):
    """Integrate a ring with radial and tangential stiffness per length numerically."""
    radius, k_radial, k_tangential = LARGEST_RING_RADIUS, (1.0 - share) * 3000.0, share * 3000.0

    def along_x(angle):
        """Return the force along x per unit displacement along x."""
        normal, tangent = np.cos(angle), -np.sin(angle)
        return radius * (k_radial * normal**2 + k_tangential * tangent**2)

    radial = quad(along_x, 0.0, 2.0 * np.pi)[0]
    torsion = quad(lambda angle: radius * k_tangential * radius**2, 0.0, 2.0 * np.pi)[0]
    bound = 2.0 * radial * radius**2
    assert torsion <= bound * (1.0 + 1e-12)
    assert torsion == pytest.approx(share * bound, abs=1e-9)
