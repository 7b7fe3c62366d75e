"""From measured loops to the numbers of a component: the rig as the model of an identification."""

from wm_drake.studies.identification.fragment import fragment
from wm_drake.studies.identification.models import (
    BUSHING_LAWS,
    DAMPER_LAWS,
    ComponentModel,
    bushing_model,
    damper_model,
)
from wm_drake.studies.identification.problem import fit_problem

__all__ = [
    "BUSHING_LAWS",
    "DAMPER_LAWS",
    "ComponentModel",
    "bushing_model",
    "damper_model",
    "fit_problem",
    "fragment",
]
