"""simulate_many: the numbers of a run are its own, whatever runs beside it; interruptions, divergence, faults, memory."""

import gc
import itertools
import sys
import tracemalloc
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import xarray as xr
from machines_of_each_kind import machines_of_each_kind
from side_by_side import check_runs_alone, recorded
from simple_machines import with_gasket_tables

from wm_drake.batch import SimulationInterrupted, simulate_many, work_items
from wm_drake.compiler.lanes import WIDTH
from wm_drake.errors import InputError, InputNotice
from wm_drake.model.build import build_machine
from wm_drake.parameters import (
    Load,
    MachineParameters,
    SpinProfile,
    Unbalance,
    load_machine,
    with_value,
)
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import measure
from wm_drake.simulation.runs import DivergenceWarning, simulate

RUN_UP = SpinProfile(time=(0.0, 12.0), speed=(5.0, 30.0))
SHORT = SpinProfile(time=(0.0, 2.0), speed=(5.0, 25.0))
LONGER = SpinProfile(time=(0.0, 11.0, 13.0), speed=(5.0, 28.0, 28.0))
VARIABLES = (
    "detergent_displacement", "gasket_force", "gasket_moment", "amplitude", "critical_speed",
)  # fmt: skip
VIOLENT = Load(unbalances=(Unbalance(mass=60.0, radius=0.3, y=0.1),))


@pytest.fixture(scope="module")
def reference(reference):
    """Return the reference machine with tables for its gasket."""
    return with_gasket_tables(reference)


@pytest.fixture(scope="module")
def machine(reference):
    """Build the machine with tables once."""
    return build_machine(reference)


def radial_force(reference, stiffness):
    """Return a straight table of the gasket's force, as long as the machine's."""
    return tuple(float(stiffness * x) for x in reference.gasket.stiffness_x.displacement)


def cases_of(reference, count, seed=1):
    """Return cases with other gaskets, weights, loads and profiles, some without gasket."""
    rng = np.random.default_rng(seed)
    for index in range(count):
        changed = with_value(
            reference, "gasket.stiffness_x.force", radial_force(reference, rng.uniform(2e3, 6e3))
        )
        changed = with_value(
            changed, "damper_types.friction.friction_force", float(rng.uniform(15.0, 40.0))
        )
        if index % 3 == 0:
            changed = with_value(changed, "bodies.motor.mass", float(rng.uniform(4.0, 7.0)))
        load = reference.loads[("middle", "counter", "front")[index % 3]]
        yield Case(
            f"case {index}",
            load,
            (RUN_UP, LONGER)[index % 2],
            gasket=index % 4 != 3,
            parameters=changed,
        )


@pytest.fixture(scope="module")
def cases(reference):
    return list(cases_of(reference, 19))


@pytest.fixture(scope="module")
def table(machine, cases):
    return simulate_many(machine, cases, workers=2)


def test_table_holds_each_case_in_its_place(table, cases):
    assert list(table.run.values) == list(range(19))
    assert list(table.case.values) == [case.name for case in cases]
    assert not any(table.diverged.values)
    assert all(table[name].attrs["units"] for name in VARIABLES)
    assert not table.gasket_force.values[3].any()  # this one had no gasket
    assert np.all(table.gasket_force.values[0] > 0.0)


@pytest.mark.parametrize("workers", [1, 3])
def test_number_of_workers_changes_no_bit(machine, cases, table, workers):
    assert table.identical(simulate_many(machine, cases, workers=workers))


def test_company_changes_no_bit(machine, cases, table):
    backwards = simulate_many(machine, reversed(cases))
    some = simulate_many(machine, cases[4:7])
    for name in VARIABLES:
        np.testing.assert_array_equal(backwards[name].values[::-1], table[name].values)
        np.testing.assert_array_equal(some[name].values, table[name].values[4:7])


@pytest.mark.parametrize("key", ["rotor_inertia", "belt_ratio"])
def test_a_run_has_its_own_rotor(key):
    parameters = load_machine("motor")
    changed = with_value(parameters, f"drive.{key}", 1.5 * getattr(parameters.drive, key))
    built, load = build_machine(parameters), parameters.loads["middle"]
    cases = [Case("run", load, SHORT, parameters=each) for each in (changed, parameters)]
    together = simulate_many(built, cases)["amplitude"].values
    alone = simulate_many(built, cases[1:])["amplitude"].values
    np.testing.assert_array_equal(together[1], alone[0])
    assert np.abs(together[0] / together[1] - 1.0).max() > 1e-4


