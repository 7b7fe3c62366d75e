"""Cases -> work items: packed numbers, in batches that can run side by side."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.framework import Context

from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.mechanics import DRUM_RATE
from wm_drake.engines.compiled.packing import DrawnBodies, Layout, initial_state, pack_elements
from wm_drake.engines.compiled.stepping import Stepping, choose_stepping
from wm_drake.engines.compiled.water import with_water
from wm_drake.engines.memory import check_size
from wm_drake.errors import InputError, Problem, input_error
from wm_drake.model.machine import Machine, Setup
from wm_drake.parameters import Load, MachineParameters, SpinProfile
from wm_drake.parameters.machine import Integrator
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.convergence import Attempt, Refinement

KEPT_BODIES, KEPT_NUMBERS = 256, 64
"""How many sets of bodies with a load, and of other numbers, are cached.

Runs of one machine or load follow each other, so that a few are enough; each takes memory.
"""


@dataclass(frozen=True)
class PackedParameters:
    """The packed numbers of a machine, without bodies and load.

    Attributes:
        setup: The setup that was packed, without load; its Context has been used again since.
        elements, layout: From `pack_elements`.
        points: Measured points, from `outputs.measured_points`, one after the other.
        rest: State of rest.
        stepping: How to integrate runs with these numbers.
        period: Time between samples. [s]
    """

    setup: Setup
    elements: FloatArray
    layout: Layout
    points: FloatArray
    rest: FloatArray
    stepping: Stepping
    period: float


@dataclass(frozen=True)
class WorkItem:
    """A packed case: all that its run needs.

    Attributes:
        number: Number of the case, in the given order.
        case: The case.
        numbers: Shared by all cases with these parameters.
        packed, layout: All packed numbers and their layout, as from `pack_run`.
        begin: State at the start of the run.
        before: The run that this one repeats with a shorter step; None for the first one.
        halvings: How often its step is halved.
    """

    number: int
    case: Case
    numbers: PackedParameters
    packed: FloatArray
    layout: Layout
    begin: FloatArray
    before: Attempt | None = None
    halvings: int = 0

    @property
    def key(self) -> "BatchKey":
        """Return what runs that are run side by side with it have in common."""
        numbers = self.numbers
        return BatchKey(self.case.profile, self.layout, numbers.stepping, numbers.period)

    def repeated(self, before: Attempt, finer: Refinement) -> "WorkItem":
        """Return the same run with a shorter step, and with more samples if it needs them."""
        stepping = self.numbers.stepping.halved(finer.step)
        period = self.numbers.period / 2**finer.period
        numbers = replace(self.numbers, stepping=stepping, period=period)
        return replace(self, numbers=numbers, before=before, halvings=self.halvings + finer.step)


@dataclass(frozen=True)
class BatchKey:
    """What runs must have in common to run side by side."""

    profile: SpinProfile
    layout: Layout
    stepping: Stepping
    period: float


def side_by_side(items: Iterable[WorkItem]) -> Iterator[tuple[BatchKey, list[WorkItem]]]:
    """Yield batches of up to `WIDTH` work items that can run side by side, each when it is full.

    Items are in the given order as far as possible.
    """
    waiting: dict[BatchKey, list[WorkItem]] = {}
    for item in items:
        key = item.key
        work_items = waiting.setdefault(key, [])
        work_items.append(item)
        if len(work_items) == WIDTH:
            yield key, waiting.pop(key)
    yield from waiting.items()


class _Identity:
    """Key of a cache that compares parameters by identity and keeps them alive.

    To compare them by value would take longer than to pack them.
    """

    __slots__ = ("parameters",)

    def __init__(self, parameters: MachineParameters) -> None:
        self.parameters = parameters

    def __hash__(self) -> int:
        return object.__hash__(self.parameters)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Identity) and other.parameters is self.parameters


class Preparation:
    """Packs cases of one machine.

    To set a machine up takes a good part of the time of a run, so its results are cached.
    """

    def __init__(
        self, machine: Machine, step: float, integrator: Integrator, at_once: float = 1.0
    ) -> None:
        """Prepare for a built machine.

        Args:
            machine: The machine.
            step: Largest step. [s]
            integrator: Integrator.
            at_once: How many times the memory of a batch is needed at once.
        """
        self.machine, self.step, self.integrator = machine, step, integrator
        self.at_once = at_once
        self.sensors = list(machine.parameters.sensors)
        self._context: Context | None = None
        self._drawn: list[tuple[object, DrawnBodies]] = []
        self._known_bodies: dict[tuple[Load, ...], FloatArray] = {}
        self._have_place: set[tuple[SpinProfile, float]] = set()
        self._known_numbers: dict[tuple[_Identity, bool, SpinProfile], PackedParameters] = {}

    def batches(self, cases: Iterable[Case]) -> Iterator[tuple[BatchKey, list[WorkItem]]]:
        """Return the batches of the work items of cases; see `side_by_side`.

        Raises:
            InputError: a case is wrong; the message names it.
        """
        return side_by_side(self._work_item(number, case) for number, case in enumerate(cases))

    def _work_item(self, number: int, case: Case) -> WorkItem:
        try:
            bodies = self._bodies(case.parameters or self.machine.parameters, case.load)
            numbers = self._numbers(case)
        except InputError as error:
            raise InputError(
                Problem(f"case {number} '{case.name}'", p.key, p.message) for p in error.problems
            ) from None
        begin = np.concatenate([numbers.rest, np.ones(len(case.load.wet))])
        begin[DRUM_RATE] = case.profile.speed[0]
        packed = np.concatenate([bodies, numbers.elements])
        packed, layout = with_water(packed, numbers.layout, case.load, self._drawn[0][1])
        return WorkItem(number, case, numbers, packed, layout, begin)

    def _bodies(self, parameters: MachineParameters, load: Load | None) -> FloatArray:
        """Return the packed bodies, which cases with the same bodies, drive and load share."""
        rotor, masses = parameters.drive, parameters.masses_on_drum
        drawn = parameters.bodies, parameters.frames, rotor, masses
        if not self._drawn or self._drawn[0][0] != drawn:
            machine = self.machine.drawn
            context = machine.bodies(None, parameters)
            bodies = DrawnBodies(machine.plant, context, parameters.drive.joint)
            self._drawn[:] = [(drawn, bodies)]
            self._known_bodies.clear()
        imbalance = parameters.imperfections.residual_imbalance
        loads = () if load is None else (load, Load(unbalances=(imbalance,)))
        if loads not in self._known_bodies:
            if len(self._known_bodies) >= KEPT_BODIES:
                del self._known_bodies[next(iter(self._known_bodies))]
            self._known_bodies[loads] = self._drawn[0][1].packed(*loads)
        return self._known_bodies[loads]

    def _numbers(self, case: Case) -> PackedParameters:
        """Return all other packed numbers of a case, which do not depend on its load."""
        key = (_Identity(case.parameters or self.machine.parameters), case.gasket, case.profile)
        if key not in self._known_numbers:
            if len(self._known_numbers) >= KEPT_NUMBERS:
                del self._known_numbers[next(iter(self._known_numbers))]
            longest = (case.parameters or self.machine.parameters).output_period
            period = case.profile.sample_period(longest)
            if (case.profile, period) not in self._have_place:  # reads files of the system
                check_size(case.profile, self.step, period, self.at_once)
                self._have_place.add((case.profile, period))
            empty = self._bodies(case.parameters or self.machine.parameters, None)
            setup = self._set_up(case)
            elements, layout = pack_elements(setup)
            stepping = choose_stepping(
                setup,
                np.concatenate([empty, elements]),
                layout,
                case.profile,
                self.step,
                self.integrator,
            )
            points, rest = setup.measured_points.ravel(), initial_state(setup, case.profile)
            self._known_numbers[key] = PackedParameters(
                setup, elements, layout, points, rest, stepping, period
            )
        return self._known_numbers[key]

    def _set_up(self, case: Case) -> Setup:
        setup = self.machine.set_up(
            parameters=case.parameters, gasket=case.gasket, context=self._context, systems=False
        )
        if list(setup.sensors) != self.sensors:
            raise input_error(
                f"has sensors {', '.join(setup.sensors)}; the machine has {', '.join(self.sensors)}"
            )
        self._context = setup.context
        return setup
