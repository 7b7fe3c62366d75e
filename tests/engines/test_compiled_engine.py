"""The compiled engine against the Drake engine: trajectories, peaks, every kind of machine, divergence, repetition."""

import numpy as np
import pytest
from machines_of_each_kind import machines_of_each_kind

from wm_drake.model.machine import build_machine
from wm_drake.parameters import Load, SpinProfile, Unbalance
from wm_drake.simulation.cases import Case, case_of
from wm_drake.simulation.measures import measure
from wm_drake.simulation.runs import DivergenceWarning, simulate

MACHINES = machines_of_each_kind()
RUN_UP = SpinProfile(time=(0.0, 0.501, 3.0, 3.5), speed=(4.0, 6.0, 30.0, 22.0))
PEAKS = ("amplitude", "detergent_displacement", "gasket_force", "gasket_moment")


@pytest.mark.parametrize("name", MACHINES)
def test_every_kind_of_machine_moves_as_in_drake(name):
    machine = build_machine(MACHINES[name])
    case = Case(
        "two",
        Load(
            unbalances=(
                Unbalance(mass=0.8, radius=0.25, y=-0.1),
                Unbalance(mass=0.4, radius=0.2, y=0.1),
            )
        ),
        RUN_UP,
    )
    jumps = name in (
        "coulomb",
        "two bushings, five dampers of three laws",
    )  # friction that jumps at rest grows what is rounded
    drake, compiled = (
        simulate(machine, case, engine, step=5e-4 if jumps else None)
        for engine in ("drake", "compiled")
    )
    assert compiled.attrs["engine"] == "compiled"
    assert list(drake.data_vars) == list(compiled.data_vars)
    motion = float(np.abs(drake.displacement).max())
    assert motion > 1e-3
    tolerance = 2e-2 if jumps else 1e-6
    for variable in ("displacement", "tub_position", "detergent_displacement"):
        np.testing.assert_allclose(compiled[variable], drake[variable], atol=tolerance * motion)
    np.testing.assert_allclose(compiled.drum_speed, drake.drum_speed, atol=1e-6)
    np.testing.assert_allclose(compiled.drum_angle, drake.drum_angle, atol=1e-5)
    np.testing.assert_allclose(
        compiled.spring_tension,
        drake.spring_tension,
        atol=tolerance * float(drake.spring_tension.max()),
    )


def test_without_gasket_and_with_other_numbers(machine, reference):
    for changes in (
        {"gasket": False},
        {"parameters": MACHINES["reference"].model_copy(update={"name": "other"})},
    ):
        case = Case("middle", reference.loads["middle"], RUN_UP, **changes)
        drake, compiled = (simulate(machine, case, engine) for engine in ("drake", "compiled"))
        np.testing.assert_allclose(
            compiled.displacement, drake.displacement, rtol=0.0, atol=1e-7
        )  # m
        assert compiled.attrs["gasket"] == drake.attrs["gasket"]


@pytest.mark.slow
@pytest.mark.parametrize(("load", "gasket"), [("middle", True), ("counter", False)])
def test_70_s_trajectories_agree_to_a_micrometre_at_refined_steps(machine, reference, load, gasket):
    case = case_of(reference, load, gasket=gasket)
    drake, compiled = (
        simulate(machine, case, engine, step=1.25e-3) for engine in ("drake", "compiled")
    )
    for variable in (
        "displacement",
        "tub_position",
        "detergent_displacement",
        "damper_deformation",
    ):
        np.testing.assert_allclose(compiled[variable], drake[variable], rtol=0.0, atol=1e-6)  # m


@pytest.mark.slow
@pytest.mark.parametrize(
    ("load", "gasket"),
    [(load, True) for load in ("middle", "counter", "back", "front")]
    + [("middle", False), ("counter", False)],
)
def test_peaks_at_default_steps_agree(machine, reference, load, gasket):
    case = case_of(reference, load, gasket=gasket)
    drake, compiled = (measure(simulate(machine, case, engine)) for engine in ("drake", "compiled"))
    for peak in PEAKS:
        np.testing.assert_allclose(getattr(compiled, peak), getattr(drake, peak), rtol=1e-5)
    np.testing.assert_allclose(compiled.critical_speed, drake.critical_speed, rtol=1e-5)


def test_a_run_that_diverges_says_what_drakes_says(machine):
    profile = SpinProfile(time=(0.0, 8.0, 9.0), speed=(0.0, 29.3, 29.3))
    violent = Case("violent", Load(unbalances=(Unbalance(mass=60.0, radius=0.3, y=0.1),)), profile)
    records = []
    for engine in ("drake", "compiled"):
        with pytest.warns(DivergenceWarning, match="diverged at"):
            records.append(simulate(machine, violent, engine))
    drake, compiled = records
    assert (
        compiled.attrs["diverged"].split(":")[0] == drake.attrs["diverged"].split(":")[0]
    )  # at the same sample
    assert compiled.sizes["time"] == drake.sizes["time"]
    assert np.isfinite(compiled.displacement).all()


def test_progress_runs_to_one(machine, reference):
    told = []
    simulate(
        machine,
        Case("middle", reference.loads["middle"], SpinProfile(time=(0.0, 12.0), speed=(0.0, 9.0))),
        progress=told.append,
    )
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert len(told) > 1
