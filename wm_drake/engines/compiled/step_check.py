"""Check that fixed steps are short enough for the fastest motion of a machine.

Own derivation. The explicit Runge-Kutta scheme of fourth order follows a linear motion
exp(lambda t) while |lambda h| stays small. Friction, sponges, bushings and a compliant bearing
make lambda large: friction over its transition velocity acts as a dashpot, and a stiff dashpot on a
light body decays within a step. The eigenvalues of the machine's Jacobian at a few states with slow
and fast motion show it, whatever the law.
"""

import functools
import itertools
import threading
from dataclasses import dataclass

import numpy as np

from wm_drake.compiler.lanes import WIDTH
from wm_drake.elements.rubber import FRICTION, MAXWELL
from wm_drake.elements.state_map import CABINET as CABINET_STATES
from wm_drake.elements.state_map import (
    CARRIER,
    CONTROL,
    DRIVE_WORDS,
    POSITION,
    SPONGE,
    STRUT_SPONGE,
    VELOCITIES,
    StateMap,
)
from wm_drake.engines.compiled.linear import CABINET as MOVING_CABINET
from wm_drake.engines.compiled.linear import INTERNAL, PATH, SMOOTH, jacobians
from wm_drake.engines.compiled.mechanics import DRUM_ANGLE, DRUM_RATE
from wm_drake.engines.compiled.packing import Layout, initial_state, pack, state_map
from wm_drake.errors import input_error
from wm_drake.model.machine import Setup
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray

LARGEST_DECAY = 2.0
"""Largest |lambda h| of a motion that decays without oscillation.

The scheme is stable up to 2.78."""

LARGEST_PHASE = 1.0
"""Largest |lambda h| of a motion that oscillates, about a sixth of its period. [rad] The scheme is
stable up to 2.83; at 1 rad a step damps the motion by 0.6 % of its amplitude."""

SPEEDS = (1e-6, 1e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0)
"""Speeds of the states that are looked at, one a lane. [m/s, rad/s]

The slowest has every friction on its steepest part; in the fast ones the sponges slip."""

DEFORMATION = 1e-4
"""Deformation of the sponges in these states. [m]"""

MOST_PIECES = 10**6
"""Number of steps in an output period from which on no decimal step is looked for."""

_STANDSTILL = SpinProfile(time=(0.0, 1.0), speed=(0.0, 0.0))

DIFFERENCE = 1e-9
"""Half a step of the central differences: below the slowest speed, so that friction that jumps at
zero counts as constant on either side. [m, rad, m/s, rad/s]"""


@dataclass(frozen=True)
class Linearised:
    """The linearised machine at states with slow and fast motion.

    Attributes:
        jacobians: Of the free states. (WIDTH, n, n) [1/s]
        kinds: How the multistep integrator treats each: one of the constants of
            `wm_drake.engines.compiled.linear`. (n,)
        cabinet: Of a cabinet that moves, under a constant wrench of its mounts. (WIDTH, m, m) [1/s]
    """

    jacobians: FloatArray
    kinds: np.ndarray
    cabinet: FloatArray


@dataclass(frozen=True)
class FastestMotion:
    """The motion of a machine that changes fastest.

    Attributes:
        rate: |lambda|. [1/s]
        oscillates: Whether it oscillates more than it decays.
        part: What moves, in words.
    """

    rate: float
    oscillates: bool
    part: str

    @property
    def longest_step(self) -> float:
        """Return the longest step that follows it. [s]"""
        largest = LARGEST_PHASE if self.oscillates else LARGEST_DECAY
        return largest / self.rate if self.rate else np.inf


def fastest_motions(setup: Setup) -> dict[str, FastestMotion]:
    """Return the motion of each part of a machine that needs the shortest step, by part.

    The parts are named as in the `StateMap`, as far as they have a fastest motion of their own. The
    drum's angle is prescribed without a motor. The friction of a bushing of rubber is left out:
    every step follows its path in closed form. Its stiffness counts in the motion of the tub.

    Raises:
        InputError: the machine has something that the compiled engine does not represent.
    """
    packed, layout = pack(setup)
    (free, parts), kinds = free_states(setup, layout.states), _state_kinds(setup, layout)
    followed = {parts[k] for k, kind in enumerate(kinds.treatment) if kind == PATH}
    matrices = linearised(setup, packed, layout, DIFFERENCE).jacobians
    if not np.all(np.isfinite(matrices)):
        return {"the machine": FastestMotion(np.inf, False, "the machine")}
    moving = np.isin(free, layout.states.indices(*VELOCITIES))
    values, vectors = np.linalg.eig(matrices)
    slowest_step: dict[str, FastestMotion] = {}
    for rates, modes in zip(values, vectors, strict=True):
        for rate, mode in zip(rates, modes.T, strict=True):
            size = float(abs(rate))
            # velocities as the displacements that they make within 1 / |lambda|
            amplitude = np.abs(mode) / np.where(moving, max(size, 1e-9), 1.0)
            part = parts[int(np.argmax(amplitude))]
            if part in followed:
                continue
            motion = FastestMotion(size, bool(abs(rate.imag) > abs(rate.real)), part)
            if part not in slowest_step or motion.longest_step < slowest_step[part].longest_step:
                slowest_step[part] = motion
    return slowest_step


