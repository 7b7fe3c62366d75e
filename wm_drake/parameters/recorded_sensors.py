"""Sensors of a recorded machine: where they sit, what they measure, and what the recorder does.

A small file declares them:

    load: middle
    sensors:
      rear_z: {channel: Acc 3, frame: sensor_r, axis: z, low_pass: 100 Hz}
    speed: {channel: Drum, kind: pulses, pulses_per_turn: 2}

Without a file, the displacement sensors and the accelerometers of the machine file are used.
"""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from wm_drake.parameters import units as u
from wm_drake.parameters.elements import Frozen
from wm_drake.parameters.files import read_model
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.types import Name
from wm_drake.parameters.units import Unit

SIGNAL_UNITS = {
    "displacement": Unit("m", "mm"),
    "velocity": Unit("m/s", "mm/s"),
    "acceleration": Unit("m/s^2", "m/s^2"),
}
"""Units of the signals of sensors, by what they measure."""


class RecordedSensor(Frozen):
    """A sensor with one axis at a point of the tub, and what its recorder does to the signal.

    Attributes:
        quantity: What it measures.
        frame: Frame of the tub at whose origin it sits; else `point`.
        point: Its position in the frame of the tub; else `frame`.
        axis: Its axis, parallel to that of W at rest.
        tilt: Roll, pitch and yaw that turn the axis from there, about the axes of W.
        axes: Whether its axis turns with the tub, as that of a part glued to it, or stays that of
            the housing, as that of a laser. By default it turns if it measures acceleration.
        gravity: An accelerometer shows gravity: at rest, 9.81 m/s^2 along an axis that points
            upwards. `removed` for a signal from which it has been taken out.
        polarity: `negative` if the recorded signal has the other sign.
        gain: Recorded value by true one, for a sensitivity that differs from the recorder's.
        ac_coupling: Corner of the first-order high-pass of an AC-coupled sensor.
        low_pass: Corner of the recorder's low-pass, a Butterworth filter.
        low_pass_order: Its order.
        noise: Standard deviation of the noise of a sample, in a unit of the quantity.
        place_deviation: Standard deviation of each coordinate of its place, for fits.
        channel: Name of the channel in the files. Default: the name of the sensor.
        unit: Unit of a channel whose file has none.
    """

    quantity: Literal["displacement", "velocity", "acceleration"] = "acceleration"
    frame: str | None = None
    point: u.Position | None = None
    axis: Literal["x", "y", "z"]
    tilt: u.Angles = (0.0, 0.0, 0.0)
    axes: Literal["tub", "world"] | None = None
    gravity: Literal["included", "removed"] = "included"
    polarity: Literal["positive", "negative"] = "positive"
    gain: Annotated[u.Ratio, Field(gt=0.0)] = 1.0
    ac_coupling: Annotated[u.Frequency, Field(gt=0.0, le=20.0)] | None = None
    low_pass: Annotated[u.Frequency, Field(gt=0.0)] | None = None
    low_pass_order: Annotated[int, Field(ge=1, le=8)] = 4
    noise: Annotated[float, Field(ge=0.0)] = 0.0
    place_deviation: Annotated[u.Length, Field(ge=0.0, le=0.1)] = 0.0
    channel: str = ""
    unit: str = ""

    @field_validator("low_pass_order", mode="before")
    @classmethod
    def _whole(cls, value: Any) -> Any:
        return int(value) if isinstance(value, str) and value.strip().isdigit() else value

    @field_validator("noise", mode="before")
    @classmethod
    def _noise_of_quantity(cls, value: Any, info: ValidationInfo) -> Any:
        """Return a noise with its unit, such as ``0.02 m/s^2``, in SI."""
        unit = SIGNAL_UNITS[info.data.get("quantity", "acceleration")]
        return unit.number(value) if isinstance(value, str) else value

    @model_validator(mode="after")
    def _is_placed(self) -> "RecordedSensor":
        if (self.frame is None) == (self.point is None):
            raise ValueError("needs either frame (of the tub) or point, such as (0, -200, 250) mm")
        if len(self.tilt) != 3:
            raise ValueError(f"tilt: needs roll, pitch and yaw, has {len(self.tilt)} values")
        if self.gravity == "removed" and self.quantity != "acceleration":
            raise ValueError(f"gravity: a {self.quantity} has none; leave it out")
        return self

    @property
    def signal_unit(self) -> Unit:
        """Unit of its signal."""
        return SIGNAL_UNITS[self.quantity]

    @property
    def turns_with_tub(self) -> bool:
        """Whether its axis turns with the tub."""
        return (self.axes or ("tub" if self.quantity == "acceleration" else "world")) == "tub"

    @property
    def shows_gravity(self) -> bool:
        """Whether its mean shows gravity."""
        is_accelerometer = self.quantity == "acceleration" and self.gravity == "included"
        return is_accelerometer and self.ac_coupling is None


class SpeedChannel(Frozen):
    """The channel of a tacho or another sensor of the drum speed.

    Attributes:
        channel: Name of the channel in the files.
        kind: A speed, or pulses, each at a rise through the middle of the signal.
        unit: Unit of a speed whose file has none.
        pulses_per_turn: Pulses in a turn of the shaft.
        ratio: Turns of the shaft in a turn of the drum, such as the ratio of the belt for a tacho
            on the motor.
    """

    channel: str
    kind: Literal["speed", "pulses"] = "speed"
    unit: str = ""
    pulses_per_turn: Annotated[u.Ratio, Field(gt=0.0)] = 1.0
    ratio: Annotated[u.Ratio, Field(gt=0.0)] = 1.0


class RecordedTest(Frozen):
    """A test of a whole machine: load, sensors, and the channel of the drum speed.

    Attributes:
        load: Name of the load of the machine, or load file.
        load_deviation: Relative standard deviation of its mass, for fits; 0 for a mass that is
            known, or is an unknown of the fit itself.
        sensors: Sensors, by name.
        speed: Channel of the drum speed, if there is one.
    """

    load: str | None = None
    load_deviation: Annotated[float, u.Fraction(), Field(ge=0.0, le=0.3)] = 0.0
    sensors: Annotated[dict[Name, RecordedSensor], Field(min_length=1)]
    speed: SpeedChannel | None = None


def load_recorded_test(path: Path) -> RecordedTest:
    """Read the file of a test.

    Raises:
        InputError: the file is missing or wrong, with one problem for each error.
    """
    return read_model(RecordedTest, path)


def recorded_test_of(parameters: MachineParameters) -> RecordedTest:
    """Return the sensors of a machine file as those of a test.

    Displacement sensors measure along axes of W. An accelerometer S1 has the channels S1_x, S1_y
    and S1_z, and shows gravity.
    """
    displacements = {
        name: RecordedSensor(quantity="displacement", frame=sensor.frame, axis=sensor.axis)
        for name, sensor in parameters.sensors.items()
    }
    accelerations = {
        f"{name}_{axis}": RecordedSensor.model_validate({"frame": frame, "axis": axis})
        for name, frame in parameters.accelerometer_frames().items()
        for axis in "xyz"
    }
    return RecordedTest(sensors={**displacements, **accelerations})
