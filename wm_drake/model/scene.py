"""The machine's shapes: distances between tub and housing, and a replay for the eye.

The simulated plant carries no shapes, so that nothing in a run depends on them; here the same SDF is posed after the run.
"""

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Cylinder, GeometryId, Meshcat, MeshcatParams, MeshcatVisualizer
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from wm_drake.model.bodies import add_bodies, sdf_path, set_bodies, unusable
from wm_drake.model.outline import support_history
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray

_FIRST_LOOK = 16
"""Every so many poses are looked at first for the smallest gap."""

_AT_ORIGIN = np.zeros((1, 6))
"""Pose of the housing."""

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


@dataclass(frozen=True)
class Outline:
    """What a shape fills at most: a cylinder, or a box; in the frame of the body it rides on.

    Attributes:
        centre: (3,) [m]
        axes: (3, 3) its axes as rows; a cylinder's own axis is the last.
        half: (3,) half widths along them; of a cylinder: its radius twice, half its length. [m]
        is_round: A cylinder.
    """

    centre: FloatArray
    axes: FloatArray
    half: FloatArray
    is_round: bool

    def begins(self, direction: FloatArray, poses: FloatArray) -> FloatArray:
        """How far along a direction in W (3,) it begins, in poses (n, 6) of its body: roll, pitch, yaw, x, y, z. (n,) [m]"""
        nearest = np.empty((len(poses), 1))
        support_history(
            poses, direction, self.centre, self.axes.ravel(), self.half, self.is_round, nearest
        )
        return nearest[:, 0]