def fastest_motion(setup: Setup) -> FastestMotion:
    """Return the motion of a machine that needs the shortest step; see `fastest_motions`."""
    return min(fastest_motions(setup).values(), key=lambda motion: motion.longest_step)


def linearised(setup: Setup, packed: FloatArray, layout: Layout, difference: float) -> Linearised:
    """Return the Jacobians of the free states, and how the multistep integrator treats each.

    Args:
        setup: The machine.
        packed, layout: From `pack`.
        difference: Half a step of the central differences. [m, rad, m/s, rad/s]
    """
    kinds = _state_kinds(setup, layout)
    of_states, cabinet = jacobians(packed, layout, _states(setup, kinds), kinds.free, difference)
    return Linearised(of_states, kinds.treatment, cabinet)


def slowest_state(setup: Setup, layout: Layout) -> FloatArray:
    """Return the first state of `linearised`: the rest pose, with almost no speed. (size,)"""
    state: FloatArray = _states(setup, _state_kinds(setup, layout))[0]
    return state


@dataclass(frozen=True)
class StateKinds:
    """What the numbers of the state of a machine are.

    Attributes:
        free: Indices of those that are not prescribed.
        treatment: How the multistep integrator treats these. (free,)
        velocities: Indices of the free velocities.
        sponges: Indices of the deformations of sponges.
    """

    free: np.ndarray
    treatment: np.ndarray
    velocities: np.ndarray
    sponges: np.ndarray


_KNOWN_KINDS: dict[Layout, StateKinds] = {}
"""Kinds by layout, of the last `_MOST_KNOWN` layouts."""
_MOST_KNOWN = 64
_KNOWN_KINDS_LOCK = threading.Lock()


def _state_kinds(setup: Setup, layout: Layout) -> StateKinds:
    """Return the kinds of the state; the machines of a design share theirs with their layout."""
    kinds = _KNOWN_KINDS.get(layout)
    if kinds is None:
        states = layout.states
        free, _ = free_states(setup, states)
        kinds = StateKinds(
            np.array(free),
            _treatment(states, free),
            np.intersect1d(free, states.indices(*VELOCITIES)),
            states.indices(SPONGE),
        )
        with _KNOWN_KINDS_LOCK:  # machines are prepared in several threads
            if len(_KNOWN_KINDS) >= _MOST_KNOWN:
                _KNOWN_KINDS.clear()
            _KNOWN_KINDS[layout] = kinds
    return kinds


def _treatment(states: StateMap, free: list[int]) -> np.ndarray:
    """Return how the multistep integrator treats the free states. (n,)"""
    kinds = np.full(states.size, SMOOTH)
    kinds[states.span(STRUT_SPONGE)] = INTERNAL
    kinds[states.span(CABINET_STATES)] = MOVING_CABINET
    kinds[states.indices(FRICTION)] = PATH
    kinds[states.indices(MAXWELL)] = INTERNAL
    return kinds[free]


def check_step(setup: Setup, step: float) -> None:
    """Check that a step is short enough for the fastest motion of a machine.

    Args:
        setup: The machine as it is set up for the run.
        step: Step size. [s]

    Raises:
        InputError: the step is too long; the message names the longest one.
    """
    fastest = fastest_motion(setup)
    if step <= fastest.longest_step:
        return
    if not np.isfinite(fastest.rate):
        raise input_error(
            "forces near rest are not finite numbers; no step follows them", key="step"
        )
    how = f"oscillates at {fastest.rate / (2.0 * np.pi):.4g} Hz"
    if not fastest.oscillates:
        how = f"decays at {fastest.rate:.4g} 1/s"
    raise input_error(
        f"{1e3 * step:g} ms is too long for {fastest.part}, whose fastest motion {how}; "
        f"allowed are up to {_allowed(fastest.longest_step, setup.parameters.output_period)}",
        key="step",
    )


