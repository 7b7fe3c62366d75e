"""The bearing of the drum, where it gives."""

from typing import Annotated

from pydantic import Field

from wm_drake.parameters import units as u
from wm_drake.parameters.elements import BushingType, Frozen


class Bearing(Frozen):
    """What holds the drum's axis in the tub, where that gives: without it the drum turns in a perfect revolute joint.

    Nothing of it is published: every number is an assumption of whoever gives it.

    Attributes:
        radial_stiffness, axial_stiffness, tilting_stiffness: Across the drum axis, along it, against tilting of it.
        torsional_stiffness: About it, where the motor's reaction passes to the tub; as against tilting if None.
        radial_damping, axial_damping, tilting_damping, torsional_damping: Likewise.
        y: Where it acts: along the drum axis, from the origin of its joint in the direction of the joint's axis.
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
        """Six components in a frame whose y axis is the drum's."""

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
