"""Causes of error that [A] section 4.2 names, as imperfections of a machine."""

from typing import Any

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.machine import Imperfections

BEARING = {
    "axial_stiffness": "8 kN/mm",
    "tilting_stiffness": "100 kN m/rad",
    "axial_damping": "1 N s/mm",
    "tilting_damping": "10 N m s/rad",
    "y": "170 mm",
}
STIFF = {"radial_stiffness": "10 kN/mm", "radial_damping": "1 N s/mm"}
LOOSE = {
    "radial_stiffness": "50 N/mm",
    "radial_damping": "0.05 N s/mm",
    "contact_stiffness": "10 kN/mm",
    "contact_damping": "1 N s/mm",
}
CAUSES: dict[str, dict[str, Any]] = {
    "whirl: a compliant bearing without clearance": {"bearing": BEARING | STIFF},
    **{
        f"whirl: radial clearance {size}": {"bearing": BEARING | LOOSE | {"clearance": size}}
        for size in ("0.05 mm", "0.15 mm", "0.5 mm")
    },
    **{
        f"residual imbalance, {size}": {
            "residual_imbalance": {"mass": size, "radius": "240 mm", "y": "0 mm"}
        }
        for size in ("10 g", "20 g", "50 g")
    },
    **{f"phase error, {size}": {"phase_error": size} for size in ("2 deg", "5 deg", "10 deg")},
}
"""Causes of error that [A] names in section 4.2; all sizes are assumptions."""


def with_cause(machine: MachineParameters, imperfections: dict[str, Any]) -> MachineParameters:
    """Return a machine with imperfections in place of its own, such as an entry of `CAUSES`."""
    checked = Imperfections.model_validate(imperfections)
    return machine.model_copy(update={"imperfections": checked})
