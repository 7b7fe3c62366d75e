"""Designs of experiments for factors at three levels: which trials to run, and how well they tell effects apart."""

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
