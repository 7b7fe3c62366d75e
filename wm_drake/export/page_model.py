"""Numbers of a machine for a web page: what its compiled functions work on, and what may change.

A number of the machine file may change in the page if the functions then pack what the engine
packs. That is tried at export, for each number alone and for all at once; what fails is left out,
with the reason.
"""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wm_drake.elements.cabinet import FEET_SIZE, FOOT, PADS
from wm_drake.elements.feet import packed_feet
from wm_drake.elements.friction_damper import FRICTION_DAMPER
from wm_drake.elements.mount import WRENCH_SIZE
from wm_drake.elements.sensor import MEASURED_POINT, POINT_SIZE
from wm_drake.elements.spring import SPRING
from wm_drake.engines.compiled.cabinet import FEET_BEGIN
from wm_drake.engines.compiled.mechanics import BODIES
from wm_drake.engines.compiled.midpoint import TUBES
from wm_drake.engines.compiled.multistep import PAST_INPUTS, PAST_RATES
from wm_drake.engines.compiled.packing import DrawnBodies, drum_joint, initial_state, pack
from wm_drake.engines.compiled.stepping import Stepping, choose_stepping
from wm_drake.errors import InputError
from wm_drake.export.kernel import HARMONICS_BEGIN, HARMONICS_SIZE, UNBALANCE_SIZE
from wm_drake.export.page_kernel import (
    BODY_SIZE,
    FREE_LENGTH,
    GAP_SIZE,
    GIVEN,
    PUSHES,
    SOLVED,
    SUMS,
    Constants,
    Counts,
    Places,
    Plan,
)
from wm_drake.export.tunable import TOLERANCE
from wm_drake.model.bodies import drawn_frame
from wm_drake.model.equilibrium import largest_rest
from wm_drake.model.machine import Machine, Setup
from wm_drake.model.scene import Scene
from wm_drake.model.state_layout import CARRIER
from wm_drake.parameters import Load, MachineParameters, SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.band import pass_band
from wm_drake.simulation.displacements import band_pass
from wm_drake.simulation.mounts import mount_names, sums_size
from wm_drake.simulation.steps import checked_integrator, checked_step

Candidates = Mapping[str, tuple[float, float, float]]
"""Value, smallest and largest value of each number that might change, by key path. [SI]"""
Move = Callable[[Mapping[str, float]], MachineParameters]
"""Function that returns the machine with other values of some numbers. [SI]"""

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
SMALL = 1e-9
"""Deviation of a packed number that is zero."""
NUMBERS = ctypes.POINTER(ctypes.c_double)
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
    stepping: Stepping
    pair_names: list[str]


