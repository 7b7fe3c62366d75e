"""Element kinds of other packages, through every door that elements of this package have."""

import json
import os
import subprocess
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from both_engines import check_alike, difference
from drag_damper import DRAG_DAMPER
from drake_spectrum import drake_spectrum
from element_ports import check_derivatives
from energy_book import EnergyBook, dense_record
from maxwell_strut import MAXWELL_STRUT
from moving_cabinet import with_moving_cabinet
from side_by_side import cases_with, check_runs_alone

import wm_drake as wm
from wm_drake.elements.kind import Ends
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.model.replay import Motion, replay_page
from wm_drake.parameters import MachineParameters, SpinProfile, load_machine
from wm_drake.parameters.file_keys import file_schema, key_groups
from wm_drake.parameters.files import machine_yaml
from wm_drake.parameters.keys import quantities
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate
from wm_drake.studies.machine_show.description import description_schema
from wm_drake.studies.modes.linearisation import Linearisation
from wm_drake.systems.element_system import element_system

FRAMES = {"tub_frame": "damper_left_tub", "housing_frame": "damper_left_housing"}
DRAG = {"kind": "drag_damper", **FRAMES, "coefficient": 4000.0}  # N s^2/m^2
MAXWELL = {"kind": "maxwell_strut", **FRAMES, "stiffness": 9e3, "damping": 250.0}  # N/m, N s/m
ELEMENTS = {
    "drag": {"slow": DRAG},
    "maxwell": {"slow": MAXWELL},
    "both": {"first": DRAG, "second": MAXWELL, "third": {**DRAG, "coefficient": 900.0}},
}
PROFILE = SpinProfile(time=(0.0, 1.0, 1.5), speed=(5.0, 30.0, 30.0))
FILE = """\
extends: reference
elements:
  slow:
    kind: drag_damper
    tub_frame: damper_left_tub
    housing_frame: damper_left_housing
    coefficient: 4000 N*s^2/m^2
"""
wm.register_element(DRAG_DAMPER)
wm.register_element(MAXWELL_STRUT)


def with_elements(parameters=None, elements=ELEMENTS["both"], **parts):
    """Return a machine with elements of other packages."""
    tree = (parameters or load_machine("reference")).model_dump(exclude_unset=True)
    return MachineParameters.model_validate(tree | {"elements": elements} | parts)


@pytest.fixture(scope="module", params=ELEMENTS)
def with_kind(request, sponges):
    """Return a built machine with elements of each kind, and dampers with sponges."""
    return build_machine(with_elements(sponges, elements=ELEMENTS[request.param]))


def test_a_kind_is_registered_once():
    assert wm.register_element(DRAG_DAMPER) is DRAG_DAMPER
    other = wm.ElementKind(
        name="drag_damper",
        parameters=DRAG_DAMPER.parameters,
        layout=DRAG_DAMPER.layout,
        numbers=DRAG_DAMPER.numbers,
        evaluate=DRAG_DAMPER.evaluate,
    )
    with pytest.raises(ValueError, match=r"drag_damper.*registered already"):
        wm.register_element(other)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("4000 N*s^2/m^2", "4000 N*s/m", "7: elements.slow.coefficient: unit .* does not fit"),
        ("4000 N*s^2/m^2", "-1 N*s^2/m^2", "7: elements.slow.coefficient: .* out of range"),
        ("coefficient", "coeficient", "unknown key 'coeficient'.*coefficient"),
        ("kind: drag_damper", "kind: drag_dampr", "4: elements.slow.kind: .*drag_damper"),
        ("    kind: drag_damper\n", "", "elements.slow.kind: is missing"),
        ("damper_left_tub", "damper_left_tb", "no frame 'damper_left_tb'.*damper_left_tub"),
        ("damper_left_tub", "damper_left_housing", "is not fixed to the tub"),
    ],
)
def test_errors_of_a_machine_file_name_line_and_key(old, new, message, check_refused):
    check_refused(FILE.replace(old, new), message)


