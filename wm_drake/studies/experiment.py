"""Runs of a machine over labelled points and loads, as one labelled dataset.

A study says what varies and what is measured; here are the order and the names of the cases, their
place in the dataset, and the marks of runs that failed. `Executor.simulate` below does the rest:
ledger, workers or cluster with retries, progress, and the check of the step.

    experiment = Experiment(machine, ("gap",), executor.simulate, tuple(cases))
    data = experiment.at(["soft", "stiff"], [soft, stiff])
    data.smallest_gap                                          # (point, load), NaN if a run failed
    responses(data, chosen_responses(parameters, profile))     # Dx, gap, ... by name, in SI

Machines and cases are made one by one when they are run, so that 100,000 of them take the memory of
their results. Cases that are no product of points and loads go to `Experiment.over`, with the
labels of any dimensions; what needs the motion itself, such as an envelope, to
`Experiment.records`. `placed` alone keeps what was measured of a run until it failed.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import xarray as xr

from wm_drake.batch import RunResult, simulate_many
from wm_drake.engines.compiled.step_check import check_step
from wm_drake.errors import InputError
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, with_values
from wm_drake.parameters.types import FloatArray
from wm_drake.report.formatting import three_digits
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.cases import Case, load_of
from wm_drake.simulation.measures.responses import Response
from wm_drake.simulation.records import Record, why_diverged
from wm_drake.simulation.steps import checked_step

Simulate: TypeAlias = Callable[..., xr.Dataset]
"""Function of a built machine, names of measures, cases and a word for them, with the table of
their runs: `Executor.simulate`, `run_here`, or another one in tests."""

PlaceLabels: TypeAlias = Mapping[str, Sequence[Any]]
"""Labels by the name of their dimension."""


@dataclass(frozen=True)
class CountedCases:
    """Cases that are made one by one when they are needed.

    Attributes:
        cases: The cases.
        count: Their number.
    """

    cases: Iterable[Case]
    count: int

    def __iter__(self) -> Iterator[Case]:
        return iter(self.cases)

    def __len__(self) -> int:
        return self.count


def run_here(
    machine: Machine, measures: tuple[str, ...], cases: Iterable[Case], what: str, **options: Any
) -> xr.Dataset:
    """Run cases on the cores of this computer, without a ledger and a progress bar.

    Args:
        options: Other options of `simulate_many`.
    """
    del what
    return simulate_many(machine, cases, measures=measures, **options)


def record_here(
    machine: Machine,
    cases: Iterable[Case],
    keep: Callable[[int, Record], None],
    what: str,
    **options: Any,
) -> None:
    """Run cases on the cores of this computer and pass number and record of each on.

    Args:
        options: Other options of `simulate_many`.
    """
    del what

    def collect(run: RunResult) -> None:
        assert run.record is not None
        keep(run.number, run.record)

    simulate_many(machine, cases, measures=[], histories=True, finished=collect, **options)


@dataclass(frozen=True)
class Experiment:
    """Runs of a machine with other numbers and loads, and what is measured of each.

    Attributes:
        machine: Built machine; its elements are those of all runs.
        measures: Names of measures, keys of `wm_drake.simulation.measures.MEASURES`.
        simulate: Function that runs cases.
        loads: Case of each load, without parameters, for `at`.
        record: Function that runs cases with their records, `Executor.records`.
    """

    machine: Machine
    measures: tuple[str, ...]
    simulate: Simulate = run_here
    loads: tuple[Case, ...] = ()
    record: Callable[..., None] = record_here

    def over(self, labels: PlaceLabels, cases: Iterable[Case], what: str = "runs") -> xr.Dataset:
        """Run cases and return their measures over labelled dimensions.

        Args:
            labels: Labels of each dimension.
            cases: One for each combination of labels; the last dimension varies fastest. They
                are taken one by one.
            what: Word beside the progress bar.

        Returns:
            As of `placed`; the measures of a run that failed are NaN.
        """
        counted = CountedCases(cases, math.prod(map(len, labels.values())))
        data = placed(self.simulate(self.machine, self.measures, counted, what), labels)
        has_ended = data.diverged == ""
        if not has_ended.all():
            data = data.drop_vars("diverged").where(has_ended).assign(diverged=data.diverged)
        return data

    def at(
        self, points: Sequence[Any], machines: Iterable[MachineParameters], what: str = "runs"
    ) -> xr.Dataset:
        """Run all loads with changed machines and return their measures over `point` and `load`.

        Args:
            points: Labels of the machines; the name of a case is that of its load and this label.
            machines: The machines. They are taken one by one.
            what: Word beside the progress bar.
        """
        pairs = zip(points, machines, strict=True)
        cases = (case for point, machine in pairs for case in self.cases_of(machine, str(point)))
        return self.over({"point": points, "load": [c.name for c in self.loads]}, cases, what)

    def records(
        self,
        labels: PlaceLabels,
        cases: Iterable[Case],
        measure: Callable[[Record], FloatArray],
        size: int,
        what: str = "records",
    ) -> FloatArray:
        """Run cases on this computer and return numbers of the record of each.

        Records are too large for a ledger.

        Args:
            labels, cases, what: As for `over`.
            measure: Function of a record with an array. (size,)
            size: Number of its values.

        Returns:
            Over the labels and these values; NaN for a run that failed.
        """
        shape = tuple(map(len, labels.values()))
        values = np.full((math.prod(shape), size), np.nan)

        def keep(number: int, record: Record) -> None:
            if not why_diverged(record):
                values[number] = measure(record)

        self.record(self.machine, CountedCases(cases, len(values)), keep, what)
        return values.reshape(*shape, size)

    def cases_of(self, machine: MachineParameters, name: str) -> Iterator[Case]:
        """Yield the case of each load for a changed machine, which has a name."""
        for case in self.loads:
            load = load_of(case, self.machine.parameters, machine)
            yield Case(f"{case.name}, {name}", load, case.profile, case.gasket, machine)

    def allowed(self, changes: Mapping[str, Mapping[str, Any]]) -> dict[str, MachineParameters]:
        """Return changed machines by name, without those that the machine or its step refuses.

        Args:
            changes: New values by key path, by name.
        """
        parameters, machines = self.machine.parameters, dict[str, MachineParameters]()
        for name, change in changes.items():
            try:
                changed = with_values(parameters, change)
            except InputError:
                continue
            if self.can_run(changed):
                machines[name] = changed
        return machines

    def can_run(self, machine: MachineParameters) -> bool:
        """Return whether a changed machine has an equilibrium, and a step that is short enough."""
        try:
            check_step(self.machine.set_up(parameters=machine), checked_step(machine, None))
        except InputError:
            return False
        return True


def placed(table: xr.Dataset, labels: PlaceLabels) -> xr.Dataset:
    """Return a table of runs over labelled dimensions.

    Args:
        table: As of `wm_drake.simulate_many`.
        labels: Labels of each dimension; the last one varies fastest over the runs.

    Returns:
        The measures in SI over these dimensions and their own ones, and `diverged`, when and why a
        run failed, "" if it did not.
    """
    shape = tuple(map(len, labels.values()))
    without_runs = {name: c.variable for name, c in table.coords.items() if "run" not in c.dims}
    return xr.Dataset(
        {
            name: ((*labels, *v.dims[1:]), v.values.reshape(*shape, *v.shape[1:]), v.attrs)
            for name, v in table.data_vars.items()
        },
        {**without_runs, **{name: list(values) for name, values in labels.items()}},
    )


def failures(data: xr.Dataset) -> tuple[str, ...]:
    """Return a line for each run of an experiment that failed: its labels, when and why."""
    reasons = data.diverged.to_series()
    return tuple(
        f"{', '.join(map(str, at if isinstance(at, tuple) else (at,)))}: {reason}"
        for at, reason in reasons[reasons != ""].items()
    )


def responses(data: xr.Dataset, chosen: Iterable[Response]) -> xr.Dataset:
    """Return responses by their names, in SI, as variables that carry their quantities.

    Args:
        data: As of `Experiment.over`.
    """
    return xr.Dataset({response.name: response_of(data, response) for response in chosen})


def response_of(data: xr.Dataset, response: Response) -> xr.DataArray:
    """Return one response of runs, in SI; it carries its quantity."""
    variable = response.variable
    at = dict(zip(variable.dims, response.place, strict=True))
    return quantity_of(response).on(data[variable.name].isel(at, drop=True))


def in_three_digits(chosen: Iterable[Response]) -> dict[str, Quantity]:
    """Return words and unit of each response by its name, with three digits."""
    return {response.name: replace(quantity_of(response), form=three_digits) for response in chosen}


def quantity_of(response: Response) -> Quantity:
    """Return words and unit of a response."""
    return Quantity(response.title.replace("_", " "), response.unit)
