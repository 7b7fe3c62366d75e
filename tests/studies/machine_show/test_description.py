"""A machine is rebuilt from its description alone, and the description follows its schema."""

import json

import jsonschema
import numpy as np
import pytest
from applied_force import elastic_and_gravity_force
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, with_values
from wm_drake.parameters.files import shipped_machines
from wm_drake.studies.machine_show.description import describe, description_schema

POSE = np.array([0.02, -0.03, 0.015, 0.006, -0.004, 0.009])  # roll, pitch, yaw [rad], x, y, z [m]

SLACK = np.array([0.0, 0.04, 0.0, 0.0, 0.0, 0.025])
"""In this pose some springs of the reference machine are slack."""


@pytest.fixture(scope="module", params=shipped_machines())
def described(request, shipped):
    """Return a shipped machine, set up, and its description as it comes from a JSON file."""
    machine = shipped(request.param)
    return machine, json.loads(json.dumps(describe(machine)))


def test_description_follows_its_schema(described):
    _, plain = described
    schema = description_schema()
    assert schema["required"] == list(plain)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    validator.validate(plain)
    for change in (
        {"more": 1},
        {"springs": {"left": {}}},
        {"gravity_W": [0.0, 0.0]},
        {"sag_at_rest": "1 mm"},
        {"loads": {"front": {"unbalances": [{"mass": "1 kg"}]}}},
    ):
        assert not validator.is_valid(plain | change)


def test_schema_is_printed_with_units_meaning_and_choices(wm_drake):
    schema = json.loads(wm_drake("machine", "schema", "description").out)
    assert schema == json.loads(json.dumps(description_schema()))
    parts = {name: part["properties"] for name, part in schema["$defs"].items()}
    assert parts["Unbalance"]["mass"]["unit"] == "kg"
    assert parts["Spring"]["preload"]["description"] == "Tension as drawn."
    assert parts["Sensor"]["axis_W"]["enum"] == ["x", "y", "z"]


def curve(stiffness, x):
    """Return force or torque of a stiffness: a number or a table, as `conventions.tables` says."""
    if not isinstance(stiffness, dict):
        return stiffness * x
    abscissas, ordinates = (np.array(values) for values in stiffness.values())
    inside = np.clip(x, abscissas[0], abscissas[-1])
    table = PchipInterpolator(abscissas, ordinates)
    return float(table(inside) + table(inside, 1) * (x - inside))


