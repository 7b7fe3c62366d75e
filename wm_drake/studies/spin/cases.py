"""Labels and speeds of the cases of a spin run, for its tables, figures and text."""

import numpy as np

from wm_drake.parameters import Sensor
from wm_drake.report.formatting import RPM_PER_RAD_S
from wm_drake.simulation.displacements import band_of
from wm_drake.studies.spin.study import CaseResult, SpinResult


def has_gasket(result: CaseResult) -> bool:
    """Return whether a case was run with the gasket."""
    return bool(result.record.attrs["gasket"] == "yes")


def case_title(result: CaseResult) -> str:
    """Return the title of a case: its load, with or without gasket."""
    return f"{result.case.name} ({'with' if has_gasket(result) else 'without'} gasket)"


def band_text(*cases: CaseResult) -> str:
    """Return the pass band of the displacements of cases as text; of different ones, all."""
    bands = dict.fromkeys(band_of(case.record) for case in cases)
    return ", ".join(f"{low:g}–{high:.3g} Hz" for low, high in bands)


def speed_rpm(result: CaseResult, time: float) -> float:
    """Return the drum speed at a time of a case. [rpm]"""
    record = result.record
    return float(np.interp(time, record.time.values, record.drum_speed.values)) * RPM_PER_RAD_S


def sensors_of(result: SpinResult, case: CaseResult) -> dict[str, Sensor]:
    """Return the displacement sensors of the machine that a case was run with."""
    return (case.case.parameters or result.parameters).sensors
