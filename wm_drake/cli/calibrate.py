"""Command `wm-drake calibrate`: fit unknown numbers of a machine to measured amplitudes."""

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.cli.common import (
    JsonOption,
    MachineOption,
    OutOption,
    OverwriteOption,
    SetOption,
    check_buildable,
    command_line,
    existing_file,
    interruptible,
    load_parameters,
    pairs_of,
    warn_of_phase_error,
    with_measured,
)
from wm_drake.cli.progress import ProgressLines, has_bars
from wm_drake.cli.result_folder import LEDGER, Run, prepare_folder, result_folder
from wm_drake.cli.study.common import RUNS_KEPT
from wm_drake.cli.terminal import Console, say
from wm_drake.errors import InputError, input_error

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.parameters import MachineParameters
    from wm_drake.studies.calibration.calibration import Calibration, Plan
    from wm_drake.studies.calibration.fewer import Simpler
    from wm_drake.studies.calibration.prediction import Prediction
    from wm_drake.studies.calibration.targets import Targets
    from wm_drake.studies.description.modal import Modes
    from wm_drake.studies.spin.study import SpinResult

DEFAULT_OUT = Path("wm-drake-calibrate")


@dataclass(frozen=True)
class Found:
    """What the command has found: a calibration, predictions, and fits with fewer quantities."""

    calibration: "Calibration"
    predictions: "list[Prediction]"
    fewer: "list[Simpler]"


