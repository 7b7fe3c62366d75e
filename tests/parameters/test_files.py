"""Machine files: YAML in and out, inheritance, and messages with file, line and key."""

import shutil

import pytest
from pydantic import TypeAdapter

from wm_drake.errors import InputError
from wm_drake.parameters import (
    DamperType,
    load_machine,
    machine_file_with,
    machine_path,
    machine_yaml,
    quantities,
    shipped_machines,
    source_of,
    with_value,
)


@pytest.fixture
def write(tmp_path):
    def to(text, name="machine.yaml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return to


def numbers(parameters):
    return {
        key: (value, unit, source_of(parameters, key))
        for key, value, unit in quantities(parameters)
    }


def refused(path):
    with pytest.raises(InputError) as error:
        load_machine(path)
    return str(error.value).splitlines()


def test_reference_is_shipped(reference):
    assert "reference" in shipped_machines()
    assert load_machine() == load_machine(machine_path("reference")) == reference


def test_written_machine_is_read_back_the_same(write, reference):
    again = load_machine(write(machine_yaml(reference)))
    assert again.model_dump(exclude={"sources"}) == reference.model_dump(exclude={"sources"})
    assert numbers(again) == numbers(reference)


def test_written_file_has_display_units(reference):
    text = machine_yaml(reference)
    stiffness = reference.spring_types["suspension"].stiffness
    assert (
        f"stiffness:\n      value: {stiffness / 1e3:g} N/mm\n      source: 'fit: spring_stiffness"
        in text
    )
    assert "value: 60 N*mm*s/deg" in text
    assert "sources" not in text


def test_written_machine_with_tables_overrides_and_another_damper_is_read_back_the_same(
    write, reference
):
    table = {"displacement": "(-9, -5, 5, 9) mm", "force": "(-200, 0, 0, 200) N"}
    law = {
        "law": "free_stroke",
        "friction_force": "80 N",
        "friction_damping": "0.1 N s/mm",
        "basic_friction_force": "5 N",
    }
    damper = TypeAdapter(DamperType).validate_python(
        {**law, "basic_full_friction_velocity": "2 mm/s", "sponge": table}
    )
    changed = with_value(reference, "damper_types", {"friction": damper})
    changed = with_value(changed, "gasket.stiffness_y", table)
    changed = with_value(changed, "gasket.friction_torque_x", "80 N mm")
    changed = with_value(changed, "bodies.tub.mass", "12 kg")
    changed = with_value(changed, "frames.sensor_Xr.position", "(1, 2, 3) mm")
    again = load_machine(write(machine_yaml(changed)))
    assert again.model_dump(exclude={"sources"}) == changed.model_dump(exclude={"sources"})


def test_written_machine_without_gasket_is_read_back_the_same(write, reference):
    changed = reference.model_copy(update={"gasket": None, "bushings": {}, "measured": ()})
    assert load_machine(write(machine_yaml(changed))).gasket is None


def test_extending_file_changes_only_its_entries(write, reference):
    path = write(
        "extends: reference\nname: heavy\nbodies:\n  upper_counterweight:\n    mass: {value: 12 kg, source: guess}\n"
    )
    heavy = load_machine(path)
    expected = with_value(
        with_value(reference, "name", "heavy"), "bodies.upper_counterweight.mass", 12.0
    )
    kept = {"sources", "measured", "published"}  # another machine was measured
    assert heavy.model_dump(exclude=kept) == expected.model_dump(exclude=kept)
    assert source_of(heavy, "bodies.upper_counterweight.mass") == "guess"
    assert source_of(heavy, "gravity") == source_of(reference, "gravity")


def test_extended_machine_extends_a_file_beside_it(write):
    write("extends: reference\ngravity: 1 m/s^2\n", "base.yaml")
    assert load_machine(write("extends: base.yaml\nname: moon\n")).gravity == 1.0


def test_changed_number_drops_the_old_source(write):
    machine = load_machine(write("extends: reference\ngasket: {stiffness_x: 3 N/mm}\n"))
    assert machine.gasket.stiffness_x == 3000.0
    assert source_of(machine, "gasket.stiffness_x") == ""


def test_new_profile_replaces_the_old_one_whole(write):
    machine = load_machine(
        write("extends: reference\nprofile: {time: '(0, 1) s', speed: '(0, 60) rpm'}\n")
    )
    assert machine.profile.time == (0.0, 1.0)
    assert source_of(machine, "profile.time") == ""


def test_null_removes_an_entry(write, reference):
    machine = load_machine(
        write("extends: reference\ngasket: null\nloads: {back: null}\nmeasured: null\n")
    )
    assert machine.gasket is None
    assert list(machine.loads) == [name for name in reference.loads if name != "back"]
    assert machine.measured == ()


def test_measured_paths_are_relative_to_the_file(write, tmp_path):
    machine = load_machine(write("extends: reference\nmeasured: [mine.csv, sub/../yours.csv]\n"))
    assert machine.measured == (str(tmp_path / "mine.csv"), str(tmp_path / "yours.csv"))
    inherited = load_machine(write("extends: reference\nname: x\n"))
    assert inherited.measured == ()  # another machine was measured


def test_model_path_is_relative_to_the_file(write, tmp_path):
    write("<sdf/>", "bodies.sdf")
    assert load_machine(write("extends: reference\nmodel: bodies.sdf\n")).model == str(
        tmp_path / "bodies.sdf"
    )
    (tmp_path / "sub").mkdir()
    write("extends: ../machine.yaml\n", "sub/next.yaml")
    assert load_machine(tmp_path / "sub" / "next.yaml").model == str(tmp_path / "bodies.sdf")


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("name: x\nname: y\n", 2, 'is not YAML: found duplicate key "name"'),
        ("name: x\ngasket:\n  tub_frame: a\n  tub_frame: b\n", 4, 'is not YAML: found duplicate key "tub_frame"'),
        ("name: x\n\tgravity: 1\n", 2, "is not YAML: found character '\\t' that cannot start any token"),
        ("name: x\nloads: [1,\n  }\n", 3, "is not YAML: "),
        ("name: x\n---\nname: y\n", 2, "is not YAML: but found another document"),
        ("name: *nobody\n", 1, "is not YAML: found undefined alias"),
    ],
)  # fmt: skip
def test_bad_yaml_is_refused_with_its_line(write, text, line, message):
    path = write(text)
    (problem,) = refused(path)
    assert problem.startswith(f"{path}:{line}: {message}")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty; allowed is a mapping of keys to values"),
        (b"# only a comment\n", "is empty; allowed is a mapping of keys to values"),
        (b"- a\n- b\n", "is not a mapping"),
        (b"machine\n", "is not a mapping"),
        (b"name: J\xe4n\n", "is not text in UTF-8"),
        (b"name: \x00\n", "is not YAML: "),
    ],
)
def test_file_that_is_not_a_mapping_is_refused(tmp_path, content, message):
    path = tmp_path / "machine.yaml"
    path.write_bytes(content)
    (problem,) = refused(path)
    assert problem.startswith(f"{path}: {message}")


