"""The numbers of a machine that vary, as unknowns of a fit, and what else is known of them."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wm_drake.errors import input_error, nearest_names
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.sums import measured
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import dimension, from_base, split, to_base
from wm_drake.parameters.variation import range_of
from wm_drake.parameters.vary_file import Relation, VaryFile
from wm_drake.parameters.varying import Varied, Varying, each
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.free_numbers import FreeNumbers
from wm_drake.studies.fitting.problem import Unknown
from wm_drake.studies.vary import in_vary_file, varying_of


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
class ParameterMap(FreeNumbers):
    """The numbers of a vary file, each with a prior, and what is known of them together.

    Arrays have one entry for each number, in SI units.

    Attributes:
        preload: Expected preload of each spring and its standard deviation; None without a prior.
            [N]
        elongation: Smallest elongation of the springs and its standard deviation; None if any is
            as good. [m]
        relations: What is known of ratios of quantities.
    """

    preload: tuple[float, float] | None = None
    elongation: tuple[float, float] | None = None
    relations: tuple[KnownRatio, ...] = ()

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
        parts = [self.known(points)]
        if self.elongation is not None:
            least, deviation = self.elongation
            parts.append(np.maximum(least - elongation, 0.0) / deviation)
        if self.preload is not None:
            expected, deviation = self.preload
            parts.insert(0, (preload - expected) / deviation)
        return np.hstack(parts)

    def known(self, points: FloatArray) -> FloatArray:
        """Return the residuals of the relations (point, n), in standard deviations."""
        parts = [relation.residuals(points)[:, None] for relation in self.relations]
        return np.hstack([np.empty((len(points), 0)), *parts])

    def solved(self, fit: Fit, source: str) -> MachineParameters:
        """Return the machine with the numbers of a fit; `source` says where they come from."""
        machine = self.machine_of(fit, f"_{self.ending}")
        about = f"{machine.about} Calibrated: {source}.".strip()
        return machine.model_copy(update={"about": about})

    def machine_of(self, fit: Fit, ending: str = "") -> MachineParameters:
        """Return the machine with the numbers of a fit.

        The source of each fitted number is "fit: " followed by the text of `_texts_of`, and
        "assumption: " followed by the known numbers that enter.

        Args:
            fit: Fit whose first unknowns are the numbers.
            ending: End of the name of the machine.
        """
        texts, parts = self._texts_of(fit), dict[str, dict[str, list[str]]]()
        for key, entering, known in self.varying.origins():
            of_key = parts.setdefault(key, {"fit: ": [], "assumption: ": []})
            of_key["fit: "] += [texts[index] for index in entering]
            of_key["assumption: "] += known
        fitted = {
            key: "; ".join(
                kind + "; ".join(dict.fromkeys(listed)) for kind, listed in kinds.items() if listed
            )
            for key, kinds in parts.items()
        }
        parameters = self.parameters_at(self._rounded(fit))
        others = {
            key: text
            for key, text in parameters.sources.items()
            if not any(key.startswith(f"{k}.") for k in fitted)
        }
        name = f"{parameters.name}{ending}"
        return parameters.model_copy(update={"name": name, "sources": {**others, **fitted}})

    def _texts_of(self, fit: Fit) -> list[str]:
        """Return for each number ``damper_friction 27.5 ± 2.1 N (expected 35 ± 9 N)``."""
        texts, values = [], self.in_units(self._rounded(fit))
        expected, deviation = self.in_units(self.expected), self.in_units(self.deviation)
        posterior = fit.remaining[: len(deviation)] * deviation
        for index, unknown in enumerate(self.unknowns):
            after, before = (
                f"{n[index]:.10g} ± {_short(s[index])} {unknown.unit.shown}".rstrip()
                for n, s in ((values, posterior), (expected, deviation))
            )
            texts.append(f"{unknown.name} {after} (expected {before})")
        return texts

    def _rounded(self, fit: Fit) -> FloatArray:
        """Return the point of a fit, rounded to about 0.1 % of the prior's standard deviation.

        The rounding is decimal in the unit in which each number is written.
        """
        point, deviations = [], self.deviation.tolist()
        for unknown, *sizes in zip(self.unknowns, fit.values.tolist(), deviations, strict=False):
            value, deviation = (from_base(size, unknown.unit.shown) for size in sizes)
            digits = 3 - math.floor(math.log10(deviation))
            point.append(to_base(round(value, digits), unknown.unit.shown))
        return np.clip(point, self.lower, self.upper)


def _short(number: float) -> str:
    return f"{number:.0f}" if abs(number) >= 100.0 else f"{number:.2g}"


def parameter_map_of(machine: Machine, file: VaryFile) -> ParameterMap:
    """Return the parameter map of a machine.

    Priors are normal; that of another distribution has its mean and deviation.

    Raises:
        InputError: the machine does not have a key, a factor has the wrong dimension or the wrong
            number of values, or a number has no bounds or no prior.
    """
    varying = varying_of(machine, file.entries(), file.known)
    unknowns = each(_unknown, varying.by_name)
    preload, elongation = file.spring_preload, file.spring_elongation
    return ParameterMap(
        varying,
        tuple(unknowns),
        preload=_pair(preload.prior, "N", "spring_preload") if preload else None,
        elongation=_pair(elongation.at_least, "mm", "spring_elongation") if elongation else None,
        relations=tuple(_known_ratios(varying, file.relations)),
    )


def read_parameter_map(machine: Machine, path: Path, file: VaryFile) -> ParameterMap:
    """Return the parameter map of a machine; problems have the line of the file."""
    with in_vary_file(path, file):
        return parameter_map_of(machine, file)


def _unknown(varied: Varied) -> Unknown:
    lower, upper = varied.needed("low", "high", study="a fit")
    mean, deviation = varied.prior(study="a fit")
    if not lower <= mean <= upper:
        raise input_error("the expected value is outside the bounds", key=varied.name)
    start = float(np.clip(varied.at.get("start", mean), lower, upper))
    return Unknown(varied.name, lower, upper, varied.unit, start, prior=(mean, deviation))


def _pair(text: str, unit: str, key: str) -> tuple[float, float]:
    """Return a value and its standard deviation. [SI]

    Raises:
        InputError: they have another dimension, or the deviation is not above 0.
    """
    ends = range_of(text)
    try:
        pairs = [measured(end) for end in ends or ()]
    except ValueError as error:
        raise input_error(str(error), key=key) from None
    if len(pairs) != 2 or any(dimension(written) != dimension(unit) for _, written in pairs):
        example = f"(2, 1) {unit}".rstrip()
        raise input_error(f"'{text}' is not a pair of numbers such as '{example}'", key=key)
    if not pairs[1][0] > 0.0:
        raise input_error("the standard deviation must be above 0", key=key)
    return pairs[0][0], pairs[1][0]


def _known_ratios(varying: Varying, relations: dict[str, Relation]) -> Iterator[KnownRatio]:
    """Yield what is known of ratios.

    Raises:
        InputError: a relation names no number that varies, or has another dimension.
    """
    names = varying.names
    for label, relation in relations.items():
        key = f"relations.{label}"
        for name in (relation.quantity, *relation.to):
            if name not in names:
                raise input_error(f"no quantity '{name}'{nearest_names(name, names)}", key=key)
        index = names.index(relation.quantity)
        factors = np.zeros(len(names))
        for name, text in relation.to.items():
            (factor, *others), written, _ = split(text)
            unit = varying.every[names.index(name)].unit
            product = dimension(unit.shown) * dimension(written)
            if others or product != dimension(varying.every[index].unit.shown):
                message = f"{name} times its factor has not the dimension of {relation.quantity}"
                raise input_error(message, key=key)
            factors[names.index(name)] = to_base(factor, written)
        pair = _pair(relation.at_most or relation.prior or "", "", key)
        yield KnownRatio(label, index, factors, *pair, relation.at_most is not None)
