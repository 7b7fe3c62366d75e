"""Machine of a solution, with the source of each number."""

import math

import numpy as np

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import from_base, to_base
from wm_drake.studies.calibration.solutions import Solution


def solved_machine(solution: Solution, number: int = 0) -> MachineParameters:
    """Return the machine of a solution.

    The source of each fitted number is "fit: " followed by the text of `fit_texts`, and
    "assumption: " followed by the known quantities that enter.

    Args:
        number: Number of the solution, for the name of the machine; 0 keeps the name.
    """
    parameter_map, all_texts = solution.parameter_map, fit_texts(solution)
    fits: dict[str, list[str]] = {}
    reasons: dict[str, list[str]] = {}
    for value in parameter_map.values:
        entering = np.flatnonzero(np.any(value.factors != 0.0, axis=1))
        texts = [all_texts[index] for index in entering]
        for listed, new in ((fits, texts), (reasons, value.reasons)):
            kept = listed.setdefault(value.key, [])
            kept.extend(text for text in new if text not in kept)
    parameters = parameter_map.parameters_at(_rounded(solution))
    fitted = {
        key: "; ".join(
            kind + "; ".join(listed[key])
            for kind, listed in (("fit: ", fits), ("assumption: ", reasons))
            if listed[key]
        )
        for key in fits
    }
    others = {
        key: text
        for key, text in parameters.sources.items()
        if not any(key.startswith(f"{k}.") for k in fitted)
    }
    name = f"{parameters.name}_calibrated_{number}" if number else parameters.name
    return parameters.model_copy(update={"name": name, "sources": {**others, **fitted}})


def fit_texts(solution: Solution) -> list[str]:
    """Return for each quantity ``damper_friction 27.5 ± 2.1 N (expected 35 ± 9 N)``."""
    parameter_map, texts = solution.parameter_map, []
    values = parameter_map.in_units(_rounded(solution))
    expected, deviation = map(parameter_map.in_units, parameter_map.prior)
    posterior = solution.posterior.spread() * deviation
    for index, (name, unit) in enumerate(
        zip(parameter_map.names, parameter_map.units, strict=True)
    ):
        after, before = (
            f"{n[index]:.10g} ± {_short(s[index])} {unit}".rstrip()
            for n, s in ((values, posterior), (expected, deviation))
        )
        texts.append(f"{name} {after} (expected {before})")
    return texts


def _rounded(solution: Solution) -> FloatArray:
    """Return the point of a solution, rounded to about 0.1 % of the prior's standard deviation.

    The rounding is decimal in the unit in which each quantity is written.
    """
    parameter_map, point = solution.parameter_map, []
    for index, unit in enumerate(parameter_map.units):
        value, deviation = (
            from_base(float(a[index]), unit) for a in (solution.point, parameter_map.deviation)
        )
        point.append(to_base(round(value, 3 - math.floor(math.log10(deviation))), unit))
    return np.clip(point, parameter_map.lower, parameter_map.upper)


def _short(number: float) -> str:
    return f"{number:.0f}" if abs(number) >= 100.0 else f"{number:.2g}"
