"""Files of a tolerance study: uncertain quantities with distributions, and limits to meet."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from wm_drake.errors import check_known
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.files import read_model
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.text_files import DATA, ShippedFiles
from wm_drake.parameters.types import Name
from wm_drake.parameters.units import Share

TOLERANCES = ShippedFiles("tolerance file", DATA / "tolerances")
"""Tolerance files of the package."""

DistributionKind: TypeAlias = Literal["normal", "lognormal", "uniform", "triangular"]

NEEDED: Mapping[str, tuple[str, ...]] = {
    "normal": ("mean", "deviation"),
    "lognormal": ("mean", "deviation"),
    "uniform": ("low", "high"),
    "triangular": ("low", "mode", "high"),
}
"""Keys that a distribution needs."""

TRUNCATED = ("normal", "lognormal")
"""Distributions that `low` and `high` may truncate."""

LAUNDRY = "laundry"
"""First part of the names of the quantities of the laundry."""


class Spread(Frozen):
    """A distribution of a number.

    Each of mean, mode, low and high is in percent of the machine's number ("95 %"), a value with a
    unit ("9 N/mm"), or a distance from the machine's number ("nominal + 2 mm", "nominal"). All of
    one distribution have the same form.

    Attributes:
        distribution: Kind. A normal or lognormal one may be truncated by low and high.
        mean, deviation: Mean and standard deviation, before any truncation.
        mode: Most frequent value of a triangular distribution.
        low, high: Ends.
        source: Where the numbers come from.
    """

    distribution: DistributionKind
    mean: str | None = None
    deviation: str | None = None
    mode: str | None = None
    low: str | None = None
    high: str | None = None
    source: str = ""

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> "Spread":
        needed = NEEDED[self.distribution]
        allowed = {*needed, *(("low", "high") if self.distribution in TRUNCATED else ())}
        missing = [name for name in needed if getattr(self, name) is None]
        if missing:
            raise ValueError(
                f"a {self.distribution} distribution needs {', '.join(needed)}; "
                f"'{missing[0]}' is missing"
            )
        others = {"mean", "deviation", "mode", "low", "high"} - allowed
        wrong = sorted(name for name in others if getattr(self, name) is not None)
        if wrong:
            raise ValueError(
                f"a {self.distribution} distribution has no '{wrong[0]}'; allowed are "
                f"{', '.join(sorted(allowed))}"
            )
        return self


class UncertainQuantity(Spread):
    """An uncertain quantity of the machine file, the SDF or the load.

    Attributes:
        keys: Key paths of its numbers; * stands for any characters of one part of a path, as in
            `bodies.*.mass` (`wm_drake.model.key_patterns`).
        draws: "one" draw for all numbers and all parts of a type, or one draw "each".
        about: Description.
    """

    keys: tuple[str, ...] = Field(min_length=1)
    draws: Literal["one", "each"] = "one"
    about: str = ""


class Laundry(Frozen):
    """Laundry in the drum: one lump, or two lumps if it is split.

    Attributes:
        mass: Mass of both lumps.
        angle: Angle of the first lump around the drum, as `phase` of an unbalance.
        y: Axial position of the first lump in D.
        radius: Radius of both lumps.
        second_share: Share of the mass in the second lump, 0 % to 100 %.
        second_angle: Angle by which the second lump leads the first.
        second_y: Axial position of the second lump in D.
    """

    mass: Spread
    angle: Spread
    y: Spread
    radius: Spread
    second_share: Spread | None = None
    second_angle: Spread | None = None
    second_y: Spread | None = None

    @model_validator(mode="after")
    def _second_is_complete(self) -> "Laundry":
        second = (self.second_share, self.second_angle, self.second_y)
        if None in second and any(second):
            raise ValueError(
                "laundry that is split needs second_share, second_angle and second_y; one is "
                "missing"
            )
        return self

    def spreads(self) -> dict[str, Spread]:
        """Return the distributions by name."""
        spreads = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: spread for name, spread in spreads.items() if spread is not None}


class Correlations(Frozen):
    """Correlations of quantities.

    Attributes:
        quantities: Names of quantities.
        matrix: Their correlation matrix, as rows. It is that of the normal scores of the quantities
            (Gaussian copula); for normal distributions these are the quantities themselves.
    """

    quantities: tuple[str, ...] = Field(min_length=2)
    matrix: tuple[tuple[float, ...], ...]

    @model_validator(mode="after")
    def _is_a_correlation_matrix(self) -> "Correlations":
        size = len(self.quantities)
        if len(set(self.quantities)) < size:
            raise ValueError("a quantity is named twice")
        if len(self.matrix) != size or any(len(row) != size for row in self.matrix):
            raise ValueError(f"matrix: needs {size} rows of {size} numbers, as many as quantities")
        matrix = np.array(self.matrix)
        if not np.isfinite(matrix).all() or np.any(matrix != matrix.T):
            raise ValueError("matrix: is not symmetric")
        if np.any(np.diag(matrix) != 1.0):
            raise ValueError("matrix: the diagonal must be 1")
        if np.linalg.eigvalsh(matrix)[0] <= 0.0:
            raise ValueError(
                "matrix: is not positive definite, so no quantities have these correlations"
            )
        return self


class Tolerances(Frozen):
    """What scatters in a tolerance study.

    Attributes:
        about: Description.
        load: Load of the machine that is run; None if the laundry is drawn.
        quantities: Uncertain quantities by name.
        laundry: Laundry; None if the load is one of the machine.
        correlations: Correlations of quantities; None if there are none.
    """

    about: str = ""
    load: str | None = None
    quantities: dict[Name, UncertainQuantity] = {}
    laundry: Laundry | None = None
    correlations: Correlations | None = None

    @model_validator(mode="after")
    def _something_scatters(self) -> "Tolerances":
        if not self.quantities and self.laundry is None:
            raise ValueError("nothing scatters; needs quantities, laundry or both")
        if (self.load is None) == (self.laundry is None):
            raise ValueError("needs either laundry, or load: the name of a load of the machine")
        if LAUNDRY in self.quantities:
            raise ValueError(f"quantities: the name '{LAUNDRY}' is reserved; use another name")
        return self


class OneSided(Frozen):
    """A limit of a quantity on one side.

    Attributes:
        quantity: Name of a response, such as gap or amplitude_Xr.
        at_least, at_most: The limit, with a unit. One of the two.
    """

    quantity: str
    at_least: str | None = None
    at_most: str | None = None

    @model_validator(mode="after")
    def _has_one_side(self) -> Self:
        if (self.at_least is None) == (self.at_most is None):
            raise ValueError("needs either at_least or at_most")
        return self

    @property
    def text(self) -> str:
        """Return the limit as text."""
        return self.at_least or self.at_most or ""


class Limit(OneSided):
    """A limit that the runs have to meet, up to an allowed share of them.

    Attributes:
        allowed_share: Largest allowed share of runs that break the limit. [0 to 1]
    """

    allowed_share: str

    @model_validator(mode="after")
    def _share_is_known(self) -> "Limit":
        fraction(self.allowed_share, "allowed_share")
        return self


class _Limits(Frozen):
    limits: tuple[Limit, ...] = Field(min_length=1)


def load_tolerances(name_or_path: str | Path = "laundry") -> Tolerances:
    """Read a tolerance file.

    Args:
        name_or_path: Name of a shipped file or path of a YAML file.
    """
    return read_model(Tolerances, TOLERANCES.path(name_or_path))


def check_load(tolerances: Tolerances, machine: MachineParameters, path: Path) -> None:
    """Raise an InputError if the machine lacks the load that a tolerance file names."""
    name = tolerances.load
    if name:
        message = f"'{name}' is not a load of machine '{machine.name}'"
        check_known(name, machine.loads, message, where=str(path), key="load")


def load_limits(path: Path) -> tuple[Limit, ...]:
    """Read a file of limits: ``limits: [{quantity, at_least or at_most, allowed_share}, ...]``."""
    return read_model(_Limits, path).limits


def fraction(text: str, name: str) -> float:
    """Return a share such as "0.1 %" or "0.001" as a number from 0 to 1.

    Raises:
        ValueError: the text is not such a share.
    """
    try:
        value = Share().number(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"{name}: '{text}' is not a share; write for example '0.1 %'")
    return value
