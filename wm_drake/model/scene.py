"""Shapes of a machine: distances between tub and housing, and poses over a motion.

The simulated plant has no shapes, so that no result of a run depends on them. Here the same SDF is
read again with its shapes and set to the poses of a finished run.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Box, Cylinder, GeometryId, Meshcat, MeshcatVisualizer
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from wm_drake.compiler.lane_memory import aligned, fill_lanes
from wm_drake.compiler.lanes import WIDTH
from wm_drake.model.bodies import add_bodies, drawn_frame, sdf_path, set_bodies, unusable
from wm_drake.model.outline import (
    BLOCK,
    find_lowest_bounds,
    lowest_points,
    measure_shifts,
    nearest_points,
    raise_bounds,
)
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray

_REFERENCE_GRID = 0.001
"""Grid of the reference poses that bounds of distances start from. [rad, m]"""

_REFERENCES_KEPT = 64
"""Number of reference poses whose distances are cached."""

APART = 1e-6
"""Distance above which shapes do not touch, whatever the rounding of a solver. [m]"""

_LEAST = float(np.nextafter(0.0, 1.0))
"""Smallest distance of shapes that do not touch. [m]"""

REPLAY_RATE = 32.0
"""Frames of a replay per simulated second. [Hz]"""


def with_fixed_cabinet(parameters: MachineParameters) -> MachineParameters:
    """Return the machine on a fixed cabinet, for shapes and pictures seen from the cabinet."""
    if not parameters.cabinet_moves:
        return parameters
    assert parameters.cabinet is not None
    fixed = parameters.cabinet.model_copy(update={"moves": False})
    return parameters.model_copy(update={"cabinet": fixed})


@dataclass(frozen=True)
class Gap:
    """Distance between a part that moves with the tub and a part of the housing.

    Attributes:
        distance: Signed distance, < 0 if the parts overlap. [m]
        time: Time of the pose. [s]
        moving, fixed: Names of the two shapes in the SDF.
        point: Point of the moving shape nearest the fixed one, in W. [m]
    """

    distance: float
    time: float
    moving: str
    fixed: str
    point: tuple[float, float, float]

    @property
    def parts(self) -> str:
        """Return the two parts in words."""
        return f"{self.moving} and {self.fixed}".replace("_", " ")


@dataclass(frozen=True)
class Outline:
    """Cylinder or box that contains a shape, in the frame of the body that the shape is fixed to.

    Attributes:
        centre: (3,) [m]
        axes: (3, 3) The axes as rows; the last one is the axis of a cylinder.
        half: (3,) Half widths along the axes; for a cylinder radius, radius, half length. [m]
        is_round: Whether it is a cylinder.
        is_exact: Whether it is the shape itself.
    """

    centre: FloatArray
    axes: FloatArray
    half: FloatArray
    is_round: bool
    is_exact: bool = True

    @functools.cached_property
    def numbers(self) -> FloatArray:
        """Return the numbers that `wm_drake.model.outline.lowest_point` reads. (15,) [m]"""
        return np.concatenate([self.centre, self.axes.ravel(), self.half])

    def lower_extent(self, direction: FloatArray, poses: FloatArray) -> FloatArray:
        """Return the smallest coordinate of any of its points along a direction.

        Args:
            direction: Unit vector in W. (3,)
            poses: Poses of its body: roll, pitch, yaw, x, y, z. (n, 6) [rad, m]

        Returns:
            (n,) [m]
        """
        nearest = np.empty((len(poses), 1))
        lowest_points(poses, direction, self.numbers, self.is_round, nearest)
        return nearest[:, 0]


def _reference(rest_pose: FloatArray) -> tuple[float, ...]:
    """Return a pose near a rest pose that machines with similar rest poses share. [rad, m]"""
    return tuple(map(float, _REFERENCE_GRID * np.round(rest_pose / _REFERENCE_GRID)))


@dataclass(frozen=True)
class _Pair:
    """A pair of shapes, of the tub group and of the housing, at a reference pose.

    Attributes:
        shapes: The shapes.
        distance: Signed distance. [m]
        bound: Unit vector in W along which the first shape moves away from the second, and the
            smallest coordinate of the second shape in the opposite direction [m]. (4,)
    """

    shapes: tuple[GeometryId, GeometryId]
    distance: float
    bound: FloatArray


@dataclass(frozen=True)
class Path:
    """Poses of the tub over time, with bounds that lead to the smallest distances.

    Attributes:
        poses: Roll, pitch, yaw, x, y, z. (n, 6) [rad, m]
        farthest: Gap of the nearest pair at rest, at the pose farthest from rest.
        pairs: The pairs of shapes that may touch or come nearer than that.
        lowest: Lowest bound of the distance of each pair in each block of poses. (blocks, pairs)
            [m]
    """

    poses: FloatArray
    farthest: Gap
    pairs: Sequence[_Pair]
    lowest: FloatArray

    def near(self, number: int, limit: float) -> NDArray[np.int64]:
        """Return the poses in blocks in which the bound of a pair is below a limit."""
        return self.poses_of(np.flatnonzero(self.lowest[:, number] < limit))

    def poses_of(self, blocks: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the numbers of the poses in blocks."""
        every = (BLOCK * blocks[:, None] + np.arange(BLOCK)).ravel()
        return every[every < len(self.poses)]


