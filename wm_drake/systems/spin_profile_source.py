"""Spin profile as a system: the prescribed acceleration and speed of the drum over time."""

from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common.value import Value
from pydrake.systems.framework import AbstractParameterIndex, LeafSystem_

from wm_drake.elements.spin_profile import drum_at
from wm_drake.errors import input_error
from wm_drake.parameters import SpinProfile
from wm_drake.systems.callbacks import NO_SLOTS, callback
from wm_drake.systems.scalars import define_system


@define_system("SpinProfileSource_", __name__)
def SpinProfileSource_(T: type) -> Any:
    """Return the class SpinProfileSource for a scalar type."""

    class SpinProfileSource(LeafSystem_[T]):
        """Prescribed motion of the drum at the time of the Context.

            [ SpinProfileSource ] ──▶ acceleration (1) [rad/s^2]
                                  ──▶ speed (1) [rad/s]
              parameter: SpinProfile (abstract)

        The acceleration jumps at the corners of the profile. The error of the speed after a step
        across a corner is at most the jump times the step size;
        `wm_drake.engines.drake.advance_to` ends a step at each corner. After the end of the profile
        the speed is constant.
        """

        __slots__ = NO_SLOTS

        def _construct(self, profile: SpinProfile, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.profile = profile  # a scalar-converted copy is constructed from it
            self._index = self.DeclareAbstractParameter(Value[object](profile))
            needs = {
                self.time_ticket(),
                self.abstract_parameter_ticket(AbstractParameterIndex(self._index)),
            }
            self.DeclareVectorOutputPort(
                "acceleration", 1, callback(self._calc_acceleration), needs
            )
            self.DeclareVectorOutputPort("speed", 1, callback(self._calc_speed), needs)

        def set_profile(self, context: Any, profile: SpinProfile) -> None:
            """Set the profile in the source's own Context."""
            context.get_mutable_abstract_parameter(self._index).set_value(profile)

        def get_profile(self, context: Any) -> SpinProfile:
            """Return the profile in the source's own Context."""
            return context.get_abstract_parameter(self._index).get_value()

        def _calc_acceleration(self, context: Any, output: Any) -> None:
            time = context.get_time()
            acceleration, _ = drum_at(self.get_profile(context), _number(time))
            output.SetFromVector([0.0 * time + acceleration])

        def _calc_speed(self, context: Any, output: Any) -> None:
            time = context.get_time()
            acceleration, speed = drum_at(self.get_profile(context), _number(time))
            output.SetFromVector([(time - _number(time)) * acceleration + speed])

    return SpinProfileSource


def check_start(time: Any, profile_speed: Any, drum_speed: Any) -> None:
    """Check that the drum turns at time 0 if its spin profile starts above 0 rpm.

    A default Context has no velocities: Drake does not let a system declare those of a plant.

    Args:
        time: Time of the Context. [s]
        profile_speed, drum_speed: Speed of the profile and of the drum. [rad/s]

    Raises:
        InputError: the drum is at rest.
    """
    if _number(time) == 0.0 and _number(drum_speed) == 0.0 != _number(profile_speed):
        raise input_error(
            f"starts at {_number(profile_speed) * 30.0 / np.pi:.4g} rpm, and the drum is at rest: "
            "a default Context has no velocities; call `set_up(..., context=context)` of the "
            "machine with the root Context of the simulation",
            key="profile",
        )


def _number(value: Any) -> float:
    """Return the value of a number, float or AutoDiffXd."""
    return float(value.value()) if isinstance(value, AutoDiffXd) else float(value)


SpinProfileSource = SpinProfileSource_[None]
