"""Results of a calibration as a machine with the source of each number, and as tables."""

import math

import numpy as np
import pandas as pd

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.measured import DESIGN, MACHINE
from wm_drake.parameters.units import from_base, to_base
from wm_drake.studies.calibration.calibration import Calibration
from wm_drake.studies.calibration.parameter_map import ParameterMap
from wm_drake.studies.calibration.solutions import Solution
from wm_drake.studies.calibration.targets import EXPERIMENT, MILLIMETRE, Targets
from wm_drake.studies.fitting.posterior import AT_BOUND, DETERMINED, UNDETERMINED


def solved_machine(
    parameter_map: ParameterMap, solution: Solution, number: int = 0
) -> MachineParameters:
    """Return the machine of a solution.

    The source of each fitted number is "fit: " followed by the text of `fit_text`, and
    "assumption: " followed by the known quantities that enter.

    Args:
        parameter_map: Map of the calibration.
        solution: The solution.
        number: Number of the solution, for the name of the machine; 0 keeps the name.
    """
    spread = solution.posterior.spread()
    fits: dict[str, list[str]] = {}
    reasons: dict[str, list[str]] = {}
    for value in parameter_map.values:
        key = value.key
        entering = np.flatnonzero(np.any(value.factors != 0.0, axis=1))
        texts = (fit_text(parameter_map, solution, spread, int(index)) for index in entering)
        for listed, new in ((fits, texts), (reasons, value.reasons)):
            kept = listed.setdefault(key, [])
            kept.extend(text for text in new if text not in kept)
    parameters = parameter_map.parameters_at(_rounded(parameter_map, solution))
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


def _rounded(parameter_map: ParameterMap, solution: Solution) -> np.ndarray:
    """Return the point of a solution, rounded to about 0.1 % of the prior's standard deviation.

    The rounding is decimal in the unit in which each quantity is written.
    """
    point = []
    for index, unit in enumerate(parameter_map.units):
        value, deviation = (
            from_base(float(a[index]), unit) for a in (solution.point, parameter_map.deviation)
        )
        point.append(to_base(round(value, 3 - math.floor(math.log10(deviation))), unit))
    return np.clip(point, parameter_map.lower, parameter_map.upper)


def _short(number: float) -> str:
    return f"{number:.0f}" if abs(number) >= 100.0 else f"{number:.2g}"


def values_beyond(solution: Solution, targets: Targets) -> list[str]:
    """Return a text for each value beyond its limit, such as ``middle Xf +23 % (20 %)``."""
    loads = [f"{name}{'' if gasket else ' without gasket'}" for name, gasket in targets.loads]
    names = [f"{load} {sensor}" for load in loads for sensor in targets.sensors]
    names += [f"{target.load} {target.response.name}" for target in targets.responses]
    errors = [solution.errors(targets).ravel(), solution.response_errors(targets)]
    used = [(name, e) for name, e in zip(names, np.concatenate(errors), strict=True) if e == e]
    return [
        f"{name} {100.0 * error:+.0f} % ({100.0 * limit:g} %)"
        for (name, error), limit in zip(used, targets.limit_of_each(), strict=True)
        if abs(error) > limit
    ]


def fit_text(
    parameter_map: ParameterMap, solution: Solution, spread: np.ndarray, index: int
) -> str:
    """Return a text such as ``damper_friction 27.5 ± 2.1 N (expected 35 ± 9 N)``.

    Args:
        parameter_map: Map with names, units and priors of the quantities.
        solution: Solution with the value.
        spread: Standard deviation of each quantity given the data, in prior deviations.
        index: Index of the quantity.
    """
    unit = parameter_map.units[index]
    expected, deviation = (
        from_base(float(a[index]), unit) for a in (parameter_map.expected, parameter_map.deviation)
    )
    value = from_base(float(_rounded(parameter_map, solution)[index]), unit)
    posterior = float(spread[index]) * deviation
    after, before = (
        f"{n:.10g} ± {_short(s)} {unit}".rstrip()
        for n, s in ((value, posterior), (expected, deviation))
    )
    return f"{parameter_map.names[index]} {after} (expected {before})"


