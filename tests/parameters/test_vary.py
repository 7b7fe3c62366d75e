"""Numbers that vary: texts, entries of files and options, their values, and what is refused."""

import numpy as np
import pytest
import scipy.stats
from simple_machines import with_gasket_tables

from wm_drake.elements.layouts import packed_stiffness
from wm_drake.errors import InputError
from wm_drake.laws.table import stiffness_force
from wm_drake.parameters import (
    Entry,
    ForceTable,
    VaryFile,
    load_vary,
    quantities,
    varying,
    with_value,
)
from wm_drake.parameters.rubber import RubberBranches
from wm_drake.parameters.units import PureNumber, Share, Unit
from wm_drake.parameters.variation import Change, change_of, number_at, range_of
from wm_drake.parameters.vary import entries_of_texts
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.studies.calibrate.parameter_map import parameter_map_of, read_parameter_map
from wm_drake.studies.tolerance.variables import joint_of
from wm_drake.studies.vary import varying_of

STIFFNESS = Unit("N/m", "N/mm")
SPRING = "spring_types.suspension.stiffness"
FRICTION = "damper_types.friction.friction_force"
KX = "gasket.stiffness_x"
STIFFNESSES = [f"{kind}stiffness_{axis}" for kind in ("", "rotational_") for axis in "xyz"]
HARDENING = ForceTable(
    displacement=(-0.03, -0.01, 0.0, 0.01, 0.03), force=(-150.0, -40.0, 0.0, 40.0, 150.0)
)


@pytest.fixture
def plain(reference):
    """Return the reference machine with plain numbers for the stiffnesses of its gasket."""
    for index, name in enumerate(STIFFNESSES):
        reference = with_value(reference, f"gasket.{name}", 3000.0 + 100.0 * index)
    return reference


def one(parameters, text, tables="linear"):
    """Return the factor of a text of `--factor`, with levels that the machine can have."""
    entries = entries_of_texts([text], gasket_entries(), "--factor", "50 %..150 %")
    return varying(parameters, entries, tables=tables).with_levels("a factor")


def settings(factors, key):
    """Return what a machine has at a key at the levels -1, 0 and 1."""
    changes = [factors.changes([factors.every[0].at_level(level)]) for level in (-1, 0, 1)]
    return [change[key] for change in changes]


@pytest.mark.parametrize(
    ("text", "unit", "change", "value"),
    [
        ("95 %", STIFFNESS, Change.PERCENT, 0.95),
        (" -5%", STIFFNESS, Change.PERCENT, -0.05),
        ("9 N/mm", STIFFNESS, Change.VALUE, 9000.0),
        ("nominal", STIFFNESS, Change.DISTANCE, 0.0),
        ("nominal + 2 N/mm", STIFFNESS, Change.DISTANCE, 2000.0),
        ("nominal - 2 N/mm", STIFFNESS, Change.DISTANCE, -2000.0),
        ("0.4", PureNumber(), Change.VALUE, 0.4),
        ("40 %", PureNumber(), Change.PERCENT, 0.4),
        ("40 %", Share(), Change.VALUE, 0.4),
    ],
)
def test_form_and_value_of_a_text(text, unit, change, value):
    assert change_of(text, unit, "key") == (change, pytest.approx(value))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("9", "'9' has no unit"),
        ("9 kg", "unit 'kg' does not fit; allowed is a unit such as N/mm"),
        ("9,5 N/mm", "decimal sign is a point"),
        ("nominal + 2", "'2' has no unit"),
        ("nominal * 2 N/mm", "is not a number with a unit"),
        ("x %", "'x ' is not a number without unit"),
        ("", "'' is not a number with a unit"),
    ],
)
def test_wrong_text_is_refused_with_its_key(text, message):
    with pytest.raises(InputError) as caught:
        change_of(text, STIFFNESS, "k.low")
    assert caught.value.problems[0].key == "k.low"
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "ends"),
    [
        ("2 N/mm..4000 N/m", ("2 N/mm", "4000 N/m")),
        ("50 % .. 150 %", ("50 %", "150 %")),
        ("(1, 2) N/mm", ("1 N/mm", "2 N/mm")),
        ("(1,2)", ("1", "2")),
        ("1 mm..", None),
        ("(1, 2, 3) mm", None),
    ],
)
def test_ends_of_a_range(text, ends):
    assert range_of(text) == ends


