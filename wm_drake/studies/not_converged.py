"""Mark the answer of a study that rests on runs that are not converged."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.parameters.units import Share
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import STEP, Quantity
from wm_drake.simulation.convergence import StepSummary
from wm_drake.studies.answer import Answer, Part

SPREAD = Quantity("spread", Share(), 1)
"""Difference of the measures of a run from those with twice its step."""

MARK = "not converged"
"""Words beside the label of such a run in the rows of tables."""

MEANING = (
    "The measures of these runs still change with the step: their motion jumps or is chaotic, and "
    "has no one peak. The spread is the largest difference from the run with the step before; "
    "wherever this result uses such a run, its numbers are uncertain by as much."
)


def marked(answer: Answer, steps: StepSummary) -> Answer:
    """Return an answer that names and marks the runs that are not converged.

    It is unchanged if all are. Tables mark the rows whose label is the name of such a run.
    """
    runs = steps.unconverged
    if not runs:
        return answer
    largest = max(accuracy.error for _, accuracy in runs)
    spread = f", with a spread of up to {SPREAD.text(largest)}" if np.isfinite(largest) else ""
    words = (
        f"Not converged: {len(runs)} of {steps.runs} runs{spread}; what rests on them is uncertain."
    )
    data = xr.Dataset(
        {
            "case": ("run", [name for name, _ in runs]),
            "step": STEP.variable("run", [accuracy.step for _, accuracy in runs]),
            "spread": SPREAD.variable("run", [accuracy.error for _, accuracy in runs]),
        }
    )
    part = Part("Runs that are not converged", (LabelledTable("not_converged", data),), MEANING)
    names = dict.fromkeys(name for name, _ in runs)
    parts = (*(_with_marks(part, names) for part in answer.parts), part)
    return replace(answer, answer=f"{answer.answer} {words}", parts=parts)


def _with_marks(part: Part, names: Iterable[str]) -> Part:
    """Return a part whose tables mark the rows of the runs with these names."""
    shown = []
    for item in part.shown:
        if isinstance(item, LabelledTable):
            marks = {name: f"{item.words.get(name, name)} ({MARK})" for name in names}
            item = replace(item, words={**item.words, **marks})
        shown.append(item)
    return replace(part, shown=shown)
