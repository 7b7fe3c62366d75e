"""Check the options of the comparison of recordings with a machine, and run it."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from wm_drake.errors import InputError, InputNotice, input_error
from wm_drake.model.frame_poses import FramePoses
from wm_drake.model.machine import Machine
from wm_drake.model.scene import Scene
from wm_drake.model.sdf_names import frame_problem
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.recorded_sensors import (
    RecordedSensor,
    RecordedTest,
    load_recorded_test,
    recorded_test_of,
)
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.records import Record, profile_of, why_diverged
from wm_drake.studies.answer import Answer
from wm_drake.studies.compare.checks import check_orders, check_pair, check_speed, judged
from wm_drake.studies.compare.diagnosis import Diagnosis, Suspect, diagnosed
from wm_drake.studies.compare.gaps import gaps_of
from wm_drake.studies.compare.options import CompareOptions
from wm_drake.studies.compare.page import compare_answer
from wm_drake.studies.compare.pairs import (
    Pair,
    measured_profile,
    pair_at,
    paired,
    predicted_signals,
    speed_of_order_one,
)
from wm_drake.studies.compare.recordings import (
    TestRecording,
    check_distinct,
    read_test,
    used_sensors,
)
from wm_drake.studies.executor import Executor
from wm_drake.studies.inputs import channel_names, existing_file, problems_of_file, selected_cases
from wm_drake.studies.study import Task

MOST_LOADS = 8
"""Most loads of a machine that are tried where a recording is not like its prediction."""


class CompareTask(Task):
    """The comparison with checked options.

    Attributes:
        warnings: Sentences on recordings that are not like their predictions.
    """

    warnings: tuple[str, ...] = ()

    def __init__(self, options: CompareOptions, machine: Machine, case: Case | None = None) -> None:
        """Read test, recordings, load and profile.

        Args:
            case: The load with its profile; None for that of the options or of the test.
        """
        self.options, self.machine = options, machine
        parameters = machine.parameters
        if parameters.cabinet_moves:
            raise input_error(
                "the sensors of a recording need a cabinet that does not move; leave it out",
                key="cabinet.moves",
            )
        self.test = recorded_test_of(parameters)
        if options.test is not None:
            self.test = load_recorded_test(existing_file(options.test, "--test"))
        with problems_of_file(options.test or Path("--machine")):
            self.points = sensor_points(machine, self.test)
        self.case = case or self._case()
        names, unit = channel_names(options, ("time", "speed", *self.test.sensors))
        paths = [existing_file(path, "RECORD") for path in options.records]
        for path in paths:
            if paths.count(path) > 1:
                raise input_error(f"'{path}' is given twice", where="RECORD")
        recordings = [
            read_test(path, self.test, names, unit, self.case.profile.duration) for path in paths
        ]
        check_distinct([recording.channels for recording in recordings])
        for recording in recordings:
            check_orders(recording)
        self.sensors = used_sensors(recordings, self.test)
        self.recordings = [_of_sensors(recording, self.sensors) for recording in recordings]

    def _case(self) -> Case:
        load = self.options.load or self.test.load
        if load is None:
            loads = self.machine.parameters.loads
            if len(loads) > 1:
                raise input_error(
                    f"the machine has the loads {', '.join(loads)}; name that of the test: --load, "
                    "or load in the file of --test",
                    where="--load",
                )
            load = next(iter(loads))
        return selected_cases(self.machine.parameters, [load], True, self.options.profile)[0]

    def run(self, executor: Executor) -> Answer:
        """Run the machine, align the recordings, and compare."""
        pairs = self.pairs(executor)
        gaps = gaps_of(pairs, self.sensors, self.points, Scene(self.machine.parameters))
        driven = "that of the profile" if self.options.speed == "profile" else "recorded"
        details = (("Load", self.case.name), ("Drum speed of the model", driven))
        answer = compare_answer(self.machine.parameters, pairs, self.sensors, gaps, details)
        return replace(answer, warned=self.warnings)

    def pairs(self, executor: Executor) -> list[Pair]:
        """Run the machine, and return the recordings on the times of the runs.

        Raises:
            InputError: a recording contradicts its run, shows nothing of it, or a discrete cause
                explains why it is not like its prediction; see `wm_drake.studies.compare.checks`.
        """
        pairs = self._pairs(executor)
        for pair in pairs:
            if self.options.speed == "profile":
                check_speed(pair)
            check_pair(pair)
        said = [judged(self.diagnosis(executor, pair), pair) for pair in pairs]
        self.warnings = tuple(filter(None, said))
        return pairs

    def doubt(self, executor: Executor) -> str:
        """Return why the recordings are not like their predictions; "" if they are."""
        try:
            self.pairs(executor)
        except InputError as error:
            return f"{error}."
        return " ".join(self.warnings)

    def diagnosis(self, executor: Executor, pair: Pair) -> Diagnosis:
        """Return what explains a recording that is not like its prediction."""
        declared = Suspect("", pair, self.sensors, self.points)
        first = diagnosed(declared)
        if not first.unlike or first.is_sure:
            return first
        profile = profile_of(pair.run)
        backwards = profile.model_copy(update={"speed": tuple(-w for w in profile.speed)})
        others = {"the drum turned the other way (a profile of speeds below 0)": backwards}
        cases = [replace(self.case, profile=backwards)]
        for name, load in list(self.machine.parameters.loads.items())[:MOST_LOADS]:
            if load != self.case.load:
                others[f"the load was {name} (--load {name})"] = profile
                cases.append(replace(self.case, load=load, profile=profile))
        suspects = []
        for words, run in zip(others, self._cases(executor, cases), strict=True):
            predicted = predicted_signals(run, self.sensors, self.points)
            if pair.alignment.source == "signals":
                other = paired(pair.recording, run, predicted)
            else:
                other = pair_at(pair.recording, run, predicted, pair.alignment)
            suspects.append(Suspect(words, other, self.sensors, self.points))
        return diagnosed(declared, suspects)

    def _pairs(self, executor: Executor) -> list[Pair]:
        speeds = [recording.speed for recording in self.recordings]
        pairs: list[Pair] = []
        if self.options.speed == "profile" or any(speed is None for speed in speeds):
            run = self._runs(executor, [self.case.profile])[0]
            predicted = predicted_signals(run, self.sensors, self.points)
            pairs = [paired(one, run, predicted) for one in self.recordings]
        if self.options.speed == "profile":
            return pairs
        followed = [
            measured_profile(one, speed_of_order_one(pairs[k]) if speed is None else speed)
            for k, (one, speed) in enumerate(zip(self.recordings, speeds, strict=True))
        ]
        runs = self._runs(executor, [profile for profile, _, _ in followed])
        return [
            pair_at(one, run, predicted_signals(run, self.sensors, self.points), clock, begin)
            for one, run, (_, clock, begin) in zip(self.recordings, runs, followed, strict=True)
        ]

    def _runs(self, executor: Executor, profiles: Sequence[SpinProfile]) -> list[Record]:
        return self._cases(executor, [replace(self.case, profile=one) for one in profiles])

    def _cases(self, executor: Executor, runs: Sequence[Case]) -> list[Record]:
        name = self.case.name
        cases = [replace(run, name=f"{name} {number}") for number, run in enumerate(runs, 1)]
        records: dict[int, Record] = {}
        executor.records(self.machine, cases, records.__setitem__, "runs")
        for record in records.values():
            if reason := why_diverged(record):
                raise input_error(f"the run diverged: {reason}", key="machine")
        return [records[number] for number in range(len(cases))]


def doubt_again(executor: Executor, options: CompareOptions, machine: Machine, case: Case) -> str:
    """Return why records that were read before are not like their predictions; "" if they are."""
    with warnings.catch_warnings(action="ignore", category=InputNotice):
        return CompareTask(options, machine, case).doubt(executor)


def sensor_points(machine: Machine, test: RecordedTest) -> dict[str, FloatArray]:
    """Return the positions of the sensors of a test in the frame of the tub, by name. [m]

    Raises:
        InputError: a frame is not one of the tub of this machine.
    """
    frames = {n: sensor.frame for n, sensor in test.sensors.items() if sensor.frame is not None}
    problems = [
        problem
        for name, frame in frames.items()
        for problem in frame_problem(machine.plant, f"sensors.{name}.frame", "tub", frame)
    ]
    if problems:
        raise InputError(problems)
    poses = FramePoses(machine.drawn.plant, machine.parameters)
    at_frames = {name: poses("tub", frame)[0] for name, frame in frames.items()}
    points = {n: np.array(s.point) for n, s in test.sensors.items() if s.point is not None}
    return at_frames | points


def _of_sensors(recording: TestRecording, sensors: Mapping[str, RecordedSensor]) -> TestRecording:
    """Return a recording with the channels of some sensors only, in their order."""
    values = {name: recording.channels.values[name] for name in sensors}
    return replace(recording, channels=replace(recording.channels, values=values))
