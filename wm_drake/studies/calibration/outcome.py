"""A solution as a machine with the source of each number, and as tables."""

import math

import numpy as np
import pandas as pd

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.units import from_base, to_base
from wm_drake.studies.calibration.calibration import Calibration
from wm_drake.studies.calibration.parameter_map import ParameterMap
from wm_drake.studies.calibration.solutions import AT_BOUND, DETERMINED, UNDETERMINED, Solution
from wm_drake.studies.calibration.targets import EXPERIMENT, MILLIMETRE


def solved_machine(turning: ParameterMap, solution: Solution) -> MachineParameters:
    """The machine of a solution; the source of each fitted number says fit, its standard deviation, and what was expected."""
    spread = solution.spread()
    sources: dict[str, list[str]] = {}
    for value in turning.values:
        entering = np.flatnonzero(np.any(value.factors != 0.0, axis=1))
        texts = sources.setdefault(".".join(value.path), [])
        texts.extend(
            text
            for index in entering
            if (text := fit_text(turning, solution, spread, int(index))) not in texts
        )
    parameters = turning.parameters_at(_rounded(turning, solution))
    fitted = {key: "fit: " + "; ".join(texts) for key, texts in sources.items()}
    kept = {
        key: text
        for key, text in parameters.sources.items()
        if not any(key.startswith(f"{k}.") for k in fitted)
    }
    return parameters.model_copy(update={"sources": {**kept, **fitted}})


def _rounded(turning: ParameterMap, solution: Solution) -> np.ndarray:
    """The point in as many digits of its written units as mean anything: a thousandth of what was expected to vary."""
    point = []
    for index, unit in enumerate(turning.units):
        value, deviation = (
            from_base(float(a[index]), unit) for a in (solution.point, turning.deviation)
        )
        point.append(to_base(round(value, 3 - math.floor(math.log10(deviation))), unit))
    return np.clip(point, turning.lower, turning.upper)


def _short(number: float) -> str:
    return f"{number:.0f}" if abs(number) >= 100.0 else f"{number:.2g}"


def fit_text(turning: ParameterMap, solution: Solution, spread: np.ndarray, index: int) -> str:
    """``damper_friction 27.5 +- 2.1 N (expected 35 +- 9 N)``."""
    unit = turning.units[index]
    expected, deviation = (
        from_base(float(a[index]), unit) for a in (turning.expected, turning.deviation)
    )
    value, sure = (
        from_base(float(_rounded(turning, solution)[index]), unit),
        float(spread[index]) * deviation,
    )
    after, before = (
        f"{n:.10g} ± {_short(s)} {unit}".rstrip() for n, s in ((value, sure), (expected, deviation))
    )
    return f"{turning.names[index]} {after} (expected {before})"


def verdict(turning: ParameterMap, solution: Solution, spread: np.ndarray, index: int) -> str:
    """What holds a quantity where it is: the data, the prior, both, or a bound."""
    reach = turning.upper[index] - turning.lower[index]
    nearest = min(
        solution.point[index] - turning.lower[index], turning.upper[index] - solution.point[index]
    )
    if nearest < AT_BOUND * reach:
        return "bound"
    if spread[index] < DETERMINED:
        return "data"
    return "prior" if spread[index] > UNDETERMINED else "data and prior"


def mean_and_largest(errors: np.ndarray) -> tuple[float, float]:
    """Of the absolute values of relative errors, without those that are NaN."""
    return float(np.nanmean(np.abs(errors))), float(np.nanmax(np.abs(errors)))


def quantity_table(calibration: Calibration) -> pd.DataFrame:
    """Every free quantity in its unit: bounds, prior, and for each solution value, standard deviation and what holds it."""
    turning = calibration.turning
    rows = []
    known = {
        "lower": turning.lower,
        "upper": turning.upper,
        "expected": turning.expected,
        "deviation": turning.deviation,
    }
    spreads = [solution.spread() for solution in calibration.solutions]
    for index, (name, unit) in enumerate(zip(turning.names, turning.units, strict=True)):
        row: dict[str, object] = {"quantity": name, "unit": unit}
        for head, array in known.items():
            row[head] = from_base(float(array[index]), unit)
        for number, (solution, spread) in enumerate(
            zip(calibration.solutions, spreads, strict=True), start=1
        ):
            row[f"value_{number}"] = from_base(float(solution.point[index]), unit)
            row[f"deviation_{number}"] = float(spread[index]) * float(str(row["deviation"]))
            row[f"held_by_{number}"] = verdict(turning, solution, spread, index)
        rows.append(row)
    return pd.DataFrame(rows)


def amplitude_rows(calibration: Calibration) -> pd.DataFrame:
    """Measured amplitudes and those of every solution, in the form of a file of measured amplitudes. [mm]"""
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