@pytest.mark.parametrize(
    "value",
    ["9" * 400, "9" * 5000, "2020-13-45", "1e400", ".nan", ".inf", "true", "nan m/s^2"],
    ids=lambda v: v[:12],
)
def test_strange_scalar_is_refused_with_its_line(write, value):
    path = write(f"extends: reference\ngravity: {value}\n")
    (problem,) = refused(path)
    assert problem.startswith(str(path))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("gasket:\n  stifness_x: 3 N/mm\n", ":3: gasket.stifness_x: unknown key 'stifness_x' (did you mean 'stiffness_x'?"),
        ("gravty: 9 m/s^2\n", ":2: gravty: unknown key 'gravty' (did you mean 'gravity'?"),
        (
            "damper_types:\n  friction:\n    friction_forse: 3 N\n",
            ":4: damper_types.friction.friction_forse: unknown key 'friction_forse' (did you mean 'friction_force'?",
        ),
        (
            "damper_types:\n  friction:\n    end_bushing: {stifness: 3 N mm/rad}\n",
            ":4: damper_types.friction.end_bushing.stifness: unknown key 'stifness' (did you mean 'stiffness'?",
        ),
        (
            "spring_types:\n  suspension:\n    stiffness: {displacemen: '(0, 1) mm', displacement: '(0, 1) mm', force: '(0, 1) N'}\n",
            ":4: spring_types.suspension.stiffness.displacemen: unknown key 'displacemen' (did you mean 'displacement'?",
        ),
        (
            "loads:\n  middle:\n    unbalances:\n    - {mass: 1 kg, radius: 1 mm, y: 1 mm, fase: 1 deg}\n",
            ":5: loads.middle.unbalances.0.fase: unknown key 'fase' (did you mean 'phase'?",
        ),
        ("damper_types: {friction: {law: glue}}\n", ":2: damper_types.friction: law 'glue' is not known; allowed are 'coulomb', "),
        ("springs:\n  left: {type: nosuch}\n", "springs: left.type: 'nosuch' is not in spring_types (known: suspension)"),
        ("gravity: -1 m/s^2\n", ":2: gravity: '-1 m/s^2' is out of range; allowed is >= 0"),
        ("gravity: 9.81\n", ":2: gravity: '9.81' has no unit; write for example '1 m/s^2'"),
        ("gasket:\n  rotational_stiffness_x: 5 N mm\n", ":3: gasket.rotational_stiffness_x: unit 'N mm' does not fit; allowed"),
        ("frames: {sensor_Xr: {position: '(1, 2, 3) N'}}\n", "position: unit 'N' does not fit; allowed is a unit such as mm"),
        ("loads: null\n", ":2: loads: is missing"),
        ("sensors: {Xr: null, Yr: null, Zr: null, Xf: null, Yf: null, Zf: null}\n", ":2: sensors: needs at least one entry"),
    ],
)  # fmt: skip
def test_bad_entry_is_refused_with_its_line_and_key(write, text, message):
    path = write(f"extends: reference\n{text}")
    (problem,) = refused(path)
    assert problem.startswith(str(path))
    assert message in problem


