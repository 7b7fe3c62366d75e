"""Machines of the net by their steady motion: scores, and all that a calibration computes.

The gasket is linear here, with the nominal stiffness of its curves. A machine costs milliseconds.
"""

from collections.abc import Sequence

import numpy as np

from analysis_tools.net_assembly import Assembled, Assembly
from analysis_tools.net_measures import ARMS, CORNERS
from analysis_tools.net_score import MIDDLE_TRIALS, Scored, Shape, ShapeMeasures
from analysis_tools.steady_model import SPEEDS, friction_of
from analysis_tools.steady_motion import Cases, steady_motions
from analysis_tools.study_targets import StudyRuns, StudyTarget
from wm_drake.elements.damper_law import packed_damper_law
from wm_drake.model.machine import Machine
from wm_drake.parameters.types import ComplexArray, FloatArray
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.studies.calibrate.computed import Computed
from wm_drake.studies.calibrate.parameter_map import ParameterMap

LEVELS = (-1, 0, 1)
RESPONSES = [f"{kind}{axis}" for kind in "DFM" for axis in "xyz"]
STUDY_LOADS = ("middle", "counter")
CASES = [("middle", False), ("counter", False), ("back", True), ("front", True)]
CASES += [("middle", True)] * len(MIDDLE_TRIALS) + [("counter", True)]
"""Cases of a first score: amplitudes, then the trials of the gasket."""

LARGEST_SAG, LARGEST_ANGLE = 0.02, np.deg2rad(3.0)
"""Farthest rest pose from the drawn one, as in the equilibrium of a built machine. [m, rad]"""

FIT_PART = 0.9
"""Part of the farthest rest pose up to which a fit may go: the linear rest pose is not exact."""

ROTATION_LAST = [3, 4, 5, 0, 1, 2]
"""Order of the coordinates in `net_measures`."""


