"""`wm-drake identify`: the numbers of a component from measured loops."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.cli.common import (
    JsonOption,
    MachineOption,
    OutOption,
    OverwriteOption,
    SetOption,
    command_line,
    interruptible,
    pairs_of,
)
from wm_drake.cli.components import (
    ArmOption,
    AxisOption,
    ComponentOption,
    DamperCommand,
    NameOption,
    Target,
    axes_of,
    existing_files,
    quantities_of,
    target_of,
)
from wm_drake.cli.progress import progress_bar
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.terminal import Console
from wm_drake.errors import input_error, nearest_names

if TYPE_CHECKING:
    from wm_drake.parameters.units import Unit
    from wm_drake.rigs.measured import MeasuredMotion
    from wm_drake.studies.fitting import Fit
    from wm_drake.studies.identification import ComponentModel, Judgement

app = typer.Typer(help="Find the numbers of a component from measured loops.", no_args_is_help=True)

DEFAULT_OUT = Path("wm-drake-identify")
PER_CENT = 100

FilesArgument = Annotated[
    list[Path], typer.Argument(help="CSV files: time, displacement, force.", metavar="FILES...")
]
MethodOption = Annotated[
    str,
    typer.Option("--method", help="least-squares, response-surface or evolution.", metavar="NAME"),
]
BoundsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--bounds",
        help="Of an unknown: sponge_stiffness='(50, 300) N/mm'. Repeatable.",
        metavar="KEY=RANGE",
    ),
]
FixOption = Annotated[
    list[str] | None,
    typer.Option(
        "--fix",
        help="A number that is known: slider_damping='0.4 N s/mm'. Repeatable.",
        metavar="KEY=VALUE",
    ),
]
UnitsOption = Annotated[
    str | None,
    typer.Option(
        "--units",
        help="Of time, displacement, force, where files do not say: 's,mm,N'.",
        metavar="UNITS",
    ),
]
KnotsOption = Annotated[
    int, typer.Option("--knots", help="Points of a table on each side of zero.", min=1, max=12)
]
SeedOption = Annotated[int, typer.Option("--seed", help="Of the search.", min=0)]


@dataclass(frozen=True)
class _Asked:
    """Options that all three commands have."""

    files: list[Path]
    units: str | None
    method: str
    seed: int
    out: Path
    overwrite: bool
    as_json: bool
    sets: list[str] | None


@app.command("damper", cls=DamperCommand)
def identify_damper(
    files: FilesArgument,
    law: Annotated[
        str | None,
        typer.Option(help="{laws}; the component's by default."),
    ] = None,
    method: MethodOption = "least-squares",
    bounds: BoundsOption = None,
    fix: FixOption = None,
    units: UnitsOption = None,
    knots: KnotsOption = 5,
    seed: SeedOption = 0,
    machine: MachineOption = "reference",
    name: NameOption = None,
    component: ComponentOption = None,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Identify a friction damper; a curve of its law is found as a monotone table."""
    from wm_drake.studies.identification import damper_model

    target = target_of("damper", machine, name, component, sets)
    own = str(target.component.parameters.law)  # type: ignore[union-attr]
    asked = _Asked(files, units, method, seed, out, overwrite, as_json, sets)
    motions = _motions(asked, rotates=False)
    ranges = _ranges(bounds)
    kept = _kept_fields(target, law or own, ranges)
    model = damper_model(law or own, motions, ranges, _single(fix, "--fix"), knots, kept)
    _run(asked, f"damper {target.component.name}, law {model.law}", target, model, motions, {})