def test_scenes_are_used_again_and_change_no_bit(machine, cases):
    built = build_machine(machine.parameters)
    first = simulate_many(built, cases[:9], measures=["gap", "contacts"], workers=2)
    count = len(built.cache.scenes)
    assert 1 <= count <= 2
    xr.testing.assert_identical(
        simulate_many(built, cases[:9], measures=["gap", "contacts"], workers=1), first
    )
    assert len(built.cache.scenes) == count


def silent(machine, case):
    """Return the record of a single run, without a warning if it diverges."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DivergenceWarning)
        return simulate(machine, case)


def test_a_single_run_and_the_same_run_beside_seven_others_are_identical(machine, reference):
    loads = ("middle", "counter", "front", "back")
    eight = [
        Case(
            f"case {index}",
            VIOLENT if index == 4 else reference.loads[loads[index % 4]],  # diverges
            RUN_UP,
            parameters=with_value(
                reference, "damper_types.friction.friction_force", 15.0 + 3.0 * index
            ),
        )
        for index in range(WIDTH)
    ]
    records, table = recorded(machine, eight)
    order = [5, 2, 7, 0, 4, 6, 1, 3]
    shuffled, other_table = recorded(machine, [eight[index] for index in order])
    for place, index in enumerate(order):
        alone = silent(machine, eight[index])
        for record in (records[index], shuffled[place]):
            xr.testing.assert_identical(record, alone)  # each variable bit for bit, each attribute
        single, measured = simulate_many(machine, [eight[index]]), measure(alone)
        for name in VARIABLES:
            value = single[name].values[0]
            np.testing.assert_array_equal(table[name].values[index], value, err_msg=name)
            np.testing.assert_array_equal(other_table[name].values[place], value, err_msg=name)
            # other code measures a record: a product and a sum may be fused there and not here
            np.testing.assert_allclose(getattr(measured, name).values, value, rtol=1e-13)
    assert table.diverged.values[4] == silent(machine, eight[4]).attrs["diverged"]
    assert sum(map(bool, table.diverged.values)) == 1


def test_only_what_is_asked_for_is_measured(machine, cases, table):
    few = simulate_many(machine, cases[:2], measures=["extremes"])
    assert set(few.data_vars) == {
        "detergent_displacement",
        "gasket_force",
        "gasket_moment",
        "diverged",
    }
    np.testing.assert_array_equal(few.gasket_force, table.gasket_force[:2])


def test_runs_that_all_diverge_end_early_and_are_reported(machine):
    told = simulate_many(machine, [Case("violent", VIOLENT, RUN_UP)] * (WIDTH + 1))
    assert all("diverged at" in text for text in told.diverged.values)
    assert np.isfinite(told.gasket_force).all()


def test_cases_are_taken_as_they_are_needed_and_progress_is_told(machine, cases):
    taken, told, ended = [], [], []

    def endless():
        for number in itertools.count():
            taken.append(number)
            yield cases[number % 2]

    simulate_many(
        machine,
        itertools.islice(endless(), 5 * WIDTH),
        workers=1,
        measures=["extremes"],
        progress=lambda done: told.append((done, len(taken))),
        finished=lambda run: ended.append((run.number, run.record)),
    )
    assert [done for done, _ in told][-1] == 5 * WIDTH
    assert not any(record for _, record in ended)  # they are kept on request only
    assert sorted(number for number, _ in ended) == list(range(5 * WIDTH))
    assert all(ahead - done <= 4 * WIDTH for done, ahead in told)


def test_ctrl_c_keeps_the_runs_that_had_ended(machine, cases, table):
    ended = []

    def interrupt(done):
        if done >= WIDTH:
            raise KeyboardInterrupt  # once per batch that ends, as an impatient user would

    with pytest.raises(SimulationInterrupted, match="interrupted after") as interrupted:
        simulate_many(
            machine,
            cases * 4,
            workers=2,
            progress=interrupt,
            finished=lambda run: ended.append(run),
        )
    kept = interrupted.value.finished
    assert WIDTH <= kept.sizes["run"] < 4 * len(cases)
    assert sorted(run.number for run in ended) == list(kept.run.values)
    for place, number in enumerate(kept.run.values):
        np.testing.assert_array_equal(
            kept.gasket_force.values[place], table.gasket_force.values[number % len(cases)]
        )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"measures": ["extremes", "amplitud"]}, "did you mean 'amplitudes'"),
        ({"step": 3e-3}, "does not divide the output period"),
    ],
)
def test_bad_arguments_are_refused(machine, cases, change, message):
    with pytest.raises(InputError, match=message):
        simulate_many(machine, cases[:1], **change)


def test_a_bad_case_is_named_and_what_had_ended_is_not_lost(machine, reference, cases):
    other = reference.model_copy(update={"gravity": 1.6})
    ended = []
    bad = Case("on the moon", reference.loads["middle"], RUN_UP, parameters=other)
    with pytest.raises(InputError, match=r"case 40 'on the moon'.*gravity"):
        simulate_many(
            machine,
            [*[cases[0]] * 40, bad],
            workers=1,
            finished=lambda run: ended.append(run.number),
        )
    assert len(ended) >= WIDTH


@pytest.mark.slow
def test_memory_does_not_grow_with_the_number_of_runs(reference, machine, monkeypatch):
    kept = 100
    monkeypatch.setattr(work_items, "KEPT_NUMBERS", kept)
    profile = SpinProfile(time=(0.0, 0.1), speed=(0.0, 1.0))

    def many(count):
        for number in range(count):
            yield Case(
                "short",
                reference.loads["middle"],
                profile,
                parameters=with_value(
                    reference, "gasket.stiffness_x.force", radial_force(reference, 3e3 + number)
                ),
            )

    simulate_many(machine, many(WIDTH), measures=["extremes"])
    peaks = []
    counts = kept + 50, kept + 850  # what is kept for the next load is full
    for count in counts:
        gc.collect()  # else up to 0.3 MB of the peak are what is to be collected
        tracemalloc.start()
        simulate_many(machine, many(count), measures=["extremes"], workers=1)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] - peaks[0] < (counts[1] - counts[0]) * 2000  # bytes; the table itself
    assert peaks[1] < 60e6


def test_machines_whose_tables_are_elsewhere_do_not_run_side_by_side(reference):
    """Swap the axes of a table and a number: they take as much room, but are not read alike."""
    table = {"displacement": (-0.05, 0.0, 0.05), "force": (-150.0, 0.0, 300.0)}
    cases = []
    for axis in "xz":
        gasket = reference.gasket.model_dump() | {f"stiffness_{axis}": table}
        parameters = MachineParameters.model_validate(reference.model_dump() | {"gasket": gasket})
        cases.append(Case(axis, reference.loads["middle"], RUN_UP, parameters=parameters))
    built = build_machine(cases[0].parameters)
    told = check_runs_alone(built, cases)
    assert abs(told.gasket_force.values[0] / told.gasket_force.values[1] - 1.0).max() > 0.01


@pytest.mark.parametrize(
    "name",
    ["gasket tables", "spring tables", "free_stroke", "two bushings, five dampers of three laws"],
)
def test_machines_with_tables_and_sponges_run_side_by_side(name):
    parameters = machines_of_each_kind()[name]
    loads = ("middle", "counter", "back")
    cases = [Case(load, parameters.loads[load], SHORT) for load in loads]
    check_runs_alone(build_machine(parameters), cases)


def test_overlapping_batches_leave_the_turns_of_threads_alone(machine, cases):
    before = sys.getswitchinterval()
    during = []
    with ThreadPoolExecutor(2) as pool:
        ended = [
            pool.submit(
                simulate_many,
                machine,
                cases[:2],
                progress=lambda _: during.append(sys.getswitchinterval()),
            )
            for _ in range(2)
        ]
    assert ended[0].result().identical(ended[1].result())
    assert {*during, sys.getswitchinterval()} == {before}


def test_friction_that_jumps_is_noticed_once_a_call(machine):
    jumping = build_machine(machines_of_each_kind()["coulomb"])
    case = Case("one", Load(unbalances=()), SpinProfile(time=(0.0, 0.2), speed=(5.0, 5.0)))
    for run in (lambda: simulate_many(jumping, [case] * 2), lambda: simulate(jumping, case)):
        with pytest.warns(InputNotice, match="Coulomb friction jumps") as issued:
            run()
        assert len(issued) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulate_many(machine, [case])
