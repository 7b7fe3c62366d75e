"""Run any study: from checked input to a result folder, with a ledger of finished runs."""

import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import ValidationError

from wm_drake.engines import DEFAULT_ENGINE
from wm_drake.errors import InputError, InputNotice, Problem, check_known, input_error
from wm_drake.report.provenance import command_line
from wm_drake.report.terminal import QUIET, say
from wm_drake.studies.blocks import blocks_of
from wm_drake.studies.executor import Executor
from wm_drake.studies.facts import PAGE, Facts
from wm_drake.studies.inputs import (
    build_checked,
    changed_parameters,
    friction_warnings,
    load_parameters,
    machine_warnings,
)
from wm_drake.studies.result_folder import (
    FIGURES,
    LEDGER,
    RUN_FILE,
    CommandRun,
    FigureFiles,
    check_folders,
    check_is_folder,
    prepare_folder,
    result_folder,
)
from wm_drake.studies.study import (
    ENGINE,
    STUDIES,
    OptionModel,
    Study,
    option,
)
from wm_drake.written_files import check_new

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.batch.ledger import Ledger
    from wm_drake.model.machine import Machine
    from wm_drake.parameters import MachineParameters
    from wm_drake.studies.answer import Answer
    from wm_drake.studies.archive import Archived

RUNS_KEPT = (
    "all runs are kept, so repeat the command to write the results without running them again"
)
"""What is kept if the results of a study cannot be written."""


class RunOptions(OptionModel):
    """Options of the driver for every study.

    Attributes:
        out: Folder; None writes nothing.
    """

    out: Path | None = option(None, "Folder for the results.", "DIR")
    overwrite: bool = option(
        False, "Replace the results of an earlier run of this command in the folder."
    )
    figures: Path | None = option(
        None,
        "Write each picture of the page to this folder as PDF, SVG and PNG, with its data as CSV.",
        "DIR",
    )
    figure_columns: int = option(
        2, "Columns of a journal that a picture takes: 1 (85 mm) or 2 (175 mm).", "N", ge=1, le=2
    )
    figure_text: bool = option(
        False, "Keep the texts of SVG files as text, which other programs can edit."
    )
    archive: Path | None = option(
        None,
        "Write one file that reproduces the study: machine, SDF, options, input files, tables, "
        "ledger; 'wm-drake rerun FILE' runs it again and compares.",
        "FILE.zip",
    )
    quick: bool = option(False, "Small sizes for a first look, where no other option sets them.")
    units: Literal["si", "us"] = option(
        "si", "Units of page, tables and files: si (mm, N, kg), or us (in, lbf, lb).", "NAME"
    )


class LedgerOptions(RunOptions):
    """Options of the driver for studies with a ledger."""

    workers: int | None = option(None, "Number of cores. Default: all.", "N", ge=1)
    resume: bool = option(False, "Continue an unfinished study in the same folder.")


class ClusterOptions(LedgerOptions):
    """Options of the driver for studies that run cases by `Executor.simulate`."""

    cluster: str | None = option(
        None, "Run on a dask.distributed cluster with the scheduler at this address.", "ADDRESS"
    )
    engine: str = ENGINE


class StudyInterrupted(KeyboardInterrupt):
    """Ctrl-C was pressed during a study; the text says what is kept."""


@dataclass(frozen=True)
class Order:
    """A study with all its options.

    Attributes:
        command: Command line or Python call.
        parameters: Machines in place of files, by their names in `options.machine`.
    """

    study: Study
    options: OptionModel
    run: RunOptions
    command: str = field(default_factory=command_line)
    parameters: "Mapping[str, MachineParameters]" = field(default_factory=dict)

    @property
    def machines(self) -> tuple[str, ...]:
        """Names or files of the machines that the driver builds."""
        chosen: Any = getattr(self.options, "machine", ()) if self.study.has_machine else ()
        return (chosen,) if isinstance(chosen, str) else chosen


