"""Uncertain quantities of a machine: what each one changes, and its distribution in SI units."""

import dataclasses
import itertools
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import ValidationError

from wm_drake.errors import InputError, InputNotice, Problem, check_known, input_error, problems_at
from wm_drake.parameters import (
    Change,
    Load,
    MachineParameters,
    Unbalance,
    Variation,
    apply,
    variation_of,
    with_values,
)
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.tolerances import LAUNDRY, TRUNCATED, Laundry, Spread, Tolerances
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share, Unit
from wm_drake.parameters.variation import change_of, changes_of, number_at, owned_twice
from wm_drake.report.formatting import shape_name
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.cases import Case
from wm_drake.studies.tolerance.distributions import (
    Joint,
    Marginal,
    lognormal,
    normal,
    triangular,
    uniform,
)

KEPT_MACHINES = 64
"""How many machines are cached; samples with the same parts follow each other."""

_LAUNDRY = {
    "mass": Quantity("mass of the laundry", Unit("kg", "g")),
    "angle": Quantity("angle of the laundry", Unit("rad", "deg")),
    "y": Quantity("axial place of the laundry", Unit("m", "mm")),
    "radius": Quantity("radius of the laundry", Unit("m", "mm")),
    "second_share": Quantity("share of the second lump", Share()),
    "second_angle": Quantity("angle of the second lump", Unit("rad", "deg")),
    "second_y": Quantity("axial place of the second lump", Unit("m", "mm")),
}
"""Quantities of the laundry by the fields of `Laundry`."""

_TYPES = {
    "spring_types": (("springs", "type"),),
    "damper_types": (("dampers", "type"), ("telescopic_dampers", "type")),
    "bushing_types": (
        ("telescopic_dampers", "tub_bushing"),
        ("telescopic_dampers", "housing_bushing"),
    ),
}
"""Tables whose parts name a type, by table of the types, with the key that names it."""


@dataclass(frozen=True)
class UncertainVariable:
    """An uncertain quantity: a variation with a distribution.

    Attributes:
        variation: What it changes; no numbers for the laundry.
        marginal: Distribution. [1 for percent, else SI]
        text: The distribution in words.
        source: Where its numbers come from.
    """

    variation: Variation
    marginal: Marginal
    text: str
    source: str

    @property
    def name(self) -> str:
        """Name of the quantity."""
        return self.variation.name

    @property
    def quantity(self) -> Quantity:
        """Words and unit."""
        kind, _, field = self.name.partition(".")
        if kind == LAUNDRY and field in _LAUNDRY:
            return _LAUNDRY[field]
        return Quantity(shape_name(self.name.replace(".", " ")), self.variation.unit)

    @property
    def is_laundry(self) -> bool:
        """Whether it is a quantity of the laundry."""
        return not self.variation.numbers

    @property
    def is_of_load(self) -> bool:
        """Whether it is the laundry or a number of a load, which no tolerance of a part limits."""
        return all(key.startswith("loads.") for key in self.variation.keys)


