"""Text form of numbers and names on a page, with a true minus sign; words on slack springs."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

MISSING = "–"
"""Text of a value that does not exist."""


def number(value: float, decimals: int = 1) -> str:
    """Return a number rounded to some decimals as text; NaN and infinity become a dash."""
    if not math.isfinite(value):
        return MISSING
    rounded = round(float(value), decimals) + 0.0  # -0.0 + 0.0 is 0.0
    return f"{rounded:.{decimals}f}".replace("-", "−")


def significant(value: float, digits: int = 4) -> str:
    """Return a number with some significant digits as text, without an exponent."""
    text = np.format_float_positional(value, precision=digits, fractional=False, trim="-")
    return text.replace("-", "−")


def three_digits(value: float) -> str:
    """Return a number with three significant digits, also zeros at its end; NaN becomes a dash."""
    if not math.isfinite(value):
        return MISSING
    size = abs(float(f"{value:.3g}"))
    return number(
        value,
        0 if size >= 100 else 1 if size >= 10 else 2 if size >= 1 else 3 if size >= 0.1 else 4,
    )


def signed(value: float) -> str:
    """Return a difference as a whole number with its sign; NaN becomes a dash."""
    return f"+{number(value, 0)}" if math.isfinite(value) and round(value) > 0 else number(value, 0)


def listed(words: Sequence[str]) -> str:
    """Return words as a list in a sentence: a, b and c."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def shape_name(name: str) -> str:
    """Return the name of an SDF shape as words: `tub_shell` becomes `tub shell`."""
    return name.replace("_", " ")


def plain(value: Any) -> Any:
    """Return data for JSON: arrays as lists, NaN and infinity as None, which it lacks."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numbers and arrays of numpy
        value = value.tolist()
    elif hasattr(value, "values"):  # labelled arrays
        value = value.values.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


CONSEQUENCE = (
    "A slack spring does not guide the tub, and its hooks are loaded abruptly when it pulls again."
)


def slack_warning(slack: Mapping[str, Sequence[str]], word: str) -> list[str]:
    """Return a warning in a list, or an empty list if no spring goes slack.

    Args:
        slack: Names of the springs that go slack, by case.
        word: Word before the names of cases, such as "case".
    """
    cases: dict[str, list[str]] = {}
    for case, springs in slack.items():
        for spring in springs:
            cases.setdefault(spring, []).append(case)
    if not cases:
        return []
    listing = "; ".join(f"{spring} in {word} {', '.join(of)}" for spring, of in cases.items())
    return [f"Springs go slack: {listing}. {CONSEQUENCE}"]
