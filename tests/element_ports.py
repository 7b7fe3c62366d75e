"""Values and derivatives of the ports of element systems."""

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff


def own_outputs(system, context):
    """Return all own outputs of an element (forces, moments, ...), one after the other."""
    ports = [system.get_output_port(i) for i in range(system.num_output_ports())]
    own = [port for port in ports if port.get_name() not in ("generalized_force", "state")]
    return np.concatenate([port.Eval(context) for port in own])


def check_derivatives(system, state, ports=("generalized_force",), step=1e-7, part=1e-5):
    """Compare derivatives of ports and rates by AutoDiffXd with central differences.

    Args:
        system: System of an element.
        state: State of tub and drum (14), then its own.
        ports: Names of output ports.
        step: Half the difference of a state.
        part: Largest difference, as a part of the largest derivative of an output.
    """

    def outputs(system, values):
        context = system.CreateDefaultContext()
        system.GetInputPort("plant_state").FixValue(context, values[:14])
        rates = np.zeros(0)
        if len(values) > 14:
            context.SetContinuousState(values[14:])
            rates = system.EvalTimeDerivatives(context).CopyToVector()
        return np.concatenate([*(system.GetOutputPort(p).Eval(context) for p in ports), rates])

    slopes = ExtractGradient(outputs(system.ToScalarType[AutoDiffXd](), InitializeAutoDiff(state)))
    steps = step * np.eye(len(state))
    ends = [(outputs(system, state + h), outputs(system, state - h)) for h in steps]
    differences = np.transpose([(high - low) / (2.0 * step) for high, low in ends])
    scale = np.maximum(np.abs(slopes).max(axis=1, keepdims=True), 1e-9)
    np.testing.assert_allclose(slopes / scale, differences / scale, atol=part)
