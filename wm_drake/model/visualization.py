"""Show the moving machine in Meshcat, with shapes on a second plant that is not simulated."""

import numpy as np
from pydrake.geometry import Box, Meshcat, MeshcatVisualizer, Rgba, SceneGraph
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, EventStatus, LeafSystem
from pydrake.systems.primitives import MatrixGain
from pydrake.systems.rendering import MultibodyPositionToGeometryPose

from wm_drake.elements.motion import POSE
from wm_drake.model.bodies import add_bodies
from wm_drake.model.machine import MachineSystems
from wm_drake.model.scene import with_fixed_cabinet
from wm_drake.model.state_layout import state_layout_of
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.callbacks import NO_SLOTS, callback

SHAPES = "/drake/visualizer"
"""Path in Meshcat of the shapes of a machine, seen from the cabinet if it moves."""

FLOOR_COLOUR, FLOOR_SIZE = Rgba(0.72, 0.74, 0.77, 1.0), (1.6, 1.6, 0.005)
"""Colour and size [m] of the drawn floor below a cabinet that moves."""

PICTURE_PERIOD = 1.0 / 32.0
"""Time between two pictures, as Drake's visualizer has it. [s]"""


def add_floor(meshcat: Meshcat, floor: float) -> None:
    """Draw the floor below a cabinet that moves.

    Args:
        floor: Height of the floor. [m]
    """
    meshcat.SetObject("/floor", Box(*FLOOR_SIZE), FLOOR_COLOUR)
    below = floor - 0.5 * FLOOR_SIZE[2]
    meshcat.SetTransform("/floor", RigidTransform([0.0, 0.0, below]))


def cabinet_pose(pose: FloatArray) -> RigidTransform:
    """Return the pose of a cabinet in W from its roll, pitch, yaw and position. [rad, m]"""
    angles, position = np.split(np.asarray(pose), 2)
    return RigidTransform(RollPitchYaw(angles), position)


class ShownCabinet(LeafSystem):
    """Pose of a cabinet that moves, shown in Meshcat with all that is drawn in its frame.

        pose (6) ──▶ [ ShownCabinet ]

    The pose is roll, pitch, yaw and position of the cabinet in W. [rad, m]
    """

    __slots__ = NO_SLOTS

    def __init__(self, meshcat: Meshcat) -> None:
        """Show the cabinet in a Meshcat."""
        LeafSystem.__init__(self)
        self._meshcat = meshcat
        self._pose = self.DeclareVectorInputPort("pose", POSE.fixed_size)
        self.DeclarePeriodicPublishEvent(PICTURE_PERIOD, 0.0, callback(self._show))
        self.DeclareForcedPublishEvent(callback(self._show))

    def _show(self, context: Context) -> EventStatus:
        pose = cabinet_pose(self._pose.Eval(context))
        self._meshcat.SetTransform(SHAPES, pose, context.get_time())
        return EventStatus.Succeeded()


def with_rigid_bearing(parameters: MachineParameters) -> MachineParameters:
    """Return the machine with a rigid bearing: the drum is shown on its axis."""
    rigid = parameters.imperfections.model_copy(update={"bearing": None})
    return parameters.model_copy(update={"imperfections": rigid})


def add_visualizer(builder: DiagramBuilder, systems: MachineSystems, meshcat: Meshcat) -> None:
    """Add systems that show a machine in Meshcat while a simulation runs.

    The shapes belong to a second plant that only follows the positions, so they cannot touch the
    dynamics. With a compliant bearing the drum is shown on the tub's axis. A cabinet that moves is
    shown where it is, on a floor.
    """
    state = systems.outputs.get("tub_in_cabinet", systems.outputs["state"])
    scene_graph = builder.AddNamedSystem("shapes", SceneGraph())
    plant = MultibodyPlant(time_step=0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    shown = with_fixed_cabinet(with_rigid_bearing(systems.parameters))
    add_bodies(plant, shown)
    layout = state_layout_of(plant, shown)
    select = np.zeros((plant.num_positions(), state.size()))
    shown_trees = np.concatenate(layout.trees)
    moved_trees = np.concatenate(systems.state_layout.trees[: len(layout.trees)])
    if systems.cabinet:  # the state is that of tub and drum alone
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
    if systems.cabinet and systems.parameters.cabinet is not None:
        add_floor(meshcat, systems.parameters.cabinet.floor)
        _add_cabinet(builder, systems, meshcat)


def _add_cabinet(builder: DiagramBuilder, systems: MachineSystems, meshcat: Meshcat) -> None:
    """Add the systems that show a cabinet that moves where it is."""
    state = systems.outputs["state"]
    pose = np.eye(state.size())[systems.state_layout.cabinet]
    selected = builder.AddNamedSystem("cabinet_pose", MatrixGain(pose))
    cabinet = builder.AddNamedSystem("shown_cabinet", ShownCabinet(meshcat))
    builder.Connect(state, selected.get_input_port())
    builder.Connect(selected.get_output_port(), cabinet.GetInputPort("pose"))