SAME = [
    {"keys": [SPRING], "low": "4 N/mm", "high": "6 N/mm", "mean": "5 N/mm", "deviation": "1 N/mm"},
    {"keys": SPRING, "bounds": "(4, 6) N/mm", "prior": "(5, 1) N/mm"},
    {"bounds": "4 N/mm..6 N/mm", "prior": "(5, 1) N/mm", "distribution": "normal"},
]


def test_each_way_to_write_an_entry_is_the_same_number(reference):
    texts = [f"{SPRING}={{low: 4 N/mm, high: 6 N/mm, mean: 5 N/mm, deviation: 1 N/mm}}"]
    entries = [Entry.model_validate(tree).of_name(SPRING) for tree in SAME]
    entries += entries_of_texts(texts, {}, "--unknown").values()
    found = [varying(reference, {SPRING: entry}).every[0] for entry in entries]
    values = {"low": 4e3, "middle": 5e3, "high": 6e3, "mean": 5e3, "deviation": 1e3}
    assert all(varied.at == values and varied.keys == (SPRING,) for varied in found)
    short = entries_of_texts([f"{SPRING}=(4, 6) N/mm"], {}, "--unknown")[SPRING]
    assert short == Entry.model_validate("4 N/mm..6 N/mm").of_name(SPRING)


def test_values_on_the_command_line_replace_those_of_a_known_entry():
    known = gasket_entries()
    (entry,) = entries_of_texts(["C_L=80 %..90 %"], known, "--factor").values()
    assert (entry.keys, entry.low, entry.high) == (known["C_L"].keys, "80 %", "90 %")


def test_gasket_factors_move_every_stiffness_and_damping_once(plain):
    factors = varying(plain, gasket_entries()).every
    assert [f.name for f in factors] == ["C_L", "C_T", *(f"K_{a}{b}" for a in "LT" for b in "xyz")]
    moved = [key for factor in factors for key in factor.keys]
    expected = [
        key
        for key, _, _ in quantities(plain)
        if key.startswith("gasket.")
        and ("stiffness" in key or "damping" in key)
        and key.removeprefix("gasket.") not in RubberBranches.model_fields  # they are 0 in the file
    ]
    assert sorted(moved) == sorted(expected)
    for number in (number for factor in factors for number in factor.numbers):
        assert factors[0].levels_of(number) == pytest.approx(
            [0.5 * number.nominal, number.nominal, 1.5 * number.nominal]
        )


def test_levels_are_set_and_nothing_else(plain):
    factors = varying(plain, gasket_entries())
    assert factors.at_levels([0] * 8) == plain
    changed = factors.at_levels([1, 0, 0, -1, 0, 0, 0, 0])
    assert changed.gasket.damping_z == pytest.approx(1.5 * plain.gasket.damping_z)
    assert changed.gasket.stiffness_y == pytest.approx(0.5 * plain.gasket.stiffness_y)
    for key in ("damping_x", "damping_y", "damping_z", "stiffness_y"):
        changed = with_value(changed, f"gasket.{key}", getattr(plain.gasket, key))
    assert changed == plain


@pytest.mark.parametrize(
    ("text", "key", "expected"),
    [
        (f"{FRICTION}=20 N..30 N", FRICTION, [20.0, 25.0, 30.0]),
        ("loads.middle.unbalances.0.mass=90 %..120 %", "loads.middle.unbalances.0.mass", [0.9, 1.05, 1.2]),
        ("K_Lx=2 N/mm..4000 N/m", KX, [2000.0, 3000.0, 4000.0]),
        ("bodies.tub.mass=9 kg..11 kg", "bodies.tub.mass", [9.0, 10.0, 11.0]),
        ("gravity", "gravity", [4.905, 9.81, 14.715]),
    ],
)  # fmt: skip
def test_any_number_can_be_a_factor(reference, text, key, expected):
    assert settings(one(reference, text), key) == pytest.approx(expected)


