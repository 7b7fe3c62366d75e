"""Machines drawn from wide priors, and how well each has the shape of the results of [B].

A machine is scored by logarithms of squared misfits, so that signs and order count and not sizes.
The first stage makes twelve runs: six amplitudes and five settings of the gasket under the middle
load, one under the counter load. Sensors and the point at the detergent box are placed after the
runs. The second stage makes the gasket study of 27 trials and two loads.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from calibrate_reference import REFERENCE, adams_targets
from choose_damper_law import free_tree_of, machine_text

from analysis_tools.goals import printed_changes
from analysis_tools.net_measures import AT_CORNERS, CORNERS, PLACES, SENSORS, SLICES, places_of
from wm_drake.batch import simulate_many
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import (
    GASKET_FACTORS,
    MachineParameters,
    at_levels,
    levels_of,
    load_factors,
    load_machine,
)
from wm_drake.parameters.files import read_yaml
from wm_drake.parameters.free import FreeFile
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.studies.calibrate.parameter_map import ParameterMap, parameter_map_of
from wm_drake.studies.calibrate.response_targets import ComputedResponses
from wm_drake.studies.calibrate.targets import Targets
from wm_drake.studies.experiment import Experiment, run_here

PRIORS = Path(__file__).parents[1] / "reference_net.yaml"
"""Quantities and relations that replace those of reference_free.yaml."""

LAWS = ("havsin", "free_stroke", "stv_sponge", "mstv")
"""Damper laws, in turn; three of the four have a sponge."""

RADIUS = 0.167
"""Radius of the ring that the gasket is taken for. Assumption: an opening of 330 mm. [m]"""

SHORT = """
step: 5 ms
profile:
  source: run-up of [B] up to 330 rpm, above all resonances, to save time
  steps:
  - {ramp_to: 330 rpm, rate: 7 rpm/s}
  - {hold_until: 48 s}
"""
"""Runs of the net: with steps of 5 ms, which change peaks by about 1 %."""

MIDDLE_TRIALS = ((), (("K_Lx", -1),), (("K_Lx", 1),), (("K_Lz", -1),), (("K_Lz", 1),))
"""Levels of gasket factors in the runs of the first stage; the others are at 0."""

LIKELY_PRELOAD = 150.0, 40.0
"""Preload of a spring and its standard deviation: three springs share the weight of 46 kg. [N]"""

NO_GASKET_TOLERANCE, TOLERANCE, TINY_TOLERANCE = 0.15, 0.10, 0.40
"""Relative misfits that count 1: of measured amplitudes, of all others, and of 0.55 mm."""


def penalty(misfits: FloatArray) -> FloatArray:
    """Return the logarithm of 1 + misfit^2, which grows slowly for large misfits."""
    return np.log1p(np.square(misfits))


def free_of_net(law: str) -> FreeFile:
    """Return the free quantities of the net for a damper law."""
    tree, wide = free_tree_of(law), read_yaml(PRIORS)
    quantities: dict[str, Any] = tree["quantities"]
    sets = quantities["gasket_radial"]["sets"]
    of_z = {key: sets.pop(key) for key in [*sets] if "stiffness_z" in key}
    quantities["gasket_vertical"] = {"sets": of_z}
    for name, changes in wide["quantities"].items():
        quantities[name] |= changes
    for quantity in quantities.values():
        quantity.pop("start", None)
    tree["relations"] |= wide["relations"]
    return FreeFile.model_validate(tree)


def machine_of_net(law: str, addition: str = "") -> Machine:
    """Return the reference machine with a damper law and further lines of its file, built."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{law}.yaml"
        path.write_text(machine_text(law) + addition, encoding="utf-8")
        return build_machine(load_machine(path))


