"""Units in which results are read: SI units of the trade, or those customary in the United States.

Files that a user writes may have any unit; this is about what commands print and write.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

SI, US = "si", "us"

READING: ContextVar[str] = ContextVar("reading", default=SI)
"""Whether results are read in SI or in US units."""

CUSTOMARY = {
    "mm": "in",
    "m": "ft",
    "mm/s": "in/s",
    "m/s": "ft/s",
    "m/s^2": "ft/s^2",
    "N": "lbf",
    "N/mm": "lbf/in",
    "N/m": "lbf/ft",
    "N*s/mm": "lbf*s/in",
    "N*s/m": "lbf*s/ft",
    "N*m": "lbf*ft",
    "N*mm": "lbf*in",
    "N*mm/rad": "lbf*in/rad",
    "N*m/rad": "lbf*ft/rad",
    "N*mm*s/deg": "lbf*in*s/deg",
    "N*mm*s/rad": "lbf*in*s/rad",
    "N*m*s/rad": "lbf*ft*s/rad",
    "N*m/A": "lbf*ft/A",
    "kg": "lb",
    "g": "oz",
    "g*m": "oz*in",
    "g*mm": "oz*in",
    "kg*m^2": "lb*ft^2",
    "kg/m^3": "lb/ft^3",
    "N/rad": "lbf/rad",
    "N*s^2/m^2": "lbf*s^2/ft^2",
    "s/m": "s/ft",
    "g*mm^2": "oz*in^2",
    "g*m^2": "oz*in^2",
    "N*m/m": "lbf",
    "MPa": "psi",
    "J": "lbf*ft",
    "mJ": "lbf*in",
}
"""US units of units for reading; all others are the same in both: s, Hz, rpm, deg, W, %."""


@contextmanager
def read_in(units: str) -> Iterator[None]:
    """Let results be read in SI or in US units in the block."""
    token = READING.set(units)
    try:
        yield
    finally:
        READING.reset(token)
