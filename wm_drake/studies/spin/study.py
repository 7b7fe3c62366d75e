"""Spin runs: cases with their records and measures, in one or several processes."""

import os
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wm_drake.batch.runs import Runner
from wm_drake.batch.work_items import Preparation
from wm_drake.engines.memory import RECORDS_OF_BATCH
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters, Sensor
from wm_drake.parameters.measured import measured_notes
from wm_drake.report.formatting import MS_PER_S, RPM_PER_RAD_S, gap_size, number
from wm_drake.simulation.cases import Case, is_as_measured, notice_jumping_friction
from wm_drake.simulation.displacements import band_of, largest_motion
from wm_drake.simulation.measures import Measures, measure
from wm_drake.simulation.records import Record, sample_period, save_record
from wm_drake.simulation.runs import DEFAULT_ENGINE, DivergenceWarning, simulate
from wm_drake.simulation.steps import checked_integrator, checked_step
from wm_drake.studies.spin.processes import can_start_processes, map_in_processes

if TYPE_CHECKING:
    from wm_drake.studies.modes.study import NaturalModes


@dataclass(frozen=True)
class CaseResult:
    """Result of one case.

    `wall_s` is the time for simulation and measures together; of runs side by side, a share. [s]
    """

    case: Case
    record: Record
    measures: Measures
    wall_s: float

    @property
    def has_gasket(self) -> bool:
        """Whether the case was run with the gasket."""
        return bool(self.record.attrs["gasket"] == "yes")

    @property
    def title(self) -> str:
        """Title: the load, with or without gasket."""
        return f"{self.case.name} ({'with' if self.has_gasket else 'without'} gasket)"

    @property
    def gap_text(self) -> str:
        """Smallest gap, its parts, and drum speed and time there; "" without one."""
        gap = self.measures.smallest_gap
        if gap is None:
            return ""
        at = f"{number(self.speed_rpm(gap.time), 0)} rpm ({number(gap.time, 2)} s)"
        return f"{gap_size(gap.distance)} between {gap.parts}, at {at}"

    @property
    def stepping_text(self) -> str:
        """Integrator and step that the run used, and the time between its samples."""
        how = self.record.attrs
        step = f"{how['step_s'] * MS_PER_S:g} ms"
        words = f"steps of up to {step} with controlled error"
        if "integrator" in how:
            words = f"{how['integrator']}, steps of {step}"
        return f"{words}, samples every {sample_period(self.record) * MS_PER_S:g} ms"

    def speed_rpm(self, time: float) -> float:
        """Return the drum speed at a time. [rpm]"""
        speed = np.interp(time, self.record.time.values, self.record.drum_speed.values)
        return float(speed) * RPM_PER_RAD_S


def band_text(*cases: CaseResult) -> str:
    """Return the pass band of the displacements of cases as text; of different ones, all."""
    bands = dict.fromkeys(band_of(case.record) for case in cases)
    return ", ".join(f"{low:g}–{high:.3g} Hz" for low, high in bands)


class Comparison(Enum):
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
class Files:
    """Which files and pictures of spin runs are written beside the usual ones.

    Attributes:
        replay: A 3D replay for each case.
        detail: Pictures of vibration for every case, not only for the one with the largest
            amplitude.
        records: The record of each case.
        part: Part of the names of files that tells machines apart; "" for a single machine.
    """

    replay: bool = False
    detail: bool = False
    records: bool = True
    part: str = ""


@dataclass(frozen=True)
class SpinRuns:
    """Results of all cases, in the order in which the cases were given.

    `modes` are the natural modes of the machine with the load of the first case; None if they were
    not asked for, or if the machine has none.
    """

    parameters: MachineParameters
    engine: str
    results: tuple[CaseResult, ...]
    comparison: Comparison = Comparison.AS_MEASURED
    modes: "NaturalModes | None" = None
    files: Files = Files()

    def is_compared(self, result: CaseResult) -> bool:
        """Return whether a case is compared with the measured amplitudes of the machine."""
        if self.comparison is not Comparison.AS_MEASURED:
            return self.comparison is Comparison.ALL
        return is_as_measured(self.parameters, result.case)

    @property
    def stepping_text(self) -> str:
        """How the cases were integrated and sampled, each way once."""
        return "; ".join(dict.fromkeys(case.stepping_text for case in self.results))

    def sensors_of(self, case: CaseResult) -> dict[str, Sensor]:
        """Return the displacement sensors of the machine that a case was run with."""
        return (case.case.parameters or self.parameters).sensors

    def replay_of(self, case: CaseResult) -> str:
        """Return the name of the file with the 3D replay of a case; "" if there is none."""
        return f"replay_{self._name_of(case)}.html" if self.files.replay else ""

    def _name_of(self, case: CaseResult) -> str:
        return "_".join(filter(None, [self.files.part, case.case.name]))

    def measured_notes(self) -> list[str]:
        """Return what the measured amplitudes in the comparison are, by their files."""
        compared = any(map(self.is_compared, self.results))
        return measured_notes(self.parameters) if compared else []

    def write_cases(self, folder: Path) -> None:
        """Write the record of each case and its 3D replay where wanted."""
        for case in self.results:
            if self.files.records:
                save_record(case.record, folder / f"record_{self._name_of(case)}.nc")
            if file := self.replay_of(case):
                (folder / file).write_text(case_replay(self.parameters, case), encoding="utf-8")

    def failures(self) -> list[str]:
        """Return a line for each case that diverged."""
        return [
            f"{case.case.name}: {case.record.attrs['diverged']}"
            for case in self.results
            if case.record.attrs["diverged"]
        ]


