"""Command `wm-drake study gasket`: effect of gasket stiffness and damping on tub and housing."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.cli.common import (
    JsonOption,
    MachineOption,
    OutOption,
    OverwriteOption,
    SetOption,
    cases_of,
    check_buildable,
    command_line,
    existing_file,
    load_parameters,
)
from wm_drake.cli.progress import progress_bar
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.study.common import (
    RUNS_KEPT,
    ProfileOption,
    ResumeOption,
    WorkersOption,
    study_ledger,
)
from wm_drake.cli.terminal import Console, say
from wm_drake.errors import InputError, Problem, input_error, nearest_names

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from collections.abc import Callable

    import xarray as xr

    from wm_drake.parameters import FactorLevels, MachineParameters
    from wm_drake.report.gasket.words import Words
    from wm_drake.simulation.cases import Case
    from wm_drake.studies.doe import Design
    from wm_drake.studies.gasket.screening import Screening
    from wm_drake.studies.gasket.study import GasketTrials

WIDE = 100
"""Width of a terminal from which on its table has the leading terms. [characters]"""

DEFAULT_OUT = Path("wm-drake-gasket")


def gasket(
    machine: MachineOption = "reference",
    load: Annotated[
        list[str] | None,
        typer.Option(
            help="Load of the machine, or load file. Repeatable. Default: middle and counter.",
            metavar="NAME|FILE",
        ),
    ] = None,
    design: Annotated[
        str,
        typer.Option(
            help="Design: d-optimal, orthogonal, full, or a CSV file with a column of -1, 0, 1 per "
            "factor."
        ),
    ] = "d-optimal",
    trials: Annotated[
        int | None,
        typer.Option(
            help="Number of trials. Default: 1000 for d-optimal. Allowed for orthogonal: 243 or "
            "729. A full design has all level combinations.",
            min=1,
            metavar="N",
        ),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            help="Effects to estimate: main (main effects) or main+2fi (with two-factor "
            "interactions)."
        ),
    ] = "main+2fi",
    seed: Annotated[int, typer.Option(help="Seed of the D-optimal design.", min=0)] = 0,
    factor: Annotated[
        list[str] | None,
        typer.Option(
            help="Factor to study instead of the eight factors of the gasket: one of C_L, K_Lx, "
            "..., or any key of the machine file. Bounds are in percent of its value, or numbers "
            "with a unit. Default: 50 %..150 %. Repeatable.",
            metavar="NAME|KEY[=LOW..HIGH]",
        ),
    ] = None,
    factors: Annotated[
        Path | None, typer.Option(help="YAML file of factors.", metavar="FILE")
    ] = None,
    response: Annotated[
        list[str] | None,
        typer.Option(
            help="What is measured of each run: D, F, M, gap, amplitude, critical_speed, "
            "power_mean, region_displacement, region_displacement_integrated, mounts, cabinet, "
            "mount_force_peak, mount_force_rms, mount_force_dynamic_rms, cabinet_force_peak, ..., "
            "or one number such as Dx, amplitude_Xr or mount_force_rms_springs.left. Repeatable. "
            "Default: D, F, M and gap.",
            metavar="NAME",
        ),
    ] = None,
    tables: Annotated[
        str,
        typer.Option(
            help="Treatment of a stiffness that is given as a table. linear: replace it by its "
            "slope at rest times the level. scaled: multiply its forces by the level."
        ),
    ] = "linear",
    profile: ProfileOption = None,
    workers: WorkersOption = None,
    cluster: Annotated[
        str | None,
        typer.Option(
            help="Run on a dask.distributed cluster with the scheduler at this address.",
            metavar="ADDRESS",
        ),
    ] = None,
    resume: ResumeOption = False,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Find how stiffness and damping of the gasket affect displacement, force and moment."""
    begin = time.perf_counter()
    from wm_drake.studies.gasket.screening import check_degrees_of_freedom

    parameters = load_parameters(machine, sets)
    levels = _factors(parameters, factor, factors, tables)
    plan = _design(design, levels, trials, model, seed)
    check_degrees_of_freedom(plan)
    cases = _loads(parameters, load, profile)
    middle = _at_middle(parameters, levels)
    check_buildable(machine, parameters)
    work = _work(middle, levels, cases, response or [])
    identity = _identity(work, plan)
    writer = Run("study gasket", overwrite, identity)
    with (
        _runner(middle, workers, cluster) as run,
        study_ledger(out, writer, identity, resume) as ledger,
    ):
        screening = _run(work, plan, partial(run, ledger=ledger))
        ledger.mark_finished()
        with result_folder(out, writer, RUNS_KEPT) as folder:
            _write(screening, work, folder, time.perf_counter() - begin)
    _print_result(screening, work, out, as_json, time.perf_counter() - begin)


