"""Tests of `wm-drake machine new` with numbers: files that run at once, parts, refusals."""

import re
from pathlib import Path

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.errors import InputError
from wm_drake.parameters.first_machine import COLUMNS, Mass, combined, read_parts, shell

ROW = "shell,tub,10,0,0,0,0.5,0.6,0.5,0,0,0"
PARTS = f"{','.join(COLUMNS)}\n{ROW}\nweight,tub,30,0,40,80,0.1,0.2,0.1,0,0,0\n"
DRUM = "drum,drum,9,0,50,0,0.3,0.38,0.3,0,0,0\n"


@pytest.fixture
def new(wm_drake):
    """Return a function that writes a machine with two springs and other numbers."""
    numbers = ("--tub-mass", "40 kg", "--springs", "2", "--dampers", "2")
    return lambda *more: wm_drake("machine", "new", "mine", *numbers, *more)


def test_numbers_alone_give_a_machine_that_runs(new, wm_drake):
    assert new("--speed", "300 rpm").code == 0
    text = Path("mine.yaml").read_text()
    assert "source: 'assumption: 2.5 Hz vertically with 49 kg'" in text
    assert wm_drake("machine", "check", "mine.yaml", "--strict").code == 0
    machine = wm.build_machine(wm.load_machine("mine.yaml"))
    found = wm.simulate(machine, "front")
    assert float(np.abs(found.displacement).max()) < 0.05
    assert new().err.startswith("mine.yaml: exists already")


@pytest.mark.parametrize("count", ["3", "4"])
def test_springs_around_the_centre_of_mass_hold_it(wm_drake, count):
    numbers = ("--tub-centre", "(12, 30, -20) mm", "--springs", count, "--dampers", count)
    assert wm_drake("machine", "new", "mine", *numbers).code == 0
    assert wm_drake("machine", "check", "mine.yaml").code == 0


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--tub-mass", "4 mm"), "--tub-mass: unit 'mm' does not fit"),
        (("--springs", "7"), "--springs: input should be less than or equal to 4"),
        (("--extends", "motor", "--speed", "9 rpm"), "--extends: not allowed with numbers"),
    ],
)
def test_wrong_numbers_are_refused(wm_drake, option, message):
    ended = wm_drake("machine", "new", "mine", *option)
    assert (ended.code, Path("mine.yaml").exists()) == (2, False)
    assert message in ended.err


def test_parts_are_combined_about_their_common_centre():
    halves = [Mass(1.0, np.array([0.0, y, 0.0]), np.zeros((3, 3)), "") for y in (-0.1, 0.3)]
    whole = combined(halves, "")
    assert (whole.mass, whole.centre.tolist()) == (2.0, pytest.approx([0.0, 0.1, 0.0]))
    assert np.diag(whole.inertia) == pytest.approx([2 * 0.2**2, 0.0, 2 * 0.2**2])
    turned = shell(2.0, 0.3, 0.4)
    assert np.diag(turned) == pytest.approx([0.09 + 2 * 0.16 / 12, 0.18, 0.09 + 2 * 0.16 / 12])


def test_a_table_of_parts_gives_the_bodies(wm_drake):
    Path("parts.csv").write_text(PARTS + DRUM)
    assert wm_drake("machine", "new", "cad", "--parts", "parts.csv", "--springs", "3").code == 0
    assert wm_drake("machine", "check", "cad.yaml").code == 0
    masses = [float(text) for text in re.findall("<mass>(.*)</mass>", Path("cad.sdf").read_text())]
    assert masses == [40.0, 9.0]
    tub = read_parts(Path("parts.csv"))["tub"]
    assert tub.centre == pytest.approx([0.0, 0.03, 0.06])
    Path("parts.csv").write_text(PARTS)
    with pytest.raises(InputError, match="has no part of the drum"):
        read_parts(Path("parts.csv"))
    Path("parts.csv").write_text(PARTS.replace("shell,tub", "shell,tob"))
    with pytest.raises(InputError, match=r"parts\.csv:2: part 'shell' has the body 'tob'; allowed"):
        read_parts(Path("parts.csv"))


UNITS = {"kg mm^2": 1e6, "g mm^2": 1e9, "g cm^2": 1e7, "kg cm^2": 1e4, "lb in^2": 3417.17, "t mm^2": 1e3, "lb ft^2": 23.7304}  # fmt: skip


def test_totals_and_assemblies_beside_their_parts_are_refused(tmp_path):
    """Add rows that are the sum of all parts, of some, and of some of both bodies, rounded."""
    generator, path = np.random.default_rng(4), tmp_path / "parts.csv"
    masses = np.round(generator.uniform(0.5, 9.0, 8), 2)
    centres = np.round(generator.uniform(-200.0, 200.0, (8, 3)))
    bodies = ["drum" if k > 5 else "tub" for k in range(8)]

    def row(name, body, mass, centre):
        return f"{name},{body},{mass:g},{','.join(f'{c:g}' for c in centre)},0.03,0.03,0.03,0,0,0\n"

    def text(rows, more=""):
        return f"{','.join(COLUMNS)}\n{''.join(rows)}{more}"

    rows = [row(f"p{k}", bodies[k], masses[k], centres[k]) for k in range(8)]
    path.write_text(text(rows))
    assert read_parts(path)["tub"].mass == pytest.approx(masses[:6].sum())
    for used in ([0, 1, 2, 3, 4, 5], [1, 3, 4], [6, 7], list(range(8))):
        mass = masses[used].sum()
        centre = np.round(masses[used] @ centres[used] / mass, 1)
        path.write_text(text(rows, row("sum", "tub", np.round(mass, 2), centre)))
        names = ", ".join(f"p{k}" for k in used)
        with pytest.raises(InputError, match=rf"parts.csv:10: part 'sum' .* of {names} together"):
            read_parts(path)


