"""Conversion of text with units to floats in SI units, and back for tables and files."""

import contextlib
import functools
import math
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
from pydantic_core import CoreSchema
from pydantic_core.core_schema import with_info_before_validator_function

from wm_drake.errors import shortened
from wm_drake.parameters.reading import CUSTOMARY, READING, SI

if TYPE_CHECKING:  # importing pint and making its registry take 0.7 s: units not in FACTORS
    import pint

# Possessive (++) and greedy: the time to match any text is proportional to its length.
_NUMBER = r"[+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?"
_BARE = re.compile(_NUMBER)
_SCALAR = re.compile(rf"({_NUMBER})\s*+(\S.*)?")
_DECIMAL_COMMA = re.compile(r"(?<![0-9])[+-]?[0-9]++,[0-9]++")
_VECTOR = re.compile(r"\(([^()]*+)\)\s*+(\S.*)?")
_NOT_FINITE = re.compile(r"[+-]?(?:nan|inf|infinity)", re.IGNORECASE)

LONGEST_UNIT = 40
"""Largest number of characters of a unit."""

LONGEST_NUMBER = 1000
"""Largest number of characters of one number with its unit."""

LONGEST_LIST = 1 << 20
"""Largest number of characters of a list of numbers with its unit."""

LARGEST_NUMBER = 1e15
"""Largest size of a number in SI units: far above any of a machine, and products stay finite."""

_POWER = r"(?:\^|\*\*)\s*-?[0-9]{1,2}(?![0-9.]|\s*(?:\^|\*\*))"
_LIST = re.compile(r"\([^()]{0,10000}\)")
"""A list of numbers without a unit."""
_UNIT = re.compile(rf"(?:1\s*/)?(?:[^\W\d]\w*|[°%]|[\s*/().·-]|{_POWER})*")
"""A unit: words, products and quotients; a power is one whole number of at most two digits."""


_FACTORS = {
    ("", "%"): 100.0,
    ("J", "mJ"): 1000.0,
    ("N*m", "N*mm"): 1000.0,
    ("N*m*s/rad", "N*mm*s/deg"): 17.453292519943297,
    ("N*mm*s/deg", "N*m*s/rad"): 0.057295779513082325,
    ("N*m*s/rad", "N*mm*s/rad"): 1000.0,
    ("N*m/rad", "N*mm/rad"): 1000.0,
    ("N*s/mm", "N*s/m"): 1000.0,
    ("N/mm", "N/m"): 1000.0,
    ("dimensionless", "percent"): 100.0,
    ("kg", "g"): 1000.0,
    ("kg*m", "g*mm"): 1000000.0,
    ("kg*m", "g*m"): 1000.0,
    ("kg*m^2", "g*m^2"): 1000.0,
    ("kg*m^2", "g*mm^2"): 1000000000.0,
    ("m", "mm"): 1000.0,
    ("m/s", "mm/s"): 1000.0,
    ("MPa", "Pa"): 1000000.0,
    ("rad", "deg"): 57.29577951308232,
    ("rad/s", "deg/s"): 57.29577951308232,
    ("rad/s", "rpm"): 9.549296585513721,
    ("rad/s^2", "rpm/s"): 9.549296585513721,
    ("s", "ms"): 1000.0,
}
FACTORS = {(b, a): 1.0 / factor for (a, b), factor in _FACTORS.items()} | _FACTORS
"""Factors from a unit to another one, of the units of machine files and pages.

They are those of pint, to the last bit, which the tests check; all other units are left to pint.
"""


@functools.cache
def registry() -> "pint.UnitRegistry[float]":
    """Return pint's registry of units, in which the angle is a dimension.

    With this, N m and N m/rad cannot be confused.
    """
    import pint

    units: pint.UnitRegistry[float] = pint.UnitRegistry(on_redefinition="ignore")
    units.define("radian = [angle] = rad")
    # pint has cached rpm and deg as dimensionless; there is no public way to clear its cache
    units._build_cache()
    return units


