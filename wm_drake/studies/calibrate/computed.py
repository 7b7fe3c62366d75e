"""Computed values at points: amplitudes, other responses, and what is known of the springs."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wm_drake.batch import simulate_many
from wm_drake.batch.ledger import Ledger, Result, key_of
from wm_drake.errors import InputError
from wm_drake.model.machine import Machine, Setup
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.studies.calibrate.parameter_map import ParameterMap
from wm_drake.studies.calibrate.response_targets import ComputedResponses
from wm_drake.studies.calibrate.targets import Targets

AT_ONCE = 100
"""Largest number of points that are evaluated before their values are stored."""


class Computed(NamedTuple):
    """Computed values at points. They are NaN if no machine exists at a point or a run diverged.

    Attributes:
        amplitude: (point, case, sensor) amplitudes. [m]
        power_mean: (point, case, sensor) smooth substitutes of the amplitudes
            (`wm_drake.simulation.displacements.power_means`). [m]
        responses: (point, response) other responses. [unit for reading]
        preload: (point, spring) preloads. [N]
        elongation: (point, spring) smallest elongation from the free length, over all cases. [m]
    """

    amplitude: FloatArray
    power_mean: FloatArray
    responses: FloatArray
    preload: FloatArray
    elongation: FloatArray


@dataclass
class Evaluation:
    """Function that computes values at points, and stores them in a ledger if it has one.

    Values that are in the ledger already are not computed again. Evaluations of other loads and
    responses have other keys.

    Attributes:
        parameter_map: Map from points to machines.
        targets: Targets; they say which cases are run.
        workers: Number of threads; None for the number of cores.
    """

    machine: Machine
    parameter_map: ParameterMap
    targets: Targets
    workers: int | None = None
    ledger: Ledger | None = None

    @cached_property
    def _responses(self) -> ComputedResponses:
        """Function that computes the other responses."""
        return ComputedResponses(self.machine, self.targets.responses, self.workers)

    def __call__(self, points: FloatArray) -> Computed:
        """Return the values at points (point, quantity), in SI units."""
        ledger = self.ledger
        if ledger is None:
            return self._computed(points)
        computes = [(t.load, t.gasket, t.of, t.response.name) for t in self.targets.responses]
        part = key_of(loads=self.targets.loads, responses=computes)
        keys = [key_of(point=point, part=part) for point in points]
        new = [index for index, key in enumerate(keys) if key not in ledger]
        for begin in range(0, len(new), AT_ONCE):
            rows = new[begin : begin + AT_ONCE]
            computed = self._computed(points[rows])
            results = {
                keys[i]: Result({kind: array[row] for kind, array in computed._asdict().items()})
                for row, i in enumerate(rows)
            }
            ledger.put_all(results)
        stored = [ledger.get(key).values for key in keys]
        return Computed(**{k: np.array([values[k] for values in stored]) for k in Computed._fields})

    def _computed(self, points: FloatArray) -> Computed:
        try:
            return self._run(points)
        except InputError:  # only the runs show that a machine needs a shorter step
            if len(points) == 1:
                return self._empty(1)
            halves = [self._computed(half) for half in np.array_split(points, 2)]
            return Computed(*map(np.concatenate, zip(*halves, strict=True)))

    def check(self, point: FloatArray) -> None:
        """Check that the machine at a point can be run.

        Raises:
            InputError: it cannot, for example because the step is too long for it.
        """
        self._run(point[None])

    def _run(self, points: FloatArray) -> Computed:
        """Return the values at points.

        Raises:
            InputError: the step is too long for one of the machines.
        """
        preloads = {
            index: ([spring.preload for spring in setup.springs.values()], setup.parameters)
            for index, setup in self._set_up(points)
        }
        places, result = list(preloads), self._empty(len(points))
        if not places:
            return result
        machines = [parameters for _, parameters in preloads.values()]
        loads = self.targets.loads
        cases = (
            Case(name, parameters.loads[name], parameters.profile, gasket, parameters=parameters)
            for parameters in machines
            for name, gasket in loads
        )
        table = simulate_many(
            self.machine,
            cases,
            measures=("amplitudes", "power means", "spring tensions"),
            workers=self.workers,
        )
        ended = (table.diverged == "").values[:, None]
        for array, values in (
            (result.amplitude, table.amplitude.values),
            (result.power_mean, table.power_mean.values),
        ):
            array[places] = np.where(ended, values, np.nan).reshape(-1, *array.shape[1:])
        shortest = table.smallest_spring_elongation.values
        result.elongation[places] = shortest.reshape(len(machines), len(loads), -1).min(axis=1)
        result.responses[places] = self._responses(machines)
        result.preload[places] = [preload for preload, _ in preloads.values()]
        return result

    def _empty(self, points: int) -> Computed:
        amplitude = (points, *self.targets.amplitude.shape)
        springs = (points, len(self.machine.springs))
        others = (points, len(self.targets.responses)), springs, springs
        return Computed(*(np.full(shape, np.nan) for shape in (amplitude, amplitude, *others)))

    def _set_up(self, points: FloatArray) -> Iterator[tuple[int, Setup]]:
        """Yield the index of each point and the machine set up there, always in the same Context.

        Points with values that are not allowed or without static equilibrium, with the gasket or
        without it where the targets ask for it, are omitted.
        """
        context = None
        without_gasket = any(not gasket for _, gasket in self.targets.loads)
        for index, point in enumerate(points):
            try:
                parameters = self.parameter_map.parameters_at(point)
                if without_gasket:
                    bare = self.machine.set_up(parameters=parameters, gasket=False, context=context)
                    context = bare.context
                setup = self.machine.set_up(parameters=parameters, context=context)
            except InputError:
                continue
            context = setup.context
            yield index, setup


@dataclass(frozen=True)
class Runner:
    """Machine, ledger and threads with which points are evaluated.

    Attributes:
        ledger: The open ledger of this calibration.
        workers: Number of threads; None for the number of cores.
        report: Called with the number of the search, the number of points it has evaluated and its
            lowest cost so far.
    """

    machine: Machine
    ledger: Ledger
    workers: int | None = None
    report: Callable[[int, int, float], None] = lambda search, evaluations, best: None

    def values(self, parameter_map: ParameterMap, targets: Targets) -> Evaluation:
        """Return the function that computes and stores the values at points."""
        return Evaluation(self.machine, parameter_map, targets, self.workers, self.ledger)

    def report_of(self, search: int) -> Callable[[int, float], None]:
        """Return the report of a search with a number."""
        return lambda evaluations, best: self.report(search, evaluations, best)
