"""Solutions of a calibration: errors, uncertainties, distinct solutions, and their machines."""

import math
from dataclasses import dataclass

import numpy as np

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share, from_base, to_base
from wm_drake.report.quantity import Quantity
from wm_drake.studies.calibrate.parameter_map import ParameterMap
from wm_drake.studies.calibrate.targets import Targets
from wm_drake.studies.fitting.fit import DETERMINED, UNDETERMINED, Fit
from wm_drake.studies.fitting.problem import Unknown

GOOD = 1.25
"""Largest ratio of the mean error of a good solution to that of the best solution."""

DISTINCT = 0.5
"""Least distance between distinct solutions: RMS over the quantities, in prior deviations."""


@dataclass(frozen=True)
class FreeQuantities:
    """Quantities of a vary file as the unknowns of a fit to recordings."""

    parameter_map: ParameterMap

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Return the unknowns."""
        return self.parameter_map.unknowns

    def parameters_at(self, point: FloatArray) -> MachineParameters:
        """Return the machine at a point. [SI]"""
        return self.parameter_map.parameters_at(point)

    def known(self, points: FloatArray) -> FloatArray:
        """Return the residuals of relations at points (k, p), in standard deviations. (k, m)"""
        return self.parameter_map.relation_residuals(points)

    def solved(self, fit: Fit, source: str) -> MachineParameters:
        """Return the machine with the quantities of a fit, as `machine_of`."""
        machine = machine_of(self.parameter_map, fit, "_calibrated")
        about = f"{machine.about} Calibrated: {source}.".strip()
        return machine.model_copy(update={"about": about})


DIFFERENCE = Quantity("difference", Share(), 1)
BEYOND = Quantity("difference", Share(), form="{:+.0f}".format)
LIMIT = Quantity("limit", Share(), form="{:g}".format)
COST = Quantity("cost", decimals=1)
VALUE = Quantity("value")
"""Value of a free quantity, in its own unit."""


def sizes_of(errors: FloatArray) -> tuple[float, float]:
    """Return mean and largest absolute value of errors; NaN values are ignored, NaN of none."""
    if not errors.size:
        return np.nan, np.nan
    sizes = np.abs(errors)
    return float(np.nanmean(sizes)), float(np.nanmax(sizes))


def sizes_text(errors: FloatArray) -> str:
    """Return mean and largest absolute value of relative errors as words."""
    mean, largest = map(DIFFERENCE.text, sizes_of(errors))
    return f"mean {mean}, largest {largest}"


@dataclass(frozen=True)
class Solution:
    """The end point of a search.

    Attributes:
        parameter_map: Map from the free quantities to the machine.
        targets: Targets of the search.
        fit: Fit of the free quantities, at the end of the search.
        amplitude: (case, sensor) computed amplitudes. [m]
        responses: (response) other computed responses. [unit for reading]
        data_cost, prior_cost: Half the sums of squares of data and prior.
    """

    parameter_map: ParameterMap
    targets: Targets
    start: int
    fit: Fit
    amplitude: FloatArray
    responses: FloatArray
    data_cost: float
    prior_cost: float

    @property
    def point(self) -> FloatArray:
        """Return the values of the free quantities (n). [SI]"""
        return self.fit.values

    @property
    def cost(self) -> float:
        """Return the cost that the search minimizes: the sum of data cost and prior cost."""
        return self.data_cost + self.prior_cost

    @property
    def coordinates(self) -> FloatArray:
        """Point in units of the prior: (quantity - expected) / deviation. (n)"""
        return self.fit.linear.point

    @property
    def errors(self) -> FloatArray:
        """(computed - measured) / measured (case, sensor); NaN where the weight is 0."""
        return self.targets.errors(self.amplitude)

    @property
    def response_errors(self) -> FloatArray:
        """(computed - target) / target (response); NaN where the weight is 0."""
        return self.targets.response_errors(self.responses)

    def verdicts(self) -> list[str]:
        """Return what determines each quantity: "data", "prior", "data and prior" or "bound"."""
        at_bound = np.array([estimate.at_bound != "" for estimate in self.fit.estimates])
        spread = self.fit.remaining
        cases = [at_bound, spread < DETERMINED, spread > UNDETERMINED]
        return list(map(str, np.select(cases, ["bound", "data", "prior"], "data and prior")))

    def values_beyond(self) -> list[str]:
        """Return a text for each value beyond its limit, such as ``middle Xf +23 % (20 %)``."""
        targets = self.targets
        loads = [f"{name}{'' if gasket else ' without gasket'}" for name, gasket in targets.loads]
        names = [f"{load} {sensor}" for load in loads for sensor in targets.sensors]
        names += [
            f"{t.load} {t.response.name}{f' {t.of}' if t.is_linear else ''}"
            for t in targets.responses
        ]
        errors = np.concatenate([self.errors.ravel(), self.response_errors])
        used = [(name, e) for name, e in zip(names, errors, strict=True) if e == e]
        return [
            f"{name} {BEYOND.text(error)} ({LIMIT.text(limit)})"
            for (name, error), limit in zip(used, targets.limit_of_each(), strict=True)
            if abs(error) > limit
        ]


def distinct(solutions: list[Solution]) -> list[Solution]:
    """Return the good solutions, best first, without those that are close to a better one."""
    ordered = sorted(solutions, key=lambda solution: solution.cost)
    limit = GOOD * sizes_of(ordered[0].errors)[0]
    kept: list[Solution] = []
    for solution in ordered:
        far = all(
            np.sqrt(np.mean((solution.coordinates - other.coordinates) ** 2)) > DISTINCT
            for other in kept
        )
        if far and sizes_of(solution.errors)[0] <= limit:
            kept.append(solution)
    return kept


def solved_machine(solution: Solution, number: int = 0) -> MachineParameters:
    """Return the machine of a solution.

    Args:
        number: Number of the solution, for the name of the machine; 0 keeps the name.
    """
    ending = f"_calibrated_{number}" if number else ""
    return machine_of(solution.parameter_map, solution.fit, ending)


def machine_of(parameter_map: ParameterMap, fit: Fit, ending: str = "") -> MachineParameters:
    """Return the machine with the quantities of a fit.

    The source of each fitted number is "fit: " followed by the text of `fit_texts`, and
    "assumption: " followed by the known quantities that enter.

    Args:
        fit: Fit whose first unknowns are the quantities.
        ending: End of the name of the machine.
    """
    all_texts = fit_texts(parameter_map, fit)
    fits: dict[str, list[str]] = {}
    reasons: dict[str, list[str]] = {}
    for key, entering, known in parameter_map.varying.origins():
        texts = [all_texts[index] for index in entering]
        for listed, new in ((fits, texts), (reasons, known)):
            kept = listed.setdefault(key, [])
            kept.extend(text for text in new if text not in kept)
    parameters = parameter_map.parameters_at(_rounded(parameter_map, fit))
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
    name = f"{parameters.name}{ending}"
    return parameters.model_copy(update={"name": name, "sources": {**others, **fitted}})


def fit_texts(parameter_map: ParameterMap, fit: Fit) -> list[str]:
    """Return for each quantity ``damper_friction 27.5 ± 2.1 N (expected 35 ± 9 N)``."""
    texts = []
    values = parameter_map.in_units(_rounded(parameter_map, fit))
    expected, deviation = map(
        parameter_map.in_units, (parameter_map.expected, parameter_map.deviation)
    )
    posterior = fit.remaining[: len(deviation)] * deviation
    for index, unknown in enumerate(parameter_map.unknowns):
        after, before = (
            f"{n[index]:.10g} ± {_short(s[index])} {unknown.unit.shown}".rstrip()
            for n, s in ((values, posterior), (expected, deviation))
        )
        texts.append(f"{unknown.name} {after} (expected {before})")
    return texts


def _rounded(parameter_map: ParameterMap, fit: Fit) -> FloatArray:
    """Return the point of a fit, rounded to about 0.1 % of the prior's standard deviation.

    The rounding is decimal in the unit in which each quantity is written.
    """
    point = []
    for index, unknown in enumerate(parameter_map.unknowns):
        unit = unknown.unit.shown
        value, deviation = (
            from_base(float(a[index]), unit) for a in (fit.values, parameter_map.deviation)
        )
        point.append(to_base(round(value, 3 - math.floor(math.log10(deviation))), unit))
    return np.clip(point, parameter_map.lower, parameter_map.upper)


def _short(number: float) -> str:
    return f"{number:.0f}" if abs(number) >= 100.0 else f"{number:.2g}"
