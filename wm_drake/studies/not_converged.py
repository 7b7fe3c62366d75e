"""Mark the answer of a study that rests on runs that are not converged."""

from dataclasses import replace

import xarray as xr

from wm_drake.parameters.units import Share
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import STEP, Quantity
from wm_drake.simulation.convergence import StepSummary
from wm_drake.studies.answer import Answer, Part

SPREAD = Quantity("spread", Share(), 1)
"""Difference of the measures of a run from those with twice its step."""

MEANING = (
    "The measures of these runs still change with the step: their motion jumps or is chaotic, and "
    "has no one peak. The spread is the largest difference from the run with the step before; "
    "wherever this result uses such a run, its numbers are uncertain by as much."
)


def marked(answer: Answer, steps: StepSummary) -> Answer:
    """Return an answer that names the runs that are not converged; unchanged if all are."""
    runs = steps.unconverged
    if not runs:
        return answer
    spread = SPREAD.text(max(accuracy.error for _, accuracy in runs))
    words = (
        f"Not converged: {len(runs)} of {steps.runs} runs, with a spread of up to {spread}; what "
        "rests on them is uncertain."
    )
    data = xr.Dataset(
        {
            "case": ("run", [name for name, _ in runs]),
            "step": STEP.variable("run", [accuracy.step for _, accuracy in runs]),
            "spread": SPREAD.variable("run", [accuracy.error for _, accuracy in runs]),
        }
    )
    part = Part("Runs that are not converged", (LabelledTable("not_converged", data),), MEANING)
    return replace(answer, answer=f"{answer.answer} {words}", parts=(*answer.parts, part))
