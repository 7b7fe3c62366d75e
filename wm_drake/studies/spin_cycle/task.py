"""The task of the study of a spin cycle: options and files checked, and runs."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.batch import simulate_many
from wm_drake.batch.many import as_table
from wm_drake.errors import InputError, check_known, input_error
from wm_drake.model.machine import Machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.unbalance_cases import TABLE_9, UnbalanceCase, load_unbalance_cases
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import measure
from wm_drake.studies.inputs import channels_of, existing_file, runnable_profile
from wm_drake.studies.run import Executor
from wm_drake.studies.spin.study import run_spin
from wm_drake.studies.spin_cycle.measured import read_accelerations, read_rms
from wm_drake.studies.spin_cycle.options import CycleOptions, SpinCycleOptions
from wm_drake.studies.spin_cycle.page import SpinCycleReport
from wm_drake.studies.spin_cycle.study import (
    Evaluate,
    labels_of,
    measures_of,
    run_spin_cycle,
    runs_of,
)
from wm_drake.studies.study import Task

ENGINES = ("compiled", "drake")


class SpinCycleTask(Task):
    """The study with checked options."""

    def __init__(self, options: SpinCycleOptions, machine: Machine) -> None:
        """Read profile, cases and measurements."""
        engine = options.engine
        check_known(engine, ENGINES, f"unknown engine '{engine}'", where="--engine")
        self.machine, self.engine = machine, engine
        self.profile = runnable_profile(options.profile, machine.parameters)
        self.cases = cases_of_table(options.cases, options.case)
        self.measured = measured_displacements(
            options, machine.parameters, self.cases, self.profile
        )

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs."""
        return {"profile": self.profile, "engine": self.engine}

    def run(self, executor: Executor) -> SpinCycleReport:
        """Run all cases."""
        parameters = self.machine.parameters
        if self.engine == "drake":
            with executor.progress(len(self.cases), "cases") as progress:
                evaluate = drake_runs(parameters, progress=progress)
                result = run_spin_cycle(parameters, self.cases, self.profile, evaluate)
        else:
            measures = measures_of(parameters)
            evaluate = partial(executor.simulate, self.machine, measures, what="cases")
            result = run_spin_cycle(parameters, self.cases, self.profile, evaluate)
        return SpinCycleReport(replace(result, measured=self.measured), self.engine)


def cases_of_table(path: Path | None, names: Sequence[str] | None) -> list[UnbalanceCase]:
    """Return the cases that `--cases` and `--case` select."""
    table = load_unbalance_cases(existing_file(path, "--cases") if path else TABLE_9)
    known = {case.name: case for case in table}
    for name in names or []:
        check_known(name, known, f"unknown case '{name}'", where="--case")
    return [known[name] for name in dict.fromkeys(names)] if names else table


def measured_displacements(
    options: CycleOptions,
    parameters: MachineParameters,
    cases: list[UnbalanceCase],
    profile: SpinProfile,
) -> xr.DataArray | None:
    """Return the measured RMS displacements in a file of the options; None without a file.

    Raises:
        InputError: there are files of both kinds, one is wrong, or a case cannot be run.
    """
    channels = channels_of(options.channels)
    if options.measured and options.accelerations:
        raise input_error("not allowed together with --measured", where="--accelerations")
    if channels and not options.accelerations:
        raise input_error("is about the files of --accelerations", where="--channels")
    try:
        runs_of(parameters, cases, profile)  # raises an error for cases that cannot be run
    except InputError as error:
        raise InputError(
            replace(p, where="--profile", key="") if p.key == "profile" else p
            for p in error.problems
        ) from None
    labels = labels_of(parameters, cases, profile)
    if options.measured:
        return read_rms(existing_file(options.measured, "--measured"), labels)
    if options.accelerations:
        return read_accelerations(options.accelerations, labels, profile, channels)
    return None


def compiled_runs(machine: Machine) -> Evaluate:
    """Return a function that runs cases of a built machine with the compiled engine."""
    return partial(simulate_many, machine, measures=measures_of(machine.parameters))


def drake_runs(
    parameters: MachineParameters, *, progress: Callable[[int], None] = lambda done: None
) -> Evaluate:
    """Return a function that runs cases with the Drake engine in processes, minutes a case."""

    def evaluate(cases: Iterable[Case]) -> xr.Dataset:
        runs = list(cases)
        done = np.zeros(len(runs))

        def report(index: int, fraction: float) -> None:
            done[index] = fraction
            progress(int(done.sum()))

        results = run_spin(parameters, runs, "drake", progress=report).results
        measures, scene = measures_of(parameters), Scene(parameters)
        rows = {
            number: (
                result.case.name,
                str(result.record.attrs["diverged"]),
                measure(result.record, scene, measures).values,
            )
            for number, result in enumerate(results)
        }
        return as_table(parameters, measures, rows)

    return evaluate