def _factors(
    parameters: "MachineParameters", named: list[str] | None, file: Path | None, tables: str
) -> "tuple[FactorLevels, ...]":
    from wm_drake.parameters import GASKET_FACTORS, TABLES, factor_of_text, levels_of, load_factors

    if tables not in TABLES:
        raise input_error(
            f"unknown treatment '{tables}'{nearest_names(tables, TABLES)}", where="--tables"
        )
    known = load_factors(GASKET_FACTORS if file is None else existing_file(file, "--factors"))
    try:
        chosen = dict(factor_of_text(text, known) for text in named) if named else known
    except InputError as error:
        raise InputError(replace(p, where="--factor") for p in error.problems) from None
    if named and len(chosen) < len(named):
        raise input_error("a factor is given twice", where="--factor")
    try:
        return levels_of(parameters, chosen, tables)
    except InputError as error:
        origin = "--factor" if named else str(file) if file else ""
        raise InputError(
            replace(p, where=": ".join(filter(None, [origin, p.where]))) for p in error.problems
        ) from None


def _design(
    kind: str, levels: "Sequence[FactorLevels]", trials: int | None, model: str, seed: int
) -> "Design":
    from wm_drake.studies.doe import DESIGNS, MODELS, make_design, read_design

    names = tuple(factor.name for factor in levels)
    if model not in MODELS:
        raise input_error(f"unknown model '{model}'{nearest_names(model, MODELS)}", where="--model")
    if kind in DESIGNS:
        return make_design(kind, names, trials=trials, model=model, seed=seed)
    if not Path(kind).is_file():
        raise input_error(
            f"'{kind}' is neither a kind of design nor a file{nearest_names(kind, DESIGNS)}",
            where="--design",
        )
    if trials is not None:
        raise input_error(
            "not allowed with a design from a file, which has its own number of trials",
            where="--trials",
        )
    return read_design(Path(kind), names, model)


def _loads(
    parameters: "MachineParameters", loads: list[str] | None, profile: Path | None
) -> "list[Case]":
    from wm_drake.studies.gasket.study import LOADS

    default = [name for name in LOADS if name in parameters.loads]
    return cases_of(parameters, loads or default, gasket=True, profile=profile)


def _at_middle(
    parameters: "MachineParameters", levels: "Sequence[FactorLevels]"
) -> "MachineParameters":
    from wm_drake.parameters import at_levels

    return at_levels(parameters, levels, [0] * len(levels))


def _work(
    parameters: "MachineParameters",
    levels: "tuple[FactorLevels, ...]",
    cases: "list[Case]",
    responses: list[str],
) -> "GasketTrials":
    from wm_drake.studies.gasket.study import GasketTrials

    try:
        return GasketTrials(parameters, levels, cases, responses)
    except InputError as error:
        raise InputError(Problem("--response", "", p.message) for p in error.problems) from None


def _identity(work: "GasketTrials", plan: "Design") -> dict[str, str]:
    """Return the properties that distinguish this study from others, for its ledger."""
    from wm_drake.batch import sources_version
    from wm_drake.batch.ledger import key_of

    machine = work.parameters
    levels = key_of(levels=plan.levels, settings=[f.settings for f in work.factors])[:8]
    runs = key_of(
        numbers=machine.model_dump_json(exclude={"name", "about", "sources", "measured"})
    )[:8]
    loads = key_of(loads=[(case.load, case.profile) for case in work.loads])[:8]
    return {
        "study": "gasket",
        "machine": f"{machine.name} {runs}",
        "design": f"{plan.kind}, {plan.trials} trials, {levels}",
        "loads": f"{', '.join(case.name for case in work.loads)}, {loads}",
        "measures": ", ".join(work.measures),
        "sources": sources_version(),
    }


