"""Spin runs in several processes have the results of one process."""

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.parameters import SpinProfile, load_machine
from wm_drake.simulation.cases import Case
from wm_drake.studies.spin.page import spin_answer
from wm_drake.studies.spin.study import natural_modes_of, run_spin

SHORT = SpinProfile(time=(0.0, 0.5), speed=(8.0, 15.0))


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["compiled", "drake"])
def test_results_do_not_depend_on_the_number_of_workers(engine):
    parameters = load_machine("reference")
    cases = [Case(name, parameters.loads[name], SHORT) for name in ("middle", "back", "front")]
    reports = []
    single = run_spin(parameters, cases, engine, workers=1)
    shared = run_spin(
        parameters,
        cases,
        engine,
        workers=2,
        progress=lambda index, fraction: reports.append((index, fraction)),
    )
    for one, other in zip(single.results, shared.results, strict=True):
        assert one.case == other.case
        assert one.record.identical(other.record)
        assert one.measures.smallest_gap == other.measures.smallest_gap
    assert {index for index, fraction in reports if fraction == 1.0} == {0, 1, 2}


def test_single_case_runs_in_this_process_and_is_measured():
    parameters = load_machine("reference")
    case = Case("middle", parameters.loads["middle"], SHORT)
    run = run_spin(parameters, [case])
    (result,) = run.results
    assert result.wall_s > 0.0
    assert np.isfinite(result.measures.amplitude).all()
    assert result.measures.smallest_gap.distance > 0.0
    modes = natural_modes_of(wm.build_machine(parameters), case)
    assert modes.load == "middle"
    table = spin_answer(run, modes).labelled()["modes"].frame()
    mode = modes.modes["sliding"][0]
    assert table.set_index("mode").frequency_sliding_Hz[mode.name] == mode.frequency_hz


def test_records_can_be_left_out(tmp_path):
    wm.run_study("spin", load=("middle",), no_records=True, out=tmp_path / "out")
    assert not list((tmp_path / "out").glob("*.nc"))
