"""Mass properties of rigid bodies: inertia matrices, and which ones no part of a machine has."""

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.types import FloatArray

LARGEST_GYRATION = 1.0
"""Largest radius of gyration: above any part of a washing machine. [m]"""

NEGLIGIBLE = 0.05
"""Moment of inertia of a light carrier in a model, which may have any radius of gyration: a few per
cent of those of a tub. [kg m^2]"""

USUAL_GYRATION = 0.5
"""Largest usual radius of gyration, of a part whose size is not known. [m]"""

LARGEST_MASS = 1000.0
"""Largest mass of a part: above any part of a washing machine. [kg]"""

DENSEST = 11340.0
"""Density of lead. [kg/m^3]"""

OTHER_UNITS = {
    "lb ft^2": 0.0421401,
    "t mm^2": 1e-3,
    "lb in^2": 2.92640e-4,
    "kg cm^2": 1e-4,
    "kg mm^2": 1e-6,
    "g cm^2": 1e-7,
    "g mm^2": 1e-9,
}
"""Units of moments of inertia in which CAD programs write. [kg m^2]"""


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
        if fault := fault_of_inertia(self.matrix):
            raise ValueError(fault)
        return self

    @property
    def matrix(self) -> FloatArray:
        """Return the matrix. (3, 3) [kg m^2]"""
        return inertia_matrix(self.xx, self.yy, self.zz, self.xy, self.xz, self.yz)


def inertia_matrix(*elements: float) -> FloatArray:
    """Return a symmetric matrix from its elements xx, yy, zz, xy, xz, yz. (3, 3)"""
    xx, yy, zz, xy, xz, yz = elements
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def fault_of_inertia(matrix: FloatArray) -> str:
    """Return why no body has an inertia matrix; empty if one has.

    Args:
        matrix: About the centre of mass. (3, 3) [kg m^2]
    """
    fault = _fault_of_moments(matrix)
    return f"{fault}{_guess_of_order(matrix)}" if fault else ""


def _fault_of_moments(matrix: FloatArray) -> str:
    smallest, middle, largest = np.linalg.eigvalsh(matrix)
    if smallest > 0.0 and smallest + middle >= largest * (1.0 - 1e-12):
        return ""
    moments = f"{smallest:g}, {middle:g}, {largest:g} kg m^2"
    if smallest <= 0.0:
        return f"is not positive definite: the principal moments {moments} must be above 0"
    return (
        f"belongs to no body: of the principal moments {moments} the largest must not exceed "
        "the sum of the others"
    )


def _guess_of_order(matrix: FloatArray) -> str:
    """Return a guess of what went wrong with an impossible matrix; empty for none."""
    xx, yy, zz, xy, xz, yz = (float(matrix[at]) for at in zip(_ROWS, _COLUMNS, strict=True))
    if not _fault_of_moments(inertia_matrix(xx, yy, zz, -xy, -xz, -yz)):
        return "; do the products have the other sign? They are -sum(m x y)"
    of_triangle = inertia_matrix(xx, xy, yz, yy, zz, xz)
    if not _fault_of_moments(of_triangle) or (xy and xy == yy):
        return "; are these the rows of the matrix? The order is ixx, iyy, izz, ixy, ixz, iyz"
    return ""


_ROWS, _COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)


def fault_of_mass_properties(mass: float, matrix: FloatArray) -> str:
    """Return why no part of a machine has a mass and an inertia; empty if one may have.

    Args:
        mass: [kg]
        matrix: About the centre of mass. (3, 3) [kg m^2]
    """
    if not 0.0 < mass <= LARGEST_MASS:
        hint = "; is it in g?" if mass > LARGEST_MASS else ""
        return f"has a mass of {mass:g} kg; allowed is above 0 up to {LARGEST_MASS:g}{hint}"
    if fault := fault_of_inertia(matrix):
        return f"has an inertia that {fault}"
    radius, moment = gyration(mass, matrix), float(np.diag(matrix).max())
    if radius > LARGEST_GYRATION and moment > NEGLIGIBLE:
        return (
            f"has {moment:.4g} kg m^2 for {mass:.4g} kg, a radius of gyration of {radius:.3g} m; "
            f"allowed is up to {LARGEST_GYRATION:g} m{_guess_of_unit(mass, radius)}"
        )
    return ""


