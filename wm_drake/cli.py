"""The command `wm-drake`. No physics and no statistics here: it reads, calls a study, and writes what comes back."""

import json
import logging
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.errors import InputError, Problem, WmDrakeError, input_error, nearest_names
from wm_drake.outputs import result_folder

if TYPE_CHECKING:  # Drake takes a second to import, and --help should not
    from wm_drake.parameters import MachineParameters
    from wm_drake.simulation import Case
    from wm_drake.studies.spin import CaseResult, SpinResult

app = typer.Typer(
    help="Dynamics of front-loading washing machines.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
machine_app = typer.Typer(help="Look at machine files.", no_args_is_help=True)
app.add_typer(machine_app, name="machine")

DEFAULT_OUT = Path("wm-drake-spin")

MachineOption = Annotated[str, typer.Option("--machine", help="Shipped machine or machine file.", metavar="NAME|FILE")]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", help="Change a number: gasket.stiffness_x='5 N/mm'. Repeatable.", metavar="KEY=VALUE"),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output and nothing else there.")]


def main() -> None:
    """Runs the command; the user's mistakes end it with their message and exit code 2."""
    try:
        app()
    except WmDrakeError as error:
        typer.echo(str(error), err=True)
        sys.exit(2)


@machine_app.command("check")
def machine_check(file: Annotated[str, typer.Argument(metavar="NAME|FILE")]) -> None:
    """Check a machine file: exit 0, or 2 with one line per problem."""
    parameters = _load(file, None)
    _check_buildable(file, parameters)
    typer.echo(f"{file}: machine '{parameters.name}' is in order")