def quantity(magnitude: float, unit: str) -> Any:
    """Return a number with a unit as a quantity of pint.

    The text is checked before pint parses it: a tower of powers or a very long word would take pint
    minutes and gigabytes.

    Raises:
        ValueError: the text has not the form of a unit.
        Exception: one of several errors of pint: the unit is unknown.
    """
    if len(unit) > LONGEST_UNIT or not _UNIT.fullmatch(unit):
        raise ValueError("not a unit")
    return registry().Quantity(magnitude, unit)


def plain_number(text: str) -> float:
    """Return a number without a unit, written with the digits 0 to 9; nan and inf are numbers too.

    Raises:
        ValueError: the text is not such a number.
    """
    if not (_matched(_BARE, text, LONGEST_NUMBER) or _NOT_FINITE.fullmatch(text.strip())):
        raise ValueError(f"'{shortened(text, 40)}' is not a number")
    return float(text)


def _known_factor(unit: str, other: str) -> float | None:
    """Return the factor of two units that needs no pint; blanks are products. None if unknown."""
    plain = unit.replace(" ", "*")
    return 1.0 if plain == other else FACTORS.get((plain, other))


@functools.lru_cache(maxsize=8192)  # pint takes 50 µs, and a page shows the same numbers again
def _in_unit(value: float, unit: str, shown: str) -> float:
    factor = _known_factor(unit, shown)
    if factor is not None:
        return float(value * factor)
    return float(registry().Quantity(value, unit).to(shown).magnitude)


@dataclass(frozen=True)
class Unit:
    """The SI unit in which a field is stored, and its display unit.

    It is used as metadata of a pydantic field: ``Annotated[float, Unit("N/m", "N/mm")]``. The field
    then accepts text with any unit of the same dimension and converts it to SI; other text is an
    error.

    Attributes:
        si: SI unit of the stored value.
        shown: Display unit, for files, tables and messages.
    """

    si: str
    shown: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return a schema that parses text before the other checks of the field."""
        read = to_si if source is float else to_si_vector
        return with_info_before_validator_function(
            lambda value, info: read(value, info, self), handler(source)
        )

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Return the JSON schema of the field.

        In a file it is text with a unit, or value and source. In a result (mode "serialization") it
        is an SI number, whose unit is the annotation `unit`.
        """
        plain = handler(core)
        if handler.mode == "serialization":
            return {**plain, "unit": self.si.replace("*", " ")} if self.si else plain
        is_list = plain.get("type") == "array"
        text = {
            "type": ["string", "number"] if not self.si else "string",
            "pattern": self._pattern(is_list=is_list),
            "examples": [self.example(is_list=is_list)],
        }
        value = {
            "type": "object",
            "properties": {"value": text, "source": {"type": "string"}},
            "required": ["value"],
            "additionalProperties": False,
        }
        return {"anyOf": [text, value]}

    def _pattern(self, *, is_list: bool) -> str:
        """Return a regular expression of texts of the field; it knows no dimensions of units."""
        number = r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"
        if not self.si:
            numbers = rf"\(\s*{number}\s*(,\s*{number}\s*)*\)" if is_list else number
            return rf"^\s*{numbers}\s*$"
        unit = r"(\s*(?![eE][+-]?[0-9])[A-Za-z\u00b0\u00b5\u03bc%]|\s+1\s*/)"
        numbers = rf"\(\s*{number}\s*(,\s*{number}\s*)*\)" if is_list else number
        return rf"^\s*{numbers}{unit}"

    def example(self, *, is_list: bool = False) -> str:
        """Return an example of a value in a file, such as ``1 N/mm``."""
        return f"(1, 2, 3) {self.shown}" if is_list else f"1 {self.shown}".strip()

    @property
    def for_reader(self) -> "Unit":
        """Return the unit with the display unit of the reader, see `parameters.reading`."""
        shown = self.shown if READING.get() == SI else CUSTOMARY.get(self.shown, self.shown)
        return self if shown == self.shown else replace(self, shown=shown)

    @property
    def label(self) -> str:
        """Display unit for reading, such as ``N mm/rad``."""
        return self.shown.replace("*", " ")

    def from_si(self, value: float) -> float:
        """Return an SI value in the display unit."""
        return _in_unit(value, self.si, self.shown)

    def to_si(self, values: Any) -> Any:
        """Return values in the display unit, as a file or an option has them, in SI."""
        return values / self.from_si(1.0)

    def number(self, text: str) -> float:
        """Return a text such as ``'3.2 N/mm'`` as a number in SI units.

        Raises:
            ValueError: the text is not a finite number with a fitting unit.
        """
        match = _matched(_SCALAR, text, LONGEST_NUMBER)
        if match is None or (match[2] or "").startswith(","):
            hint = comma_hint(text) or f"; write for example '{self.example()}'"
            raise ValueError(f"'{shortened(text, 60)}' is not a number with a unit{hint}")
        return convert(float(match[1]), match[2], self)

    def reading(self, value: float, digits: int = 6) -> str:
        """Return an SI value as text for reading, rounded, in the unit in which it is read."""
        read = self.for_reader
        return f"{read.from_si(value):.{digits}g} {read.label}".rstrip()

    def text(self, value: Any) -> str:
        """Return an SI value, or a tuple of them, as text such as ``3.2 N/mm``.

        `to_si` converts the text back to exactly the same value. If this is not possible with the
        display unit, the text has the SI unit.
        """
        values = value if isinstance(value, tuple) else (value,)
        shown = [self._exact_digits(number) for number in values]
        unit = self.si if None in shown else self.shown
        digits = (
            [repr(number) for number in values] if None in shown else [str(text) for text in shown]
        )
        return (
            f"({', '.join(digits)}) {unit}" if isinstance(value, tuple) else f"{digits[0]} {unit}"
        )

    def _exact_digits(self, value: float) -> str | None:
        shown = self.from_si(value)
        for digits in (f"{shown:.12g}", repr(shown)):
            if convert(float(digits), self.shown, self) == value:
                return digits
        return None