def part(mass=12.0, centre=(0, 0, 0), inertia=(0.6, 0.8, 0.6, 0, 0, 0), name="part"):
    return f"{name},tub,{','.join(map(str, (mass, *centre, *inertia)))}\n"


REFUSED = {
    **{
        f"inertia in {unit}": (part(inertia=np.array([0.6, 0.8, 0.6, 0, 0, 0]) * n), rf"radius of gyration .* is it in .*{re.escape(unit)}")
        for unit, n in UNITS.items()
    },
    "mass in g": (part(mass=12000), "a mass of 12000 kg; allowed is above 0 up to 1000; is it in g"),
    "mass in t": (part(mass=0.012), "or is the mass in t"),
    "mass 0": (part(mass=0), "a mass of 0 kg"),
    "mass below 0": (part(mass=-1), "a mass of -1 kg"),
    "place in um": (part(centre=(0, 0, 250000)), "250000 mm from the middle|2.5e.05 mm from the middle"),
    "rows of the matrix": (part(inertia=(0.6, 0.05, 0.02, 0.05, 0.8, 0.01)), "not positive definite.* rows of the matrix"),
    "rows of the triangle": (part(inertia=(0.6, 0.05, 0.02, 0.8, 0.01, 0.6)), "rows of the matrix"),
    "products that a body has": (part(inertia=(0.6, 0.6, 0.6, -0.25, -0.25, -0.25)), None),
    "products of the other sign": (part(inertia=(0.6, 0.6, 0.6, 0.25, 0.25, 0.25)), "belongs to no body.* do the products have the other sign"),
    "no triangle": (part(inertia=(0.04, 0.9, 0.1, 0, 0, 0)), "principal moments 0.04, 0.1, 0.9 kg m.2 the largest must not"),
    "twice": (part() * 2, "is there already"),
    "no name": (part(name=""), "has no name"),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_part_that_no_machine_has_is_refused_with_its_line(kind, wm_drake):
    rows, reason = REFUSED[kind]
    comments = f"# from CAD\n{','.join(COLUMNS)}\n\n{ROW}\n# a comment\n"
    Path("parts.csv").write_text(f"{comments}{rows}{DRUM}")
    ended = wm_drake("machine", "new", "cad", "--parts", "parts.csv")
    assert Path("cad.yaml").exists() == Path("cad.sdf").exists() == (reason is None)
    if reason:
        assert ended.code == 2
        (line,) = ended.messages
        assert re.match(r"parts\.csv:[67]: part '.*' ", line)
        assert re.search(reason, line)


@pytest.mark.parametrize(
    ("rows", "remark"),
    [
        (part(9, (0, -50, 250), (0.625, 0.6625, 0.1225, 0, 0, 0.1125)), "is the inertia about the origin?"),
        (part(inertia=(6e-4, 8e-4, 6e-4, 0, 0, 0)), "denser than lead"),
        (part(inertia=(3.6, 4.8, 3.6, 0, 0, 0)), "a radius of gyration of 632.5 mm, which is unusual"),
        (part(9, (0, -50, 250), (0.04, 0.1, 0.1, 0, 0, 0)), ""),
    ],
)  # fmt: skip
def test_part_that_is_unlikely_is_remarked_on(rows, remark, wm_drake):
    Path("parts.csv").write_text(f"{','.join(COLUMNS)}\n{ROW}\n{rows}{DRUM}")
    ended = wm_drake("machine", "new", "cad", "--parts", "parts.csv")
    assert ended.code == 0
    assert ("notice: parts.csv:3: part 'part': " in ended.err) == bool(remark)
    assert remark in ended.err


def test_places_in_metres_are_remarked_on(wm_drake):
    rows = part(9, (0, -0.05, 0.25), (0.04, 0.1, 0.1, 0, 0, 0))
    Path("parts.csv").write_text(f"{','.join(COLUMNS)}\n{ROW}\n{rows}{DRUM.replace('50', '0.05')}")
    ended = wm_drake("machine", "new", "cad", "--parts", "parts.csv")
    assert "notice: parts.csv: all centres of mass are within 2 mm" in ended.err


def test_a_centre_off_the_plane_of_two_springs_gets_preloads_that_work(new, wm_drake):
    new()
    off = "extends: mine.yaml\nname: off\ngasket: null\n"
    off += "bodies: {tub: {centre_of_mass: '(0, 25, 0) mm'}}\n"
    Path("off.yaml").write_text(off)
    ended = wm_drake("machine", "check", "off.yaml")
    assert ended.code == 2
    assert "or let it find its own rest pose: with springs.left.preload: 2" in ended.err
    found = re.findall(r"springs\.(\w+)\.preload: (\S+ N)", ended.err)
    springs = ", ".join(f"{name}: {{preload: {force}}}" for name, force in found)
    Path("off.yaml").write_text(f"{off}springs: {{{springs}}}\n")
    assert wm_drake("machine", "check", "off.yaml").code == 0


def test_a_housing_that_nothing_holds_is_named(new, wm_drake):
    new()
    sdf = Path("mine.sdf").read_text()
    joint = re.search(r' *<joint name="housing_to_floor".*?</joint>\n', sdf, re.DOTALL)
    Path("mine.sdf").write_text(sdf.replace(joint[0], ""))
    ended = wm_drake("machine", "check", "mine.yaml")
    assert ended.code == 2
    assert "link 'housing' is not fixed to world: add <joint" in ended.err