@dataclass(frozen=True)
class UncertainMachine:
    """A machine with uncertain quantities: samples become cases.

    Attributes:
        parameters: The machine. It contains all numbers that change.
        variables: Uncertain quantities.
        joint: Their distribution.
        case: Case of the machine without changes; its load is not used if the laundry is drawn.
    """

    parameters: MachineParameters
    variables: tuple[UncertainVariable, ...]
    joint: Joint
    case: Case
    _known: dict[tuple[float, ...], MachineParameters] = dataclasses.field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def cases(self, scores: FloatArray, first: int = 1) -> Iterator[Case]:
        """Yield the case of each sample.

        Args:
            scores: Independent standard normal scores. (n, variables)
            first: Number of the first sample, for the names of the cases.

        Raises:
            InputError: a sample is not a machine.
        """
        for number, values in enumerate(self.joint.values(scores), start=first):
            with problems_at(f"sample {number}"):
                case = self._case(f"sample {number}", values.tolist())
            yield case

    def _case(self, name: str, values: Sequence[float]) -> Case:
        pairs = list(zip(self.variables, values, strict=True))
        laundry = {v.name.removeprefix(f"{LAUNDRY}."): x for v, x in pairs if v.is_laundry}
        parameters = self._machine_with(tuple(x for v, x in pairs if not v.is_laundry))
        load = laundry_load(laundry) if laundry else parameters.loads[self.case.name]
        return Case(name, load, self.case.profile, parameters=parameters)

    def _machine_with(self, values: tuple[float, ...]) -> MachineParameters:
        """Return the machine with values of its variations, the same one for the same values.

        The samples of Sobol indices exchange one quantity at a time: half of their machines differ
        in the laundry only, and each machine is prepared once.
        """
        if not values:
            return self.parameters
        if values not in self._known:
            if len(self._known) >= KEPT_MACHINES:
                del self._known[next(iter(self._known))]
            variations = [v.variation for v in self.variables if not v.is_laundry]
            self._known[values] = apply(self.parameters, variations, values)
        return self._known[values]

    def check(self, is_usable: Callable[[Case], None]) -> None:
        """Check the machine at both ends of each quantity, the others at their medians.

        Args:
            is_usable: Raises an InputError if a case cannot be run.

        Raises:
            InputError: a quantity reaches a value that is not allowed.
        """
        problems = []
        medians = self.joint.values(np.zeros((1, len(self.variables))))[0]
        for index, variable in enumerate(self.variables):
            ends = variable.marginal.values(np.array([-np.inf, np.inf]))
            for end, value in zip(("lower", "upper"), ends, strict=True):
                values = medians.copy()
                values[index] = value
                try:
                    is_usable(self._case(f"{end} end of {variable.name}", values.tolist()))
                except InputError as error:
                    hint = "; truncate it with low and high" if "normal" in variable.text else ""
                    problems += [
                        Problem(
                            f"quantity {variable.name}",
                            p.key,
                            f"its {end} end is not allowed: {p.message}{hint}",
                        )
                        for p in error.problems
                    ]
        if problems:
            raise InputError(problems)


def laundry_load(values: dict[str, float]) -> Load:
    """Return the load of a lump of laundry, or of two.

    Args:
        values: SI values by the names of the fields of `Laundry`.
    """
    share = values.get("second_share", 0.0)
    if not 0.0 <= share <= 1.0:
        raise input_error(f"{share:.3g} is not a share from 0 to 1", key=f"{LAUNDRY}.second_share")
    first = {
        "mass": values["mass"] * (1.0 - share),
        "radius": values["radius"],
        "y": values["y"],
        "phase": values["angle"],
    }
    lumps = [first]
    if "second_share" in values:
        phase = values["angle"] + values["second_angle"]
        second = {"mass": values["mass"] * share, "y": values["second_y"], "phase": phase}
        lumps.append(first | second)
    try:
        return Load(unbalances=tuple(Unbalance.model_validate(lump) for lump in lumps))
    except ValidationError as error:
        raise InputError(problems_of(error, Unbalance, LAUNDRY)) from None


def uncertain_machine(
    parameters: MachineParameters, tolerances: Tolerances, case: Case
) -> UncertainMachine:
    """Return a machine with the uncertain quantities of a tolerance file.

    Args:
        parameters: The machine, with the numbers of the SDF that the file names
            (`wm_drake.model.bodies.with_sdf_values`).
        case: Case of the machine without changes.

    Raises:
        InputError: the machine does not have a key, a distribution is wrong, or the correlations
            name an unknown quantity.
    """
    variables: list[UncertainVariable] = []
    groups = {name: quantity.keys for name, quantity in tolerances.quantities.items()}
    problems = owned_twice(groups, "quantity")
    for name, quantity in tolerances.quantities.items():
        try:
            parameters, draws = _groups(parameters, name, quantity.keys, quantity.draws)
            for draw, keys in draws.items():
                if kept := _that_scatter(parameters, draw, keys, quantity):
                    variables.append(_variable(parameters, draw, kept, quantity, quantity.about))
        except InputError as error:
            problems += [Problem(f"quantity {name}", p.key, p.message) for p in error.problems]
    if tolerances.laundry is not None:
        laundry, wrong = _laundry_variables(tolerances.laundry)
        variables, problems = [*variables, *laundry], [*problems, *wrong]
    if problems:
        raise InputError(problems)
    factor = _correlation_factor(tolerances, [v.name for v in variables])
    joint = Joint(tuple(v.marginal for v in variables), factor)
    return UncertainMachine(
        parameters, tuple(variables), joint, replace(case, parameters=parameters)
    )


