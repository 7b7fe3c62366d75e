"""Rigid-body modes of the suspended tub."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import InputPortSelection, OutputPortSelection
from pydrake.systems.primitives import Linearize

from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray


@dataclass(frozen=True)
class Modes:
    """Natural modes in rising order of frequency.

    Attributes:
        frequency_hz: (n,) natural frequencies |lambda| / (2 pi). [Hz]
        damping_ratio: (n,) -Re(lambda) / |lambda|.
        shape: (n, 6) mode shapes: roll, pitch, yaw, x, y, z of T. Each is the real part at the
            phase of its largest component, scaled so that this component is 1 after angles are
            multiplied by 0.25 m. [rad, m]
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    shape: FloatArray


_SLOWEST = 2.0 * np.pi * 0.01
"""Least angular frequency of a mode. [rad/s]

Slower eigenvalues result from rounding only: nothing holds the rotation of a damper's tubes about
its axis.
"""

_ANGLE_ARM = 0.25
"""Length that converts angles to displacements in a mode shape: about the radius of the tub. [m]"""


def natural_modes(
    machine: Machine, parameters: MachineParameters | None = None, *, gasket: bool = True
) -> Modes:
    """Compute the natural modes of the empty machine about its rest pose without dampers.

    The diagram is linearized with Drake's `Linearize`. The drum stands still. Dampers are removed,
    because friction at rest is neither a spring nor a dashpot: a smoothed friction law would
    linearize to a very stiff dashpot. Overdamped motions are not included. Of the others, only the
    six slowest are included; damper tubes on their bushings and a drum in a compliant bearing have
    faster ones.

    Args:
        machine: A built machine.
        parameters: Parameters to use; those of the built machine if None.
        gasket: False removes the gasket.
    """
    setup = machine.set_up(parameters=parameters, gasket=gasket, dampers=False)
    # the drum stands still, whatever speed the spin profile begins with
    machine.set_drum_acceleration(setup.context, 0.0)
    machine.plant.SetVelocities(setup.plant_context, np.zeros(machine.plant.num_velocities()))
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