def check_sample_time(setup: Setup) -> None:
    """Check that a sampled speed controller and the drum are stable together.

    Between two samples the torque of the controller is constant. The drum with its rotor, J about
    its axis against a tub at rest, and the integral part then change by

        r_(k+1) = r_k - n T_s/J (n K_p r_k - I_k),    I_(k+1) = I_k - n T_s K_i r_k

    from the wanted speed. The eigenvalues must be inside the unit circle.

    Raises:
        InputError: the sample time is too long.
    """
    drive = setup.motor
    if drive is None or drive.controller.sample_time is None:
        return
    period, control = drive.controller.sample_time, drive.controller
    n, inertia = drive.belt_ratio, drum_inertia(setup)
    steps = period * n * np.array([1.0 / inertia, 1.0])
    loop = np.eye(2) + steps[:, None] * np.array(
        [[-n * control.proportional_gain, 1.0], [-control.integral_gain, 0.0]]
    )
    if np.abs(np.linalg.eigvals(loop)).max() > 1.0 + 1e-12:
        bound = 2.0 * inertia / (n**2 * control.proportional_gain)
        raise input_error(
            f"{1e3 * period:g} ms is too long for the gains of the controller: its "
            f"speed loop is unstable; allowed is less than {1e3 * bound:.3g} ms, or lower gains",
            key="drive.controller.sample_time",
        )


def drum_inertia(setup: Setup) -> float:
    """Return the inertia of drum and rotor about the drum's axis, with a tub at rest. [kg m^2]"""
    plant, context = setup.machine.plant, setup.plant_context
    index = setup.machine.state_layout.drum
    return float(plant.CalcMassMatrix(context)[index, index])


def _allowed(longest: float, period: float) -> str:
    """Return the longest step that divides the output period, in words."""
    pieces = int(np.ceil(period / longest))
    text = f"{1e3 * period / pieces:.4g} ms"
    if pieces < MOST_PIECES and 10**9 % pieces:
        # this step has no finite decimal expansion: name one that has
        pieces = next(more for more in itertools.count(pieces) if 10**9 % more == 0)
        text += f", such as {1e3 * period / pieces:g} ms"
    return text


def free_states(setup: Setup, states: StateMap) -> tuple[list[int], list[str]]:
    """Return the indices of the states that are not prescribed, and what each belongs to."""
    words, fixed = states.words(), [DRUM_ANGLE, DRUM_RATE]
    if setup.motor:
        words[DRUM_ANGLE] = words[DRUM_RATE] = DRIVE_WORDS
        # a sampled controller changes its state at its samples only; a continuous one holds nothing
        integral, demand = states.indices(CONTROL)
        fixed = [integral, demand] if setup.motor.controller.sample_time else [demand]
    free = [index for index in range(states.size) if index not in fixed]
    return free, [words[index] for index in free]


def _states(setup: Setup, kinds: StateKinds) -> FloatArray:
    """Return the states to look at (WIDTH, size): the rest pose, with speeds of each size.

    A drum with play in its bearing is pressed into the contact, which is the stiffest it meets. If
    something rolls or flows in the drum, the drum turns at its highest speed in every second one.
    """
    rest = initial_state(setup, _STANDSTILL)
    if setup.bearing:
        place = state_map(setup).indices(POSITION, kinds=[CARRIER])
        rest[place] += setup.bearing.into_contact(rest[place] - setup.rest_pose[3:])
    states, directions = np.tile(rest, (WIDTH, 1)), _directions(len(rest))
    if any(e.kind.on_drum for e in setup.elements.others.values()):
        highest = setup.parameters.profile.highest_speed
        profile = SpinProfile(time=_STANDSTILL.time, speed=(highest, highest))
        states[1::2] = initial_state(setup, profile)
    speeds, sponges = np.resize(SPEEDS, WIDTH), kinds.sponges.astype(int)
    states[:, kinds.velocities] += speeds[:, None] * directions[kinds.velocities]
    states[:, sponges] += DEFORMATION * directions[sponges]
    return states


@functools.cache
def _directions(size: int) -> FloatArray:
    """Return the same numbers at random between -1 and 1 for all machines of a size. (size,)"""
    return np.random.default_rng(0).uniform(-1.0, 1.0, size)
