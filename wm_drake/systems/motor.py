"""Speed controller, motor and belt of a drive.

spin profile ──▶ [ SpeedController ] ──demand──▶ [ Motor ] ──torque──▶ [ Belt ] ──▶ drum
                      ▲        ▲                  │     ▲                │   ▲
                      │        └── torque limit ──┘     └── motor speed ─┘   │
                      └──────────────────── drum speed ──────────────────────┘
"""

from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem_

from wm_drake.elements.motor import evaluate_controller, evaluate_motor
from wm_drake.parameters.types import FloatArray
from wm_drake.systems.callbacks import NO_SLOTS, callback
from wm_drake.systems.scalars import Packed, define_system, empty, evaluator
from wm_drake.systems.spin_profile_source import check_start


class _Controller(Packed):
    """Methods of the `SpeedController`, for both scalar types."""

    __slots__ = NO_SLOTS

    def declare_controller(self, scalar: type, packed: FloatArray, sample_time: float) -> None:
        """Declare ports, state and events; `self` is a LeafSystem of the scalar type."""
        system: Any = self
        self.sample_time, self._scalar = sample_time, scalar
        self._evaluate = evaluator(evaluate_controller, scalar)
        ticket = self.declare_numbers(scalar, packed)
        self._profile, self._reference, self._speed, self._limit = (
            system.DeclareVectorInputPort(name, 1)
            for name in ("profile_speed", "speed_reference", "drum_speed", "torque_limit")
        )
        if sample_time:
            system.DeclareDiscreteState(2)
            system.DeclarePeriodicDiscreteUpdateEvent(sample_time, 0.0, callback(self._sample))
            needs = {system.xd_ticket()}
        else:
            system.DeclareContinuousState(1)
            inputs = self._profile, self._reference, self._speed
            needs = {ticket, system.xc_ticket(), *(port.ticket() for port in inputs)}
        system.DeclareVectorOutputPort("demand", 1, callback(self._calc_demand), needs)
        system.DeclareInitializationPublishEvent(callback(self._check_start))

    def _check_start(self, context: Any) -> None:
        if not self._reference.HasValue(context):
            speeds = (port.Eval(context)[0] for port in (self._profile, self._speed))
            check_start(context.get_time(), *speeds)

    def reset(self, context: Any) -> None:
        """Set the controller's own Context to its state before a run: no torque."""
        if self.sample_time:
            context.SetDiscreteState(np.zeros(2))
        else:
            context.SetContinuousState(np.zeros(1))

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
        """Write the rate of the integral part of a continuous controller."""
        if not self.sample_time:
            response = self._response(context, self._integral(context), with_limit=True)
            derivatives.get_mutable_vector().SetFromVector(response[1:])

    def _integral(self, context: Any) -> Any:
        kind = "discrete" if self.sample_time else "continuous"
        return getattr(context, f"get_{kind}_state_vector")().CopyToVector()[0]

    def _response(self, context: Any, integral: Any, *, with_limit: bool) -> Any:
        """Return the demand [N m] and the rate of the integral part [N m/s].

        The demand does not depend on the limit. To read it there would be an algebraic loop.
        """
        reference = self._reference if self._reference.HasValue(context) else self._profile
        inputs, outputs = empty(4, self._scalar), empty(2, self._scalar)
        inputs[:3] = integral, self._speed.Eval(context)[0], reference.Eval(context)[0]
        inputs[3] = self._limit.Eval(context)[0] if with_limit else 0.0 * integral
        self._evaluate(inputs, self.packed_numbers(context), outputs)
        return outputs

    def _calc_demand(self, context: Any, output: Any) -> None:
        if self.sample_time:
            output.SetFromVector(context.get_discrete_state_vector().CopyToVector()[1:])
        else:
            response = self._response(context, self._integral(context), with_limit=False)
            output.SetFromVector(response[:1])

    def _sample(self, context: Any, state: Any) -> None:
        integral = self._integral(context)
        demand, growth = self._response(context, integral, with_limit=True)
        state.get_mutable_vector().SetFromVector([integral + self.sample_time * growth, demand])


