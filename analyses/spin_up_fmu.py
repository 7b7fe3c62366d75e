"""How does an FMU run up with a controller outside of it?

The machine `motor` is exported with a torque input. A PI controller with the gains of its machine
file, sampled each millisecond, follows the machine's spin profile.

    python analyses/spin_up_fmu.py --picture docs/pictures/fmu_run_up.png
"""

import argparse
import tempfile
from collections.abc import Iterable
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave

import wm_drake as wm
from wm_drake.export.options import FmuOptions
from wm_drake.parameters import MotorDrive
from wm_drake.parameters.types import FloatArray
from wm_drake.report.drawing import matplotlib_of
from wm_drake.report.figure import OURS, QUIET, Axis, Figure, Line, Panel

SAMPLE_TIME = 1e-3


def spin_up(
    path: Path, reference: Iterable[float], gains: tuple[float, float, float], sample_time: float
) -> list[list[float]]:
    """Return speed of the drum and displacement after each sample of the controller.

    Args:
        path: FMU of version 3 with the input `torque`.
        reference: Wanted speed of the motor at each sample. [rad/s]
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


def figure(time: FloatArray, profile: FloatArray, history: FloatArray) -> Figure:
    """Return speed and displacement over time; one of ten samples."""
    shown, rpm = slice(None, None, 10), 30.0 / np.pi
    speeds = (
        Line(time[shown], rpm * profile[shown], color=QUIET, dash="dashed", key="spin profile"),
        Line(time[shown], rpm * history[shown, 0], color=OURS, key="drum of the FMU"),
    )
    motion = (Line(time[shown], 1e3 * history[shown, 1], color=OURS, width=0.8),)
    panels = (
        Panel(marks=speeds, x=Axis(label="time, s"), y=Axis(label="drum speed, rpm")),
        Panel(marks=motion, x=Axis(label="time, s"), y=Axis(label="displacement Xr, mm"), row=1),
    )
    return Figure(panels=panels, height=420.0, keys=("spin profile", "drum of the FMU"))


def main() -> None:
    """Export the machine, run it up, and print what happens."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the first two seconds")
    parser.add_argument("--out", type=Path, help="also write the line to this file")
    parser.add_argument("--picture", type=Path, help="write the picture to this file")
    arguments = parser.parse_args()
    parameters = wm.load_machine("motor")
    drive, profile = parameters.drive, parameters.profile
    assert isinstance(drive, MotorDrive)
    controller = drive.controller
    gains = drive.belt_ratio, controller.proportional_gain, controller.integral_gain
    time = np.arange(0.0, 2.0 if arguments.quick else profile.duration, SAMPLE_TIME)
    speed = np.asarray(profile.speed_at(time))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motor.fmu"
        wm.export_fmu(parameters, "middle", path, FmuOptions(input="torque"))
        history = np.array(spin_up(path, drive.belt_ratio * speed, gains, SAMPLE_TIME))
    behind = 30.0 / np.pi * np.abs(history[:, 0] - speed).max()
    text = (
        f"{time[-1]:.1f} s to {30.0 / np.pi * history[-1, 0]:.0f} rpm: the drum is at most "
        f"{behind:.2g} rpm from the profile; largest displacement Xr "
        f"{1e3 * np.abs(history[:, 1]).max():.3g} mm"
    )
    print(text)
    if arguments.out:
        arguments.out.write_text(text + "\n")
    if arguments.picture:
        matplotlib_of(figure(time, speed, history)).savefig(arguments.picture, dpi=110)


if __name__ == "__main__":
    main()
