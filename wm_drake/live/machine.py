"""An open machine: built once, moved many times; its numbers move."""

import threading
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from wm_drake.batch.work_items import Preparation
from wm_drake.elements.kind import element_kind
from wm_drake.engines.compiled.step_check import fastest_motion
from wm_drake.engines.compiled.stepping import LONGEST_STEP
from wm_drake.errors import InputError, Problem, input_error, nearest_names
from wm_drake.live.parts import CALCULATION, PART_ORDER, places_of
from wm_drake.live.sliders import Slider, sliders_of
from wm_drake.live.state import DESCRIBED, PageState
from wm_drake.model.bodies import with_sdf_values
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine, Setup
from wm_drake.model.replay import DENSITY
from wm_drake.model.same_elements import check_same_elements
from wm_drake.model.scene import Outline, Scene
from wm_drake.model.sdf_names import sdf_names
from wm_drake.parameters import (
    MachineParameters,
    measured_amplitudes,
    with_values,
)
from wm_drake.parameters.elements import CurveTable
from wm_drake.parameters.variation import number_at
from wm_drake.simulation.cases import Case, case_of
from wm_drake.simulation.mounts import mount_names
from wm_drake.simulation.steps import checked_integrator, checked_step

LONGEST_RUN = 300.0
"""Longest spin profile that a page may run. [s]"""

MOST_STEPS = 1_100_000
"""Largest number of steps of a run of a page: some seconds, with bodies between tub and housing."""

SLIDER_STEPS = 300_000
"""Largest number of steps of a run that is repeated with shorter ones: about a second."""

MOST_BUILT = 4
"""Largest number of machines that are built for one file."""

_Measured: TypeAlias = dict[tuple[str, str], list[dict[str, object]]]
"""Source and amplitudes of measurements, by load and whether the gasket is in (yes, no)."""

HALVINGS = 5
"""How often the way to the end of a slider is halved until the machine allows the end."""


