"""The linear map from free quantities to the values of a machine."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import ValidationError

from wm_drake.errors import InputError, Problem, nearest_names
from wm_drake.model.bodies import with_sdf_values
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.free import FreeFile, FreeQuantity, KnownQuantity, Measured
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit, dimension, from_base

COMPONENTS = {"x": 0, "y": 1, "z": 2}


@dataclass(frozen=True)
class Value:
    """A value of the machine that depends on free quantities.

    Attributes:
        path: Names and indices that lead to the value in the tree of parameters.
        component: Index of the component of a vector; None for the whole value.
        factors: (quantities, 1 or points) factors of each free quantity: one for a number, several
            for the column of a table.
        constant: (1 or points) what the known quantities add.
        reasons: Texts of the known quantities that enter.
        is_list: Whether the value is the column of a table.
    """

    path: tuple[str, ...]
    component: int | None
    factors: FloatArray
    constant: FloatArray
    reasons: tuple[str, ...]
    is_list: bool


@dataclass(frozen=True)
class KnownRatio:
    """What is known of the ratio of one free quantity to a weighted sum of others.

    Attributes:
        name: Name of the relation.
        quantity: Index of the quantity.
        factors: (quantities) weights of the sum.
        ratio, deviation: Expected or largest ratio, and its standard deviation.
        is_limit: Whether `ratio` is the largest one. Then smaller ratios are as good.
    """

    name: str
    quantity: int
    factors: FloatArray
    ratio: float
    deviation: float
    is_limit: bool

    def at(self, points: FloatArray) -> FloatArray:
        """Return the ratio (point) at points (point, quantity)."""
        return np.asarray(points[:, self.quantity] / (points @ self.factors))

    def residuals(self, points: FloatArray) -> FloatArray:
        """Return (ratio - expected) / deviation (point); 0 where a largest ratio is not reached."""
        residual = (self.at(points) - self.ratio) / self.deviation
        return np.maximum(residual, 0.0) if self.is_limit else residual


@dataclass(frozen=True)
class ParameterMap:
    """The free quantities of a machine and the values that depend on them.

    Arrays have one entry for each quantity, in SI units.

    Attributes:
        base: The machine, with explicit values for all that may change.
        names, units: Names of the quantities and the units in which they are written.
        lower, upper: Bounds.
        expected, deviation: Prior: expected values and standard deviations.
        start: Point where searches start.
        values: Values of the machine that depend on the quantities.
        preload: Expected preload of each spring and its standard deviation; None without a prior.
            [N]
        elongation: Smallest elongation of the springs and its standard deviation; None if any is
            as good. [m]
        relations: What is known of ratios of quantities.
    """

    base: MachineParameters
    names: tuple[str, ...]
    units: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray
    expected: FloatArray
    deviation: FloatArray
    start: FloatArray
    values: tuple[Value, ...]
    preload: tuple[float, float] | None
    elongation: tuple[float, float] | None
    relations: tuple[KnownRatio, ...]
    _tree: dict[str, Any]

    def prior_residuals(
        self, points: FloatArray, preload: FloatArray, elongation: FloatArray
    ) -> FloatArray:
        """Return the residuals of what is known beside the priors of the quantities.

        Args:
            points: (point, quantity) in SI units.
            preload: (point, spring) preloads. [N]
            elongation: (point, spring) smallest elongations from the free length. [m]

        Returns:
            (point, n) in standard deviations: preloads, relations, then elongations. An elongation
            above the smallest one gives 0.
        """
        parts = [relation.residuals(points)[:, None] for relation in self.relations]
        if self.elongation is not None:
            least, deviation = self.elongation
            parts.append(np.maximum(least - elongation, 0.0) / deviation)
        if self.preload is not None:
            expected, deviation = self.preload
            parts.insert(0, (preload - expected) / deviation)
        return np.hstack([np.empty((len(points), 0)), *parts])

    def parameters_at(self, point: FloatArray) -> MachineParameters:
        """Return the machine at a point.

        Args:
            point: Values of the free quantities, in SI units.

        Raises:
            InputError: a value of the machine is not allowed.
        """
        tree = dict(self._tree)
        for value in self.values:
            set_to = value.constant + np.asarray(point) @ value.factors
            if np.count_nonzero(value.factors) > set_to.size:
                # 15 digits, so that the sum is short in a file
                set_to = np.array([float(f"{number:.15g}") for number in set_to])
            _set(tree, value, tuple(map(float, set_to)) if value.is_list else float(set_to[0]))
        try:
            return MachineParameters.model_validate(tree)
        except ValidationError as error:
            raise InputError(problems_of(error, MachineParameters)) from None


def parameter_map_of(machine: Machine, free: FreeFile) -> ParameterMap:
    """Return the parameter map of a free file for a machine.

    Raises:
        InputError: the machine does not have a key, or a factor has the wrong dimension or the
            wrong number of values.
    """
    listed: dict[str, FreeQuantity | KnownQuantity] = {**free.quantities, **free.known}
    keys = list(dict.fromkeys(key for quantity in listed.values() for key in quantity.sets))
    base = with_sdf_values(machine.plant, machine.parameters, keys)
    known = {key: (value, unit) for key, value, unit in quantities(base)}
    problems: list[Problem] = []
    values = []
    for key in keys:
        try:
            values.append(_value(key, known, free))
        except ValueError as error:
            first = next(name for name, quantity in listed.items() if key in quantity.sets)
            section = "quantities" if first in free.quantities else "known"
            problems.append(Problem("", f"{section}.{first}.sets", f"'{key}' {error}"))
    if problems:
        raise InputError(problems)
    entries = list(free.quantities.values())
    pairs = np.array([[*q.bounds.values, *q.prior.values] for q in entries])
    names, units = tuple(free.quantities), tuple(q.unit for q in entries)
    lower, upper, expected, deviation = pairs.T
    start = np.array([(q.start or q.prior).values[0] for q in entries])
    tree = base.model_dump(exclude_unset=True)
    preload = elongation = None
    if free.spring_elongation is not None:
        elongation = (
            free.spring_elongation.at_least.values[0],
            free.spring_elongation.at_least.values[1],
        )
    if free.spring_preload is not None:
        preload = (free.spring_preload.prior.values[0], free.spring_preload.prior.values[1])
    return ParameterMap(
        base,
        names,
        units,
        lower,
        upper,
        expected,
        deviation,
        start,
        tuple(values),
        preload,
        elongation,
        tuple(_known_ratios(free)),
        tree,
    )


def _known_ratios(free: FreeFile) -> Iterator[KnownRatio]:
    names = list(free.quantities)
    for name, relation in free.relations.items():
        pair = relation.at_most or relation.prior
        assert pair is not None  # the file was checked
        factors = np.array([relation.to[n].values[0] if n in relation.to else 0.0 for n in names])
        yield KnownRatio(
            name,
            names.index(relation.quantity),
            factors,
            pair.values[0],
            pair.values[1],
            relation.at_most is not None,
        )


def _value(key: str, known: Mapping[str, tuple[Any, Unit]], free: FreeFile) -> Value:
    name, _, last = key.rpartition(".")
    component = None
    if key not in known and last in COMPONENTS and name in known:
        component, shape_key = COMPONENTS[last], name
    elif key in known:
        shape_key = key
    else:
        raise ValueError(f"is not a number of the machine{nearest_names(key, known)}")
    value, unit = known[shape_key]
    is_list = isinstance(value, tuple) and component is None
    size = len(value) if is_list else 1

    def factors(quantity: FreeQuantity | KnownQuantity) -> FloatArray:
        factor = quantity.sets.get(key)
        if factor is None:
            return np.zeros(size)
        return _factor(factor, quantity.unit, unit, size, is_list)

    entering = {name: entry for name, entry in free.known.items() if key in entry.sets}
    constant = sum(
        (entry.value.values[0] * factors(entry) for entry in entering.values()), np.zeros(size)
    )
    return Value(
        tuple(shape_key.split(".")),
        component,
        np.array([factors(quantity) for quantity in free.quantities.values()]),
        constant,
        tuple(_known_text(name, entry) for name, entry in entering.items()),
        is_list,
    )


def _known_text(name: str, entry: KnownQuantity) -> str:
    """Return a text such as ``drum_mass 9 kg (parts list)``."""
    value = f"{from_base(entry.value.values[0], entry.unit):.10g} {entry.unit}".rstrip()
    return f"{name} {value} ({entry.source})"


def _factor(
    factor: Measured, quantity_unit: str, unit: Unit, size: int, is_list: bool
) -> FloatArray:
    if factor.is_list != is_list or len(factor.values) != size:
        wanted = f"a list of {size} factors" if is_list else "one factor"
        raise ValueError(f"needs {wanted}, not {len(factor.values)}")
    if dimension(quantity_unit) * dimension(factor.unit) != dimension(unit.si):
        written = " times ".join(filter(None, [quantity_unit, factor.unit])) or "a pure number"
        raise ValueError(f"needs a unit such as {unit.shown}, but {written} is not of this kind")
    return np.array(factor.values)


def _set(tree: dict[str, Any], value: Value, number: Any) -> None:
    """Set a value in a tree; containers on the path are copied, so the base does not change."""
    node: Any = tree
    *parents, last = value.path
    for part in parents:
        at: Any = int(part) if isinstance(node, list) else part
        child = node[at]
        node[at] = dict(child) if isinstance(child, dict) else list(child)
        node = node[at]
    place: Any = int(last) if isinstance(node, list) else last
    if value.component is None:
        node[place] = number
    else:
        vector = list(node[place])
        vector[value.component] = number
        node[place] = tuple(vector)
