"""Who drops a built machine gets its memory back, whatever was done with it."""

import gc
import weakref

import pytest

from wm_drake.model.build import build_machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import SpinProfile, load_machine
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import measure
from wm_drake.simulation.runs import simulate

SHORT = SpinProfile(time=(0.0, 0.02), speed=(0.0, 1.0))


@pytest.mark.parametrize("name", ["free_stroke", "motor", "light_cabinet", "ball_rings"])
def test_built_machine_is_freed_after_its_use(name):
    parameters = load_machine(name)
    machine, scene = build_machine(parameters), Scene(parameters)
    case = Case("short", next(iter(parameters.loads.values())), SHORT)
    measure(simulate(machine, case, "drake"), scene)
    copy = machine.diagram.ToAutoDiffXd()
    context = copy.CreateDefaultContext()
    context.SetTimeStateAndParametersFrom(machine.set_up().context)
    gc.collect()  # the copy holds all that it needs
    copy.EvalTimeDerivatives(context)
    diagram = machine.diagram
    systems = [copy, diagram, scene.plant, *map(diagram.GetSubsystemByName, names_in(diagram))]
    alive = [(system.get_name(), weakref.ref(system)) for system in systems]
    del machine, scene, copy, context, diagram, systems
    gc.collect()
    assert [label for label, system in alive if system() is not None] == []


def names_in(diagram):
    """Return the names of the systems of a diagram."""
    return [system.get_name() for system in diagram.GetSystems()]
