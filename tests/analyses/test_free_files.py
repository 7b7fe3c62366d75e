"""Start values of the vary files are the shipped machines."""

from pathlib import Path

import numpy as np
import pytest

from wm_drake.parameters.keys import quantities
from wm_drake.parameters.vary_file import load_vary
from wm_drake.studies.calibrate.parameter_map import parameter_map_of

ANALYSES = Path(__file__).parents[2] / "analyses"


def test_the_start_of_the_free_file_is_the_shipped_machine(machine):
    parameter_map = parameter_map_of(machine, load_vary(ANALYSES / "reference_free.yaml"))
    shipped = {key: value for key, value, _ in quantities(parameter_map.base)}
    started = {
        key: value for key, value, _ in quantities(parameter_map.parameters_at(parameter_map.start))
    }
    # the file rounds each quantity to a thousandth of its prior deviation
    rounding = 1e-3 * np.abs(parameter_map.deviation)
    allowed = dict.fromkeys((value.key for value in parameter_map.varying.sums), 1e-9)
    for value in parameter_map.varying.sums:
        allowed[value.key] += np.max(rounding @ np.abs(value.factors))
    for key, tolerance in allowed.items():
        assert started[key] == pytest.approx(shipped[key], abs=tolerance), key
