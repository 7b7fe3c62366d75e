"""Connect elements to the plant: their part of its state, and their forces on its trees."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import Adder, Demultiplexer, MatrixGain, Multiplexer

from wm_drake.elements.motion import GENERALIZED_FORCE_SIZE
from wm_drake.model.state_layout import StateLayout
from wm_drake.systems.cabinet import Cabinet
from wm_drake.systems.element_system import ElementSystem


@dataclass(frozen=True)
class Link:
    """An element between tub and drum, which are the first tree, and another tree of the plant.

    Attributes:
        label: Name of its system in the diagram.
        system: An `ElementSystem` of two trees.
        tree: Number of the other tree.
    """

    label: str
    system: Any
    tree: int


class Wiring:
    """Adds systems to a diagram, with a prefix before their names, and connects them."""

    def __init__(
        self, builder: DiagramBuilder, plant: MultibodyPlant, layout: StateLayout, prefix: str
    ) -> None:
        """Connect to a finalized plant that is in the builder."""
        self.builder, self.plant, self.layout, self._prefix = builder, plant, layout, prefix

    def add(self, name: str, system: System) -> Any:
        """Add a system under its name, with the prefix, and return it."""
        return self.builder.AddNamedSystem(self._prefix + name, system)

    def tub_state(self) -> OutputPort:
        """Return the port of the state of tub and drum (14), which most elements read."""
        if len(self.layout.trees) == 1:
            return self.plant.get_state_output_port()
        return self._part_of_state("state_of_tub", [0])

    def connect_elements(
        self, tub_state: OutputPort, elements: list[tuple[str, Any]], links: list[Link]
    ) -> None:
        """Add elements of tub and drum, by label, and links, and sum up their forces on the plant.

        Args:
            tub_state: From `tub_state`.
            elements: Systems with a port "generalized_force" on tub and drum, and "plant_state" if
                they read the state.
            links: Elements between tub and drum and another tree.
        """
        total = self._total("total_force", tub_state, elements, more=len(links))
        forces = total.get_output_port()
        if links:
            forces = self._with_links(forces, total, len(elements), links)
        self.builder.Connect(forces, self.plant.get_applied_generalized_force_input_port())

    def connect_cabinet(
        self, cabinet: Cabinet, mounts: list[tuple[str, Any]], feet: ElementSystem
    ) -> OutputPort:
        """Add the mounts of tub and drum on a cabinet that moves, and its feet.

        Args:
            cabinet: System of the cabinet, which is in the diagram as a link.
            mounts: Elements by label, as for `connect_elements`.

        Returns:
            The port of the state of tub and drum seen from the cabinet.
        """
        seen = cabinet.GetOutputPort("tub_in_cabinet")
        total = self._total("mounts_force", seen, mounts)
        self.builder.Connect(total.get_output_port(), cabinet.GetInputPort("mounts_force"))
        self.add("feet", feet)
        state = self._part_of_state("state_of_feet", [len(self.layout.trees) - 1])
        self.builder.Connect(state, feet.GetInputPort("plant_state"))
        force = feet.GetOutputPort("generalized_force")
        self.builder.Connect(force, cabinet.GetInputPort("feet_force"))
        return seen

    def _total(
        self, name: str, state: OutputPort, elements: list[tuple[str, Any]], more: int = 0
    ) -> Adder:
        """Add elements of tub and drum, by label, and the sum of their forces; return the sum.

        Args:
            name: Name of the sum in the diagram.
            state: The state of tub and drum that they read.
            more: Number of further inputs of the sum.
        """
        total = self.add(name, Adder(len(elements) + more, GENERALIZED_FORCE_SIZE))
        for index, (label, system) in enumerate(elements):
            self.add(label, system)
            if system.HasInputPort("plant_state"):
                self.builder.Connect(state, system.GetInputPort("plant_state"))
            force = system.GetOutputPort("generalized_force")
            self.builder.Connect(force, total.get_input_port(index))
        return total

    def _with_links(
        self, on_tub: OutputPort, total: Adder, first: int, links: list[Link]
    ) -> OutputPort:
        """Connect the links; return the port of the forces on all trees, in the plant's order."""
        size, trees = GENERALIZED_FORCE_SIZE, self.layout.trees
        all_forces = self.add("all_forces", Multiplexer([size] * len(trees)))
        self.builder.Connect(on_tub, all_forces.get_input_port(0))
        for index, link in enumerate(links):
            self.add(link.label, link.system)
            state = self._part_of_state(f"state_of_{link.label}", [0, link.tree])
            split = self.add(f"forces_of_{link.label}", Demultiplexer([size, size]))
            self.builder.Connect(state, link.system.GetInputPort("plant_state"))
            self.builder.Connect(
                link.system.GetOutputPort("generalized_force"), split.get_input_port()
            )
            self.builder.Connect(split.get_output_port(0), total.get_input_port(first + index))
            self.builder.Connect(split.get_output_port(1), all_forces.get_input_port(link.tree))
        order = np.concatenate(trees)
        if np.array_equal(order, np.arange(self.layout.size)):
            return all_forces.get_output_port()
        in_order = self.add("forces_in_order", MatrixGain(np.eye(self.layout.size)[:, order]))
        self.builder.Connect(all_forces.get_output_port(), in_order.get_input_port())
        return in_order.get_output_port()

    def _part_of_state(self, name: str, trees: list[int]) -> OutputPort:
        """Add a gain that selects the states of some trees from the plant's; return its port."""
        states = self.layout.states()
        chosen = np.concatenate([states[tree] for tree in trees])
        part = self.add(name, MatrixGain(np.eye(self.plant.num_multibody_states())[chosen]))
        self.builder.Connect(self.plant.get_state_output_port(), part.get_input_port())
        return part.get_output_port()