def skew(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def rebuilt_force(plain, pose):
    """Return moment about To and force on the tub in W of springs, bushings, struts and gravity."""
    rotation, position = Rotation.from_euler("xyz", pose[:3]).as_matrix(), pose[3:]
    moment, force = np.zeros(3), np.zeros(3)

    def apply(point_T, f, m=(0.0, 0.0, 0.0)):
        nonlocal moment, force
        moment = moment + np.cross(rotation @ point_T, f) + m
        force = force + f

    def strut(of):
        line = position + rotation @ of["tub_point_T"] - of["housing_point_W"]
        length = np.linalg.norm(line)
        return line / length, length

    for body in plain["bodies"].values():
        if body["turns_with"] in ("tub", "drum"):
            apply(body["centre_of_mass_T"], body["mass"] * np.array(plain["gravity_W"]))
    for spring in plain["springs"].values():
        e, length = strut(spring)
        stretched = curve(spring["stiffness"], length - spring["length_at_preload"])
        tension = spring["preload"] + stretched
        s = max(tension, 0.0) / spring["taut_from"]
        tension = tension if s >= 1.0 else spring["taut_from"] * s**2 * (2.0 - s)
        apply(spring["tub_point_T"], -tension * e)
    for damper in plain["dampers"].values():
        e, length = strut(damper)
        moments = []
        for axis in (rotation @ damper["neutral_direction"], np.array(damper["neutral_direction"])):
            sines = np.cross(axis, e)
            sine = np.linalg.norm(sines)
            angle = np.arctan2(sine, axis @ e) / sine * sines
            moments.append(-damper["end_bushing"]["stiffness"] * angle)
        apply(damper["tub_point_T"], np.cross(sum(moments), e) / length, -moments[0])
    for bushing in plain["bushings"].values():
        r_law = np.array(bushing["housing_rotation_W"])
        d = r_law.T @ (position + rotation @ bushing["tub_point_T"] - bushing["housing_point_W"])
        relative = r_law.T @ rotation @ bushing["tub_rotation_T"]
        r = Rotation.from_matrix(relative).as_rotvec()
        f = [-curve(bushing[f"stiffness_{axis}"], d[i]) for i, axis in enumerate("xyz")]
        t = [-curve(bushing[f"rotational_stiffness_{axis}"], r[i]) for i, axis in enumerate("xyz")]
        theta = np.linalg.norm(r)
        k = (1.0 - 0.5 * theta / np.tan(0.5 * theta)) / theta**2
        rate_of_w = np.eye(3) - 0.5 * skew(r) + k * skew(r) @ skew(r)  # r' = rate_of_w @ w
        apply(bushing["tub_point_T"], r_law @ f, r_law @ (rate_of_w.T @ t))
    return np.concatenate([moment, force])


def test_elastic_force_is_rebuilt_from_the_description(machine):
    plain = json.loads(json.dumps(describe(machine)))
    setup = machine.set_up()
    for pose in (POSE, -2.0 * POSE, SLACK):
        positions = machine.plant.GetPositions(setup.plant_context)
        positions[machine.state_layout.tub] = pose
        machine.plant.SetPositions(setup.plant_context, positions)
        expected = elastic_and_gravity_force(machine, setup)
        assert np.abs(expected).max() > 10.0
        np.testing.assert_allclose(rebuilt_force(plain, pose), expected, rtol=1e-9, atol=1e-9)


def test_imperfections_and_points_are_described(machine, reference):
    changed = with_values(
        reference,
        {
            "imperfections.residual_imbalance.mass": "20 g",
            "imperfections.residual_imbalance.radius": "240 mm",
            "imperfections.phase_error": "5 deg",
        },
    )
    plain, found = describe(machine), describe(build_machine(changed))
    assert found["imperfections"]["residual_imbalance"]["mass"] == pytest.approx(0.02)
    assert found["imperfections"]["phase_error"] == pytest.approx(np.deg2rad(5.0))
    assert found["imperfections"] != plain["imperfections"]
    assert found["bodies"] == plain["bodies"]  # the residual imbalance is not in the empty drum
    assert list(plain["accelerometers"]) == ["S1", "S2", "S3"]
    assert plain["drum_joint"]["start_angle"] == 0.0
    assert "[A] (2), (3)" in plain["laws"]["havsin"]
    assert plain["numerics"]["step_s"] == reference.step


def test_neutral_direction_is_that_of_the_drawing_not_of_rest():
    """Put a spring hook out of place: the rest pose tilts, end bushings stay neutral as drawn."""
    parameters = with_values(
        load_machine("reference"), {"frames.spring_left_housing.position": "(-320, -190, 390) mm"}
    )
    plain = describe(build_machine(parameters))
    damper = plain["dampers"]["left"]
    drawn = np.subtract(damper["tub_point_T"], damper["housing_point_W"])
    np.testing.assert_allclose(damper["neutral_direction"], drawn / np.linalg.norm(drawn))
    assert (
        np.abs(np.subtract(damper["direction_at_rest_W"], damper["neutral_direction"])).max() > 1e-6
    )


def test_a_motor_is_described(described, machine):
    driven, plain = described
    drive = driven.parameters.drive
    if drive.kind == "prescribed":
        assert plain["motor"] is None
        return
    assert plain["motor"]["belt_ratio"] == drive.belt_ratio
    assert plain["motor"]["torque_limit"] == {"torque": 2.2, "power": 550.0}
    # n J of the rotor is at the drum instead of the tub, see wm_drake.model.rotor
    reference = describe(machine)["bodies"]
    for body, sign in (("drum", 1.0), ("tub", -1.0)):
        inertias = (b[body]["inertia_about_centre_T"]["yy"] for b in (plain["bodies"], reference))
        change = np.subtract(*inertias)
        assert change == pytest.approx(sign * drive.belt_ratio * drive.rotor_inertia)
