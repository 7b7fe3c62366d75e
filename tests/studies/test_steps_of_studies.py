"""Studies and exports whose step is too long: their answers are those of short steps."""

import io

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from stopped_machine import RUN_UP, stopped

import wm_drake as wm
from wm_drake.export.fmu import _reference
from wm_drake.export.model import exported_model
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import STEP
from wm_drake.simulation.convergence import Accuracy, StepSummary
from wm_drake.studies.answer import Answer, Part
from wm_drake.studies.cycle.study import run_cycle
from wm_drake.studies.not_converged import marked
from wm_drake.studies.response.study import ResponseSettings, run_response_study

STIFFNESS = 2000e3
SHORT = {"accuracy": 1.0, "step": 2.5e-3 / 64, "output_period": 5e-3 / 16}


@pytest.fixture(scope="module")
def machine():
    """Return the machine with its default step, which is too long for its stop."""
    return stopped(STIFFNESS).model_copy(update={"profile": RUN_UP})


@pytest.fixture(scope="module")
def true_record(machine):
    return wm.simulate(machine.model_copy(update=SHORT), "middle")


def displacements(record):
    return np.abs(record.displacement).max("time").values


def test_a_cycle_is_repeated_until_its_swings_are_true(machine):
    case = wm.Case("middle", machine.loads["middle"], RUN_UP)
    cycle = run_cycle(wm.build_machine(machine), case)
    assert (cycle.accuracy.is_converged, cycle.accuracy.halvings > 0) == (1.0, True)
    true = run_cycle(wm.build_machine(machine.model_copy(update=SHORT)), case)
    as_it_is = run_cycle(wm.build_machine(machine.model_copy(update={"accuracy": 1.0})), case)

    def swings(of):
        return of.course.half_swing.max("time").values

    np.testing.assert_allclose(swings(cycle), swings(true), rtol=0.01)
    assert np.abs(swings(as_it_is) / swings(true) - 1.0).max() > 0.01


def test_the_reference_run_of_an_exported_machine_is_repeated(machine, true_record):
    text = _reference(exported_model(machine, "middle")).decode()
    found = pd.read_csv(io.StringIO(text)).filter(like="displacement.").abs().max()
    np.testing.assert_allclose(found, displacements(true_record), rtol=0.01)


@pytest.mark.slow
def test_the_run_up_of_a_response_is_repeated(machine):
    steps = StepSummary()
    built, load = wm.build_machine(machine), {"middle": machine.loads["middle"]}
    settings = ResponseSettings(np.array([15.0, 16.0]), gaskets=(True,), rates=())
    run_response_study(built, load, settings, steps=steps)
    assert steps.runs == 1
    assert not steps.unconverged
    assert "1 of 1 runs were repeated" in steps.text


def test_rows_of_runs_that_are_not_converged_are_marked():
    names = ["front", "middle"]
    data = xr.Dataset({"peak": STEP.variable("load", [1e-3, 2e-3])}, {"load": names})
    table = LabelledTable("peaks", data, "Peaks")
    steps = StepSummary()
    steps.add("front", Accuracy(0.001, 1.0, 2.5e-3, 0.0))
    answer = Answer("Title", "Answer.", None, (Part("Peaks", (table,)),))
    assert marked(answer, steps) is answer
    steps.add("middle", Accuracy(0.07, 0.0, 1e-4, 5.0))
    with_marks = marked(answer, steps)
    groups = with_marks.labelled()["peaks"].table().shown
    same = [group.heading == name for group, name in zip(groups, names, strict=True)]
    assert same == [True, False]
    assert with_marks.labelled()["not_converged"].data.spread.values == [0.07]
    assert answer.tables()["peaks"].equals(with_marks.tables()["peaks"])
