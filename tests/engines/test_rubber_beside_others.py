"""Rubber with tubes, a motor and a moving cabinet: both engines have the same time derivatives."""

import pytest
from both_engines import difference
from machines_of_each_kind import FRICTION, RUBBER, changed
from moving_cabinet import with_moving_cabinet
from telescopic_machine import changed as with_parts
from telescopic_machine import telescopic

from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", ["tubes", "motor", "cabinet"])
def test_derivatives_are_those_of_the_diagram(name):
    parameters = {
        "tubes": telescopic,
        "motor": lambda: load_machine("motor"),
        "cabinet": lambda: with_moving_cabinet(changed()),
    }[name]()
    gasket = parameters.gasket.model_dump() | FRICTION | RUBBER
    machine = build_machine(with_parts(parameters, gasket=gasket))
    assert machine.set_up().bushings["gasket"].state_size > 0
    assert difference(machine) < 1e-10
