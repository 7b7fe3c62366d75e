"""Speed source of the drum, and the torque that the motor needs for it."""

from typing import Any

from pydrake.systems.framework import LeafSystem_

from wm_drake.systems.callbacks import NO_SLOTS, callback
from wm_drake.systems.scalars import define_system
from wm_drake.systems.spin_profile_source import check_start

REFLECTED_INERTIA = 1e8
"""Inertia of the drive at the drum joint. [kg m^2] Not physical: it enters only the diagonal of the
mass matrix at the joint. The actuation J alpha therefore accelerates the drum by alpha for any
motion of the tub, to one part in 1e8. The motor torque is J (alpha - drum acceleration)."""


@define_system("SpeedSource_", __name__)
def SpeedSource_(T: type) -> Any:
    """Return the class SpeedSource for a scalar type."""

    class SpeedSource(LeafSystem_[T]):
        """Turn the drum with a prescribed angular acceleration alpha.

            profile_acceleration (1) ──▶ [ SpeedSource ] ──▶ actuation (1) J alpha [N m]
            drum_acceleration (1)    ──▶ [             ]
            profile_speed (1)        ──▶ [             ]
            drum_speed (1)           ──▶ [             ]

        alpha is the value of the port `drum_acceleration` if one is connected or fixed there, else
        that of `profile_acceleration`. [rad/s^2] The speeds are for `check_start` alone, when a
        simulation begins.
        """

        __slots__ = NO_SLOTS

        def _construct(self, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self._profile = self.DeclareVectorInputPort("profile_acceleration", 1)
            self._acceleration = self.DeclareVectorInputPort("drum_acceleration", 1)
            self._speeds = [
                self.DeclareVectorInputPort(name, 1) for name in ("profile_speed", "drum_speed")
            ]
            needs = {self._profile.ticket(), self._acceleration.ticket()}
            self.DeclareVectorOutputPort("actuation", 1, callback(self._calc_actuation), needs)
            self.DeclareInitializationPublishEvent(callback(self._check_start))

        def _check_start(self, context: Any) -> None:
            if not self._acceleration.HasValue(context):
                check_start(context.get_time(), *(port.Eval(context)[0] for port in self._speeds))

        def _calc_actuation(self, context: Any, output: Any) -> None:
            acceleration = (
                self._acceleration if self._acceleration.HasValue(context) else self._profile
            )
            output.SetFromVector(REFLECTED_INERTIA * acceleration.Eval(context))

    return SpeedSource


SpeedSource = SpeedSource_[None]


@define_system("MotorTorque_", __name__)
def MotorTorque_(T: type) -> Any:
    """Return the class MotorTorque for a scalar type."""

    class MotorTorque(LeafSystem_[T]):
        """Torque of the motor on the drum; its reaction acts on the tub.

            actuation (1)                ──▶ [ MotorTorque ] ──▶ torque (1) [N m]
            generalized_acceleration (n) ──▶ [             ]

        torque = actuation - J vdot, with the reflected inertia J of the drive.
        """

        __slots__ = NO_SLOTS

        def _construct(self, size: int, drum: int, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.size, self.drum = size, drum
            self._actuation = self.DeclareVectorInputPort("actuation", 1)
            self._rates = self.DeclareVectorInputPort("generalized_acceleration", size)
            needs = {self._actuation.ticket(), self._rates.ticket()}
            self.DeclareVectorOutputPort("torque", 1, callback(self._calc_torque), needs)

        def _calc_torque(self, context: Any, output: Any) -> None:
            rate = self._rates.Eval(context)[self.drum : self.drum + 1]
            output.SetFromVector(self._actuation.Eval(context) - REFLECTED_INERTIA * rate)

    return MotorTorque


MotorTorque = MotorTorque_[None]
