"""Computed values at points: amplitudes, other responses, and what is known of the springs."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wm_drake.engines.compiled.step_check import check_step
from wm_drake.errors import InputError
from wm_drake.model.machine import Machine, Setup
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.steps import checked_step
from wm_drake.studies.calibrate.parameter_map import ParameterMap
from wm_drake.studies.calibrate.response_targets import ComputedResponses
from wm_drake.studies.calibrate.targets import Targets
from wm_drake.studies.experiment import Experiment

MEASURES = ("amplitudes", "power means", "spring tensions")
"""Measures of each run."""


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
    """Function that computes values at points.

    Attributes:
        experiment: Runs of the machine.
        parameter_map: Map from points to machines.
        targets: Targets; they say which cases are run.
    """

    experiment: Experiment
    parameter_map: ParameterMap
    targets: Targets

    @property
    def machine(self) -> Machine:
        """Return the built machine."""
        return self.experiment.machine

    @cached_property
    def _responses(self) -> ComputedResponses:
        """Function that computes the other responses."""
        return ComputedResponses(self.experiment, self.targets.responses)

    def __call__(self, points: FloatArray) -> Computed:
        """Return the values at points (point, quantity), in SI units."""
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
        labels = {"point": places, "case": range(len(loads))}
        runs = replace(self.experiment, measures=MEASURES).over(labels, cases)
        result.amplitude[places] = runs.amplitude.values
        result.power_mean[places] = runs.power_mean.values
        result.elongation[places] = runs.smallest_spring_elongation.min("case").values
        result.responses[places] = self._responses(machines)
        result.preload[places] = [preload for preload, _ in preloads.values()]
        return result

    def check(self, point: FloatArray) -> None:
        """Check that the machine at a point can be run.

        Raises:
            InputError: it cannot, for example because the step is too long for it.
        """
        self._set_up_at(point, None)

    def _empty(self, points: int) -> Computed:
        amplitude = (points, *self.targets.amplitude.shape)
        springs = (points, len(self.machine.springs))
        others = (points, len(self.targets.responses)), springs, springs
        return Computed(*(np.full(shape, np.nan) for shape in (amplitude, amplitude, *others)))

    def _set_up(self, points: FloatArray) -> Iterator[tuple[int, Setup]]:
        """Yield the index of each point and the machine set up there, always in the same Context.

        Points without a machine that can be run are omitted.
        """
        last: Setup | None = None
        for index, point in enumerate(points):
            try:
                last = self._set_up_at(point, last)
            except InputError:
                continue
            yield index, last

    def _set_up_at(self, point: FloatArray, last: Setup | None) -> Setup:
        """Return the machine set up at a point.

        Raises:
            InputError: a value is not allowed, there is no static equilibrium, with the gasket or
                without it where the targets ask for it, or the step is too long.
        """
        parameters = self.parameter_map.parameters_at(point)
        context = None if last is None else last.context
        if any(not gasket for _, gasket in self.targets.loads):
            bare = self.machine.set_up(parameters=parameters, gasket=False, context=context)
            context = bare.context
        setup = self.machine.set_up(parameters=parameters, context=context)
        check_step(setup, checked_step(parameters, None))
        return setup
