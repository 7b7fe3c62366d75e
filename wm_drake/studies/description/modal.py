"""Rigid-body modes of the hanging tub."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import InputPortSelection, OutputPortSelection
from pydrake.systems.primitives import Linearize

from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray


@dataclass(frozen=True)
class Modes:
    """Modes in rising order of frequency.

    Attributes:
        frequency_hz: (n,) natural frequency |lambda| / (2 pi).
        damping_ratio: (n,) -Re(lambda) / |lambda|.
        shape: (n, 6) roll, pitch, yaw, x, y, z of T, real part at the phase of the largest component, which is 1 after
            angles are weighted with 0.25 m. [rad, m]
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    shape: FloatArray


_SLOWEST = 2.0 * np.pi * 0.01
"""What is slower is held by nothing but rounding: the turn of a damper's tubes about its axis. [rad/s]"""

_ANGLE_ARM = 0.25
"""Weighs angles against translations in a mode shape: about the radius of the tub. [m]"""


def natural_modes(
    machine: Machine, parameters: MachineParameters | None = None, *, gasket: bool = True
) -> Modes:
    """The empty tub's modes about its rest pose with the dampers free, by Drake's `Linearize` of the whole diagram.

    Dampers are taken out because friction at rest is no spring and no dashpot: a smoothed law would linearize to a huge one.
    The drum stands still. Overdamped motions are not among the modes, nor are those of damper tubes on their bushings and of
    a drum in its bearing, which are faster than the tub's six.

    Args:
        machine: A built machine.
        parameters, gasket: As for `Machine.set_up`.
    """
    setup = machine.set_up(parameters=parameters, gasket=gasket, dampers=False)
    machine.set_drum_acceleration(setup.context, 0.0)
    system = Linearize(
        machine.diagram, setup.context, InputPortSelection.kNoInput, OutputPortSelection.kNoOutput
    )
    values, vectors = np.linalg.eig(system.A())
    oscillating = np.flatnonzero(values.imag > max(_SLOWEST, 1e-6 * np.abs(values).max()))
    order = oscillating[np.argsort(np.abs(values[oscillating]))][:6]
    shapes = [_real_shape(vectors[machine.state_layout.tub, index]) for index in order]
    size = np.abs(values[order])
    return Modes(size / (2.0 * np.pi), -values[order].real / size, np.array(shapes))


def _real_shape(vector: FloatArray) -> FloatArray:
    weight = np.repeat([_ANGLE_ARM, 1.0], 3)
    largest = int(np.argmax(np.abs(vector * weight)))
    return np.asarray((vector / (vector[largest] * weight[largest])).real)
