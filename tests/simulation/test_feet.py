"""Feet of the cabinet: weights, a rotating force, batch against record, regions, messages."""

import numpy as np
import pytest

from wm_drake.batch import simulate_many
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, Unbalance, load_machine, with_value
from wm_drake.parameters.cabinet import Cabinet
from wm_drake.parameters.spin import Region
from wm_drake.simulation.cases import Case
from wm_drake.simulation.feet import FeetLoaded, foot_loads, foot_measures
from wm_drake.simulation.measures import measure
from wm_drake.simulation.measures.record import wrenches_on_cabinet
from wm_drake.simulation.runs import simulate

G = 9.81  # m/s^2
S, H = 0.26, 0.51  # half distance of the feet, height of Wo above the floor [m]
SQUARE = Cabinet.model_validate(
    {
        "mass": 70.0,
        "centre_of_mass": (0.0, 0.0, 0.1),
        "floor": -H,
        "friction": 0.4,
        "feet": {
            "a": {"x": S, "y": S},
            "b": {"x": -S, "y": -S},
            "c": {"x": S, "y": -S},
            "d": {"x": -S, "y": S},
        },
    }
)
PROFILE = SpinProfile(
    time=(0.0, 4.0),
    speed=(5.0, 30.0),
    regions=(Region(name="A", begin=0.5, end=2.0), Region(name="B", begin=2.0, end=3.5)),
)
LOAD = Load(unbalances=(Unbalance(mass=0.9, radius=0.24, y=-0.1),))
VIOLENT = Load(unbalances=(Unbalance(mass=60.0, radius=0.3, y=0.1),))


def rotating(size, samples=3600):
    """Return a force that turns in the plane y = 0 about Wo, as wrenches on the cabinet."""
    angle = 2.0 * np.pi * np.arange(samples) / samples
    wrenches = np.zeros((samples, 6))
    wrenches[:, 3], wrenches[:, 5] = size * np.cos(angle), size * np.sin(angle)
    return wrenches


def test_feet_are_ordered_counterclockwise():
    assert SQUARE.corners == ("b", "c", "a", "d")


def test_rotating_force_at_the_centre():
    """Check least N = W/4 - F/4 sqrt(1 + (h/s)^2) and slide margin mu W - F sqrt(1 + mu^2)."""
    size, weight = 150.0, 70.0 * G
    found = foot_measures(FeetLoaded(SQUARE, G, rotating(size)), PROFILE, 5e-3)
    least = 0.25 * (weight - size * np.hypot(1.0, H / S))
    assert least > 0.0
    np.testing.assert_allclose(found["foot_normal_smallest"], least, rtol=1e-5)
    largest = 0.25 * (weight + size * np.hypot(1.0, H / S))
    np.testing.assert_allclose(found["foot_normal_largest"], largest, rtol=1e-5)
    slide = 0.4 * weight - size * np.hypot(1.0, 0.4)
    assert float(found["slide_margin"]) == pytest.approx(slide, rel=1e-5)
    assert float(found["tilt_margin"]) == pytest.approx(
        weight * S - size * np.hypot(S, H), rel=1e-5
    )


def test_vertical_moment_is_held_up_to_mu_w_r():
    wrenches = np.zeros((3, 6))
    wrenches[:, 2] = (0.0, 30.0, -50.0)
    found = foot_loads(SQUARE, G, wrenches)
    full = 0.4 * 70.0 * G * S * np.sqrt(2.0)
    np.testing.assert_allclose(found.margins[:, 2], full - np.abs(wrenches[:, 2]), rtol=1e-12)
    np.testing.assert_allclose(found.tangential[2], 50.0 / (4.0 * S * np.sqrt(2.0)), rtol=1e-12)