def _axis_command(kind: str) -> Callable[..., None]:
    """Return the command of a component that is tested axis by axis: bushing or gasket."""

    def identify_axis(
        files: FilesArgument,
        axis: AxisOption,
        law: Annotated[
            str, typer.Option(help="voigt, table (monotone curve) or, about an axis, voigt_havsin.")
        ] = "voigt",
        arm: ArmOption = None,
        method: MethodOption = "least-squares",
        bounds: BoundsOption = None,
        fix: FixOption = None,
        units: UnitsOption = None,
        knots: KnotsOption = 5,
        seed: SeedOption = 0,
        machine: MachineOption = "reference",
        name: NameOption = None,
        component: ComponentOption = None,
        out: OutOption = DEFAULT_OUT,
        overwrite: OverwriteOption = False,
        as_json: JsonOption = False,
        sets: SetOption = None,
    ) -> None:
        from wm_drake.parameters.units import Unit
        from wm_drake.studies.identification import bushing_model

        target = target_of(kind, machine, name, component, sets)
        asked = _Asked(files, units, method, seed, out, overwrite, as_json, sets)
        axes = axes_of(axis)
        radius = quantities_of(arm, Unit("m", "mm"), "--arm")[0] if arm else 0.0
        motions = _motions(asked, rotates=axes[0].startswith("about") and not radius)
        model = bushing_model(
            law,
            motions,
            target.component.parameters,  # type: ignore[arg-type]
            axes[0],
            arm=radius,
            bounds=_ranges(bounds),
            fixed=_single(fix, "--fix"),
            knots=knots,
        )
        title = f"{target.component.name}, {axis.replace('_', ' ')}, law {law}"
        _run(asked, title, target, model, motions, _copies(model, axes))

    return identify_axis


app.command("bushing", help="One axis of a six-component bushing.")(_axis_command("bushing"))
app.command("gasket", help="One axis of the gasket.")(_axis_command("gasket"))


def _copies(model: "ComponentModel", axes: tuple[str, ...]) -> dict[str, str]:
    """Return the fields of a bushing's other axes, and the field that each is copied from."""
    ours, others = axes[0][-1], [other[-1] for other in axes[1:]]
    names = [*(unknown.name for unknown in model.unknowns), *model.fixed]
    fields = list(dict.fromkeys(name.split(".")[0] for name in names))
    return {f"{field[: -len(ours)]}{other}": field for field in fields for other in others}


def _motions(asked: _Asked, *, rotates: bool) -> "list[MeasuredMotion]":
    """Return the loops of the files, with the motion of each."""
    from wm_drake.errors import InputError, Problem
    from wm_drake.parameters import read_loops
    from wm_drake.rigs.measured import measured_motion
    from wm_drake.studies.fitting import METHODS

    if asked.method not in METHODS:
        raise input_error(
            f"no method '{asked.method}'{nearest_names(asked.method, METHODS)}", where="--method"
        )
    units = None
    if asked.units is not None:
        parts = [part.strip() for part in asked.units.split(",")]
        if len(parts) != 3:
            raise input_error(
                f"'{asked.units}' is not three units; write for example 's,mm,N'", where="--units"
            )
        units = (parts[0], parts[1], parts[2])
    loops = read_loops(existing_files(asked.files), units)
    if loops[0].rotates != rotates:
        holds, needs = ("angles and moments", "displacements and forces")[
            :: 1 if loops[0].rotates else -1
        ]
        raise input_error(f"holds {holds}, needs {needs} (or --arm)", where=loops[0].path)
    motions, problems = [], list[Problem]()
    for loop in loops:
        try:
            motions.append(measured_motion(loop))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return sorted(motions, key=lambda measured: measured.order)


def _kept_fields(
    target: Target, law: str, bounds: "dict[str, tuple[float, float]]"
) -> dict[str, float]:
    """Return the numbers of a component of the same law that are not unknown and have no bounds."""
    from wm_drake.parameters import DAMPER_LAWS, quantities

    parameters = target.component.parameters
    if law not in DAMPER_LAWS or getattr(parameters, "law", None) != law:
        return {}
    free = {*DAMPER_LAWS[law].unknowns, *bounds}
    return {
        key: value for key, value, _ in quantities(parameters) if "." not in key and key not in free
    }


