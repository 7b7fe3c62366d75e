"""Run the cases of a study: on the cores of this computer or on a cluster."""

from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from wm_drake.engines import DEFAULT_ENGINE
from wm_drake.report.progress import progress_bar, progress_bars

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    import xarray as xr

    from wm_drake.batch.ledger import Ledger
    from wm_drake.model.machine import Machine
    from wm_drake.simulation.cases import Case
    from wm_drake.simulation.convergence import StepSummary
    from wm_drake.simulation.records import Record

RunCases: TypeAlias = "Callable[[Iterable[Case]], xr.Dataset]"
"""Function that runs cases and returns the table of their measures, as `simulate_many` does."""


def _no_steps() -> "StepSummary":
    from wm_drake.simulation.convergence import StepSummary

    return StepSummary()


@dataclass
class Executor:
    """Run cases for a task: on the cores of this computer or on a cluster, with a progress bar.

    Attributes:
        ledger: Finished runs; None for a study without runs.
        workers: Number of threads, or of processes for the Drake engine; None for the number of
            cores.
        client: Client of a cluster, or None.
        out: Folder of the results, or None.
        engine: Name of the engine of all runs.
        runs: Number of runs so far.
        steps: Steps and errors of the runs so far.
    """

    ledger: "Ledger | None" = None
    workers: int | None = None
    client: Any = None
    out: Path | None = None
    engine: str = DEFAULT_ENGINE
    runs: int = 0
    steps: "StepSummary" = field(default_factory=lambda: _no_steps(), repr=False)
    _report: Callable[..., None] | None = field(default=None, repr=False)
    _reported: int = field(default=0, repr=False)

    def simulate(
        self,
        machine: "Machine",
        measures: tuple[str, ...],
        cases: "Iterable[Case]",
        what: str = "runs",
    ) -> "xr.Dataset":
        """Run cases that the ledger does not have, and return the table of all.

        The table is that of `wm_drake.simulate_many`, with the step and the integrator of the
        machine.

        Args:
            machine: Built machine.
            measures: Names of measures.
            cases: Cases. They are taken one by one if their number is known.
            what: Word beside the progress bar.
        """
        if self._report is None:
            counted = cases if isinstance(cases, Sized) else list(cases)
            with progress_bar(len(counted), what) as report:
                return self._run(machine, measures, counted, report)
        whole, before = self._report, self._reported
        table = self._run(machine, measures, cases, lambda done: whole(before + done))
        self._reported += table.sizes["run"]
        return table

    def each(
        self, function: Callable[[Any], Any], items: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """Yield number and result of a function for each item, as they end: here or on a cluster.

        Args:
            function: Function at the level of a module, for work that is no run of a machine.
        """
        if self.client is None:
            yield from ((number, function(item)) for number, item in enumerate(items))
            return
        from wm_drake.batch.cluster import map_on_cluster

        yield from map_on_cluster(function, items, self.client)

    def records(
        self,
        machine: "Machine",
        cases: "Sequence[Case]",
        keep: "Callable[[int, Record], None]",
        what: str = "records",
    ) -> None:
        """Run cases on this computer and pass the number and the record of each to a function.

        Records are too large for a ledger.
        """
        from wm_drake.simulation.convergence import accuracy_in
        from wm_drake.studies.experiment import record_here

        cases = list(cases)

        def collect(number: int, record: "Record") -> None:
            self.steps.add(cases[number].name, accuracy_in(record.attrs))
            keep(number, record)

        how: dict[str, Any] = {"workers": self.workers, "engine": self.engine}
        with progress_bar(len(cases), what) as report:
            record_here(machine, cases, collect, what, progress=report, **how)

    @contextmanager
    def progress(self, total: int, what: str = "runs") -> Iterator[Callable[..., None]]:
        """Show one progress bar, which all calls of `simulate` in the block move together.

        Args:
            total: Number of runs or steps of the block.
            what: Word beside the bar.

        Yields:
            Function to call with the number of finished steps, and with words to show beside it, if
            the block does not simulate.
        """
        with progress_bar(total, what) as report:
            self._report, self._reported = report, 0
            try:
                yield report
            finally:
                self._report = None

    @contextmanager
    def fraction(self, what: str) -> Iterator[Callable[[float], None]]:
        """Show a progress bar in percent; yield the function to call with the finished fraction.

        Calls of `simulate` in the block show no bar of their own.
        """
        with progress_bars([what]) as report:
            self._report, self._reported = (lambda done: None), 0
            try:
                yield lambda done: report(0, done)
            finally:
                self._report = None

    @contextmanager
    def fractions(self, names: Sequence[str]) -> Iterator[Callable[[int, float], None]]:
        """Show a bar in percent for each name; yield the function of number and fraction."""
        with progress_bars(names) as report:
            yield report

    def _run(
        self,
        machine: "Machine",
        measures: tuple[str, ...],
        cases: "Iterable[Case]",
        report: Callable[[int], None],
    ) -> "xr.Dataset":
        from wm_drake.batch import simulate_remembered
        from wm_drake.batch.cluster import run_on_cluster

        assert self.ledger is not None, "a study that runs cases is declared with has_runs=True"
        how: dict[str, Any] = {"workers": self.workers, "engine": self.engine, "progress": report}
        if self.client is not None:
            how["run"] = partial(run_on_cluster, client=self.client)
        table = simulate_remembered(machine, cases, self.ledger, measures=measures, **how)
        self.runs += table.sizes["run"]
        self.steps.add_table(table)
        return table
