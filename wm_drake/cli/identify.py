"""`wm-drake identify`: the numbers of a component from measured loops."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.cli.channels import LOOP_WORDS, channels_of
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
    ComponentOption,
    JigMassOption,
    NameOption,
    OuterMassOption,
    Target,
    ValidatingCommand,
    axes_of,
    existing_files,
    quantities_of,
    target_of,
)
from wm_drake.cli.figures import writes_pages
from wm_drake.cli.progress import progress_bar
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.table2 import identify_table2
from wm_drake.cli.terminal import Console, say
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
OptionalAxisOption = Annotated[
    str | None,
    typer.Option(
        "--axis",
        help="radial, axial, tilt, twist; or x, y, z, about_x, about_y, about_z.",
        metavar="AXIS",
    ),
]
StaticOption = Annotated[
    bool,
    typer.Option(
        "--static",
        help="Quasi-static tests, to the end and back: table and hysteresis of each axis. Files "
        "are AXIS=FILE, or all of one --axis.",
    ),
]
ValidateOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--validate",
        help="Files that no fit sees: their loops are predicted. Takes all names that follow it.",
        metavar="FILES...",
    ),
]
CutoffOption = Annotated[
    str | None,
    typer.Option(
        "--cutoff",
        help="Take each motion as recorded, smoothed so that this frequency is halved: '50 Hz'.",
        metavar="FREQUENCY",
    ),
]
ChannelsOption = Annotated[
    str | None,
    typer.Option(
        "--channels",
        help="Names in the files: 'displacement=Pos 1,force=Load' (also time, angle, moment).",
        metavar="WORD=NAME,...",
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
    validate: list[Path] = field(default_factory=list)
    cutoff: str | None = None
    channels: str | None = None
    driven_mass: float = 0.0


@app.command("damper", cls=ValidatingCommand)
@writes_pages
def identify_damper(
    files: FilesArgument,
    law: Annotated[
        str | None,
        typer.Option(help="{laws}; the component's by default. Several: mstv,stv."),
    ] = None,
    validate: ValidateOption = None,
    method: MethodOption = "least-squares",
    bounds: BoundsOption = None,
    fix: FixOption = None,
    units: UnitsOption = None,
    cutoff: CutoffOption = None,
    channels: ChannelsOption = None,
    knots: KnotsOption = 5,
    seed: SeedOption = 0,
    machine: MachineOption = "reference",
    name: NameOption = None,
    component: ComponentOption = None,
    sponge_mass: Annotated[
        str | None,
        typer.Option(help="Mass of the sponge on the bench, under sines, e.g. '10 g'."),
    ] = None,
    outer_mass: OuterMassOption = None,
    jig_mass: JigMassOption = None,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Identify a friction damper; a curve of its law is found as a monotone table.

    Several laws are fitted to the same files and compared. Forces of inertia of masses at the
    driven end are printed and taken out of the measured ones.
    """
    from wm_drake.studies.identification import damper_model

    target = target_of("damper", machine, name, component, sets)
    own = str(target.component.parameters.law)  # type: ignore[union-attr]
    sponge, outer, jig = (
        _mass(text, option)
        for text, option in (
            (sponge_mass, "--sponge-mass"),
            (outer_mass, "--outer-mass"),
            (jig_mass, "--jig-mass"),
        )
    )
    common = (files, units, method, seed, out, overwrite, as_json, sets)
    asked = _Asked(*common, validate or [], cutoff, channels, outer + jig)
    laws, ranges, fixed = _laws(law or own, ""), _ranges(bounds), _single(fix, "--fix")
    motions = _motions(asked, asked.files, rotates=False)
    models = {
        one: damper_model(one, motions, *given, knots, _kept_fields(target, one, given[0]), sponge)
        for one, given in _given_by_law(laws, ranges, fixed, "").items()
    }
    parts = [f"damper {target.component.name}"]
    parts += [f"sponge of {1e3 * sponge:g} g"] if sponge else []
    parts += [f"less the inertia of {outer + jig:g} kg at the driven end"] if outer + jig else []
    _run_all(asked, ", ".join(parts), target, models, motions, {})


def _mass(text: str | None, option: str) -> float:
    """Return the mass of an option, 0 without it. [kg]"""
    from wm_drake.parameters.units import Unit

    if text is None:
        return 0.0
    mass = quantities_of(text, Unit("kg", "kg"), option)[0]
    if mass < 0.0:
        raise input_error(f"is {mass:g} kg; allowed is >= 0", where=option)
    return mass


