"""Identify the numbers of a component from measured loops: the rig is the model."""

from wm_drake.studies.identification.fragment import fragment
from wm_drake.studies.identification.judgement import Judgement, LoopJudgement, judge
from wm_drake.studies.identification.models import (
    BUSHING_LAWS,
    ComponentModel,
    bushing_model,
    damper_model,
)
from wm_drake.studies.identification.problem import fit_problem

__all__ = [
    "BUSHING_LAWS",
    "ComponentModel",
    "Judgement",
    "LoopJudgement",
    "bushing_model",
    "damper_model",
    "fit_problem",
    "fragment",
    "judge",
]
