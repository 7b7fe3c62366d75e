"""Numbers of a page are those of `wm-drake spin`: as exported, and after each slider was moved.

The page runs in node, bit for bit as in a browser (tests/browser/test_exported_page.py). Its
rounding is not that of the engine, which fuses products and sums. Balls that hit each other make a
motion chaotic: rounding grows to the size of the motion. So each run has a twin, the engine with an
unbalance that differs by 1e-14. Displacements are compared as long as the twin stays near, and to
amplitudes and gaps the distance of the twin is added.
"""

from dataclasses import replace

import numpy as np
import pytest
from exported_machine import NodePage, movable, moved_value

import wm_drake as wm
from wm_drake.batch import simulate_many
from wm_drake.live.exported import export_page
from wm_drake.live.machine import OpenMachine
from wm_drake.parameters import SpinProfile, shipped_machines
from wm_drake.simulation.measures.record import foot_loads_of

DISPLACEMENT, AMPLITUDE, GAP = 1e-6, 1e-3, 1e-4
"""Accuracies: of displacements before the filter, relative to the largest; of amplitudes, relative;
of the gap [m]."""
OF_OVERLAP = 0.01
"""Accuracy of the depth of an overlap, relative: the page searches the direction of least depth."""
DISTURBANCE, NEAR = 1e-14, 1e-9
"""Relative change of the unbalance of a twin, and how near its displacements then are."""


def twin_of(case):
    """Return a case with an unbalance that differs as rounding does."""
    load = case.load
    if load.unbalances:
        first, *others = load.unbalances
        changed = first.model_copy(update={"mass": first.mass * (1.0 + DISTURBANCE)})
        return replace(case, load=load.model_copy(update={"unbalances": (changed, *others)}))
    moment = load.static.moment * (1.0 + DISTURBANCE)
    static = load.static.model_copy(update={"moment": moment})
    return replace(case, load=load.model_copy(update={"static": static}))


def runs_of(machine, cases):
    """Return the results of cases and of their twins, side by side, with records.

    Their steps are those that the page is told to take: no run is repeated.
    """
    found = {}
    both = [one for case in cases for one in (case, twin_of(case))]
    accepted = {"accuracy": 1.0}
    given = [one.parameters or machine.parameters for one in both]
    both = [
        replace(one, parameters=parameters.model_copy(update=accepted))
        for one, parameters in zip(both, given, strict=True)
    ]
    simulate_many(
        machine, both, measures=("amplitudes", "gap"), histories=True, workers=1,
        finished=lambda run: found.update({run.number: run}),
    )  # fmt: skip
    return [(found[number], found[number + 1]) for number in range(0, len(both), 2)]


def check_equal(page, run, twin):
    """Check a run of the page against one of the engine; return whether its twin stays near."""
    expected, other = (one.record.displacement.values for one in (run, twin))
    assert page.moved.shape == expected.shape
    largest = np.abs(expected).max(axis=0)
    is_near = np.abs(other - expected).max(axis=1) <= NEAR * largest.max()
    end = len(is_near) if is_near.all() else int(is_near.argmin())
    apart = (np.abs(page.moved - expected)[:end] / largest).max()
    assert end > 0.02 * len(is_near)
    assert apart <= DISPLACEMENT, f"{apart:.2g} in {end} of {len(is_near)} samples"
    sizes, sizes_of_twin = (one.values["amplitude"] for one in (run, twin))
    allowed = AMPLITUDE * sizes + 2.0 * np.abs(sizes_of_twin - sizes)
    assert (np.abs(page.sizes - sizes) <= allowed).all()
    assert (page.gap is None) == (run.gap is None)
    if run.gap is not None:
        wide = 2.0 * abs(twin.gap.distance - run.gap.distance)
        deep = OF_OVERLAP * max(0.0, -run.gap.distance)
        assert abs(page.gap - run.gap.distance) <= GAP + wide + deep
    return bool(is_near.all())


def check_feet(data, page, record):
    """Check smallest and largest load of each foot; both ends of its bins follow those before."""
    names = dict(data["forces"])
    loads = foot_loads_of(record)
    count = data["model"]["count"]
    bins = np.array(page.bands).reshape(-1, 6 + count["mounts"] + count["feet"], 2)
    at = [names[f"foot {name.replace('_', ' ')}"] for name in loads.feet]
    found = bins[:, at, 0].min(axis=0), bins[:, at, 1].max(axis=0)
    expected = loads.normal.min(axis=0), loads.normal.max(axis=0)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-2)