def _ranges(entries: list[str] | None) -> dict[str, tuple[float, float]]:
    found = {}
    for key, text in pairs_of(entries, "--bounds"):
        values = quantities_of(text, _unit_of_field(key, "--bounds"), "--bounds")
        if len(values) != 2:
            raise input_error(
                f"'{text}' is not a range; write for example '(50, 300) N/mm'",
                where="--bounds",
                key=key,
            )
        found[key] = (values[0], values[1])
    return found


def _single(entries: list[str] | None, option: str) -> dict[str, float]:
    return {
        key: quantities_of(text, _unit_of_field(key, option), option)[0]
        for key, text in pairs_of(entries, option)
    }


def _unit_of_field(key: str, option: str) -> "Unit":
    """Return the unit of a component's field, or of a rise of one of its tables."""
    from wm_drake.studies.identification.models import unit_of_field, units_of_fields

    unit = unit_of_field(key)
    if unit is None:
        raise input_error(
            f"unknown number '{key}'{nearest_names(key, units_of_fields())}", where=option
        )
    return unit


def _run(
    asked: _Asked,
    title: str,
    target: Target,
    model: "ComponentModel",
    motions: "list[MeasuredMotion]",
    copies: dict[str, str],
) -> None:
    from wm_drake.report.identify.report import (
        errors_table,
        estimates_table,
        fitted_loops,
        fixed_numbers,
        identify_report,
    )
    from wm_drake.report.rig.figures import force_scale
    from wm_drake.studies.fitting import identify
    from wm_drake.studies.identification import fit_problem, fragment, judge

    writer = Run("identify", asked.overwrite)
    with interruptible(), result_folder(asked.out, writer) as folder:
        with progress_bar(PER_CENT, "identify") as bar:
            fit = identify(
                fit_problem(model, motions),
                asked.method,
                seed=asked.seed,
                progress=lambda fraction, least: bar(int(PER_CENT * fraction)),
            )
        judgement = judge(fit, motions)
        text = fragment(
            fit,
            model,
            target.component,
            target.machine,
            target.key,
            copies,
            asked.out,
            judgement.sentences,
            dict(pairs_of(asked.sets, "--set")),
        )
        (folder / "identified.yaml").write_text(text, encoding="utf-8")
        estimates_table(fit, model.fixed).to_csv(folder / "parameters.csv", index=False)
        errors_table(fit, motions, judgement).to_csv(folder / "errors.csv", index=False)
        fitted_loops(fit, motions).to_csv(folder / "loops.csv", index=False, float_format="%.7g")
        found = {
            **fit.as_dict(),
            "fixed": fixed_numbers(model.fixed),
            "judgement": judgement.as_dict(),
        }
        (folder / "fit.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
        command = command_line()
        (folder / "report.html").write_text(
            identify_report(title, fit, motions, judgement, model.fixed, command),
            encoding="utf-8",
        )
    if asked.as_json:
        typer.echo(json.dumps({"component": title, **found}))
    else:
        _print(
            title, fit, judgement, force_scale(motions[0].loop.rotates)[1], model.fixed, asked.out
        )


def _print(
    title: str,
    fit: "Fit",
    judgement: "Judgement",
    unit: str,
    fixed: Mapping[str, float],
    out: Path,
) -> None:
    from rich.table import Table

    from wm_drake.report.identify.report import estimate_cells, undetermined_sentences

    console = Console()
    for sentence in judgement.sentences:
        console.print(sentence, highlight=False)
    table = Table(title=f"{title}: RMSE {fit.rmse:.4g} {unit} by {fit.method}")
    table.add_column("unknown", no_wrap=True)
    for head in ("value", "95 % interval", "unit", "remark"):
        table.add_column(head)
    for cells in estimate_cells(fit, fixed):
        table.add_row(*cells)
    console.print(table)
    for sentence in (*undetermined_sentences(fit), *fit.notes):
        console.print(sentence, highlight=False)
    console.print(
        f"Results in {out}: report.html, identified.yaml, parameters.csv, errors.csv, loops.csv, "
        "fit.json"
    )
