"""Shipped machines: every number has its source, every frame its use; whole machines are plausible."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from pydantic import BaseModel
from pydrake.math import RollPitchYaw

from wm_drake.model.bodies import SDF_FOLDER, sdf_path
from wm_drake.model.build import build_machine
from wm_drake.model.equilibrium import EQUILIBRIUM_TOLERANCE
from wm_drake.parameters import (
    load_machine,
    measured_amplitudes,
    quantities,
    shipped_machines,
    source_of,
)
from wm_drake.studies.machine_show.description import oscillating_mass
from wm_drake.studies.modes.natural import natural_modes

README = SDF_FOLDER / "README.md"
CARRIED = {"oscillating_group.sdf": 2e-3, "oscillating_group_sponge.sdf": 2e-3}
"""Part of the weight that bushings may carry: short springs lean, stiff end bushings hold them."""
SHIFT = {"oscillating_group.sdf": 6e-3, "oscillating_group_sponge.sdf": 6e-3}
"""Largest distance of the rest pose from the drawn one: its rear spring leans, it tilts by 2.5 deg.
[m]"""
FRAME_GROUPS = ("spring_", "damper_", "gasket_", "sensor_", "detergent_")

pytestmark = pytest.mark.parametrize(
    "machine", [pytest.param(name, id=name) for name in shipped_machines()], indirect=True
)


@pytest.fixture(scope="module")
def machine(request):
    return load_machine(request.param)


@pytest.fixture(scope="module")
def washing_machine(machine):
    if machine.gasket is None:
        pytest.skip("a rotor rig, not a washing machine")
    return machine


@pytest.fixture(scope="module")
def built(machine):
    return build_machine(machine)


@pytest.fixture(scope="module")
def sdf(machine):
    return ET.parse(sdf_path(machine.model)).getroot().find("model")


@pytest.fixture(scope="module")
def readme():
    assert README.is_file(), f"{README} is missing"
    return README.read_text(encoding="utf-8")


def is_written(node, parts):
    """Return whether a number stands in the file; defaults do not."""
    if not parts:
        return True
    if isinstance(node, BaseModel):
        return parts[0] in node.model_fields_set and is_written(getattr(node, parts[0]), parts[1:])
    return is_written(node[int(parts[0]) if isinstance(node, tuple) else parts[0]], parts[1:])


def used_frames(machine):
    elements = [
        *machine.springs.values(),
        *machine.dampers.values(),
        *machine.all_bushings().values(),
    ]
    frames = {frame for element in elements for frame in (element.tub_frame, element.housing_frame)}
    ends = ("tub_frame", "outer_frame", "inner_frame", "housing_frame")
    frames |= {
        getattr(damper, end) for damper in machine.telescopic_dampers.values() for end in ends
    }
    sensors = [*machine.sensors.values(), *machine.accelerometers.values()]
    return frames | {sensor.frame for sensor in sensors} | {machine.clearance.detergent_frame}


def test_every_written_number_has_a_source(machine):
    keys = [key for key, _, _ in quantities(machine) if is_written(machine, key.split("."))]
    assert len(keys) >= 10
    assert [key for key in keys if not source_of(machine, key).strip()] == []


def test_every_source_belongs_to_a_number(machine):
    keys = [key for key, _, _ in quantities(machine)]
    assert [
        source
        for source in machine.sources
        if not any(f"{key}.".startswith(f"{source}.") for key in keys)
    ] == []


def test_every_frame_is_used_or_documented(machine, sdf, readme):
    frames = {frame.get("name") for frame in sdf.iter("frame")}
    assert frames
    assert {frame for frame in frames - used_frames(machine) if frame not in readme} == set()


def test_every_link_and_group_of_frames_is_documented(sdf, readme):
    links = {link.get("name") for link in sdf.iter("link")}
    assert {link for link in links if link not in readme} == set()
    frames = {frame.get("name") for frame in sdf.iter("frame")}
    prefixes = {
        frame: next((group for group in FRAME_GROUPS if frame.startswith(group)), frame)
        for frame in frames
    }
    assert {
        frame for frame, prefix in prefixes.items() if frame not in readme and prefix not in readme
    } == set()


def test_measured_tables_are_readable_and_belong_to_the_machine(machine):
    table = measured_amplitudes(machine)
    assert set(table["load"]) <= set(machine.loads)
    sizes = table[list(machine.sensors)]
    assert ((sizes > 0.0) & (sizes < 100.0)).all(axis=None)  # mm


def test_counts(washing_machine):
    machine = washing_machine
    assert len(machine.springs) >= 2
    assert len(machine.dampers) + len(machine.telescopic_dampers) >= 2
    assert len(machine.sensors) == 6
    assert machine.gasket is not None
    assert len(machine.loads) >= 2
    assert machine.profile.duration > 10.0


def test_oscillating_mass_is_that_of_the_sdf(washing_machine, built, sdf):
    machine = washing_machine
    masses = {
        link.get("name"): float(link.findtext("inertial/mass"))
        for link in sdf.iter("link")
        if link.get("name") != "housing"
    }
    masses = {name: mass for name, mass in masses.items() if not name.startswith("damper_")}
    masses |= {
        name: override.mass
        for name, override in machine.bodies.items()
        if override.mass is not None
    }
    masses |= {f"liquid at {part.y}": part.mass for part in machine.masses_on_drum}
    assert oscillating_mass(built.set_up()) == pytest.approx(sum(masses.values()))
    assert 20.0 < sum(masses.values()) < 100.0


def test_springs_carry_the_weight(washing_machine, built):
    machine = washing_machine
    setup = built.set_up(gasket=False)
    turned = RollPitchYaw(setup.rest_pose[:3]).ToRotationMatrix().matrix()
    lift = 0.0
    for spring in setup.springs.values():
        along = spring.p_WH - turned @ spring.p_ToA_T - setup.rest_pose[3:]
        length = np.linalg.norm(along)
        lift += spring.tension(length) * along[2] / length
    tubes = sum(
        built.plant.GetBodyByName(f"damper_{name}_outer").default_mass()
        for name in machine.telescopic_dampers
    )
    weight = (oscillating_mass(setup) + tubes) * machine.gravity
    assert lift == pytest.approx(weight, rel=CARRIED.get(machine.model, 2e-4))
    setup = built.set_up()
    assert all(spring.preload > 0.0 for spring in setup.springs.values())
    assert abs(setup.residual).max() <= EQUILIBRIUM_TOLERANCE
    # m: the drawn pose, but for a lateral force of 5 N of springs that lean over 4 N/mm
    assert abs(setup.rest_pose[3:]).max() < SHIFT.get(machine.model, 1.5e-3)


def test_tub_has_six_soft_modes(washing_machine, built):
    machine = washing_machine
    frequencies = natural_modes(built).frequency.values
    assert len(frequencies) == 6
    assert 0.5 < frequencies[0] < frequencies[-1] < 10.0
    # the run-up goes through all of them
    assert machine.profile.speed[-1] > 2.0 * 3.1416 * frequencies[-1]
