"""Uncertain quantities of a machine: what each one changes, and its distribution in SI units."""

import dataclasses
import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import ValidationError

from wm_drake.errors import InputError, Problem, input_error, nearest_names
from wm_drake.parameters import (
    ForceTable,
    Load,
    MachineParameters,
    TorqueTable,
    Unbalance,
    quantities,
    with_values,
)
from wm_drake.parameters.factors import nominal_at, scaled_table, value_at
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.tolerances import LAUNDRY, TRUNCATED, Laundry, Spread, Tolerances
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit, convert, split
from wm_drake.simulation.cases import Case
from wm_drake.studies.tolerance.distributions import (
    Joint,
    Marginal,
    lognormal,
    normal,
    triangular,
    uniform,
)

PERCENT, VALUE, DISTANCE = "percent", "value", "distance"
"""Forms of the numbers of a distribution: in percent of the machine's number, a value with a unit,
a distance from the machine's number."""

KEPT_MACHINES = 2048
"""How many machines are cached."""

_NOMINAL = re.compile(r"nominal\s*(?:([+-])\s*(.+))?")

_LAUNDRY_UNITS = {
    "mass": Unit("kg", "g"),
    "angle": Unit("rad", "deg"),
    "y": Unit("m", "mm"),
    "radius": Unit("m", "mm"),
    "second_share": None,
    "second_angle": Unit("rad", "deg"),
    "second_y": Unit("m", "mm"),
}

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
class Variable:
    """An uncertain quantity.

    Attributes:
        name: Name of the quantity.
        keys: Key paths of the numbers that it changes; empty for the laundry.
        form: PERCENT, VALUE or DISTANCE.
        marginal: Distribution. [1 for PERCENT, else SI]
        unit: Unit of its numbers; None if they have none.
        text: The distribution in words.
        source: Where its numbers come from.
        about: Description.
    """

    name: str
    keys: tuple[str, ...]
    form: str
    marginal: Marginal
    unit: Unit | None
    text: str
    source: str
    about: str

    @property
    def is_laundry(self) -> bool:
        """Whether it is a quantity of the laundry."""
        return not self.keys


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
    variables: tuple[Variable, ...]
    joint: Joint
    case: Case
    _known: dict[tuple[float, ...], MachineParameters] = dataclasses.field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def cases(self, scores: FloatArray, first: int = 1) -> list[Case]:
        """Return the case of each sample.

        Args:
            scores: Independent standard normal scores. (n, variables)
            first: Number of the first sample, for the names of the cases.

        Raises:
            InputError: a sample is not a machine.
        """
        found = []
        for number, values in enumerate(self.joint.values(scores), start=first):
            try:
                found.append(self._case(f"sample {number}", values.tolist()))
            except InputError as error:
                raise InputError(
                    replace(p, where=f"sample {number}") for p in error.problems
                ) from None
        return found

    def _case(self, name: str, values: Sequence[float]) -> Case:
        changes: dict[str, Any] = {}
        laundry: dict[str, float] = {}
        for variable, value in zip(self.variables, values, strict=True):
            if variable.is_laundry:
                laundry[variable.name.removeprefix(f"{LAUNDRY}.")] = value
            for key in variable.keys:
                changes[key] = value
        parameters = self._machine_with(changes) if changes else self.parameters
        load = laundry_load(laundry) if laundry else parameters.loads[self.case.name]
        return Case(name, load, self.case.profile, parameters=parameters)

    def _machine_with(self, drawn: dict[str, float]) -> MachineParameters:
        """Return the machine with drawn values by key path, the same one for the same values.

        The samples of Sobol indices exchange one quantity at a time: half of their machines differ
        in the laundry only, and each machine is prepared once.
        """
        values = tuple(drawn.values())
        if values not in self._known:
            if len(self._known) >= KEPT_MACHINES:
                del self._known[next(iter(self._known))]
            forms = {key: variable for variable in self.variables for key in variable.keys}
            changes = {key: self._changed(forms[key], key, v) for key, v in drawn.items()}
            self._known[values] = with_values(self.parameters, changes)
        return self._known[values]

    def _changed(self, variable: Variable, key: str, value: float) -> Any:
        if variable.form == VALUE:
            return value
        nominal = value_at(self.parameters, key)
        if isinstance(nominal, ForceTable | TorqueTable):
            return scaled_table(nominal, value)
        return nominal * value if variable.form == PERCENT else nominal + value

    def check(self, is_usable: Callable[[Case], None]) -> None:
        """Check the machine at both ends of each quantity, the others at their medians.

        Args:
            is_usable: Raises an InputError if a case cannot be run.

        Raises:
            InputError: a quantity reaches a value that is not allowed.
        """
        problems = []
        for index, variable in enumerate(self.variables):
            for end, score in (("lower", -np.inf), ("upper", np.inf)):
                scores = np.zeros((1, len(self.variables)))
                values = self.joint.values(scores)[0]
                values[index] = variable.marginal.values(np.array([score]))[0]
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

    Raises:
        InputError: a value is not allowed.
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
        tolerances: The file.
        case: Case of the machine without changes.

    Raises:
        InputError: the machine does not have a key, a distribution is wrong, or the correlations
            name an unknown quantity.
    """
    variables: list[Variable] = []
    problems: list[Problem] = []
    owner: dict[str, str] = {}
    for name, quantity in tolerances.quantities.items():
        try:
            parameters, groups = _groups(parameters, name, quantity.keys, quantity.draws)
            for own, keys in groups.items():
                for key in keys:
                    if owner.setdefault(key, name) != name:
                        raise input_error(f"belongs to quantity {owner[key]} already", key=key)
                variables.append(_variable(parameters, own, keys, quantity, quantity.about))
        except InputError as error:
            problems += [Problem(f"quantity {name}", p.key, p.message) for p in error.problems]
    if tolerances.laundry is not None:
        found, wrong = _laundry_variables(tolerances.laundry)
        variables, problems = [*variables, *found], [*problems, *wrong]
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
            parameters, own = with_own_types(parameters, table, kind)
            groups |= {f"{name}.{part}": (f"{table}.{t}.{field}",) for part, t in own.items()}
        else:
            groups[f"{name}.{key}" if len(keys) > 1 else name] = (key,)
    return parameters, groups


def with_own_types(
    parameters: MachineParameters, table: str, kind: str
) -> tuple[MachineParameters, dict[str, str]]:
    """Return a machine in which each part has a type of its own, and the types by part.

    Args:
        parameters: The machine.
        table: spring_types, damper_types or bushing_types.
        kind: Name of the type that is replaced.
    """
    types = dict(getattr(parameters, table))
    changes: dict[str, Any] = {}
    own: dict[str, str] = {}
    for parts, field in _TYPES[table]:
        for part, element in getattr(parameters, parts).items():
            if getattr(element, field) == kind:
                label = f"{part}_{field.removesuffix('_bushing')}" if "bushing" in field else part
                own[label] = f"{kind}_{label}"[-64:]
                types[own[label]] = types[kind]
                changes[f"{parts}.{part}.{field}"] = own[label]
    if len(own) < 2:
        only = next(iter(own), "")
        return parameters, {only: kind} if only else {kind: kind}
    return with_values(with_values(parameters, {table: types}), changes), own


def _laundry_variables(laundry: Laundry) -> tuple[list[Variable], list[Problem]]:
    variables, problems = [], []
    for field, spread in laundry.spreads().items():
        name, unit = f"{LAUNDRY}.{field}", _LAUNDRY_UNITS[field]
        try:
            form, marginal = marginal_of(spread, unit, None)
            if unit is not None and form != VALUE:
                raise input_error(f"needs values with a unit, such as '1 {unit.shown}'", key=name)
        except InputError as error:
            problems += [Problem(LAUNDRY, p.key or name, p.message) for p in error.problems]
            continue
        text = _text(spread)
        variables.append(Variable(name, (), VALUE, marginal, unit, text, spread.source, ""))
    return variables, problems


def _variable(
    parameters: MachineParameters, name: str, keys: tuple[str, ...], spread: Spread, about: str
) -> Variable:
    known = {key: (value, unit) for key, value, unit in quantities(parameters)}
    units = []
    for key in keys:
        number, unit = nominal_at(parameters, known, key)
        form, marginal = marginal_of(spread, unit, number, key)
        is_table = isinstance(value_at(parameters, key), ForceTable | TorqueTable)
        if is_table and form != PERCENT:
            raise input_error("is a table; give its distribution in percent", key=key)
        units.append(unit)
    return Variable(name, keys, form, marginal, units[0], _text(spread), spread.source, about)


def marginal_of(
    spread: Spread, unit: Unit | None, nominal: float | None, key: str = ""
) -> tuple[str, Marginal]:
    """Return form and distribution of a spread.

    Args:
        spread: The spread.
        unit: Unit of the number; None if it has none.
        nominal: Number of the machine; None for the laundry.
        key: Key path for messages.

    Raises:
        InputError: a number has another form or unit, or the ends are not in order.
    """
    is_share = unit is None and nominal is None
    numbers: dict[str, float] = {}
    forms: dict[str, str] = {}
    for field in ("mean", "mode", "low", "high"):
        text = getattr(spread, field)
        if text is not None:
            forms[field], numbers[field] = _number(
                text, unit, f"{key}.{field}".lstrip("."), is_share
            )
    if len(set(forms.values())) > 1:
        raise input_error(
            f"{' and '.join(forms)} have different forms; write all in percent, all as values or "
            "all as nominal + distance",
            key=key,
        )
    form = next(iter(forms.values()))
    if form != VALUE and nominal is None:
        raise input_error("has no number of a machine; write values with a unit", key=key)
    if form == PERCENT and nominal == 0.0:
        raise input_error("is 0, so percents of it are 0; write values with a unit", key=key)
    if spread.deviation is not None:
        d_key = f"{key}.deviation".lstrip(".")
        d_form, numbers["deviation"] = _number(spread.deviation, unit, d_key, is_share)
        if (d_form == PERCENT) != (form == PERCENT) or numbers["deviation"] <= 0.0:
            what = "in percent" if form == PERCENT else "a value with a unit"
            raise input_error(f"'{spread.deviation}' is not {what} above 0", key=d_key)
    return form, _made(spread, form, numbers, key)


def _made(spread: Spread, form: str, n: dict[str, float], key: str) -> Marginal:
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
    if form == DISTANCE or n["mean"] <= 0.0 or ends.get("high", 1.0) <= 0.0:
        raise input_error("a lognormal distribution needs a mean and an end above 0", key=key)
    return lognormal(n["mean"], n["deviation"], **ends)


def _number(text: str, unit: Unit | None, key: str, is_share: bool) -> tuple[str, float]:
    """Return form and number of a text; a percent is a fraction of 1."""
    try:
        relative = _NOMINAL.fullmatch(text.strip())
        if relative:
            sign, distance = -1.0 if relative[1] == "-" else 1.0, relative[2]
            return DISTANCE, sign * _plain(distance, unit) if distance else 0.0
        if text.strip().endswith("%"):
            percent = 0.01 * _plain(text.strip().removesuffix("%"), None)
            return VALUE if is_share else PERCENT, percent
        return VALUE, _plain(text, unit)
    except ValueError as error:
        raise input_error(str(error), key=key) from None


def _plain(text: str, unit: Unit | None) -> float:
    numbers, given, several = split(text.strip())
    if several:
        raise ValueError(f"'{text}' is more than one number")
    if unit is not None:
        return convert(numbers[0], given or None, unit)
    if given:
        raise ValueError(f"'{text}' has a unit; the number has none")
    return numbers[0]


def _text(spread: Spread) -> str:
    """Return a distribution in words."""
    kind = spread.distribution
    if kind not in TRUNCATED:
        mode = f", mode {spread.mode}" if spread.mode else ""
        return f"{kind}, {spread.low} to {spread.high}{mode}"
    ends = [f"{end} {getattr(spread, end)}" for end in ("low", "high") if getattr(spread, end)]
    truncated = f", truncated ({', '.join(ends)})" if ends else ""
    return f"{kind}, {spread.mean} ± {spread.deviation}{truncated}"


def _correlation_factor(tolerances: Tolerances, names: list[str]) -> FloatArray | None:
    """Return the Cholesky factor of the correlations of all quantities; None without any."""
    given = tolerances.correlations
    if given is None:
        return None
    for name in given.quantities:
        if name not in names:
            raise input_error(
                f"no quantity '{name}'{nearest_names(name, names)}", key="correlations.quantities"
            )
    places = [names.index(name) for name in given.quantities]
    matrix = np.eye(len(names))
    matrix[np.ix_(places, places)] = np.array(given.matrix)
    return np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
