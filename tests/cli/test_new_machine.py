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
    with pytest.raises(InputError, match=r"parts\.csv:2: body 'tob' is not allowed"):
        read_parts(Path("parts.csv"))


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
