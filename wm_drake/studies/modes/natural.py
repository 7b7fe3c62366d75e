"""Natural modes of an empty machine without friction."""

import numpy as np
import xarray as xr

from wm_drake.engines.trajectory import COORDINATES
from wm_drake.model.build import AnyMachine, machine_of
from wm_drake.parameters import MachineParameters
from wm_drake.studies.modes.data import oscillation
from wm_drake.studies.modes.linearisation import MODES, Linearisation
from wm_drake.studies.modes.shapes import shape_of


def natural_modes(
    machine: AnyMachine, parameters: MachineParameters | None = None, *, gasket: bool = True
) -> xr.Dataset:
    """Return the natural modes of the empty machine about its rest pose, without friction.

    The drum stands still. Dampers lose their law and their friction, because friction at rest is
    neither a spring nor a dashpot; `wm_drake.studies.modes.study.modes` treats it. Their bushings
    and tubes stay. Overdamped motions are not included. Of
    the others, only the six slowest are included; damper tubes on their bushings and a drum in a
    compliant bearing have faster ones.

    Args:
        machine: A built machine, its parameters, or its name or file.
        parameters: Parameters to use; those of the built machine if None.
        gasket: False removes the gasket.

    Returns:
        Over `mode`, in rising order: `frequency` |lambda| / (2 pi) [Hz], `damping_ratio`
        -Re(lambda) / |lambda|, and `shape` over `coordinate` (roll, pitch, yaw, x, y, z of T)
        [rad, m]: the real part at the phase of its largest component, scaled so that this component
        is 1 after angles are multiplied by 0.25 m.

    Example:
        >>> import wm_drake as wm
        >>> modes = wm.natural_modes(wm.build_machine(wm.load_machine("reference")))
        >>> modes.frequency.size
        6
    """
    machine = machine_of(machine)
    setup = machine.set_up(parameters=parameters, gasket=gasket, dampers=False)
    spectrum = Linearisation(setup).spectrum().first(MODES)
    shape = np.array([shape_of(vector).real for vector in spectrum.right.T])
    return xr.Dataset(
        {
            **oscillation("mode", spectrum.frequency_hz, spectrum.damping_ratio),
            "shape": (("mode", "coordinate"), shape),
        },
        {"coordinate": list(COORDINATES)},
    )
