"""A law of another package that is stiff where no eigenvalue at rest shows it gets shorter steps."""

import numpy as np
import pytest
from hidden_wall import HIDDEN_WALL

import wm_drake as wm
from wm_drake.parameters import MachineParameters, SpinProfile

wm.register_element(HIDDEN_WALL)
PROFILE = SpinProfile(time=(0.0, 16.0), speed=(0.0, 20.1))


def with_wall(met_at):
    """Return the reference machine with a wall behind its rear sensor."""
    tree = wm.load_machine("reference").model_dump(exclude_unset=True)
    ends = {"tub_frame": "sensor_Zr", "housing_frame": "foot"}
    wall = {"kind": "hidden_wall", **ends, "stiffness": 900e3, "met_at": met_at}
    frames = {"foot": {"attached_to": "housing", "position": (0.08, 0.18, 0.42)}}
    return MachineParameters.model_validate(tree | {"frames": frames, "elements": {"wall": wall}})


def rest_length():
    """Return the distance of both ends of the wall at rest. [m]"""
    machine = wm.build_machine(with_wall(0.0))
    setup = machine.set_up()
    tub, housing = (
        machine.plant.GetFrameByName(name).CalcPoseInWorld(setup.plant_context).translation()
        for name in ("sensor_Zr", "foot")
    )
    return float(np.linalg.norm(tub - housing))


def test_a_hidden_wall_is_met_with_short_steps():
    parameters = with_wall(rest_length() - 6e-3)
    machine = wm.build_machine(parameters)

    def run(accuracy, step=None):
        given = parameters.model_copy(update={"accuracy": accuracy})
        case = wm.Case("middle", parameters.loads["middle"], PROFILE, parameters=given)
        return wm.simulate_many(machine, [case], measures=["extremes", "gap"], step=step)

    rough, repeated, true = run(1.0), run(0.005), run(1.0, 2.5e-3 / 64)
    away = [
        float(np.nanmax(np.abs(t.detergent_displacement / true.detergent_displacement - 1.0)))
        for t in (rough, repeated)
    ]
    assert rough.error.item() > 0.005
    assert repeated.is_converged.item() == 1.0
    assert away[1] < 2.0 * 0.005 < away[0]
    assert repeated.smallest_gap.item() == pytest.approx(true.smallest_gap.item(), abs=1e-4)
