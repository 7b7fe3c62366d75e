"""simulate_remembered returns the table of simulate_many and runs only the missing cases."""

import itertools

import numpy as np
import pytest
import xarray as xr

from wm_drake.batch import SimulationInterrupted, run_keys, simulate_many, simulate_remembered
from wm_drake.batch.ledger import open_ledger
from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile, with_value
from wm_drake.simulation.cases import Case

SHORT = SpinProfile(time=(0.0, 3.0), speed=(5.0, 20.0))
IDENTITY = {"study": "test"}


def cases_of(reference, count=20):
    for index in range(count):
        changed = with_value(reference, "gasket.damping_x", 10.0 + index)
        yield Case(f"case {index}", reference.loads["middle"], SHORT, parameters=changed)


def remembered(path, machine, cases, **options):
    with open_ledger(path, IDENTITY, resume=True) as ledger:
        held = len(ledger)
        table = simulate_remembered(machine, cases, ledger, **options)
        return table, len(ledger) - held


@pytest.fixture(scope="module")
def plain(machine, reference):
    return simulate_many(machine, cases_of(reference), measures=("extremes",))


def test_nothing_is_run_the_second_time_and_the_table_is_the_same(
    machine, reference, plain, tmp_path, no_runs
):
    path = tmp_path / "ledger"
    first, run = remembered(path, machine, cases_of(reference))
    assert run == 20
    no_runs()
    second, run = remembered(path, machine, cases_of(reference))
    assert run == 0
    xr.testing.assert_identical(first, plain)
    xr.testing.assert_identical(second, plain)


def test_missing_cases_are_run_whatever_the_ledger_holds(machine, reference, plain, tmp_path):
    cases = list(cases_of(reference))
    remembered(tmp_path / "ledger", machine, cases[3:14:2])
    done = []
    table, run = remembered(
        tmp_path / "ledger", machine, iter(cases), progress=done.append, workers=1
    )
    assert run == 14
    assert done == list(range(1, 21))
    xr.testing.assert_identical(table, plain)


def test_interrupted_runs_are_kept(machine, reference, plain, tmp_path):
    def interrupting(done):
        if done == 8:
            raise KeyboardInterrupt

    with pytest.raises(SimulationInterrupted):
        remembered(
            tmp_path / "ledger", machine, cases_of(reference), progress=interrupting, workers=1
        )
    table, run = remembered(tmp_path / "ledger", machine, cases_of(reference))
    assert run <= 12
    xr.testing.assert_identical(table, plain)


def test_divergence_of_a_run_is_stored(machine, reference, tmp_path):
    violent = with_value(reference, "loads.middle.unbalances.0.mass", 2000.0)
    case = Case("violent", violent.loads["middle"], SpinProfile(time=(0.0, 8.0), speed=(0.0, 40.0)))
    first, _ = remembered(tmp_path / "ledger", machine, [case])
    second, run = remembered(tmp_path / "ledger", machine, [case])
    assert run == 0
    assert "the run diverged at" in first.diverged.values[0]
    xr.testing.assert_identical(first, second)


def test_keys_depend_on_all_that_determines_a_run_and_nothing_else(reference, tmp_path):
    other_sdf = tmp_path / "other.sdf"
    from wm_drake.model.bodies import sdf_path

    other_sdf.write_text(sdf_path(reference.model).read_text() + "<!-- -->")
    case = Case("one", reference.loads["middle"], SHORT)
    variants = [
        case,
        Case("one", reference.loads["counter"], SHORT),
        Case("one", reference.loads["middle"], reference.profile),
        Case("one", reference.loads["middle"], SHORT, gasket=False),
        Case(
            "one",
            reference.loads["middle"],
            SHORT,
            parameters=with_value(reference, "gasket.damping_x", 19.1),
        ),
    ]
    keys = list(run_keys(reference, variants, measures=["extremes"]))
    keys += run_keys(reference, [case], measures=["extremes", "gap"])
    keys += run_keys(reference, [case], measures=["extremes"], step=1e-3)
    keys += run_keys(with_value(reference, "model", str(other_sdf)), [case], measures=["extremes"])
    assert len(set(keys)) == len(keys)
    renamed = with_value(with_value(reference, "name", "x"), "loads.back.unbalances.0.mass", 3.0)
    same = [Case("two", reference.loads["middle"], SHORT, parameters=renamed)]
    assert list(run_keys(reference, same, measures=["extremes"])) == keys[:1]


def test_cases_are_taken_as_needed(machine, reference, tmp_path):
    endless = (case for _ in itertools.count() for case in cases_of(reference))

    def stop(done):
        if done >= 48:
            raise KeyboardInterrupt

    with pytest.raises(SimulationInterrupted) as caught:
        remembered(tmp_path / "ledger", machine, endless, progress=stop)
    assert np.all(np.isfinite(caught.value.finished.gasket_force))


def test_parameters_that_are_tables_are_stored_too(reference, tmp_path):
    curve = {"displacement": (-0.02, 0.0, 0.02), "force": (-80.0, 0.0, 80.0)}
    hardening = with_value(reference, "gasket.stiffness_x", curve)
    built = build_machine(hardening)
    case = Case("table", hardening.loads["middle"], SHORT)
    table, _ = remembered(tmp_path / "ledger", built, [case])
    xr.testing.assert_identical(table, simulate_many(built, [case], measures=("extremes",)))
