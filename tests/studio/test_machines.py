"""Machines that pages open: each file once, read again when it has changed."""

import os

import pytest

from wm_drake.errors import InputError
from wm_drake.parameters import shipped_machines
from wm_drake.studio.machines import Machines


@pytest.fixture
def machines(tmp_path):
    """Return the machines of an empty folder."""
    return Machines("reference", tmp_path)


def test_changed_file_is_read_again(machines):
    path, text = machines.folder / "mine.yaml", shipped_machines()["reference"].read_text()
    path.write_text("name: nonsense\n")
    with pytest.raises(InputError):
        machines.open("mine.yaml")
    path.write_text(text)
    os.utime(path, (1, 1))
    opened = machines.open("mine.yaml")
    assert machines.open("mine.yaml") is opened
    os.utime(path, (2, 2))
    renewed = machines.open("mine.yaml")
    assert renewed is not opened
    assert renewed.machine is opened.machine  # same elements: nothing is built


@pytest.mark.parametrize("name", ["reference", "free_stroke", "rodrigues_2010"])
def test_each_number_has_a_part_of_the_machine_and_words(machines, name):
    page = machines.open(name).for_page()
    assert {number["part"] for number in page["numbers"]} <= set(page["parts"])
    words = [number["group"] for number in page["numbers"]]
    assert not [text for text in words if "_" in text or "frames" in text]


def test_sliders_end_where_a_vary_file_says(machines, tmp_path):
    path = tmp_path / "ranges.yaml"
    path.write_text(
        "vary:\n  gasket.damping_x: 50 %..200 %\n  bodies.tub.mass: (20, 30) kg\n"
        "  gasket.damping_y: {mean: 100 %, deviation: 7 %}\n"
    )
    usual = machines.open("reference").sliders
    given = Machines("reference", tmp_path, str(path)).open("reference").sliders
    assert (given["bodies.tub.mass"].low, given["bodies.tub.mass"].high) == (20.0, 30.0)
    nominal = usual["gasket.damping_x"].number.nominal * usual["gasket.damping_x"].unit.from_si(1.0)
    ends = given["gasket.damping_x"].low, given["gasket.damping_x"].high
    assert ends == pytest.approx((0.5 * nominal, 2.0 * nominal))
    del usual["bodies.tub.mass"], usual["gasket.damping_x"]
    assert usual.items() <= given.items()


def test_a_vary_file_of_another_machine_is_refused(tmp_path):
    path = tmp_path / "ranges.yaml"
    path.write_text("vary:\n  gasket.dampin_x: 50 %..200 %\n")
    with pytest.raises(InputError, match=r"ranges\.yaml.*gasket\.dampin_x.*damping_x"):
        Machines("reference", tmp_path, str(path)).open("reference")


@pytest.mark.parametrize("name", ["reference", "free_stroke", "rodrigues_2010"])
def test_both_ends_of_each_slider_are_allowed(machines, name):
    machine = machines.open(name)
    refused = []
    for slider in machine.sliders.values():
        for end in () if slider.needs else (slider.low, slider.high):
            try:
                machine.moved({slider.key: f"{end!r} {slider.unit.label}"})
            except InputError as error:
                refused.append(str(error))
    assert refused == []


def test_number_that_cannot_be_moved_alone_has_no_slider_and_comes_last(machines):
    machine = machines.open("reference")
    alone = [number for number in machine.for_page()["numbers"] if not number["needs"]]
    others = machine.for_page()["numbers"][len(alone) :]
    keys = {number["key"] for number in others if number["part"] == "gasket"}
    axes = [f"{part}_{axis}" for part in ("force", "torque") for axis in "xyz"]
    assert {f"gasket.dahl_{axis}" for axis in axes} < keys
    assert all("dahl" in key or "maxwell" in key for key in keys)
    (force,) = (number for number in others if number["key"] == "gasket.dahl_force_x")
    assert force["needs"] == "dahl_displacement_x: must be above 0 where dahl_force_x is"
    both = {"gasket.dahl_force_x": "5 N", "gasket.dahl_displacement_x": "1 mm"}
    assert machine.moved(both).gasket.dahl_force_x == 5.0


def test_time_of_a_profile_stays_between_its_neighbours(machines):
    slider = machines.open("reference").sliders["profile.time.1"]
    assert 0.0 < slider.low < slider.high < 70.0


def test_folders_and_other_files_are_not_listed(machines):
    (machines.folder / "folder.yaml").mkdir()
    (machines.folder / "notes.txt").write_text("")
    assert [name for name, kind in machines.listed().items() if kind == "saved"] == []
