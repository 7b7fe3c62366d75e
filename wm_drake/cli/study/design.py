"""Command `wm-drake study design`: search designs of a machine and print their Pareto front."""

import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.cli.common import (
    JsonOption,
    MachineOption,
    OutOption,
    OverwriteOption,
    ProfileOption,
    SetOption,
    cases_of,
    check_buildable,
    command_line,
    load_parameters,
)
from wm_drake.cli.progress import progress_bar
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.study.common import (
    RUNS_KEPT,
    ClusterOption,
    ResumeOption,
    SeedOption,
    WorkersOption,
    batch_runner,
    problems_of_file,
    study_identity,
    study_ledger,
    with_progress,
)
from wm_drake.cli.terminal import Console, say
from wm_drake.errors import input_error, nearest_names

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    import xarray as xr

    from wm_drake.model.machine import Machine
    from wm_drake.parameters import MachineParameters
    from wm_drake.parameters.designs import DesignTask
    from wm_drake.simulation.cases import Case
    from wm_drake.simulation.records import Record
    from wm_drake.studies.pareto.envelopes import Envelopes
    from wm_drake.studies.pareto.problem import MachineDesigns
    from wm_drake.studies.pareto.robust import Promise
    from wm_drake.studies.pareto.study import ParetoFront

DEFAULT_OUT = Path("wm-drake-design")


