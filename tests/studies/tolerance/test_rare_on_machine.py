"""Subset simulation against a crude count, on the reference machine."""

import numpy as np
import pytest

from wm_drake import build_machine, load_machine, simulate_many
from wm_drake.parameters import SpinProfile, varying
from wm_drake.parameters.vary_file import load_vary
from wm_drake.simulation.cases import Case
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studies.tolerance.rare import subset_simulation
from wm_drake.studies.tolerance.shares import share_of
from wm_drake.studies.tolerance.variables import uncertain_machine

GAP = 0.0149
"""Gap that about one run in a hundred falls below with heavy laundry. [m]"""
RUN_UP = SpinProfile(time=(0.0, 12.0), speed=(6.0, 30.0))
"""A run-up through the resonances, six times as short as that of the machine file."""


@pytest.mark.slow
def test_subset_simulation_agrees_with_a_crude_count_on_the_reference_machine():
    parameters = load_machine("reference")
    case = Case("laundry", next(iter(parameters.loads.values())), RUN_UP)
    file = load_vary("heavy_laundry")
    uncertain = uncertain_machine(varying(parameters, file.entries(without=())), file, case)
    machine = build_machine(uncertain.parameters)

    def above(scores):
        table = simulate_many(machine, uncertain.cases(scores), measures=("gap",))
        return np.where(table.diverged.values != "", np.nan, table.smallest_gap.values - GAP)

    size = uncertain.joint.size
    crude = share_of(above(base_samples(size, 2048, 0)[0]) <= 0.0)
    event = subset_simulation(above, size, samples=500, seed=1)
    assert 2e-3 < crude.estimate < 5e-2
    assert event.lower < crude.upper
    assert crude.lower < event.upper
    assert event.evaluations < 2048
