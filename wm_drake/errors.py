"""What can go wrong by a user's hand, said in one line each."""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass


class WmDrakeError(Exception):
    """Something the user can mend; the text is the whole message."""


@dataclass(frozen=True)
class Problem:
    """One thing wrong in an input: where it stands, what it is, what is allowed."""

    where: str
    key: str
    message: str

    def __str__(self) -> str:
        """One line: ``file:line: key.path: message``."""
        return ": ".join(part for part in (self.where, self.key, self.message) if part)


class InputError(WmDrakeError):
    """An input that cannot be used, with one line per problem."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        """Args: problems, at least one."""
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


def input_error(message: str, *, where: str = "", key: str = "") -> InputError:
    """An `InputError` with a single problem."""
    return InputError([Problem(where, key, message)])


def nearest_names(name: str, known: Iterable[str]) -> str:
    """`` (did you mean 'x'? known: x, y, z)``: the nearest known name, and all of them while they are few."""
    names = sorted(known)
    if not names:
        return " (there are none)"
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f"did you mean '{close[0]}'? " if close else ""
    if len(names) <= 24 or not close:
        hint += "known: " + ", ".join(names)
    return f" ({hint.strip()})"