@dataclass(frozen=True)
class Scored:
    """Machines with their scores; lower is better, NaN if a machine cannot be run.

    Attributes:
        points: Free quantities, with sensors and detergent point placed. (machine, quantity) [SI]
        first: Score of the first stage. (machine,)
        second: Score of the second stage; NaN if it was not made. (machine,)
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


class Net:
    """Draws and scores machines with one damper law."""

    def __init__(self, law: str) -> None:
        """Build the machines: one with curves for a gasket, one with constant stiffnesses."""
        self.machine = machine_of_net(law, SHORT)
        self.map: ParameterMap = parameter_map_of(self.machine, free_of_net(law))
        self.index = {name: k for k, name in enumerate(self.map.names)}
        self.factors = load_factors(GASKET_FACTORS)
        self.linear = build_machine(self._trial(self.machine.parameters, ()))
        self.reference = load_machine(REFERENCE)

    @cached_property
    def targets(self) -> Targets:
        """Targets of the reference machine."""
        return adams_targets(self.reference)

    @cached_property
    def _study(self) -> ComputedResponses:
        return ComputedResponses(
            Experiment(self.machine, (), partial(run_here, workers=1)), self.targets.responses
        )

    def drawn(self, rng: np.random.Generator) -> FloatArray:
        """Return a machine: the gasket by its relations, all else from the priors. (quantity,)"""
        m, k = self.map, self.index
        point = m.expected + m.deviation * rng.normal(size=len(m.names))

        def log_uniform(low: float, high: float) -> float:
            return float(np.exp(rng.uniform(np.log(low), np.log(high))))

        radial = log_uniform(2e3, 10e3)
        axial = radial * rng.uniform(0.3, 0.85)
        point[k["gasket_radial"]] = radial
        point[k["gasket_vertical"]] = radial * rng.uniform(0.9, 1.1)
        point[k["gasket_axial"]] = axial
        point[k["gasket_tilt"]] = log_uniform(0.1, 1.2) * axial * RADIUS**2 / 2.0
        point[k["gasket_torsion"]] = min(log_uniform(50.0, 500.0), 2.2 * radial * RADIUS**2)
        point[k["damper_friction"]] = log_uniform(8.0, 60.0)
        margin = 1e-3 * (m.upper - m.lower)
        return np.clip(point, m.lower + margin, m.upper - margin)

    def _trial(
        self, parameters: MachineParameters, levels: Sequence[tuple[str, int]]
    ) -> MachineParameters:
        """Return a machine with constant stiffnesses of the gasket, some factors at a level."""
        chosen = dict(levels)
        row = [chosen.get(name, 0) for name in self.factors]
        return at_levels(parameters, levels_of(parameters, self.factors, "linear"), row)

    def scored(self, points: FloatArray) -> Scored:
        """Return the first stage of machines (machine, quantity); a machine that fails is NaN."""
        try:
            return self._first_stage(points)
        except InputError:  # only the runs show that a machine needs a shorter step
            if len(points) == 1:
                nan = np.full(1, np.nan)
                return Scored(points, nan, nan, nan, np.full((1, 2), np.nan), nan)
            halves = [self.scored(half) for half in np.array_split(points, 2)]
            joined = (np.concatenate(parts) for parts in zip(*map(_values, halves), strict=True))
            return Scored(*joined)

    def _first_stage(self, points: FloatArray) -> Scored:
        machines = [self.map.parameters_at(point) for point in points]
        preload = self._preloads(machines)
        loads = self.targets.loads
        table = simulate_many(
            self.machine,
            (
                Case(name, p.loads[name], p.profile, gasket, parameters=p)
                for p in machines
                for name, gasket in loads
            ),
            measures=(PLACES.name,),
            workers=1,
        )
        at_places = _ended(table, table.place_amplitude.values).reshape(len(points), len(loads), -1)
        trials = [("middle", levels) for levels in MIDDLE_TRIALS] + [("counter", ())]
        table = simulate_many(
            self.linear,
            (
                Case(load, trial.loads[load], trial.profile, True, parameters=trial)
                for p in machines
                for load, levels in trials
                for trial in [self._trial(p, levels)]
            ),
            measures=(AT_CORNERS.name, "extremes"),
            workers=1,
        )
        shape = len(points), len(trials)
        at_corners = 1e3 * _ended(table, table.corner_displacement.values).reshape(*shape, -1, 3)
        loads_of_gasket = np.hstack([table.gasket_force.values, table.gasket_moment.values])
        forces = _ended(table, loads_of_gasket).reshape(*shape, 6)
        placed = [self._sensors_placed(p, a) for p, a in zip(points, at_places, strict=True)]
        corners = [self._corner_placed(p, c) for p, c in zip(points, at_corners, strict=True)]
        first = [score for score, _ in placed] + np.array([score for score, _ in corners])
        first += [self._score_of_forces(f) for f in forces]
        expected, deviation = LIKELY_PRELOAD
        first += penalty((preload - expected) / deviation).sum(axis=1)
        nan = np.full(len(points), np.nan)
        return Scored(
            points,
            np.asarray(first),
            nan,
            np.array([signs for _, signs in placed]),
            np.array([slopes for _, slopes in corners]),
            nan,
        )

    def _preloads(self, machines: Sequence[MachineParameters]) -> FloatArray:
        """Return the preloads of the springs. (machine, spring) [N]"""
        context, preloads = None, []
        for parameters in machines:
            setup = self.machine.set_up(parameters=parameters, gasket=False, context=context)
            context = setup.context
            preloads.append([spring.preload for spring in setup.springs.values()])
        return np.array(preloads)

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

    def with_second_stage(self, scored: Scored, chosen: np.ndarray) -> Scored:
        """Return scored machines with the second stage of those with the given numbers."""
        second, effects = scored.second.copy(), scored.effects.copy()
        for number in chosen:
            try:
                values = self._study([self.map.parameters_at(scored.points[number])])[0]
            except InputError:
                continue
            second[number], effects[number] = self._score_of_study(values)
        return Scored(scored.points, scored.first, second, scored.signs, scored.slopes, effects)

    def _score_of_study(self, values: FloatArray) -> tuple[float, int]:
        """Return the score of a gasket study, and how many effects have the printed sign."""
        targets = self.targets.responses
        misfits = [t.misfits(values[k]) / t.deviation for k, t in enumerate(targets)]
        at_low = [k for k, t in enumerate(targets) if t.level == -1]
        signs = sum(int(values[k] * targets[k].value > 0.0) for k in at_low)
        return float(penalty(np.array(misfits)).sum()), signs


def _values(scored: Scored) -> list[FloatArray]:
    return [getattr(scored, name) for name in Scored.__dataclass_fields__]


def _ended(table: Any, values: FloatArray) -> FloatArray:
    """Return values of runs (run, ...), NaN where a run diverged."""
    diverged = (table.diverged.values != "").reshape(-1, *[1] * (values.ndim - 1))
    return np.where(diverged, np.nan, values)


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
