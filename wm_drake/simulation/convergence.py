"""Whether the step of a run was short enough: a run is accepted, or repeated with a shorter step.

This is the one rule of all runs of the compiled engine; the Drake engine controls its error itself.
The error of a run is estimated while it is integrated (`wm_drake.engines.compiled.local_error`). If
the estimate is above the accuracy that the machine file demands, the run is repeated. It is
accepted when its estimate holds, or when its measures differ from those of the run before it by no
more than the accuracy. A run whose measures still differ after `MOST_HALVINGS` is not converged,
and this difference is its spread: friction that jumps, or a motion that is chaotic. The rule sees
one run only, so that its result depends neither on other runs nor on their number.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from wm_drake.engines.trajectory import Estimates
from wm_drake.parameters.spin import SAMPLES_OF_TURN
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures.registry import MEASURES

MOST_HALVINGS = 5
"""How often the step of a run is halved at most."""

MOST_AT_ONCE = 3
"""How often it is halved at most before the next run."""

FALLS_BY = 4.0
"""By how much the estimate falls at least where the step is halved, as of corners of a force."""

LARGEST_LOSS = 2.0 * (1.0 - math.cos(math.pi / SAMPLES_OF_TURN))
"""Part of the largest acceleration that may lie between samples: 1.1 %, twice that of order one,
because an acceleration has orders above one. Displacements then lose less than 0.5 %."""

SMALLEST_PART = 0.1
"""Smallest size by which a difference is divided, by the largest number of its variable; of
lengths, by the largest displacement of the run."""

COMPARED = ("extremes", "amplitudes")
"""Measures that are compared of runs without other ones."""

ACCURACY = "accuracy"
"""Name of the `Accuracy` of a run among its values."""

STEP, PERCENT = Unit("s", "ms"), Unit("", "%")


class Accuracy(NamedTuple):
    """How accurate a run is, and how it was stepped.

    Attributes:
        error: Error that remains, relative: the estimate, or the difference of the measures from
            those with a longer step. Of a run that is not converged, its spread.
        is_converged: Whether the error holds the demanded accuracy, 1 or 0.
        step: Step size. [s]
        halvings: How often it was halved.
    """

    error: float
    is_converged: float
    step: float
    halvings: float

    @property
    def text(self) -> str:
        """Return the error in words."""
        if self.error == math.inf:
            return "not converged: with a longer step it diverges"
        percent = f"{PERCENT.from_si(self.error):.2g} %"
        if self.is_converged:
            return f"error of up to {percent}"
        return f"not converged: its measures differ by {percent} from those with a longer step"


def attributes_of(accuracy: Accuracy) -> dict[str, Any]:
    """Return the attributes of a record that say how accurate its run is."""
    is_converged = "yes" if accuracy.is_converged else "no"
    how = {"step_s": accuracy.step, "error": accuracy.error, "halvings": accuracy.halvings}
    return how | {"converged": is_converged}


def accuracy_in(attributes: Mapping[str, Any]) -> Accuracy | None:
    """Return the accuracy in the attributes of a record; None if it has none."""
    if "converged" not in attributes:
        return None
    is_converged = float(attributes["converged"] == "yes")
    error, step, halvings = (float(attributes[key]) for key in ("error", "step_s", "halvings"))
    return Accuracy(error, is_converged, step, halvings)


@dataclass(frozen=True)
class Attempt:
    """A run with some step, as the rule sees it.

    Attributes:
        estimates: Its estimated errors.
        step: Step size. [s]
        halvings: How often the step was halved before.
        diverged: When and why it stopped early; "" if it did not.
        values: Measures by the names of their variables; needed if the estimates do not hold.
        size: Largest displacement. [m]
    """

    estimates: Estimates
    step: float
    halvings: int = 0
    diverged: str = ""
    values: Mapping[str, FloatArray] = field(default_factory=dict)
    size: float = 0.0

    def holds(self, accuracy: float) -> bool:
        """Return whether its estimates hold an accuracy; all do at 100 %."""
        return accuracy >= 1.0 or (
            self.estimates.steps <= accuracy
            and self.estimates.samples <= LARGEST_LOSS
            and not self.diverged
        )


@dataclass(frozen=True)
class Refinement:
    """How the next run differs: how often step and time between samples are halved."""

    step: int
    period: int


def judged(
    run: Attempt, before: Attempt | None, accuracy: float
) -> tuple[Accuracy, Refinement | None]:
    """Return how accurate a run is, and how it must be repeated; None if it need not be.

    Args:
        run: The run.
        before: The same with a longer step; None for the first one.
        accuracy: Largest relative error that the machine file allows.
    """
    error = run.estimates.steps
    if before is not None:
        apart = difference(before, run)
        error = min(error, apart) if run.holds(accuracy) else apart
    holds = run.holds(accuracy) or (before is not None and error <= accuracy)
    left = MOST_HALVINGS - run.halvings
    accuracy_of_run = Accuracy(error, float(holds), run.step, float(run.halvings))
    if holds or not left:
        return accuracy_of_run, None
    halvings = MOST_AT_ONCE
    if not run.diverged:
        ratio = max(run.estimates.steps / accuracy, 1.0)
        halvings = max(math.ceil(math.log(ratio, FALLS_BY) - 0.5), 1)
    halvings = min(halvings, MOST_AT_ONCE, left)
    # a motion that is rough for its steps has peaks of force between its samples, too
    return accuracy_of_run, Refinement(halvings, math.ceil(halvings / 2))


def difference(before: Attempt, run: Attempt) -> float:
    """Return the largest relative difference of the measures of two runs of a case.

    Only numbers that can get better or worse are compared: a critical speed or a number of hits
    follows from the same motion and may jump. Infinite if only one of the runs has a number.
    """
    if before.diverged or run.diverged:
        return 0.0 if before.diverged and run.diverged else math.inf
    largest = 0.0
    for variable in (v for measure in MEASURES.values() for v in measure.variables):
        if variable.name not in run.values or not variable.better or not variable.unit.si:
            continue
        old, new = np.asarray(before.values[variable.name]), np.asarray(run.values[variable.name])
        known = ~np.isnan(new)
        if not np.array_equal(known, ~np.isnan(old)):
            return math.inf
        if not known.any():
            continue
        floor = SMALLEST_PART * np.abs(new[known]).max()
        if variable.unit.si == "m":
            floor = max(floor, SMALLEST_PART * run.size)
        sizes = np.maximum(np.abs(new[known]), floor)
        apart = np.abs(new[known] - old[known])
        largest = max(largest, float(np.max(apart[sizes > 0.0] / sizes[sizes > 0.0], initial=0.0)))
    return largest


class StepSummary:
    """Steps and errors of all runs of a study.

    Attributes:
        runs: Number of runs.
        unconverged: Names and accuracies of the runs that are not converged.
    """

    def __init__(self) -> None:
        """Begin without runs."""
        self.runs = 0
        self.unconverged: list[tuple[str, Accuracy]] = []
        self._steps: set[float] = set()
        self._repeated, self._error = 0, 0.0

    def add(self, name: str, accuracy: Iterable[float] | None) -> None:
        """Add the run of a case, if its accuracy is known."""
        if accuracy is None or np.isnan(accuracy := tuple(accuracy)).all():
            return
        of_run = Accuracy(*map(float, accuracy))
        self.runs += 1
        self._steps.add(of_run.step)
        self._repeated += of_run.halvings > 0
        if of_run.is_converged:
            self._error = max(self._error, of_run.error)
        else:
            self.unconverged.append((name, of_run))

    def add_table(self, table: xr.Dataset) -> None:
        """Add the runs of a table of `simulate_many`."""
        accuracies = zip(*(table[name].values for name in Accuracy._fields), strict=True)
        for name, accuracy in zip(table.case.values.tolist(), accuracies, strict=True):
            self.add(name, accuracy)

    @property
    def text(self) -> str:
        """Return steps taken and the error that remains, in a sentence; "" without runs."""
        if not self.runs:
            return ""
        ends = [f"{STEP.from_si(step):.4g}" for step in (min(self._steps), max(self._steps))]
        steps = " to ".join(dict.fromkeys(ends))
        repeated = f"; {self._repeated} of {self.runs} runs were repeated" if self._repeated else ""
        percent = f"{PERCENT.from_si(self._error):.2g} %"
        return f"{steps} ms{repeated}; an error of up to {percent} remains"

    @property
    def warning(self) -> str:
        """Return which runs are not converged; "" if all are."""
        if not self.unconverged:
            return ""
        name, worst = max(self.unconverged, key=lambda pair: pair[1].error)
        return (
            f"{len(self.unconverged)} of {self.runs} runs are not converged, with steps down to "
            f"{STEP.from_si(worst.step):.3g} ms; '{name}' is {worst.text}. Their motion jumps or "
            "is chaotic, and has no one peak"
        )