def convert(magnitude: float, unit_text: str | None, unit: Unit) -> float:
    """Return a number with a unit as a number in SI units.

    Args:
        unit_text: Its unit; None if it has none.
        unit: Unit of the field that the number is for.

    Raises:
        ValueError: the unit is missing, unknown or of another dimension, or the number is not
            finite.
    """
    if unit_text is None:
        raise ValueError(f"'{magnitude:g}' has no unit; write for example '1 {unit.shown}'")
    factor = _known_factor(unit_text, unit.si)
    if factor is not None:
        return bounded(magnitude * factor, f"{magnitude:g} {unit_text}")
    import pint

    try:
        value = float(quantity(magnitude, unit_text).to(unit.si).magnitude)
    except pint.DimensionalityError:
        raise ValueError(
            f"unit '{shortened(unit_text, 40)}' does not fit; "
            f"allowed is a unit such as {unit.shown}"
        ) from None
    except Exception as error:  # pint raises several types of errors on text that is not a unit
        raise ValueError(
            f"unit '{shortened(unit_text, 40)}' is not known; write for example '1 {unit.shown}'"
        ) from error
    return bounded(value, f"{magnitude:g} {unit_text}")


def bounded(value: float, shown: str) -> float:
    """Return a number in SI units, after checking that a computation can use it.

    Args:
        shown: The number as it was given, for the message.

    Raises:
        ValueError: it is not finite, or larger than `LARGEST_NUMBER`.
    """
    if not math.isfinite(value):
        raise ValueError(f"'{shortened(shown, 60)}' is not a finite number")
    if abs(value) > LARGEST_NUMBER:
        raise ValueError(
            f"'{shortened(shown, 60)}' is out of range; allowed are sizes up to "
            f"{LARGEST_NUMBER:g} in SI units"
        )
    return value


