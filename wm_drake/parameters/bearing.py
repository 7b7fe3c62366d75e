"""Compliant bearing of the drum."""

from typing import Annotated

from pydantic import Field

from wm_drake.parameters import units as u
from wm_drake.parameters.elements import BushingType, Frozen


class Bearing(Frozen):
    """Compliant bearing of the drum in the tub; a machine without one has a perfect revolute joint.

    No paper has these numbers: each is an assumption of its author.

    Attributes:
        radial_stiffness, axial_stiffness: Across and along the drum axis. [N/m]
        tilting_stiffness: Against tilting of the drum axis. [N m/rad]
        torsional_stiffness: About the drum axis, where the reaction of the motor acts on the tub;
            the tilting stiffness if None. [N m/rad]
        radial_damping, axial_damping: Across and along the drum axis. [N s/m]
        tilting_damping: Against tilting of the drum axis. [N m s/rad]
        torsional_damping: About the drum axis; the tilting damping if None. [N m s/rad]
        y: Place of the bearing on the drum axis, from the origin of its joint in the direction of
            the joint's axis. [m]
    """

    radial_stiffness: Annotated[u.LinearStiffness, Field(gt=0.0)]
    axial_stiffness: Annotated[u.LinearStiffness, Field(gt=0.0)]
    tilting_stiffness: Annotated[u.RotationalStiffness, Field(gt=0.0)]
    torsional_stiffness: Annotated[u.RotationalStiffness, Field(gt=0.0)] | None = None
    radial_damping: Annotated[u.LinearDamping, Field(ge=0.0)]
    axial_damping: Annotated[u.LinearDamping, Field(ge=0.0)]
    tilting_damping: Annotated[u.RotationalDamping, Field(ge=0.0)]
    torsional_damping: Annotated[u.RotationalDamping, Field(ge=0.0)] | None = None
    y: u.Length

    def as_bushing(self) -> BushingType:
        """Return the bushing of six components in a frame whose y axis is the drum's."""

        def or_tilting(torsional: float | None, tilting: float) -> float:
            return tilting if torsional is None else torsional

        return BushingType(
            stiffness_x=self.radial_stiffness,
            stiffness_y=self.axial_stiffness,
            stiffness_z=self.radial_stiffness,
            rotational_stiffness_x=self.tilting_stiffness,
            rotational_stiffness_y=or_tilting(self.torsional_stiffness, self.tilting_stiffness),
            rotational_stiffness_z=self.tilting_stiffness,
            damping_x=self.radial_damping,
            damping_y=self.axial_damping,
            damping_z=self.radial_damping,
            rotational_damping_x=self.tilting_damping,
            rotational_damping_y=or_tilting(self.torsional_damping, self.tilting_damping),
            rotational_damping_z=self.tilting_damping,
        )
