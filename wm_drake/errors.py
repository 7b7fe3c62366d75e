"""Errors that a user can correct, with one line of message for each problem."""

import difflib
import re
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

LONGEST_LINE = 500
"""Largest number of characters of a problem; a longer one is shortened."""

MOST_PROBLEMS = 8
"""Largest number of problems, each in a line, that the text of an `InputError` lists."""

MOST_NAMES = 8
"""Largest number of allowed names that a message lists."""

LIBRARIES = {
    "libglib-2.0.so.0": "libglib2.0-0",
    "libpcre2-8.so.0": "libpcre2-8-0",
    "libstdc++.so.6": "libstdc++6",
    "libgcc_s.so.1": "libgcc-s1",
}
"""Libraries that Drake links and no wheel has, and the packages of Debian and Ubuntu with them."""

_LONGEST_WHERE, _LONGEST_KEY, _LONGEST_WORD, _LONGEST_LIST = 220, 80, 60, 300


class WmDrakeError(Exception):
    """An error that the user can correct; its text is the complete message."""


@dataclass(frozen=True)
class Problem:
    """One problem of an input.

    Attributes:
        where: Location, such as ``file:line`` or the name of an option; may be empty.
        key: Key path of the value; may be empty.
        message: What is wrong and what is allowed.
    """

    where: str
    key: str
    message: str

    def __str__(self) -> str:
        """Return one line: ``file:line: key.path: message``.

        Long parts are shortened, and characters that a terminal would act on are escaped.
        """
        where, key = shortened(self.where, _LONGEST_WHERE), shortened(self.key, _LONGEST_KEY)
        message = shortened(self.message, LONGEST_LINE - len(where) - len(key) - 4)
        return ": ".join(part for part in (where, key, message) if part)


class InputNotice(UserWarning):
    """A remark on an input that is used, but not exactly as it was given."""


class InputError(WmDrakeError):
    """An input that cannot be used.

    The message has one line per problem, at most `MOST_PROBLEMS`, and the number of the others.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        """Store the problems, of which there must be at least one."""
        self.problems = tuple(problems)
        lines = [str(problem) for problem in self.problems[:MOST_PROBLEMS]]
        if left_out := len(self.problems) - len(lines):
            lines.append(f"and {left_out} more problem{'s' if left_out > 1 else ''}")
        super().__init__("\n".join(lines))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the problems; the default would pass the message to `__init__`."""
        return type(self), (self.problems,), self.__dict__


def input_error(message: str, *, where: str = "", key: str = "") -> InputError:
    """Return an `InputError` with a single problem."""
    return InputError([Problem(where, key, message)])


@contextmanager
def problems_at(where: str, key: str | None = None) -> Iterator[None]:
    """Replace the place of the problems that the block raises, and their key path if one is given.

    Args:
        where: Such as the name of an option.
        key: Key path; None to keep those of the problems.
    """
    try:
        yield
    except InputError as error:
        raise InputError(
            replace(p, where=where, key=p.key if key is None else key) for p in error.problems
        ) from None


@contextmanager
def problems_inside(key: str) -> Iterator[None]:
    """Prefix the key paths of the problems that the block raises.

    Args:
        key: Key path of what the block reads.
    """
    try:
        yield
    except InputError as error:
        raise InputError(
            replace(p, key=f"{key}.{p.key}" if p.key else key) for p in error.problems
        ) from None


@contextmanager
def libraries_named() -> Iterator[None]:
    """Replace the error of an import that does not find a library by one that names its package."""
    try:
        yield
    except ImportError as error:
        pattern = r"(?P<linux>[^\s/]+): cannot open shared object|Library not loaded: (?P<mac>\S+)"
        missing = re.search(pattern, str(error))
        if not missing:
            raise
        library = missing["linux"] or missing["mac"]
        how = "install the package of this system that has it"
        if library in LIBRARIES:
            how += f"; on Debian or Ubuntu: apt-get install {LIBRARIES[library]}"
        raise input_error(f"is missing, and Drake needs it; {how}", where=library) from None


def shortened(text: str, longest: int) -> str:
    """Return a text in one printable line of limited length.

    Characters that are not printable are escaped. In a text that is too long, long words lose their
    middle first, then the text loses its middle.
    """
    line = text if text.isprintable() else "".join(map(_printable, text))
    if len(line) > longest:
        line = re.sub(rf"\S{{{_LONGEST_WORD + 1},}}", _without_middle, line)
    if len(line) > longest:
        tail = longest // 3
        line = f"{line[: longest - tail - 1]}…{line[-tail:]}"
    return line


def _printable(character: str) -> str:
    return character if character.isprintable() else character.encode("unicode_escape").decode()


def _without_middle(word: re.Match[str]) -> str:
    return f"{word[0][: _LONGEST_WORD - 21]}…{word[0][-20:]}"


def reason_of(error: OSError | ValueError) -> str:
    """Return why a file cannot be read or written, in words without the number of the error."""
    return getattr(error, "strerror", None) or shortened(str(error), 100) or type(error).__name__


def nearest_names(name: str, known: Iterable[str]) -> str:
    """Return a hint for an unknown name, such as `` (did you mean 'x'? known: x, y, z)``.

    The hint contains the most similar other name if there is one, and at most `MOST_NAMES` known
    names, the most similar ones first; a longer list ends with the number of names left out.
    """
    names = sorted(set(known) - {name})
    if not names:
        return " (there are none)"
    short = name[:_LONGEST_KEY]
    close = difflib.get_close_matches(short, names, n=MOST_NAMES, cutoff=0.5)
    hint = f"did you mean '{close[0]}'? " if close else ""
    listed = names
    if len(names) > MOST_NAMES:
        listed = [*close, *(other for other in names if other not in close)]
    shown, length = list[str](), 0
    for other in listed[:MOST_NAMES]:
        length += len(other) + 2
        if length > _LONGEST_LIST:
            break
        shown.append(other)
    left_out = len(names) - len(shown)
    hint += "known: " + ", ".join([*shown, *([f"{left_out} more"] if left_out else [])])
    return f" ({hint.strip()})"


def check_known(
    name: str, known: Collection[str], message: str, *, where: str = "", key: str = ""
) -> None:
    """Raise an `InputError` for a name that is not known: a message with a hint to known names."""
    if name not in known:
        raise input_error(f"{message}{nearest_names(name, known)}", where=where, key=key)
