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

from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.cases import Case, is_as_measured
from wm_drake.simulation.measures import Measures, measure
from wm_drake.simulation.records import Record
from wm_drake.simulation.runs import DEFAULT_ENGINE, DivergenceWarning, checked_step, simulate
from wm_drake.studies.spin.processes import can_start_processes, map_in_processes

if TYPE_CHECKING:
    from wm_drake.studies.modes.study import NaturalModes

_IN_PROCESSES = {"drake"}
"""Engines whose cases run in separate processes.

One case takes seconds, and Python systems of Drake do not run in parallel threads.
"""


@dataclass(frozen=True)
class CaseResult:
    """Result of one case; `wall_s` is the time for simulation and measures together. [s]"""

    case: Case
    record: Record
    measures: Measures
    wall_s: float


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


def compared_cases(measured: Sequence[Path] | None, sets: Sequence[str] | None) -> Comparison:
    """Return which cases are compared with measured amplitudes, from the options of a command."""
    if measured:
        return Comparison.ALL
    return Comparison.NONE if sets else Comparison.AS_MEASURED


@dataclass(frozen=True)
class SpinResult:
    """Results of all cases, in the order in which the cases were given.

    `modes` are the natural modes of the machine with the load of the first case; None if they were
    not asked for, or if the machine has none.
    """

    parameters: MachineParameters
    engine: str
    step: float
    results: tuple[CaseResult, ...]
    comparison: Comparison = Comparison.AS_MEASURED
    modes: "NaturalModes | None" = None

    def is_compared(self, result: CaseResult) -> bool:
        """Return whether a case is compared with the measured amplitudes of the machine."""
        if self.comparison is not Comparison.AS_MEASURED:
            return self.comparison is Comparison.ALL
        return is_as_measured(self.parameters, result.case)


@dataclass(frozen=True)
class _WorkItem:
    """All data that a process needs for one run."""

    parameters: MachineParameters
    case: Case
    engine: str
    step: float


def run_spin(
    parameters: MachineParameters,
    cases: Sequence[Case],
    engine: str = DEFAULT_ENGINE,
    *,
    step: float | None = None,
    progress: Callable[[int, float], None] = lambda index, fraction: None,
    workers: int | None = None,
    comparison: Comparison = Comparison.AS_MEASURED,
    modes: bool = False,
) -> SpinResult:
    """Run cases and return their records and measures.

    The results do not depend on the number of workers.

    Args:
        parameters: The machine.
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
    step = checked_step(parameters, step)
    count = min(workers or os.cpu_count() or 1, len(cases))
    work_items = [_WorkItem(parameters, case, engine, step) for case in cases]
    machine = None
    if engine in _IN_PROCESSES and count > 1 and can_start_processes():
        results = map_in_processes(_build_and_run, work_items, count, progress)
    else:
        machine, scene = build_machine(parameters), Scene(parameters)
        results = [
            _run(item, machine, scene, partial(progress, index))
            for index, item in enumerate(work_items)
        ]
    natural = _modes_of(machine or build_machine(parameters), cases[0]) if modes else None
    return SpinResult(parameters, engine, step, tuple(results), comparison, natural)


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
