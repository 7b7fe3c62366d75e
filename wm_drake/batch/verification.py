"""Verify the step of runs: a sample of them is run again with half the step and twice the samples.

The eigenvalues of a machine tell whether a step is stable, not whether it is accurate: a foot that
strikes the floor, a spring that goes slack or a motion that is chaotic shows in no linear machine.
Nor do they tell how far the peaks lie beside the samples that the measures are computed from. A run
that is converged changes little with half the step and half the time between samples.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wm_drake.batch.ledger import Ledger, LedgerEntry
from wm_drake.batch.remembered import run_keys
from wm_drake.batch.runs import Runner
from wm_drake.batch.work_items import BatchKey, Preparation, WorkItem
from wm_drake.compiler.lanes import WIDTH
from wm_drake.errors import InputError
from wm_drake.model.machine import Machine
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.cases import Case
from wm_drake.simulation.steps import checked_integrator, checked_step

LARGEST_DIFFERENCE = 0.02
"""Largest difference of amplitudes that needs no warning, by the largest amplitude of the run."""

MS, PERCENT = Unit("s", "ms"), Unit("", "%")

MOST_RUNS = WIDTH
"""Largest number of runs that are run again: one batch."""


@dataclass(frozen=True)
class StepError:
    """Largest difference of amplitudes between runs and the same runs, twice as fine.

    Attributes:
        difference: By the largest amplitude of the run; infinite if one of the two diverged.
        case: Name of the case of this difference.
        step, period: Its step size and its time between samples, before they were halved. [s]
        runs: Number of runs that were run again.
    """

    difference: float
    case: str
    step: float
    period: float
    runs: int

    @property
    def is_large(self) -> bool:
        """Whether the results need a warning."""
        return not self.difference <= LARGEST_DIFFERENCE

    @property
    def text(self) -> str:
        """Return what was verified and what came out, in one sentence."""
        if not np.isfinite(self.difference):
            differ = f"one of the two runs of '{self.case}' diverges"
        else:
            differ = (
                f"amplitudes of '{self.case}' differ by {PERCENT.from_si(self.difference):.2g} %"
            )
        step, period = map(MS.from_si, (self.step, self.period))
        halved = f"half the step of {step:g} ms and half the {period:g} ms between samples"
        return f"with {halved}, {differ}"

    @property
    def warning(self) -> str:
        """Return the warning of results that are not converged."""
        return (
            f"{self.text}: the results are not converged. Use a shorter step (--set step=...) or "
            "more samples (--set output_period=...); if the difference stays, the motion is "
            "chaotic and its amplitudes have no one value"
        )


class Sample:
    """At most `MOST_RUNS` runs, evenly spread over all that were added.

    Attributes:
        cases: Machine and case of each run of the sample.
    """

    def __init__(self) -> None:
        """Begin with no run."""
        self.cases: list[tuple[Machine, Case]] = []
        self._stride, self._seen = 1, 0

    def add(self, machine: Machine, case: Case) -> None:
        """Add a run; of more than `MOST_RUNS`, every second one leaves the sample."""
        if self._seen % self._stride == 0:
            self.cases.append((machine, case))
        self._seen += 1
        if len(self.cases) > MOST_RUNS:
            self.cases = self.cases[::2]
            self._stride *= 2

    def key(self) -> str:
        """Return the key of the error of its steps in a ledger."""
        keys = (
            key
            for machine, case in self.cases
            for key in run_keys(machine.parameters, [case], measures=("amplitudes",))
        )
        return hashlib.sha256(f"half step and period {' '.join(keys)}".encode()).hexdigest()

    def step_error(self, step: float | None = None) -> StepError | None:
        """Return the error of the steps of the sample; None without runs.

        Args:
            step: Step size; None for that of each machine. [s]
        """
        machines = {id(machine): machine for machine, _ in self.cases}
        errors = [
            step_error(machine, [case for other, case in self.cases if other is machine], step)
            for machine in machines.values()
        ]
        if not errors:
            return None
        worst = max(errors, key=lambda error: error.difference)
        return replace(worst, runs=len(self.cases))


def remembered_step_error(sample: Sample, ledger: Ledger) -> StepError | None:
    """Return the error of the steps of a sample, which is run once for a ledger."""
    key = sample.key()
    if key in ledger:
        known = ledger.get(key)
        difference, step, period, runs = known.values["step_error"].tolist()
        return StepError(difference, known.note, step, period, int(runs))
    error = sample.step_error()
    if error is not None:
        numbers = np.array([error.difference, error.step, error.period, error.runs])
        ledger.put_all({key: LedgerEntry({"step_error": numbers}, error.case)})
    return error


def step_error(machine: Machine, cases: Sequence[Case], step: float | None = None) -> StepError:
    """Run cases twice, the second time twice as fine, and compare their amplitudes.

    The second runs have half the step and half the time between samples.

    Args:
        machine: A built machine.
        cases: Cases, at least one.
        step: Step size; None for that of the machine. [s]

    Raises:
        InputError: a case is wrong.

    Example:
        >>> import wm_drake as wm
        >>> machine = wm.build_machine(wm.load_machine("reference"))
        >>> error = wm.step_error(machine, [wm.case_of(machine.parameters, "middle")])
        >>> error.difference < 1e-3
        True
    """
    step = checked_step(machine.parameters, step)
    integrator = checked_integrator(machine.parameters, None)
    runner = Runner(machine.parameters, ("amplitudes",), histories=False)
    errors = list[StepError]()
    for key, items in Preparation(machine, step, integrator).batches(cases):
        given = runner.run(key, items)
        halved = dict(_twice_as_fine(machine, runner, key, items))
        for index, run in enumerate(given):
            before, after = run.values["amplitude"], halved[index]
            difference = _difference(before, after)
            sizes = key.stepping.step, key.period
            errors.append(StepError(difference, run.case.name, *sizes, len(cases)))
    return max(errors, key=lambda error: error.difference)


def _twice_as_fine(
    machine: Machine, runner: Runner, key: BatchKey, items: Sequence[WorkItem]
) -> Iterator[tuple[int, FloatArray]]:
    """Yield number and amplitudes of each work item, run with half the step and half the period."""
    step, cases = 0.5 * key.stepping.step, _with_period(machine, 0.5 * key.period, items)
    try:
        batches = list(Preparation(machine, step, key.stepping.integrator).batches(cases))
    except InputError:  # this integrator does not suit so short a step
        batches = list(Preparation(machine, step, "runge_kutta").batches(cases))
    for halved, work_items in batches:
        for run in runner.run(halved, work_items):
            yield run.number, run.values["amplitude"]


def _with_period(machine: Machine, period: float, items: Sequence[WorkItem]) -> list[Case]:
    """Return the cases of work items with another time between samples."""
    given = [item.case.parameters or machine.parameters for item in items]
    # cases with the same parameters share what is packed of them
    finer = {id(one): one.model_copy(update={"output_period": period}) for one in given}
    return [
        replace(item.case, parameters=finer[id(one)])
        for item, one in zip(items, given, strict=True)
    ]


def _difference(before: FloatArray, after: FloatArray) -> float:
    """Return the largest difference of amplitudes, by the largest of them."""
    if not np.array_equal(np.isnan(before), np.isnan(after)):
        return float("inf")
    known = ~np.isnan(before)
    scale = float(np.max(before[known], initial=0.0))
    if scale == 0.0:
        return 0.0
    return float(np.max(np.abs(after[known] - before[known]))) / scale