def _matched(form: re.Pattern[str], text: str, longest: int) -> re.Match[str] | None:
    """Return the match of a whole text, without the blanks around it.

    Raises:
        ValueError: the text is too long to be parsed.
    """
    bare = text.strip()
    if len(bare) > longest:
        raise ValueError(f"has {len(bare)} characters; allowed are up to {longest}")
    return form.fullmatch(bare)


_INSTRUMENT_UNITS = {
    "nm": "N*m",
    "nmm": "N*mm",
    "knm": "kN*m",
    "knmm": "kN*mm",
    "kn": "kN",
    "g": "g_0",
    "gn": "g_0",
    "gs": "g_0",
    "mg": "mg_0",
    "µg": "µg_0",
    "ug": "µg_0",
    "kp": "kgf",
    "sec": "s",
    "secs": "s",
    "sek": "s",
    "msec": "ms",
    "usec": "us",
    "µsec": "us",
    "hr": "h",
    "hrs": "h",
    "°": "deg",
    **dict.fromkeys(
        ("1/min", "min^-1", "u/min", "rev/min", "r/min", "revs/min", "upm", "cpm", "rev per min"),
        "rpm",
    ),
    **dict.fromkeys(("hz", "rps", "rev/s", "r/s", "u/s", "cps"), "revolution/s"),
}
"""Units as instruments write them, in small letters, and what they mean where pint's do not fit."""

_NO_UNIT = ("", "-", "--", "none", "n/a", "1", "[]")
"""Texts that stand in the place of a unit and name none."""

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


def plain_unit(text: str) -> str:
    """Return the text of a unit as an instrument writes it, in the form that pint reads.

    Brackets go; powers get their sign: ``m/s2``, ``m/s²`` and ``[m/s^2]`` become ``m/s^2``. A text
    that names no unit, such as ``-``, becomes "".
    """
    plain = text.strip().strip("[]").strip().translate(_SUPERSCRIPTS).replace("μ", "µ")
    if plain.lower() in _NO_UNIT:
        return ""
    plain = plain.replace("·", "*").replace("×", "*").replace("**", "^")
    plain = re.sub(r"(?<=[A-Za-z])-(?=[A-Za-z])", "*", plain)
    return re.sub(r"(?<=[A-Za-z°µ])(-?[0-9])(?![0-9A-Za-z_])", r"^\1", plain)


def factor_of(text: str, unit: Unit) -> float:
    """Return the factor that converts numbers in a unit, as instruments write it, to SI.

    A text with several meanings has that of the dimension: ``mg`` is a thousandth of the
    acceleration of gravity, or a mass; ``Hz`` is a drum speed in revolutions per second.

    Raises:
        ValueError: the unit is missing, unknown or of another dimension.
    """
    plain = plain_unit(text)
    small = plain.lower()
    try:
        return convert(1.0, plain or None, unit)
    except ValueError:
        if plain:
            with contextlib.suppress(ValueError):
                return convert(1.0, _INSTRUMENT_UNITS.get(small, small), unit)
        raise


def is_unit(text: str) -> bool:
    """Return whether a text is a unit, as instruments write it, of any dimension."""
    plain = plain_unit(text)
    if plain.lower() in _INSTRUMENT_UNITS or plain in ("%", "‰"):
        return True
    try:
        dimension(plain)
    except ValueError:
        return False
    return bool(plain)


def split(text: str) -> tuple[list[float], str, bool]:
    """Split text such as ``'(9, 12) kg'`` into numbers and unit.

    Returns:
        The numbers, the text of the unit ("" for pure numbers), and whether there is more than one
        number.

    Raises:
        ValueError: the text is not a number or a list of numbers, or the unit is unknown.
    """
    match = _matched(_VECTOR, text, LONGEST_LIST)
    parts = [part.strip() for part in match[1].split(",")] if match else []
    if match is None:
        match = _matched(_SCALAR, text, LONGEST_NUMBER)
        parts = [match[1]] if match else []
    comma = match is not None and (match[2] or "").startswith(",")
    if match is None or comma or not all(_BARE.fullmatch(part) for part in parts):
        hint = comma_hint(text) or "; write for example '12 kg' or '(9, 12) kg'"
        raise ValueError(
            f"'{shortened(text, 60)}' is not a number or a list of numbers with a unit{hint}"
        )
    unit = match[2] or ""
    dimension(unit)
    numbers = [float(part) for part in parts]
    for number in numbers:
        bounded(to_base(number, unit), f"{number:g} {unit}")
    return numbers, unit, len(parts) > 1


