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
SIZES = ("0.05 mm", "10 g", "2 deg"), ("0.15 mm", "20 g", "5 deg"), ("0.5 mm", "50 g", "10 deg")
"""Small, middle and large size of the three causes. All are assumptions."""

ASKED_FOR = ("19 deg", "24 deg")
"""Errors of the phase that the excess of [A] at 180 and at 90 degrees asks for, if all groups have
a common error in quadrature."""


def whirl(size: str) -> dict[str, Any]:
    """Return a radial clearance in the bearing."""
    return {"bearing": BEARING | LOOSE | {"clearance": size}}


def residual(size: str) -> dict[str, Any]:
    """Return a residual imbalance of the drum."""
    return {"residual_imbalance": {"mass": size, "radius": "240 mm", "y": "0 mm"}}


def phase(size: str) -> dict[str, Any]:
    """Return an error of the phase of the rear mass."""
    return {"phase_error": size}


CAUSES: dict[str, dict[str, Any]] = {
    "whirl: a compliant bearing without clearance": {"bearing": BEARING | STIFF},
    **{f"whirl: radial clearance {size}": whirl(size) for size, _, _ in SIZES},
    **{f"residual imbalance, {size}": residual(size) for _, size, _ in SIZES},
    **{f"phase error, {size}": phase(size) for size in (*(of[2] for of in SIZES), *ASKED_FOR)},
    **{
        f"all three: {', '.join(sizes)}": whirl(sizes[0]) | residual(sizes[1]) | phase(sizes[2])
        for sizes in SIZES
    },
}
"""Causes of error that [A] names in section 4.2, alone and together."""


def without_phase_error(imperfections: dict[str, Any]) -> dict[str, Any]:
    """Return imperfections without the error of the phase, as at 0 degrees."""
    return {name: value for name, value in imperfections.items() if name != "phase_error"}


def with_cause(machine: MachineParameters, imperfections: dict[str, Any]) -> MachineParameters:
    """Return a machine with imperfections in place of its own, such as an entry of `CAUSES`."""
    checked = Imperfections.model_validate(imperfections)
    return machine.model_copy(update={"imperfections": checked})