def test_number_of_the_sdf_varies_around_its_value(machine):
    (varied,) = varying_of(
        machine, entries_of_texts(["bodies.motor.mass"], {}, "", "90 %..110 %")
    ).every
    body = machine.drawn.plant.GetBodyByName("motor").default_mass()
    assert varied.first_levels == pytest.approx([0.9 * body, body, 1.1 * body])


def test_nominal_stiffness_is_the_slope_of_the_first_fifth():
    line = ForceTable(displacement=(-0.02, 0.0, 0.02), force=(-60.0, 0.0, 60.0))
    assert line.nominal_stiffness == pytest.approx(3000.0)
    x = np.linspace(-0.006, 0.006, 4001)
    forces = [stiffness_force(float(point), packed_stiffness(HARDENING), 0) for point in x]
    assert HARDENING.nominal_stiffness == pytest.approx(float(x @ forces / (x @ x)), rel=1e-3)


def test_tables_become_numbers_or_are_scaled(reference):
    parameters, nominal = with_value(reference, KX, HARDENING), HARDENING.nominal_stiffness
    linear, scaled = one(parameters, "K_Lx"), one(parameters, "K_Lx", "scaled")
    assert settings(linear, KX) == pytest.approx([0.5 * nominal, nominal, 1.5 * nominal])
    low, middle, high = settings(scaled, KX)
    assert middle.force == pytest.approx(HARDENING.force)
    assert low.force == pytest.approx([0.5 * force for force in HARDENING.force])
    assert high.displacement == HARDENING.displacement
    absolute = one(parameters, "K_Lx=2 N/mm..6 N/mm", "scaled")
    assert settings(absolute, KX)[0].nominal_stiffness == pytest.approx(2000.0)
    with pytest.raises(InputError, match=r"stiffness_x: '-.*' is out of range"):
        one(parameters, "K_Lx=-10 %..50 %", "scaled")


def test_curve_that_cannot_be_a_number_is_scaled(reference):
    sponge = {
        "displacement": (-0.02, -0.01, -0.004, 0.004, 0.01, 0.02),
        "force": (-120.0, -40.0, 0.0, 0.0, 40.0, 120.0),
    }
    damper = {
        "law": "free_stroke", "friction_force": 25.0, "friction_damping": 60.0,
        "basic_friction_force": 5.0, "basic_full_friction_velocity": 0.09, "sponge": sponge,
    }  # fmt: skip
    tree = reference.model_dump() | {"damper_types": {"friction": damper}}
    key = "damper_types.friction.sponge"
    factor = one(type(reference).model_validate(tree), key)
    assert settings(factor, key)[2].force == pytest.approx([1.5 * f for f in sponge["force"]])


@pytest.mark.parametrize(
    ("text", "expected"), [("110 %", 1.1), ("nominal + 1 kN/m", None), ("9 N/mm", None)]
)
def test_entry_changes_all_its_numbers_and_nothing_else(sponges, text, expected):
    keys = (SPRING, KX)
    found = varying(sponges, {"k": Entry(keys=keys, start=text)})
    changed = found.machine_at([found.every[0].at["start"]])
    for key in keys:
        before, after = number_at(sponges, key).nominal, number_at(changed, key).nominal
        known = {"nominal + 1 kN/m": before + 1000.0, "9 N/mm": 9000.0}
        assert after == pytest.approx(expected * before if expected else known[text])
    if found.every[0].change is not Change.VALUE:
        assert found.machine_at([found.every[0].nominal]) == sponges


FILE = """
vary:
  friction: {keys: damper_types.friction.friction_force, low: 20 N, high: 60 N}
  lean:
    bounds: (-60, 90) mm
    prior: (20, 30) mm
    sets: {frames.damper_left_housing.position.x: -1, frames.damper_right_rear_housing.position.x: 1}
  rate: {keys: gasket.damping_x, distribution: triangular, low: 50 %, mode: 90 %, high: 150 %}
"""


def read(tmp_path, text):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    return load_vary(path)


