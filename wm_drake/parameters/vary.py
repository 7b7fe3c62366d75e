"""Declaration of a number that varies: one grammar of files and of the command line.

An entry says which numbers of a machine change together, and what is known of them:

    C_L:       {keys: [gasket.damping_x, gasket.damping_y], low: 50 %, high: 150 %}
    stiffness: {keys: gasket.stiffness_x, mean: 100 %, deviation: 7 %}
    tub_mass:  {sets: {bodies.tub.mass: 1, bodies.tub.inertia.xx: 0.0545 m^2},
                bounds: '(9, 12) kg', prior: '(10.8, 0.8) kg'}
    gasket.stiffness_y: 80 %..120 %

A study uses what it needs of an entry: levels, range, distribution, or bounds and prior.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import BeforeValidator, ValidationError, model_validator

from wm_drake.errors import InputError, input_error, problems_at
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.files import yaml_of_text
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.units import Share, Unit
from wm_drake.parameters.variation import range_of

DistributionKind: TypeAlias = Literal["normal", "lognormal", "uniform", "triangular"]

NEEDED: Mapping[str, tuple[str, ...]] = {
    "normal": ("mean", "deviation"),
    "lognormal": ("mean", "deviation"),
    "uniform": ("low", "high"),
    "triangular": ("low", "mode", "high"),
}
"""Values that a distribution needs. A normal or lognormal one may be truncated by low and high."""

PLACES = ("low", "middle", "high", "mean", "mode", "start")
"""Fields of an entry that are values; `deviation` is a difference of two."""

PAIRS = {"bounds": ("low", "high"), "prior": ("mean", "deviation")}
"""Fields that stand for two others, such as `bounds: (9, 12) kg`."""

KEPT = {"keys", "sets", "draws", "about", "source"}
"""Fields of an entry that are no values."""

JOIN = "+"
"""Separator of keys in the name of an entry without `keys`."""

LAUNDRY = {
    "laundry.mass": Unit("kg", "g"),
    "laundry.angle": Unit("rad", "deg"),
    "laundry.y": Unit("m", "mm"),
    "laundry.radius": Unit("m", "mm"),
    "laundry.second_share": Share(),
    "laundry.second_angle": Unit("rad", "deg"),
    "laundry.second_y": Unit("m", "mm"),
}
"""Numbers of the laundry in the drum: one lump, or two lumps if it is split.

