"""Displacement sensors on the tub."""

from typing import Any

from pydrake.systems.framework import BasicVector_, LeafSystem_, NumericParameterIndex

from wm_drake.elements.motion import PLANT_STATE_SIZE
from wm_drake.elements.sensor import POINT_SIZE, evaluate_sensors
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.callbacks import NO_SLOTS, callback
from wm_drake.systems.scalars import define_system, empty, evaluator

DETERGENT_SIZE = 3
"""The last three measured points are the point nearest the detergent box, along x, y, z."""

DRUM_OUTPUTS = ("drum_speed", "drum_angle", "drum_motion")
"""Outputs that tell how the drum turns; the last one is what a PidController of Drake takes."""

_ANGLE = PLANT_STATE_SIZE // 2 - 1
"""Index of the drum angle in the state of tub and drum: the last position."""


class _DrumOutputs:
    """Outputs `DRUM_OUTPUTS`, for both scalar types."""

    __slots__ = NO_SLOTS

    def declare_drum_outputs(self, plant_state: Any) -> None:
        """Declare the outputs; `self` is a LeafSystem with an input port of tub and drum."""
        system: Any = self
        self._drum_state = plant_state
        calcs = (self._calc_drum_speed, self._calc_drum_angle, self._calc_drum_motion)
        for name, size, calc in zip(DRUM_OUTPUTS, (1, 1, 2), calcs, strict=True):
            needs = {plant_state.ticket()}
            system.DeclareVectorOutputPort(name, size, callback(calc), needs)

    def _calc_drum_speed(self, context: Any, output: Any) -> None:
        output.SetFromVector(self._drum_state.Eval(context)[-1:])

    def _calc_drum_angle(self, context: Any, output: Any) -> None:
        output.SetFromVector(self._drum_state.Eval(context)[_ANGLE : _ANGLE + 1])

    def _calc_drum_motion(self, context: Any, output: Any) -> None:
        output.SetFromVector(self._drum_state.Eval(context)[[_ANGLE, -1]])


@define_system("Sensors_", __name__)
def Sensors_(T: type) -> Any:
    """Return the class Sensors for a scalar type."""

    class Sensors(_DrumOutputs, LeafSystem_[T]):
        """Displacement sensors of the tub; law `displacement_at`.

            plant_state (14) ──▶ [ Sensors ] ──▶ displacement (k) of each sensor along its axis [m]
                                             ──▶ detergent_displacement (3) in W [m]
                                             ──▶ drum_speed (1) against the tub [rad/s]
                                             ──▶ drum_angle (1) against the tub [rad]
                                             ──▶ drum_motion (2) angle and speed [rad, rad/s]

        Displacements are from the rest pose of the empty machine.
        """

        __slots__ = NO_SLOTS

        def _construct(self, points: FloatArray, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.points = points  # a scalar-converted copy is constructed from these
            self._evaluate = evaluator(evaluate_sensors, T)
            self._plant_state = self.DeclareVectorInputPort("plant_state", PLANT_STATE_SIZE)
            self._index = self.DeclareNumericParameter(BasicVector_[T](points.ravel()))
            needs = {
                self._plant_state.ticket(),
                self.numeric_parameter_ticket(NumericParameterIndex(self._index)),
            }
            sensors = len(points) - DETERGENT_SIZE
            self.DeclareVectorOutputPort(
                "displacement", sensors, callback(self._calc_sensors), needs
            )
            self.DeclareVectorOutputPort(
                "detergent_displacement", DETERGENT_SIZE, callback(self._calc_detergent), needs
            )
            self.declare_drum_outputs(self._plant_state)

        def set_points(self, context: Any, points: FloatArray) -> None:
            """Set the measured points (k, `POINT_SIZE`) in the system's own Context."""
            context.get_mutable_numeric_parameter(self._index).SetFromVector(points.ravel())

        def _displacements(self, context: Any) -> Any:
            points = context.get_numeric_parameter(self._index).CopyToVector()
            displacement = empty(len(points) // POINT_SIZE, T)
            self._evaluate(self._plant_state.Eval(context), points, displacement)
            return displacement

        def _calc_sensors(self, context: Any, output: Any) -> None:
            output.SetFromVector(self._displacements(context)[:-DETERGENT_SIZE])

        def _calc_detergent(self, context: Any, output: Any) -> None:
            output.SetFromVector(self._displacements(context)[-DETERGENT_SIZE:])

    return Sensors


Sensors = Sensors_[None]