@machine_app.command("show")
def machine_show(
    file: Annotated[str, typer.Argument(metavar="[NAME|FILE]")] = "reference",
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Show a machine resolved in SI: bodies, elements, preloads, equilibrium, natural frequencies."""
    from wm_drake.machine import build_machine
    from wm_drake.studies.description import as_text, describe

    parameters = _load(file, sets)
    with _located(file):
        description = describe(build_machine(parameters))
    typer.echo(json.dumps(description, indent=1) if as_json else as_text(description))


@app.command()
def spin(
    machine: MachineOption = "reference",
    load: Annotated[
        list[str] | None,
        typer.Option(
            help="Load of the machine, or load file. Repeatable; all of the machine's by default.", metavar="NAME|FILE"
        ),
    ] = None,
    no_gasket: Annotated[bool, typer.Option("--no-gasket", help="Take the gasket out.")] = False,
    profile: Annotated[Path | None, typer.Option(help="Spin profile, YAML or CSV (time_s,speed_rpm).", metavar="FILE")] = None,
    engine: Annotated[str | None, typer.Option(help="Engine that integrates the motion.", metavar="NAME")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.", metavar="DIR")] = DEFAULT_OUT,
    replay: Annotated[bool, typer.Option("--replay", help="Also write 3D replays around the largest motion.")] = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Run the drum up through the resonances, and report how the tub moves."""
    from wm_drake.simulation import DEFAULT_ENGINE, ENGINES

    engine = engine or DEFAULT_ENGINE
    if engine not in ENGINES:
        raise input_error(f"no engine '{engine}'{nearest_names(engine, ENGINES)}", where="--engine")
    parameters = _load(machine, sets)
    cases = _cases(parameters, load, not no_gasket, profile)
    _check_buildable(machine, parameters)
    try:
        with result_folder(out) as folder:
            result = _run(parameters, cases, engine)
            _write(result, folder, replay)
    except KeyboardInterrupt:
        typer.echo("interrupted; nothing was written", err=True)
        raise typer.Exit(130) from None
    diverged = [f"{r.case.name}: {r.record.attrs['diverged']}" for r in result.results if r.record.attrs["diverged"]]
    if as_json:
        typer.echo(json.dumps(_as_json(result)))
    else:
        _print_tables(result, out)
    for message in diverged:
        typer.echo(message, err=True)
    if diverged:
        raise typer.Exit(1)


@contextmanager
def _located(file: str) -> Iterator[None]:
    """Adds file and line to problems that show only once the machine is built."""
    from wm_drake.parameters import located, machine_path

    try:
        yield
    except InputError as error:
        raise located(error, machine_path(file)) from None


def _load(file: str, sets: list[str] | None) -> "MachineParameters":
    from wm_drake.parameters import load_machine, with_value

    parameters = load_machine(file)
    for entry in sets or []:
        key, separator, value = entry.partition("=")
        if not separator:
            raise input_error(f"'{entry}' is not KEY=VALUE", where="--set")
        try:
            changed = with_value(parameters, key.strip(), value.strip())
        except InputError as error:
            raise InputError(Problem("--set", p.key, p.message) for p in error.problems) from None
        parameters = changed.model_copy(update={"sources": {**changed.sources, key.strip(): "set on the command line"}})
    return parameters


def _cases(parameters: "MachineParameters", loads: list[str] | None, gasket: bool, profile: Path | None) -> "list[Case]":
    from wm_drake.parameters import load_load, load_profile
    from wm_drake.simulation import Case

    spin_profile = parameters.profile if profile is None else load_profile(_existing(profile, "--profile"))
    cases = []
    for name in loads or list(parameters.loads):
        if name in parameters.loads:
            cases.append(Case(name, parameters.loads[name], spin_profile, gasket))
        elif Path(name).is_file():
            cases.append(Case(Path(name).stem, load_load(Path(name)), spin_profile, gasket))
        else:
            hint = nearest_names(name, parameters.loads)
            raise input_error(f"'{name}' is neither a load of machine '{parameters.name}' nor a file{hint}", where="--load")
    names = [case.name for case in cases]
    for name in names:
        if names.count(name) > 1:
            raise input_error(f"'{name}' is asked for twice; record_{name}.nc can hold one", where="--load")
    return cases


def _existing(path: Path, option: str) -> Path:
    if not path.is_file():
        raise input_error(f"no such file '{path}'", where=option)
    return path


def _check_buildable(file: str, parameters: "MachineParameters") -> None:
    """Finds the faults that show only in the built machine."""
    from wm_drake.machine import build_machine
    from wm_drake.parameters import measured_amplitudes

    with _located(file):
        measured_amplitudes(parameters)
        build_machine(parameters).set_up()


def _run(parameters: "MachineParameters", cases: "list[Case]", engine: str) -> "SpinResult":
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from wm_drake.studies.spin import run_spin

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        tasks = [bar.add_task(case.name, total=1.0) for case in cases]
        return run_spin(parameters, cases, engine, progress=lambda i, fraction: bar.update(tasks[i], completed=fraction))


def _write(result: "SpinResult", folder: Path, replay: bool) -> None:
    from wm_drake.report.spin_report import amplitude_table, spin_report
    from wm_drake.simulation import save_record

    for case in result.results:
        save_record(case.record, folder / f"record_{case.case.name}.nc")
        if replay:
            (folder / f"replay_{case.case.name}.html").write_text(_replay(result, case), encoding="utf-8")
    amplitude_table(result).to_csv(folder / "amplitudes.csv", index=False, float_format="%.4f")
    command = shlex.join(["wm-drake", *sys.argv[1:]])
    (folder / "report.html").write_text(spin_report(result, command), encoding="utf-8")


def _replay(result: "SpinResult", case: "CaseResult") -> str:
    from wm_drake.measures import largest_motion
    from wm_drake.scene import replay_page

    logging.getLogger("drake").setLevel(logging.WARNING)  # Meshcat would tell of its server
    time, positions = largest_motion(case.record)
    return replay_page(result.parameters, time, positions)


def _print_tables(result: "SpinResult", out: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    from wm_drake.parameters.units import Unit
    from wm_drake.report.spin_report import amplitude_table

    table = Table(title=f"Amplitudes in mm, machine '{result.parameters.name}'")
    amplitudes = amplitude_table(result)
    for name in amplitudes.columns:
        table.add_column(str(name), justify="left" if name in ("load", "gasket", "source") else "right", overflow="fold")
    for row in amplitudes.itertuples(index=False):
        table.add_row(*(f"{value:.1f}" if isinstance(value, float) else str(value) for value in row))
    millimetre = Unit("m", "mm")
    console = Console()
    console.print(table)
    for case in result.results:
        gap = case.measures.smallest_gap
        if gap:
            console.print(
                f"{case.case.name}: smallest gap {millimetre.from_si(gap.distance):.1f} mm at {gap.time:.2f} s, "
                f"{gap.moving} to {gap.fixed}"
            )
    console.print(f"Results in {out}: report.html, amplitudes.csv, record_<load>.nc")


def _as_json(result: "SpinResult") -> dict[str, Any]:
    return {
        "machine": result.parameters.name,
        "engine": result.engine,
        "cases": [_case_as_json(case) for case in result.results],
    }


def _case_as_json(case: "CaseResult") -> dict[str, Any]:
    from wm_drake.parameters.units import Unit

    measures = case.measures
    millimetre = Unit("m", "mm")

    def numbers(values: Any, unit: Unit, prefix: str = "") -> dict[str, float | None]:
        labels = [f"{prefix}{label}" for label in values[values.dims[0]].values]
        shown = [unit.from_si(float(value)) if value == value else None for value in values.values]  # JSON has no NaN
        return dict(zip(labels, shown, strict=True))

    return {
        "load": case.case.name,
        "gasket": case.record.attrs["gasket"] == "yes",
        "amplitudes_mm": numbers(measures.amplitude, millimetre),
        "detergent_box_mm": numbers(measures.detergent_displacement, millimetre, "D"),
        "gasket_force_N": numbers(measures.gasket_force, Unit("N", "N"), "F"),
        "gasket_moment_Nm": numbers(measures.gasket_moment, Unit("N*m", "N*m"), "M"),
        "smallest_gap_mm": millimetre.from_si(measures.smallest_gap.distance) if measures.smallest_gap else None,
        "critical_rpm": numbers(measures.critical_speed, Unit("rad/s", "rpm")),
        "diverged": case.record.attrs["diverged"] or None,
        "wall_s": case.wall_s,
    }
