"""Aliases that several rooms share."""

from typing import TypeAlias

import numpy as np

FloatArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
"""An array of floats; the docstring of each use gives shape and unit."""
