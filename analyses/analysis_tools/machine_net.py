"""Machines drawn from wide priors, and their scores from runs (`net_score` has the scores).

The first part of a score needs twelve runs: six amplitudes and five settings of the gasket under
the middle load, one under the counter load. The second part needs the gasket study of 27 trials and
two loads.
"""

from collections.abc import Sequence
from functools import cached_property, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from choose_damper_law import free_tree_of, machine_text

from analysis_tools.net_measures import AT_CORNERS, PLACES
from analysis_tools.net_score import (
    MIDDLE_TRIALS,
    Scored,
    Shape,
    ShapeMeasures,
    failed,
    joined,
)
from wm_drake.batch import simulate_many
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, load_machine
from wm_drake.parameters.files import read_yaml
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.vary_file import VaryFile, gasket_entries
from wm_drake.parameters.varying import varying
from wm_drake.simulation.cases import Case
from wm_drake.studies.calibrate.parameter_map import ParameterMap, parameter_map_of
from wm_drake.studies.calibrate.response_targets import ComputedResponses
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


def free_of_net(law: str) -> VaryFile:
    """Return the free quantities of the net for a damper law."""
    tree, wide = free_tree_of(law), read_yaml(PRIORS)
    quantities: dict[str, Any] = tree["vary"]
    sets = quantities["gasket_radial"]["sets"]
    of_z = {key: sets.pop(key) for key in [*sets] if "stiffness_z" in key}
    quantities["gasket_vertical"] = {"sets": of_z}
    for name, changes in wide["vary"].items():
        quantities[name] |= changes
    for quantity in quantities.values():
        quantity.pop("start", None)
    tree["relations"] |= wide["relations"]
    return VaryFile.model_validate(tree)


def machine_of_net(law: str, addition: str = "") -> Machine:
    """Return the reference machine with a damper law and further lines of its file, built."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{law}.yaml"
        path.write_text(machine_text(law) + addition, encoding="utf-8")
        return build_machine(load_machine(path))


class Net:
    """Draws machines with one damper law, and scores them by runs."""

    def __init__(self, law: str) -> None:
        """Build the machines: one with curves for a gasket, one with constant stiffnesses."""
        self.machine = machine_of_net(law, SHORT)
        self.map: ParameterMap = parameter_map_of(self.machine, free_of_net(law))
        self.factors = gasket_entries()
        self.linear = build_machine(self._trial(self.machine.parameters, ()))
        self.shape = Shape(self.map.names)

    @cached_property
    def _study(self) -> ComputedResponses:
        experiment = Experiment(self.machine, (), partial(run_here, workers=1))
        return ComputedResponses(experiment, self.shape.targets.responses)

    def drawn(self, rng: np.random.Generator) -> FloatArray:
        """Return a machine: the gasket by its relations, all else from the priors. (quantity,)"""
        m, k = self.map, self.shape.index
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
        return varying(parameters, self.factors, tables="linear").at_levels(row)

    def scored(self, points: FloatArray) -> Scored:
        """Return machines (machine, quantity) with the first part of their scores, by runs.

        A machine that fails has NaN.
        """
        try:
            return self.shape.scored(points.copy(), self._measures(points))
        except InputError:  # only the runs show that a machine needs a shorter step
            if len(points) == 1:
                return failed(points)
            return joined([self.scored(half) for half in np.array_split(points, 2)])

    def _measures(self, points: FloatArray) -> ShapeMeasures:
        """Return the measures of machines from twelve runs each."""
        machines = [self.map.parameters_at(point) for point in points]
        preload = self._preloads(machines)
        loads = self.shape.targets.loads
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
        return ShapeMeasures(at_places, at_corners, forces, preload)

    def _preloads(self, machines: Sequence[MachineParameters]) -> FloatArray:
        """Return the preloads of the springs. (machine, spring) [N]"""
        context, preloads = None, []
        for parameters in machines:
            setup = self.machine.set_up(parameters=parameters, gasket=False, context=context)
            context = setup.context
            preloads.append([spring.preload for spring in setup.springs.values()])
        return np.array(preloads)

    def with_study(self, scored: Scored, chosen: np.ndarray) -> Scored:
        """Return scored machines with the second part of those with the given numbers, by runs."""
        second, effects = scored.second.copy(), scored.effects.copy()
        for number in chosen:
            try:
                values = self._study([self.map.parameters_at(scored.points[number])])[0]
            except InputError:
                continue
            second[number], effects[number] = self.shape.score_of_study(values)
        return scored._replace(second=second, effects=effects)


def _ended(table: Any, values: FloatArray) -> FloatArray:
    """Return values of runs (run, ...), NaN where a run diverged."""
    diverged = (table.diverged.values != "").reshape(-1, *[1] * (values.ndim - 1))
    return np.where(diverged, np.nan, values)