class Contents:
    """The parts of the model of a page, one after the other."""

    def __init__(
        self, machine: Machine, move: Move, profile: SpinProfile, depths: Sequence[float]
    ) -> None:
        """Set the machine up without load.

        Args:
            move: Function that returns the machine with other values of some numbers.
            profile: Spin profile, which gives the step, the samples and the filter.
            depths: Where along the drum axis orbits are drawn. [m]
        """
        self.machine, self.move, self.profile, self.depths = machine, move, profile, depths
        self.context = machine.diagram.CreateDefaultContext()
        self.setup = self.set_up({})
        drawn = machine.set_up_bodies(None, machine.parameters)
        self.drawn = machine.plant.GetMyContextFromRoot(drawn)
        self.packed, self.layout = pack(self.setup)
        parameters = self.setup.parameters
        self.stepping = choose_stepping(
            self.setup, self.packed, self.layout, profile, checked_step(parameters, None),
            checked_integrator(parameters, None)
        )  # fmt: skip
        self.period = profile.sample_period(parameters.output_period)
        self.band = pass_band(profile, self.period)
        self.scene = Scene(parameters)
        self.derived = self._derived()
        self.start = self.rows(self.setup)

    def set_up(
        self, values: Mapping[str, float], *, gasket: bool = True, load: Load | None = None
    ) -> Setup:
        """Return the machine with other values of some numbers. [SI]

        Without a load it has no residual imbalance either.
        """
        parameters = self.move(values) if values else self.machine.parameters
        return self.machine.set_up(load, context=self.context, parameters=parameters, gasket=gasket)

    def rows(self, setup: Setup) -> FloatArray:
        """Return `full_rows` without what the functions compute from the others."""
        rows = self.full_rows(setup)
        rows[self.derived] = 0.0
        return rows

    def full_rows(self, setup: Setup) -> FloatArray:
        """Return packed numbers, free length of each spring, measured points, numbers of feet."""
        parameters = setup.parameters
        types = (parameters.spring_types[s.type] for s in parameters.springs.values())
        lengths = [t.free_length or 0.0 for t in types]
        orbits = [
            MEASURED_POINT.pack(p_ToM_T=(0.0, y, 0.0), direction_W=axis, at_rest=0.0)
            for y in self.depths
            for axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
        ]
        points = setup.measured_points.ravel(), *orbits
        rows: list[FloatArray] = [pack(setup)[0], np.array(lengths), *points]
        if setup.cabinet:
            rows.append(packed_feet(setup.cabinet.cabinet, parameters.gravity))
        return np.concatenate(rows)

    def _derived(self) -> np.ndarray:
        """Return the rows that the functions compute from others."""
        parameters, mounts = self.setup.parameters, self.layout
        rows: list[int] = []
        for at, kind in zip(mounts.springs, self.spring_kinds(), strict=True):
            names = ["rest_length", "taut_from"] + ["preload"] * (kind % PUSHES != GIVEN)
            rows += [at + SPRING.offsets[name] for name in names]
        for at in mounts.dampers:
            rows += range(
                at + FRICTION_DAMPER.offsets["axis"], at + FRICTION_DAMPER.offsets["axis"] + 3
            )
        if mounts.cabinet >= 0:
            first = mounts.cabinet + FEET_BEGIN
            sags = range(PADS.fixed_size + FOOT.offsets["at_rest"], FEET_SIZE, FOOT.fixed_size)
            rows += [first + at for at in (PADS.offsets["damping_growth"], *sags)]
        first = len(self.packed) + len(parameters.springs)
        count = len(self.setup.measured_points) + 2 * len(self.depths)
        rows += [first + POINT_SIZE * (k + 1) - 1 for k in range(count)]
        return np.array(rows, dtype=int)

    def spring_kinds(self) -> list[int]:
        """Return what gives the preload of each spring, and whether it pushes."""
        parameters, kinds = self.setup.parameters, []
        for name, spring in parameters.springs.items():
            free = parameters.spring_types[spring.type].free_length
            kind = (
                FREE_LENGTH if free is not None else GIVEN if spring.preload is not None else SOLVED
            )
            kinds.append(kind + PUSHES * self.setup.springs[name].pushes)
        return kinds

    def slopes(self, key: str, value: float, ends: Sequence[float]) -> FloatArray | None:
        """Return how all rows grow with a number; None if one does not by a straight line."""
        low, high = (self.rows(self.set_up({key: end})) - self.start for end in ends)
        slopes = (high - low) / (ends[1] - ends[0])
        straight = slopes * (ends[0] - value)
        size = np.abs(self.start) + np.abs(low) + np.abs(high)
        return None if np.any(np.abs(straight - low) > TOLERANCE * size) else slopes

    def body_constants(self, name: str) -> FloatArray | None:
        """Return the constants of a body that may change; None if it is in neither group."""
        plant, context = self.machine.plant, self.drawn
        tub, drum = plant.GetBodyByName("tub"), self._drum_joint.child_body()
        body = plant.GetBodyByName(name)
        groups = [{b.index() for b in plant.GetBodiesWeldedTo(of)} for of in (tub, drum)]
        if plant.HasBodyNamed(CARRIER) or not any(body.index() in group for group in groups):
            return None
        X_TB = plant.CalcRelativeTransform(context, drawn_frame(plant, tub), body.body_frame())
        inertia = body.CalcSpatialInertiaInBodyFrame(context)
        central = inertia.Shift(inertia.get_com()).ReExpress(X_TB.rotation().inverse())
        matrix = central.CalcRotationalInertia().CopyToFullMatrix3()
        override = self.setup.parameters.bodies.get(name)
        grows, origin = override is None or override.inertia is None, BODIES.offsets["origin"]
        return np.array([
            body.index() in groups[1], grows, inertia.get_mass(), *inertia.get_com(),
            *X_TB.rotation().matrix().ravel(),
            *(self.packed[origin : origin + 3] - X_TB.translation()),
            *matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
        ])  # fmt: skip

    @property
    def _drum_joint(self) -> Any:
        return drum_joint(self.machine.plant, self.setup.parameters.drive.joint)

    def of_load(self, load: Load) -> FloatArray:
        """Return what a load adds to the harmonics of the drum beside its point masses."""
        joint = self.setup.parameters.drive.joint
        bodies = DrawnBodies(self.machine.plant, self.drawn, joint)
        points = bodies.packed(Load(unbalances=load.unbalances))
        whole = bodies.packed(load)
        return (whole - points)[HARMONICS_BEGIN : HARMONICS_BEGIN + HARMONICS_SIZE]


