"""Identify the numbers of a component from measured loops: the rig is the model."""

from wm_drake.studies.identification.comparison import (
    Comparison,
    LawResult,
    check_blind,
    compare_laws,
    fit_law,
)
from wm_drake.studies.identification.fragment import (
    fragment,
    missing_numbers,
    table_entry,
    written_fragment,
)
from wm_drake.studies.identification.judgement import Judgement, LoopJudgement, judge
from wm_drake.studies.identification.models import (
    BUSHING_LAWS,
    ComponentModel,
    bushing_model,
    damper_model,
    fields_of_law,
)
from wm_drake.studies.identification.problem import fit_problem
from wm_drake.studies.identification.static import StaticCurve, static_curve

__all__ = [
    "BUSHING_LAWS",
    "Comparison",
    "ComponentModel",
    "Judgement",
    "LawResult",
    "LoopJudgement",
    "StaticCurve",
    "bushing_model",
    "check_blind",
    "compare_laws",
    "damper_model",
    "fields_of_law",
    "fit_law",
    "fit_problem",
    "fragment",
    "judge",
    "missing_numbers",
    "static_curve",
    "table_entry",
    "written_fragment",
]
