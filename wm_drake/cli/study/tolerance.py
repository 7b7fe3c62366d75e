"""Command `wm-drake study tolerance`: how machine and laundry scatter, and whether it touches."""

import time
from dataclasses import replace
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
    check_buildable,
    command_line,
    existing_file,
    load_parameters,
)
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
from wm_drake.errors import InputError

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.model.machine import Machine
    from wm_drake.parameters import MachineParameters
    from wm_drake.parameters.tolerances import Tolerances
    from wm_drake.studies.gasket.responses import Response
    from wm_drake.studies.tolerance.study import ToleranceResult
    from wm_drake.studies.tolerance.variables import UncertainMachine

DEFAULT_OUT = Path("wm-drake-tolerance")


def tolerance(
    file: Annotated[
        str,
        typer.Argument(
            help="Shipped tolerance file (laundry, heavy_laundry, laundry_and_parts), or a YAML "
            "file.",
            metavar="NAME|FILE",
        ),
    ] = "laundry",
    machine: MachineOption = "reference",
    samples: Annotated[
        int, typer.Option(help="Number of samples, a power of two.", min=16, metavar="N")
    ] = 4096,
    sensitivity: Annotated[
        int | None,
        typer.Option(
            help="Samples of the Sobol indices, a power of two; each needs one run more than there "
            "are quantities. 0 for none. Default: 512, or the samples if they are fewer.",
            min=0,
            metavar="N",
        ),
    ] = None,
    subset: Annotated[
        int,
        typer.Option(
            help="Runs of each level of the subset simulation, which estimates contact that is "
            "rarer than 1 in 1000. 0 for none.",
            min=0,
            metavar="N",
        ),
    ] = 1000,
    limits: Annotated[
        Path | None,
        typer.Option(
            help="YAML file of limits: quantity, at_least or at_most, allowed_share.",
            metavar="FILE",
        ),
    ] = None,
    response: Annotated[
        list[str] | None,
        typer.Option(
            help="What is measured of each run, as for study gasket. Repeatable. Default: D, F, M, "
            "gap, amplitude and mount_force_peak.",
            metavar="NAME",
        ),
    ] = None,
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
    """Find how often the tub touches, how far it moves, and which quantities decide that."""
    begin = time.perf_counter()
    from wm_drake.studies.tolerance.study import Settings, limits_of, run_tolerances

    several = min(512, samples) if sensitivity is None else sensitivity
    settings = Settings(samples, several, subset, seed)
    parameters = load_parameters(machine, sets)
    tolerances, wanted = _tolerances(file), _limits_file(limits)
    check_buildable(machine, parameters)
    built, uncertain = _uncertain(file, parameters, tolerances, profile)
    chosen, measures = _measures(uncertain, response)
    try:
        known = limits_of(wanted, chosen)
    except InputError as error:
        raise InputError(replace(p, where=str(limits)) for p in error.problems) from None
    identity = study_identity(
        "tolerance",
        uncertain.parameters,
        measures,
        seed,
        tolerances=tolerances,
        profile=uncertain.case.profile,
    )
    writer = Run("study tolerance", overwrite, identity)
    with study_ledger(out, writer, identity, resume) as ledger:
        with batch_runner(built, ledger, measures, workers, cluster) as batch:
            result = run_tolerances(uncertain, chosen, with_progress(batch), settings, known)
        ledger.mark_finished()
        with result_folder(out, writer, RUNS_KEPT) as folder:
            _write(result, tolerances, folder, time.perf_counter() - begin)
    _print_result(result, out, as_json, time.perf_counter() - begin)


def _tolerances(file: str) -> "Tolerances":
    from wm_drake.parameters.tolerances import load_tolerances

    return load_tolerances(file)


def _limits_file(path: Path | None) -> tuple:  # type: ignore[type-arg]
    from wm_drake.parameters.tolerances import load_limits

    return () if path is None else load_limits(existing_file(path, "--limits"))


def _uncertain(
    file: str, parameters: "MachineParameters", tolerances: "Tolerances", profile: Path | None
) -> "tuple[Machine, UncertainMachine]":
    """Return the built machine and its uncertain quantities, checked at their ends."""
    from wm_drake.engines.compiled.step_check import check_step
    from wm_drake.model.bodies import with_sdf_values
    from wm_drake.model.build import build_machine
    from wm_drake.parameters import load_profile
    from wm_drake.parameters.tolerances import check_load, tolerances_path
    from wm_drake.simulation.cases import Case
    from wm_drake.simulation.runs import checked_step
    from wm_drake.studies.tolerance.variables import uncertain_machine

    spin = (
        parameters.profile if profile is None else load_profile(existing_file(profile, "--profile"))
    )
    name = tolerances.load or "laundry"
    check_load(tolerances, parameters, tolerances_path(file))
    load = parameters.loads[name] if tolerances.load else next(iter(parameters.loads.values()))
    keys = [key for quantity in tolerances.quantities.values() for key in quantity.keys]
    with problems_of_file(tolerances_path(file)):
        full = with_sdf_values(build_machine(parameters).plant, parameters, keys)
        uncertain = uncertain_machine(full, tolerances, Case(name, load, spin))
        built = build_machine(uncertain.parameters)
        step = checked_step(uncertain.parameters, None)
        uncertain.check(lambda case: check_step(built.set_up(parameters=case.parameters), step))
    return built, uncertain


def _measures(
    uncertain: "UncertainMachine", names: list[str] | None
) -> "tuple[tuple[Response, ...], tuple[str, ...]]":
    """Return the responses and the measures of `simulate_many`."""
    from wm_drake.batch import MEASURES
    from wm_drake.studies.gasket.responses import chosen_responses, has_gap, measures_of
    from wm_drake.studies.tolerance.study import CONTACTS, DEFAULT

    parameters, is_default = uncertain.parameters, not names
    wanted = names or [n for n in DEFAULT if n != "gap" or has_gap(parameters)]
    try:
        chosen = chosen_responses(parameters, uncertain.case.profile, wanted)
    except InputError as error:
        raise InputError(replace(p, where="--response", key="") for p in error.problems) from None
    if not is_default and not any(r.name == "gap" for r in chosen) and has_gap(parameters):
        chosen += chosen_responses(parameters, uncertain.case.profile, ["gap"])
    measures = set(measures_of(parameters, chosen))
    measures |= {CONTACTS} if "gap" in measures else set()
    return chosen, tuple(name for name in MEASURES if name in measures)


def _write(
    result: "ToleranceResult", tolerances: "Tolerances", folder: Path, wall_s: float
) -> None:
    from wm_drake.report.tolerance.report import tolerance_report
    from wm_drake.studies.tolerance.tables import write_tables

    write_tables(result, folder)
    page = tolerance_report(result, tolerances.about, command_line(), wall_s)
    (folder / "report.html").write_text(page, encoding="utf-8")


def _print_result(result: "ToleranceResult", out: Path, as_json: bool, wall_s: float) -> None:
    from wm_drake.report.tolerance.words import summary, warnings
    from wm_drake.studies.gasket.tables import to_json
    from wm_drake.studies.tolerance.tables import as_plain_data

    if as_json:
        typer.echo(to_json(as_plain_data(result) | {"wall_s": wall_s}))
    else:
        _print_tables(result)
        say("\n".join(summary(result)))
        say(f"Results in {out}: report.html and CSV tables")
    for text in warnings(result):
        say(f"warning: {text}", err=True)
    if result.failed:
        raise typer.Exit(1)


def _print_tables(result: "ToleranceResult") -> None:
    from rich.table import Table

    from wm_drake.report.tolerance.words import measure_titles
    from wm_drake.studies.tolerance.tables import measures_table

    titles = measure_titles(result)
    table = Table(title=f"Measures of {result.settings.samples} samples")
    for name in ("measure", "unit", "5 %", "median", "95 %"):
        table.add_column(name, justify="left" if name in ("measure", "unit") else "right")
    for row in measures_table(result).to_dict("records"):
        table.add_row(
            *titles[str(row["measure"])], *(f"{row[p]:.4g}" for p in ("p5", "p50", "p95"))
        )
    Console().print(table)
    if result.verdicts:
        limits = Table(title="Limits")
        for name in ("quantity", "limit", "allowed", "share", "95 % interval", "verdict"):
            limits.add_column(name)
        for v in result.verdicts:
            side = "≥" if v.limit.at_least is not None else "≤"
            ends = f"{100 * v.broken.lower:.3g} to {100 * v.broken.upper:.3g} %"
            share = f"{100 * v.broken.estimate:.3g} %"
            cells = (v.limit.quantity, f"{side} {v.limit.text}", f"{100 * v.allowed:g} %", share)
            limits.add_row(*cells, ends, v.word)
        Console().print(limits)
