"""The linear map from free quantities to the values of a machine."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wm_drake.errors import InputError, Problem, nearest_names
from wm_drake.model.bodies import with_sdf_values
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, with_values
from wm_drake.parameters.free import FreeFile, FreeQuantity, KnownQuantity, Measured
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit, dimension, from_base, with_base
from wm_drake.studies.fitting.problem import Unknown

COMPONENTS = {"x": 0, "y": 1, "z": 2}


@dataclass(frozen=True)
class FreeValue:
    """A value of the machine that depends on free quantities.

    Attributes:
        key: Key path of the value; of the whole vector if it is one component of it.
        component: Index of the component of a vector; None for the whole value.
        factors: (quantities, 1 or points) factors of each free quantity: one for a number, several
            for the column of a table.
        constant: (1 or points) what the known quantities add.
        reasons: Texts of the known quantities that enter.
        is_list: Whether the value is the column of a table.
    """

    key: str
    component: int | None
    factors: FloatArray
    constant: FloatArray
    reasons: tuple[str, ...]
    is_list: bool

    def changes(self, point: FloatArray) -> dict[str, Any]:
        """Return the value at a point (quantities), by key path. [SI]"""
        sums = self.constant + np.asarray(point) @ self.factors
        if np.count_nonzero(self.factors) > sums.size:
            # 15 digits, so that the sum is short in a file
            sums = np.array([float(f"{number:.15g}") for number in sums])
        key = self.key if self.component is None else f"{self.key}.{self.component}"
        return {key: tuple(map(float, sums)) if self.is_list else float(sums[0])}


@dataclass(frozen=True)
class KnownRatio:
    """What is known of the ratio of one free quantity to a weighted sum of others.

    Attributes:
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
        unknowns: The quantities, each with the unit in which it is written, bounds, prior and the
            point where searches start.
        values: Values of the machine that depend on the quantities.
        preload: Expected preload of each spring and its standard deviation; None without a prior.
            [N]
        elongation: Smallest elongation of the springs and its standard deviation; None if any is
            as good. [m]
        relations: What is known of ratios of quantities.
    """

    base: MachineParameters
    unknowns: tuple[Unknown, ...]
    values: tuple[FreeValue, ...]
    preload: tuple[float, float] | None
    elongation: tuple[float, float] | None
    relations: tuple[KnownRatio, ...]

    @property
    def names(self) -> list[str]:
        """Names of the quantities."""
        return [unknown.name for unknown in self.unknowns]

    @property
    def lower(self) -> FloatArray:
        """Lower bounds."""
        return np.array([unknown.lower for unknown in self.unknowns])

    @property
    def upper(self) -> FloatArray:
        """Upper bounds."""
        return np.array([unknown.upper for unknown in self.unknowns])

    @property
    def start(self) -> FloatArray:
        """Point where searches start."""
        return np.array([unknown.start for unknown in self.unknowns])

    @property
    def expected(self) -> FloatArray:
        """Expected values."""
        return self._priors[0]

    @property
    def deviation(self) -> FloatArray:
        """Standard deviations of the priors."""
        return self._priors[1]

    @property
    def _priors(self) -> FloatArray:
        """Expected values and standard deviations (2, quantity)."""
        return np.reshape([unknown.prior for unknown in self.unknowns], (-1, 2)).T

    def in_units(self, values: FloatArray) -> FloatArray:
        """Return values (quantity) in the units in which the quantities are written."""
        pairs = zip(values.tolist(), self.unknowns, strict=True)
        return np.array([unknown.unit.from_si(value) for value, unknown in pairs])

    def prior_residuals(
        self, points: FloatArray, preload: FloatArray, elongation: FloatArray
    ) -> FloatArray:
        """Return the residuals of what is known besides the priors of the quantities.

        Args:
            points: (point, quantity) in SI units.
            preload: (point, spring) preloads. [N]
            elongation: (point, spring) smallest elongations from the free length. [m]

        Returns:
            (point, n) in standard deviations: preloads, relations, then elongations. An elongation
            above the smallest one gives 0.
        """
        parts = [self.relation_residuals(points)]
        if self.elongation is not None:
            least, deviation = self.elongation
            parts.append(np.maximum(least - elongation, 0.0) / deviation)
        if self.preload is not None:
            expected, deviation = self.preload
            parts.insert(0, (preload - expected) / deviation)
        return np.hstack(parts)

    def relation_residuals(self, points: FloatArray) -> FloatArray:
        """Return the residuals of the relations (point, n), in standard deviations."""
        parts = [relation.residuals(points)[:, None] for relation in self.relations]
        return np.hstack([np.empty((len(points), 0)), *parts])

    def parameters_at(self, point: FloatArray) -> MachineParameters:
        """Return the machine at a point.

        Args:
            point: Values of the free quantities, in SI units.

        Raises:
            InputError: a value of the machine is not allowed.
        """
        changes: dict[str, Any] = {}
        for value in self.values:
            changes |= value.changes(point)
        return with_values(self.base, changes)


def parameter_map_of(machine: Machine, free: FreeFile) -> ParameterMap:
    """Return the parameter map of a free file for a machine.

    Raises:
        InputError: the machine does not have a key, or a factor has the wrong dimension or the
            wrong number of values.
    """
    listed: dict[str, FreeQuantity | KnownQuantity] = {**free.quantities, **free.known}
    keys = list(dict.fromkeys(key for quantity in listed.values() for key in quantity.sets))
    base = with_sdf_values(machine.drawn.plant, machine.parameters, keys)
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
    return ParameterMap(
        base,
        tuple(_unknown(name, quantity) for name, quantity in free.quantities.items()),
        tuple(values),
        None if free.spring_preload is None else free.spring_preload.prior.pair,
        None if free.spring_elongation is None else free.spring_elongation.at_least.pair,
        tuple(_known_ratios(free)),
    )


def _unknown(name: str, quantity: FreeQuantity) -> Unknown:
    lower, upper = quantity.bounds.pair
    start = (quantity.start or quantity.prior).values[0]
    return Unknown(
        name,
        lower,
        upper,
        with_base(quantity.unit),
        float(np.clip(start, lower, upper)),
        prior=quantity.prior.pair,
    )


def _known_ratios(free: FreeFile) -> Iterator[KnownRatio]:
    names = list(free.quantities)
    for name, relation in free.relations.items():
        pair = relation.at_most or relation.prior
        assert pair is not None  # the file was checked
        factors = np.array([relation.to[n].values[0] if n in relation.to else 0.0 for n in names])
        yield KnownRatio(
            name, names.index(relation.quantity), factors, *pair.pair, relation.at_most is not None
        )


def _value(key: str, known: Mapping[str, tuple[Any, Unit]], free: FreeFile) -> FreeValue:
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
    return FreeValue(
        shape_key,
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
        needed = f"a list of {size} factors" if is_list else "one factor"
        raise ValueError(f"needs {needed}, not {len(factor.values)}")
    if dimension(quantity_unit) * dimension(factor.unit) != dimension(unit.si):
        written = " times ".join(filter(None, [quantity_unit, factor.unit])) or "a pure number"
        raise ValueError(f"needs a unit such as {unit.shown}, but {written} is not of this kind")
    return np.array(factor.values)