def _groups(
    parameters: MachineParameters, name: str, keys: tuple[str, ...], draws: str
) -> tuple[MachineParameters, dict[str, tuple[str, ...]]]:
    """Return the keys that share a draw, by name of the draw.

    For one draw each, a type that several parts share is replaced by a type for each part.
    """
    if draws == "one":
        return parameters, {name: keys}
    groups: dict[str, tuple[str, ...]] = {}
    for key in keys:
        table, _, rest = key.partition(".")
        kind, _, field = rest.partition(".")
        if table in _TYPES and field and kind in getattr(parameters, table):
            parameters, types = with_types_apart(parameters, table, kind)
            groups |= {f"{name}.{part}": (f"{table}.{t}.{field}",) for part, t in types.items()}
        else:
            groups[f"{name}.{key}" if len(keys) > 1 else name] = (key,)
    return parameters, groups


def _that_scatter(
    parameters: MachineParameters, name: str, keys: tuple[str, ...], spread: Spread
) -> tuple[str, ...]:
    """Return the keys of a quantity without those of which it gives percents of 0, with a notice.

    A machine without this damping or stiffness has nothing there that scatters.
    """
    kept = []
    for key in keys:
        number = number_at(parameters, key)
        change, _ = changes_of(_places(spread), number.unit, key)
        if change is Change.PERCENT and number.nominal == 0.0:
            message = f"quantity {name}: {key} is 0, so percents of it do not scatter; left out"
            warnings.warn(message, InputNotice, stacklevel=2)
        else:
            kept.append(key)
    return tuple(kept)


def with_types_apart(
    parameters: MachineParameters, table: str, kind: str
) -> tuple[MachineParameters, dict[str, str]]:
    """Return a machine in which each part has a separate type, and the types by part.

    Args:
        table: spring_types, damper_types or bushing_types.
        kind: Name of the type that is replaced.
    """
    types = dict(getattr(parameters, table))
    changes: dict[str, Any] = {}
    by_part: dict[str, str] = {}
    for parts, field in _TYPES[table]:
        for part, element in getattr(parameters, parts).items():
            if getattr(element, field) == kind:
                label = f"{part}_{field.removesuffix('_bushing')}" if "bushing" in field else part
                by_part[label] = f"{kind}_{label}"[-64:]
                types[by_part[label]] = types[kind]
                changes[f"{parts}.{part}.{field}"] = by_part[label]
    if len(by_part) < 2:
        only = next(iter(by_part), "")
        return parameters, {only: kind} if only else {kind: kind}
    return with_values(with_values(parameters, {table: types}), changes), by_part


def _laundry_variables(laundry: Laundry) -> tuple[list[UncertainVariable], list[Problem]]:
    variables, problems = [], []
    for field, spread in laundry.spreads().items():
        name, unit = f"{LAUNDRY}.{field}", _LAUNDRY[field].unit
        variation = Variation(name, (), Change.VALUE, unit)
        try:
            change, values = changes_of(_places(spread), unit, name)
            if change is not Change.VALUE:
                raise input_error(f"needs values with a unit, such as '1 {unit.shown}'", key=name)
            variables.append(_with_spread(variation, spread, values, name))
        except InputError as error:
            problems += [Problem(LAUNDRY, p.key or name, p.message) for p in error.problems]
    return variables, problems


