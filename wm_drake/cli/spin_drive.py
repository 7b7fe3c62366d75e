"""The drive in `wm-drake spin`: the option `--drive`, the JSON and the lines on the terminal."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.errors import input_error, nearest_names

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    import xarray as xr

    from wm_drake.parameters import MachineParameters
    from wm_drake.simulation.drive import DriveMeasures

IN_BATCH = (
    *("peak_torque", "mean_torque", "mean_torque_speed", "peak_power", "energy", "speed_ripple"),
    *("caught_speed", "caught_torque"),
)
"""Measures of the drive in a batch that the JSON has, without `drive_`."""

DRIVES = ("prescribed", "motor")

DriveOption = Annotated[
    str | None,
    typer.Option(
        help="Drive in place of that of the machine file: prescribed (follows the profile exactly) "
        "or motor (the default motor with torque limit and speed controller, or the motor of the "
        "machine file).",
        metavar="NAME",
    ),
]


def with_drive(parameters: "MachineParameters", drive: str | None) -> "MachineParameters":
    """Return a machine with the drive of the option `--drive`, with the sources of its numbers.

    Raises:
        InputError: there is no such drive.
    """
    from wm_drake.parameters import Drive, load_machine, with_value
    from wm_drake.parameters.drive import motor_of

    if drive is None or drive == parameters.drive.kind:
        return parameters
    if drive not in DRIVES:
        raise input_error(f"no drive '{drive}'{nearest_names(drive, DRIVES)}", where="--drive")
    joint, others = parameters.drive.joint, dict(parameters.sources)
    if drive == "prescribed":
        return with_value(parameters, "drive", Drive(joint=joint))
    shipped = load_machine("motor")
    motor = motor_of(shipped.drive)
    assert motor  # that is what this machine is for
    sources = {key: text for key, text in shipped.sources.items() if key.startswith("drive")}
    changed = with_value(parameters, "drive", motor.model_copy(update={"joint": joint}))
    return changed.model_copy(update={"sources": others | sources})


def drive_as_json(drive: "DriveMeasures") -> dict[str, Any]:
    """Return the measures of the drive for JSON, which has no NaN."""
    caught, nan = drive.capture, float("nan")
    return {
        "peak_torque_Nm": _number(drive.peak_torque),
        "mean_torque_Nm": _number(drive.mean_torque),
        "mean_torque_rpm": _rpm(drive.mean_torque_speed),
        "peak_power_W": _number(drive.peak_power),
        "energy_J": _number(drive.energy),
        "speed_ripple_percent": _number(100.0 * drive.speed_ripple),
        "caught_rpm": _rpm(caught.speed if caught else nan),
        "caught_mean_torque_Nm": _number(caught.torque if caught else nan),
    }


def drive_of_run_as_json(measured: "xr.Dataset") -> dict[str, Any] | None:
    """Return the measures of the drive of one run of a batch; None if they were not measured."""
    if "drive_peak_torque" not in measured:
        return None
    of = {name: float(measured[f"drive_{name}"]) for name in IN_BATCH}
    return {
        "peak_torque_Nm": _number(of["peak_torque"]),
        "mean_torque_Nm": _number(of["mean_torque"]),
        "mean_torque_rpm": _rpm(of["mean_torque_speed"]),
        "peak_power_W": _number(of["peak_power"]),
        "energy_J": _number(of["energy"]),
        "speed_ripple_percent": _number(100.0 * of["speed_ripple"]),
        "caught_rpm": _rpm(of["caught_speed"]),
        "caught_mean_torque_Nm": _number(of["caught_torque"]),
    }


def _number(value: float) -> float | None:
    """Return a number, or None for NaN, which JSON does not have."""
    return value if value == value else None


def _rpm(speed: float) -> float | None:
    """Return a speed in rpm, or None for NaN. [rad/s]"""
    from wm_drake.parameters.units import Unit

    return _number(Unit("rad/s", "rpm").from_si(speed))


def drive_text(drive: "DriveMeasures") -> str:
    """Return the measures of the drive as text for the terminal."""
    text = drive_as_json(drive)
    if text["peak_torque_Nm"] is None:
        return "the run is too short for measures of the drive"
    line = f"motor torque on the drum up to {text['peak_torque_Nm']:.1f} N m"
    if text["mean_torque_Nm"] is not None:
        line += (
            f", over a revolution up to {text['mean_torque_Nm']:.2f} N m at "
            f"{text['mean_torque_rpm']:.0f} rpm"
        )
    if text["speed_ripple_percent"] is not None:
        line += f"; speed ripple {text['speed_ripple_percent']:.1f} %"
    if text["caught_rpm"] is not None:
        line += (
            f"; caught at {text['caught_rpm']:.0f} rpm with {text['caught_mean_torque_Nm']:.2f} "
            "N m on average"
        )
    return line