def dimension(unit: str) -> Any:
    """Return the dimension of a unit; it is equal for units that convert into each other."""
    try:
        return quantity(1.0, unit).dimensionality
    except Exception as error:  # pint raises several types of errors on text that is not a unit
        raise ValueError(
            f"unit '{shortened(unit, 40)}' is not known; write for example kg, mm or N/mm"
        ) from error


def to_base(value: float, unit: str) -> float:
    """Return a number with a unit as a number in SI units."""
    return float(registry().Quantity(value, unit).to_base_units().magnitude)


def with_base(unit: str) -> Unit:
    """Return a unit in which numbers are written, with its SI base unit."""
    return Unit(str(registry().Quantity(1.0, unit).to_base_units().units), unit)


def from_base(value: float, unit: str) -> float:
    """Return a number in SI units as a number in another unit."""
    return value / to_base(1.0, unit)


def to_si(value: Any, info: ValidationInfo, unit: Unit) -> float:
    """Return a value such as ``'3.2 N/mm'`` or an SI float as a float in SI units.

    Args:
        value: Text with a unit, or an SI float.
        info: Context of the validation. In a file every number needs a unit.
        unit: Unit of the field.
    """
    return unit.number(value) if isinstance(value, str) else _plain_number(value, info, unit)


def to_si_vector(value: Any, info: ValidationInfo, unit: Unit) -> tuple[float, ...]:
    """Return values such as ``'(1, 2, 3) mm'`` or a sequence of SI floats as floats in SI units.

    Args:
        value: Text with a unit, or a sequence of SI floats.
        info: Context of the validation. In a file every list of numbers needs a unit.
        unit: Unit of the field.
    """
    example = unit.example(is_list=True)
    if isinstance(unit, PureNumber) and isinstance(value, str) and _LIST.fullmatch(value.strip()):
        return tuple(unit.number(part.strip()) for part in value.strip()[1:-1].split(","))
    if isinstance(value, str):
        match = _matched(_VECTOR, value, LONGEST_LIST)
        parts = [] if match is None else [part.strip() for part in match[1].split(",")]
        if match is None or not all(_BARE.fullmatch(part) for part in parts):
            raise ValueError(
                f"'{shortened(value, 60)}' is not a list of numbers with a unit; "
                f"write for example '{example}'"
            )
        return tuple(convert(float(part), match[2], unit) for part in parts)
    if not isinstance(value, list | tuple):
        raise ValueError(
            f"{shortened(repr(value), 60)} is not a list of numbers with a unit; "
            f"write for example '{example}'"
        )
    return tuple(_plain_number(number, info, unit, is_list=True) for number in value)


def comma_hint(text: str) -> str:
    """Return a hint for a number with a decimal comma in a text, or "" if there is none.

    Args:
        text: Text that is not a number as it stands, such as ``'6,5 N/mm'``.
    """
    match = _DECIMAL_COMMA.search(text[:LONGEST_NUMBER])
    if match is None:
        return ""
    return f"; the decimal sign is a point, not a comma: write {match[0].replace(',', '.')}"


def _plain_number(value: Any, info: ValidationInfo, unit: Unit, *, is_list: bool = False) -> float:
    example, is_pure = unit.example(is_list=is_list), isinstance(unit, PureNumber)
    if isinstance(value, str) and (is_pure or (is_list and not _BARE.fullmatch(value))):
        return unit.number(value)  # an entry with a unit of its own
    if isinstance(value, str) and _BARE.fullmatch(value):
        raise ValueError(f"'{value}' has no unit; write for example '{example}'")
    if isinstance(value, bool) or not isinstance(value, int | float):
        kind = "a number" if is_pure else "a number with a unit"
        shown = shortened(repr(value), 60)
        raise ValueError(f"{shown} is not {kind}; write for example '{example}'")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"this is not a finite number; write for example '{example}'")
    bounded(number, f"{number:g}")
    if not is_pure and info.context and info.context.get("units_required"):
        raise ValueError(f"'{number:g}' has no unit; write for example '{example}'")
    return number