WRONG_FILES = {
    "unknown word": (FILE.replace("low: 20 N", "lo: 20 N"), r":3: vary.friction.lo: unknown key 'lo' \(did you mean"),
    "one bound": (FILE.replace("(-60, 90) mm", "90 mm"), r":4: vary.lean: bounds: needs two values"),
    "keys and sets": (FILE.replace("    bounds", "    keys: gravity\n    bounds"), "has keys and sets"),
    "half a distribution": (FILE.replace("mode: 90 %, ", ""), "'mode' is missing"),
    "a value of another distribution": (FILE.replace("triangular", "uniform"), "a uniform distribution has no 'mode'"),
    "a mode alone": (FILE.replace("distribution: triangular, ", ""), "without a distribution there is no 'mode'"),
    "a deviation alone": (FILE.replace("low: 20 N, high", "deviation"), "'mean' is missing"),
    "unknown distribution": (FILE.replace("triangular", "triangle"), "'triangle' is not allowed"),
    "nothing": ("about: nothing\n", "nothing varies"),
    "laundry without a place": ("vary: {laundry.mass: 200 g..600 g}\n", "laundry needs .*; add laundry.angle"),
    "unknown laundry": ("vary: {laundry.mas: 200 g..600 g}\n", "did you mean 'laundry.mass'"),
    "known and free": (FILE + "known: {lean: {value: 1 mm, sets: gravity, source: x}}\n", "'lean' is in vary and in known"),
    "no matrix": (FILE + "correlations: {quantities: [lean, rate], matrix: [[1, 2], [2, 1]]}\n", "not positive definite"),
}  # fmt: skip


@pytest.mark.parametrize("fault", WRONG_FILES)
def test_wrong_file_is_refused_with_its_line(fault, tmp_path):
    text, message = WRONG_FILES[fault]
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path, text)
    assert "mine.yaml" in str(caught.value)


MISFITS = {
    "unknown key": ({"k": {"keys": "gasket.stifness_x", "low": "90 %"}}, "k: gasket.stifness_x: .*did you mean 'stiffness_x'"),
    "unknown mass": ({"k": {"keys": "bodies.tub.masss", "low": "9 kg"}}, "did you mean 'mass'"),
    "a list": ({"k": {"keys": "profile.time", "low": "9 s"}}, "name one of them by its index"),
    "no number": ({"k": {"keys": "gasket", "low": "9 s"}}, "is not a number of the machine"),
    "unit": ({"k": {"keys": KX, "low": "9 N"}}, "unit 'N' does not fit"),
    "forms": ({"k": {"keys": SPRING, "low": "90 %", "high": "9 N/mm"}}, "low and high have different forms"),
    "percent of the SDF's": ({"k": {"keys": "bodies.tub.mass", "low": "90 %"}}, "has no number of a machine"),
    "percent of zero": ({"k": {"keys": "gasket.friction_torque_x", "low": "90 %"}}, "percents of it are 0"),
    "falling": ({"k": {"keys": KX, "low": "150 %", "high": "50 %"}}, "low must be below high"),
    "mode outside": ({"k": {"keys": KX, "distribution": "triangular", "low": "80 %", "mode": "70 %", "high": "90 %"}}, "mode between"),
    "start outside": ({"k": {"keys": KX, "low": "80 %", "high": "90 %", "start": "95 %"}}, "start is outside"),
    "deviation of another form": ({"k": {"keys": SPRING, "mean": "100 %", "deviation": "1 N/mm"}}, "not in percent above 0"),
    "deviation of no width": ({"k": {"keys": SPRING, "mean": "5 N/mm", "deviation": "0 N/mm"}}, "above 0"),
    "owned twice": ({"a": {"keys": KX, "low": "90 %"}, "b": {"keys": [SPRING, KX], "low": "90 %"}}, "b: gasket.stiffness_x: belongs to a already"),
    "owned by a sum": ({"a": {"keys": KX, "low": "90 %"}, "b": {"sets": KX, "low": "1 N/mm"}}, "belongs to an entry with sets"),
    "prior of another dimension": ({"k": {"sets": KX, "bounds": "(1, 2) N/mm", "prior": "(1, 1) kg"}}, "mean is in kg, others in N/mm"),
    "sum of another dimension": ({"k": {"sets": SPRING, "bounds": "(1, 2) kg"}}, "needs a unit such as N/mm, but kg is not of this kind"),
    "sum of no number": ({"k": {"sets": "gasket.tub_frame", "bounds": "(1, 2) kg"}}, "is not a number of the machine"),
}  # fmt: skip


