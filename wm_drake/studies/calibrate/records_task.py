"""Check the options of a fit to recordings, and run it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from wm_drake.errors import input_error
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters.vary_file import VARY_FILES, load_vary
from wm_drake.simulation.cases import load_of
from wm_drake.studies.answer import Answer
from wm_drake.studies.calibrate.blocks import calibrated
from wm_drake.studies.calibrate.fit_page import FitWords, compared, fit_answer
from wm_drake.studies.calibrate.options import CalibrateOptions
from wm_drake.studies.calibrate.parameter_map import read_parameter_map
from wm_drake.studies.calibrate.recorded import RecordedLoad, until_last_sample, without_edges
from wm_drake.studies.calibrate.records import RecordModel
from wm_drake.studies.calibrate.test_file import (
    calibrated_test,
    clock_remarks,
    test_text,
    vary_text,
)
from wm_drake.studies.compare.pairs import QUANTITIES
from wm_drake.studies.compare.recordings import check_distinct
from wm_drake.studies.compare.task import CompareTask, doubt_again
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment, record_here
from wm_drake.studies.fitting.free_numbers import FreeNumbers, free_numbers_of_texts
from wm_drake.studies.health import health_part
from wm_drake.studies.study import Task

OF_TARGETS = ("targets", "deviation", "weight", "limit", "leave_out")
"""Options that are about targets, not about records."""


METHOD = (
    "The model predicts the signals as they were recorded. Unknowns of the fit beside those of the "
    "machine are what is not known of the recorder: gain and tilt of each sensor, offset and rate "
    "of each clock, and, if signals over time are fitted, the angle of the drum at the start. Each "
    "has a prior: expected value and standard deviation. Of signals over time, offset and drift "
    "are taken out. Two seconds at both ends of a record are left out. Confidence intervals take "
    "the correlation of neighbouring residuals into account."
)


class CalibrateRecordsTask(Task):
    """A calibration to recordings with checked options."""

    def __init__(self, options: CalibrateOptions, machine: Machine) -> None:
        """Read test, recordings, loads and profile, and check the unknowns.

        Raises:
            InputError: an option or a file is wrong.
        """
        for name in OF_TARGETS:
            if name in options.model_fields_set:
                word = name.replace("_", "-")
                raise input_error("is about targets, not about records", where=f"--{word}")
        if options.by == "history" and options.speed == "measured":
            raise input_error(
                "history needs the angle of the drum, which a measured speed does not tell; fit "
                "envelope, order or rms, or name the profile",
                where="--by",
            )
        self.options, self.machine = options, machine
        self.free = _free_numbers(options, machine)
        self.tests = [
            CompareTask(options.model_copy(update={"records": files, "load": load}), machine)
            for load, files in _by_load(options).items()
        ]
        check_distinct([one.channels for test in self.tests for one in test.recordings])

    @property
    def identity(self) -> Mapping[str, Any]:
        """Return what determines the fit beside the machine."""
        options = self.options
        return {
            "records": [path.name for path in options.records],
            "unknowns": self.free.unknowns,
            "test": self.tests[0].test.model_dump_json(),
            "fitted": f"{options.by}, seed {options.seed}",
        }

    def run(self, executor: Executor) -> Answer:
        """Align the recordings at the start of the search, and fit the unknowns."""
        loads = [
            recorded_load(test, executor, partial(load_of, test.case, self.machine.parameters))
            for test in self.tests
        ]
        model = record_model(executor, self.free, self.tests, loads, self.options.by)
        title = f"Machine {self.machine.parameters.name} calibrated to records"
        return fitted_answer(executor, model, self.options.seed, (title, "calibrated"), self.tests)


def fitted_answer(
    executor: Executor,
    model: RecordModel,
    seed: int,
    words: tuple[str, str],
    tests: Sequence[CompareTask],
) -> Answer:
    """Fit a model to its recordings, and return the answer.

    Args:
        words: Title of the page, and name of the file of the machine with the values found.
        tests: Of the recordings.
    """
    with executor.fraction("search") as report:
        fit, data = calibrated(model, seed, lambda fraction, least: report(fraction))
    files = ", ".join(pair.recording.path.name for pair in model.pairs)
    loads, count = ", ".join(load.name for load in model.loads), len(model.pairs)
    fitted = "signals" if model.by == "history" else "amplitudes"
    texts = FitWords(
        *words,
        data="1 record" if count == 1 else f"{count} records",
        fitted=fitted,
        source=f"calibrated to {files}",
        method=METHOD,
        facts=(("Records", files), ("Load", loads), ("Fitted", model.by)),
    )
    parts = []
    for quantity in QUANTITIES.values():
        names = [n for n, sensor in model.sensors.items() if sensor.quantity == quantity.words]
        if names:
            parts.append(compared(data.sel(sensor=names), quantity, fitted))
    parts.append(health_part({p.recording.path.name: p.recording.findings for p in model.pairs}))
    answer = fit_answer(model, fit, data, texts, parts)
    calibrated_sensors = calibrated_test(model, fit, tests[0].test)
    name, text = f"{words[1]}_test.yaml", test_text(calibrated_sensors, clock_remarks(model, fit))
    of_next = {name: text, f"{words[1]}_vary.yaml": vary_text(model.free, fit, texts.source)}
    doubts = [warning for test in tests for warning in test.warnings]
    if fit.rmse > model.most_misfit:
        fitted_machine = build_machine(model.free.solved(fit, texts.source))
        loaded = [load.load_at(fitted_machine.parameters) for load in model.loads]
        doubts = [
            doubt_again(executor, test.options, fitted_machine, replace(test.case, load=load))
            for test, load in zip(tests, loaded, strict=True)
        ]
    warned = (*filter(None, doubts), *answer.warned)
    return replace(answer, files={**answer.files, **of_next}, warned=warned)


def recorded_load(test: CompareTask, executor: Executor, load_at: Any) -> RecordedLoad:
    """Return the recordings of a test on the times of runs, without their ends.

    Args:
        load_at: Function of a machine with the load.
    """
    pairs = until_last_sample([without_edges(pair) for pair in test.pairs(executor)])
    return RecordedLoad(test.case.name, load_at, pairs)


def record_model(
    executor: Executor,
    free: FreeNumbers,
    tests: Sequence[CompareTask],
    loads: Sequence[RecordedLoad],
    by: Any,
) -> RecordModel:
    """Return the model of the sensors of all loads, whose values the ledger keeps.

    Raises:
        InputError: the records of the loads have other sensors.
    """
    names = list(tests[0].sensors)
    for test in tests:
        if list(test.sensors) != names:
            raise input_error(
                f"the records of load {test.case.name} have the sensors "
                f"{', '.join(test.sensors)}, those of load {tests[0].case.name} {', '.join(names)}",
                where="RECORD",
            )
    record = partial(record_here, workers=executor.workers)  # records are used at once
    first, ledger = tests[0], executor.ledger
    experiment, deviation = Experiment(first.machine, (), record=record), first.test.load_deviation
    return RecordModel(
        experiment, free, first.sensors, tuple(loads), first.points, by, ledger, deviation
    )


def _by_load(options: CalibrateOptions) -> dict[str | None, tuple[Path, ...]]:
    """Return the records of each load: RECORD is one of the test, LOAD=RECORD of another load."""
    files: dict[str | None, tuple[Path, ...]] = {}
    for path in options.records:
        load, separator, name = str(path).partition("=")
        known = load if separator and not path.exists() else None
        file = Path(name) if known else path
        files[known or options.load] = (*files.get(known or options.load, ()), file)
    return files


def _free_numbers(options: CalibrateOptions, machine: Machine) -> FreeNumbers:
    """Return the unknowns of `--unknown`, or those of a vary file."""
    if bool(options.unknown) == (options.vary is not None):
        raise input_error(
            "records need either --unknown NAME[=VALUES] or --vary FILE", where="--unknown"
        )
    if options.vary is None:
        return free_numbers_of_texts(machine.parameters, options.unknown, "calibrated")
    path, file = VARY_FILES.path(options.vary), load_vary(options.vary)
    if file.spring_preload is not None or file.spring_elongation is not None:
        raise input_error(
            "spring_preload and spring_elongation are about targets; leave them out for records",
            where=str(path),
        )
    return read_parameter_map(machine, path, file)