def calibrate(
    free: Annotated[
        Path,
        typer.Option(help="YAML file of the free quantities, bounds and priors.", metavar="FILE"),
    ],
    machine: MachineOption = "reference",
    targets: Annotated[
        list[Path] | None,
        typer.Option(
            help="Measured amplitudes, or other responses (docs/how-to/calibrate.md). Repeatable. "
            "Default: those of the machine file.",
            metavar="CSV",
        ),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            help="Search method: least-squares, basin-hopping (slower, searches more widely) or "
            "evolution.",
            metavar="NAME",
        ),
    ] = "least-squares",
    starts: Annotated[
        int, typer.Option(help="Number of searches, each with its own starting point.")
    ] = 8,
    iterations: Annotated[
        int,
        typer.Option(
            help="Largest number of iterations per search; 0: default of the method.", min=0
        ),
    ] = 0,
    seed: Annotated[int, typer.Option(help="Seed of the random starting points.", min=0)] = 0,
    deviation: Annotated[
        list[str] | None,
        typer.Option(
            help="Standard deviation of a measured amplitude, in percent (default: 5), or that of "
            "other responses by name or kind, such as Fx=8 or moment=15 (default: 10). Repeatable.",
            metavar="PERCENT|NAME=PERCENT",
        ),
    ] = None,
    resolution: Annotated[
        float, typer.Option(help="Step to which measured amplitudes are rounded, in mm.")
    ] = 0.1,
    weight: Annotated[
        list[str] | None,
        typer.Option(
            help="Weight of a load, a sensor, a response, a kind of response, or LOAD:NAME. "
            "Default: 1. Repeatable.",
            metavar="NAME=NUMBER",
        ),
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            help="Largest accepted difference of all amplitudes, in percent, or that of a load, a "
            "sensor, a response, a kind of response or LOAD:NAME, such as moment=50. A value "
            "beyond its limit costs much more. Repeatable.",
            metavar="PERCENT|NAME=PERCENT",
        ),
    ] = None,
    leave_out: Annotated[
        list[str] | None,
        typer.Option(
            help="Loads to hold out: calibrate without them, then predict them. Repeatable.",
            metavar="LOAD[,LOAD]",
        ),
    ] = None,
    fewer: Annotated[
        str | None,
        typer.Option(
            help="Fit again with fewer free quantities and show what that costs, such as 30,20,10. "
            "The others keep their expected values.",
            metavar="COUNT[,COUNT]",
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Number of threads. Default: number of cores.", min=1)
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue an interrupted calibration.")
    ] = False,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Fit unknown numbers of a machine to measured amplitudes, within bounds and with priors."""
    from wm_drake.studies.calibration.calibration import Plan

    groups, counts = _groups(leave_out), _counts(fewer)
    parameters = with_measured(load_parameters(machine, sets), targets, "--targets")
    amplitudes, responses = _deviations(deviation)
    wanted = _targets(parameters, responses).weighted(_weights(weight))
    try:
        wanted = wanted.limited(_fractions(limit, "--limit"))
    except InputError as error:
        raise InputError(replace(p, where="--limit", key="") for p in error.problems) from None
    check_buildable(machine, parameters)
    warn_of_phase_error(parameters)
    plan = Plan(method, starts, seed, iterations, amplitudes, 1e-3 * resolution)
    with interruptible(f"finished evaluations are kept in {out}; continue with --resume"):
        found, writer = _run(
            parameters, free, wanted, plan, groups, counts, out, workers, resume, overwrite
        )
    with result_folder(out, writer, RUNS_KEPT) as folder:
        _write(parameters, found, folder)
    if as_json:
        typer.echo(json.dumps(_as_json(found)))
    else:
        _print(found, out)


def _targets(parameters: "MachineParameters", deviations: dict[str, float]) -> "Targets":
    from wm_drake.parameters.measured import measured_amplitudes, measured_responses
    from wm_drake.studies.calibration.response_targets import with_deviations
    from wm_drake.studies.calibration.targets import targets_of

    if not parameters.measured:
        raise input_error(
            f"machine '{parameters.name}' names no measured amplitudes of its own; name a CSV file",
            where="--targets",
        )
    targets = targets_of(
        parameters,
        measured_amplitudes(parameters),
        ", ".join(Path(name).name for name in parameters.measured),
        measured_responses(parameters),
    )
    try:
        responses = with_deviations(targets.responses, deviations)
    except InputError as error:
        raise InputError(replace(p, where="--deviation", key="") for p in error.problems) from None
    return replace(targets, responses=responses)


def _deviations(entries: list[str] | None) -> tuple[float, dict[str, float]]:
    """Return the relative standard deviations of amplitudes, and of other responses by name."""
    from wm_drake.studies.calibration.calibration import RELATIVE_DEVIATION
    from wm_drake.studies.calibration.targets import AMPLITUDE

    responses = _fractions(entries, "--deviation")
    return responses.pop(AMPLITUDE, RELATIVE_DEVIATION), responses


def _fractions(entries: list[str] | None, option: str) -> dict[str, float]:
    """Return the numbers of NAME=PERCENT entries; one without a name is that of all amplitudes."""
    from wm_drake.studies.calibration.targets import AMPLITUDE

    named = [entry for entry in entries or [] if "=" in entry]
    plain = [entry for entry in entries or [] if "=" not in entry]
    if len(plain) > 1:
        raise input_error(
            f"{' and '.join(plain)} are given; one number without a name is allowed, that of the "
            "amplitudes",
            where=option,
        )
    entries = [*named, *(f"{AMPLITUDE}={entry}" for entry in plain)]
    return {
        name: percent / 100.0 for name, percent in _numbers(entries, option, zero=False).items()
    }


def _numbers(entries: list[str] | None, option: str, zero: bool = True) -> dict[str, float]:
    """Return the numbers of NAME=NUMBER entries, each finite and above 0, or 0 where allowed."""
    from wm_drake.parameters.units import plain_number

    numbers: dict[str, float] = {}
    for name, text in pairs_of(entries, option):
        try:
            number = plain_number(text)
        except ValueError as error:
            raise input_error(str(error), where=option, key=name) from None
        if not 0.0 <= number < math.inf or (number == 0.0 and not zero):
            allowed = ">= 0" if zero else "> 0"
            raise input_error(
                f"'{text}' is not allowed; must be {allowed} and finite", where=option, key=name
            )
        if name in numbers:
            raise input_error("is given twice", where=option, key=name)
        numbers[name] = number
    return numbers


def _weights(entries: list[str] | None) -> dict[str, float]:
    return _numbers(entries, "--weight")


def _groups(entries: list[str] | None) -> list[list[str]]:
    """Return the groups of loads that `--leave-out` names."""
    groups = [[name.strip() for name in entry.split(",")] for entry in entries or []]
    for names in groups:
        for name in names:
            if names.count(name) > 1:
                raise input_error(f"'{name}' is given twice", where="--leave-out")
    return groups


def _counts(entry: str | None) -> list[int]:
    """Return the numbers of free quantities that `--fewer` names."""
    texts = [text.strip() for text in entry.split(",")] if entry is not None else []
    for text in texts:
        if not (text.isascii() and text.isdigit() and len(text) < 6):
            raise input_error(
                f"'{text[:20]}' is not a whole number; write for example 30,20,10", where="--fewer"
            )
    return [int(text) for text in texts]


def _run(
    parameters: "MachineParameters",
    free: Path,
    targets: "Targets",
    plan: "Plan",
    held_out: list[list[str]],
    counts: list[int],
    out: Path,
    workers: int | None,
    resume: bool,
    overwrite: bool,
) -> "tuple[Found, Run]":
    """Run the calibration and what follows, with a ledger of evaluations in the folder `out`."""
    from wm_drake.batch.ledger import open_ledger
    from wm_drake.model.build import build_machine
    from wm_drake.parameters import located
    from wm_drake.parameters.free import load_free
    from wm_drake.studies.calibration.calibration import calibrate, identity_of
    from wm_drake.studies.calibration.fewer import check_counts, fit_with_fewer
    from wm_drake.studies.calibration.parameter_map import parameter_map_of
    from wm_drake.studies.calibration.prediction import check_held_out, predict

    free_file, built = load_free(existing_file(free, "--free")), build_machine(parameters)
    plan.check()
    check_held_out(targets, held_out)
    check_counts(counts, len(free_file.quantities))
    try:
        parameter_map_of(built, free_file)
    except InputError as error:
        raise located(error, free) from None
    identity = identity_of(built, free_file, targets, plan)
    asked = {"leave_out": "; ".join(map(",".join, held_out)), "fewer": ",".join(map(str, counts))}
    writer = Run("calibrate", overwrite, {**identity, **asked})
    prepare_folder(out, writer)
    with open_ledger(out / LEDGER, identity, resume=resume, replace=overwrite) as ledger:
        with _progress(plan.starts) as report:
            calibration = calibrate(
                built, free_file, targets, plan, ledger, workers=workers, report=report
            )
        with _progress(len(held_out) * plan.starts) as report:
            predictions = predict(
                built, free_file, calibration, held_out, ledger, workers=workers, report=report
            )
        fits = []
        if counts:
            with _progress(len(counts)) as report:
                fits = fit_with_fewer(
                    built, calibration, counts, ledger, workers=workers, report=report
                )
        ledger.mark_finished()
    return Found(calibration, predictions, fits), writer


@contextmanager
def _progress(searches: int) -> Iterator[Callable[[int, int, float], None]]:
    """Show a progress bar of the searches on standard error, and yield the function to update it.

    The bar shows the number of machines and the least cost of the current search.
    """
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.description}", markup=False),
        TimeElapsedColumn(),
    )
    console, lines = Console(stderr=True), ProgressLines()
    with Progress(
        *columns,
        TextColumn("remaining"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not has_bars(console),
    ) as bar:
        task = bar.add_task("search", total=searches)
        ended, last = 0, (0, 0)

        def report(start: int, evaluations: int, best: float) -> None:
            nonlocal ended, last
            if last[1] > evaluations or last[0] != start:  # another search has begun
                ended += 1
            last = start, evaluations
            text = f"{evaluations} machines, least cost {best:.1f}"
            bar.update(task, completed=ended, description=text)
            lines.show(f"search {ended + 1} of {searches}: {text}")

        yield report


def _write(parameters: "MachineParameters", found: Found, folder: Path) -> None:
    from wm_drake.parameters import machine_yaml
    from wm_drake.report.calibration.report import calibration_report
    from wm_drake.studies.calibration.fewer import fewer_table
    from wm_drake.studies.calibration.outcome import (
        amplitude_rows,
        quantity_table,
        response_table,
        solved_machine,
    )

    calibration = found.calibration
    for number, solution in enumerate(calibration.solutions, start=1):
        text = machine_yaml(solved_machine(calibration.parameter_map, solution, number))
        (folder / f"machine_{number}.yaml").write_text(text, encoding="utf-8")
    quantity_table(calibration).to_csv(folder / "quantities.csv", index=False, float_format="%.6g")
    amplitude_rows(calibration).to_csv(folder / "amplitudes.csv", index=False, float_format="%.4f")
    if calibration.targets.responses:
        table = response_table(calibration)
        table.to_csv(folder / "responses.csv", index=False, float_format="%.6g")
    if found.fewer:
        fewer_table(found.fewer).to_csv(folder / "fewer.csv", index=False, float_format="%.6g")
    best, modes = _shown(parameters, calibration)
    page = calibration_report(
        calibration, found.predictions, best, modes, command_line(), fewer=found.fewer
    )
    (folder / "report.html").write_text(page, encoding="utf-8")


def _shown(
    parameters: "MachineParameters", calibration: "Calibration"
) -> "tuple[SpinResult, list[tuple[str, Modes]]]":
    """Return spin runs and natural modes of the best solution, for the report."""
    from wm_drake.model.build import build_machine
    from wm_drake.simulation.cases import case_of
    from wm_drake.studies.calibration.outcome import solved_machine
    from wm_drake.studies.description.modal import natural_modes
    from wm_drake.studies.spin.study import run_spin

    solved = solved_machine(calibration.parameter_map, calibration.solutions[0])
    cases = [case_of(solved, name, gasket=gasket) for name, gasket in calibration.targets.loads]
    built = build_machine(solved)
    titles = (
        {False: "without gasket", True: "with gasket"} if parameters.gasket else {False: "modes"}
    )
    return run_spin(solved, cases), [
        (title, natural_modes(built, gasket=gasket)) for gasket, title in titles.items()
    ]


def _print(found: Found, out: Path) -> None:
    from wm_drake.studies.calibration.outcome import mean_and_largest, values_beyond

    calibration, predictions = found.calibration, found.predictions
    _print_values(calibration)
    best = calibration.solutions[0]
    mean, largest = mean_and_largest(best.errors(calibration.targets))
    say(
        f"Searches: {len(calibration.ended)}. Distinct good solutions: "
        f"{len(calibration.solutions)}."
    )
    say("Absolute differences of the amplitudes from the experiment:")
    say(f"  best solution: mean {100 * mean:.1f} %, largest {100 * largest:.1f} %")
    if calibration.targets.responses:
        mean, largest = mean_and_largest(best.response_errors(calibration.targets))
        say("Absolute differences of the other responses:")
        say(f"  best solution: mean {100 * mean:.1f} %, largest {100 * largest:.1f} %")
    for text in values_beyond(best, calibration.targets):
        say(f"  beyond its limit: {text}")
    for prediction in predictions:
        pairs = [
            mean_and_largest(errors)
            for errors in (prediction.calibrated, prediction.predicted, prediction.seen)
        ]
        calibrated, predicted, others = (
            f"mean {100 * mean:.1f} %, largest {100 * largest:.1f} %" for mean, largest in pairs
        )
        say(f"  load {', '.join(prediction.loads)}:")
        say(f"    used for the calibration: {calibrated}")
        say(f"    held out and predicted: {predicted}")
        say(f"    other loads in that calibration: {others}")
        covered = f"{100 * prediction.covered:.0f} %"
        say(f"    95 % intervals contain {covered} of the held-out amplitudes")
    if found.fewer:
        _print_fewer(found.fewer)
    say(f"Results in {out}: report.html, machine_<n>.yaml, quantities.csv, amplitudes.csv")


def _print_values(calibration: "Calibration") -> None:
    """Print the quantities of the best solution; the deviation is that given data and prior."""
    from rich.table import Table

    from wm_drake.studies.calibration.outcome import quantity_table

    table = Table(title="Best solution, machine_1.yaml")
    table.add_column("quantity", no_wrap=True)
    for head in ("value", "± deviation", "expected"):
        table.add_column(head, justify="right")
    for head in ("unit", "determined by"):
        table.add_column(head)
    for row in quantity_table(calibration).to_dict("records"):
        numbers = (f"{row[key]:.4g}" for key in ("value_1", "deviation_1", "expected"))
        table.add_row(str(row["quantity"]), *numbers, str(row["unit"]), str(row["held_by_1"]))
    Console().print(table)


def _print_fewer(fits: "list[Simpler]") -> None:
    from rich.table import Table

    from wm_drake.studies.calibration.fewer import fewer_table

    table = Table(title="Cost against number of free quantities")
    frame = fewer_table(fits).drop(columns="set_to_expected")
    for head in frame.columns:
        table.add_column(head.replace("_", " "), justify="right")
    for row in frame.itertuples(index=False):
        table.add_row(str(row[0]), *("–" if math.isnan(x) else f"{x:.3g}" for x in row[1:]))
    Console().print(table)


def _as_json(found: Found) -> dict[str, Any]:
    from wm_drake.studies.calibration.fewer import fewer_table
    from wm_drake.studies.calibration.outcome import mean_and_largest, quantity_table

    calibration, predictions = found.calibration, found.predictions

    def errors(values: Any) -> dict[str, float]:
        mean, largest = mean_and_largest(values)
        return {"mean_percent": 100 * mean, "largest_percent": 100 * largest}

    return {
        "searches": len(calibration.ended),
        "solutions": [
            {
                "start": s.start,
                "cost": s.cost,
                "data_cost": s.data_cost,
                **errors(s.errors(calibration.targets)),
                "other_responses": errors(s.response_errors(calibration.targets))
                if calibration.targets.responses
                else None,
            }
            for s in calibration.solutions
        ],
        "quantities": json.loads(quantity_table(calibration).to_json(orient="records")),
        "predictions": [
            {"loads": list(p.loads)}
            | {kind: errors(getattr(p, kind)) for kind in ("calibrated", "predicted", "seen")}
            | {"covered_percent": 100 * p.covered}
            for p in predictions
        ],
        "fewer": json.loads(fewer_table(found.fewer).to_json(orient="records")),
    }