def test_numbers_are_found_changed_and_written(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(FILE, encoding="utf-8")
    parameters = load_machine(path)
    key = "elements.slow.coefficient"
    assert {name: value for name, value, _ in quantities(parameters)}[key] == 4000.0
    changed = wm.with_value(parameters, key, "2 kN*s^2/m^2")
    assert changed.elements["slow"].coefficient == 2000.0
    path.write_text(machine_yaml(changed), encoding="utf-8")
    assert load_machine(path).elements == changed.elements
    with pytest.raises(InputError, match="coefficient"):
        wm.with_value(parameters, "elements.slow.coefficent", 1.0)


def test_schema_and_manual_have_the_keys():
    schema = json.dumps(file_schema())
    assert "Tension over the square of the velocity" in schema
    groups = [group for group in key_groups() if "elements.NAME" in group.places]
    assert {"Drag damper", "Maxwell strut"} <= {group.title for group in groups}


def test_description_of_the_machine_has_the_elements(with_kind):
    description, schema = wm.describe(with_kind), description_schema()
    jsonschema.validate(description, schema)
    assert set(description["elements"]) == set(with_kind.parameters.elements)
    for name, element in with_kind.parameters.elements.items():
        described = description["elements"][name]
        assert described["kind"] == element.kind
        ends = np.subtract(described["tub_point_T"], described["housing_point_W"])
        assert described["length_at_rest"] == pytest.approx(np.linalg.norm(ends), rel=0.05)
    coefficient = schema["$defs"]["drag_damper"]["properties"]["coefficient"]
    assert coefficient["unit"] == "N s^2/m^2"
    assert coefficient["description"].startswith("Tension over the square")


def test_both_engines_agree_at_random_states(with_kind):
    assert difference(with_kind) < 1e-10


def test_both_engines_agree_if_a_cabinet_that_moves_carries_the_elements():
    assert difference(build_machine(with_elements(with_moving_cabinet()))) < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize(
    "integrator", ["multistep", pytest.param("runge_kutta", marks=pytest.mark.hours)]
)
def test_both_engines_move_alike(integrator, sponges):
    machine = build_machine(with_elements(sponges))
    case = Case("middle", machine.parameters.loads["middle"], PROFILE)
    ours = simulate(machine, case, integrator=integrator, step=1.25e-4)
    drake = simulate(machine, case, "drake-accurate", step=1.25e-4)
    variables = "displacement", "drag_damper_tension", "maxwell_strut_tension", "mount_force"
    check_alike(ours, drake, variables, 2e-3)
    assert list(ours.mount.values[-3:]) == ["elements.first", "elements.second", "elements.third"]
    assert list(ours.drag_damper.values) == ["first", "third"]


def test_eight_runs_side_by_side_are_single_runs():
    machine = build_machine(with_elements())
    values = 250.0 * np.arange(1, 10)
    cases = cases_with(machine, "elements.first.coefficient", values, PROFILE)
    table = check_runs_alone(machine, cases)
    assert len(set(table.gasket_force.sel(axis="x").values)) == 9


@pytest.mark.parametrize(("kind", "numbers"), [(DRAG_DAMPER, DRAG), (MAXWELL_STRUT, MAXWELL)])
def test_derivatives_of_the_system_are_those_of_differences(kind, numbers):
    """Compare AutoDiffXd with central differences, by the state of the plant and own states."""
    point, ground = np.array([-0.1, 0.02, -0.2]), np.array([-0.25, 0.03, -0.5])
    ends = Ends(point, np.eye(3), ground, np.eye(3))
    placed = kind.place(ends, kind.parameters.model_validate(numbers))
    system = element_system(kind, placed.packed(), np.zeros(placed.state_size))
    rng = np.random.default_rng(1)
    state = rng.uniform(-0.2, 0.2, 14 + placed.state_size)
    check_derivatives(system, state, step=1e-6, part=1e-6)


def test_modes_are_those_of_drakes_linearize(with_kind):
    setup = with_kind.set_up()
    ours, drake = Linearisation(setup).spectrum(), drake_spectrum(setup)
    np.testing.assert_allclose(ours.first(6).frequency_hz, drake.first(6).frequency_hz, rtol=1e-6)
    assert len(Linearisation(setup).wrench_slopes()) == len(Linearisation(setup).names)


def test_equilibrium_stays_where_it_is_without_force_at_rest(with_kind, sponges):
    setup, plain = with_kind.set_up(), build_machine(sponges).set_up()
    np.testing.assert_allclose(setup.rest_pose, plain.rest_pose, atol=1e-12)
    tensions = [[spring.preload for spring in s.springs.values()] for s in (setup, plain)]
    np.testing.assert_allclose(*tensions, rtol=1e-12)


def test_energy_balances():
    """Dissipate c |v|^3 in the drag dampers, v from the motion of their ends in the record."""
    coefficient = 4e5  # N s^2/m^2
    parameters = with_elements(elements={"slow": {**DRAG, "coefficient": coefficient}})
    profile = SpinProfile(time=(0.0, 2.0, 3.0), speed=(12.0, 24.0, 24.0))
    case = Case("middle", parameters.loads["middle"], profile)
    setup, record = dense_record(build_machine(parameters), case, 3.125e-4)
    book = EnergyBook(setup, case.load, record)
    work, change, dissipated = book.balance()
    ends = setup.elements.others["slow"].ends
    arm = book.rotation.apply(ends.tub_point)
    line = book.position + arm - ends.housing_point
    rate = np.sum(line * (book.v + np.cross(book.w, arm)), axis=1) / np.linalg.norm(line, axis=1)
    in_drag = book.integral(coefficient * np.abs(rate) ** 3)
    assert in_drag > 0.05  # J
    assert work - change - dissipated == pytest.approx(in_drag, rel=5e-3)
    tension = record.drag_damper_tension.values[:, 0]
    np.testing.assert_allclose(tension, coefficient * np.abs(rate) * rate, atol=1e-9)


def test_other_elements_need_another_built_machine(with_kind):
    parameters = with_kind.parameters
    name = next(iter(parameters.elements))
    fewer = {key: value for key, value in parameters.elements.items() if key != name}
    with pytest.raises(InputError, match=f"elements: '{name}' is not in both machines"):
        with_kind.set_up(parameters=parameters.model_copy(update={"elements": fewer}))


@pytest.mark.parametrize("elements", [{}, ELEMENTS["drag"]])
def test_replay_draws_a_strut(elements):
    motion = Motion(np.array([0.0, 0.1]), np.zeros((2, 7)), np.ones(2))
    page = replay_page(with_elements(elements=elements, dampers={}), motion)
    assert ("</span> damper" in page) == bool(elements)


def test_an_entry_point_makes_a_kind_known_to_every_command(tmp_path):
    """Install a package that has only the file and its metadata; run commands in new processes."""
    folder = tmp_path / "drag-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: drag\nVersion: 1.0\n")
    entry = "[wm_drake.elements]\nquadratic_drag = drag_damper:DRAG_DAMPER\n"
    (folder / "entry_points.txt").write_text(entry)
    (tmp_path / "mine.yaml").write_text(FILE, encoding="utf-8")
    (tmp_path / "short.csv").write_text("time_s,speed_rpm\n0,50\n1,100\n")
    paths = [str(tmp_path), str(Path(__file__).parent), *sys.path]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}

    def run(*words):
        command = [sys.executable, "-m", "wm_drake", *words]
        found = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert found.returncode == 0, found.stderr
        return found.stdout

    set_ = ("--set", "elements.slow.coefficient=800 N*s^2/m^2")
    shown = json.loads(run("machine", "show", "mine.yaml", "--json", *set_))
    assert shown["elements"]["slow"]["coefficient"] == 800.0
    words = (
        "spin", "--machine", "mine.yaml", "--load", "middle", "--profile", "short.csv", "--json",
    )  # fmt: skip
    result = run(*words)
    assert "elements.slow" in result