class Scene:
    """Shapes of a machine, which can be set to any pose.

    Attributes:
        plant: Plant with the shapes; its bearing is rigid.
        reach: Largest distance of a point of the tub group from To. [m]

    Example:
        >>> import wm_drake as wm
        >>> machine = wm.build_machine(wm.load_machine("reference"))
        >>> scene = wm.Scene(machine.parameters)
        >>> gap = wm.measure(wm.simulate(machine, "middle"), scene).smallest_gap
        >>> gap.moving, gap.fixed
        ('tub_shell', 'detergent_box')
    """

    def __init__(self, parameters: MachineParameters, meshcat: Meshcat | None = None) -> None:
        """Build plant and geometry of a machine.

        A compliant bearing is replaced by a rigid one: the drum moves in it by hundredths of a
        millimetre only. A cabinet that moves is fixed: poses are those seen from it.

        Args:
            meshcat: Shows the shapes if given.
        """
        perfect = parameters.imperfections.model_copy(update={"bearing": None})
        parameters = parameters.model_copy(update={"imperfections": perfect})
        parameters = with_fixed_cabinet(parameters)
        builder = DiagramBuilder()
        self.plant, self._scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
        add_bodies(self.plant, parameters)
        if meshcat is not None:
            MeshcatVisualizer.AddToBuilder(builder, self._scene_graph, meshcat)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = self.plant.GetMyContextFromRoot(self._context)
        set_bodies(self.plant, self._plant_context, parameters)
        self._query_port = self._scene_graph.get_query_output_port()
        self._query_context = self._scene_graph.GetMyContextFromRoot(self._context)
        self._positions = np.zeros(self.plant.num_positions())
        self._pairs = [(a, b) for a in self._shapes("tub") for b in self._shapes("housing")]
        try:
            query = self._query_port.Eval(self._query_context)
            for pair in self._pairs:
                query.ComputeSignedDistancePairClosestPoints(*pair)
        except (RuntimeError, SystemExit) as error:  # Drake turns failed assertions into exits
            raise unusable(sdf_path(parameters.model), error) from None
        self._outlines = {shape: self._outline(shape) for pair in self._pairs for shape in pair}
        self._name_of = {shape: self._name(shape) for shape in self._outlines}
        self._references: dict[tuple[float, ...], list[_Pair]] = {}
        self._names = tuple(f"{self._name(a)}|{self._name(b)}" for a, b in self._pairs)
        outlines = [self._outlines[shape] for shape, _ in self._pairs]
        self.reach = max(
            (float(np.linalg.norm(o.centre) + np.linalg.norm(o.half)) for o in outlines),
            default=0.0,
        )

    def _shapes(self, body: str) -> list[GeometryId]:
        """Return the collision shapes of a body and of all bodies that are welded to it."""
        welded = self.plant.GetBodiesWeldedTo(self.plant.GetBodyByName(body))
        return [
            shape for part in welded for shape in self.plant.GetCollisionGeometriesForBody(part)
        ]

    def outlines(self, body: str) -> dict[str, Outline]:
        """Return the outlines of the collision shapes of one body, by name: in W or T as drawn."""
        shapes = self.plant.GetCollisionGeometriesForBody(self.plant.GetBodyByName(body))
        return {self._name(shape): self._outline(shape) for shape in shapes}

    def _outline(self, shape: GeometryId) -> Outline:
        """Return the outline of a shape, in W if it is fixed to the housing, else in T."""
        inspector = self._scene_graph.model_inspector()
        body = self.plant.GetBodyFromFrameId(inspector.GetFrameId(shape))
        grounded = self.plant.GetBodiesWeldedTo(self.plant.world_body())
        is_fixed = any(body.index() == other.index() for other in grounded)
        carrier = (
            self.plant.world_frame()
            if is_fixed
            else drawn_frame(self.plant, self.plant.GetBodyByName("tub"))
        )
        X_CB = self.plant.CalcRelativeTransform(self._plant_context, carrier, body.body_frame())
        X_CS = X_CB.multiply(inspector.GetPoseInFrame(shape))
        kind = inspector.GetShape(shape)
        if isinstance(kind, Cylinder):
            half = np.array([kind.radius(), kind.radius(), 0.5 * kind.length()])
            return Outline(X_CS.translation(), X_CS.rotation().matrix().T, half, is_round=True)
        box = inspector.GetObbInGeometryFrame(shape)
        assert box is not None  # only an unbounded shape, such as a plane, has no box
        X_CO = X_CS.multiply(box.pose())
        return Outline(
            X_CO.translation(),
            X_CO.rotation().matrix().T,
            np.array(box.half_width()),
            is_round=False,
            is_exact=isinstance(kind, Box),
        )

    def tub_outlines(self) -> dict[str, Outline]:
        """Return the outlines in T of the shapes that move with the tub, by name."""
        return {self._name(shape): self._outline(shape) for shape in self._shapes("tub")}

    def _name(self, shape: GeometryId) -> str:
        """Return the name of a shape in the SDF."""
        return str(self._scene_graph.model_inspector().GetName(shape)).split("::")[-1]

    def distance(
        self, pose: FloatArray, pair: tuple[GeometryId, GeometryId]
    ) -> tuple[float, FloatArray]:
        """Return the distance of a pair of shapes at a pose.

        Args:
            pose: Pose of the tub: roll, pitch, yaw, x, y, z. (6,) [rad, m]
            pair: A shape of the tub group and a shape of the housing.

        Returns:
            Signed distance, and the point of the first shape nearest the second, in W. [m]
        """
        return self._nearest(pose, pair)[:2]

    def _nearest(
        self, pose: FloatArray, pair: tuple[GeometryId, GeometryId]
    ) -> tuple[float, FloatArray, FloatArray]:
        """Return what `distance` returns, and the direction (3,) that separates the pair.

        It is the unit vector in W along which the first shape moves away from the second. Cylinders
        and boxes that are apart have the distance of `wm_drake.model.outline.distance_of`; Drake's
        solver, which others need, is accurate to about 1e-6 m.
        """
        pose = np.round(pose, 9)  # poses that differ by rounding errors only have the same result
        outlines = [self._outlines[shape] for shape in pair]
        if all(outline.is_exact for outline in outlines):
            rounds, answer = tuple(outline.is_round for outline in outlines), np.empty(10)
            shapes = (outline.numbers for outline in outlines)
            nearest_points(pose, *shapes, rounds, answer)
            if answer[0] > APART:
                return float(answer[0]), answer[4:7], answer[1:4]
        self._set_positions(pose)
        query = self._query_port.Eval(self._query_context)
        nearest = query.ComputeSignedDistancePairClosestPoints(*pair)
        first = nearest.id_A == pair[0]  # Drake may swap the pair
        witness, away = (
            (nearest.p_ACa, nearest.nhat_BA_W) if first else (nearest.p_BCb, -nearest.nhat_BA_W)
        )
        return nearest.distance, query.GetPoseInWorld(pair[0]) @ witness, away

    def nearest_points(self, pose: FloatArray, moving: str, fixed: str) -> tuple[float, FloatArray]:
        """Return the distance of two shapes, and their points that are nearest to each other.

        Args:
            pose: Pose of the tub: roll, pitch, yaw, x, y, z. (6,) [rad, m]
            moving, fixed: Names of a shape of the tub group and of a shape of the housing.

        Returns:
            Signed distance [m]; (2, 3) the point of the first shape in W, then that of the second.
            [m]
        """
        pair = self._pairs[self.pair_names().index(f"{moving}|{fixed}")]
        distance, point, away = self._nearest(pose, pair)
        return distance, np.stack([point, point - distance * away])

    def _set_positions(self, positions: FloatArray) -> None:
        """Set the first positions of the plant; the others, of damper tubes, are 0 as drawn."""
        self._positions[: len(positions)] = positions
        self._positions[len(positions) :] = 0.0
        self.plant.SetPositions(self._plant_context, self._positions)

    def smallest_gap(
        self, time: FloatArray, poses: FloatArray, rest_pose: FloatArray, path: Path | None = None
    ) -> Gap | None:
        """Return the smallest distance between tub group and housing over sampled poses.

        The gap between the support functions of two convex shapes along any direction is a lower
        bound of their distance. The largest bound over all directions is the distance itself. For
        each pair of shapes, the direction near rest gives a bound at all poses. The distance
        is computed at the pose with the lowest bound, and its direction raises the bounds of all
        poses. This repeats until no bound is below the smallest distance found. The result is
        exact over the samples, after a few distances.

        Args:
            time: (n,) [s]
            poses: Poses of the tub: roll, pitch, yaw, x, y, z. (n, 6) [rad, m]
            rest_pose: Pose of the tub at rest. (6,) [rad, m]

        Returns:
            The smallest gap; None if there is no sample or the SDF has no shapes to measure.
        """
        path = path or self._path(time, poses, rest_pose)
        if path is None:
            return None
        if not path.pairs:
            return path.farthest
        block, number = divmod(int(np.argmin(path.lowest)), len(path.pairs))
        lowest = path.poses_of(np.array([block]))  # gives a small gap, which excludes most blocks
        best = self._smallest_of_pair(path, number, path.farthest, time, lowest)
        for number, bound in enumerate(path.lowest.min(axis=0)):
            if bound < best.distance:
                near = path.near(number, best.distance)
                best = self._smallest_of_pair(path, number, best, time, near)
        return best

    def _path(self, time: FloatArray, poses: FloatArray, rest_pose: FloatArray) -> Path | None:
        samples = fill_lanes(aligned(poses.size * WIDTH), [poses.ravel()])
        return self.paths(time, samples.reshape(*poses.shape, WIDTH), [len(time)], [rest_pose])[0]

    def paths(
        self,
        time: FloatArray,
        samples: FloatArray,
        good: Sequence[int],
        rest_poses: Sequence[FloatArray],
    ) -> list[Path | None]:
        """Return the poses of runs side by side, with bounds that lead to the smallest distances.

        Args:
            time: (n,) [s]
            samples: Samples, each with the pose first. (n, >= 6, lanes) [rad, m]
            good: Number of samples of each run that count.
            rest_poses: Pose of the tub at rest of each run. (6,) [rad, m]

        Returns:
            Path of each run; None if there is no sample or the SDF has no shapes to measure.
        """
        if not self._pairs or not max(good):
            return [None] * len(good)
        rows, size, _ = samples.shape
        counts = fill_lanes(aligned(WIDTH), [np.array([float(count)]) for count in good])
        flat = samples.ravel(), size, counts
        references = [_reference(pose) for pose in rest_poses]
        places = [np.array([*pose, self.reach]) for pose in references]
        farthest = aligned(2 * WIDTH)
        measure_shifts(*flat, fill_lanes(aligned(7 * WIDTH), places), farthest)
        numbers, shift = farthest[:WIDTH].astype(int).tolist(), farthest[WIDTH:]
        at_rest = [self._at(reference) for reference in references]
        firsts, chosen = list[Gap | None](), set[int]()
        for lane, pairs in enumerate(at_rest):
            if not good[lane]:
                firsts.append(None)
                continue
            nearest, at = min(pairs, key=lambda pair: pair.distance), numbers[lane]
            first = self._gap(nearest.shapes, time[at], samples[at, :6, lane])[0]
            limit = max(first.distance, _LEAST) + shift[lane]
            chosen |= {number for number, pair in enumerate(pairs) if pair.distance < limit}
            firsts.append(first)
        of_runs = [[pairs[number] for number in sorted(chosen)] for pairs in at_rest]
        moving = [self._outlines[pair.shapes[0]] for pair in of_runs[0]]
        bounds: list[FloatArray] = [
            np.array([pair.bound for pair in pairs]).ravel() for pairs in of_runs
        ]
        lowest = aligned(-(-rows // BLOCK) * len(moving) * WIDTH)
        find_lowest_bounds(
            *flat,
            fill_lanes(aligned(len(bounds[0]) * WIDTH), bounds),
            np.array([outline.numbers for outline in moving]).reshape(len(moving), 15),
            np.array([outline.is_round for outline in moving], dtype=bool),
            lowest,
        )
        lowest = lowest.reshape(-(-rows // BLOCK), len(moving), WIDTH)
        return [
            Path(samples[:count, :6, lane], first, of_runs[lane], lowest[..., lane])
            if first
            else None
            for lane, (count, first) in enumerate(zip(good, firsts, strict=True))
        ]

    def separations(self, pose: FloatArray) -> list[tuple[Outline, Outline, FloatArray, float]]:
        """Return outlines of each pair of shapes, what separates them, and their distance.

        Args:
            pose: Pose of the tub: roll, pitch, yaw, x, y, z. (6,) [rad, m]

        Returns:
            Outline of the shape of the tub group, in T, and of that of the housing, in W; unit
            vector in W along which the first moves away from the second (3,); signed distance [m].
        """
        separations = []
        for pair in self._pairs:
            distance, _, away = self._nearest(pose, pair)
            separations.append((self._outlines[pair[0]], self._outlines[pair[1]], away, distance))
        return separations

    def pair_names(self) -> list[str]:
        """Return the names of the pairs of shapes: one of the tub group, one of the housing."""
        return list(self._names)

    def contacts(
        self, time: FloatArray, poses: FloatArray, rest_pose: FloatArray, path: Path | None = None
    ) -> FloatArray:
        """Return the smallest distance of each pair that touches over sampled poses.

        Args:
            time, poses, rest_pose, path: As for `smallest_gap`.

        Returns:
            By pair, in the order of `pair_names`; NaN for a pair that does not touch. [m]
        """
        distances = np.full(len(self._pairs), np.nan)
        path = path or self._path(time, poses, rest_pose)
        if path is None:
            return distances
        apart = Gap(_LEAST, 0.0, "", "", (0.0, 0.0, 0.0))
        for number, pair in enumerate(path.pairs):
            nearest = self._smallest_of_pair(path, number, apart, time, path.near(number, _LEAST))
            if nearest.distance <= 0.0:
                distances[self._pairs.index(pair.shapes)] = nearest.distance
        return distances

    def _gap(
        self, pair: tuple[GeometryId, GeometryId], time: float, pose: FloatArray
    ) -> tuple[Gap, FloatArray]:
        """Return the gap of a pair at a pose, and the direction that separates the pair (3,)."""
        distance, point, direction = self._nearest(pose, pair)
        x, y, z = map(float, point)
        return Gap(
            float(distance), float(time), self._name_of[pair[0]], self._name_of[pair[1]], (x, y, z)
        ), direction

    def _at(self, reference: tuple[float, ...]) -> list[_Pair]:
        """Return the pairs of shapes at a pose."""
        if reference not in self._references:
            pairs = []
            for shapes in self._pairs:
                distance, _, away = self._nearest(np.array(reference), shapes)
                opposite = self._outlines[shapes[1]].lower_extent(-away, np.zeros((1, 6)))
                pairs.append(_Pair(shapes, distance, np.append(away, opposite)))
            if len(self._references) == _REFERENCES_KEPT:
                del self._references[next(iter(self._references))]
            self._references[reference] = pairs
        return self._references[reference]

    def _smallest_of_pair(
        self, path: Path, number: int, best: Gap, time: FloatArray, near: NDArray[np.int64]
    ) -> Gap:
        """Return the smaller of a known gap and the smallest gap of one pair of shapes."""
        pair = path.pairs[number]
        if not len(near):
            return best
        poses, direction = path.poses[near], pair.bound[:3]
        moving, fixed = (self._outlines[shape] for shape in pair.shapes)
        numbers = moving.numbers, fixed.numbers, (moving.is_round, fixed.is_round)
        bound = np.full(len(near), -np.inf)
        while True:
            index = raise_bounds(poses, direction, *numbers, bound)
            if not bound[index] < best.distance:
                return best
            gap, direction = self._gap(pair.shapes, time[near[index]], poses[index])
            best = min(best, gap, key=lambda candidate: candidate.distance)
            bound[index] = np.inf  # this distance is known

    def pose_in_world(self, body: str) -> RigidTransform:
        """Return the pose in W of T or another body at the pose that was set last."""
        frame = drawn_frame(self.plant, self.plant.GetBodyByName(body))
        return frame.CalcPoseInWorld(self._plant_context)

    def animate(
        self,
        meshcat: Meshcat,
        time: FloatArray,
        positions: FloatArray,
        also: Callable[[float], None] = lambda moment: None,
    ) -> None:
        """Record a motion into a Meshcat animation that begins at time 0.

        Args:
            time: (n,) [s]
            positions: Positions of the plant: roll, pitch, yaw, x, y, z, drum angle. (n, 7)
                [rad, m]
            also: Called with the time of each frame in the animation, with the poses set, to record
                other shapes. [s]
        """
        meshcat.StartRecording(
            frames_per_second=REPLAY_RATE, set_visualizations_while_recording=False
        )
        for moment, position in zip(time, positions, strict=True):
            self._context.SetTime(float(moment - time[0]))
            self._set_positions(position)
            self._diagram.ForcedPublish(self._context)
            also(float(moment - time[0]))
        meshcat.StopRecording()
        meshcat.PublishRecording()