@define_system("SpeedController_", __name__)
def SpeedController_(T: type) -> Any:
    """Return the class SpeedController for a scalar type."""

    class SpeedController(_Controller, LeafSystem_[T]):
        """PI controller with anti-windup; laws `speed_controller` and `integral_rate`.

            profile_speed (1) [rad/s]   ──▶ [ SpeedController ] ──▶ demand (1) [N m]
            speed_reference (1) [rad/s] ──▶ [   (integral)    ]
            drum_speed (1) [rad/s]      ──▶ [                 ]
            torque_limit (1) [N m]      ──▶ [                 ]

        The wanted speed of the drum is the value of `speed_reference` if one is connected or fixed
        there, else that of `profile_speed`. The state of a continuous controller is the integral
        part; a sampled one has it and the demand, which it holds, as discrete states.
        """

        __slots__ = NO_SLOTS

        def _construct(self, packed: FloatArray, sample_time: float, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.declare_controller(T, packed, sample_time)

    return SpeedController


SpeedController = SpeedController_[None]


@define_system("Motor_", __name__)
def Motor_(T: type) -> Any:
    """Return the class Motor for a scalar type."""

    class Motor(Packed, LeafSystem_[T]):
        """Motor with a torque limit over its speed; laws `torque_limit` and `limited`.

        demand (1) [N m]        ──▶ [ Motor ] ──▶ torque (1) at its shaft [N m]
        motor_speed (1) [rad/s] ──▶ [       ] ──▶ torque_limit (1) [N m]
        """

        __slots__ = NO_SLOTS

        def _construct(self, packed: FloatArray, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self._evaluate = evaluator(evaluate_motor, T)
            ticket = self.declare_numbers(T, packed)
            self._demand = self.DeclareVectorInputPort("demand", 1)
            self._speed = self.DeclareVectorInputPort("motor_speed", 1)
            needs = {ticket, self._speed.ticket()}
            self.DeclareVectorOutputPort(
                "torque", 1, callback(self._calc_torque), {self._demand.ticket(), *needs}
            )
            self.DeclareVectorOutputPort("torque_limit", 1, callback(self._calc_limit), needs)

        def _response(self, context: Any, demand: Any) -> Any:
            inputs, outputs = empty(2, T), empty(2, T)
            inputs[:] = demand, self._speed.Eval(context)[0]
            self._evaluate(inputs, self.packed_numbers(context), outputs)
            return outputs

        def _calc_torque(self, context: Any, output: Any) -> None:
            output.SetFromVector(self._response(context, self._demand.Eval(context)[0])[:1])

        def _calc_limit(self, context: Any, output: Any) -> None:
            output.SetFromVector(self._response(context, T(0.0))[1:])

    return Motor


Motor = Motor_[None]


@define_system("Belt_", __name__)
def Belt_(T: type) -> Any:
    """Return the class Belt for a scalar type."""

    class Belt(Packed, LeafSystem_[T]):
        """Rigid belt without slip: the motor turns `belt_ratio` times as fast as the drum.

            drum_speed (1) [rad/s]  ──▶ [ Belt ] ──▶ motor_speed (1) [rad/s]
            motor_torque (1) [N m]  ──▶ [      ] ──▶ drum_torque (1) [N m]
            given_torque (1) [N m]  ──▶ [      ]

        The drum torque is that of the motor times the ratio; the torque that accelerates the rotor
        is part of it (`wm_drake.model.rotor`). If a torque is connected or fixed at `given_torque`,
        the drum torque is that, without a limit, in place of the motor's.
        """

        __slots__ = NO_SLOTS

        def _construct(self, packed: FloatArray, converter: Any = None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            ticket = self.declare_numbers(T, packed)
            self._speed = self.DeclareVectorInputPort("drum_speed", 1)
            self._torque = self.DeclareVectorInputPort("motor_torque", 1)
            self._given = self.DeclareVectorInputPort("given_torque", 1)
            torques = {self._torque.ticket(), self._given.ticket()}
            for name, needs, calc in (
                ("motor_speed", {self._speed.ticket()}, self._calc_speed),
                ("drum_torque", torques, self._calc_torque),
            ):
                self.DeclareVectorOutputPort(name, 1, callback(calc), {ticket, *needs})

        def _calc_speed(self, context: Any, output: Any) -> None:
            output.SetFromVector(self.packed_numbers(context) * self._speed.Eval(context))

        def _calc_torque(self, context: Any, output: Any) -> None:
            if self._given.HasValue(context):
                output.SetFromVector(self._given.Eval(context))
            else:
                output.SetFromVector(self.packed_numbers(context) * self._torque.Eval(context))

    return Belt


Belt = Belt_[None]