@dataclass(frozen=True, eq=False)
class OpenMachine:
    """A machine that pages move.

    Attributes:
        parameters: The machine as its file has it.
        machine: A built machine with the same elements.
        scene: Its shapes. One thread at a time may use it.
        ranges: Ends of sliders by key path, in place of the usual ones. [SI]
        lock: Held while `machine` or `scene` are used.
    """

    parameters: MachineParameters
    machine: Machine
    scene: Scene
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)
    _preparations: dict[tuple[int, float, str], Preparation] = field(default_factory=dict)
    _others: list[Machine] = field(default_factory=list)
    _sliders: dict[str, Slider] = field(default_factory=dict)
    _measured: list[_Measured] = field(default_factory=list)

    @property
    def sliders(self) -> Mapping[str, Slider]:
        """Return a slider for each number that can be moved, by key path; also for the SDF's."""
        if not self._sliders:
            plant, parts = self.machine.drawn.plant, ("mass", "centre_of_mass")
            names = sdf_names(plant)
            keys = [f"bodies.{link}.{part}" for link in names.links for part in parts]
            keys += [f"frames.{name}" for name in names.movable_frames]
            sliders = sliders_of(with_sdf_values(plant, self.parameters, keys))
            for key in self.ranges.keys() & sliders.keys():
                low, high = map(sliders[key].unit.from_si, self.ranges[key])
                sliders[key] = replace(sliders[key], low=low, high=high)
            possible = [self._possible(slider) for slider in sliders.values()]
            possible.sort(key=lambda slider: bool(slider.needs))
            self._sliders.update({slider.key: slider for slider in possible})
        return self._sliders

    def _possible(self, slider: Slider) -> Slider:
        """Return a slider of which both ends are allowed while all other numbers stay."""
        value = slider.unit.from_si(float(slider.number.nominal or 0.0))
        low, _ = self._possible_end(slider, value, slider.low)
        high, needs = self._possible_end(slider, value, slider.high)
        return replace(slider, low=low, high=high, needs="" if low < high else needs)

    def _possible_end(self, slider: Slider, value: float, end: float) -> tuple[float, str]:
        """Return the farthest allowed end on the way to one, which is halved, and what is wrong."""
        message = ""
        for _ in range(HALVINGS):
            try:
                step = (end - value) / slider.unit.from_si(1.0)
                self.moved_by(self.parameters, slider.key, step)
                return end, message
            except InputError as error:
                end, message = 0.5 * (end + value), error.problems[0].message
        return value, message

    def preparation(self, parameters: MachineParameters) -> Preparation:
        """Return the preparation of runs with the step and the integrator of some parameters."""
        step = checked_step(parameters, None)
        integrator = checked_integrator(parameters, None)
        built = self._built_for(parameters)
        key = id(built), step, integrator
        if key not in self._preparations:
            self._preparations[key] = Preparation(built, step, integrator)
        return self._preparations[key]

    def _built_for(self, parameters: MachineParameters) -> Machine:
        """Return a built machine with the elements of some parameters.

        A number that is zero may have no element; the first other value then builds a machine.
        """
        machines = [self.machine, *self._others]
        for built in machines:
            if is_same(built, parameters):
                return built
        if len(machines) > MOST_BUILT:
            check_same_elements(self.machine.parameters, parameters)
        self._others.append(build_machine(parameters))
        return self._others[-1]

    def moved(self, values: Mapping[str, str]) -> MachineParameters:
        """Return the machine with other numbers.

        Args:
            values: Texts with units by key path, those of `sliders` or of whole vectors.

        Raises:
            InputError: one problem for each number that is wrong, in the words of `machine check`.
        """
        try:
            return self._with(self.parameters, values)
        except InputError:
            problems: list[Problem] = []
            parameters = self.parameters
            for key, text in values.items():
                try:
                    parameters = self._with(parameters, {key: text})
                except InputError as error:
                    problems += error.problems
            if problems:
                raise InputError(problems) from None
            raise

    def moved_by(self, parameters: MachineParameters, key: str, step: float) -> MachineParameters:
        """Return parameters with one number changed by a step in SI units."""
        with_sdf = with_sdf_values(self.machine.drawn.plant, parameters, [key])
        number = number_at(with_sdf, key)
        assert number.nominal is not None  # the values of the SDF are in these parameters
        return with_values(with_sdf, {key: number.at(number.nominal + step)})

    def _with(self, parameters: MachineParameters, values: Mapping[str, str]) -> MachineParameters:
        for key in values:
            if not any(key in (known, known.rpartition(".")[0]) for known in self.sliders):
                raise input_error(
                    f"'{key}' is not a number of the machine{nearest_names(key, self.sliders)}",
                    key=key,
                )
        given = {key: self._value(key, text) for key, text in values.items()}
        return with_values(with_sdf_values(self.machine.drawn.plant, parameters, given), given)

    def _value(self, key: str, text: str) -> str | float | CurveTable:
        """Return what a text sets: itself, the number of an entry, or a scaled curve."""
        slider = self.sliders.get(key)
        if slider is None or not (slider.is_entry or slider.number.is_table):
            return text
        value = slider.number.resolved(text)
        if value < 0.0 and slider.number.is_table:
            raise input_error(f"{text} is out of range; allowed is >= 0", key=key)
        return slider.number.at(value)

    def case(self, state: PageState) -> Case:
        """Return the case that a page has chosen.

        Raises:
            InputError: a number or the load is wrong, or the run would be too long.
        """
        parameters = self.moved(state.values)
        if state.masses:
            load = state.described_load()
            case = Case(DESCRIBED, load, parameters.profile, state.gasket, parameters)
        else:
            case = case_of(parameters, state.load, gasket=state.gasket)
            case = replace(case, parameters=parameters)
        check_length(case)
        return case

    def shown_values(self, case: Case, state: PageState) -> dict[str, float]:
        """Return the moved numbers of a case in their display units, by key path."""
        assert case.parameters is not None  # a page's case has parameters of its own
        return {
            key: self.sliders[key].unit.from_si(number_at(case.parameters, key).nominal or 0.0)
            for key in state.values
            if key in self.sliders
        }

    def measured(self, state: PageState) -> list[dict[str, object]]:
        """Return what was measured of the machine with a load: source and amplitudes [mm]."""
        if state.masses:
            return []
        gasket = "yes" if state.gasket and self.parameters.gasket else "no"
        if not self._measured:  # reading the files takes as long as a third of a run
            by_load: _Measured = defaultdict(list)
            for row in measured_amplitudes(self.parameters).to_dict("records"):
                amplitude = {name: float(row[name]) for name in self.parameters.sensors}
                by_load[row["load"], row["gasket"]].append(
                    {"source": str(row["source"]), "amplitude": amplitude}
                )
            self._measured.append(by_load)
        return self._measured[0].get((state.load, gasket), [])

    def for_page(self) -> dict[str, object]:
        """Return all that a page needs to know of the machine before the first run."""
        parameters = self.parameters
        with self.lock:
            places = places_of(parameters, self.machine.plant)
            numbers = [slider.for_page(places) for slider in self.sliders.values()]
            fastest = fastest_motion(self.machine.set_up(None))
            shapes = {
                body: [_shape(name, of) for name, of in outlines.items()]
                for body, outlines in (
                    ("tub", self.scene.tub_outlines()),
                    ("housing", self.scene.outlines("housing")),
                )
            }
        return {
            "name": parameters.name,
            "about": parameters.about,
            "numbers": numbers,
            "parts": [*PART_ORDER, CALCULATION],
            "loads": list(parameters.loads),
            "gasket": parameters.gasket is not None,
            "sensors": {name: sensor.axis for name, sensor in parameters.sensors.items()},
            "mounts": list(mount_names(parameters)),
            "shapes": shapes,
            "fastest": fastest.part if fastest.longest_step < LONGEST_STEP else "",
            "rings": _rings(parameters),
            "density": DENSITY,
        }