def unlikely_mass_properties(mass: float, matrix: FloatArray, reach: float = np.inf) -> str:
    """Return what is unlikely about a mass and an inertia that are possible; empty for nothing.

    A radius of gyration is at most the largest distance of a point from the centre of mass, and at
    least that of a ball of lead:

        tr(I) / 2 = sum m r^2 >= 3/5 m R^2,  4/3 pi R^3 rho = m

    Args:
        mass: [kg]
        matrix: About the centre of mass. (3, 3) [kg m^2]
        reach: Largest distance of a point of its shapes from the centre of mass. [m]
    """
    radius, usual = gyration(mass, matrix), min(reach, USUAL_GYRATION)
    moment = float(np.diag(matrix).max())
    has = f"{moment:.4g} kg m^2 for {mass:.4g} kg"
    if radius > usual:
        of = "of the shapes" if reach < USUAL_GYRATION else "of parts"
        return (
            f"{has} are a radius of gyration of {1e3 * radius:.4g} mm, which is unusual; the size "
            f"{of} allows {1e3 * usual:.4g} mm{_guess_of_unit(mass, radius)}"
        )
    if 0.5 * float(np.trace(matrix)) < 0.6 * mass * ball_radius(mass) ** 2:
        return f"{has} are denser than lead, which is unusual; are the units right?"
    return ""


MOST_OF_STEINER = 0.6
"""Share of Steiner's term from which an inertia is probably about the origin: a part around the
axis that is about its own centre of mass has less."""


def unlikely_reference(mass: float, matrix: FloatArray, centre: FloatArray) -> str:
    """Return that an inertia may be about the origin, not the centre of mass; empty if not.

    The inertia less Steiner's term m (d.d 1 - d d^T) is then that of a body, and smaller by far.

    Args:
        mass: [kg]
        matrix: (3, 3) [kg m^2]
        centre: Centre of mass. (3,) [m]
    """
    steiner = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    share = float(np.trace(steiner) / np.trace(matrix))
    if share < MOST_OF_STEINER or _fault_of_moments(matrix - steiner):
        return ""
    return (
        f"{100.0 * share:.0f} % of its inertia is that of its mass at this distance from the "
        "origin; is the inertia about the origin? It has to be about the centre of mass"
    )


def gyration(mass: float, matrix: FloatArray) -> float:
    """Return the largest radius of gyration of a body. [m]"""
    return float(np.sqrt(np.linalg.eigvalsh(matrix)[-1] / mass))


def ball_radius(mass: float) -> float:
    """Return the radius of a ball of lead. [kg] -> [m]"""
    return float(np.cbrt(0.75 * mass / (np.pi * DENSEST)))


def _guess_of_unit(mass: float, radius: float) -> str:
    """Return the question in which unit a moment of inertia is; empty if none makes sense."""
    low = np.sqrt(0.4) * ball_radius(mass)
    units = [
        unit
        for unit, size in OTHER_UNITS.items()
        if low <= radius * np.sqrt(size) <= 0.8 * USUAL_GYRATION
    ]
    low = np.sqrt(0.4) * ball_radius(1e3 * mass)
    in_tonnes = low <= radius / np.sqrt(1e3) <= 0.8 * USUAL_GYRATION and 1e3 * mass < LARGEST_MASS
    guesses = [f"is it in {' or '.join(units)}"] if units else []
    guesses += ["is the mass in t"] if in_tonnes else []
    return f"; {', or '.join(guesses)}?" if guesses else ""