def _variable(
    parameters: MachineParameters, name: str, keys: tuple[str, ...], spread: Spread, about: str
) -> UncertainVariable:
    variation, values = variation_of(parameters, name, keys, _places(spread), about)
    return _with_spread(variation, spread, values, keys[-1])


def _places(spread: Spread) -> dict[str, str]:
    """Return the texts of a distribution by name, without its standard deviation."""
    texts = {name: getattr(spread, name) for name in ("mean", "mode", "low", "high")}
    return {name: text for name, text in texts.items() if text is not None}


def _with_spread(
    variation: Variation, spread: Spread, values: dict[str, float], key: str
) -> UncertainVariable:
    """Return a variation with a distribution.

    Args:
        values: Values of `_places`. [1 for percent, else SI]
        key: Key path for messages.

    Raises:
        InputError: the deviation has another form or unit, or the ends are not in order.
    """
    change = variation.change
    if spread.deviation is not None:
        form = Change.PERCENT if change is Change.PERCENT else Change.VALUE
        unit = variation.numbers[0].unit if variation.numbers else variation.unit
        given, deviation = change_of(spread.deviation, unit, f"{key}.deviation")
        if given is not form or deviation <= 0.0:
            what = "in percent" if form is Change.PERCENT else "a value with a unit"
            message = f"'{spread.deviation}' is not {what} above 0"
            raise input_error(message, key=f"{key}.deviation")
        values = values | {"deviation": deviation}
    marginal = _marginal(spread, values, key, can_be_negative=change is Change.DISTANCE)
    return UncertainVariable(variation, marginal, _text(variation, spread, values), spread.source)


def _marginal(spread: Spread, n: dict[str, float], key: str, *, can_be_negative: bool) -> Marginal:
    kind = spread.distribution
    order = [n[f] for f in ("low", "mode", "high") if f in n]
    is_ordered = all(a <= b for a, b in itertools.pairwise(order))
    if not is_ordered or ("low" in n and "high" in n and n["low"] == n["high"]):
        raise input_error(
            f"{kind} distribution: low must be below high, and the mode between them", key=key
        )
    if kind == "uniform":
        return uniform(n["low"], n["high"])
    if kind == "triangular":
        return triangular(n["low"], n["mode"], n["high"])
    ends = {end: n[end] for end in ("low", "high") if end in n}
    if kind == "normal":
        return normal(n["mean"], n["deviation"], **ends)
    if can_be_negative or n["mean"] <= 0.0 or ends.get("high", 1.0) <= 0.0:
        raise input_error("a lognormal distribution needs a mean and an end above 0", key=key)
    return lognormal(n["mean"], n["deviation"], **ends)


def _text(variation: Variation, spread: Spread, values: dict[str, float]) -> str:
    """Return a distribution in words.

    Args:
        values: As of `_with_spread`, with the deviation.
    """
    kind, unit = spread.distribution, variation.unit

    def place(name: str) -> str:
        value = values[name]
        if variation.change is not Change.DISTANCE:
            return unit.reading(value)
        sign = "-" if value < 0.0 else "+"
        return f"nominal {sign} {unit.reading(abs(value))}" if value else "nominal"

    if kind not in TRUNCATED:
        mode = f", mode {place('mode')}" if "mode" in values else ""
        return f"{kind}, {place('low')} to {place('high')}{mode}"
    ends = [f"{end} {place(end)}" for end in ("low", "high") if end in values]
    truncated = f", truncated ({', '.join(ends)})" if ends else ""
    return f"{kind}, {place('mean')} ± {unit.reading(values['deviation'])}{truncated}"


def _correlation_factor(tolerances: Tolerances, names: list[str]) -> FloatArray | None:
    """Return the Cholesky factor of the correlations of all quantities; None without any."""
    given = tolerances.correlations
    if given is None:
        return None
    for name in given.quantities:
        check_known(name, names, f"no quantity '{name}'", key="correlations.quantities")
    places = [names.index(name) for name in given.quantities]
    matrix = np.eye(len(names))
    matrix[np.ix_(places, places)] = np.array(given.matrix)
    return np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