class _Chosen:
    """Which numbers may change, and how the rows grow with them."""

    def __init__(self, contents: Contents, candidates: Candidates):
        self.contents, self.candidates = contents, candidates
        self.refused: dict[str, str] = {}
        self.slopes: dict[str, FloatArray] = {}
        self.bodies: dict[str, FloatArray] = {}
        for key, (value, *ends) in candidates.items():
            try:
                self._add(key, value, ends)
            except InputError as error:
                self.refused[key] = error.problems[0].message
        if contents.setup.parameters.gasket is not None:
            without = contents.rows(contents.set_up({}, gasket=False))
            self.slopes[GASKET] = contents.start - without
        self._leave_out_mixed()

    def _add(self, key: str, value: float, ends: Sequence[float]) -> None:
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
        slopes = self.contents.slopes(key, value, ends)
        if slopes is None:
            self.refused[key] = OTHERWISE
        elif not np.any(slopes) and not key.startswith("springs"):
            self.refused[key] = "has no influence on what this page shows"
        else:
            self.slopes[key] = slopes

    def value_of(self, key: str) -> float:
        """Return the value of a number as exported. [SI]"""
        return 1.0 if key == GASKET else self.candidates[key][0]

    def _leave_out_mixed(self) -> None:
        """Leave out numbers whose effects do not add up when all change at once."""
        moved = {
            key: value + 0.3 * (high - value)
            for key, (value, _, high) in self.candidates.items()
            if key in self.slopes
        }
        contents = self.contents
        expected = contents.start
        for key, value in moved.items():
            expected = expected + self.slopes[key] * (value - self.candidates[key][0])
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
    parts = _constants(contents, chosen)
    sizes = [len(part) for part in parts.values()]
    of = Constants(**dict(zip(parts, _begins(sizes), strict=True)), size=sum(sizes))
    count = _counts(contents, chosen)
    at = _places(contents, count)
    plan = _plan(contents, at, of, count)
    numbers, places = _numbers(contents, chosen, plan)
    loads = contents.machine.parameters.loads
    return PageModel(
        plan,
        numbers,
        np.concatenate(list(parts.values())),
        places,
        {name: contents.of_load(load) for name, load in loads.items()},
        chosen.refused,
        contents.stepping,
        contents.scene.pair_names(),
    )


def _begins(sizes: Sequence[int]) -> list[int]:
    return [0, *np.cumsum(sizes)[:-1].tolist()]


def _constants(contents: Contents, chosen: _Chosen) -> dict[str, FloatArray]:
    """Return the parts of the constants, in the order of `Constants`."""
    harmonics, rotation, origin = DrawnBodies(
        contents.machine.plant, contents.drawn, contents.setup.parameters.drive.joint
    ).of_point_masses
    entries = [
        (row, number, slopes[row])
        for number, slopes in enumerate(chosen.slopes.values())
        for row in np.flatnonzero(slopes)
    ]
    sections, settled = band_pass(contents.period, contents.band)
    pairs = contents.scene.separations(contents.setup.rest_pose)
    return {
        "packed": contents.full_rows(contents.setup),
        "start": np.array([chosen.value_of(key) for key in chosen.slopes]),
        "entries": np.array(entries, dtype=float).ravel(),
        "harmonics": harmonics.ravel(),
        "drum": np.concatenate([rotation.ravel(), origin]),
        "bodies": np.array(list(chosen.bodies.values())).ravel(),
        "initial": initial_state(contents.setup, contents.profile),
        "relaxation": contents.stepping.relaxation,
        "sections": sections,
        "settled": settled,
        "pairs": np.concatenate(
            [
                [],
                *(
                    np.concatenate([m.numbers, f.numbers, [m.is_round, f.is_round], away])
                    for m, f, away, _ in pairs
                ),
                [distance for *_, distance in pairs],
            ]
        ),
    }


