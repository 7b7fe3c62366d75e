"""Errors that a user can correct, with one line of message for each problem."""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass


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
        """Return one line: ``file:line: key.path: message``."""
        return ": ".join(part for part in (self.where, self.key, self.message) if part)


class InputError(WmDrakeError):
    """An input that cannot be used; the message has one line per problem."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        """Store the problems, of which there must be at least one."""
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


def input_error(message: str, *, where: str = "", key: str = "") -> InputError:
    """Return an `InputError` with a single problem.

    Args:
        message: What is wrong and what is allowed.
        where: Location, such as ``file:line`` or the name of an option.
        key: Key path of the value.
    """
    return InputError([Problem(where, key, message)])


def first_line(error: Exception) -> str:
    """Return the first line of the message of a foreign exception, at most 200 characters of it."""
    line = next(iter(str(error).strip().splitlines()), type(error).__name__)
    return line if len(line) <= 200 else f"{line[:197]}..."


def nearest_names(name: str, known: Iterable[str]) -> str:
    """Return a hint for an unknown name, such as `` (did you mean 'x'? known: x, y, z)``.

    The hint contains the most similar name if there is one. It lists all known names if they are
    at most 24, or if none is similar.

    Args:
        name: The unknown name.
        known: All known names.
    """
    names = sorted(known)
    if not names:
        return " (there are none)"
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f"did you mean '{close[0]}'? " if close else ""
    if len(names) <= 24 or not close:
        hint += "known: " + ", ".join(names)
    return f" ({hint.strip()})"