@pytest.mark.parametrize("misfit", MISFITS)
def test_entry_that_does_not_fit_the_machine_is_refused_by_its_name(sponges, misfit):
    tree, message = MISFITS[misfit]
    with pytest.raises(InputError, match=message) as caught:
        varying(sponges, VaryFile.model_validate({"vary": tree}).entries())
    assert {problem.key for problem in caught.value.problems} <= tree.keys()
    assert len(str(caught.value).splitlines()) == 1


TEXTS = {
    "no values": (["K_Lx=1 N/mm"], "is not NAME=LOW..HIGH; write for example 'K_Lx=50 %..150 %'"),
    "braces": (["K_Lx={low: 1 N/mm"], "is not YAML"),
    "unknown field": (["K_Lx={lo: 1 N/mm}"], "unknown key 'lo'"),
    "twice": (["K_Lx", "K_Lx=80 %..90 %"], "'K_Lx' is given twice"),
}


@pytest.mark.parametrize("fault", TEXTS)
def test_wrong_text_of_an_option_is_refused(fault):
    texts, message = TEXTS[fault]
    with pytest.raises(InputError) as caught:
        entries_of_texts(texts, gasket_entries(), "--factor", "50 %..150 %")
    assert message in str(caught.value)
    assert caught.value.problems[0].where == "--factor"


def test_table_is_scaled_with_its_nominal_stiffness(sponges):
    machine = with_gasket_tables(sponges)
    found = varying(machine, {"k": Entry(keys=(KX,), low="90 %", high="110 %")})
    low, high = (found.machine_at([value]).gasket.stiffness_x for value in (0.9, 1.1))
    assert low.displacement == high.displacement == machine.gasket.stiffness_x.displacement
    assert low.nominal_stiffness == pytest.approx(0.9 * number_at(machine, KX).nominal)
    assert high.force == pytest.approx([1.1 * f for f in machine.gasket.stiffness_x.force])


ONE_FILE = {
    "friction": {"keys": FRICTION, "low": "20 N", "high": "60 N"},
    "share": {"keys": SPRING, "low": "90 %", "high": "110 %"},
    "place": {"keys": "loads.middle.unbalances.0.y", "mean": "nominal", "deviation": "5 mm"},
}
LACKING = {
    ("a fit", "friction"): "a fit needs mean and deviation; add 'mean: 40 N' and 'deviation: 4 N'",
    ("samples", "friction"): "add 'distribution: uniform'",
    ("a fit", "share"): "add 'mean: 100 %' and 'deviation: 10 %'",
    ("samples", "share"): "add 'distribution: uniform'",
    ("levels", "place"): "add 'low: nominal - 1 mm' and 'high: nominal + 1 mm'",
}


@pytest.mark.parametrize(("study", "name"), LACKING)
def test_study_that_lacks_a_value_says_which_line_to_add(machine, study, name):
    """One file serves all studies: the line that is asked for is enough."""
    message = LACKING[study, name]
    views = {
        "a fit": lambda file: parameter_map_of(machine, file),
        "samples": lambda file: joint_of(varying_of(machine, file.entries()), None),
        "levels": lambda file: varying_of(machine, file.entries()).with_levels("a factor"),
    }
    file = VaryFile.model_validate({"vary": {name: ONE_FILE[name]}})
    with pytest.raises(InputError) as caught:
        views[study](file)
    assert message in str(caught.value)
    assert caught.value.problems[0].key == name
    lines = dict(line.split(": ") for line in message.split("'")[1::2])
    views[study](VaryFile.model_validate({"vary": {name: ONE_FILE[name] | lines}}))