`mass` is that of both lumps and `radius` is the radius of both. `angle` is that of the first lump
around the drum, as `phase` of an unbalance, and `y` is its axial position in D. `second_share` is
the share of the mass in the second lump, `second_angle` the angle by which it leads the first one,
and `second_y` its axial position in D.
"""


def _text(value: Any) -> Any:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return repr(value) if is_number else value


def _keys(value: Any) -> Any:
    return (value,) if isinstance(value, str) else value


def _factors(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _text(factor) for key, factor in value.items()}
    return {value: "1"} if isinstance(value, str) else value


Factors: TypeAlias = Annotated[dict[str, str], BeforeValidator(_factors)]
"""Factors by key path; a key path alone has the factor 1."""


class Entry(Frozen):
    """A number that varies, as a user writes it.

    Each value is in percent of the machine's number ("95 %"), a value with a unit ("9 N/mm"), or a
    distance from the machine's number ("nominal + 2 mm", "nominal"). All values of an entry have
    the same form. A text LOW..HIGH or (LOW, HIGH) UNIT in place of an entry is its low and high.

    Attributes:
        keys: Key paths of the numbers that follow the value; by default the name of the entry, in
            which + separates several. * stands for any characters of one part of a path, as in
            `bodies.*.mass` (`wm_drake.model.key_patterns`).
        sets: In place of keys, factors by key path. Such a number is the sum of factor times value
            over all entries that name it. A factor may have a unit, and it may be a list with one
            number for each point of a table.
        low, high: Ends: levels -1 and 1 of a factor, range of a design, bounds of a search, ends
            of a distribution. `bounds` is the pair of both.
        middle: Level 0 of a factor; None for the mean of low and high.
        distribution: Kind; normal if there is a mean.
        mean, deviation: Expected value and standard deviation, before any truncation. `prior` is
            the pair of both.
        mode: Most frequent value of a triangular distribution.
        start: Start value of searches; None for the mean.
        draws: "one" draw for all numbers, or "each": an entry for each number, and for each part
            that has a type.
        about, source: Description, and where the values come from.
    """

    keys: Annotated[tuple[str, ...], BeforeValidator(_keys)] = ()
    sets: Factors = {}
    low: str | None = None
    high: str | None = None
    middle: str | None = None
    distribution: DistributionKind | None = None
    mean: str | None = None
    deviation: str | None = None
    mode: str | None = None
    start: str | None = None
    draws: Literal["one", "each"] = "one"
    about: str = ""
    source: str = ""

    @model_validator(mode="before")
    @classmethod
    def _in_full(cls, given: Any) -> Any:
        """Write a range alone, and pairs, as the fields for which they stand."""
        if isinstance(given, str):
            given = {"bounds": given}
        if not isinstance(given, Mapping):
            return given
        full = dict(given)
        for pair, names in PAIRS.items():
            if pair in full:
                ends = range_of(str(full.pop(pair)))
                if ends is None:
                    example = "(10.8, 0.8) kg" if pair == "prior" else "(9, 12) kg"
                    raise ValueError(f"{pair}: needs two values; write for example '{example}'")
                full |= dict(zip(names, ends, strict=True))
        return full

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        if self.keys and self.sets:
            raise ValueError("has keys and sets; allowed is one of them")
        needed, kind = NEEDED.get(self.kind, ()), self.kind
        missing = [name for name in needed if getattr(self, name) is None]
        if missing:
            raise ValueError(
                f"a {kind} distribution needs {', '.join(needed)}; '{missing[0]}' is missing"
            )
        for name in ("mean", "deviation", "mode"):
            if getattr(self, name) is not None and name not in needed:
                has = f"a {kind} distribution has" if kind else "without a distribution there is"
                raise ValueError(f"{has} no '{name}'")
        return self

    @property
    def kind(self) -> str:
        """Kind of the distribution: normal if there is a mean; "" if there is none."""
        has_mean = self.mean is not None or self.deviation is not None
        return self.distribution or ("normal" if has_mean else "")

    @property
    def texts(self) -> dict[str, str]:
        """Texts of the values by name."""
        texts = {name: getattr(self, name) for name in PLACES}
        return {name: text for name, text in texts.items() if text is not None}

    def of_name(self, name: str) -> "Entry":
        """Return the entry with the keys in its name, if it has none of its own."""
        if self.keys or self.sets:
            return self
        return self.model_copy(update={"keys": tuple(key.strip() for key in name.split(JOIN))})


def entries_of_texts(
    texts: Sequence[str], known: Mapping[str, Entry], option: str, default: str = ""
) -> dict[str, Entry]:
    """Return the entries of a repeatable option NAME[=VALUES].

    NAME is the name of a known entry, or a key path, or several with + between them. VALUES takes
    the place of the values of a known entry. It is a range LOW..HIGH or (LOW, HIGH) UNIT, or an
    entry in braces as in a file: {low: 9 kg, high: 12 kg, mean: 10.8 kg, deviation: 0.8 kg}.

    Args:
        known: Entries by name.
        option: Name of the option, for messages.
        default: Values of a key path without any.

    Raises:
        InputError: a text is wrong, or a name is given twice.
    """
    entries: dict[str, Entry] = {}
    for text in texts:
        name, _, values = (part.strip() for part in text.partition("="))
        if name in entries:
            raise input_error(f"'{name}' is given twice", where=option)
        with problems_at(option):
            entries[name] = _entry(name, values or ("" if name in known else default), known, text)
    return entries


def _entry(name: str, values: str, known: Mapping[str, Entry], text: str) -> Entry:
    if not values:
        return known[name] if name in known else Entry().of_name(name)
    given: Any = {"bounds": values}
    if values.startswith("{"):
        given = yaml_of_text(values, "")
    elif range_of(values) is None:
        message = f"'{text}' is not NAME=LOW..HIGH; write for example '{name}=50 %..150 %'"
        raise input_error(message)
    kept = known[name].model_dump(include=KEPT) if name in known else {}
    try:
        return Entry.model_validate(kept | given).of_name(name)
    except ValidationError as error:
        raise InputError(problems_of(error, Entry, name)) from None
