"""Design experiments with factors at three levels, and analyse the variance of their responses.

Enters: names of factors and a model, or a design file; for `anova`, levels and responses. Leaves: a
`Design` with its D-efficiency, and an `AnovaTable` for each response.
May import: `parameters` (CSV files) and `errors`; it needs no machine.
"""

from wm_drake.studies.doe.coding import MODELS, efficiency, level_matrix, model_matrix, terms_of
from wm_drake.studies.doe.design import DESIGNS, Design, make_design, read_design, write_design
from wm_drake.studies.doe.exchange import d_optimal_levels
from wm_drake.studies.doe.orthogonal import orthogonal_levels

__all__ = [
    "DESIGNS",
    "MODELS",
    "Design",
    "d_optimal_levels",
    "efficiency",
    "level_matrix",
    "make_design",
    "model_matrix",
    "orthogonal_levels",
    "read_design",
    "terms_of",
    "write_design",
]
