"""How numbers and names are written on a page: millimetres, rpm, rounded, with a true minus sign."""

import math

import numpy as np

from wm_drake.parameters.units import Unit
from wm_drake.studies.spin.study import CaseResult

MM_PER_M = Unit("m", "mm").from_si(1.0)
RPM_PER_RAD_S = Unit("rad/s", "rpm").from_si(1.0)

MISSING = "–"
"""Stands where there is no number."""


def number(value: float, decimals: int = 1) -> str:
    """A number rounded for reading; NaN is a dash."""
    if not math.isfinite(value):
        return MISSING
    rounded = round(float(value), decimals) + 0.0  # -0.0 + 0.0 is 0.0
    return f"{rounded:.{decimals}f}".replace("-", "−")


def percent(value: float) -> str:
    """A difference in whole percent, with its sign; NaN is a dash."""
    if not math.isfinite(value):
        return MISSING
    text = number(value, 0)
    return f"+{text} %" if round(value) > 0 else f"{text} %"


def shape_name(name: str) -> str:
    """The name of a shape in the SDF, as words."""
    return name.replace("_", " ")


def has_gasket(result: CaseResult) -> bool:
    """Whether the case ran with its gasket."""
    return bool(result.record.attrs["gasket"] == "yes")


def case_title(result: CaseResult) -> str:
    """Load and gasket of a case."""
    return f"{result.case.name} ({'with' if has_gasket(result) else 'without'} gasket)"


def speed_rpm(result: CaseResult, time: float) -> float:
    """Drum speed at a time of a case. [rpm]"""
    record = result.record
    return float(np.interp(time, record.time.values, record.drum_speed.values)) * RPM_PER_RAD_S
