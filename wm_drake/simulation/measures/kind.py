"""Declaration of a measure: its variables with units and words, what it reads, its evaluator."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, TypeAlias

import numpy as np

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures.run import Need, Run

Better: TypeAlias = Literal["smaller", "larger", ""]
"""Which change of a number is an improvement; "" if neither."""

Evaluate: TypeAlias = Callable[[Sequence[Run]], Sequence[FloatArray]]
"""Function of runs side by side, one a lane. It returns one array (lanes, ...) for each variable of
its measure, in the order of the declaration, in SI units. A record is a block of one lane."""


@dataclass(frozen=True)
class Variable:
    """One array that a measure has of each run.

    Attributes:
        name: Name in tables of runs and in files, such as `gasket_force`.
        dims: Dimensions, keys of `wm_drake.simulation.measures.labels.LABELS`.
        unit: SI unit, and unit for reading.
        kind: Quantity in words, such as "peak torque"; numbers of one kind share a figure.
        about: What it is, as part of a sentence.
        better: Which change is an improvement.
        group: Name under which studies choose all its numbers, and the beginning of the name of
            each: `group_label`, or `Dx` for a group of one letter. If empty, the name.
        title: Words for one number, with {} for its labels. If empty, the kind and the labels.
        short: Title for a narrow table, with {} for the labels. If empty, the title.
        is_response: Whether studies may choose its numbers as responses.
        is_in_spin: Whether every run of `wm-drake spin` has it.
        studio: Decimals in the studio; None if the studio does not show it.
    """

    name: str
    dims: tuple[str, ...]
    unit: Unit
    kind: str
    about: str
    better: Better = "smaller"
    group: str = ""
    title: str = ""
    short: str = ""
    is_response: bool = True
    is_in_spin: bool = True
    studio: int | None = 2

    @property
    def units(self) -> str:
        """SI unit for the attributes of a table."""
        return _unit_text(self.unit.si)

    @property
    def unit_text(self) -> str:
        """Unit for reading."""
        return _unit_text(self.unit.shown)

    @property
    def group_name(self) -> str:
        """Name under which studies choose all its numbers."""
        return self.group or self.name

    def response_name(self, labels: Iterable[str]) -> str:
        """Return the name of one number, such as `Dx` or `amplitude_Xr`."""
        parts = (self.group_name, *labels)
        return ("" if len(self.group_name) == 1 else "_").join(parts)

    def title_of(self, labels: Iterable[str]) -> str:
        """Return the words for one number."""
        return (self.title or f"{self.kind} {{}}").format(" ".join(labels)).strip()

    def short_title_of(self, labels: Iterable[str]) -> str:
        """Return the words for one number in a narrow table."""
        labels = tuple(labels)
        return self.short.format(" ".join(labels)) if self.short else self.title_of(labels)


detail = partial(Variable, is_response=False, is_in_spin=False, studio=None)
"""Declare a variable that only tables of runs and their files have."""


@dataclass(frozen=True)
class Measure:
    """What is measured of a run.

    Attributes:
        name: Name by which commands and `wm_drake.simulate_many` choose it.
        variables: What it returns.
        evaluate: Function that evaluates it for runs side by side.
        needs: What it reads of a run beyond time, drum and motor, names in
            `wm_drake.simulation.measures.run.Need`.
        has_table: Whether the page of `spin` has a table of it that is made from this declaration.
        applies: Whether a machine has what it measures. Of others it has no responses, and pages
            do not show it.
    """

    name: str
    variables: tuple[Variable, ...]
    evaluate: Evaluate
    needs: tuple[Need, ...] = ()
    has_table: bool = True
    applies: Callable[[MachineParameters], bool] = lambda machine: True

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables."""
        return tuple(variable.name for variable in self.variables)

    @property
    def is_in_spin(self) -> bool:
        """Whether every spin run has it."""
        return any(variable.is_in_spin for variable in self.variables)


def each_run(evaluate: Callable[[Run], Sequence[FloatArray]]) -> Evaluate:
    """Return the evaluator of runs side by side that evaluates one run after the other."""

    def evaluate_all(runs: Sequence[Run]) -> Sequence[FloatArray]:
        columns = zip(*(evaluate(run) for run in runs), strict=True)
        return [np.stack(column) for column in columns]

    return evaluate_all


def _unit_text(unit: str) -> str:
    return "" if unit == "dimensionless" else unit.replace("*", " ")