def run_study(name: str, machine: Any = None, *, quiet: bool = False, **options: Any) -> "Answer":
    """Run a study and return its result.

    Args:
        name: Name of the study, such as "drive".
        machine: Name of a shipped machine, machine file, or parameters; a list of them for a study
            that compares machines. Default: that of the study.
        quiet: Whether progress and warnings are not printed.
        options: Options of the command by their Python name, such as `samples=256`. With `out`, the
            result folder is written as by the command; without it, nothing is written.

    Raises:
        InputError: an option or the machine is wrong.

    Example:
        >>> import wm_drake as wm
        >>> result = wm.run_study("drive", load=["middle"], quick=True, quiet=True)
        >>> list(result.tables())
        ['map', 'thresholds']
    """
    study = STUDIES.find(name)
    several = machine if isinstance(machine, (list, tuple)) else [machine]
    loaded = {m.name: m for m in several if not isinstance(m, (str, Path, type(None)))}
    if machine is not None:
        names = [str(m) if isinstance(m, (str, Path)) else m.name for m in several]
        options["machine"] = names[0] if machine is several[0] else names
    shown = ", ".join([repr(name), *(f"{key}={value!r}" for key, value in options.items())])
    order = replace(order_of(study, options, f"wm_drake.run_study({shown})"), parameters=loaded)
    token = QUIET.set(quiet or QUIET.get())
    try:
        return execute(order)[0]
    finally:
        QUIET.reset(token)


def order_of(study: Study, given: Mapping[str, Any], command: str = "") -> Order:
    """Return a study with options by their Python names, checked.

    Args:
        given: Options of the study and of the driver that the user has set.
        command: Command line or Python call.
    """
    model = options_of_driver(study)
    running = {name: value for name, value in given.items() if name in model.model_fields}
    others = {name: value for name, value in given.items() if name not in running}
    if running.get("figures") and not running.get("out"):
        raise input_error("needs a folder of results too (out)", where="figures")
    if isinstance(others.get("machine"), Path):
        others["machine"] = str(others["machine"])
    sizes = study.quick if running.get("quick") else {}
    try:
        return Order(study, study.all_options(**{**sizes, **others}), model(**running), command)
    except ValidationError as error:
        raise input_error_of(error) from None


def input_error_of(error: ValidationError) -> InputError:
    """Return the problems of options with wrong values."""
    return InputError(
        Problem("", ".".join(map(str, fault["loc"])), fault["msg"]) for fault in error.errors()
    )


def options_of_driver(study: Study) -> type[RunOptions]:
    """Return the model of the options that the driver has for a study."""
    if not study.has_runs:
        return RunOptions
    return ClusterOptions if study.has_cluster else LedgerOptions


def execute(order: Order) -> tuple["Answer", Facts, tuple[str, ...]]:
    """Run a study.

    Returns:
        Answer, how it was computed, and the names of the files that were written.

    Raises:
        InputError: the input is wrong, or the folder must not or cannot be written to.
        StudyInterrupted: Ctrl-C was pressed.
    """
    from wm_drake.parameters.reading import read_in

    with read_in(order.run.units):
        return _executed(order)


def _executed(order: Order) -> tuple["Answer", Facts, tuple[str, ...]]:
    begin, study, options = time.perf_counter(), order.study, order.options
    archive, replaces = order.run.archive, order.run.overwrite
    check_new(filter(None, [archive]), replace=replaces)
    machines = tuple(_machine_of(order, name) for name in order.machines)
    machine = machines[0] if len(machines) == 1 else None
    given = getattr(options, "profile", None)
    profile = given if isinstance(given, Path) else None
    engine = _engine(order.run)
    about_machines = _warnings(machines, partial(machine_warnings, profile=profile))
    for text in about_machines:
        say(f"warning: {text}", err=True)
    task = study.begin(options, *machines)
    begun = [block.begin(task) for block in blocks_of(study.command)]
    run = CommandRun(
        study.folder_owner,
        order.run.overwrite,
        _identity(order, machines, task.identity) if study.has_runs and machines else {},
        order.command,
        options.model_dump(mode="json"),
    )
    with _figures_of(order.run), _notices_once(), _executor(order, run) as executor:
        result = task.run(executor)
        for extend in filter(None, begun):
            result = extend(executor, result)
        if executor.ledger is not None:
            executor.ledger.mark_finished()
        step, integrator = _stepping(machine)
        not_converged = (executor.steps.warning,) if executor.steps.unconverged else ()
        for text in not_converged:
            say(f"warning: {text}", err=True)
        result = _marked(result, executor)
        wall_s = time.perf_counter() - begin
        warned = (*about_machines, *_warnings(machines, friction_warnings), *not_converged)
        steps = executor.steps.text
        facts = Facts(order.command, wall_s, warned, step, integrator, steps, executor.runs, engine)
        files = _written(result, facts, order.run.out, run)
    if archive is not None:
        from wm_drake.studies.archive import write_archive  # most studies have none

        ledger = None if order.run.out is None else order.run.out / LEDGER
        write_archive(archive, _archived(order), result, ledger, replace=replaces)
    return result, facts, files


