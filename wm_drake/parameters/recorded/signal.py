"""The labelled signal: samples of a channel, and what its recorder said about them."""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit, factor_of, is_unit, plain_unit

SECOND = Unit("s", "s")
TIME = "time"
"""Kind of an abscissa of time."""

_KINDS = {
    "an angle": Unit("rad", "deg"),
    "a distance": Unit("m", "mm"),
    "a frequency": Unit("Hz", "Hz"),
    "a drum speed": Unit("rad/s", "rpm"),
}
"""Kinds of an abscissa that is no time, by its unit."""

_BRACKETED = re.compile(r"(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*")
_AFTER_SIGN = re.compile(r"(.*\S)\s+(?:/|in)\s+(\S+)\s*")
_AFTER_WORD = re.compile(r"\s*([A-Za-zÄÖÜäöü]+)\s*(?:[\[(]([^\])]*)[\])]|[_ ](\S+))?\s*")


@dataclass(frozen=True, eq=False)
class Abscissa:
    """The axis over which a channel was sampled.

    Attributes:
        values: Place of each sample, in `unit` (n,); None if the file has none.
        name, unit: Texts of the file; "" if it has none.
        kind: What the file says it is: "time", or words such as "an angle (sync type 2)"; "" if it
            does not say.
    """

    values: FloatArray | None = None
    name: str = ""
    unit: str = ""
    kind: str = ""

    @property
    def words(self) -> str:
        """Return name and unit, such as ``'angle' [deg]``."""
        return f"'{self.name or 'abscissa'}'" + (f" [{self.unit}]" if self.unit else "")


@dataclass(frozen=True, eq=False)
class Signal:
    """A recorded channel with its labels.

    Attributes:
        name: Name in the file, without its unit.
        values: Samples, in `unit` (n,). A sample that is missing or invalid is NaN.
        unit: Text of the unit, as the file has it; "" if it has none.
        abscissa: The axis over which it was sampled.
        start: Absolute time at which `abscissa` is zero, since 1970; None if the file does not say.
            [ns]
        group: Group, structure or folder in the file; "" if it has none.
        node: Node and direction, such as ``2+Z``; "" if it has none.
        title: Name as the file writes it: a header with its unit.
        fault: Why its values cannot be used; "" if they can.
        fault_line: Line of the file of that fault, 0 if it has none.
        lines: Line of the file of each sample (n,); None if the file has no lines.
    """

    name: str
    values: FloatArray
    unit: str = ""
    abscissa: Abscissa = field(default_factory=Abscissa)
    start: int | None = None
    group: str = ""
    node: str = ""
    title: str = ""
    fault: str = ""
    fault_line: int = 0
    lines: np.ndarray | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names by which it can be chosen, from the shortest to the longest."""
        with_node = [f"{self.name}:{self.node}"] if self.node else []
        short = [self.name, *with_node, *([self.title] if self.title else [])]
        return (*short, *(f"{self.group}/{name}" for name in short if self.group))

    def usable(self, path: Path) -> "Signal":
        """Return the signal itself, after checking that its values can be used.

        Raises:
            InputError: they cannot; the message has the words of the file.
        """
        if self.fault:
            where = f"{path}:{self.fault_line}" if self.fault_line else str(path)
            raise input_error(self.fault, where=where, key=self.title or self.name)
        return self

    def time(self, path: Path) -> FloatArray:
        """Return the time of each sample after `start` (n,). [s]

        Raises:
            InputError: it was not sampled over time, or the file has no time for it.
        """
        axis = self.abscissa
        if axis.values is None:
            message = "the file has no time for this channel; name one: --channels time=NAME"
            raise input_error(axis.kind or message, where=str(path), key=self.name)
        if axis.kind in ("", TIME):
            if not plain_unit(axis.unit):
                return axis.values
            try:
                return axis.values * factor_of(axis.unit, SECOND)
            except ValueError:
                pass
        kind = axis.kind if axis.kind not in ("", TIME) else kind_of(axis.unit)
        raise input_error(
            f"was recorded over {axis.words}, {kind}; needs a recording over time, in a unit such "
            "as s, ms, min or h",
            where=str(path),
            key=self.name,
        )


def real_signal(signal: Signal) -> Signal:
    """Return a signal, with a fault if its values are complex."""
    if not np.iscomplexobj(signal.values):
        return signal
    fault = "has complex values, such as those of a spectrum; needs a recording over time"
    return replace(signal, values=np.asarray(signal.values).real, fault=fault)


def kind_of(unit: str) -> str:
    """Return what a unit of an abscissa measures, in words."""
    for kind, measured in _KINDS.items():
        try:
            factor_of(unit, measured)
        except ValueError:
            continue
        return kind
    return "which is no time" if is_unit(unit) else f"whose unit '{unit}' is not known"


def split_title(title: str) -> tuple[str, str]:
    """Return name and unit of a title such as ``Acc 1 [g]``, ``Acc 1 (g)`` or ``Acc 1 / g``.

    A bracket that has no known unit belongs to the name.
    """
    text = " ".join(title.split())
    for form in (_BRACKETED, _AFTER_SIGN):
        match = form.fullmatch(text)
        if match:
            unit = next(part for part in match.groups()[1:] if part is not None).strip()
            if is_unit(unit) or (form is _BRACKETED and not plain_unit(unit)):
                return match[1], unit
    return text, ""


def word_of(name: str) -> tuple[str, str]:
    """Return the first word of a name, in small letters, and the unit that follows it.

    It splits ``time_s``, ``force N`` and ``displacement [furl]``. A name of several words has no
    such form: the word is then the whole name.
    """
    match = _AFTER_WORD.fullmatch(name)
    if match is None or (match[3] and not is_unit(match[3])):
        return name.strip().lower(), ""
    return match[1].lower(), (match[2] or match[3] or "").strip()