def verdict(parameter_map: ParameterMap, solution: Solution, spread: np.ndarray, index: int) -> str:
    """Return what determines a quantity: "data", "prior", "data and prior" or "bound".

    Args:
        parameter_map: Map with the bounds of the quantities.
        solution: Solution with the value.
        spread: Standard deviation of each quantity given the data, in prior deviations.
        index: Index of the quantity.
    """
    width = parameter_map.upper[index] - parameter_map.lower[index]
    nearest = min(
        solution.point[index] - parameter_map.lower[index],
        parameter_map.upper[index] - solution.point[index],
    )
    if nearest < AT_BOUND * width:
        return "bound"
    if spread[index] < DETERMINED:
        return "data"
    return "prior" if spread[index] > UNDETERMINED else "data and prior"


def mean_and_largest(errors: np.ndarray) -> tuple[float, float]:
    """Return mean and largest absolute value of relative errors; NaN values are ignored."""
    return float(np.nanmean(np.abs(errors))), float(np.nanmax(np.abs(errors)))


def quantity_table(calibration: Calibration) -> pd.DataFrame:
    """Return a table of the free quantities, each in its unit.

    It has bounds and prior, and for each solution the value, its standard deviation and what
    determines it (see `verdict`).
    """
    parameter_map = calibration.parameter_map
    rows = []
    known = {
        "lower": parameter_map.lower,
        "upper": parameter_map.upper,
        "expected": parameter_map.expected,
        "deviation": parameter_map.deviation,
    }
    spreads = [solution.posterior.spread() for solution in calibration.solutions]
    for index, (name, unit) in enumerate(
        zip(parameter_map.names, parameter_map.units, strict=True)
    ):
        row: dict[str, object] = {"quantity": name, "unit": unit}
        for head, array in known.items():
            row[head] = from_base(float(array[index]), unit)
        for number, (solution, spread) in enumerate(
            zip(calibration.solutions, spreads, strict=True), start=1
        ):
            row[f"value_{number}"] = from_base(float(solution.point[index]), unit)
            row[f"deviation_{number}"] = float(spread[index]) * float(str(row["deviation"]))
            row[f"held_by_{number}"] = verdict(parameter_map, solution, spread, index)
        rows.append(row)
    return pd.DataFrame(rows)


def amplitude_rows(calibration: Calibration) -> pd.DataFrame:
    """Return measured amplitudes and those of each solution as one table of amplitudes. [mm]"""
    targets = calibration.targets
    rows = []
    for index, (load, gasket) in enumerate(targets.loads):
        sources = [(EXPERIMENT, targets.amplitude[index])]
        sources += [
            (f"solution {n}", solution.amplitude[index])
            for n, solution in enumerate(calibration.solutions, start=1)
        ]
        for source, values in sources:
            amplitudes = {
                name: MILLIMETRE.from_si(float(v))
                for name, v in zip(targets.sensors, values, strict=True)
            }
            rows.append(
                {"load": load, "gasket": "yes" if gasket else "no", "source": source, **amplitudes}
            )
    return pd.DataFrame(rows)


def response_table(calibration: Calibration) -> pd.DataFrame:
    """Return the targets that are no amplitudes, and those responses of each solution.

    Columns: load, gasket (yes, no), of (machine, design), response, unit, target, deviation in
    percent, and one for each solution.
    """
    rows = []
    for index, target in enumerate(calibration.targets.responses):
        row: dict[str, object] = {
            "load": target.load,
            "gasket": "yes" if target.gasket else "no",
            "of": DESIGN if target.of_design else MACHINE,
            "response": target.response.name,
            "unit": target.response.unit_text,
            "target": target.value,
            "deviation_percent": 100.0 * target.deviation,
        }
        for number, solution in enumerate(calibration.solutions, start=1):
            row[f"solution_{number}"] = float(solution.responses[index])
        rows.append(row)
    return pd.DataFrame(rows)
