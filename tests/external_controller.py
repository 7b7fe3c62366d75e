"""Spin an FMU with a torque input up by a PI controller outside of it."""

import fmpy
from fmpy.fmi3 import FMU3Slave


def spin_up(path, reference, gains, sample_time):
    """Return speed of the drum and displacement after each sample of the controller.

    Args:
        path: FMU of version 3 with the input `torque`.
        reference: Speed of the motor that is wanted at each sample. [rad/s]
        gains: Belt ratio [1], proportional [N m s/rad] and integral gain [N m/rad].
        sample_time: Time between two samples. [s]
    """
    belt_ratio, proportional, integral = gains
    description = fmpy.read_model_description(path)
    machine = FMU3Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(path),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="machine",
    )
    number = {v.name: v.valueReference for v in description.modelVariables}
    outputs = [number["drum_rate"], number["displacement.Xr"]]
    machine.instantiate()
    machine.enterInitializationMode(startTime=0.0)
    machine.exitInitializationMode()
    history, summed = [], 0.0
    for k, target in enumerate(reference):
        speed = machine.getFloat64(outputs)[0]
        error = target - belt_ratio * speed
        machine.setFloat64([number["motor_torque_demand"]], [proportional * error + summed])
        summed += sample_time * integral * error
        machine.doStep(k * sample_time, sample_time)
        history.append(machine.getFloat64(outputs))
    machine.terminate()
    machine.freeInstance()
    return history
