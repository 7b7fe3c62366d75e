"""Show the moving machine in Meshcat, with shapes on a second plant that is not simulated."""

import numpy as np
from pydrake.geometry import Meshcat, MeshcatVisualizer, SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import MatrixGain
from pydrake.systems.rendering import MultibodyPositionToGeometryPose

from wm_drake.model.bodies import add_bodies
from wm_drake.model.cabinet import with_fixed_cabinet
from wm_drake.model.state_layout import StateLayout, state_layout_of
from wm_drake.parameters import MachineParameters


def with_rigid_bearing(parameters: MachineParameters) -> MachineParameters:
    """Return the machine with a rigid bearing: the drum is shown on its axis."""
    rigid = parameters.imperfections.model_copy(update={"bearing": None})
    return parameters.model_copy(update={"imperfections": rigid})


def add_visualizer(
    builder: DiagramBuilder,
    parameters: MachineParameters,
    state_layout: StateLayout,
    state: OutputPort,
    meshcat: Meshcat,
) -> None:
    """Add systems that show a machine in Meshcat while a simulation runs.

    The shapes belong to a second plant that only follows the positions, so they cannot touch the
    dynamics. With a compliant bearing the drum is shown on the tub's axis.

    Args:
        builder: The diagram that the machine is in.
        parameters: The machine.
        state_layout: State layout of the machine's plant.
        state: Output port of the plant's state; for a cabinet that moves, port of the state of tub
            and drum seen from it.
        meshcat: Where to show it.
    """
    scene_graph = builder.AddNamedSystem("shapes", SceneGraph())
    plant = MultibodyPlant(time_step=0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    shown = with_fixed_cabinet(with_rigid_bearing(parameters))
    add_bodies(plant, shown)
    layout = state_layout_of(plant, shown)
    select = np.zeros((plant.num_positions(), state.size()))
    shown_trees = np.concatenate(layout.trees)
    moved_trees = np.concatenate(state_layout.trees[: len(layout.trees)])
    if parameters.cabinet_moves:  # the state is that of tub and drum alone
        moved_trees = np.arange(len(shown_trees))
    select[shown_trees, moved_trees] = 1.0
    positions = builder.AddNamedSystem("shown_positions", MatrixGain(select))
    poses = builder.AddNamedSystem("shape_poses", MultibodyPositionToGeometryPose(plant))
    builder.Connect(state, positions.get_input_port())
    builder.Connect(positions.get_output_port(), poses.get_input_port())
    builder.Connect(
        poses.get_output_port(), scene_graph.get_source_pose_port(plant.get_source_id())
    )
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
