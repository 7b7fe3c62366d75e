"""State of a machine: names, order and sizes of all numbers that the compiled engine integrates.

The parts of a machine that have states are declared here with the role of each state; a machine has
some of these parts, in the order of `ORDER`. All indices in a state follow from a `StateMap`.
"""

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from wm_drake.elements.cabinet import SLIP_SIZE
from wm_drake.elements.motion import BODY_STATE, TREE_STATE
from wm_drake.elements.motor import MOTOR_STATE_SIZE
from wm_drake.elements.rubber import AXIS_COUNT
from wm_drake.parameters.types import FloatArray

ANGLE, POSITION, JOINT = "angle", "position", "joint position"
ANGULAR_VELOCITY, VELOCITY, JOINT_VELOCITY = "angular velocity", "velocity", "joint velocity"
SPONGE, CONTROL, SLIP, ELEMENT_STATE = "sponge", "control", "slip", "own"
WATER_LEFT = "water left"
"""Roles of states, with `FRICTION` and `MAXWELL` of rubber. `ELEMENT_STATE` is
that of a state of an element kind of another package."""
PLACES = (ANGLE, POSITION, JOINT)
VELOCITIES = (ANGULAR_VELOCITY, VELOCITY, JOINT_VELOCITY)

_ROLES = {
    "angles": ANGLE,
    "position": POSITION,
    "joint_position": JOINT,
    "angular_velocity": ANGULAR_VELOCITY,
    "velocity": VELOCITY,
    "joint_rate": JOINT_VELOCITY,
}
TREE_ROLES = tuple(
    _ROLES[name] for name, kind in TREE_STATE.fields.items() for _ in range(kind.size)
)
BODY_ROLES = tuple(
    _ROLES[name] for name, kind in BODY_STATE.fields.items() for _ in range(kind.size)
)
"""Role of each number of a `TREE_STATE` and of a `BODY_STATE`."""

TUB, STRUT_SPONGE, TUBES, CARRIER = "tub", "sponge of a strut", "tubes", "carrier"
DRIVE, CABINET, STRETCHES, ELEMENT = "drive", "cabinet", "stretches", "element"
WATER = "water"
ORDER = (TUB, STRUT_SPONGE, TUBES, CARRIER, DRIVE, CABINET, STRETCHES, ELEMENT, WATER)
"""Kinds of parts, in the order of their states.

Tub and drum (`TREE_STATE`); the sponge of each strut damper, in use or not; each telescopic damper
(`TUBES_STATE`); the drum carrier of a compliant bearing (`BODY_STATE`); a drive with a motor
(`MOTOR_STATE`); a cabinet that moves (`BODY_STATE`, then the slips of its feet); the stretches of
each bushing of rubber; the states of each element of another package; the share of water that is
left in each wet mass of the load."""

TUB_WORDS, BEARING_WORDS = "the tub", "the drum in its bearing"
DRIVE_WORDS, CABINET_WORDS = "the drum with its motor", "the cabinet on its feet"
"""What states belong to, for messages."""

RATES_SIZE = 6
"""Accelerations of a body in a sample: angular, and of its origin, in W. [rad/s^2, m/s^2]"""


class Begins(NamedTuple):
    """Indices for compiled functions. The tub begins at 0.

    Attributes:
        sponges, tubes, carrier, motor, cabinet, stretches, elements, water: Where the parts of each
            kind begin in the state, in the order of `ORDER`.
        size: Number of states.
        stretch_inputs, wrench_input: Where the rates of rubber bushings and the wrench on the
            cabinet begin in the inputs of internal states.
        inputs: Number of inputs of internal states.
        rates: Number of accelerations in a sample.
    """

    sponges: int
    tubes: int
    carrier: int
    motor: int
    cabinet: int
    stretches: int
    elements: int
    water: int
    size: int
    stretch_inputs: int
    wrench_input: int
    inputs: int
    rates: int


@dataclass(frozen=True)
class StatePart:
    """Consecutive states of one part of a machine.

    Attributes:
        kind: One of `ORDER`.
        roles: Role of each state.
        words: What each state belongs to, for messages.
        begin: Index of the first one.
    """

    kind: str
    roles: tuple[str, ...]
    words: tuple[str, ...] = field(compare=False)
    begin: int = 0

    @property
    def end(self) -> int:
        """Return the index behind its last state."""
        return self.begin + len(self.roles)

    def indices(self, *roles: str) -> list[int]:
        """Return the indices of its states with some roles; of all states without an argument."""
        return [
            self.begin + k for k, role in enumerate(self.roles) if role in (roles or self.roles)
        ]