class Scene:
    """The shapes of a machine, to be put into any pose."""

    def __init__(self, parameters: MachineParameters, meshcat: Meshcat | None = None) -> None:
        """Builds plant and geometry of a machine; with a Meshcat to show them in, if given.

        The drum is shown on its axis even if its bearing gives: by hundredths of a millimetre.
        """
        perfect = parameters.imperfections.model_copy(update={"bearing": None})
        parameters = parameters.model_copy(update={"imperfections": perfect})
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
        try:
            query = self._scene_graph.get_query_output_port().Eval(
                self._scene_graph.GetMyContextFromRoot(self._context)
            )
            for pair in self._pairs:
                query.ComputeSignedDistancePairClosestPoints(*pair)
        except (RuntimeError, SystemExit) as error:  # Drake turns failed assertions into exits
            raise unusable(sdf_path(parameters.model), error) from None
        self._outlines = {shape: self._outline(shape) for pair in self._pairs for shape in pair}
        self._kept_at_rest: dict[
            tuple[float, ...], list[tuple[float, FloatArray, tuple[GeometryId, GeometryId]]]
        ] = {}
        outlines = [self._outlines[shape] for shape, _ in self._pairs]
        self._reach = max(
            (float(np.linalg.norm(o.centre) + np.linalg.norm(o.half)) for o in outlines),
            default=0.0,
        )

    def _shapes(self, body: str) -> list[GeometryId]:
        welded = self.plant.GetBodiesWeldedTo(self.plant.GetBodyByName(body))
        return [
            shape for part in welded for shape in self.plant.GetCollisionGeometriesForBody(part)
        ]

    def _outline(self, shape: GeometryId) -> Outline:
        inspector = self._scene_graph.model_inspector()
        body = self.plant.GetBodyFromFrameId(inspector.GetFrameId(shape))
        grounded = self.plant.GetBodiesWeldedTo(self.plant.world_body())
        is_fixed = any(body.index() == other.index() for other in grounded)
        carrier = (
            self.plant.world_frame() if is_fixed else self.plant.GetBodyByName("tub").body_frame()
        )
        X_CB = self.plant.CalcRelativeTransform(self._plant_context, carrier, body.body_frame())
        X_CS = X_CB.multiply(inspector.GetPoseInFrame(shape))
        kind = inspector.GetShape(shape)
        if isinstance(kind, Cylinder):
            half = np.array([kind.radius(), kind.radius(), 0.5 * kind.length()])
            return Outline(X_CS.translation(), X_CS.rotation().matrix().T, half, is_round=True)
        box = inspector.GetObbInGeometryFrame(shape)
        assert box is not None  # only unbounded shapes have none, and those cannot ride on a tub
        X_CO = X_CS.multiply(box.pose())
        return Outline(
            X_CO.translation(),
            X_CO.rotation().matrix().T,
            np.array(box.half_width()),
            is_round=False,
        )

    def _name(self, shape: GeometryId) -> str:
        return str(self._scene_graph.model_inspector().GetName(shape)).split("::")[-1]

    def distance(
        self, pose: FloatArray, pair: tuple[GeometryId, GeometryId]
    ) -> tuple[float, FloatArray]:
        """Signed distance of a pair at a pose (roll, pitch, yaw, x, y, z), and the nearest point of the first in W. [m]"""
        return self._nearest(pose, pair)[:2]

    def _nearest(
        self, pose: FloatArray, pair: tuple[GeometryId, GeometryId]
    ) -> tuple[float, FloatArray, FloatArray]:
        """`distance`, and the unit vector in W along which the first is to move away from the second."""
        # Drake stops when near enough, a micrometre or so: poses that differ in rounding only should get the same answer
        self._put(np.append(np.round(pose, 9), 0.0))
        query = self._scene_graph.get_query_output_port().Eval(
            self._scene_graph.GetMyContextFromRoot(self._context)
        )
        nearest = query.ComputeSignedDistancePairClosestPoints(*pair)
        first = nearest.id_A == pair[0]  # Drake may swap the pair
        witness, away = (
            (nearest.p_ACa, nearest.nhat_BA_W) if first else (nearest.p_BCb, -nearest.nhat_BA_W)
        )
        return nearest.distance, query.GetPoseInWorld(pair[0]) @ witness, away

    def _put(self, positions: FloatArray) -> None:
        """Into a pose; tubes of which no position is given stay as they are drawn."""
        drawn = np.zeros(self.plant.num_positions() - len(positions))
        self.plant.SetPositions(self._plant_context, np.concatenate([positions, drawn]))

    def smallest_gap(
        self, time: FloatArray, poses: FloatArray, rest_pose: FloatArray
    ) -> Gap | None:
        """Smallest distance between tub group and housing over sampled poses; None if the SDF has no shapes to measure.

        Along any direction, what two convex shapes leave free between their support functions is a lower bound of their
        distance, and the largest over all directions is the distance itself. So for each pair the bound is known at all poses
        from the direction at rest; the pose where it is lowest is measured, its direction tightens the bound everywhere, and
        so on until no pose can beat the smallest gap found: exact over the samples after a few dozen measurements.

        Args:
            time: (n,) [s]
            poses: (n, 6) roll, pitch, yaw, x, y, z. [rad, m]
            rest_pose: (6,)
        """
        if not self._pairs or not len(time):
            return None
        away = np.ascontiguousarray((poses - rest_pose).T)
        roll, pitch, yaw, x, y, z = away
        turned = (np.abs(roll) + np.abs(pitch) + np.abs(yaw)) * self._reach
        shift = np.sqrt(x * x + y * y + z * z) + turned
        at_rest = self._at_rest(tuple(map(float, rest_pose)))
        farthest = int(np.argmax(shift))
        best = self._measured(at_rest[0][2], time[farthest], poses[farthest])[0]
        for stride in (
            _FIRST_LOOK,
            1,
        ):  # a first look at some poses, so that most of the others need none
            for distance, direction, pair in at_rest:
                if (
                    distance - shift[farthest] >= best.distance
                ):  # nor can any pair that is farther apart at rest
                    break
                least = (
                    distance + direction @ away[3:, ::stride] - turned[::stride]
                )  # a gap shrinks by no more
                near = stride * np.flatnonzero(least < best.distance)
                best = self._smallest_of_pair(pair, direction, best, time[near], poses[near])
        return best

    def _measured(
        self, pair: tuple[GeometryId, GeometryId], time: float, pose: FloatArray
    ) -> tuple[Gap, FloatArray]:
        """The gap of a pair at a pose, and its direction."""
        distance, point, direction = self._nearest(pose, pair)
        x, y, z = map(float, point)
        return Gap(
            float(distance), float(time), self._name(pair[0]), self._name(pair[1]), (x, y, z)
        ), direction

    def _at_rest(
        self, rest_pose: tuple[float, ...]
    ) -> list[tuple[float, FloatArray, tuple[GeometryId, GeometryId]]]:
        """Distance, direction and pair, nearest first; kept, since runs of a machine begin at the same pose."""
        if rest_pose not in self._kept_at_rest:
            found = [(*self._nearest(np.array(rest_pose), pair), pair) for pair in self._pairs]
            nearest_first = sorted(found, key=lambda entry: entry[0])
            self._kept_at_rest = {
                rest_pose: [(distance, away, pair) for distance, _, away, pair in nearest_first]
            }
        return self._kept_at_rest[rest_pose]

    def _smallest_of_pair(
        self,
        pair: tuple[GeometryId, GeometryId],
        direction: FloatArray,
        best: Gap,
        time: FloatArray,
        poses: FloatArray,
    ) -> Gap:
        """The smallest gap after this pair was looked at; `direction` is a first guess of where it is narrowest."""
        if not len(time):
            return best
        moving, fixed = (self._outlines[shape] for shape in pair)
        bound = np.full(len(time), -np.inf)
        while True:
            free = moving.begins(direction, poses) + fixed.begins(
                -direction, _AT_ORIGIN
            )  # < 0 if they overlap there
            bound = np.maximum(bound, free)
            index = int(np.argmin(bound))
            if not bound[index] < best.distance:
                return best
            gap, direction = self._measured(pair, time[index], poses[index])
            best = min(best, gap, key=lambda found: found.distance)
            bound[index] = np.inf  # measured

    def animate(self, meshcat: Meshcat, time: FloatArray, positions: FloatArray) -> None:
        """Records the poses (n, 7) at their times, counted from the first, into a Meshcat animation."""
        meshcat.StartRecording(
            frames_per_second=REPLAY_RATE, set_visualizations_while_recording=False
        )
        for moment, position in zip(time, positions, strict=True):
            self._context.SetTime(float(moment - time[0]))
            self._put(position)
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
    meshcat = Meshcat(MeshcatParams(host="localhost"))  # reachable from this computer only
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetCameraPose(camera_in_world=[0.7, -1.5, 0.6], target_in_world=[0.0, 0.0, 0.0])
    scene = Scene(parameters, meshcat)
    scene.animate(meshcat, time, positions)
    return str(meshcat.StaticHtml())
