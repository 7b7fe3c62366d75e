"""Inertia matrix of a rigid body."""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen


class InertiaMatrix(Frozen):
    """Inertia matrix about the centre of mass, in the axes of T (or D).

    The products of inertia are elements of the matrix: xy = -sum(m x y).

    Attributes:
        xx, yy, zz: Moments of inertia.
        xy, xz, yz: Elements of the matrix outside of its diagonal.
    """

    xx: Annotated[u.Inertia, Field(gt=0.0)]
    yy: Annotated[u.Inertia, Field(gt=0.0)]
    zz: Annotated[u.Inertia, Field(gt=0.0)]
    xy: u.Inertia = 0.0
    xz: u.Inertia = 0.0
    yz: u.Inertia = 0.0

    @model_validator(mode="after")
    def _physical(self) -> "InertiaMatrix":
        matrix = [
            [self.xx, self.xy, self.xz],
            [self.xy, self.yy, self.yz],
            [self.xz, self.yz, self.zz],
        ]
        smallest, middle, largest = np.linalg.eigvalsh(matrix)
        moments = f"{smallest:g}, {middle:g}, {largest:g} kg m^2"
        if smallest <= 0.0:
            raise ValueError(
                f"is not positive definite: the principal moments {moments} must be above 0"
            )
        if smallest + middle < largest * (1.0 - 1e-12):
            raise ValueError(
                f"belongs to no body: of the principal moments {moments} the largest must not "
                "exceed the sum of the others"
            )
        return self