def _rings(parameters: MachineParameters) -> list[dict[str, object]]:
    """Return the keys of the numbers with which each ring on the drum is drawn."""
    rings = []
    for name, element in parameters.elements.items():
        if (ring := element_kind(element.kind).ring) is not None:
            key = f"elements.{name}"
            radii = [f"{key}.{field}" for field in ring.radii]
            numbers = {"y": f"{key}.y", "across": f"{key}.{ring.across}", "radii": radii}
            rings.append({**numbers, "isLiquid": ring.is_liquid})
    return rings


def drum_of(setup: Setup) -> dict[str, object]:
    """Return origin and axes, as columns of a matrix, of the drum at angle 0, in T. [m]"""
    poses = setup.machine.cache.frame_poses(setup.machine.drawn.plant, setup.parameters)
    origin, axes = poses.on_drum(0.0)
    return {"origin": origin.tolist(), "axes": axes.tolist()}


def _shape(name: str, outline: Outline) -> dict[str, object]:
    return {
        "name": name,
        "centre": outline.centre.tolist(),
        "axes": outline.axes.tolist(),
        "half": outline.half.tolist(),
        "round": outline.is_round,
    }


def is_same(built: Machine, parameters: MachineParameters) -> bool:
    """Return whether a built machine has the elements of some parameters."""
    try:
        check_same_elements(built.parameters, parameters)
    except InputError:
        return False
    return True


def check_length(case: Case) -> None:
    """Raise an InputError for a run that is too long for a page."""
    step = checked_step(case.parameters, None) if case.parameters else 1.0
    if case.profile.duration > LONGEST_RUN:
        raise input_error(
            f"a run of {case.profile.duration:g} s is too long for this page; allowed are "
            f"{LONGEST_RUN:g} s; the command 'spin' has no limit",
            key="profile.time",
        )
    if case.profile.duration / step > MOST_STEPS:
        raise input_error(
            f"a run of {case.profile.duration / step:.0f} steps is too long for this page; allowed "
            f"are {MOST_STEPS}; the command 'spin' has no limit",
            key="step",
        )