def _counts(contents: Contents, chosen: _Chosen) -> Any:
    setup = contents.setup
    loads = setup.parameters.loads.values()
    return Counts(
        packed=len(contents.start),
        numbers=len(contents.packed),
        parameters=len(chosen.slopes),
        entries=sum(int(np.count_nonzero(slopes)) for slopes in chosen.slopes.values()),
        bodies=len(chosen.bodies),
        unbalances=1 + max([MOST_UNBALANCES, *(len(load.unbalances) for load in loads)]),
        springs=len(setup.springs),
        points=len(setup.measured_points) + 2 * len(contents.depths),
        sensors=len(setup.sensors),
        mounts=len(mount_names(setup.parameters)),
        pairs=len(contents.scene.pair_names()),
    )


def _places(contents: Contents, count: Any) -> Any:
    begins = contents.layout.states.begins
    solved = max(6, count.springs)
    sizes = {
        "time": 1,
        "parameters": count.parameters,
        "bodies": BODY_SIZE * count.bodies,
        "unbalances": UNBALANCE_SIZE * count.unbalances,
        "of_load": HARMONICS_SIZE,
        "speed": 1,
        "packed": count.packed,
        "total": 2 * SUMS,
        "state": begins.size,
        "rest": 6,
        "trial": begins.size,
        "wrenches": WRENCH_SIZE * count.mounts,
        "slopes": solved * solved,
        "step": solved,
        "rate": begins.size,
        "inputs": max(begins.inputs, 1),
        "stage": begins.size,
        "sum": max(begins.size, TUBES),
        "past_rates": PAST_RATES * begins.size,
        "past_inputs": PAST_INPUTS * max(begins.inputs, 1),
        "extremes": count.points + 7,
        "sums": sums_size(count.mounts),
        "answer": GAP_SIZE + count.mounts,
    }
    return Places(
        **dict(zip(sizes, _begins(list(sizes.values())), strict=True)), size=sum(sizes.values())
    )


def _plan(contents: Contents, at: Any, of: Any, count: Any) -> Any:
    setup, layout = contents.setup, contents.layout
    others = [element.kind.acts_at_rest for element in setup.elements.others.values()]
    resting = layout.mounts._replace(others=layout.mounts.others if any(others) else None)
    solved = sum(kind % PUSHES == SOLVED for kind in contents.spring_kinds())
    sags = any(spring.is_given for spring in setup.springs.values())
    settles = not setup.telescopes and not setup.bearing and solved <= WRENCH_SIZE
    return Plan(
        at,
        of,
        count,
        layout.elements,
        resting,
        tuple(contents.spring_kinds()),
        layout.gasket,
        contents.stepping.integrator,
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
    model: PageModel, set_up: Any, contents: Contents, candidates: Candidates
) -> PageModel:
    """Return the model without the numbers for which its functions pack something else.

    Args:
        set_up: Compiled function of this name, for this computer.
        contents, candidates: Those that the model was made of.
    """
    places, refused = dict(model.places), dict(model.refused)
    for key in model.places:
        if key not in candidates:
            continue
        try:
            right = all(
                is_packed_alike(model, set_up, contents, {key: end}) for end in candidates[key][1:]
            )
            reason = OTHERWISE
        except InputError as error:
            right, reason = False, error.problems[0].message
        if not right:
            del places[key]
            refused[key] = reason
    return replace(model, places=places, refused=refused)


def is_packed_alike(
    model: PageModel, set_up: Any, contents: Contents, values: Mapping[str, float]
) -> bool:
    """Return whether the functions of a page pack what the engine packs.

    Args:
        values: Numbers that differ from those of the machine, by key path. [SI]
    """
    at, count = model.plan.at, model.plan.count
    v = model.numbers.copy()
    for key, value in values.items():
        v[model.places[key]] = value
    if set_up(*(array.ctypes.data_as(NUMBERS) for array in (v, model.constants))) != 0.0:
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
