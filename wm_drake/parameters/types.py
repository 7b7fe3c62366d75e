"""Aliases that several rooms share."""

from typing import Annotated, TypeAlias

import numpy as np
from pydantic import StringConstraints

FloatArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
"""An array of floats; the docstring of each use gives shape and unit."""

ComplexArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]
"""An array of complex numbers; the docstring of each use gives shape and unit."""

Name: TypeAlias = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_-]{0,63}$")]
"""Name of an entry. It becomes part of key paths and of file names."""
