"""Rigid-body modes of the suspended tub."""

from dataclasses import dataclass

import numpy as np

from wm_drake.model.build import AnyMachine, machine_of
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.modes.linearisation import MODES, Linearisation
from wm_drake.studies.modes.shapes import shape_of


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


def natural_modes(
    machine: AnyMachine, parameters: MachineParameters | None = None, *, gasket: bool = True
) -> Modes:
    """Compute the natural modes of the empty machine about its rest pose, without friction.

    The drum stands still. Dampers lose their law and their friction, because friction at rest is
    neither a spring nor a dashpot; `wm_drake.studies.modes.study.modes` treats it. Their bushings
    and tubes stay. Overdamped motions are not included. Of
    the others, only the six slowest are included; damper tubes on their bushings and a drum in a
    compliant bearing have faster ones.

    Args:
        machine: A built machine, its parameters, or its name or file.
        parameters: Parameters to use; those of the built machine if None.
        gasket: False removes the gasket.

    Example:
        >>> import wm_drake as wm
        >>> modes = wm.natural_modes(wm.build_machine(wm.load_machine("reference")))
        >>> len(modes.frequency_hz)
        6
    """
    machine = machine_of(machine)
    setup = machine.set_up(parameters=parameters, gasket=gasket, dampers=False)
    spectrum = Linearisation(setup).spectrum().first(MODES)
    shapes = [shape_of(vector).real for vector in spectrum.right.T]
    return Modes(spectrum.frequency_hz, spectrum.damping_ratio, np.array(shapes))
