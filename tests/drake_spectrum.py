"""Eigenvalues of a machine from Drake's own linearisation, to compare modes with."""

import numpy as np
from pydrake.systems.framework import InputPortSelection, OutputPortSelection
from pydrake.systems.primitives import Linearize

from wm_drake.studies.modes.linearisation import spectrum_of


def drake_spectrum(setup):
    """Return the oscillating eigenvalues of Drake's `Linearize`, with a drum that stands still.

    The eigenvectors are in Drake's order of the state. The Context of the setup is changed.
    """
    machine = setup.machine
    # the drum stands still, whatever speed the spin profile begins with
    machine.set_drum_acceleration(setup.context, 0.0)
    machine.plant.SetVelocities(setup.plant_context, np.zeros(machine.plant.num_velocities()))
    system = Linearize(
        machine.diagram, setup.context, InputPortSelection.kNoInput, OutputPortSelection.kNoOutput
    )
    return spectrum_of(system.A())
