"""The compiled engine against the Drake engine: trajectories, peaks, every kind of machine, divergence, repetition."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from machines_of_each_kind import machines_of_each_kind

from wm_drake.engines.compiled import run
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.engines.drake import run_drake
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, Unbalance, with_value
from wm_drake.simulation.cases import Case, case_of
from wm_drake.simulation.measures import measure
from wm_drake.simulation.runs import DivergenceWarning, simulate

MACHINES = machines_of_each_kind()
RUN_UP = SpinProfile(time=(0.0, 0.301, 1.6, 1.9), speed=(6.0, 8.0, 30.0, 22.0))
PEAKS = ("amplitude", "detergent_displacement", "gasket_force", "gasket_moment")


SHORT = SpinProfile(time=(0.0, 0.151, 0.4), speed=(12.0, 16.0, 22.0))
JUMPS = "two bushings, five dampers of three laws"
"""Machine with friction that jumps where a damper reverses: rounding grows there, and Drake's error
control takes its smallest steps, so that it runs for a short time only."""
RUNS = [
    "reference",
    JUMPS,
    "eight springs, seven dampers of two laws",
    pytest.param("two bushings of rubber", marks=pytest.mark.slow),
]
"""Machines that run; a run compiles 15 s of code. tests/engines/test_mechanics.py compares the time
derivatives of all kinds at random states."""
TWO = Load(
    unbalances=(Unbalance(mass=0.8, radius=0.25, y=-0.1), Unbalance(mass=0.4, radius=0.2, y=0.1))
)


@pytest.mark.parametrize("name", RUNS)
def test_every_kind_of_machine_moves_as_in_drake(name):
    """Compare Drake at its tight accuracy with the compiled engine at a fine step."""
    machine = build_machine(MACHINES[name])
    case = Case("two", TWO, SHORT if name == JUMPS else RUN_UP)
    drake = simulate(machine, case, "drake-accurate")
    compiled = simulate(machine, case, step=2.5e-3 / 16)
    compiled = compiled.sel(time=drake.time, method="nearest")  # may have more samples
    assert compiled.attrs["engine"] == "compiled"
    assert list(drake.data_vars) == list(compiled.data_vars)
    motion = float(np.abs(drake.displacement).max())
    assert motion > 1e-3
    tolerance = 2e-2 if name == JUMPS else 3e-4
    for variable in ("displacement", "tub_position", "detergent_displacement"):
        np.testing.assert_allclose(compiled[variable], drake[variable], atol=tolerance * motion)
    np.testing.assert_allclose(compiled.drum_speed, drake.drum_speed, atol=1e-6)
    np.testing.assert_allclose(compiled.drum_angle, drake.drum_angle, atol=1e-5)
    np.testing.assert_allclose(
        compiled.spring_tension,
        drake.spring_tension,
        atol=tolerance * float(np.abs(drake.spring_tension).max()),
    )


def test_without_gasket_and_with_other_numbers(machine, reference):
    for changes in (
        {"gasket": False},
        {"parameters": with_value(reference, "gasket.damping_x", 60.0)},
    ):
        case = Case("middle", reference.loads["middle"], RUN_UP, **changes)
        drake = simulate(machine, case, "drake-accurate")
        compiled = simulate(machine, case, step=2.5e-3 / 16)
        np.testing.assert_allclose(compiled.displacement, drake.displacement, rtol=0.0, atol=3e-6)
        assert compiled.attrs["gasket"] == drake.attrs["gasket"]


@pytest.mark.hours
@pytest.mark.parametrize(("load", "gasket"), [("middle", True), ("counter", False)])
def test_70_s_trajectories_agree_to_a_micrometre_when_both_are_refined(
    machine, reference, load, gasket
):
    """Compare the compiled engine at a fine step with Drake at tight accuracy. [m]"""
    case = case_of(reference, load, gasket=gasket)
    setups = [machine.set_up(case.load, gasket=gasket) for _ in range(2)]
    drake = run_drake(setups[0], case.profile, 2.5e-3, lambda fraction: None, accuracy=4e-7)
    compiled = run_compiled(setups[1], case.profile, 2.5e-3 / 32, lambda fraction: None)
    for part in ("state", "deformation"):
        found, expected = getattr(compiled, part), getattr(drake, part)
        columns = slice(3, 6) if part == "state" else slice(None)
        np.testing.assert_allclose(found[:, columns], expected[:, columns], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(("load", "gasket"), [("middle", True), ("back", True), ("counter", False)])
@pytest.mark.parametrize(
    "rate", [pytest.param(8.0, marks=pytest.mark.slow), pytest.param(1.0, marks=pytest.mark.hours)]
)
def test_peaks_at_default_steps_agree(machine, reference, load, gasket, rate):
    """Check the default step of 2.5 ms: 0.1 % in peaks with gasket, 0.3 % without."""
    profile = reference.profile
    faster = SpinProfile(time=tuple(t / rate for t in profile.time), speed=profile.speed)
    case = replace(case_of(reference, load, gasket=gasket), profile=faster)
    drake, compiled = (measure(simulate(machine, case, engine)) for engine in ("drake", "compiled"))
    for peak in PEAKS:
        np.testing.assert_allclose(
            getattr(compiled, peak), getattr(drake, peak), rtol=1e-3 if gasket else 3e-3
        )


def test_a_run_that_diverges_says_what_drakes_says(machine):
    profile = SpinProfile(time=(0.0, 8.0, 9.0), speed=(0.0, 29.3, 29.3))
    violent = Case("violent", Load(unbalances=(Unbalance(mass=60.0, radius=0.3, y=0.1),)), profile)
    records = []
    for engine in ("drake", "compiled"):
        with pytest.warns(DivergenceWarning, match="diverged at"):
            records.append(simulate(machine, violent, engine))
    coordinates = [record.attrs["diverged"].split(":")[1].split("=")[0] for record in records]
    assert coordinates[0] == coordinates[1]
    ends = [record.time[-1].item() for record in records]  # s; a repeated run has closer samples
    assert ends[0] == pytest.approx(ends[1], abs=0.01)
    assert np.isfinite(records[1].displacement).all()


@pytest.mark.parametrize("mass", [0.3, 60.0])  # kg; the second run diverges
def test_where_the_integration_pauses_changes_no_bit(machine, monkeypatch, mass):
    load = Load(unbalances=(Unbalance(mass=mass, radius=0.3, y=0.1),))
    profile = SpinProfile(time=(0.0, 1.0031, 8.0), speed=(0.0, 8.0, 29.3))  # a corner off samples
    records = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DivergenceWarning)
        for steps in (run.PAUSE_STEPS, 1, 7, 10**6):
            monkeypatch.setattr(run, "PAUSE_STEPS", steps)
            records.append(simulate(machine, Case("case", load, profile)))
    assert bool(records[0].attrs["diverged"]) == (mass > 1.0)
    for record in records[1:]:
        xr.testing.assert_identical(record, records[0])


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
