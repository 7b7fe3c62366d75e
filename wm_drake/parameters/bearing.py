"""Parameters of a compliant bearing of the drum."""

from typing import Annotated

from pydantic import Field

from wm_drake.parameters import units as u
from wm_drake.parameters.elements import BushingType, Frozen


class Bearing(Frozen):
    """A compliant bearing between drum and tub.

    A machine without these parameters has a rigid bearing: a revolute joint. None of the numbers is
    published; every number in a machine file is an assumption of its author.

    Attributes:
        radial_stiffness: Stiffness perpendicular to the drum axis. [N/m]
        axial_stiffness: Stiffness along the drum axis. [N/m]
        tilting_stiffness: Stiffness against tilting of the drum axis. [N m/rad]
        torsional_stiffness: Stiffness about the drum axis, in the path of the motor's reaction
            torque to the tub; if None, the tilting stiffness is used. [N m/rad]
        radial_damping, axial_damping: Damping in the same directions. [N s/m]
        tilting_damping, torsional_damping: Damping of the rotations; if the torsional one is None,
            the tilting one is used. [N m s/rad]
        y: Position of the bearing along the axis of the drum's joint, from the joint's origin. [m]
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
        """Return the bearing as a bushing in a frame whose y axis is the drum axis."""

        def torsional_or_tilting(torsional: float | None, tilting: float) -> float:
            return tilting if torsional is None else torsional

        return BushingType(
            stiffness_x=self.radial_stiffness,
            stiffness_y=self.axial_stiffness,
            stiffness_z=self.radial_stiffness,
            rotational_stiffness_x=self.tilting_stiffness,
            rotational_stiffness_y=torsional_or_tilting(
                self.torsional_stiffness, self.tilting_stiffness
            ),
            rotational_stiffness_z=self.tilting_stiffness,
            damping_x=self.radial_damping,
            damping_y=self.axial_damping,
            damping_z=self.radial_damping,
            rotational_damping_x=self.tilting_damping,
            rotational_damping_y=torsional_or_tilting(self.torsional_damping, self.tilting_damping),
            rotational_damping_z=self.tilting_damping,
        )
