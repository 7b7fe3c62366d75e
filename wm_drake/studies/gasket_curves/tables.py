"""Tables of the curves of a gasket: CSV files and plain data for JSON."""

from typing import Any

import numpy as np
import pandas as pd

from wm_drake.report.formatting import MPA_PER_PA, plain
from wm_drake.solid.curves import AXIAL, RADIAL, TILT, TWIST, Motion
from wm_drake.studies.gasket_curves.machine import coupling
from wm_drake.studies.gasket_curves.study import CurvesResult
from wm_drake.studies.rig.units import units_of

AXES: dict[str, tuple[Motion, str]] = {
    "x": (RADIAL, ""),
    "y": (AXIAL, ""),
    "z": (RADIAL, ""),
    "about_x": (TILT, "rotational_"),
    "about_y": (TWIST, "rotational_"),
    "about_z": (TILT, "rotational_"),
}
"""Motion of each axis of a bushing, and the beginning of its keys in a machine file."""


def curves_table(result: CurvesResult) -> pd.DataFrame:
    """Return each point: force on the moved rim along its motion, along the others, energy, work.

    The motions are those of x (radial), y (axial), about y (twist) and about z (tilt).
    """
    frames = []
    for name, checked in result.curves.items():
        curve = checked.curve
        unit = units_of(curve.motion.rotates)
        frame = pd.DataFrame(
            {
                "curve": name,
                "value": unit.factor * curve.values,
                "unit": unit.unit,
                "force_x_N": curve.wrench(RADIAL.component),
                "force_y_N": curve.wrench(AXIAL.component),
                "moment_y_Nm": curve.wrench(TWIST.component),
                "moment_z_Nm": curve.wrench(TILT.component),
                "energy_J": [point.energy for point in curve.points],
                "work_J": curve.work(),
            }
        )
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


def values_table(result: CurvesResult) -> pd.DataFrame:
    """Return stiffness and damping of the six axes, in SI."""
    rows = []
    for axis, (motion, kind) in AXES.items():
        curve = result.curves[motion.name].curve
        key = f"{kind}damping_{axis[-1]}"
        rows.append(
            {
                "axis": axis,
                "stiffness_at_rest": curve.slope_at_rest(),
                "stiffness_first_20_percent": curve.table.nominal_stiffness,
                "damping": getattr(result.machine.gasket, key),
                "unit_of_stiffness": "N*m/rad" if motion.rotates else "N/m",
            }
        )
    return pd.DataFrame(rows)


def checks_table(result: CurvesResult) -> pd.DataFrame:
    """Return stretch, stress, error of the work, touching folds and wrinkles of each curve."""
    rows = []
    for name, checked in result.curves.items():
        unit = units_of(checked.curve.motion.rotates)
        rows.append(
            {
                "curve": name,
                "unit": unit.unit,
                "from": unit.factor * checked.curve.values[0],
                "to": unit.factor * checked.curve.values[-1],
                "stretch_at_begin": checked.begin.stretch,
                "stretch_at_end": checked.end.stretch,
                "stress_at_begin_MPa": MPA_PER_PA * checked.begin.stress,
                "stress_at_end_MPa": MPA_PER_PA * checked.end.stress,
                "work_error": checked.curve.work_error(),
                "folds_touch_from": unit.factor * checked.touches_at[0],
                "folds_touch_to": unit.factor * checked.touches_at[1],
                "largest_overlap_in_thicknesses": checked.depth,
                "wrinkles_from": unit.factor * checked.wrinkles_at[0],
                "wrinkles_to": unit.factor * checked.wrinkles_at[1],
                "stopped": checked.curve.stopped,
            }
        )
    return pd.DataFrame(rows)


def as_plain_data(result: CurvesResult) -> dict[str, Any]:
    """Return the result for JSON."""
    curves = {name: checked.curve for name, checked in result.curves.items()}
    rubber = result.drawing.rubber
    shown = {
        "gasket": result.name,
        "elements": [result.mesh.meridian, result.mesh.around],
        "shear_modulus_Pa": 2.0 * rubber.constants[0],
        "storage_modulus": rubber.modulus(result.frequency).real,
        "loss_modulus": rubber.modulus(result.frequency).imag,
        "frequency_hz": result.frequency,
        "values": values_table(result).to_dict("records"),
        "coupling_x_about_z_N": coupling(curves),
        "curves": curves_table(result).to_dict("records"),
        "checks": checks_table(result).replace({np.nan: None}).to_dict("records"),
    }
    return plain(shown)
