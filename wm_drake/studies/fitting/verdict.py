"""Verdict on a fit by its lack of fit."""

from typing import Literal, TypeAlias

Verdict: TypeAlias = Literal["good", "fair", "poor"]

GOOD, FAIR = 0.05, 0.15
"""Largest lack of fit of a good and of a fair fit, as a part of the measured values."""


def verdict_of(missed: float) -> Verdict:
    """Return the verdict on a model that misses a part of the measured values."""
    if missed <= GOOD:
        return "good"
    return "fair" if missed <= FAIR else "poor"
