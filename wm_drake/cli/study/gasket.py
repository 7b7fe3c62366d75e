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
    ProfileOption,
    SetOption,
    cases_of,
    check_buildable,
    command_line,
    existing_file,
    load_parameters,
    pairs_of,
)
from wm_drake.cli.progress import progress_bar
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.study.common import (
    RUNS_KEPT,
    ClusterOption,
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
    from wm_drake.studies.doe.anova import AnovaTable
    from wm_drake.studies.gasket.beside import Beside
    from wm_drake.studies.gasket.check import Check, Setting
    from wm_drake.studies.gasket.published import Published
    from wm_drake.studies.gasket.screening import Label, Screening
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
            "feet, smallest_foot_load, slide_margin, turn_margin, tilt_margin, "
            "or one number such as Dx, amplitude_Xr or mount_force_rms_springs.left. Repeatable. "
            "Default: D, F, M and gap.",
            metavar="NAME",
        ),
    ] = None,
    tables: Annotated[
        str,
        typer.Option(
            help="Treatment of a stiffness that is given as a table. scaled: multiply its forces "
            "by the level, so that level 0 is the machine. linear: replace it by its slope at rest "
            "times the level, as in [B]. The page shows how much both differ at level 0."
        ),
    ] = "scaled",
    published: Annotated[
        list[Path] | None,
        typer.Option(
            help="Published results to compare with: load, response, term, percent, effects. "
            "Repeatable. Default: those of the machine file, for its own numbers, loads and "
            "profile and the factors of [B].",
            metavar="CSV",
        ),
    ] = None,
    check: Annotated[
        list[str] | None,
        typer.Option(
            help="Run this setting of the factors too and compare it with the fitted model: "
            "'C_L=0.5 N*s/mm, K_Lx=120 %'. Other factors are at their middle level. Repeatable; "
            "the page gives the text for the setting of its sliders.",
            metavar="NAME=VALUE,...",
        ),
    ] = None,
    profile: ProfileOption = None,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    resume: ResumeOption = False,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Find how stiffness and damping of the gasket affect displacement, force and moment."""
    begin = time.perf_counter()
    from wm_drake.parameters import TABLES
    from wm_drake.studies.gasket.beside import Beside
    from wm_drake.studies.gasket.level_zero import run_level_zero
    from wm_drake.studies.gasket.screening import check_degrees_of_freedom

    parameters = _with_published(load_parameters(machine, sets), published)
    levels = _factors(parameters, factor, factors, tables)
    settings = [_setting(parameters, levels, text) for text in check or []]
    plan = _design(design, levels, trials, model, seed)
    check_degrees_of_freedom(plan)
    cases = _loads(parameters, load, profile)
    middle = _at_middle(parameters, levels)
    check_buildable(machine, parameters)
    work = _work(middle, levels, cases, response or [])
    every = {name: _factors(parameters, factor, factors, name) for name in TABLES}
    compared = [] if sets or factor or factors else _as_measured(parameters, cases)
    known = _published(parameters, work, [c.name for c in cases] if published else compared)
    identity = _identity(work, plan)
    writer = Run("study gasket", overwrite, identity)
    with (
        _runner(workers, cluster) as run,
        study_ledger(out, writer, identity, resume) as ledger,
    ):
        screening = _run(work, plan, partial(run, middle, ledger=ledger))
        zero = run_level_zero(
            parameters,
            every,
            tables,
            cases,
            work.chosen,
            lambda built, some: run(built, some, measures=work.measures, ledger=ledger),
        )
        checked = _check(screening, work, settings, partial(run, middle, ledger=ledger))
        ledger.mark_finished()
        beside = Beside(known, zero, checked)
        with result_folder(out, writer, RUNS_KEPT) as folder:
            _write(screening, work, beside, folder, time.perf_counter() - begin)
    _print_result(screening, work, beside, out, as_json, time.perf_counter() - begin)


def _setting(
    parameters: "MachineParameters", levels: "tuple[FactorLevels, ...]", text: str
) -> "Setting":
    """Return the setting of the factors that an option `--check` means."""
    from wm_drake.parameters import place_of
    from wm_drake.studies.gasket.check import Setting

    places = {factor.name: 0.0 for factor in levels}
    by_name = {factor.name: factor for factor in levels}
    for name, value in pairs_of(text.split(","), "--check"):
        if name not in by_name:
            raise input_error(
                f"unknown factor '{name}'{nearest_names(name, by_name)}", where="--check"
            )
        try:
            places[name] = place_of(parameters, by_name[name], value)
        except InputError as error:
            raise InputError(replace(p, where="--check") for p in error.problems) from None
    return Setting(text, tuple(places.values()))


def _check(
    screening: "Screening",
    work: "GasketTrials",
    settings: "list[Setting]",
    run: "Callable[..., xr.Dataset]",
) -> "Check | None":
    """Run the settings of `--check` and return them beside the fitted model."""
    from wm_drake.studies.gasket.check import run_check
    from wm_drake.studies.gasket.surface import surfaces

    if not settings:
        return None
    return run_check(
        work, settings, surfaces(screening), lambda cases: run(cases, measures=work.measures)
    )


def _print_check(check: "Check") -> None:
    """Print prediction and run of each setting of `--check`."""
    from rich.table import Table

    table = Table(title="Fitted model and runs of --check")
    for name in ("setting", "load", "response"):
        table.add_column(name)
    for name in ("predicted", "± 95 %", "run", "inside"):
        table.add_column(name, justify="right")
    for row in check.frame().to_dict("records"):
        numbers = (f"{row[name]:.4g}" for name in ("predicted", "half_width", "run"))
        inside = "yes" if row["is_inside"] else "no"
        response = f"{row['response']}, {row['unit']}"
        table.add_row(str(row["setting"]), str(row["load"]), response, *numbers, inside)
    Console().print(table)


def _with_published(
    parameters: "MachineParameters", files: list[Path] | None
) -> "MachineParameters":
    """Return the machine with other files of published results, if any are given."""
    if not files:
        return parameters
    paths = tuple(str(existing_file(path, "--published").resolve()) for path in files)
    return parameters.model_copy(update={"published": paths})


def _as_measured(parameters: "MachineParameters", cases: "list[Case]") -> list[str]:
    """Return the names of the loads that a machine file may compare with published results."""
    from wm_drake.simulation.cases import is_as_measured

    return [case.name for case in cases if is_as_measured(parameters, case)]


def _published(
    parameters: "MachineParameters", work: "GasketTrials", loads: list[str]
) -> "Published":
    """Return the published results of some loads."""
    from wm_drake.parameters import published_results
    from wm_drake.studies.gasket.published import published_beside

    labels = [(load, response.name) for load in loads for response in work.chosen]
    names = ", ".join(Path(path).name for path in parameters.published)
    return published_beside(published_results(parameters.published), labels, names)


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
        numbers=machine.model_dump_json(
            exclude={"name", "about", "sources", "measured", "published"}
        )
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
def _runner(workers: int | None, cluster: str | None) -> "Iterator[Callable[..., xr.Dataset]]":
    """Yield the function that builds a machine and runs cases: on this computer or a cluster."""
    from wm_drake.batch import simulate_remembered
    from wm_drake.batch.cluster import cluster_client, simulate_on_cluster
    from wm_drake.model.build import build_machine

    if cluster is None:
        yield lambda built, cases, **options: simulate_remembered(
            build_machine(built), cases, workers=workers, **options
        )
    else:
        with cluster_client(cluster) as client:
            yield lambda built, cases, **options: simulate_on_cluster(
                build_machine(built), cases, client=client, **options
            )


def _run(work: "GasketTrials", plan: "Design", run: "Callable[..., xr.Dataset]") -> "Screening":
    from wm_drake.studies.gasket.screening import run_screening

    with progress_bar(plan.trials * len(work.loads)) as progress:
        return run_screening(
            plan,
            lambda d: work.responses(
                d, lambda cases: run(cases, measures=work.measures, progress=progress)
            ),
        )


def _write(
    screening: "Screening", work: "GasketTrials", beside: "Beside", folder: Path, wall_s: float
) -> None:
    from wm_drake.report.gasket.report import gasket_report
    from wm_drake.studies.gasket.tables import write_tables

    write_tables(screening, folder, work.factors, beside)
    command = command_line()
    (folder / "report.html").write_text(
        gasket_report(screening, work, command, wall_s, beside), encoding="utf-8"
    )


def _print_result(
    screening: "Screening",
    work: "GasketTrials",
    beside: "Beside",
    out: Path,
    as_json: bool,
    wall_s: float,
) -> None:
    from wm_drake.report.gasket.findings import summary, warnings
    from wm_drake.report.gasket.words import Words
    from wm_drake.studies.gasket.tables import as_plain_data, to_json

    words = Words(work.factors, screening.responses.meanings)
    if as_json:
        typer.echo(to_json(as_plain_data(screening, beside) | {"wall_s": wall_s}))
    else:
        _print_table(screening, words, beside.published)
        if beside.check is not None:
            _print_check(beside.check)
        say("\n".join(summary(screening, words, beside)))
        say(f"Results in {out}: report.html and CSV tables")
    for text in warnings(screening, words):
        say(f"warning: {text}", err=True)
    for (trial, load), reason in screening.responses.failed.items():
        typer.echo(f"trial {trial + 1}, load {load}: {reason}", err=True)
    if screening.responses.failed:
        raise typer.Exit(1)


def _print_table(screening: "Screening", words: "Words", published: "Published") -> None:
    from rich.table import Table

    from wm_drake.report.gasket.tables import published_cells, r2_text

    design, has_means = screening.design, published.has_means
    about = f"{design.kind}, {design.trials} trials, D-efficiency {design.efficiency():.2f} %"
    table = Table(title=f"Percent of the variance explained ({about})")
    for name in ("load", "response"):
        table.add_column(name)
    means = ("mean", "pub-\nlished\nmean", "differ-\nence") if has_means else ("mean",)
    for name in (*means, "main", "inter-\nactions", "resid-\nual", "pre-\ndicted\nR2"):
        table.add_column(name, justify="right")
    console = Console()
    is_wide = console.width >= WIDE
    if is_wide:
        table.add_column("leading terms, percent")
    for (load, name), found in screening.tables.items():
        leading = ", ".join(_leading_texts(found, published, (load, name)))
        percents = (found.main_percent, found.interaction_percent, found.residual_percent)
        mean = f"{found.constant:.3g} {screening.responses.units[name]}"
        known = published_cells(screening, published, (load, name)) if has_means else ()
        texts = (load, words.response(name), mean, *known, *(f"{v:.1f}" for v in percents))
        texts = (*texts, r2_text(found.predicted_r2), *([leading] if is_wide else []))
        table.add_row(*texts)
    console.print(table)
    if published.has_terms:
        console.print("In parentheses: the published percentage of a leading term.")


def _leading_texts(table: "AnovaTable", published: "Published", label: "Label") -> list[str]:
    """Return the leading terms of a response with their percentages, and the published ones."""
    from wm_drake.studies.gasket.screening import leading_terms

    texts = []
    for term in leading_terms(table):
        known = published.percent(label, term)
        beside = "" if known is None else f" ({known:.0f})"
        texts.append(f"{term.name.replace(':', ' × ')} {term.percent:.0f}{beside}")
    return texts
