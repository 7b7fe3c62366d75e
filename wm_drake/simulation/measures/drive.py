"""The drive: torque, power, energy, speed ripple, speed at the end, and capture at a resonance."""

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.drive import measured_drive
from wm_drake.simulation.measures.kind import Better, Measure, Variable, each_run
from wm_drake.simulation.measures.run import Run

_TORQUE, _SPEED = Unit("N*m", "N*m"), Unit("rad/s", "rpm")
_RIPPLE = Unit("dimensionless", "percent")


def _drive(run: Run) -> list[FloatArray]:
    return measured_drive(run.time, run.drum_angle, run.drum_speed, run.motor_torque, run.profile)


def _number(name: str, unit: Unit, about: str, better: Better = "smaller") -> Variable:
    """Return a variable that is one number of the run and a response of studies."""
    return Variable(
        f"drive_{name}",
        (),
        unit,
        f"{name.replace('_', ' ')} of the drive",
        about,
        better=better,
        is_response=not name.startswith("caught"),
        studio=None,
    )


DRIVE = Measure(
    "drive",
    (
        _number("peak_torque", _TORQUE, "largest torque of the motor on the drum"),
        _number("mean_torque", _TORQUE, "largest torque of the motor averaged over a revolution"),
        _number(
            "mean_torque_speed", _SPEED, "speed of the drum at the largest mean torque", better=""
        ),
        _number("peak_power", Unit("W", "W"), "largest power of the motor"),
        _number("energy", Unit("J", "J"), "work of the motor over the run"),
        _number("speed_ripple", _RIPPLE, "largest coefficient of fluctuation of the speed"),
        _number(
            "end_speed",
            _SPEED,
            "speed of the drum at the end, averaged over a revolution",
            "larger",
        ),
        _number(
            "caught_speed",
            _SPEED,
            "speed at which the drum is caught; NaN if it is not",
            better="",
        ),
        _number(
            "caught_torque",
            _TORQUE,
            "mean torque of the motor where the drum is caught",
            better="",
        ),
    ),
    each_run(_drive),
    has_table=False,
)
