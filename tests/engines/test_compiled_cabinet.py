"""A cabinet that moves on its feet: the compiled machine against the Drake diagram."""

import numpy as np
import pytest
from both_engines import LOAD, STATES, BothEngines, places
from machine_with_bearing import with_bearing
from machines_of_each_kind import machines_of_each_kind
from moving_cabinet import with_moving_cabinet

from wm_drake.model.build import build_machine


def machines():
    kinds = machines_of_each_kind()
    fixed = {"reference": kinds["reference"]}
    fixed["three laws"] = kinds["two bushings, five dampers of three laws"]
    fixed["compliant bearing"] = with_bearing(kinds["reference"])
    return {name: with_moving_cabinet(parameters) for name, parameters in fixed.items()}


MACHINES = machines()


@pytest.mark.parametrize("name", MACHINES)
def test_derivatives_are_those_of_the_diagram_at_random_states(name):
    machine = build_machine(MACHINES[name])
    both, did = BothEngines(machine, machine.set_up(LOAD)), set()
    slips = places(both.context, [machine.feet])

    def visit_feet():
        feet = machine.feet.GetMyContextFromRoot(both.context)
        for force in machine.outputs["feet_floor_force"].Eval(feet).reshape(4, 3):
            did.add("lifted" if force[2] == 0.0 else "pressed")
        rates = machine.diagram.EvalTimeDerivatives(both.context).CopyToVector()[slips]
        did.update("slides" if np.any(slip) else "sticks" for slip in rates.reshape(4, 2))

    assert both.largest_difference(STATES, visit=visit_feet) < 1e-10
    assert did == {"lifted", "pressed", "sticks", "slides"}
