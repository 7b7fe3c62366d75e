"""Spin runs: cases with their records and measures, in one or several processes."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from wm_drake.batch.many import run_cases
from wm_drake.batch.runs import BatchOptions, RunResult
from wm_drake.elements.kind import element_kind
from wm_drake.engines import DEFAULT_ENGINE
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters, Sensor
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import SPEED, STEP, TIME, of_measure
from wm_drake.simulation.cases import Case, is_as_measured
from wm_drake.simulation.convergence import Accuracy
from wm_drake.simulation.displacements import band_of, largest_motion
from wm_drake.simulation.measures import MEASURES, Measures, measure
from wm_drake.simulation.records import Record, sample_period, why_diverged

if TYPE_CHECKING:
    from wm_drake.studies.modes.study import NaturalModes


@dataclass(frozen=True)
class CaseResult:
    """Result of one case: its record, which has times of its own, and its measures.

    `wall_s` is its share of the time for simulation and measures of all cases. [s]
    `accuracy` is None if it is not known.
    """

    case: Case
    record: Record
    measures: Measures
    wall_s: float
    accuracy: Accuracy | None = None

    @property
    def has_gasket(self) -> bool:
        """Whether the case was run with the gasket."""
        return self.gasket == "yes"

    @property
    def gasket(self) -> str:
        """Whether it was run with the gasket: yes or no."""
        return str(self.record.attrs["gasket"])

    @property
    def diverged(self) -> str:
        """Time and reason if the run diverged, else ""."""
        return why_diverged(self.record)

    @property
    def title(self) -> str:
        """Title: the load, with or without gasket."""
        return f"{self.case.name} ({'with' if self.has_gasket else 'without'} gasket)"

    @property
    def has_envelopes(self) -> bool:
        """Whether it is long enough for the filter of the amplitudes, and did not fail."""
        return not bool(self.measures.amplitude.isnull().any())

    @property
    def gap_text(self) -> str:
        """Smallest gap, its parts, and drum speed and time there; "" without one."""
        gap = self.measures.smallest_gap
        if gap is None:
            return ""
        at = f"{SPEED.text(self.speed_at(gap.time))} ({TIME.text(gap.time)})"
        return f"{gap_size(gap.distance)} between {gap.parts}, at {at}"

    @property
    def stepping_text(self) -> str:
        """Integrator and step that the run used, and the time between its samples."""
        how = self.record.attrs
        step = STEP.text(how["step_s"])
        words = f"steps of up to {step} with controlled error"
        if "integrator" in how:
            words = f"{how['integrator']}, steps of {step}"
        if self.accuracy is not None:
            words += f", {self.accuracy.text}"
        return f"{words}, samples every {STEP.text(sample_period(self.record))}"

    def speed_at(self, time: float) -> float:
        """Return the drum speed at a time. [rad/s]"""
        return float(np.interp(time, self.record.time.values, self.record.drum_speed.values))


GAP = of_measure("smallest_gap")


def gap_size(distance: float) -> str:
    """Return a gap as text, and that the parts touch where it is not positive. [m]"""
    return f"{GAP.text(distance)}{' (they touch)' if distance <= 0.0 else ''}"


def band_text(*cases: CaseResult) -> str:
    """Return the pass band of the displacements of cases as text; of different ones, all."""
    bands = dict.fromkeys(band_of(case.record) for case in cases)
    return ", ".join(f"{low:g}–{high:.3g} Hz" for low, high in bands)


class ComparedCases(Enum):
    """Which cases are compared with the measured amplitudes of a machine.

    Attributes:
        AS_MEASURED: Cases with a load and the spin profile of the machine file, since these were
            measured.
        ALL: All cases; the user named the measurements.
        NONE: No case; the numbers of the machine are not those that were measured.
    """

    AS_MEASURED = "as measured"
    ALL = "all"
    NONE = "none"


@dataclass(frozen=True)
class SpinRuns:
    """Runs of all cases, in the order in which the cases were given.

    They are no labelled dataset, as each record has times and motion of its own; `measures` is.
    """

    parameters: MachineParameters
    engine: str
    results: tuple[CaseResult, ...]
    comparison: ComparedCases = ComparedCases.AS_MEASURED

    def is_compared(self, result: CaseResult) -> bool:
        """Return whether a case is compared with the measured amplitudes of the machine."""
        if self.comparison is not ComparedCases.AS_MEASURED:
            return self.comparison is ComparedCases.ALL
        return is_as_measured(self.parameters, result.case)

    @property
    def labels(self) -> list[str]:
        """Name of the load of each case; with or without gasket too if a load occurs twice."""
        names = [case.case.name for case in self.results]
        if len(set(names)) == len(names):
            return names
        return [case.title for case in self.results]

    @cached_property
    def measures(self) -> xr.Dataset:
        """Measures of all cases over `load`. [SI] Numbers of a gasket that is not there are NaN."""
        tables = [_of_parts(case) for case in self.results]
        loads = xr.Variable("load", self.labels)
        return xr.concat(tables, loads, data_vars="all", coords="minimal", compat="override")

    @property
    def stepping_text(self) -> str:
        """Return how the cases were integrated and sampled, each way once."""
        return "; ".join(dict.fromkeys(case.stepping_text for case in self.results))

    def sensors_of(self, case: CaseResult) -> dict[str, Sensor]:
        """Return the displacement sensors of the machine that a case was run with."""
        return (case.case.parameters or self.parameters).sensors

    def failures(self) -> tuple[str, ...]:
        """Return a line for each case that diverged."""
        return tuple(f"{case.case.name}: {case.diverged}" for case in self.results if case.diverged)


def _of_parts(case: CaseResult) -> xr.Dataset:
    """Return the measures of a case; those of a gasket that was taken out are NaN."""
    table = case.measures.table
    if case.has_gasket:
        return table
    changed = {
        name: table[name].where(table.mount != "gasket")
        for name in MEASURES["mounts"].names
        if name in table
    }
    gasket = [name for name in table if str(name).startswith("gasket_")]
    return table.assign(changed | {name: np.nan * table[name] for name in gasket})


def run_spin(
    machine: MachineParameters | Machine,
    cases: Sequence[Case],
    engine: str = DEFAULT_ENGINE,
    *,
    progress: Callable[[int, float], None] = lambda index, fraction: None,
    comparison: ComparedCases = ComparedCases.AS_MEASURED,
    **chosen: Any,
) -> SpinRuns:
    """Run cases and return their records and measures.

    The results do not depend on the number of workers.

    Args:
        machine: The machine, built or not.
        cases: Cases to run.
        engine: Name of the engine, key of `wm_drake.simulation.runs.ENGINES`.
        progress: Called with the index of a case and the fraction of it that is done; for cases in
            processes, when a case has ended.
        comparison: Which cases are compared with the measured amplitudes of the machine.
        chosen: Other fields of `BatchOptions`: step, workers.

    Raises:
        InputError: a case or an argument is wrong.

    Example:
        >>> import wm_drake as wm
        >>> parameters = wm.load_machine("reference")
        >>> result = wm.run_spin(parameters, [wm.case_of(parameters, "middle")])
        >>> result.results[0].case.name
        'middle'
    """
    built = machine if isinstance(machine, Machine) else build_machine(machine)
    scene, begin = Scene(built.parameters), time.time()
    ended = dict[int, tuple[Record, Measures, Accuracy | None]]()

    def collect(runs: list[RunResult]) -> None:
        for run in runs:
            assert run.record is not None  # all are kept
            ended[run.number] = run.record, measure(run.record, scene), run.accuracy
            progress(run.number, 1.0)

    shown = (m for m in MEASURES.values() if m.is_in_spin and m.applies(built.parameters))
    compared = tuple(one.name for one in shown)
    options = BatchOptions((), histories=True, engine=engine, compared=compared, **chosen)
    run_cases(built, cases, options, collect, progress)
    share = (time.time() - begin) / max(1, len(cases))
    results = (
        CaseResult(case, *ended[number][:2], share, ended[number][2])
        for number, case in enumerate(cases)
    )
    return SpinRuns(built.parameters, engine, tuple(results), comparison)


def natural_modes_of(machine: Machine, case: Case) -> "NaturalModes | None":
    """Return the natural modes of a machine with the load of a case; None if it has none."""
    from wm_drake.studies.modes.study import three_linearisations

    try:
        natural = three_linearisations(
            machine, case.load, parameters=case.parameters, gasket=case.gasket
        )
    except InputError:  # its cabinet moves, or the compiled engine does not represent it
        return None
    return replace(natural, load=case.name)


def _water_in(case: CaseResult, shown: Record) -> FloatArray | None:
    """Return the mean share of water in each wet mass over a motion; None for a load that stays."""
    if "mass_left" not in shown:
        return None
    load, masses = case.case.load, shown.mass_left.values.mean(axis=0)
    dry, wet = (load.masses(share * np.ones(len(load.wet))) for share in (0.0, 1.0))
    at = list(load.wet)
    return np.asarray((masses - dry)[at] / (wet - dry)[at])


def _balls_in(parameters: MachineParameters, shown: Record) -> dict[str, FloatArray]:
    """Return the places in D of the balls of each ring on the drum over a motion, by its name."""
    balls = {}
    for name, element in parameters.elements.items():
        kind = element_kind(element.kind)
        if kind.ring is not None:
            outputs = {
                output.name: shown[f"{kind.name}_{output.name}"].sel({kind.name: name}).values
                for output in kind.outputs
            }
            balls[name] = kind.ring.places(element, outputs)
    return balls


def write_replay(parameters: MachineParameters, case: CaseResult, path: Path) -> None:
    """Write the page of the 3D replay of a case around its largest amplitude."""
    from wm_drake.model.replay import Motion, replay_page

    time, positions = largest_motion(case.record)
    shown = case.record.sel(time=time)
    cabinet = None
    if "cabinet_angle" in shown:
        cabinet = np.hstack([shown.cabinet_angle.values, shown.cabinet_position.values])
    gasket = case.has_gasket
    words = "" if gasket or parameters.gasket is None else ", without gasket"
    text = replay_page(
        parameters,
        Motion(
            time,
            positions,
            shown.drum_speed.values,
            cabinet,
            _water_in(case, shown),
            _balls_in(parameters, shown),
        ),
        title=f"Machine {parameters.name}, load {case.case.name}{words}",
        load=case.case.load,
        gasket=gasket,
    )
    path.write_text(text, encoding="utf-8")