def _axis_command(kind: str) -> Callable[..., None]:
    """Return the command of a component that is tested axis by axis: bushing or gasket."""

    def identify_axis(
        files: FilesArgument,
        axis: OptionalAxisOption = None,
        static: StaticOption = False,
        law: Annotated[
            str,
            typer.Option(
                help="voigt, table (monotone curve), voigt_dahl, voigt_maxwell, rubber (both) or, "
                "about an axis, voigt_havsin."
            ),
        ] = "voigt",
        validate: ValidateOption = None,
        arm: ArmOption = None,
        method: MethodOption = "least-squares",
        bounds: BoundsOption = None,
        fix: FixOption = None,
        units: UnitsOption = None,
        cutoff: CutoffOption = None,
        channels: ChannelsOption = None,
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
        if static:
            from wm_drake.cli.static_tests import run_static

            run_static(
                kind, files, axis, units, channels, knots, target, out, overwrite, as_json, sets
            )
            return
        if axis is None:
            raise input_error("is needed, for example --axis radial", where="--axis")
        asked = _Asked(
            files,
            units,
            method,
            seed,
            out,
            overwrite,
            as_json,
            sets,
            validate or [],
            cutoff,
            channels,
        )
        axes = axes_of(axis)
        radius = quantities_of(arm, Unit("m", "mm"), "--arm")[0] if arm else 0.0
        laws, ranges, fixed = _laws(law, axes[0]), _ranges(bounds), _single(fix, "--fix")
        motions = _motions(asked, asked.files, rotates=axes[0].startswith("about") and not radius)
        models = {
            one: bushing_model(
                one,
                motions,
                target.component.parameters,  # type: ignore[arg-type]
                axes[0],
                arm=radius,
                bounds=given[0],
                fixed=given[1],
                knots=knots,
            )
            for one, given in _given_by_law(laws, ranges, fixed, axes[0]).items()
        }
        title = f"{target.component.name}, {axis.replace('_', ' ')}"
        copies = {one: _copies(model, axes) for one, model in models.items()}
        _run_all(asked, title, target, models, motions, copies)

    return identify_axis


app.command("bushing", cls=ValidatingCommand, help="One axis of a six-component bushing.")(
    writes_pages(_axis_command("bushing"))
)
app.command("gasket", cls=ValidatingCommand, help="One axis of the gasket.")(
    writes_pages(_axis_command("gasket"))
)


app.command("table2")(writes_pages(identify_table2))


def _copies(model: "ComponentModel", axes: tuple[str, ...]) -> dict[str, str]:
    """Return the fields of a bushing's other axes, and the field that each is copied from."""
    ours, others = axes[0][-1], [other[-1] for other in axes[1:]]
    names = [*(unknown.name for unknown in model.unknowns), *model.fixed]
    fields = list(dict.fromkeys(name.split(".")[0] for name in names))
    return {f"{field[: -len(ours)]}{other}": field for field in fields for other in others}


def _laws(text: str, axis: str) -> list[str]:
    """Return the laws that an option names, separated by commas."""
    from wm_drake.studies.identification import fields_of_law

    found = [part.strip() for part in text.split(",")]
    for law in found:
        fields_of_law(law, axis)
        if found.count(law) > 1:
            raise input_error(f"'{law}' is there twice", where="--law")
    return found


def _given_by_law(
    laws: list[str],
    bounds: dict[str, tuple[float, float]],
    fixed: dict[str, float],
    axis: str,
) -> dict[str, tuple[dict[str, tuple[float, float]], dict[str, float]]]:
    """Return bounds and fixed numbers of each law: of several laws, those of its own fields.

    Raises:
        InputError: No law has a field.
    """
    from wm_drake.studies.identification import fields_of_law

    if len(laws) == 1:
        return {laws[0]: (bounds, fixed)}
    fields = {law: fields_of_law(law, axis) for law in laws}
    known = sorted({name for names in fields.values() for name in names})
    for option, given in (("--bounds", bounds), ("--fix", fixed)):
        for name in given:
            if name.split(".")[0] not in known:
                raise input_error(
                    f"none of these laws has a number '{name}'{nearest_names(name, known)}",
                    where=option,
                )
    return {
        law: (
            {name: value for name, value in bounds.items() if name.split(".")[0] in names},
            {name: value for name, value in fixed.items() if name.split(".")[0] in names},
        )
        for law, names in fields.items()
    }


def _run_all(
    asked: _Asked,
    title: str,
    target: Target,
    models: "dict[str, ComponentModel]",
    motions: "list[MeasuredMotion]",
    copies: Mapping[str, dict[str, str]],
) -> None:
    """Fit one law, or compare several."""
    rotates = motions[0].loop.rotates
    if len(models) == 1 and not asked.validate:
        ((law, model),) = models.items()
        _run(asked, f"{title}, law {law}", target, model, motions, copies.get(law, {}))
        return
    from wm_drake.cli.rival_laws import run_comparison
    from wm_drake.studies.identification import check_blind

    validation = []
    if asked.validate:
        check_blind(asked.files, existing_files(asked.validate))
        validation = _motions(asked, asked.validate, rotates=rotates)
    run_comparison(
        title,
        target,
        models,
        motions,
        validation,
        copies,
        method=asked.method,
        seed=asked.seed,
        out=asked.out,
        overwrite=asked.overwrite,
        as_json=asked.as_json,
        sets=asked.sets,
    )


def _motions(asked: _Asked, files: list[Path], *, rotates: bool) -> "list[MeasuredMotion]":
    """Return the loops of the files, with the motion of each."""
    from wm_drake.errors import InputError, Problem
    from wm_drake.parameters import read_loops
    from wm_drake.parameters.units import Unit
    from wm_drake.rigs.measured import inertia_share, measured_motion, without_inertia
    from wm_drake.studies.fitting import METHODS

    if asked.method not in METHODS:
        raise input_error(
            f"no method '{asked.method}'{nearest_names(asked.method, METHODS)}", where="--method"
        )
    units = units_of(asked.units)
    cutoff = None
    if asked.cutoff is not None:
        cutoff = quantities_of(asked.cutoff, Unit("Hz", "Hz"), "--cutoff")[0]
        if not cutoff > 0.0:
            raise input_error(f"is {cutoff:g} Hz; allowed is > 0", where="--cutoff")
    loops = read_loops(existing_files(files), units, channels_of(asked.channels, LOOP_WORDS))
    if loops[0].rotates != rotates:
        holds, needs = ("angles and moments", "displacements and forces")[
            :: 1 if loops[0].rotates else -1
        ]
        raise input_error(f"holds {holds}, needs {needs} (or --arm)", where=loops[0].path)
    motions, problems = [], list[Problem]()
    for loop in loops:
        try:
            motions.append(measured_motion(loop, cutoff))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    found = sorted(motions, key=lambda measured: measured.order)
    if asked.driven_mass > 0.0:
        for motion in found:
            inertia, share = inertia_share(motion, asked.driven_mass)
            say(
                f"{motion.loop.name}: {asked.driven_mass:g} kg at the driven end take up to "
                f"{inertia:.3g} N, {100.0 * share:.3g} % of the measured force; taken out.",
                err=True,
            )
        found = [without_inertia(motion, asked.driven_mass) for motion in found]
    return found


def units_of(text: str | None) -> tuple[str, str, str] | None:
    """Return the units of time, displacement and force of the option `--units`."""
    if text is None:
        return None
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3:
        raise input_error(
            f"'{text}' is not three units; write for example 's,mm,N'", where="--units"
        )
    return (parts[0], parts[1], parts[2])


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
    from wm_drake.studies.identification import fit_law, judge

    writer = Run("identify", asked.overwrite)
    with interruptible(), result_folder(asked.out, writer) as folder:
        with progress_bar(PER_CENT, "identify") as bar:
            fit = fit_law(
                model,
                motions,
                asked.method,
                seed=asked.seed,
                progress=lambda fraction, least: bar(int(PER_CENT * fraction)),
            )
        judgement = judge(fit, motions)
        told = write_fragment(
            folder / "identified.yaml",
            fit,
            model,
            target,
            copies,
            asked.out,
            judgement.sentences,
            asked.sets,
        )
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
        _print(title, fit, judgement, motions, model.fixed, told, asked.out)


def write_fragment(
    path: Path,
    fit: "Fit",
    model: "ComponentModel",
    target: Target,
    copies: Mapping[str, str],
    out: Path,
    remarks: tuple[str, ...],
    sets: list[str] | None,
) -> str:
    """Write the identified numbers as a machine or component file, if they are complete.

    Returns:
        A sentence that names what is missing for the file; "" if it is written.
    """
    from wm_drake.studies.identification import fragment, missing_numbers

    missing = missing_numbers(fit, model, target.component)
    if missing:
        return (
            f"{path.name} is not written: the data do not determine {', '.join(missing)}, which "
            f"the law {model.law} needs and {target.component.name} did not have; give a value "
            "with --fix."
        )
    changes = dict(pairs_of(sets, "--set"))
    text = fragment(
        fit, model, target.component, target.machine, target.key, copies, out, remarks, changes
    )
    path.write_text(text, encoding="utf-8")
    return ""


def _print(
    title: str,
    fit: "Fit",
    judgement: "Judgement",
    motions: "list[MeasuredMotion]",
    fixed: Mapping[str, float],
    told: str,
    out: Path,
) -> None:
    from rich.table import Table

    from wm_drake.report.identify.report import (
        estimate_cells,
        motion_sentences,
        undetermined_sentences,
    )
    from wm_drake.report.rig.figures import force_scale

    unit = force_scale(motions[0].loop.rotates)[1]
    console = Console()
    for sentence in (*judgement.sentences, *motion_sentences(motions)):
        console.print(sentence, highlight=False)
    table = Table(title=f"{title}: RMSE {fit.rmse:.4g} {unit} by {fit.method}")
    table.add_column("unknown", no_wrap=True)
    for head in ("value", "95 % interval", "unit", "remark"):
        table.add_column(head)
    for cells in estimate_cells(fit, fixed):
        table.add_row(*cells)
    console.print(table)
    for sentence in (*undetermined_sentences(fit), *fit.notes, *([told] if told else [])):
        console.print(sentence, highlight=False)
    console.print(
        f"Results in {out}: report.html, {'' if told else 'identified.yaml, '}parameters.csv, "
        "errors.csv, loops.csv, fit.json"
    )