def test_several_problems_are_several_lines(write):
    path = write(
        "extends: reference\ngravity: 9.81 N\ngasket:\n  stiffness_x: 3 N\n  damping_x: -1 N s/mm\nextra: 1\nprofile: {steps: []}\n"
    )
    problems = refused(path)
    assert sorted(problem.removeprefix(f"{path}:").split(" ")[1] for problem in problems) == [
        "extra:", "gasket.damping_x:", "gasket.stiffness_x:", "gravity:", "profile:",
    ]  # fmt: skip
    assert sorted(int(problem.removeprefix(f"{path}:").split(":")[0]) for problem in problems) == [
        2, 4, 5, 6, 7,
    ]  # fmt: skip


def test_everything_missing_is_several_lines(write):
    problems = refused(write("name: x\n"))
    assert [problem.split(": ", 1)[1] for problem in problems] == [
        f"{key}: is missing"
        for key in (
            "gravity", "sensors", "loads", "profile",
        )
    ]  # fmt: skip


def test_machine_that_extends_itself_is_refused(write):
    path = write("extends: other.yaml\n")
    write("extends: machine.yaml\n", "other.yaml")
    (problem,) = refused(path)
    assert problem.endswith("extends: extends itself")


def test_missing_machine_is_refused_with_the_nearest(tmp_path):
    (message,) = refused("refrence")
    assert message.startswith(
        "refrence: no such file, and no shipped machine of that name (did you mean 'reference'? "
        "known: reference, "
    )
    assert refused(tmp_path)[0].startswith(f"{tmp_path}: is a folder")


def test_problem_in_an_extended_file_names_that_file(write):
    base = write("extends: reference\ngravity: 9.81\n", "base.yaml")
    (problem,) = refused(write("extends: base.yaml\nname: x\n"))
    assert problem.startswith(f"{base}:2: gravity: ")


def test_unknown_frames_are_reported_with_file_and_line(write, wm_drake):
    path = write(
        "extends: reference\nsprings:\n  left:\n    tub_frame: spring_lft_tub\nsensors:\n  Xr: {frame: housing}\n"
    )
    ended = wm_drake("machine", "check", path)
    assert ended.code == 2
    first, second = ended.messages
    assert first.startswith(
        f"{path}:4: springs.left.tub_frame: no frame 'spring_lft_tub' in the SDF (did you mean "
        "'spring_left_tub'?"
    )
    assert second == f"{path}:6: sensors.Xr.frame: frame 'housing' is not fixed to the tub"


def test_copied_shipped_machine_is_the_same_machine(tmp_path, reference):
    for path in machine_path("reference").parent.glob("*.*"):
        shutil.copy(path, tmp_path)
    copy = load_machine(tmp_path / "reference.yaml")
    elsewhere = {"measured": (), "published": ()}
    assert copy.model_copy(update=elsewhere) == reference.model_copy(update=elsewhere)


def test_numbers_are_replaced_and_the_rest_of_the_file_stays(write, reference):
    path = write(machine_path("reference").read_text(encoding="utf-8"))
    changed = with_value(reference, "damper_types.friction.friction_force", 31.5)
    changed = changed.model_copy(
        update={"sources": {**changed.sources, "damper_types.friction.friction_force": "fit: new"}}
    )
    text = machine_file_with(path, changed, ["damper_types.friction.friction_force"])
    assert "friction_force: {value: 31.5 N, source: 'fit: new'}" in text
    again = load_machine(write(text))
    assert again.model_dump(
        exclude={"sources", "model", "measured", "published"}
    ) == changed.model_dump(exclude={"sources", "model", "measured", "published"})
    before, after = (set(t.splitlines()) for t in (path.read_text(encoding="utf-8"), text))
    comments = {line for line in before if line.startswith("#")}
    assert comments
    assert comments <= after


def test_a_replaced_vector_keeps_its_own_source(write):
    parts = "mass: {value: 7 kg, source: 'fit: heavy'}, centre_of_mass: {value: '(0, 60, 0) mm', source: 'fit: old'}"
    path = write(f"extends: reference\nbodies:\n  drum: {{{parts}}}\n")
    machine = load_machine(path)
    key = "bodies.drum.centre_of_mass"
    changed = with_value(machine, key, (0.0, 0.05, 0.0))
    changed = changed.model_copy(update={"sources": {**changed.sources, key: "fit: new"}})
    text = machine_file_with(path, changed, [key])
    again = load_machine(write(text))
    assert again.bodies["drum"].centre_of_mass == (0.0, 0.05, 0.0)
    assert again.sources[key] == "fit: new"
    assert again.sources["bodies.drum.mass"] == machine.sources["bodies.drum.mass"]


def test_without_clearance_the_point_of_the_first_sensor_counts(write, reference):
    read = load_machine(write("extends: reference\nclearance: null\n"))
    assert read.clearance_frame == "sensor_Xr"
    assert reference.clearance_frame == "detergent_point"


def test_repr_leaves_out_what_has_its_default(reference):
    shown = repr(reference.gasket)
    assert "damping_x=19.0" in shown
    assert "maxwell" not in shown
    assert len(shown) < 3000  # six tables
