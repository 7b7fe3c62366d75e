"""Check the options of the calibration to recordings, and run it."""

from collections.abc import Sequence
from functools import partial

from wm_drake.batch import RunResult, simulate_many
from wm_drake.model.machine import Machine
from wm_drake.simulation.cases import Case
from wm_drake.simulation.records import Record
from wm_drake.studies.answer import Answer
from wm_drake.studies.compare.pairs import check_signs
from wm_drake.studies.compare.task import CompareTask
from wm_drake.studies.executor import Executor
from wm_drake.studies.record_calibrate.options import RecordCalibrateOptions
from wm_drake.studies.record_calibrate.page import record_calibrate_answer
from wm_drake.studies.record_calibrate.study import RecordModel, calibrated, without_edges
from wm_drake.studies.spin_identify.study import unknowns_of


class RecordCalibrateTask(CompareTask):
    """The calibration with checked options."""

    def __init__(self, options: RecordCalibrateOptions, machine: Machine) -> None:
        """Read test, recordings, load and profile, and check the unknowns."""
        self.sought = unknowns_of(machine.parameters, options.unknown)
        super().__init__(options, machine)
        self.by, self.seed = options.by, options.seed

    def run(self, executor: Executor) -> Answer:
        """Align the recordings at the start of the search, and fit the unknowns."""
        pairs = self.pairs(executor)
        for pair in pairs:
            check_signs(pair, self.sensors)
        kept = tuple(without_edges(pair) for pair in pairs)
        run = partial(records_of, self.machine)
        parts = self.sensors, self.points, self.sought, self.by, run
        model = RecordModel(self.machine.parameters, self.case, kept, *parts)
        with executor.fraction("search") as report:
            fit, data = calibrated(model, self.seed, lambda fraction, least: report(fraction))
        return record_calibrate_answer(model, fit, data)


def records_of(machine: Machine, cases: Sequence[Case]) -> list[Record]:
    """Run cases and return their records, in their order."""
    records: dict[int, Record] = {}

    def collect(result: RunResult) -> None:
        assert result.record is not None
        records[result.number] = result.record

    simulate_many(machine, cases, measures=("extremes",), histories=True, finished=collect)
    return [records[number] for number in range(len(cases))]