@dataclass(frozen=True)
class StateMap:
    """The states of a machine.

    Attributes:
        parts: The parts that have states, in their order.
    """

    parts: tuple[StatePart, ...]

    def __hash__(self) -> int:
        """Return a hash, which is computed once: thousands of runs are sorted by their states."""
        return self._hash

    @functools.cached_property
    def _hash(self) -> int:
        return hash(self.parts)

    @classmethod
    def of(cls, parts: Iterable[StatePart]) -> "StateMap":
        """Return the map of parts in any order; those of one kind keep theirs."""
        placed, begin = list[StatePart](), 0
        for part in sorted(parts, key=lambda part: ORDER.index(part.kind)):
            placed.append(replace(part, begin=begin))
            begin = placed[-1].end
        return cls(tuple(placed))

    @property
    def size(self) -> int:
        """Return the number of states."""
        return self.parts[-1].end

    def of_kind(self, kind: str) -> list[StatePart]:
        """Return the parts of a kind."""
        return [part for part in self.parts if part.kind == kind]

    def span(self, kind: str) -> slice:
        """Return the states of all parts of a kind; an empty slice at their place without any."""
        before = ORDER.index(kind)
        begin = max((p.end for p in self.parts if ORDER.index(p.kind) < before), default=0)
        return slice(begin, max((part.end for part in self.of_kind(kind)), default=begin))

    def indices(self, *roles: str, kinds: Sequence[str] = ORDER) -> np.ndarray:
        """Return the indices of the states with some roles in parts of some kinds."""
        indices = [k for part in self.parts if part.kind in kinds for k in part.indices(*roles)]
        return np.array(indices, dtype=np.int64)

    def kinds(self) -> list[tuple[str, str]]:
        """Return kind of part and role of each state."""
        return [(part.kind, role) for part in self.parts for role in part.roles]

    def words(self) -> list[str]:
        """Return what each state belongs to, for messages."""
        return [words for part in self.parts for words in part.words]

    def begins_of(self, kind: str) -> np.ndarray:
        """Return the index of the first state of each part of a kind."""
        return np.array([part.begin for part in self.of_kind(kind)], dtype=np.int64)

    @functools.cached_property
    def begins(self) -> Begins:
        """Return the indices for compiled functions."""
        struts, rubber = len(self.of_kind(STRUT_SPONGE)), AXIS_COUNT * len(self.of_kind(STRETCHES))
        cabinets, wrench = len(self.of_kind(CABINET)), struts + rubber
        return Begins(
            sponges=self.span(STRUT_SPONGE).start,
            tubes=self.span(TUBES).start,
            carrier=self.span(CARRIER).start,
            motor=self.span(DRIVE).start,
            cabinet=self.span(CABINET).start,
            stretches=self.span(STRETCHES).start,
            elements=self.span(ELEMENT).start,
            water=self.span(WATER).start,
            size=self.size,
            stretch_inputs=struts,
            wrench_input=wrench,
            inputs=wrench + RATES_SIZE * cabinets,
            rates=RATES_SIZE * (1 + len(self.of_kind(CARRIER)) + cabinets),
        )

    def take(self, states: FloatArray, kind: str) -> FloatArray:
        """Return the states (n, k) of all parts of a kind."""
        return states[:, self.span(kind)]

    def cabinet(self, states: FloatArray) -> FloatArray | None:
        """Return the states (n, 20) of a cabinet that moves; None for a fixed one."""
        return self.take(states, CABINET) if self.of_kind(CABINET) else None

    def deformation(self, states: FloatArray) -> FloatArray:
        """Return the deformations of all sponges (n, d), those of telescopic dampers last. [m]"""
        return np.take(states, self.indices(SPONGE), axis=1)

    def tubes(self, states: FloatArray) -> FloatArray:
        """Return the `TREE_STATE` of each telescopic damper. (n, dampers, 14)"""
        return np.take(states, self._trees, axis=1)

    @property
    def _trees(self) -> np.ndarray:
        return self.begins_of(TUBES)[:, None] + np.arange(TREE_STATE.fixed_size)

    def joined(
        self,
        motion: FloatArray,
        deformation: FloatArray,
        tubes: FloatArray,
        others: dict[str, FloatArray],
    ) -> FloatArray:
        """Return states (n, size) from their parts; the inverse of the functions above.

        Args:
            motion: State of tub and drum. (n, 14)
            deformation: Deformations of all sponges. (n, d) [m]
            tubes: `TREE_STATE` of each telescopic damper. (n, dampers, 14)
            others: States (n, k) of all parts of other kinds, by kind; zero without an entry.
        """
        states: FloatArray = np.zeros((len(motion), self.size))
        states[:, self.span(TUB)] = motion
        states[:, self._trees] = tubes
        states[:, self.indices(SPONGE)] = deformation
        for kind, part in others.items():
            states[:, self.span(kind)] = part
        return states


def _part(kind: str, roles: Sequence[str], words: str) -> StatePart:
    return StatePart(kind, tuple(roles), (words,) * len(roles))


def tub_part() -> StatePart:
    """Return the states of tub and drum."""
    return _part(TUB, TREE_ROLES, TUB_WORDS)


def sponge_part(name: str) -> StatePart:
    """Return the state of a strut damper: the deformation of its sponge, if it has one."""
    return _part(STRUT_SPONGE, [SPONGE], f"the sponge of damper '{name}'")


def tubes_part(name: str) -> StatePart:
    """Return the states of a telescopic damper."""
    tubes, sponge = f"the tubes of damper '{name}'", f"the sponge of damper '{name}'"
    return StatePart(TUBES, (*TREE_ROLES, SPONGE), (*[tubes] * len(TREE_ROLES), sponge))


def stretches_part(name: str, roles: Sequence[str]) -> StatePart:
    """Return the states of a bushing of rubber, each of the role `FRICTION` or `MAXWELL`."""
    return StatePart(
        STRETCHES, tuple(roles), tuple(f"the {role} of bushing '{name}'" for role in roles)
    )


def element_part(name: str, size: int) -> StatePart:
    """Return the states of an element of another package."""
    return _part(ELEMENT, [ELEMENT_STATE] * size, f"element '{name}'")


def water_part(count: int) -> StatePart:
    """Return the shares of water that are left in the wet masses of a load."""
    return _part(WATER, [WATER_LEFT] * count, "the water of the load")


def carrier_part() -> StatePart:
    """Return the states of the drum carrier in a compliant bearing."""
    return _part(CARRIER, BODY_ROLES, BEARING_WORDS)


def drive_part() -> StatePart:
    """Return the states of a drive with a motor."""
    return _part(DRIVE, [CONTROL] * MOTOR_STATE_SIZE, DRIVE_WORDS)


def cabinet_part() -> StatePart:
    """Return the states of a cabinet that moves."""
    return _part(CABINET, [*BODY_ROLES, *[SLIP] * SLIP_SIZE], CABINET_WORDS)
