"""The question of what to measure next, and machines with their answers and measurements."""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from wm_drake.engines.compiled.step_check import check_step
from wm_drake.errors import InputError
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.measures.responses import Response
from wm_drake.simulation.steps import checked_step
from wm_drake.studies.experiment import Experiment, response_of
from wm_drake.studies.next.knowledge import Knowledge
from wm_drake.studies.next.measurements import CandidateMeasurement, TriedMachines
from wm_drake.studies.proposal import SIGNS


@dataclass(frozen=True)
class Question:
    """What shall become sure, and how it can be measured.

    Attributes:
        knowledge: What is known.
        measurements: What could be measured.
        answers: Responses, each of its worst load.
        loads: Loads of the answers.
        experiments: Runs with the gasket (True) and without it.
    """

    knowledge: Knowledge
    measurements: tuple[CandidateMeasurement, ...]
    answers: tuple[Response, ...]
    loads: tuple[str, ...]
    experiments: Mapping[bool, Experiment]

    def at(self, scores: FloatArray, what: str) -> "Observed":
        """Run the machines at scores (k, p), and return their answers and what is measured."""
        machines = self._machines(scores)
        try:
            tried = self._run(machines, what)
        except InputError:  # only a set-up shows that a machine cannot be run
            machines = self._that_run(machines)
            tried = self._run(machines, what)
        kept = list(machines)
        none = np.empty((len(kept), 0))
        answers = [none, *(self._signed(tried.runs[True], response) for response in self.answers)]
        numbers = [m.numbers(tried).reshape(len(kept), -1) for m in self.measurements]
        return Observed(
            _placed(np.hstack(answers), kept, len(scores)),
            tuple(_placed(part, kept, len(scores)) for part in numbers),
        )

    def _run(self, machines: Mapping[int, MachineParameters], what: str) -> TriedMachines:
        """Return machines with their runs.

        Raises:
            InputError: one of them cannot be run.
        """
        runs = {
            gasket: experiment.at(list(machines), machines.values(), what)
            for gasket, experiment in self.experiments.items()
        }
        return TriedMachines(self.knowledge.machine, list(machines.values()), runs)

    def _machines(self, scores: FloatArray) -> dict[int, MachineParameters]:
        """Return the machines at scores by their places, without those that do not exist."""
        machines = dict[int, MachineParameters]()
        for place, values in enumerate(self.knowledge.values(scores)):
            with contextlib.suppress(InputError):
                machines[place] = self.knowledge.machine_of(values)
        return machines

    def _that_run(self, machines: Mapping[int, MachineParameters]) -> dict[int, MachineParameters]:
        """Return the machines that can be run: with a rest pose and for the step."""
        machine, kept = self.knowledge.machine, dict[int, MachineParameters]()
        step = checked_step(machine.parameters, None)
        for place, parameters in machines.items():
            with contextlib.suppress(InputError):
                for gasket in self.experiments:
                    check_step(machine.set_up(parameters=parameters, gasket=gasket), step)
                kept[place] = parameters
        return kept

    def _signed(self, runs: xr.Dataset, response: Response) -> FloatArray:
        """Return a response of each load, signed so that less is better. (machines, loads)"""
        values = response_of(runs, response).sel(load=list(self.loads))
        return SIGNS[response.better] * values.transpose("point", "load").values

    def worst(self, answers: FloatArray) -> FloatArray:
        """Return each answer of its worst load, with its own sign. (k, answers) [SI]

        Args:
            answers: As of `Observed.answers`.
        """
        of_loads = answers.reshape(len(answers), len(self.answers), len(self.loads))
        return np.array([SIGNS[r.better] for r in self.answers]) * of_loads.max(axis=2)


@dataclass(frozen=True, eq=False)
class Observed:
    """What machines at points give; NaN where there is no such machine, or a run failed.

    Attributes:
        answers: Each answer of each load, signed so that less is better. (k, answers loads) [SI]
        numbers: Numbers of each measurement. (k, n)
    """

    answers: FloatArray
    numbers: tuple[FloatArray, ...]


def _placed(values: FloatArray, kept: Sequence[int], count: int) -> FloatArray:
    """Return rows at their places among NaN."""
    rows = np.full((count, values.shape[1]), np.nan)
    rows[list(kept)] = values
    return rows
