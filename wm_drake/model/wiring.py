"""Elements joined to the bodies: who sees which part of the plant's state, and where each one's force goes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, Demultiplexer, MatrixGain, Multiplexer

from wm_drake.elements.motion import GENERALIZED_FORCE_SIZE
from wm_drake.model.state_layout import StateLayout


@dataclass(frozen=True)
class Link:
    """An element between tub and drum, which are the first tree, and another tree of the plant.

    Attributes:
        label: Name of its system in the diagram.
        name: Its own.
        system: A `ElementSystem` of two trees.
        tree: Number of the other tree.
    """

    label: str
    name: str
    system: Any
    tree: int


def connect(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    state_layout: StateLayout,
    elements: list[tuple[str, Any]],
    links: list[Link],
) -> None:
    """Adds elements of tub and drum, by name, and links to the diagram, and their forces to those on the plant."""
    if links:
        _connect_trees(builder, plant, state_layout, elements, links)
        return
    total = builder.AddNamedSystem("total_force", Adder(len(elements), GENERALIZED_FORCE_SIZE))
    for index, (label, system) in enumerate(elements):
        builder.AddNamedSystem(label, system)
        builder.Connect(plant.get_state_output_port(), system.GetInputPort("plant_state"))
        builder.Connect(system.GetOutputPort("generalized_force"), total.get_input_port(index))
    builder.Connect(total.get_output_port(), plant.get_applied_generalized_force_input_port())


def _connect_trees(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    state_layout: StateLayout,
    elements: list[tuple[str, Any]],
    links: list[Link],
) -> None:
    """Where there is more than tub and drum: elements see their part of the state, other trees get forces of their own."""
    size = GENERALIZED_FORCE_SIZE
    total = builder.AddNamedSystem("total_force", Adder(len(elements) + len(links), size))
    all_forces = builder.AddNamedSystem("all_forces", Multiplexer([size] * len(state_layout.trees)))
    states, trees = np.eye(plant.num_multibody_states()), state_layout.states()
    of_tub = builder.AddNamedSystem("state_of_tub", MatrixGain(states[trees[0]]))
    builder.Connect(plant.get_state_output_port(), of_tub.get_input_port())
    for index, (label, system) in enumerate(elements):
        builder.AddNamedSystem(label, system)
        builder.Connect(of_tub.get_output_port(), system.GetInputPort("plant_state"))
        builder.Connect(system.GetOutputPort("generalized_force"), total.get_input_port(index))
    for index, link in enumerate(links):
        builder.AddNamedSystem(link.label, link.system)
        chosen = np.concatenate([trees[0], trees[link.tree]])
        state = builder.AddNamedSystem(f"state_of_{link.name}", MatrixGain(states[chosen]))
        split = builder.AddNamedSystem(f"forces_of_{link.name}", Demultiplexer([size, size]))
        builder.Connect(plant.get_state_output_port(), state.get_input_port())
        builder.Connect(state.get_output_port(), link.system.GetInputPort("plant_state"))
        builder.Connect(link.system.GetOutputPort("generalized_force"), split.get_input_port())
        builder.Connect(split.get_output_port(0), total.get_input_port(len(elements) + index))
        builder.Connect(split.get_output_port(1), all_forces.get_input_port(link.tree))
    builder.Connect(total.get_output_port(), all_forces.get_input_port(0))
    forces = all_forces.get_output_port()
    if not np.array_equal(np.concatenate(state_layout.trees), np.arange(state_layout.size)):
        gathered = np.eye(state_layout.size)[:, np.concatenate(state_layout.trees)]
        in_order = builder.AddNamedSystem("forces_in_order", MatrixGain(gathered))
        builder.Connect(forces, in_order.get_input_port())
        forces = in_order.get_output_port()
    builder.Connect(forces, plant.get_applied_generalized_force_input_port())