def test_machine_at_rest_stands_with_its_weight(machine, reference):
    still = SpinProfile(time=(0.0, 0.1), speed=(0.0, 0.0))
    record = simulate(machine, Case("empty", Load(unbalances=()), still))
    plant, context = machine.plant, machine.set_up().plant_context
    group = (*plant.GetBodiesWeldedTo(plant.GetBodyByName("tub")), plant.GetBodyByName("drum"))
    masses = [body.get_mass(context) for body in group] + [reference.cabinet.mass]
    centres = [
        body.EvalPoseInWorld(context) @ body.CalcCenterOfMassInBodyFrame(context) for body in group
    ] + [np.array(reference.cabinet.centre_of_mass)]
    total, centre = sum(masses), np.average(centres, axis=0, weights=masses)
    found = foot_loads(reference.cabinet, reference.gravity, wrenches_on_cabinet(record))
    # feet at +-S
    expected = [
        0.25 * total * G * (1.0 + centre[0] * foot.x / S**2 + centre[1] * foot.y / S**2)
        for foot in (reference.cabinet.feet[name] for name in found.feet)
    ]
    np.testing.assert_allclose(found.normal[-1], expected, rtol=1e-6)


def test_smallest_values_are_those_of_the_history(machine, reference):
    """Check that the lower bound by which samples are skipped loses none."""
    record = simulate(machine, Case("one", LOAD, PROFILE))
    wrenches = wrenches_on_cabinet(record)
    loads = foot_loads(reference.cabinet, reference.gravity, wrenches)
    feet = FeetLoaded(reference.cabinet, reference.gravity, wrenches)
    found = foot_measures(feet, PROFILE, 5e-3)
    smallest = loads.margins.min(axis=0)
    names = ("smallest_foot_load", "slide_margin", "turn_margin", "tilt_margin")
    for column, name in enumerate(names):
        assert float(found[name]) == smallest[column]
        in_regions = [loads.margins[a:b, column].min() for a, b in ((100, 400), (400, 700))]
        np.testing.assert_array_equal(found[f"region_{name}"], in_regions)
    np.testing.assert_array_equal(found["foot_normal_largest"], loads.normal.max(axis=0))
    np.testing.assert_array_equal(found["foot_tangential_largest"], loads.tangential.max(axis=0))


def test_friction_of_a_heavier_cabinet_holds_more(machine, reference):
    heavy = with_value(reference, "cabinet.mass", 50.0)
    cases = [
        Case("one", LOAD, PROFILE),
        Case("heavy", LOAD, PROFILE, parameters=heavy),
        Case("diverges", VIOLENT, PROFILE),
    ]
    table = simulate_many(machine, cases, measures=("feet", "feet regions"))
    assert table.slide_margin[1] > table.slide_margin[0] + 0.4 * 20.0 * G
    assert table.foot.values.tolist() == list(reference.cabinet.corners)
    assert np.isnan(table.region_turn_margin.values[2]).all()  # it ended before the regions did
    assert table.turn_margin.values[2] < 0.0


def test_machine_without_cabinet_is_told_so():
    machine = build_machine(load_machine("reference").model_copy(update={"cabinet": None}))
    with pytest.raises(InputError, match=r"cabinet: machine 'reference' has no cabinet"):
        simulate_many(machine, [Case("one", LOAD, PROFILE)], measures=("feet",))
    record = simulate(machine, Case("one", LOAD, SpinProfile(time=(0.0, 0.2), speed=(5.0, 6.0))))
    assert measure(record).feet is None


@pytest.mark.parametrize(
    ("feet", "message"),
    [
        ({"a": (0, 0), "b": (1, 0), "c": (1, 1)}, "has 3 feet; allowed are four"),
        ({"a": (0, 0), "b": (1, 0), "c": (2, 0), "d": (3, 0)}, "in a line"),
        ({"a": (0, 0), "b": (1, 0), "c": (0.5, 1), "d": (0.5, 0.3)}, "'d' is in a line .* between"),
        ({"a": (0, 0), "b": (1, 0), "c": (1, 1), "d": (1, 1)}, "must be the corners"),
    ],
)
def test_feet_that_cannot_carry_a_cabinet_are_refused(feet, message):
    places = {name: {"x": float(x), "y": float(y)} for name, (x, y) in feet.items()}
    with pytest.raises(ValueError, match=message):
        Cabinet.model_validate(SQUARE.model_dump() | {"feet": places})


@pytest.mark.parametrize("value", ["0", "-0.1", "0,3", "0.3 N", "nan"])
def test_bad_friction_is_refused(reference, value):
    with pytest.raises(InputError, match=r"cabinet\.friction"):
        with_value(reference, "cabinet.friction", value)
