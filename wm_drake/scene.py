"""The machine's shapes: distances between tub and housing, and a replay for the eye.

The simulated plant carries no shapes, so that nothing in a run depends on them; here the same SDF is posed after the run.
"""

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import GeometryId, Meshcat, MeshcatVisualizer
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from wm_drake.bodies import add_bodies, set_bodies
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.elements import FloatArray

REPLAY_RATE = 32.0
"""Frames of a replay per simulated second. [Hz]"""


@dataclass(frozen=True)
class Gap:
    """Distance between a part that moves with the tub and a part of the housing.

    Attributes:
        distance: < 0 when they overlap. [m]
        time: When. [s]
        moving, fixed: Names of the two shapes in the SDF.
        point: Point of the moving shape nearest the fixed one, in W. [m]
    """

    distance: float
    time: float
    moving: str
    fixed: str
    point: tuple[float, float, float]


class Scene:
    """The shapes of a machine, to be put into any pose."""

    def __init__(self, parameters: MachineParameters, meshcat: Meshcat | None = None) -> None:
        """Builds plant and geometry of a machine; with a Meshcat to show them in, if given."""
        builder = DiagramBuilder()
        self.plant, self._scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
        add_bodies(self.plant, parameters)
        if meshcat is not None:
            MeshcatVisualizer.AddToBuilder(builder, self._scene_graph, meshcat)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = self.plant.GetMyContextFromRoot(self._context)
        set_bodies(self.plant, self._plant_context, parameters)
        self._pairs = [(a, b) for a in self._shapes("tub") for b in self._shapes("housing")]

    def _shapes(self, body: str) -> list[GeometryId]:
        welded = self.plant.GetBodiesWeldedTo(self.plant.GetBodyByName(body))
        return [shape for part in welded for shape in self.plant.GetCollisionGeometriesForBody(part)]

    def _name(self, shape: GeometryId) -> str:
        return str(self._scene_graph.model_inspector().GetName(shape)).split("::")[-1]

    def distance(self, pose: FloatArray, pair: tuple[GeometryId, GeometryId]) -> tuple[float, FloatArray]:
        """Signed distance of a pair at a pose (roll, pitch, yaw, x, y, z), and the nearest point of the first in W. [m]"""
        self.plant.SetPositions(self._plant_context, np.append(pose, 0.0))
        query = self._scene_graph.get_query_output_port().Eval(self._scene_graph.GetMyContextFromRoot(self._context))
        nearest = query.ComputeSignedDistancePairClosestPoints(*pair)
        witness = nearest.p_ACa if nearest.id_A == pair[0] else nearest.p_BCb  # Drake may swap the pair
        return nearest.distance, query.GetPoseInWorld(pair[0]) @ witness

    def smallest_gap(self, time: FloatArray, poses: FloatArray, rest_pose: FloatArray) -> Gap | None:
        """Smallest distance between tub group and housing over sampled poses; None if the SDF has no shapes to measure.

        A point of the tub at most `reach` from To moves from rest by at most |translation| + |rotation| reach, and no gap can
        shrink by more. So poses are tried in the order of that bound, and a pair is measured only where it could beat the
        smallest gap so far: the result is exact over the samples, at a small part of the cost.

        Args:
            time: (n,) [s]
            poses: (n, 6) roll, pitch, yaw, x, y, z. [rad, m]
            rest_pose: (6,)
        """
        if not self._pairs or not len(time):
            return None
        at_rest = [self.distance(rest_pose, pair)[0] for pair in self._pairs]
        moved = poses - rest_pose
        bound = np.linalg.norm(moved[:, 3:], axis=1) + np.abs(moved[:, :3]).sum(axis=1) * self._reach()
        best: Gap | None = None
        for index in np.argsort(-bound):
            smallest = np.inf if best is None else best.distance
            if min(at_rest) - bound[index] >= smallest:
                break
            for rest, pair in zip(at_rest, self._pairs, strict=True):
                smallest = np.inf if best is None else best.distance
                if rest - bound[index] < smallest:
                    distance, point = self.distance(poses[index], pair)
                    if distance < smallest:
                        names = self._name(pair[0]), self._name(pair[1])
                        x, y, z = map(float, point)
                        best = Gap(float(distance), float(time[index]), *names, (x, y, z))
        return best

    def _reach(self) -> float:
        """Bound of the distance from To of the points of the tub's shapes: far corner of each shape's box about its frame."""
        inspector = self._scene_graph.model_inspector()
        reach = 0.0
        for shape in {pair[0] for pair in self._pairs}:
            box = inspector.GetObbInGeometryFrame(shape)
            assert box is not None  # only unbounded shapes have none, and those cannot ride on a tub
            centre = inspector.GetPoseInFrame(shape).translation() + box.center()
            reach = max(reach, float(np.linalg.norm(centre) + np.linalg.norm(box.half_width())))
        return reach

    def animate(self, meshcat: Meshcat, time: FloatArray, positions: FloatArray) -> None:
        """Records the poses (n, 7) at their times, counted from the first, into a Meshcat animation."""
        meshcat.StartRecording(frames_per_second=REPLAY_RATE, set_visualizations_while_recording=False)
        for moment, position in zip(time, positions, strict=True):
            self._context.SetTime(float(moment - time[0]))
            self.plant.SetPositions(self._plant_context, position)
            self._diagram.ForcedPublish(self._context)
        meshcat.StopRecording()
        meshcat.PublishRecording()


def replay_page(parameters: MachineParameters, time: FloatArray, positions: FloatArray) -> str:
    """A self-contained HTML page that replays a motion in 3D.

    Args:
        parameters: The machine.
        time: (n,) [s]
        positions: (n, 7) positions of the plant: roll, pitch, yaw, x, y, z, drum angle. [rad, m]
    """
    meshcat = Meshcat()
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetCameraPose(camera_in_world=[0.7, -1.5, 0.6], target_in_world=[0.0, 0.0, 0.0])
    scene = Scene(parameters, meshcat)
    scene.animate(meshcat, time, positions)
    return str(meshcat.StaticHtml())
