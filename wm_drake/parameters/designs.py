"""Files of a design study: variables, choices, objectives and constraints of a machine."""

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from wm_drake.errors import check_known, input_error
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.files import read_model
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.text_files import DATA, ShippedFiles
from wm_drake.parameters.tolerances import OneSided, fraction
from wm_drake.parameters.types import Name

DESIGNS = ShippedFiles("design file", DATA / "designs")
"""Design files of the package."""


class DesignVariable(Frozen):
    """A number that the search may choose between two bounds.

    Attributes:
        keys: Key paths of the numbers that it sets.
        low, high: Bounds, in percent of the machine's number, as a value with a unit, or as a
            distance ("nominal + 2 mm").
        about: Description.
    """

    keys: tuple[str, ...] = Field(min_length=1)
    low: str
    high: str
    about: str = ""


class Choice(Frozen):
    """A discrete choice.

    Attributes:
        options: By name of each option: values by key path, as text with a unit, or as name of a
            type.
        about: Description.
    """

    options: dict[Name, dict[str, str]] = Field(min_length=2)
    about: str = ""


class Objective(Frozen):
    """What the search makes small or large.

    Attributes:
        quantity: Name of a response, such as Dx or gap, or key path of a number, such as
            bodies.motor.mass.
        goal: Direction.
        over: How the values of several loads or samples become one: the worst, the mean, or a
            quantile such as "95 %", counted towards the worse side.
    """

    quantity: str
    goal: Literal["smaller", "larger"] = "smaller"
    over: str = "worst"

    @model_validator(mode="after")
    def _over_is_known(self) -> "Objective":
        check_over(self.over)
        return self


class Constraint(OneSided):
    """A limit that a design must meet.

    Attributes:
        over: As that of an objective.
    """

    over: str = "worst"

    @model_validator(mode="after")
    def _over_is_known(self) -> "Constraint":
        check_over(self.over)
        return self


class Robust(Frozen):
    """Scatter of a robust design.

    Attributes:
        tolerances: Name of a shipped tolerance file, or path of one.
        samples: Samples of each design, a power of two.
    """

    tolerances: str
    samples: int = Field(ge=4, le=4096)

    @model_validator(mode="after")
    def _is_power_of_two(self) -> "Robust":
        if self.samples & (self.samples - 1):
            raise ValueError(f"samples: {self.samples} is not a power of two")
        return self


class DesignFile(Frozen):
    """What a design study searches.

    Attributes:
        about: Description.
        loads: Loads of the machine that each design runs; empty for a robust design with laundry.
        variables, choices: What the search may change, by name.
        objectives: At least one.
        constraints: Limits.
        robust: Scatter; None for a nominal design.
    """

    about: str = ""
    loads: tuple[str, ...] = ()
    variables: dict[Name, DesignVariable] = {}
    choices: dict[Name, Choice] = {}
    objectives: tuple[Objective, ...] = Field(min_length=1)
    constraints: tuple[Constraint, ...] = ()
    robust: Robust | None = None

    @model_validator(mode="after")
    def _is_complete(self) -> "DesignFile":
        if not self.variables and not self.choices:
            raise ValueError("nothing to design; needs variables, choices or both")
        both = sorted(set(self.variables) & set(self.choices))
        if both:
            raise ValueError(f"choices: '{both[0]}' is the name of a variable too")
        if bool(self.loads) == (self.robust is not None):
            raise ValueError("needs either loads, or robust with its tolerances")
        return self


def check_loads(task: DesignFile, machine: MachineParameters) -> None:
    """Raise an InputError for a load that the machine does not have, or that is named twice."""
    for number, name in enumerate(task.loads):
        key = f"loads.{number}"
        message = f"'{name}' is not a load of machine '{machine.name}'"
        check_known(name, machine.loads, message, key=key)
        if name in task.loads[:number]:
            raise input_error(f"'{name}' is named twice", key=key)


def check_over(text: str) -> None:
    """Raise a ValueError if a text is not worst, mean or a quantile such as 95 %."""
    if text not in ("worst", "mean"):
        try:
            fraction(text, "over")
        except ValueError:
            raise ValueError(
                f"over: '{text}' is not allowed; allowed are worst, mean and a quantile such as "
                "'95 %'"
            ) from None


def load_design(name_or_path: str | Path = "gasket") -> DesignFile:
    """Read a design file."""
    return read_model(DesignFile, DESIGNS.path(name_or_path))