def design(
    file: Annotated[
        str,
        typer.Argument(help="Shipped design file (gasket), or a YAML file.", metavar="NAME|FILE"),
    ] = "gasket",
    machine: MachineOption = "reference",
    evaluations: Annotated[
        int, typer.Option(help="Number of designs to evaluate.", min=4, metavar="N")
    ] = 2000,
    population: Annotated[
        int, typer.Option(help="Designs of a generation.", min=4, metavar="N")
    ] = 64,
    search: Annotated[
        str,
        typer.Option(
            help="genetic: NSGA-II, or NSGA-III for more than two objectives. surfaces: NSGA on "
            "response surfaces of the designs so far, which needs fewer designs.",
            metavar="NAME",
        ),
    ] = "genetic",
    profile: ProfileOption = None,
    seed: SeedOption = 0,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    resume: ResumeOption = False,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Find the designs of which no other is better in every objective."""
    begin = time.perf_counter()
    from wm_drake.parameters.designs import load_design
    from wm_drake.studies.pareto.search import check_search
    from wm_drake.studies.pareto.study import SEARCHES, run_designs

    if search not in SEARCHES:
        raise input_error(
            f"no search '{search}'{nearest_names(search, SEARCHES)}", where="--search"
        )
    check_search(evaluations, population)
    parameters, task = load_parameters(machine, sets), load_design(file)
    check_buildable(machine, parameters)
    built, designs = _designs(file, parameters, task, profile, seed)
    measures = _measures(designs)
    identity = study_identity("design", designs.parameters, measures, seed, design=task)
    writer = Run("study design", overwrite, identity)
    with study_ledger(out, writer, identity, resume) as ledger:
        with batch_runner(built, ledger, measures, workers, cluster) as batch:
            with progress_bar(evaluations * designs.scenarios) as progress:
                front = run_designs(
                    designs,
                    _counted(batch, progress),
                    evaluations=evaluations,
                    population=population,
                    seed=seed,
                    search=search,
                )
            kept = _promises(front, batch, seed)
        ledger.mark_finished()
        shown = _envelopes(front, built, workers)
        with result_folder(out, writer, RUNS_KEPT) as folder:
            _write(front, shown, kept, task, folder, time.perf_counter() - begin)
    _print_result(front, kept, out, as_json, time.perf_counter() - begin)


def _promises(
    front: "ParetoFront",
    batch: "Callable[[Iterable[Case], Callable[[int], None]], xr.Dataset]",
    seed: int,
) -> "list[Promise]":
    """Return the check of a robust front on fresh samples."""
    from wm_drake.studies.pareto.robust import promises

    return promises(front, lambda cases: with_progress(batch)(cases, "fresh samples"), seed)


def _envelopes(front: "ParetoFront", built: "Machine", workers: int | None) -> "Envelopes | None":
    """Return the envelopes of the designs of a front, run again with their histories."""
    from wm_drake.batch import RunResult, simulate_many
    from wm_drake.studies.pareto.envelopes import front_envelopes

    if not len(front.objectives):
        return None

    def histories(cases: "Sequence[Case]", found: "Callable[[int, Record], None]") -> None:
        def collect(run: RunResult) -> None:
            assert run.record is not None
            found(run.number, run.record)

        with progress_bar(len(cases), "envelopes of the front") as progress:
            simulate_many(
                built,
                cases,
                measures=("extremes",),
                histories=True,
                workers=workers,
                progress=progress,
                finished=collect,
            )

    return front_envelopes(front, histories)


def _counted(
    batch: "Callable[[Iterable[Case], Callable[[int], None]], xr.Dataset]",
    progress: Callable[[int], None],
) -> "Callable[[Iterable[Case]], xr.Dataset]":
    """Return the function that runs cases, which counts the runs of all its calls."""
    before = 0

    def run(cases: "Iterable[Case]") -> "xr.Dataset":
        nonlocal before
        table = batch(cases, lambda done: progress(before + done))
        before += table.sizes["run"]
        return table

    return run


def _designs(
    file: str,
    parameters: "MachineParameters",
    task: "DesignTask",
    profile: Path | None,
    seed: int,
) -> "tuple[Machine, MachineDesigns]":
    """Return the built machine and its designs."""
    from wm_drake.model.bodies import with_sdf_values
    from wm_drake.model.build import build_machine
    from wm_drake.parameters.designs import check_loads, design_path
    from wm_drake.parameters.tolerances import check_load, load_tolerances, tolerances_path
    from wm_drake.studies.pareto.problem import machine_designs
    from wm_drake.studies.tolerance.distributions import base_samples
    from wm_drake.studies.tolerance.variables import uncertain_machine

    tolerances_name = task.robust.tolerances if task.robust else ""
    tolerances = load_tolerances(tolerances_name) if task.robust else None
    keys = [key for variable in task.variables.values() for key in variable.keys]
    keys += [
        k for choice in task.choices.values() for values in choice.options.values() for k in values
    ]
    keys += [goal.quantity for goal in task.objectives]
    keys += [goal.quantity for goal in task.constraints]
    if tolerances:
        keys += [key for quantity in tolerances.quantities.values() for key in quantity.keys]
    with problems_of_file(design_path(file)):
        own = [key for key in keys if key.startswith(("frames.", "bodies."))]
        full = with_sdf_values(build_machine(parameters).plant, parameters, own)
        if tolerances is None:
            check_loads(task, full)
            cases = cases_of(full, list(task.loads), gasket=True, profile=profile)
            return build_machine(full), machine_designs(full, task, cases)
        check_load(tolerances, full, tolerances_path(tolerances_name))
        load = tolerances.load or next(iter(full.loads))
        (case,) = cases_of(full, [load], gasket=True, profile=profile)

        def scattered(changed: "MachineParameters") -> "object":
            return uncertain_machine(changed, tolerances, case)

        uncertain = scattered(full)
        assert task.robust is not None
        scores, _ = base_samples(uncertain.joint.size, task.robust.samples, seed)  # type: ignore[attr-defined]
        designs = machine_designs(full, task, [case], scattered, scores)  # type: ignore[arg-type]
        return build_machine(uncertain.parameters), designs  # type: ignore[attr-defined]


def _measures(designs: "MachineDesigns") -> tuple[str, ...]:
    from wm_drake.batch import MEASURES

    needed = {response.measure for response in designs.responses} or {"extremes"}
    return tuple(name for name in MEASURES if name in needed)


def _write(
    front: "ParetoFront",
    shown: "Envelopes | None",
    kept: "list[Promise]",
    task: "DesignTask",
    folder: Path,
    wall_s: float,
) -> None:
    from wm_drake.report.pareto.report import pareto_report
    from wm_drake.studies.pareto.tables import write_tables

    write_tables(front, kept, folder)
    page = pareto_report(front, shown, kept, task.about, command_line(), wall_s)
    (folder / "report.html").write_text(page, encoding="utf-8")


def _print_result(
    front: "ParetoFront", kept: "list[Promise]", out: Path, as_json: bool, wall_s: float
) -> None:
    from rich.table import Table

    from wm_drake.report.pareto.report import summary
    from wm_drake.studies.gasket.tables import to_json
    from wm_drake.studies.pareto.tables import as_plain_data, front_table

    if as_json:
        typer.echo(to_json(as_plain_data(front, kept) | {"wall_s": wall_s}))
        return
    rows = front_table(front)
    table = Table(title="Chosen designs of the front")
    table.add_column("quantity")
    for name in front.chosen:
        table.add_column(name, justify="right")
    for column in rows.columns:
        cells = [rows[column].iloc[number] for number in front.chosen.values()]
        texts = [f"{cell:.4g}" if isinstance(cell, float) else str(cell) for cell in cells]
        table.add_row(str(column), *texts)
    Console().print(table)
    say(summary(front, kept))
    say(f"Results in {out}: report.html, front.csv, machine files")
