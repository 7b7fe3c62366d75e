"""Values of the ports of element systems."""

import numpy as np


def own_outputs(system, context):
    """Return all own outputs of an element (forces, moments, ...), one after the other."""
    ports = [system.get_output_port(i) for i in range(system.num_output_ports())]
    own = [port for port in ports if port.get_name() not in ("generalized_force", "state")]
    return np.concatenate([port.Eval(context) for port in own])