@contextmanager
def _runner(
    parameters: "MachineParameters", workers: int | None, cluster: str | None
) -> "Iterator[Callable[..., xr.Dataset]]":
    """Yield the function that runs cases: on the cores of this computer, or on a cluster."""
    from wm_drake.batch import simulate_remembered
    from wm_drake.batch.cluster import cluster_client, simulate_on_cluster
    from wm_drake.model.build import build_machine

    if cluster is None:
        yield partial(simulate_remembered, build_machine(parameters), workers=workers)
    else:
        with cluster_client(cluster) as client:
            yield partial(simulate_on_cluster, build_machine(parameters), client=client)


def _run(work: "GasketTrials", plan: "Design", run: "Callable[..., xr.Dataset]") -> "Screening":
    from wm_drake.studies.gasket.screening import run_screening

    with progress_bar(plan.trials * len(work.loads)) as progress:
        return run_screening(
            plan,
            lambda d: work.responses(
                d, lambda cases: run(cases, measures=work.measures, progress=progress)
            ),
        )


def _write(screening: "Screening", work: "GasketTrials", folder: Path, wall_s: float) -> None:
    from wm_drake.report.gasket.report import gasket_report
    from wm_drake.studies.gasket.tables import write_tables

    write_tables(screening, folder, work.factors)
    command = command_line()
    (folder / "report.html").write_text(
        gasket_report(screening, work, command, wall_s), encoding="utf-8"
    )


def _print_result(
    screening: "Screening", work: "GasketTrials", out: Path, as_json: bool, wall_s: float
) -> None:
    from wm_drake.report.gasket.findings import summary, warnings
    from wm_drake.report.gasket.words import Words
    from wm_drake.studies.gasket.tables import as_plain_data, to_json

    words = Words(work.factors, screening.responses.meanings)
    if as_json:
        typer.echo(to_json(as_plain_data(screening) | {"wall_s": wall_s}))
    else:
        _print_table(screening, words)
        say("\n".join(summary(screening, words)))
        say(f"Results in {out}: report.html and CSV tables")
    for text in warnings(screening, words):
        say(f"warning: {text}", err=True)
    for (trial, load), reason in screening.responses.failed.items():
        typer.echo(f"trial {trial + 1}, load {load}: {reason}", err=True)
    if screening.responses.failed:
        raise typer.Exit(1)


def _print_table(screening: "Screening", words: "Words") -> None:
    from rich.table import Table

    from wm_drake.report.gasket.tables import r2_text
    from wm_drake.studies.gasket.screening import leading_terms

    design = screening.design
    about = f"{design.kind}, {design.trials} trials, D-efficiency {design.efficiency():.2f} %"
    table = Table(title=f"Percent of the variance explained ({about})")
    for name in ("load", "response"):
        table.add_column(name)
    for name in ("mean", "main", "inter-\nactions", "resid-\nual", "pre-\ndicted\nR2"):
        table.add_column(name, justify="right")
    console = Console()
    is_wide = console.width >= WIDE
    if is_wide:
        table.add_column("leading terms, percent")
    for (load, name), found in screening.tables.items():
        leading = ", ".join(
            f"{term.name.replace(':', ' × ')} {term.percent:.0f}" for term in leading_terms(found)
        )
        percents = (found.main_percent, found.interaction_percent, found.residual_percent)
        mean = f"{found.constant:.3g} {screening.responses.units[name]}"
        texts = (load, words.response(name), mean, *(f"{value:.1f}" for value in percents))
        texts = (*texts, r2_text(found.predicted_r2), *([leading] if is_wide else []))
        table.add_row(*texts)
    console.print(table)
