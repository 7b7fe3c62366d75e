"""Vary files, of numbers that vary: one file for factors, tolerances, designs and calibrations.

The section `vary` has the numbers. Other sections say what single studies need beside them; a study
reads those that it uses.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import BeforeValidator, Field, StringConstraints, model_validator

from wm_drake.errors import check_known, input_error, nearest_names
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.files import read_model
from wm_drake.parameters.limits import Constraint, Objective
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.old_forms import check_form
from wm_drake.parameters.text_files import DATA, ShippedFiles
from wm_drake.parameters.types import Name
from wm_drake.parameters.vary import LAUNDRY, Entry, Factors

VARY_FILES = ShippedFiles("vary file", DATA / "vary")
"""Vary files of the package."""

GASKET = "gasket"
"""Shipped file with the eight factors of [B] section 4."""

_LUMP = tuple(name for name in LAUNDRY if "second" not in name)
_SECOND = tuple(name for name in LAUNDRY if "second" in name)

EntryName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_.+*-]{0,255}$")]
"""Name of an entry; it may be a key path, or several with + between them."""


class Known(Frozen):
    """A number that is known, in the form of an entry that sets sums.

    Attributes:
        value: The value, with a unit.
        sets: As of `Entry`.
        source: Reason for the value.
    """

    value: str
    sets: Annotated[Factors, Field(min_length=1)]
    source: str


class Relation(Frozen):
    """What physics says about one number when others are given.

    Example: a rubber ring of radius R, whose radial stiffness is K, has at most the torsional
    stiffness 2 K R^2.

    Attributes:
        quantity: Name of the entry.
        to: Factors by name of other entries. Their weighted sum is what the number is compared
            with; it has the dimension of the number.
        prior: Expected ratio of the number to the sum, and its standard deviation.
        at_most: Largest ratio, and the standard deviation by which it may be exceeded.
        source: Derivation.
    """

    quantity: str
    to: Annotated[Factors, Field(min_length=1)]
    prior: str | None = None
    at_most: str | None = None
    source: str

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.prior is None) == (self.at_most is None):
            raise ValueError("needs either 'prior' or 'at_most'")
        return self


class ExpectedPreload(Frozen):
    """Prior of the spring preloads, which follow from the weight and are no numbers of the machine.

    Attributes:
        prior: Expected force and standard deviation, the same for each spring.
        source: Reason for the prior.
    """

    prior: str
    source: str


class LeastElongation(Frozen):
    """Smallest elongation of a spring from its free length, over all runs with measured amplitudes.

    A spring that hangs in hooks goes slack at zero.

    Attributes:
        at_least: The elongation, and the standard deviation by which it may be missed.
        source: Reason.
    """

    at_least: str
    source: str


class Correlations(Frozen):
    """Correlations of numbers that are drawn.

    Attributes:
        quantities: Names of entries.
        matrix: Their correlation matrix, as rows. It is that of the normal scores of the numbers
            (Gaussian copula); for normal distributions these are the numbers themselves.
    """

    quantities: tuple[str, ...] = Field(min_length=2)
    matrix: tuple[tuple[float, ...], ...]

    @model_validator(mode="after")
    def _is_a_correlation_matrix(self) -> Self:
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


class Choice(Frozen):
    """A discrete choice of a design.

    Attributes:
        options: By name of each option: values by key path, as text with a unit, or as name of a
            type.
        about: Description.
    """

    options: dict[Name, dict[str, str]] = Field(min_length=2)
    about: str = ""


class Robust(Frozen):
    """Scatter of a robust design.

    Attributes:
        tolerances: Name of a shipped vary file, or path of one.
        samples: Samples of each design, a power of two.
    """

    tolerances: str
    samples: int = Field(ge=4, le=4096)

    @model_validator(mode="after")
    def _is_power_of_two(self) -> Self:
        if self.samples & (self.samples - 1):
            raise ValueError(f"samples: {self.samples} is not a power of two")
        return self


class VaryFile(Frozen):
    """Numbers of a machine that vary, and what studies need beside them.

    Attributes:
        about: Description.
        vary: The numbers by name.
        known: Numbers that are known, by name. One of them varies once its entry is in `vary`, with
            bounds and prior in place of the value.
        relations, spring_preload, spring_elongation: What else is known before a calibration.
        correlations: Correlations of numbers that are drawn.
        loads: Loads of the machine that are run, where no laundry is drawn.
        choices, objectives, constraints, robust: Of a design search.
    """

    about: str = ""
    vary: dict[EntryName, Entry] = {}
    known: dict[Name, Known] = {}
    relations: dict[Name, Relation] = {}
    spring_preload: ExpectedPreload | None = None
    spring_elongation: LeastElongation | None = None
    correlations: Correlations | None = None
    loads: Annotated[
        tuple[str, ...], BeforeValidator(lambda v: (v,) if isinstance(v, str) else v)
    ] = ()
    choices: dict[Name, Choice] = {}
    objectives: tuple[Objective, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    robust: Robust | None = None

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        if not self.vary and not self.choices:
            raise ValueError("nothing varies; needs vary, choices or both")
        for section in ("known", "choices"):
            for name in getattr(self, section):
                if name in self.vary:
                    raise ValueError(f"'{name}' is in vary and in {section}; allowed is one")
        laundry = [name for name in self.vary if name.startswith("laundry.")]
        for name in laundry:
            if name not in LAUNDRY:
                raise ValueError(f"vary: no number '{name}'{nearest_names(name, LAUNDRY)}")
        for needed in (_LUMP if laundry else (), _SECOND if set(laundry) & {*_SECOND} else ()):
            missing = [name for name in needed if name not in laundry]
            if missing:
                raise ValueError(f"vary: laundry needs {', '.join(needed)}; add {missing[0]}")
        return self

    @property
    def has_laundry(self) -> bool:
        """Whether the laundry in the drum varies."""
        return not self.vary.keys().isdisjoint(LAUNDRY)

    def entries(self, *, without: tuple[str, ...] = ("laundry.",)) -> dict[str, Entry]:
        """Return the entries by name, with their keys.

        Args:
            without: Beginnings of keys; an entry of which all keys begin so is left out.
        """
        every = {name: entry.of_name(name) for name, entry in self.vary.items()}
        return {
            name: entry
            for name, entry in every.items()
            if entry.sets or not all(key.startswith(without) for key in entry.keys)
        }

    def without_starts(self) -> "VaryFile":
        """Return a copy without start values, so that searches start at the expected values."""
        entries = {
            name: entry.model_copy(update={"start": None}) for name, entry in self.vary.items()
        }
        return self.model_copy(update={"vary": entries})


def load_vary(name_or_path: str | Path = GASKET) -> VaryFile:
    """Read a vary file.

    Args:
        name_or_path: Name of a shipped file or path of a YAML file.

    Raises:
        InputError: the file is wrong, or has the form of an earlier version.
    """
    path = VARY_FILES.path(name_or_path)
    check_form(path)
    return read_model(VaryFile, path)


def check_loads(file: VaryFile, machine: MachineParameters) -> None:
    """Raise an InputError for a load that the machine does not have, or that is named twice."""
    for number, name in enumerate(file.loads):
        message, key = f"'{name}' is not a load of machine '{machine.name}'", f"loads.{number}"
        check_known(name, machine.loads, message, key=key)
        if name in file.loads[:number]:
            raise input_error(f"'{name}' is named twice", key=key)


def gasket_entries() -> Mapping[str, Entry]:
    """Return the eight factors of [B] section 4, by symbol."""
    return load_vary(GASKET).entries()
