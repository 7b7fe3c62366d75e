"""Tests of usual ranges: shipped machines are inside, slips of unit and keyboard are found."""

import pytest
from simple_machines import SPONGES

from wm_drake.model.build import build_machine
from wm_drake.model.expectations import unusual_springs, unusual_values
from wm_drake.parameters import load_machine, quantities, with_values
from wm_drake.parameters.files import shipped_machines
from wm_drake.parameters.gasket_drawing import load_gasket_drawing
from wm_drake.parameters.plausibility import RANGES, unusual_numbers, usual_range


@pytest.mark.parametrize("name", shipped_machines())
def test_shipped_machine_has_nothing_unusual(name):
    machine = load_machine(name)
    known = {"profile.speed"} if name == "rodrigues_2010" else set()  # a rotor rig, to 5300 rpm
    found = unusual_values(build_machine(machine).set_up())
    assert {problem.key for problem in found} == known


SLIPS = {
    "mass of a load in g": {"loads.middle.unbalances.0.mass": "800 kg"},
    "radius in m": {"loads.middle.unbalances.0.radius": "240 m"},
    "y in m": {"loads.middle.unbalances.0.y": "-20 m"},
    "spring in N/m": {"spring_types.suspension.stiffness": "6.5 N/m"},
    "spring in kN/mm": {"spring_types.suspension.stiffness": "6.5 kN/mm"},
    "gasket in N/mm^-1": {"gasket.damping_x": "19 N s/mm"},
    "friction in kN": {"damper_types.friction.friction_force": "40 kN"},
    "no gravity": {"gravity": "981 m/s^2"},
    "phase in rad": {"imperfections.phase_error": "180 deg"},
}


@pytest.mark.parametrize("slip", SLIPS)
def test_slip_is_found(reference, slip):
    (key,) = SLIPS[slip]
    (problem,) = unusual_numbers(with_values(reference, SLIPS[slip]))
    assert problem.key == key
    assert " is unusual; usual is " in problem.message


def test_slip_of_a_sponge_is_found(sponges):
    soft = with_values(sponges, {"damper_types.friction.sponge_stiffness": "50 N/m"})
    (problem,) = unusual_numbers(soft)
    assert problem.key == "damper_types.friction.sponge_stiffness"


@pytest.mark.parametrize(
    ("key", "inside", "outside"),
    [
        ("loads.middle.unbalances.0.mass", "5 kg", "5.001 kg"),
        ("loads.middle.unbalances.0.radius", "400 mm", "400.1 mm"),
        ("spring_types.suspension.stiffness", "1 N/mm", "0.999 N/mm"),
        ("imperfections.phase_error", "45 deg", "45.1 deg"),
    ],
)
def test_ends_of_a_range_are_usual(reference, key, inside, outside):
    assert unusual_numbers(with_values(reference, {key: inside})) == []
    assert len(unusual_numbers(with_values(reference, {key: outside}))) == 1


MORE = """extends: reference
bodies: {drum: {mass: 9 kg, centre_of_mass: "(0, 0, 0) mm"}}
frames:
  gasket_tub: {position: "(0, 0, 0) mm"}
  more: {attached_to: tub, position: "(0, 0, 0) mm", angles: "(0, 0, 0) deg"}
springs: {left: {preload: 90 N}}
gasket: {rotational_stiffness_x: {angle: "(-3, 0, 3) deg", torque: "(-1, 0, 1) N m"}}
loads:
  towels:
    unbalances:
      - {mass: 1 kg, radius: 240 mm, y: 0 mm, water: {share: 0.6, speed: "(0, 400) rpm", left: "(1, 0.6)", time_constant: 20 s}}
spring_types:
  free: {stiffness: 8 N/mm, free_length: 150 mm}
  table: {stiffness: {displacement: "(-20, 0, 20) mm", force: "(-160, 0, 160) N"}}
"""


def test_every_range_belongs_to_a_number_and_has_its_unit(tmp_path):
    (tmp_path / "more.yaml").write_text(MORE)
    machines = map(load_machine, [*shipped_machines(), SPONGES, tmp_path / "more.yaml"])
    units = {key: unit.shown for machine in machines for key, _, unit in quantities(machine)}
    units |= dict.fromkeys(load_gasket_drawing("folded").sizes, "mm")
    used = {usual: key for key in units if (usual := usual_range(key)) and usual.unit == units[key]}
    assert [usual.pattern for usual in RANGES if usual not in used] == []


def test_spring_too_soft_for_its_weight_has_no_free_length(machine, reference):
    """Check free length = length - preload / stiffness: 0 at stiffness = preload / length."""
    setup = machine.set_up()
    limits = {
        f"springs.{name}": spring.preload / spring.rest_length
        for name, spring in setup.springs.items()
    }
    limit = max(limits.values())
    assert min(limits.values()) < 0.99 * limit
    for factor in (1.001, 0.999):
        found = [name for name in limits if limits[name] > factor * limit]
        assert bool(found) == (factor < 1.0)
        soft = with_values(reference, {"spring_types.suspension.stiffness": factor * limit})
        problems = unusual_springs(build_machine(soft).set_up())
        assert [problem.key for problem in problems] == found
    stiff = with_values(reference, {"spring_types.suspension.stiffness": "6.5 N/m"})
    assert len(unusual_springs(build_machine(stiff).set_up())) == 3