@pytest.mark.parametrize(
    ("more", "frozen"),
    [
        ({"distribution": "uniform"}, scipy.stats.uniform(0.8, 0.5)),
        ({"distribution": "triangular", "mode": "90 %"}, scipy.stats.triang(0.2, 0.8, 0.5)),
    ],
)
def test_a_fit_takes_mean_and_deviation_of_a_distribution(machine, more, frozen):
    entry = {"keys": SPRING, "low": "80 %", "high": "130 %", **more}
    file = VaryFile.model_validate({"vary": {"share": entry}})
    (unknown,) = parameter_map_of(machine, file).unknowns
    assert unknown.prior == pytest.approx((frozen.mean(), frozen.std()))


def test_an_entry_of_a_vary_file_is_named_with_its_line(machine, tmp_path):
    path = tmp_path / "mine.yaml"
    text = f"about: mine\nvary:\n  {SPRING}: 90 %..110 %\n  {FRICTION}:\n    high: 60 N\n"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_parameter_map(machine, path, load_vary(path))
    assert [p.where for p in caught.value.problems] == [f"{path}:3", f"{path}:4"]


OLD_FORMS = {
    "factor file": (
        "soft: {keys: [gasket.stiffness_x], about: soft}\n",
        ["mine.yaml:1: soft: is of an earlier version; write below a line 'vary:' the line"],
        "vary:\n  soft: {low: 50 %, high: 150 %, keys: [gasket.stiffness_x], about: soft}\n",
    ),
    "tolerance file": (
        "load: middle\nquantities:\n  k: {keys: [gravity], distribution: uniform, low: 90 %, high: 110 %}\n",
        ["mine.yaml:2: quantities: is of a tolerance or free file of an earlier version; write 'vary:' in place of 'quantities:'", "mine.yaml:1: load: has another name now; write 'loads: middle'"],
        "loads: middle\nvary:\n  k: {keys: [gravity], distribution: uniform, low: 90 %, high: 110 %}\n",
    ),
    "laundry": (
        "laundry:\n  mass: {distribution: uniform, low: 200 g, high: 600 g}\n",
        ["mine.yaml:2: laundry: is of an earlier version; write below a line 'vary:' the line '  laundry.mass: {distribution: uniform, low: 200 g, high: 600 g}'"],
        None,
    ),
    "free file": (
        "quantities:\n  k: {bounds: '(1, 2) N/mm', prior: '(1.5, 0.1) N/mm', sets: gasket.stiffness_x, source: x}\n",
        ["mine.yaml:1: quantities: is of a tolerance or free file"],
        "vary:\n  k: {bounds: '(1, 2) N/mm', prior: '(1.5, 0.1) N/mm', sets: gasket.stiffness_x, source: x}\n",
    ),
    "design file": (
        "loads: [middle]\nvariables:\n  k: {keys: [gravity], low: 90 %, high: 110 %}\nobjectives: [{quantity: gap}]\n",
        ["mine.yaml:2: variables: is of a design file of an earlier version; write 'vary:'"],
        "loads: [middle]\nvary:\n  k: {keys: [gravity], low: 90 %, high: 110 %}\nobjectives: [{quantity: gap}]\n",
    ),
}  # fmt: skip


@pytest.mark.parametrize("form", OLD_FORMS)
def test_old_form_is_refused_with_the_lines_to_write_instead(form, tmp_path):
    text, messages, new = OLD_FORMS[form]
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    assert all(message in str(caught.value) for message in messages)
    if new:
        assert read(tmp_path, new).vary


def test_lines_that_a_refusal_gives_are_the_file_to_write(tmp_path):
    with pytest.raises(InputError) as caught:
        read(
            tmp_path, "soft: {keys: [gasket.stiffness_x]}\nhard: {keys: [gravity], low: 1 m/s^2}\n"
        )
    lines = [problem.message.partition("the line '")[2][:-1] for problem in caught.value.problems]
    entries = read(tmp_path, "\n".join(["vary:", *lines])).vary
    assert (entries["hard"].low, entries["soft"].high) == ("1 m/s^2", "150 %")
