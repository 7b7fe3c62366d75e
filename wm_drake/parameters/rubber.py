"""Rubber beyond spring and dashpot: friction, Maxwell branches and cross-stiffness of a bushing."""

import itertools
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from wm_drake.parameters import units as u
from wm_drake.parameters.types import FloatArray

RUBBER_AXES = ("x", "y", "z", "about_x", "about_y", "about_z")
"""Axes of a bushing: along, then about."""

_COUPLING = u.Unit("N/rad", "N/rad")
_Force = Annotated[u.Force, Field(ge=0.0)]
_Torque = Annotated[u.Torque, Field(ge=0.0)]
_Length = Annotated[u.Length, Field(ge=0.0)]
_Angle = Annotated[u.Angle, Field(ge=0.0)]
_Stiffness = Annotated[u.LinearStiffness, Field(ge=0.0)]
_Damping = Annotated[u.LinearDamping, Field(ge=0.0)]
_RotationalStiffness = Annotated[u.RotationalStiffness, Field(ge=0.0)]
_RotationalDamping = Annotated[u.RotationalDamping, Field(ge=0.0)]
_Coupling = Annotated[float, _COUPLING]

DAHL_FIELDS = tuple(
    (f"dahl_torque_{axis[-1]}", f"dahl_angle_{axis[-1]}")
    if axis.startswith("about")
    else (f"dahl_force_{axis}", f"dahl_displacement_{axis}")
    for axis in RUBBER_AXES
)
"""Fields of the Dahl friction of each axis: full force, and displacement."""
MAXWELL_FIELDS = tuple(
    (f"{kind}maxwell_stiffness_{axis[-1]}", f"{kind}maxwell_damping_{axis[-1]}")
    for axis in RUBBER_AXES
    for kind in ["rotational_" if axis.startswith("about") else ""]
)
"""Fields of the Maxwell branch of each axis: spring and dashpot in series."""


def _cross_field(first: str, second: str) -> str:
    kind = "rotational_" if first.startswith("about") else ""
    second = second[-1] if kind else second
    return f"{kind}cross_stiffness_{first[-1]}_{second}"


CROSS_FIELDS = tuple(
    _cross_field(first, second) for first, second in itertools.combinations(RUBBER_AXES, 2)
)
"""Field of the stiffness between each pair of axes, in the order of the upper triangle by rows."""