@dataclass(frozen=True)
class _WorkItem:
    """All data that a process needs for one run."""

    parameters: MachineParameters
    case: Case
    engine: str
    step: float


def run_spin(
    machine: MachineParameters | Machine,
    cases: Sequence[Case],
    engine: str = DEFAULT_ENGINE,
    *,
    step: float | None = None,
    progress: Callable[[int, float], None] = lambda index, fraction: None,
    workers: int | None = None,
    comparison: Comparison = Comparison.AS_MEASURED,
    modes: bool = False,
) -> SpinRuns:
    """Run cases and return their records and measures.

    The results do not depend on the number of workers.

    Args:
        machine: The machine, built or not.
        cases: Cases to run.
        engine: Name of the engine, key of `wm_drake.simulation.runs.ENGINES`.
        step: Step size; None for that of the machine. [s]
        progress: Called with the index of a case and the fraction of it that is done.
        workers: Number of processes for an engine that needs processes; None for the number of
            cores. A single case always runs in this process, and all cases do in a daemon process,
            which cannot start others.
        comparison: Which cases are compared with the measured amplitudes of the machine.
        modes: Whether to compute the natural modes with the load of the first case.

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
    parameters = built.parameters
    step = checked_step(parameters, step)
    count = min(workers or os.cpu_count() or 1, len(cases))
    work_items = [_WorkItem(parameters, case, engine, step) for case in cases]
    if engine == DEFAULT_ENGINE:
        results = _run_side_by_side(built, cases, step, progress)
    elif count > 1 and can_start_processes():  # Python systems of Drake block other threads
        results = map_in_processes(_build_and_run, work_items, count, progress)
    else:
        scene = Scene(parameters)
        results = [
            _run(item, built, scene, partial(progress, index))
            for index, item in enumerate(work_items)
        ]
    natural = _modes_of(built, cases[0]) if modes else None
    return SpinRuns(parameters, engine, tuple(results), comparison, natural)


def _modes_of(machine: Machine, case: Case) -> "NaturalModes | None":
    """Return the natural modes of a machine with the load of a case; None if it has none."""
    from wm_drake.studies.modes.study import three_linearisations

    try:
        natural = three_linearisations(
            machine, case.load, parameters=case.parameters, gasket=case.gasket
        )
    except InputError:  # its cabinet moves, or the compiled engine does not represent it
        return None
    return replace(natural, load=case.name)


def _run_side_by_side(
    machine: Machine, cases: Sequence[Case], step: float, progress: Callable[[int, float], None]
) -> list[CaseResult]:
    """Return the results of cases, which the compiled engine runs in the lanes of a batch."""
    notice_jumping_friction(machine.parameters)
    scene, runner = Scene(machine.parameters), Runner(machine.parameters, (), histories=True)
    integrator = checked_integrator(machine.parameters, None)
    preparation = Preparation(machine, step, integrator, RECORDS_OF_BATCH)
    results = dict[int, CaseResult]()
    for key, items in preparation.batches(cases):
        begin = time.perf_counter()

        def report(fraction: float, numbers: tuple[int, ...]) -> None:
            for index in numbers:
                progress(index, fraction)

        numbers = tuple(item.number for item in items)
        runs = runner.run(key, items, partial(report, numbers=numbers))
        share = (time.perf_counter() - begin) / len(runs)
        for run in runs:
            assert run.record is not None  # the runner keeps all
            begin = time.perf_counter()
            measures = measure(run.record, scene)
            wall = share + time.perf_counter() - begin
            results[run.number] = CaseResult(run.case, run.record, measures, wall)
    return [results[number] for number in range(len(cases))]


def _build_and_run(item: _WorkItem, report: Callable[[float], None]) -> CaseResult:
    """Return the result of a case in a process that has no built machine yet."""
    return _run(item, build_machine(item.parameters), Scene(item.parameters), report)


def _run(
    item: _WorkItem, machine: Machine, scene: Scene, progress: Callable[[float], None]
) -> CaseResult:
    begin = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DivergenceWarning)  # the report shows it from the record
        record = simulate(machine, item.case, item.engine, step=item.step, progress=progress)
    measures = measure(record, scene)
    return CaseResult(item.case, record, measures, time.perf_counter() - begin)


def case_replay(parameters: MachineParameters, case: CaseResult) -> str:
    """Return the page of the 3D replay of a case around its largest amplitude."""
    from wm_drake.model.replay import Motion, replay_page

    time, positions = largest_motion(case.record)
    shown = case.record.sel(time=time)
    cabinet = None
    if "cabinet_angle" in shown:
        cabinet = np.hstack([shown.cabinet_angle.values, shown.cabinet_position.values])
    gasket = case.has_gasket
    words = "" if gasket or parameters.gasket is None else ", without gasket"
    return replay_page(
        parameters,
        Motion(time, positions, shown.drum_speed.values, cabinet),
        title=f"Machine {parameters.name}, load {case.case.name}{words}",
        load=case.case.load,
        gasket=gasket,
    )
