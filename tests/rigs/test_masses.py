"""Masses on the bench: sponge and outer tube of [A] Eq. (6), jig of [C] Eq. (2)."""

import numpy as np
import pandas as pd
import pytest

from wm_drake.parameters import ForceTable, load_component, load_machine
from wm_drake.rigs import MATRICES, Harmonic, beyond_tables, bushing_bench, damper_bench, force_loop

FREE_STROKE = load_machine("free_stroke").damper_types["free_stroke"]
MSTV = load_component("mstv_damper").parameters
BUSHING = load_machine("free_stroke").bushing_types["connecting"]


@pytest.mark.parametrize("damper", [FREE_STROKE, MSTV], ids=["free stroke", "mstv"])
def test_a_mass_at_the_driven_end_adds_its_inertia(damper):
    motion = Harmonic(7.0, 5e-3)
    plain, heavy = (force_loop(damper_bench(damper, 0.0, mass), motion) for mass in (0.0, 2.0))
    inertia = -2.0 * (2.0 * np.pi * 7.0) ** 2 * plain.displacement
    assert heavy.force - plain.force == pytest.approx(inertia, abs=1e-9)


@pytest.mark.parametrize(("frequency", "amplitude"), [(1.0, 8e-3), (3.0, 10e-3), (7.0, 5e-3)])
def test_a_light_sponge_of_a_free_stroke_damper_moves_as_a_massless_one(frequency, amplitude):
    motion = Harmonic(frequency, amplitude)
    light, massless = (force_loop(damper_bench(FREE_STROKE, m), motion).force for m in (1e-4, 0.0))
    error = np.sqrt(np.mean(np.square(light - massless))) / np.max(massless)
    assert error < 2e-3


def test_the_effect_of_the_mass_of_its_sponge_grows_with_it():
    motion = Harmonic(7.0, 5e-3)
    forces = [force_loop(damper_bench(FREE_STROKE, m), motion).force for m in (0.0, 5e-3, 20e-3)]
    effect = [np.sqrt(np.mean(np.square(force - forces[0]))) for force in forces[1:]]
    assert effect[1] > 2.0 * effect[0]
    inertia = 20e-3 * (2.0 * np.pi * 7.0) ** 2 * 5e-3
    assert effect[1] < 20.0 * inertia


def test_matrices_are_those_of_the_tables_of_a():
    counts = {kind: len(papers["A"]) for kind, papers in MATRICES.items()}
    assert counts == {"damper": 12, "bushing": 12, "bushing about": 8, "gasket": 9}
    assert max(motion.amplitude for motion in MATRICES["bushing"]["A"]) == 0.4e-3


def test_a_motion_beyond_a_table_is_told_with_its_reach():
    table = ForceTable(displacement=(-1e-3, 0.0, 2e-3), force=(-10.0, 0.0, 20.0))
    bench = bushing_bench(BUSHING.model_copy(update={"stiffness_x": table}), "x")
    assert beyond_tables(bench, 1e-3) == []
    (told,) = beyond_tables(bench, 1.5e-3)
    assert told.startswith("stiffness_x: the motion reaches 1.5 mm, the table goes from -1 to 2 mm")
    assert beyond_tables(damper_bench(MSTV), 1.0) == []


def test_command_writes_the_effect_of_masses(wm_drake):
    bench = ("rig", "damper", "--machine", "free_stroke", "-f", "7 Hz", "-a", "5 mm")
    ended = wm_drake(*bench, "--outer-mass", "150 g", "--jig-mass", "2 kg", "--out", "out")
    assert ended.code == 0
    largest = 2.15 * (2.0 * np.pi * 7.0) ** 2 * 5e-3
    table = pd.read_csv("out/masses.csv")
    assert table.largest_difference_N[0] == pytest.approx(largest, rel=1e-6)
