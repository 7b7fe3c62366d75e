"""`wm-drake rig`: a component on a bench, its force loops, and their measures."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.cli.common import (
    JsonOption,
    MachineOption,
    OutOption,
    OverwriteOption,
    SetOption,
    command_line,
    interruptible,
)
from wm_drake.cli.components import (
    ArmOption,
    AxisOption,
    ComponentOption,
    DamperCommand,
    JigMassOption,
    NameOption,
    OuterMassOption,
    axes_of,
    quantities_of,
    target_of,
)
from wm_drake.cli.figures import writes_pages
from wm_drake.cli.progress import progress_bar
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.terminal import Console, say
from wm_drake.errors import input_error, nearest_names

if TYPE_CHECKING:
    from wm_drake.parameters import Component
    from wm_drake.rigs import Bench, Harmonic, RigRun

app = typer.Typer(
    help="Test a component on a bench: harmonic motion, steady force loops.", no_args_is_help=True
)

DEFAULT_OUT = Path("wm-drake-rig")
FrequencyOption = Annotated[
    str | None,
    typer.Option(
        "--frequency", "-f", help="Of the motion; several as '1,3,5 Hz'.", metavar="FREQUENCIES"
    ),
]
AmplitudeOption = Annotated[
    str | None,
    typer.Option(
        "--amplitude",
        "-a",
        help="Of the motion; several as '1,3,5 mm', angles in deg.",
        metavar="AMPLITUDES",
    ),
]
MatrixOption = Annotated[
    str | None,
    typer.Option(
        "--matrix", help="Run the test matrix of a paper: A, or for dampers C.", metavar="PAPER"
    ),
]


@app.command("damper", cls=DamperCommand)
@writes_pages
def rig_damper(
    frequency: FrequencyOption = None,
    amplitude: AmplitudeOption = None,
    matrix: MatrixOption = None,
    machine: MachineOption = "reference",
    name: NameOption = None,
    component: ComponentOption = None,
    sponge_mass: Annotated[
        str | None,
        typer.Option(
            help="Mass of the sponge, law {laws_with_mass} only, e.g. '10 g'; none in the machine.",
            metavar="MASS",
        ),
    ] = None,
    outer_mass: OuterMassOption = None,
    jig_mass: JigMassOption = None,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Test a friction damper along its line.

    With masses, their effect on the loops is printed and in masses.csv.
    """
    from wm_drake.parameters.units import Unit
    from wm_drake.rigs import damper_bench

    chosen = target_of("damper", machine, name, component, sets).component
    mass = quantities_of(sponge_mass, Unit("kg", "kg"), "--sponge-mass")[0] if sponge_mass else 0.0
    driven = sum(
        quantities_of(text, Unit("kg", "kg"), option)[0]
        for text, option in ((outer_mass, "--outer-mass"), (jig_mass, "--jig-mass"))
        if text
    )
    damper: Any = chosen.parameters
    bench = damper_bench(damper, mass, driven)
    motions = _motions("damper", bench, frequency, amplitude, matrix)
    parts = [f"damper {chosen.name}", f"law {damper.law}"]
    parts += [f"sponge of {1e3 * mass:g} g"] if mass else []
    parts += [f"{driven:g} kg at the driven end"] if driven else []
    plain = damper_bench(damper) if mass or driven else None
    _run(", ".join(parts), bench, motions, chosen, out, Run("rig", overwrite), as_json, plain)


def _axis_command(kind: str) -> Callable[..., None]:
    """Return the command of a component that is tested axis by axis: bushing or gasket."""

    def rig_axis(
        axis: AxisOption,
        frequency: FrequencyOption = None,
        amplitude: AmplitudeOption = None,
        matrix: MatrixOption = None,
        arm: ArmOption = None,
        machine: MachineOption = "reference",
        name: NameOption = None,
        component: ComponentOption = None,
        out: OutOption = DEFAULT_OUT,
        overwrite: OverwriteOption = False,
        as_json: JsonOption = False,
        sets: SetOption = None,
    ) -> None:
        from wm_drake.parameters.units import Unit
        from wm_drake.rigs import JIG_ARM, bushing_bench

        chosen = target_of(kind, machine, name, component, sets).component
        turned = axes_of(axis)[0]
        radius = quantities_of(arm, Unit("m", "mm"), "--arm")[0] if arm else 0.0
        if matrix is not None and turned.startswith("about") and not arm:
            radius = JIG_ARM
        bench = bushing_bench(chosen.parameters, turned, radius)  # type: ignore[arg-type]
        motions = _motions(kind, bench, frequency, amplitude, matrix)
        what = kind if chosen.name == kind else f"{kind} {chosen.name}"
        through = f", through an arm of {1e3 * radius:g} mm" if radius else ""
        title = f"{what}, axis {turned.replace('_', ' ')}{through}"
        _run(title, bench, motions, chosen, out, Run("rig", overwrite), as_json)

    return rig_axis


