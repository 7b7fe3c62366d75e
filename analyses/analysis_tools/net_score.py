"""How well machines have the shape of the results of [B], from measures at many places.

The score is a sum of logarithms of squared misfits, so that signs and order count and not sizes.
Sensors and the point at the detergent box are placed where they fit best.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from calibrate_reference import REFERENCE, adams_targets

from analysis_tools.goals import printed_changes
from analysis_tools.net_measures import CORNERS, SENSORS, SLICES, places_of
from wm_drake.parameters import load_machine
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibrate.targets import Targets

MIDDLE_TRIALS = ((), (("K_Lx", -1),), (("K_Lx", 1),), (("K_Lz", -1),), (("K_Lz", 1),))
"""Levels of gasket factors in the cases of the middle load; the others are at 0."""

LIKELY_PRELOAD = 150.0, 40.0
"""Preload of a spring and its standard deviation: three springs share the weight of 46 kg. [N]"""

NO_GASKET_TOLERANCE, TOLERANCE, TINY_TOLERANCE = 0.15, 0.10, 0.40
"""Relative misfits that count 1: of measured amplitudes, of all others, and of 0.55 mm."""


def penalty(misfits: FloatArray) -> FloatArray:
    """Return the logarithm of 1 + misfit^2, which grows slowly for large misfits."""
    return np.log1p(np.square(misfits))


class Scored(NamedTuple):
    """Machines with their scores; lower is better, NaN if a machine has none.

    Attributes:
        points: Free quantities, with sensors and detergent point placed. (machine, quantity) [SI]
        first: First part of the score: amplitudes, means and slopes. (machine,)
        second: Second part, of the gasket study; NaN without one. (machine,)
        signs: Of the changes of Table 1, how many have the printed sign. (machine,)
        slopes: Change of Dz of the middle load from level -1 to 1 of K_Lx and of K_Lz, as
            fractions of it; [B] has 0.12 and -0.10. (machine, 2)
        effects: Of the printed effects at level -1, how many have the printed sign. (machine,)
    """

    points: FloatArray
    first: FloatArray
    second: FloatArray
    signs: FloatArray
    slopes: FloatArray
    effects: FloatArray


def failed(points: FloatArray) -> Scored:
    """Return machines (machine, quantity) that have no score."""
    nan = np.full(len(points), np.nan)
    return Scored(points, nan, nan, nan, np.full((len(points), 2), np.nan), nan)


def joined(parts: Sequence[Scored]) -> Scored:
    """Return the machines of all parts in a row."""
    return Scored(*map(np.concatenate, zip(*parts, strict=True)))


class ShapeMeasures(NamedTuple):
    """Measures of machines, from which the first part of the score follows.

    Attributes:
        places: Amplitudes at the places where sensors may be, of the cases of the targets.
            (machine, case, place) [m]
        corners: Largest displacements of the corners in `MIDDLE_TRIALS` and, last, in the trial of
            the counter load. (machine, trial, corner, axis) [mm]
        forces: Largest forces and moments of the gasket in these. (machine, trial, 6) [N, N m]
        preload: Of the springs. (machine, spring) [N]
    """

    places: FloatArray
    corners: FloatArray
    forces: FloatArray
    preload: FloatArray


class Shape:
    """Scores machines and places their sensors."""

    def __init__(self, names: list[str]) -> None:
        """Begin with the names of the free quantities."""
        self.index = {name: k for k, name in enumerate(names)}
        self.reference = load_machine(REFERENCE)

    @cached_property
    def targets(self) -> Targets:
        """Targets of the reference machine."""
        return adams_targets(self.reference)

    def scored(self, points: FloatArray, of: ShapeMeasures) -> Scored:
        """Return machines with the first part of their scores; their sensors are placed.

        Args:
            points: Free quantities, changed. (machine, quantity) [SI]
            of: Their measures; a machine with NaN has a score of NaN.
        """
        placed = [self._sensors_placed(p, a) for p, a in zip(points, of.places, strict=True)]
        corners = [self._corner_placed(p, c) for p, c in zip(points, of.corners, strict=True)]
        first = [score for score, _ in placed] + np.array([score for score, _ in corners])
        first += [self._score_of_forces(f) for f in of.forces]
        expected, deviation = LIKELY_PRELOAD
        first += penalty((of.preload - expected) / deviation).sum(axis=1)
        nan = np.full(len(points), np.nan)
        return Scored(
            points,
            np.asarray(first),
            nan,
            np.array([signs for _, signs in placed]),
            np.array([slopes for _, slopes in corners]),
            nan,
        )

    @cached_property
    def _changes(self) -> dict[str, FloatArray]:
        """Changes by the gasket of [B] Table 1 (sensor), as logarithms of ratios, by load."""
        loads = [load for load, gasket in self.targets.loads if not gasket]
        printed = printed_changes(self.reference, self.targets)
        return dict(zip(loads, printed, strict=True))

    def _sensors_placed(self, point: FloatArray, amplitude: FloatArray) -> tuple[float, int]:
        """Place the sensors of a machine where they fit best; `point` is changed.

        Args:
            point: (quantity,)
            amplitude: (case, place) [m]

        Returns:
            The score, and how many changes by the gasket have the printed sign.
        """
        loads, wanted = self.targets.loads, self.targets.amplitude
        row = {case: k for k, case in enumerate(loads)}
        costs, changes = {}, {}
        for number, sensor in enumerate(SENSORS):
            of_sensor = amplitude[:, SLICES[sensor]]
            has_gasket = np.array([gasket for _, gasket in loads])
            tolerance = np.where(has_gasket, TOLERANCE, NO_GASKET_TOLERANCE)
            tolerance = np.where(wanted[:, number] < 1e-3, TINY_TOLERANCE, tolerance)
            misfits = np.log(of_sensor / wanted[:, [number]]) / tolerance[:, None]
            changes[sensor] = {
                load: np.log(of_sensor[row[load, True]] / of_sensor[row[load, False]])
                for load in self._changes
            }
            cost = penalty(misfits).sum(axis=0)
            for load, change in changes[sensor].items():
                wrong = change - self._changes[load][number]
                cost = cost + penalty(wrong / TOLERANCE)
            costs[sensor] = cost.reshape([len(grid) for grid in places_of(sensor)])
        chosen = _chosen_places(costs)
        score, signs = 0.0, 0
        for number, (sensor, place) in enumerate(chosen.items()):
            score += float(costs[sensor][place])
            flat = np.ravel_multi_index(place, costs[sensor].shape)
            for load, change in changes[sensor].items():
                signs += int(change[flat] * self._changes[load][number] > 0.0)
        self._write_places(point, chosen)
        return score, signs

    def _write_places(self, point: FloatArray, chosen: dict[str, tuple[int, int]]) -> None:
        at = {s: [grid[k] for grid, k in zip(places_of(s), chosen[s], strict=True)] for s in chosen}
        values = {
            "sensor_rear_y": at["Xr"][0],
            "sensor_front_y": at["Xf"][0],
            "sensor_Zf_y": at["Zf"][0],
            "sensor_Xr_z": at["Xr"][1],
            "sensor_Xf_z": at["Xf"][1],
            "sensor_Zr_x": at["Zr"][1],
            "sensor_Zf_x": at["Zf"][1],
        }
        for sensor in ("Yr", "Yf"):
            values |= {f"sensor_{sensor}_x": at[sensor][0], f"sensor_{sensor}_z": at[sensor][1]}
        for name, value in values.items():
            point[self.index[name]] = value

    def _corner_placed(
        self, point: FloatArray, size: FloatArray
    ) -> tuple[float, tuple[float, float]]:
        """Place the point at the detergent box where it fits best; `point` is changed.

        Args:
            point: (quantity,)
            size: (trial, corner, axis) displacements in the order of the trials. [mm]

        Returns:
            The score, and the relative change of Dz from level -1 to 1 of K_Lx and of K_Lz.
        """
        at_zero = np.stack([size[0], size[-1]])
        means = np.array(
            [[self._mean(load, f"D{a}") for a in "xyz"] for load in ("middle", "counter")]
        )
        cost = penalty(np.log(at_zero / means[:, None]) / TOLERANCE).sum(axis=(0, 2))
        slopes = np.stack([size[2] - size[1], size[4] - size[3]]) / size[0]
        for k, factor in enumerate(("K_Lx", "K_Lz")):
            wanted = [self._slope("middle", f"D{axis}", factor) for axis in "xyz"]
            cost += penalty((slopes[k] - wanted) / 0.04).sum(axis=1)
        best = int(np.argmin(np.nan_to_num(cost, nan=np.inf)))
        for name, value in zip("xyz", CORNERS[best], strict=True):
            point[self.index[f"detergent_{name}"]] = value
        return float(cost[best]), (float(slopes[0, best, 2]), float(slopes[1, best, 2]))

    def _score_of_forces(self, forces: FloatArray) -> float:
        """Return the score of forces and moments (trial, 6) in the first and the last trial."""
        wanted = [
            [self._mean(load, name) for name in ("Fx", "Fy", "Fz", "Mx", "My", "Mz")]
            for load in ("middle", "counter")
        ]
        return float(penalty(np.log(forces[[0, -1]] / wanted) / TOLERANCE).sum())

    def _mean(self, load: str, response: str) -> float:
        """Return a printed mean. [unit for reading]"""
        return self._printed[load, response, "", None]

    def _slope(self, load: str, response: str, factor: str) -> float:
        """Return the printed change from level -1 to 1 over the mean; 0 if none is printed."""
        effects = [self._printed.get((load, response, factor, level)) for level in (-1, 0)]
        if effects[0] is None or effects[1] is None:
            return 0.0
        return (-2.0 * effects[0] - effects[1]) / self._mean(load, response)

    @cached_property
    def _printed(self) -> dict[tuple[str, str, str, int | None], float]:
        return {
            (t.load, t.response.name, t.factor, t.level): t.value for t in self.targets.responses
        }

    def score_of_study(self, values: FloatArray) -> tuple[float, int]:
        """Return the score of a gasket study, and how many effects have the printed sign."""
        targets = self.targets.responses
        misfits = [t.misfits(values[k]) / t.deviation for k, t in enumerate(targets)]
        at_low = [k for k, t in enumerate(targets) if t.level == -1]
        signs = sum(int(values[k] * targets[k].value > 0.0) for k in at_low)
        return float(penalty(np.array(misfits)).sum()), signs


def _chosen_places(costs: dict[str, FloatArray]) -> dict[str, tuple[int, int]]:
    """Return the best place of each sensor; both sensors at the rear have the same depth."""
    costs = {sensor: np.nan_to_num(cost, nan=np.inf) for sensor, cost in costs.items()}
    depth = int(np.argmin(costs["Xr"].min(axis=1) + costs["Zr"].min(axis=1)))
    chosen = {}
    for sensor, cost in costs.items():
        if sensor in ("Xr", "Zr"):
            chosen[sensor] = depth, int(np.argmin(cost[depth]))
        else:
            first, second = np.unravel_index(int(np.argmin(cost)), cost.shape)
            chosen[sensor] = int(first), int(second)
    return chosen
