"""Sensitivity of frequencies and damping ratios to the numbers of the machine file.

The derivative of an eigenvalue by a number p is

    dlambda/dp = l (dA/dp) r       l, r: left and right eigenvector, l r = 1

dA/dp is a central difference of matrices of machines that are set up again with p changed, so that
preloads and rest pose follow.
"""

from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr

from wm_drake.errors import InputError
from wm_drake.parameters import Change, MachineParameters, with_value
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.variation import Number
from wm_drake.studies.modes.linearisation import Spectrum
from wm_drake.studies.modes.quantities import DAMPING_CHANGE, FREQUENCY_CHANGE

RELATIVE_STEP = 1e-3
"""Half of the central difference, as part of the number."""

STEP_OF_ZERO = 1e-3
"""Step from a number that is zero, in its display unit."""

SKIPPED = ("profile", "step", "sensors", "measured")
"""Groups of numbers that no linearisation depends on."""


RELATIVE = "relative change"
"""What the sensitivity to a number that is not zero is divided by."""


def sensitivities(
    parameters: MachineParameters,
    spectrum: Spectrum,
    matrix_of: Callable[[MachineParameters], FloatArray],
    loads: bool,
    progress: Callable[[], None] = lambda: None,
) -> xr.Dataset:
    """Return the sensitivity of modes to every number, without those that cannot be changed.

    A table counts as one number: a factor of all its values.

    Args:
        matrix_of: Returns the matrix of a machine with a number changed.
        loads: Whether the matrix depends on a load.

    Returns:
        Over `key`, the key path of the number, and mode: `relative_change_of_frequency` over the
        relative change of the number, and `change_of_damping_ratio` likewise. A number that is zero
        has no relative change: the display unit that they are divided by is in `per`, which else is
        `RELATIVE`.
    """
    every = list[tuple[str, str, FloatArray, FloatArray]]()
    for number in numbers_of(parameters, loads):
        slope = _slope(parameters, number, matrix_of)
        progress()
        if slope is None:
            continue
        change = np.einsum("mi,ij,jm->m", spectrum.left, slope, spectrum.right)
        size = np.abs(spectrum.values)
        relative = np.real(np.conj(spectrum.values) * change) / size**2
        damping = -change.real / size + spectrum.values.real * relative / size
        is_zero = not isinstance(number.original, tuple) and not number.nominal
        per = number.unit.shown if is_zero else RELATIVE
        every.append((number.key, per, relative, damping))
    keys, units, frequency, damping = zip(*every, strict=True)
    return xr.Dataset(
        {
            "relative_change_of_frequency": FREQUENCY_CHANGE.variable(("key", "mode"), frequency),
            "change_of_damping_ratio": DAMPING_CHANGE.variable(("key", "mode"), damping),
            "per": ("key", list(units)),
        },
        {"key": list(keys)},
    )


def numbers_of(parameters: MachineParameters, loads: bool) -> Iterator[Number]:
    """Yield every number, or column of a table, that a linearisation may depend on."""
    for key, value, unit in quantities(parameters):
        group = key.split(".")[0]
        if group in SKIPPED or (group == "loads" and not loads):
            continue
        if isinstance(value, tuple) and not any(value):
            continue
        yield Number(key, value, unit)


def _slope(
    parameters: MachineParameters,
    number: Number,
    matrix_of: Callable[[MachineParameters], FloatArray],
) -> FloatArray | None:
    """Return dA per relative change of a number; of a zero, dA per display unit.

    Returns:
        None if the number cannot be changed, or is of a branch of rubber that is not in use.
    """

    def at(change: Change, value: float) -> FloatArray:
        return matrix_of(with_value(parameters, number.key, number.changed(change, value)))

    try:
        if number.original == 0.0:
            step = STEP_OF_ZERO / number.unit.from_si(1.0)
            moved, plain = at(Change.DISTANCE, step), at(Change.DISTANCE, 0.0)
            return (moved - plain) / STEP_OF_ZERO if moved.shape == plain.shape else None
        ends = [at(Change.PERCENT, 1.0 + sign * RELATIVE_STEP) for sign in (1.0, -1.0)]
        return (ends[0] - ends[1]) / (2.0 * RELATIVE_STEP)
    except InputError:
        return None
