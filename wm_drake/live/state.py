"""What a page has chosen: a machine, numbers that differ from it, a load, gasket in or out."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from wm_drake.errors import InputError, Problem
from wm_drake.parameters import Load
from wm_drake.parameters.problems import problems_of

Text = Annotated[str, StringConstraints(max_length=200)]

DESCRIBED = "described"
"""Name of a load of which the user gave the masses on the page."""


class DescribedMass(BaseModel):
    """A point mass of a described load, with the keys and units of a machine file."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    mass: Text
    radius: Text
    y: Text
    phase: Text


class PageState(BaseModel):
    """What a page has chosen; all that a permanent link holds.

    Attributes:
        machine: Identifier of the machine, see `wm_drake.studio.machines`.
        values: Texts with units of the numbers that differ from the machine, by key path.
        load: Name of a load of the machine; not used if there are masses.
        masses: Masses of a load that the user described.
        gasket: Whether the machine has its gasket.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    machine: Text
    values: Annotated[dict[Text, Text], Field(max_length=1000)] = {}
    load: Text
    masses: Annotated[tuple[DescribedMass, ...], Field(max_length=20)] = ()
    gasket: bool = True

    def described_load(self) -> Load:
        """Return the described load.

        Raises:
            InputError: a text is not a number with a fitting unit; the key begins with "masses".
        """
        try:
            return Load.model_validate(
                {"unbalances": [mass.model_dump() for mass in self.masses]},
                context={"units_required": True},
            )
        except ValidationError as error:
            raise InputError(
                Problem("", p.key.replace("unbalances", "masses", 1), p.message)
                for p in problems_of(error, Load)
            ) from None
