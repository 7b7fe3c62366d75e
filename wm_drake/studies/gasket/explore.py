"""Data of the interactive part of the gasket page: the fitted models, for `explore.js`."""

from typing import Any

import numpy as np
from markupsafe import Markup

from wm_drake.report.interactive import packed
from wm_drake.report.page import as_json
from wm_drake.studies.gasket.screening import Label, Screening
from wm_drake.studies.gasket.study import GasketTrials
from wm_drake.studies.gasket.surface import Surfaces
from wm_drake.studies.gasket.words import Words


def explorer_data(
    screening: Screening, surfaces: Surfaces, trials: GasketTrials, words: Words
) -> Markup:
    """Return the fitted models with the words for factors and responses, as JSON."""
    values = screening.responses.values
    data: dict[str, Any] = {
        "factors": [
            {
                "name": factor.name,
                "title": words.factor(factor.name),
                "unit": words.unit(factor.name),
                "numbers": [float(v) for v in next(iter(factor.numbers.values()))],
            }
            for factor in trials.factors
        ],
        "loads": screening.loads,
        "responses": [
            {
                "name": name,
                "title": words.response(name),
                "unit": screening.responses.units[name],
                "goal": words.meaning(name).goal,
                "low": float(min(frame[name].min() for frame in values.values())),
                "high": float(max(frame[name].max() for frame in values.values())),
            }
            for name in screening.names
        ],
        "interactions": surfaces.interactions,
        "models": {
            load: {name: _model(screening, surfaces, (load, name)) for name in screening.names}
            for load in screening.loads
        },
        **_inverses(surfaces),
    }
    return as_json(data)


def _model(screening: Screening, surfaces: Surfaces, label: Label) -> dict[str, Any]:
    table = screening.tables[label]
    return {
        "coefficients": packed(surfaces.coefficients[label]),
        "spread": surfaces.quantiles[label] * surfaces.deviations[label],
        "r2": table.predicted_r2,
        "percents": {term.name: term.percent for term in table.terms if len(term.factors) == 2},
    }


def _inverses(surfaces: Surfaces) -> dict[str, Any]:
    """Return the different matrices (X' X)^-1, and which of them each load has."""
    different: list[np.ndarray] = []
    of_load = {}
    for load, inverse in surfaces.inverses.items():
        same = [i for i, other in enumerate(different) if other is inverse]
        of_load[load] = same[0] if same else len(different)
        if not same:
            different.append(inverse)
    return {"inverses": [packed(m.ravel()) for m in different], "inverse_of": of_load}
