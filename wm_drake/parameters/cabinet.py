"""The cabinet on its four feet: mass, centre of mass, height, positions of the feet, friction."""

import math
from typing import Annotated

from pydantic import Field, model_validator

from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.inertia import InertiaMatrix
from wm_drake.parameters.types import Name

SMALLEST_SINE = 0.02
"""Smallest sine of the angle at a foot between its neighbours; below it, three feet are in line."""


class Foot(Frozen):
    """Position of a foot on the floor, in W.

    Attributes:
        x: To the right.
        y: To the rear.
    """

    x: u.Length
    y: u.Length


class FootType(Frozen):
    """The pad of a foot; all four are alike. Each is a spring with a damper in each direction.

    Attributes:
        vertical_stiffness: Stiffness of a pad that is pressed; it does not pull.
        vertical_damping: Its damping.
        horizontal_stiffness: Stiffness of a pad in shear, the same in all directions.
        horizontal_damping: Its damping, above 0: it limits the speed at which a sliding pad springs
            back.
    """

    vertical_stiffness: Annotated[u.LinearStiffness, Field(gt=0.0)]
    vertical_damping: Annotated[u.LinearDamping, Field(ge=0.0)]
    horizontal_stiffness: Annotated[u.LinearStiffness, Field(gt=0.0)]
    horizontal_damping: Annotated[u.LinearDamping, Field(gt=0.0)]


class Cabinet(Frozen):
    """A rigid cabinet that stands on four feet on a rigid level floor.

    The bodies of the SDF are not part of it, except for the housing, which has no mass there.

    Attributes:
        mass: Mass of everything that does not hang on the mounts. [kg]
        centre_of_mass: Its centre of mass in W. [m]
        floor: z of the floor in W. [m]
        friction: Coefficient of Coulomb friction between feet and floor.
        feet: The four feet by name, corners of a convex quadrilateral, in any order.
        moves: Whether it moves on its feet. It then needs `inertia` and `foot_type`. Otherwise it
            is fixed, and the loads of its feet follow from statics.
        inertia: Inertia about the centre of mass, in the axes of W.
        foot_type: The pads of the feet.
    """

    mass: Annotated[u.Mass, Field(gt=0.0)]
    centre_of_mass: u.Position
    floor: u.Length
    friction: Annotated[u.Ratio, Field(gt=0.0)]
    feet: dict[Name, Foot]
    moves: bool = False
    inertia: InertiaMatrix | None = None
    foot_type: FootType | None = None

    @model_validator(mode="after")
    def _can_move(self) -> "Cabinet":
        missing = [name for name in ("inertia", "foot_type") if getattr(self, name) is None]
        if self.moves and missing:
            raise ValueError(
                f"moves: needs {' and '.join(missing)} of the cabinet; add them or leave moves out"
            )
        return self

    @model_validator(mode="after")
    def _stands(self) -> "Cabinet":
        if len(self.feet) != 4:
            raise ValueError(f"feet: has {len(self.feet)} feet; allowed are four")
        corners = [(self.feet[name].x, self.feet[name].y) for name in self.corners]
        for index in range(4):
            before, here, after = (corners[(index + k) % 4] for k in (-1, 0, 1))
            first = here[0] - before[0], here[1] - before[1]
            second = after[0] - here[0], after[1] - here[1]
            lengths = math.hypot(*first) * math.hypot(*second)
            if not first[0] * second[1] - first[1] * second[0] > SMALLEST_SINE * lengths:
                raise ValueError(
                    f"feet: '{self.corners[index]}' is in a line with two others or between them; "
                    "the four feet must be the corners of a convex quadrilateral"
                )
        return self

    @property
    def corners(self) -> tuple[str, ...]:
        """Names of the feet, counterclockwise from above, from the left front corner on."""
        count = len(self.feet)
        x = sum(foot.x for foot in self.feet.values()) / count
        y = sum(foot.y for foot in self.feet.values()) / count
        return tuple(
            sorted(
                self.feet, key=lambda name: math.atan2(self.feet[name].y - y, self.feet[name].x - x)
            )
        )