@dataclass(frozen=True)
class PureNumber(Unit):
    """A number without a unit, such as a friction coefficient."""

    si: str = ""
    shown: str = ""

    def text(self, value: Any) -> str:
        """Return a number as text that reads back as the same number."""
        return repr(value)

    def number(self, text: str) -> float:
        """Return a text such as ``'0.4'`` as a number."""
        if _matched(_BARE, text, LONGEST_NUMBER) is None:
            hint = comma_hint(text) or "; write for example '1'"
            raise ValueError(f"'{shortened(text, 60)}' is not a number without unit{hint}")
        return bounded(float(text), text)


@dataclass(frozen=True)
class Fraction(PureNumber):
    """A part of a whole, shown as 0.3; 30 % is read too."""

    def number(self, text: str) -> float:
        """Return a text such as ``'30 %'`` or ``'0.3'`` as a number."""
        body = text.strip()
        return 0.01 * super().number(body[:-1]) if body.endswith("%") else super().number(body)


@dataclass(frozen=True)
class Share(Fraction):
    """A part of a whole, shown as 30 %."""

    shown: str = "%"


Ratio = Annotated[float, PureNumber()]
Ratios = Annotated[tuple[float, ...], PureNumber()]
Mass = Annotated[float, Unit("kg", "kg")]
Inertia = Annotated[float, Unit("kg*m^2", "kg*m^2")]
StaticMoment = Annotated[float, Unit("kg*m", "g*mm")]
CoupleMoment = Annotated[float, Unit("kg*m^2", "g*mm^2")]
Length = Annotated[float, Unit("m", "mm")]
Angle = Annotated[float, Unit("rad", "deg")]
Speed = Annotated[float, Unit("rad/s", "rpm")]
AngularAcceleration = Annotated[float, Unit("rad/s^2", "rpm/s")]
Duration = Annotated[float, Unit("s", "s")]
Velocity = Annotated[float, Unit("m/s", "mm/s")]
Acceleration = Annotated[float, Unit("m/s^2", "m/s^2")]
AngularVelocity = Annotated[float, Unit("rad/s", "rad/s")]
Force = Annotated[float, Unit("N", "N")]
Torque = Annotated[float, Unit("N*m", "N*mm")]
MotorTorque = Annotated[float, Unit("N*m", "N*m")]
Power = Annotated[float, Unit("W", "W")]
TorqueConstant = Annotated[float, Unit("N*m/A", "N*m/A")]
LinearStiffness = Annotated[float, Unit("N/m", "N/mm")]
LinearDamping = Annotated[float, Unit("N*s/m", "N*s/mm")]
RotationalStiffness = Annotated[float, Unit("N*m/rad", "N*mm/rad")]
RotationalDamping = Annotated[float, Unit("N*m*s/rad", "N*mm*s/deg")]
Position = Annotated[tuple[float, float, float], Unit("m", "mm")]
Lengths = Annotated[tuple[float, ...], Unit("m", "mm")]
Angles = Annotated[tuple[float, ...], Unit("rad", "deg")]
Forces = Annotated[tuple[float, ...], Unit("N", "N")]
Torques = Annotated[tuple[float, ...], Unit("N*m", "N*mm")]
MotorTorques = Annotated[tuple[float, ...], Unit("N*m", "N*m")]
Times = Annotated[tuple[float, ...], Unit("s", "s")]
Frequency = Annotated[float, Unit("Hz", "Hz")]
Frequencies = Annotated[tuple[float, ...], Unit("Hz", "Hz")]
Speeds = Annotated[tuple[float, ...], Unit("rad/s", "rpm")]