app.command("bushing", help="One axis of a six-component bushing.")(
    writes_pages(_axis_command("bushing"))
)
app.command("gasket", help="One axis of the gasket.")(writes_pages(_axis_command("gasket")))


def _motions(
    kind: str, bench: "Bench", frequency: str | None, amplitude: str | None, matrix: str | None
) -> "list[Harmonic]":
    from wm_drake.parameters.units import Unit
    from wm_drake.rigs import MATRICES, BushingBench, Harmonic

    if matrix is not None:
        if frequency or amplitude:
            raise input_error(
                "has its own frequencies and amplitudes; leave -f and -a out", where="--matrix"
            )
        rotates = isinstance(bench, BushingBench) and bench.axis.startswith("about")
        if kind == "gasket" and rotates:
            raise input_error("[A] does not rotate the gasket; give -f and -a", where="--matrix")
        papers = MATRICES[f"{kind} about" if rotates else kind]
        if matrix not in papers:
            raise input_error(
                f"no matrix '{matrix}' for a {kind}{nearest_names(matrix, papers)}",
                where="--matrix",
            )
        return list(papers[matrix])
    if not (frequency and amplitude):
        raise input_error(
            "needs -f and -a (for example -f '3 Hz' -a '5 mm'), or --matrix", where=f"rig {kind}"
        )
    unit = Unit("rad", "deg") if bench.rotates else Unit("m", "mm")
    return [
        Harmonic(f, a)
        for f in quantities_of(frequency, Unit("Hz", "Hz"), "--frequency")
        for a in quantities_of(amplitude, unit, "--amplitude")
    ]


def _run(
    title: str,
    bench: "Bench",
    motions: "list[Harmonic]",
    chosen: "Component",
    out: Path,
    writer: Run,
    as_json: bool,
    plain: "Bench | None" = None,
) -> None:
    from wm_drake.report.rig.report import (
        loop_file,
        loop_table,
        masses_sentence,
        masses_table,
        measures_table,
        rig_report,
    )
    from wm_drake.rigs import beyond_tables, run_rig

    with interruptible(), result_folder(out, writer) as folder:
        with progress_bar(len(motions), "loops") as progress:
            run = run_rig(title, bench, motions, _numbers(chosen), progress)
        for loop in run.loops:
            loop_table(loop).to_csv(folder / loop_file(loop), index=False, float_format="%.9g")
        measures_table(run).to_csv(folder / "measures.csv", index=False, float_format="%.9g")
        command = command_line()
        told = beyond_tables(bench, motions)
        effect = ""
        if plain is not None:
            massless = run_rig(title, plain, motions)
            masses_table(run, massless).to_csv(
                folder / "masses.csv", index=False, float_format="%.9g"
            )
            effect = masses_sentence(run, massless)
        (folder / "report.html").write_text(
            rig_report(run, command, told, effect), encoding="utf-8"
        )
    for sentence in told:
        say(f"warning: {sentence}", err=True)
    if as_json:
        typer.echo(json.dumps(_as_json(run)))
    else:
        _print(run, out, effect)


def _numbers(chosen: "Component") -> tuple[tuple[str, str, str], ...]:
    from wm_drake.parameters import quantities
    from wm_drake.report.tables import readable

    found = []
    for key, value, unit in quantities(chosen.parameters):
        if key.startswith("end_bushing"):
            continue  # not on the bench
        source = next(
            (chosen.sources[part] for part in (key, key.split(".")[0]) if part in chosen.sources),
            "",
        )
        found.append((key, readable(value, unit), source))
    return tuple(found)


def _as_json(run: "RigRun") -> dict[str, Any]:
    from wm_drake.report.rig.report import measures_table

    rows = json.loads(measures_table(run).to_json(orient="records", double_precision=15))
    return (
        {"component": run.title, **rows[0]}
        if len(rows) == 1
        else {"component": run.title, "loops": rows}
    )


def _print(run: "RigRun", out: Path, effect: str) -> None:
    from rich.table import Table

    from wm_drake.report.rig.report import measures_cells, measures_header

    table = Table(title=run.title)
    for name in measures_header(run):
        table.add_column(name, justify="right")
    for cells in measures_cells(run):
        table.add_row(*cells)
    console = Console()
    console.print(table)
    if effect:
        console.print(effect, highlight=False)
    console.print(
        f"Results in {out}: report.html, measures.csv, {'masses.csv, ' if effect else ''}"
        "loop_<frequency>_<amplitude>.csv"
    )
