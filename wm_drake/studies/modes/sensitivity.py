"""Sensitivity of frequencies and damping ratios to the numbers of the machine file.

The derivative of an eigenvalue by a number p is

    dlambda/dp = l (dA/dp) r       l, r: left and right eigenvector, l r = 1

dA/dp is a central difference of matrices of machines that are set up again with p changed, so that
preloads and rest pose follow.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from wm_drake.errors import InputError
from wm_drake.parameters import MachineParameters, with_value
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.studies.modes.linearisation import Spectrum

RELATIVE_STEP = 1e-3
"""Half of the central difference, as part of the number."""

STEP_OF_ZERO = 1e-3
"""Step from a number that is zero, in its display unit."""

SKIPPED = ("profile", "step", "sensors", "measured")
"""Groups of numbers that no linearisation depends on."""


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of the modes by one number of the machine file.

    A table counts as one number: a factor of all its values.

    Attributes:
        key: Key path.
        value: The number; NaN for a table. SI
        unit: Its unit.
        frequency: Relative change of each frequency over the relative change of the number; per
            display unit if the number is zero. (m,)
        damping: Change of each damping ratio, likewise. (m,)
        per_unit: Whether the number is zero.
    """

    key: str
    value: float
    unit: Unit
    frequency: FloatArray
    damping: FloatArray
    per_unit: bool


def sensitivities(
    parameters: MachineParameters,
    spectrum: Spectrum,
    matrix_of: Callable[[MachineParameters], FloatArray],
    loads: bool,
    progress: Callable[[], None] = lambda: None,
) -> list[Sensitivity]:
    """Return the sensitivity of modes to every number, without those that cannot be changed.

    Args:
        parameters: The machine.
        spectrum: Modes of its matrix.
        matrix_of: Returns the matrix of a machine with a number changed.
        loads: Whether the matrix depends on a load.
        progress: Called after each number.
    """
    found = []
    for key, value, unit in numbers_of(parameters, loads):
        slope, per_unit = _slope(parameters, key, value, unit, matrix_of)
        progress()
        if slope is None:
            continue
        change = np.einsum("mi,ij,jm->m", spectrum.left, slope, spectrum.right)
        size = np.abs(spectrum.values)
        relative = np.real(np.conj(spectrum.values) * change) / size**2
        damping = -change.real / size + spectrum.values.real * relative / size
        number = np.nan if isinstance(value, tuple) else float(value)
        found.append(Sensitivity(key, number, unit, relative, damping, per_unit))
    return found


def numbers_of(parameters: MachineParameters, loads: bool) -> Iterator[tuple[str, Any, Unit]]:
    """Yield key, value and unit of every number that a linearisation may depend on."""
    for key, value, unit in quantities(parameters):
        group = key.split(".")[0]
        if group in SKIPPED or (group == "loads" and not loads):
            continue
        if isinstance(value, tuple) and not any(value):
            continue
        yield key, value, unit


def _slope(
    parameters: MachineParameters,
    key: str,
    value: Any,
    unit: Unit,
    matrix_of: Callable[[MachineParameters], FloatArray],
) -> tuple[FloatArray | None, bool]:
    """Return dA per relative change of a number, and False; dA per display unit and True for 0."""

    def at(factor: float, shift: float) -> FloatArray:
        moved = (
            tuple(factor * number for number in value)
            if isinstance(value, tuple)
            else factor * value + shift
        )
        return matrix_of(with_value(parameters, key, moved))

    try:
        if value == 0.0:
            step = STEP_OF_ZERO / unit.from_si(1.0)
            moved, plain = at(1.0, step), at(1.0, 0.0)
            if moved.shape != plain.shape:  # a branch of rubber that is not in use
                return None, False
            return (moved - plain) / STEP_OF_ZERO, True
        both = at(1.0 + RELATIVE_STEP, 0.0) - at(1.0 - RELATIVE_STEP, 0.0)
        return both / (2.0 * RELATIVE_STEP), False
    except InputError:
        return None, False
