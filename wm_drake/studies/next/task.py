"""Check the options of the study of what to measure next, and run it."""

from collections.abc import Callable, Collection, Sequence
from typing import Any

from wm_drake.errors import InputError, input_error, problems_at
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.candidates import CANDIDATES, CandidateFile, load_candidates
from wm_drake.parameters.machine import FrameOverride, Sensor
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.measures.responses import (
    GAP,
    Response,
    chosen_responses,
    has_gap,
    measures_of,
)
from wm_drake.studies.answer import Answer, Part
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.inputs import problems_of_file, profile_of
from wm_drake.studies.next.knowledge import Knowledge, of_calibration_folder, of_file
from wm_drake.studies.next.measurements import CandidateMeasurement, measurements_of
from wm_drake.studies.next.options import NextOptions
from wm_drake.studies.next.page import BLOCK, next_answer, next_part
from wm_drake.studies.next.question import Question
from wm_drake.studies.next.study import model_of
from wm_drake.studies.run import machine_text
from wm_drake.studies.study import Task

FEW, BLOCK_BUDGET = 32, 2
"""Drawn machines and measurements of the block for another page."""

UNMEASURED = "unmeasured"
"""Shipped vary file: what is known of any machine."""


class NextTask(Task):
    """The study with checked options."""

    def __init__(self, options: NextOptions, machine: Machine) -> None:
        """Read what is known and what could be measured."""
        self.options = options
        path = CANDIDATES.path(options.candidates)
        self.file = load_candidates(options.candidates)
        with problems_of_file(path):
            extended = build_machine(with_candidates(machine.parameters, self.file))
        self.profile = profile_of(extended.parameters, options.profile)
        with problems_at("--for", ""):
            self.answers = chosen_responses(extended.parameters, self.profile, options.answers)
        self.cases = cases_of(machine.parameters, self.profile)
        self.knowledge = knowledge_of(options, extended)
        with problems_of_file(path):
            self.measurements = measurements_of(self.knowledge.machine, self.file)

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs."""
        return {
            "machine": machine_text(self.knowledge.machine.parameters),
            "known": self.knowledge.about,
            "profile": self.profile,
            "seed": str(self.options.seed),
        }

    def run(self, executor: Executor) -> Answer:
        """Run the machines near the middle and those drawn, and rank the measurements."""
        question = question_of(
            executor, self.knowledge, self.measurements, self.answers, self.cases
        )
        model = model_of(question, self.options.samples, self.options.seed)
        return next_answer(model, self.options.budget, self.file.about)


def next_block(
    executor: Executor,
    knowledge: Callable[[], Knowledge],
    command: str,
    profile: SpinProfile,
    measured: Collection[tuple[str, bool]] = (),
) -> Part:
    """Return the block on what to measure next for the page of another study.

    It has few samples, runs with the gasket only, and the usual candidates.

    Args:
        knowledge: Function that returns what is known of the machine.
        command: Command of the whole study.
        profile: Spin profile of all runs.
        measured: Load and gasket of runs that are measured already.
    """
    try:
        known = knowledge()
        parameters = known.machine.parameters
        usual = measurements_of(known.machine, load_candidates())
        left = tuple(m for m in usual if m.run is None or (m.run[1] and m.run not in measured))
        names = (GAP,) if has_gap(parameters) else ("amplitude",)
        cases = cases_of(parameters, profile)
        answers = chosen_responses(parameters, profile, names)
        question = question_of(executor, known, left, answers, cases)
        return next_part(model_of(question, FEW, 0), BLOCK_BUDGET, command)
    except InputError as error:
        return Part(BLOCK, text=f"Not computed: {error.problems[0]}. Try {command}.")


def with_candidates(parameters: MachineParameters, file: CandidateFile) -> MachineParameters:
    """Return a machine with the loads and the sensors of a file of candidates.

    Raises:
        InputError: a name is in the machine already.
    """
    frames, sensors = {}, {}
    for name, sensor in file.sensors.items():
        frame = f"sensor_{name}"
        frames[frame] = FrameOverride(position=sensor.position, attached_to="tub")
        sensors[name] = Sensor(frame=frame, axis=sensor.axis)
    added: dict[str, dict[str, Any]] = {"loads": file.loads, "frames": frames, "sensors": sensors}
    for group, parts in added.items():
        for name in parts.keys() & getattr(parameters, group).keys():
            key = f"{group}.{name}"
            raise input_error("is in the machine already; choose another name", key=key)
    changes: dict[str, Any] = {
        group: {**getattr(parameters, group), **parts} for group, parts in added.items()
    }
    changes |= {"measured": ()} if sensors else {}  # no measured value of a sensor that is new
    return parameters.model_copy(update=changes)


def knowledge_of(options: NextOptions, machine: Machine) -> Knowledge:
    """Return what the options say is known."""
    if options.calibrated is None:
        return of_file(machine, options.vary or UNMEASURED)
    if options.vary is None:
        written = options.calibrated / "calibrated_vary.yaml"
        file = written if written.is_file() else "FILE"
        message = f"needs the vary file of the calibration; add --vary {file}"
        raise input_error(message, where="--calibrated")
    return of_calibration_folder(machine, options.vary, options.calibrated)


def cases_of(parameters: MachineParameters, profile: SpinProfile) -> tuple[Case, ...]:
    """Return a case of each load of a machine."""
    return tuple(Case(name, load, profile) for name, load in parameters.loads.items())


def question_of(
    executor: Executor,
    knowledge: Knowledge,
    measurements: tuple[CandidateMeasurement, ...],
    answers: tuple[Response, ...],
    cases: Sequence[Case],
) -> Question:
    """Return the question with the runs that it needs.

    Args:
        cases: Case of each load of the answers; their profile is that of all runs.
    """
    parameters = knowledge.machine.parameters
    read = {"amplitudes"}  # by sensors; the answers are those with the gasket
    needed = {True: {*measures_of(parameters, answers), *read}, False: read}
    loads = tuple(case.name for case in cases)
    runs = dict.fromkeys([*((load, True) for load in loads), *(m.run for m in measurements)])
    experiments = {
        gasket: Experiment(
            knowledge.machine,
            tuple(name for name in MEASURES if name in needed[gasket]),
            executor.simulate,
            tuple(
                Case(run[0], parameters.loads[run[0]], cases[0].profile, gasket)
                for run in runs
                if run is not None and run[1] is gasket
            ),
        )
        for gasket in (True, False)
        if any(run is not None and run[1] is gasket for run in runs)
    }
    return Question(knowledge, measurements, answers, loads, experiments)