@pytest.fixture
def opened(tmp_path):
    """Return a function that exports a machine: its page in node, and the open machine."""
    pages = []

    def export(parameters, accuracy=1.0):  # no run is repeated, as in `runs_of`
        parameters = parameters.model_copy(update={"accuracy": accuracy})
        path = tmp_path / f"{parameters.name}_{len(pages)}.html"
        export_page(parameters, path)
        pages.append(NodePage(path))
        machine = wm.build_machine(parameters)
        return pages[-1], OpenMachine(parameters, machine, wm.Scene(parameters))

    yield export
    for page in pages:
        page.close()


MACHINES = [
    pytest.param(name, marks=pytest.mark.slow if name == "reference" else pytest.mark.hours)
    for name in sorted(shipped_machines())
]


@pytest.mark.parametrize("name", MACHINES)
def test_each_load_runs_as_with_spin(opened, name):
    parameters = wm.load_machine(name)
    page, machine = opened(parameters)
    cases = [wm.case_of(parameters, load) for load in parameters.loads]
    for case, (run, twin) in zip(cases, runs_of(machine.machine, cases), strict=True):
        found = page.run(case.name)
        if check_equal(found, run, twin) and parameters.cabinet:
            check_feet(page.data, found, run.record)


@pytest.mark.parametrize("name", MACHINES)
def test_each_moved_number_is_as_with_spin(opened, name):
    parameters = wm.load_machine(name)
    top = parameters.profile.highest_speed
    quick = SpinProfile(time=(0.0, 6.0, 8.0), speed=(0.0, top, top), band=parameters.profile.band)
    page, machine = opened(parameters)
    load = next(iter(parameters.loads))
    numbers, cases = movable(page.data), []
    for number in numbers:
        nominal = float(machine.sliders[number["key"]].number.nominal or 0.0)
        step = moved_value(number) - nominal
        moved = machine.moved_by(parameters, number["key"], step)
        cases.append(replace(wm.case_of(moved, load), parameters=moved, profile=quick))
    assert len(numbers) > 10
    for number, pair in zip(numbers, runs_of(machine.machine, cases), strict=True):
        change = [page.data["model"]["places"][number["key"]], moved_value(number)]
        job = {"profile": {"time": quick.time, "speed": quick.speed}}
        check_equal(page.run(load, [change], **job), *pair)


@pytest.mark.slow
def test_a_run_that_diverges_says_when(opened, reference):
    page, _ = opened(reference)
    places = page.data["model"]["places"]
    run = page.run("middle", [[places["gasket.damping_y"], 1e6]])
    assert 0.0 < run.diverged < 1.0
    assert np.isnan(run.sizes).all()
    assert page.run("middle").diverged is None
    assert page.run("middle", [[places["spring_types.suspension.stiffness"], 1e9]]).status < 0.0


STOP = """
extends: reference
name: with_stop
elements:
  buffer:
    kind: stop
    tub_frame: damper_left_tub
    housing_frame: damper_left_housing
    gap: 2 mm
    stiffness: 40 N/mm
    loss: 1 s/m
    friction: 0.3
"""


@pytest.mark.slow
def test_a_machine_with_a_stop_runs_as_with_spin(opened, tmp_path):
    (tmp_path / "stop.yaml").write_text(STOP, encoding="utf-8")
    parameters = wm.load_machine(tmp_path / "stop.yaml")
    page, machine = opened(parameters)
    assert "elements.buffer.gap" in page.data["model"]["places"]
    ((run, twin),) = runs_of(machine.machine, [wm.case_of(parameters, "middle")])
    assert float(run.record.stop_force.max()) > 10.0  # it is touched
    check_equal(page.run("middle"), run, twin)
    # a page that repeats its run with half the step begins at rest again
    repeated = opened(parameters, parameters.accuracy)[0].run("middle").moved
    largest = np.abs(run.record.displacement.values).max(axis=0)
    found = np.abs(repeated).max(axis=0)
    np.testing.assert_allclose(found, largest, rtol=parameters.accuracy)


TWIN = """
extends: reference
name: twin
springs:
  second: {type: suspension, tub_frame: spring_left_tub, housing_frame: spring_left_housing}
"""


@pytest.mark.slow
def test_springs_that_can_replace_each_other_share_the_weight(opened, tmp_path):
    (tmp_path / "twin.yaml").write_text(TWIN, encoding="utf-8")
    parameters = wm.load_machine(tmp_path / "twin.yaml")
    page, machine = opened(parameters)
    ((run, twin),) = runs_of(machine.machine, [wm.case_of(parameters, "middle")])
    check_equal(page.run("middle"), run, twin)
    assert "bodies.motor.mass" in page.data["model"]["places"]