class RubberBranches(BaseModel):
    """Options of a bushing, each per axis and in parallel with its spring and dashpot.

    Attributes:
        dahl_force_x, dahl_force_y, dahl_force_z: Full force of rate-independent friction along each
            axis; 0 for none.
        dahl_displacement_x, dahl_displacement_y, dahl_displacement_z: Displacement over which that
            friction builds up: from rest it is dahl_force (1 - exp(-x / dahl_displacement)).
        dahl_torque_x, dahl_torque_y, dahl_torque_z: Full torque of rate-independent friction about
            each axis; 0 for none.
        dahl_angle_x, dahl_angle_y, dahl_angle_z: Angle over which that friction builds up.
        maxwell_stiffness_x, maxwell_stiffness_y, maxwell_stiffness_z: Spring of a Maxwell branch
            along each axis, in series with its dashpot; 0 for none.
        maxwell_damping_x, maxwell_damping_y, maxwell_damping_z: Dashpot of that branch.
        rotational_maxwell_stiffness_x, rotational_maxwell_stiffness_y:
            Spring of a Maxwell branch about each axis, in series with its dashpot; 0 for none.
        rotational_maxwell_stiffness_z: The same about z.
        rotational_maxwell_damping_x, rotational_maxwell_damping_y, rotational_maxwell_damping_z:
            Dashpot of that branch.
        cross_stiffness_x_y, cross_stiffness_x_z, cross_stiffness_y_z: Force along the first axis
            from the displacement along the second one, and the reverse. The stiffness of all six
            axes together must not be negative in any direction.
        cross_stiffness_x_about_x, cross_stiffness_x_about_y, cross_stiffness_x_about_z:
            Force along x from the rotation about an axis, and the reverse.
        cross_stiffness_y_about_x, cross_stiffness_y_about_y, cross_stiffness_y_about_z:
            Force along y from the rotation about an axis, and the reverse.
        cross_stiffness_z_about_x, cross_stiffness_z_about_y, cross_stiffness_z_about_z:
            Force along z from the rotation about an axis, and the reverse.
        rotational_cross_stiffness_x_y, rotational_cross_stiffness_x_z:
            Torque about the first axis from the rotation about the second one, and the reverse.
        rotational_cross_stiffness_y_z: The same for y and z.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    dahl_force_x: _Force = 0.0
    dahl_force_y: _Force = 0.0
    dahl_force_z: _Force = 0.0
    dahl_displacement_x: _Length = 0.0
    dahl_displacement_y: _Length = 0.0
    dahl_displacement_z: _Length = 0.0
    dahl_torque_x: _Torque = 0.0
    dahl_torque_y: _Torque = 0.0
    dahl_torque_z: _Torque = 0.0
    dahl_angle_x: _Angle = 0.0
    dahl_angle_y: _Angle = 0.0
    dahl_angle_z: _Angle = 0.0
    maxwell_stiffness_x: _Stiffness = 0.0
    maxwell_stiffness_y: _Stiffness = 0.0
    maxwell_stiffness_z: _Stiffness = 0.0
    maxwell_damping_x: _Damping = 0.0
    maxwell_damping_y: _Damping = 0.0
    maxwell_damping_z: _Damping = 0.0
    rotational_maxwell_stiffness_x: _RotationalStiffness = 0.0
    rotational_maxwell_stiffness_y: _RotationalStiffness = 0.0
    rotational_maxwell_stiffness_z: _RotationalStiffness = 0.0
    rotational_maxwell_damping_x: _RotationalDamping = 0.0
    rotational_maxwell_damping_y: _RotationalDamping = 0.0
    rotational_maxwell_damping_z: _RotationalDamping = 0.0
    cross_stiffness_x_y: u.LinearStiffness = 0.0
    cross_stiffness_x_z: u.LinearStiffness = 0.0
    cross_stiffness_x_about_x: _Coupling = 0.0
    cross_stiffness_x_about_y: _Coupling = 0.0
    cross_stiffness_x_about_z: _Coupling = 0.0
    cross_stiffness_y_z: u.LinearStiffness = 0.0
    cross_stiffness_y_about_x: _Coupling = 0.0
    cross_stiffness_y_about_y: _Coupling = 0.0
    cross_stiffness_y_about_z: _Coupling = 0.0
    cross_stiffness_z_about_x: _Coupling = 0.0
    cross_stiffness_z_about_y: _Coupling = 0.0
    cross_stiffness_z_about_z: _Coupling = 0.0
    rotational_cross_stiffness_x_y: u.RotationalStiffness = 0.0
    rotational_cross_stiffness_x_z: u.RotationalStiffness = 0.0
    rotational_cross_stiffness_y_z: u.RotationalStiffness = 0.0

    @model_validator(mode="after")
    def _branches_are_whole(self) -> "RubberBranches":
        for force, displacement in DAHL_FIELDS:
            if getattr(self, force) > 0.0 and not getattr(self, displacement) > 0.0:
                raise ValueError(f"{displacement}: must be above 0 where {force} is")
        for spring, dashpot in MAXWELL_FIELDS:
            if (getattr(self, spring) > 0.0) != (getattr(self, dashpot) > 0.0):
                raise ValueError(
                    f"{spring} and {dashpot}: both must be above 0 for a Maxwell branch, or both 0"
                )
        return self

    @model_validator(mode="after")
    def _stores_energy(self) -> "RubberBranches":
        if not any(self.cross):
            return self
        matrix = self.cross_matrix()
        matrix += np.diag([_slope_at_zero(getattr(self, name)) for name in _SPRINGS])
        scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        least = np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0]
        if not least >= -1e-9:
            raise ValueError(
                "the cross-stiffness is too large for the stiffness of its axes: the matrix of all "
                "six axes has a negative direction; allowed is |cross| <= sqrt(k_i k_j) of a pair"
            )
        return self

    @property
    def cross(self) -> tuple[float, ...]:
        """Return the cross-stiffnesses in the order of `CROSS_FIELDS`, in SI."""
        return tuple(getattr(self, name) for name in CROSS_FIELDS)

    def cross_matrix(self) -> FloatArray:
        """Return the symmetric matrix of cross-stiffnesses, with a diagonal of zeros. (6, 6)"""
        matrix = np.zeros((6, 6))
        matrix[np.triu_indices(6, 1)] = self.cross
        return matrix + matrix.T

    @property
    def stretched_branches(self) -> tuple[str, ...]:
        """Return the branches in use by the name of their force or spring, in packed order."""
        pairs = zip(DAHL_FIELDS, MAXWELL_FIELDS, strict=True)
        fields = [name for friction, maxwell in pairs for name in (friction[0], maxwell[0])]
        return tuple(name for name in fields if getattr(self, name) > 0.0)

    @property
    def branches_in_use(self) -> tuple[str, ...]:
        """Return the branches in use, and "cross_stiffness" if there is any."""
        if self.model_fields_set.isdisjoint(RubberBranches.model_fields):
            return ()
        return (*self.stretched_branches, *(["cross_stiffness"] if any(self.cross) else []))


_SPRINGS = tuple(
    f"{'rotational_' if axis.startswith('about') else ''}stiffness_{axis[-1]}"
    for axis in RUBBER_AXES
)


def _slope_at_zero(stiffness: Any) -> float:
    """Return a stiffness, or the slope of a table at zero by a small central difference."""
    if isinstance(stiffness, float | int):
        return float(stiffness)
    near = 1e-7
    low, high = stiffness.values(np.array([-near, near]))
    return float(high - low) / (2.0 * near)