def _archived(order: Order) -> "Archived":
    """Return the study for its archive, with the machines before `--set`."""
    from wm_drake.parameters import load_machine
    from wm_drake.studies.archive import NOT_AGAIN, Archived

    return Archived(
        order.study.command,
        order.command,
        {n: order.parameters.get(n) or load_machine(n) for n in order.machines},
        order.options.model_dump(exclude={"machine"} if order.study.has_machine else None),
        sorted(order.options.model_fields_set),
        order.run.model_dump(mode="json", exclude=set(NOT_AGAIN)),
    )


def _marked(result: "Answer", executor: Executor) -> "Answer":
    """Return a result that names its runs that are not converged."""
    if not executor.steps.unconverged:
        return result
    from wm_drake.studies.not_converged import marked

    return marked(result, executor.steps)


def _machine_of(order: Order, name: str) -> "Machine":
    """Return a built machine of a study by its name or file, changed and checked."""
    adapt, sets = order.study.adapt, getattr(order.options, "sets", ())
    try:
        if name in order.parameters:
            adapted = adapt(order.parameters[name], order.options)
            parameters = changed_parameters(adapted, sets)
        else:
            parameters = load_parameters(name, sets, lambda machine: adapt(machine, order.options))
    except InputError as error:
        if len(order.machines) == 1:
            raise
        raise InputError(
            replace(p, where=f"--set in machine '{name}'") if p.where == "--set" else p
            for p in error.problems
        ) from None
    return build_checked(name, parameters, batch=isinstance(order.run, LedgerOptions))


def _engine(options: RunOptions) -> str:
    """Return the engine of the runs that the driver has for a study, after checking it."""
    if not isinstance(options, ClusterOptions):
        return DEFAULT_ENGINE if isinstance(options, LedgerOptions) else ""
    from wm_drake.simulation.runs import ENGINES

    engine = options.engine
    check_known(engine, ENGINES, f"unknown engine '{engine}'", where="--engine")
    return engine


def _warnings(
    machines: "Sequence[Machine]", of_machine: "Callable[[MachineParameters], Sequence[str]]"
) -> tuple[str, ...]:
    """Return warnings of machines; of several ones with their names."""
    return tuple(
        text if len(machines) == 1 else f"{machine.parameters.name}: {text}"
        for machine in machines
        for text in of_machine(machine.parameters)
    )


def _stepping(machine: "Machine | None") -> tuple[float, str]:
    """Return step size and integrator of a machine; (0, "") without one. [s]"""
    from wm_drake.simulation.steps import checked_integrator, checked_step

    if machine is None:
        return 0.0, ""
    return checked_step(machine.parameters, None), checked_integrator(machine.parameters, None)


def _written(result: "Answer", facts: Facts, out: Path | None, run: CommandRun) -> tuple[str, ...]:
    if out is None:
        return ()
    with result_folder(out, run, RUNS_KEPT if run.identity else "") as folder:
        result.save(folder, facts)
        names = sorted(path.name for path in folder.iterdir())
    return (PAGE, *(name for name in names if name != PAGE))