class SteadyNet:
    """Machines by their steady motion.

    Attributes:
        parameter_map: Map from points to machines.
        shape: Scores machines.
        targets: Targets, as of a calibration.
        assembly: Assembles machines.
    """

    def __init__(self, machine: Machine, parameter_map: ParameterMap, shape: Shape) -> None:
        """Begin with a built machine and its free quantities."""
        self.parameter_map, self.shape, self.targets = parameter_map, shape, shape.targets
        self.assembly = Assembly(machine, parameter_map)
        self._runs = StudyRuns(machine)
        self._factors = gasket_entries()
        (self._damper,) = parameter_map.base.damper_types.values()
        levels = np.zeros((len(CASES), len(self._factors)), dtype=int)
        for row, trial in enumerate(MIDDLE_TRIALS, start=4):
            for name, level in trial:
                levels[row, list(self._factors).index(name)] = level
        self._scales = self._scales_of(levels)
        study = np.tile(self._runs.levels, (len(STUDY_LOADS), 1))
        self._study_scales = self._scales_of(study)

    def _scales_of(self, levels: np.ndarray) -> tuple[FloatArray, FloatArray]:
        """Return the factors of stiffness and damping of the gasket of trials. (trial, 6)

        Args:
            levels: Of the factors of [B] section 4. (trial, factor)
        """
        scales = []
        for kind in ("stiffness", "damping"):
            scale = np.ones((len(levels), 6))
            keys = [f"gasket.{turn}{kind}_{axis}" for turn in ("", "rotational_") for axis in "xyz"]
            for column, factor in zip(levels.T, self._factors.values(), strict=True):
                low, high = (float(text.rstrip("% ")) / 100.0 for text in (factor.low, factor.high))
                by_level = np.interp(column, LEVELS, (low, 0.5 * (low + high), high))
                scale[:, [key in factor.keys for key in keys]] *= by_level[:, None]
            scales.append(scale)
        return scales[0], scales[1]

    def motions(
        self,
        of: Assembled,
        machine: int,
        cases: Sequence[tuple[str, bool]],
        scales: tuple[FloatArray, FloatArray],
    ) -> tuple[ComplexArray, FloatArray]:
        """Return motions (case, speed, 6), and largest loads of the gasket (case, 6) [N, N m]."""
        names = list(dict.fromkeys(name for name, _ in cases))
        engaged = np.array([gasket for _, gasket in cases], dtype=float)[:, None]
        stiffness = engaged * scales[0] * of.gasket_stiffness[machine]
        damping = engaged * scales[1] * of.gasket_damping[machine]
        g = of.gasket[machine]
        masses, forces = (np.array([of.loads[n][k][machine] for n in names]) for k in (0, 1))
        k, c = ((g.T * by_axis[:, None, :]) @ g for by_axis in (stiffness, damping))
        load = np.array([names.index(name) for name, _ in cases], dtype=np.int64)
        motions = np.empty((len(cases), len(SPEEDS), 6), dtype=complex)
        friction = self._friction(of.numbers, machine)
        steady_motions(
            of.tub(machine, masses), friction, Cases(load, k, c, forces, SPEEDS), motions
        )
        at_rest = np.linalg.solve(of.stiffness[machine] + k, of.rest[machine][:, None])[..., 0]
        constant = np.abs(stiffness * (at_rest @ g.T))
        complex_rate = stiffness[:, None, :] + 1j * SPEEDS[:, None] * damping[:, None, :]
        varying = np.abs(complex_rate * (motions @ g.T)).max(axis=1)
        return motions, constant + varying

    def _friction(self, numbers: dict[str, FloatArray], machine: int):  # type: ignore[no-untyped-def]
        damper, key = self._damper, "damper_types.friction"
        own = {
            name: float(numbers[f"{key}.{name}"][machine, 0])
            for name in type(damper).model_fields
            if f"{key}.{name}" in numbers and numbers[f"{key}.{name}"].shape[1] == 1
        }
        law = packed_damper_law(damper.model_copy(update=own))
        end = [numbers[f"{key}.end_bushing.{name}"][machine, 0] for name in END]
        return friction_of(law, *end)

    def is_possible(self, of: Assembled, part: float = 1.0) -> np.ndarray:
        """Return whether all springs are taut at rest, near the drawn pose. (machine,)

        Args:
            of: Assembled machines.
            part: Part of the farthest rest pose that is allowed.
        """
        pose = np.linalg.solve(of.stiffness, of.rest[..., None])[..., 0]
        near = np.abs(pose[:, 3:]).max(axis=1) < part * LARGEST_SAG
        level = np.abs(pose[:, :3]).max(axis=1) < part * LARGEST_ANGLE
        return near & level & (of.preload > 0.0).all(axis=1)

    def measures(self, of: Assembled, machine: int) -> ShapeMeasures:
        """Return the measures of one machine, as those of twelve runs."""
        motions, loads = self.motions(of, machine, CASES, self._scales)
        motions = motions[..., ROTATION_LAST]
        rows = [CASES.index(case) for case in self.targets.loads]
        places = np.hstack([np.abs(motions[rows] @ a).max(axis=1) for a in ARMS.values()])
        corners = 1e3 * largest_at(motions[4:], CORNERS)
        return ShapeMeasures(places[None], corners[None], loads[None, 4:], of.preload[[machine]])

    def responses(self, of: Assembled, machine: int, corner: FloatArray) -> FloatArray:
        """Return the responses of the targets, all of the gasket study. (response,)

        Args:
            corner: Point of the tub nearest the detergent box, in T. [m]
        """
        trials = len(self._runs.levels)
        cases = [(load, True) for load in STUDY_LOADS for _ in range(trials)]
        motions, loads = self.motions(of, machine, cases, self._study_scales)
        at_corner = largest_at(motions[..., ROTATION_LAST], corner[None])[:, 0]
        columns = np.hstack([1e3 * at_corner, loads])
        values = []
        for target in self.targets.responses:
            assert isinstance(target, StudyTarget)
            begin = trials * STUDY_LOADS.index(target.load)
            runs = columns[begin : begin + trials, RESPONSES.index(target.response.name)]
            values.append(float(self._runs.statistic(target, runs[None])[0]))
        return np.array(values)

    def scored(self, points: FloatArray) -> Scored:
        """Return machines (machine, quantity) with the first part of their scores."""
        points, of = points.copy(), self.assembly(points)
        possible = np.flatnonzero(self.is_possible(of))
        measures = [self.measures(of, machine) for machine in possible]
        all_of = ShapeMeasures(*map(np.concatenate, zip(*measures, strict=True)))
        scored = self.shape.scored(points[possible], all_of)
        columns = []
        for values in scored[1:]:
            column = np.full((len(points), *values.shape[1:]), np.nan)
            column[possible] = values
            columns.append(column)
        points[possible] = scored.points
        return Scored(points, *columns)

    def with_study(self, scored: Scored, chosen: np.ndarray) -> Scored:
        """Return scored machines with the second part of those with the given numbers."""
        second, effects = scored.second.copy(), scored.effects.copy()
        of = self.assembly(scored.points[chosen])
        corners = of.numbers["frames.detergent_point.position"]
        for row, number in enumerate(chosen):
            values = self.responses(of, row, corners[row])
            second[number], effects[number] = self.shape.score_of_study(values)
        return scored._replace(second=second, effects=effects)

    def __call__(self, points: FloatArray) -> Computed:
        """Return what a calibration computes at points (point, quantity)."""
        of = self.assembly(points)
        possible = self.is_possible(of, FIT_PART)
        rows = [self._computed(of, row, bool(possible[row])) for row in range(len(points))]
        return Computed(*map(np.stack, zip(*rows, strict=True)))

    def _computed(self, of: Assembled, row: int, is_possible: bool) -> Computed:
        targets, springs = self.targets, np.full(of.preload.shape[1], np.nan)
        if not is_possible:
            nan = np.full(targets.amplitude.shape, np.nan)
            return Computed(nan, nan, np.full(len(targets.responses), np.nan), springs, springs)
        ones = np.ones((len(targets.loads), 6))
        motions, _ = self.motions(of, row, targets.loads, (ones, ones))
        amplitude = np.abs(motions @ self.sensor_arms(of, row).T).max(axis=1)
        stretched = np.abs(motions @ of.springs[row].T).max(axis=(0, 1))
        elongation = of.preload[row] / of.spring_stiffness[row] - stretched
        responses = self.responses(of, row, of.numbers["frames.detergent_point.position"][row])
        return Computed(amplitude, amplitude, responses, of.preload[row], elongation)

    def sensor_arms(self, of: Assembled, machine: int) -> FloatArray:
        """Return the displacements of the sensors of a machine by the coordinates. (sensor, 6)"""
        arms = []
        for name in self.targets.sensors:
            point = of.numbers[f"frames.sensor_{name}.position"][machine]
            along = np.eye(3)["xyz".index(self.parameter_map.base.sensors[name].axis)]
            arms.append(np.concatenate([np.cross(point, along), along]))
        return np.array(arms)


END = ("friction_torque", "full_friction_rate")
"""Numbers of the friction of an end bushing."""


def largest_at(motions: ComplexArray, points: FloatArray) -> FloatArray:
    """Return the largest displacements of points of the tub. (case, point, axis) [m]

    Args:
        motions: Displacements and rotations. (case, speed, 6) [m, rad]
        points: In T. (point, 3) [m]
    """
    arms = np.zeros((len(points), 3, 6))
    arms[:, :, :3] = np.eye(3)
    x, y, z = points.T
    arms[:, 0, 4], arms[:, 0, 5] = z, -y
    arms[:, 1, 5], arms[:, 1, 3] = x, -z
    arms[:, 2, 3], arms[:, 2, 4] = y, -x
    moved = np.abs(motions @ arms.reshape(-1, 6).T).max(axis=1)
    return np.asarray(moved.reshape(len(motions), *arms.shape[:2]))
