"""Numbers of a machine for a web page: what its compiled functions work on, and what may change.

A number of the machine file may change in the page if the functions then pack what the engine
packs. That is tried at export, for each number alone and for all at once; what fails is left out,
with the reason.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from wm_drake.elements.cabinet import FEET_COUNT
from wm_drake.elements.mount import WRENCH_SIZE
from wm_drake.elements.sensor import POINT_SIZE
from wm_drake.engines.compiled.local_error import SUMS_SIZE
from wm_drake.engines.compiled.midpoint import TUBES
from wm_drake.engines.compiled.multistep import PAST_INPUTS, PAST_RATES
from wm_drake.engines.compiled.packing import initial_state
from wm_drake.engines.compiled.step_check import slowest_state
from wm_drake.errors import InputError
from wm_drake.export.arrangement import drum_parts, entries_of, joined, pair_parts, places_of
from wm_drake.export.kernel import HARMONICS_SIZE, UNBALANCE_SIZE
from wm_drake.export.page_contents import Contents
from wm_drake.export.page_plan import (
    BODY_SIZE,
    GAP_SIZE,
    SUMS,
    Constants,
    Counts,
    Places,
    Plan,
)
from wm_drake.export.tunable import TOLERANCE
from wm_drake.model.equilibrium import largest_rest
from wm_drake.parameters import Load
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.displacements import band_pass
from wm_drake.simulation.mounts import mount_names, sums_size


class MovedNumber(NamedTuple):
    """Value of a number that may enter the compiled functions, and the ends of its range. [SI]"""

    value: float
    low: float
    high: float

    @property
    def ends(self) -> tuple[float, float]:
        """Ends of its range. [SI]"""
        return self.low, self.high


Candidates = Mapping[str, MovedNumber]
"""Value, smallest and largest value of each number that might change, by key path. [SI]"""
MOST_UNBALANCES = 8
"""Largest number of point masses of a load in a page."""
ACCURACY = 1e-8
"""Largest relative deviation of a packed number, and of the rest pose, of a number that may
change."""
UNBALANCE_FIELDS = ("mass", "phase", "y", "radius")
"""Fields of a point mass in the order of its packed numbers."""
RESIDUAL = "imperfections.residual_imbalance."
"""Keys of the residual imbalance, which is the last point mass of every load."""
OTHERWISE = "enters the machine in a way that is not computed in a page"
"""Why most refused numbers cannot change."""
MULTIPLE = 128
"""What numbers of the machine file, and of entries, are rounded up to."""
SMALL = 1e-9
"""Deviation of a packed number that is zero."""
GASKET = "gasket"
"""Key under which the page takes the gasket out: 1 or 0."""


@dataclass(frozen=True)
class PageModel:
    """A machine, ready to be compiled for a page.

    Attributes:
        plan: What its functions are compiled for.
        numbers: Array of an instance before a run.
        places: Index in the array of each number that may change, by key path.
        of_load: By load: what it adds to the harmonics of the drum beside its point masses.
        refused: By key path: why a number cannot change.
        padding: Samples by which displacements are mirrored for the filter; 0: none is filtered.
    """

    plan: Any
    numbers: FloatArray
    constants: FloatArray
    places: dict[str, int]
    of_load: dict[str, FloatArray]
    refused: dict[str, str]
    pair_names: list[str]


class _Chosen:
    """Which numbers may change, and how the rows grow with them."""

    def __init__(self, contents: Contents, candidates: Candidates):
        self.contents, self.candidates = contents, candidates
        self.refused: dict[str, str] = {}
        self.slopes: dict[str, FloatArray] = {}
        self.bodies: dict[str, FloatArray] = {}
        for key, candidate in candidates.items():
            try:
                self._add(key, candidate)
            except InputError as error:
                self.refused[key] = error.problems[0].message
        if contents.setup.parameters.gasket is not None:
            without = contents.rows(contents.set_up({}, gasket=False))
            self.slopes[GASKET] = contents.start - without
        self._leave_out_mixed()

    def _add(self, key: str, candidate: MovedNumber) -> None:
        table, name, *_ = [*key.split("."), ""]
        if key.startswith(RESIDUAL):
            return
        if table == "bodies":
            constants = self.contents.body_constants(name)
            if constants is None or ".inertia" in key:
                self.refused[key] = OTHERWISE
            else:
                self.bodies[name] = constants
            return
        slopes = self.contents.slopes(key, candidate.value, candidate.ends)
        if slopes is None:
            self.refused[key] = OTHERWISE
        elif not np.any(slopes) and not key.startswith("springs"):
            self.refused[key] = "has no influence on what this page shows"
        else:
            self.slopes[key] = slopes

    def value_of(self, key: str) -> float:
        """Return the value of a number as exported. [SI]"""
        return 1.0 if key == GASKET else self.candidates[key].value

    def _leave_out_mixed(self) -> None:
        """Leave out numbers whose effects do not add up when all change at once."""
        moved = {
            key: candidate.value + 0.3 * (candidate.high - candidate.value)
            for key, candidate in self.candidates.items()
            if key in self.slopes
        }
        contents = self.contents
        expected = contents.start
        for key, value in moved.items():
            expected = expected + self.slopes[key] * (value - self.candidates[key].value)
        actual = contents.rows(contents.set_up(moved))
        size = np.abs(actual) + np.abs(contents.start)
        wrong = np.abs(actual - expected) > 10.0 * TOLERANCE * size
        for key in moved:
            if np.any(wrong & (self.slopes[key] != 0.0)):
                del self.slopes[key]
                self.refused[key] = (
                    "changes together with others in a way that is not computed here"
                )


def page_model(contents: Contents, candidates: Candidates) -> PageModel:
    """Return a machine, ready to be compiled for a page.

    Args:
        candidates: Value, smallest and largest value of each number that might change. [SI]

    Raises:
        InputError: the machine cannot be set up, or the compiled engine does not represent it.
    """
    chosen = _Chosen(contents, candidates)
    of, constants = joined(Constants, _constants(contents, chosen))
    count = _counts(contents, chosen)
    at = _places(contents, count)
    plan = _plan(contents, at, of, count)
    numbers, places = _numbers(contents, chosen, plan)
    loads = contents.machine.parameters.loads
    return PageModel(
        plan,
        numbers,
        constants,
        places,
        {name: contents.of_load(load) for name, load in loads.items()},
        chosen.refused,
        contents.scene.pair_names(),
    )


def _constants(contents: Contents, chosen: _Chosen) -> dict[str, Any]:
    """Return the parts of the constants."""
    rows = [np.flatnonzero(slopes) for slopes in chosen.slopes.values()]
    slopes = [of[at] for of, at in zip(chosen.slopes.values(), rows, strict=True)]
    sections, settled = band_pass(contents.period, contents.band)
    pairs, distances = pair_parts(contents.scene, contents.setup.rest_pose)
    return {
        "packed": contents.packed_rows,
        **drum_parts(contents.bodies),
        "initial": initial_state(contents.setup, contents.profile),
        "slowest": slowest_state(contents.setup, contents.layout),
        "sections": sections,
        "settled": settled,
        "pairs": [*pairs.ravel(), *distances],
        "start": _padded([chosen.value_of(key) for key in chosen.slopes], 1),
        "entries": _padded(entries_of(zip(rows, slopes, strict=True)), 3),
        "bodies": [*chosen.bodies.values()],
    }


def _rounded(count: int) -> int:
    """Return a number rounded up, so that machines that differ in numbers have the same plan."""
    return max(1, math.ceil(count / MULTIPLE)) * MULTIPLE


def _padded(rows: Any, width: int) -> FloatArray:
    """Return rows with rows of zeros behind them, which change nothing, to a `_rounded` number."""
    padded = np.zeros((_rounded(len(rows)), width))
    padded[: len(rows)] = np.reshape(rows, (-1, width))
    return padded


def _counts(contents: Contents, chosen: _Chosen) -> Any:
    setup = contents.setup
    loads = setup.parameters.loads.values()
    return Counts(
        packed=len(contents.start),
        numbers=len(contents.packed),
        parameters=_rounded(len(chosen.slopes)),
        entries=_rounded(sum(map(np.count_nonzero, chosen.slopes.values()))),
        bodies=len(chosen.bodies),
        unbalances=1 + max([MOST_UNBALANCES, *(len(load.unbalances) for load in loads)]),
        springs=len(setup.springs),
        points=len(setup.measured_points) + 2 * len(contents.depths),
        sensors=len(setup.sensors),
        mounts=len(mount_names(setup.parameters)),
        feet=FEET_COUNT if setup.parameters.cabinet else 0,
        pairs=len(contents.scene.pair_names()),
    )


def _places(contents: Contents, count: Any) -> Any:
    begins = contents.layout.states.begins
    dampers = len(contents.layout.tubes)
    sizes = {
        "time": 1,
        "unbalances": UNBALANCE_SIZE * count.unbalances,
        "of_load": HARMONICS_SIZE,
        "speed": 1,
        "packed": count.packed,
        "total": 2 * SUMS,
        "state": begins.size,
        "rest": 6,
        "trial": begins.size,
        "wrenches": WRENCH_SIZE * (count.mounts + 1),
        "slopes": TUBES * TUBES,
        "step": TUBES,
        "rate": begins.size,
        "inputs": max(begins.inputs, 1),
        "stage": begins.size,
        "sum": max(begins.size, TUBES),
        "past_rates": PAST_RATES * begins.size,
        "past_inputs": PAST_INPUTS * max(begins.inputs, 1),
        "errors": SUMS_SIZE,
        "length": 1,
        "jacobian": (2 * TUBES) ** 2,
        "relaxation": TUBES**2 * dampers,
        "extremes": count.points + 7,
        "sums": sums_size(count.mounts),
        "answer": GAP_SIZE + count.mounts,
        "parameters": count.parameters,
        "bodies": BODY_SIZE * count.bodies,
    }
    return places_of(Places, sizes)


def _plan(contents: Contents, at: Any, of: Any, count: Any) -> Any:
    setup, layout = contents.setup, contents.layout
    others = [element.kind.acts_at_rest for element in setup.elements.others.values()]
    resting = layout.mounts._replace(others=layout.mounts.others if any(others) else None)
    sags = any(spring.is_given for spring in setup.springs.values())
    settles = not setup.telescopes and not setup.bearing
    return Plan(
        at,
        of,
        count,
        layout.elements,
        resting,
        tuple(contents.spring_kinds()),
        layout.gasket,
        bool(layout.tubes) and contents.stepping.integrator == "midpoint",
        largest_rest(sags=sags),
        contents.scene.reach,
        settles and (not others or all(others) == any(others)),
    )


def _numbers(contents: Contents, chosen: _Chosen, plan: Any) -> tuple[FloatArray, dict[str, int]]:
    """Return the array of an instance before a run, and the place of each number in it."""
    at, numbers, places = plan.at, np.zeros(plan.at.size), dict[str, int]()
    for k, key in enumerate(chosen.slopes):
        places[key] = at.parameters + k
        numbers[places[key]] = chosen.value_of(key)
    for k, (name, constants) in enumerate(chosen.bodies.items()):
        begin = at.bodies + BODY_SIZE * k
        numbers[begin : begin + BODY_SIZE] = constants[2 : 2 + BODY_SIZE]
        keys = ["mass", *(f"centre_of_mass.{i}" for i in range(3))]
        places |= {f"bodies.{name}.{key}": begin + i for i, key in enumerate(keys)}
    residual = contents.setup.parameters.imperfections.residual_imbalance
    begin = at.of_load - UNBALANCE_SIZE
    for k, field in enumerate(UNBALANCE_FIELDS):
        numbers[begin + k] = getattr(residual, field)
        places[f"{RESIDUAL}{field}"] = begin + k
    numbers[at.speed] = contents.profile.speed[0]
    return numbers, places


def without_wrong(
    model: PageModel, set_up: Callable[..., float], contents: Contents, candidates: Candidates
) -> PageModel:
    """Return the model without the numbers for which its functions pack something else.

    Args:
        set_up: The function `wm_set_up`, for this process.
        contents, candidates: Those that the model was made of.
    """
    places, refused = dict(model.places), dict(model.refused)
    for key in model.places:
        if key not in candidates:
            continue
        try:
            right = all(
                is_packed_alike(model, set_up, contents, {key: end}) for end in candidates[key].ends
            )
            reason = OTHERWISE
        except InputError as error:
            right, reason = False, error.problems[0].message
        if not right:
            del places[key]
            refused[key] = reason
    return replace(model, places=places, refused=refused)


def is_packed_alike(
    model: PageModel, set_up: Callable[..., float], contents: Contents, values: Mapping[str, float]
) -> bool:
    """Return whether the functions of a page pack what the engine packs.

    Args:
        values: Numbers that differ from those of the machine, by key path. [SI]
    """
    at, count = model.plan.at, model.plan.count
    v = model.numbers.copy()
    for key, value in values.items():
        v[model.places[key]] = value
    if set_up(v, model.constants) != 0.0:
        return False
    setup = contents.set_up(values, load=Load(unbalances=()))
    expected = contents.full_rows(setup)
    packed = v[at.packed : at.packed + count.packed]
    compared = slice(count.numbers + count.springs + POINT_SIZE * (count.sensors + 3))
    with np.errstate(invalid="ignore"):
        near = np.abs(packed - expected) <= ACCURACY * np.abs(expected) + SMALL
    equal = (packed == expected) | near
    rest = v[at.rest : at.rest + 6] - setup.rest_pose
    state = initial_state(setup, contents.profile)
    begins = v[at.state : at.state + len(state)] - state
    return bool(
        np.all(equal[compared]) and max(np.abs(rest).max(), np.abs(begins).max()) < ACCURACY
    )