def machine_text(parameters: "MachineParameters") -> str:
    """Return name and hash of the numbers and bodies of a machine, for the identity of a study."""
    from wm_drake.batch.ledger import key_of
    from wm_drake.batch.remembered import model_version

    words = {"name", "about", "sources", "measured", "published", "model"}
    numbers = parameters.model_dump_json(exclude=words)
    return f"{parameters.name} {key_of(numbers=numbers, model=model_version(parameters))[:8]}"


def _identity(
    order: Order, machines: "Sequence[Machine]", parts: Mapping[str, Any]
) -> dict[str, str]:
    """Return the properties that distinguish a study from others, for its ledger."""
    from wm_drake.batch import sources_version
    from wm_drake.batch.ledger import key_of

    return {
        "study": order.study.name,
        "engine": _engine(order.run),
        "machine": ", ".join(machine_text(machine.parameters) for machine in machines),
        **{
            name: part if isinstance(part, str) else key_of(part=part)[:8]
            for name, part in parts.items()
        },
        "sources": sources_version(),
    }


@contextmanager
def _notices_once() -> Iterator[None]:
    """Show a notice once, not for each batch of runs."""
    with warnings.catch_warnings():
        warnings.simplefilter("default", InputNotice)
        yield


@contextmanager
def _figures_of(options: RunOptions) -> Iterator[None]:
    """Make `result_folder` write the pictures of pages to the folder of `--figures`."""
    folder, columns, has_text = options.figures, options.figure_columns, options.figure_text
    token = FIGURES.set(FigureFiles(folder, columns, has_text) if folder else None)
    try:
        yield
    finally:
        FIGURES.reset(token)


@contextmanager
def _executor(order: Order, run: CommandRun) -> Iterator[Executor]:
    """Yield what runs the cases of a study, with an open ledger if the study has runs.

    Raises:
        StudyInterrupted: Ctrl-C was pressed in the block.
    """
    chosen, kept = order.run, "nothing was written"
    try:
        if not isinstance(chosen, LedgerOptions):
            if chosen.out is not None:
                check_folders(chosen.out, run)
            yield Executor(out=chosen.out)
            return
        with ExitStack() as stack:
            client = None
            if isinstance(chosen, ClusterOptions) and chosen.cluster is not None:
                from wm_drake.batch.cluster import cluster_client

                client = stack.enter_context(cluster_client(chosen.cluster))
            ledger = stack.enter_context(_ledger(chosen, run))
            try:
                yield Executor(ledger, chosen.workers, client, chosen.out, _engine(chosen))
            finally:
                if chosen.out is not None and len(ledger):
                    go_on = "repeat the command" if chosen.resume else "continue with --resume"
                    kept = f"{len(ledger)} finished runs are kept in {ledger.path}; {go_on}"
    except KeyboardInterrupt:
        raise StudyInterrupted(f"interrupted; {kept}") from None


@contextmanager
def _ledger(chosen: LedgerOptions, run: CommandRun) -> "Iterator[Ledger]":
    """Open the ledger of a study in its folder, or in a temporary one if nothing is written.

    If no run finished and no result was written, this function removes what it created: the ledger,
    and the folder if it was not there.
    """
    from wm_drake.batch.ledger import open_ledger

    if chosen.out is None:
        with (
            tempfile.TemporaryDirectory() as folder,
            open_ledger(Path(folder) / LEDGER, dict(run.identity)) as ledger,
        ):
            yield ledger
        return
    out, kept = chosen.out, 0
    check_is_folder(out)
    created, earlier = not out.exists(), set(out.glob(f"{LEDGER}*"))
    prepare_folder(out, run)
    options = {"resume": chosen.resume, "replace": run.overwrite}
    try:
        with open_ledger(out / LEDGER, run.identity, **options) as ledger:
            try:
                yield ledger
            finally:
                kept = len(ledger)
    finally:
        if not kept and not (out / RUN_FILE).exists():
            for path in set(out.glob(f"{LEDGER}*")) - earlier:
                path.unlink()
            if created and not any(out.iterdir()):
                out.rmdir()
