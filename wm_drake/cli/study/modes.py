"""Command `wm-drake study modes`: natural modes, critical speeds, and what moves them."""

import json
import logging
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.cli.common import (
    JsonOption,
    MachineOption,
    OutOption,
    OverwriteOption,
    SetOption,
    build_checked,
    command_line,
    interruptible,
    load_parameters,
)
from wm_drake.cli.progress import progress_bars
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.terminal import Console

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    from wm_drake.model.machine import Machine
    from wm_drake.studies.modes.study import MachineModes

DEFAULT_OUT = Path("wm-drake-modes")


def modes(
    machine: MachineOption = "reference",
    load: Annotated[
        str | None,
        typer.Option(
            "--load",
            help="Load of the machine in the drum. Default: the empty drum.",
            metavar="NAME",
        ),
    ] = None,
    no_gasket: Annotated[bool, typer.Option("--no-gasket", help="Without the gasket.")] = False,
    amplitude: Annotated[
        str,
        typer.Option(
            help="Amplitude of the modes that depend on it, at the middle of the tub.",
            metavar="LENGTH",
        ),
    ] = "5 mm",
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    replay: Annotated[
        bool, typer.Option("--replay", help="Also write a 3D animation of each sliding mode.")
    ] = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Compute natural modes, critical speeds, and how each number of the machine moves them."""
    from wm_drake.cli.components import quantities_of
    from wm_drake.parameters.units import Unit

    (size,) = quantities_of(amplitude, Unit("m", "mm"), "--amplitude")[:1]
    parameters = load_parameters(machine, sets)
    built = build_checked(machine, parameters)
    with interruptible(), result_folder(out, Run("study modes", overwrite)) as folder:
        result = _run(built, load, not no_gasket, size)
        _write(result, folder, replay)
    if as_json:
        typer.echo(json.dumps(_as_json(result)))
    else:
        _print_table(result, out)


def _run(built: "Machine", load: str | None, gasket: bool, amplitude: float) -> "MachineModes":
    from wm_drake.studies.modes.study import modes as modes_of

    with progress_bars(["modes"]) as progress:
        return modes_of(
            built,
            load,
            gasket=gasket,
            amplitude=amplitude,
            run_up=True,
            progress=lambda fraction: progress(0, fraction),
        )


def _write(result: "MachineModes", folder: Path, replay: bool) -> None:
    from wm_drake.report.modes.report import (
        amplitudes_table,
        campbell_table,
        modes_report,
        modes_table,
        sensitivities_table,
    )

    for name, table in (
        ("modes", modes_table),
        ("amplitudes", amplitudes_table),
        ("campbell", campbell_table),
        ("sensitivities", sensitivities_table),
    ):
        table(result).to_csv(folder / f"{name}.csv", index=False, float_format="%.8g")
    replays = _write_replays(result, folder) if replay else {}
    page = modes_report(result, command_line(), replays)
    (folder / "report.html").write_text(page, encoding="utf-8")


def _write_replays(result: "MachineModes", folder: Path) -> dict[str, str]:
    from wm_drake.model.replay import replay_page
    from wm_drake.studies.modes.animation import mode_motion
    from wm_drake.studies.modes.study import SLIDING

    # Meshcat would print the address of its server
    logging.getLogger("drake").setLevel(logging.WARNING)
    names = {}
    for mode in result.modes[SLIDING]:
        name = f"replay_{re.sub('[^a-z]', '_', mode.name)}.html"
        page = replay_page(result.parameters, mode_motion(mode), title=mode.name)
        (folder / name).write_text(page, encoding="utf-8")
        names[mode.name] = name
    return names


def _as_json(result: "MachineModes") -> dict[str, Any]:
    from wm_drake.parameters.units import Unit
    from wm_drake.studies.modes.study import AMPLITUDE, SLIDING, STUCK

    rpm = Unit("rad/s", "rpm")

    def entry(mode: Any) -> dict[str, Any]:
        return {
            "frequency_Hz": mode.frequency_hz,
            "damping_ratio": mode.damping_ratio,
            "name": mode.name,
        }

    def diagram(name: str) -> dict[str, Any]:
        found = result.diagrams[name]
        return {
            "rpm": [rpm.from_si(float(speed)) for speed in found.speed],
            "frequency_Hz": _finite(found.frequency_hz.T),
            "damping_ratio": _finite(found.damping_ratio.T),
            "name": [mode.name for mode in result.modes[name]],
        }

    return {
        "machine": result.parameters.name,
        "load": result.load,
        "gasket": result.gasket,
        "amplitude_mm": Unit("m", "mm").from_si(result.amplitude),
        "modes": {
            STUCK: [entry(mode) for mode in result.modes[STUCK]],
            SLIDING: [entry(mode) for mode in result.modes[SLIDING]],
            AMPLITUDE: [entry(mode) for mode in result.at_amplitude],
        },
        "critical_rpm": [rpm.from_si(float(speed)) for speed in result.critical_speeds],
        "critical": {
            name: [
                {
                    "order": critical.order,
                    "name": result.modes[name][critical.mode].name,
                    "rpm": rpm.from_si(critical.speed),
                    "damping_ratio": critical.damping_ratio,
                }
                for critical in found
            ]
            for name, found in result.critical.items()
        },
        "campbell": diagram(SLIDING),
        "campbell_stuck": diagram(STUCK),
    }


def _finite(rows: Any) -> list[list[float | None]]:
    """Return rows of numbers; JSON has no NaN."""
    return [[float(value) if value == value else None for value in row] for row in rows]


def _print_table(result: "MachineModes", out: Path) -> None:
    from rich.table import Table

    from wm_drake.report.modes.report import summary
    from wm_drake.studies.modes.study import SLIDING, STUCK

    table = Table(title=f"Modes of machine '{result.parameters.name}'")
    for head in ("friction", "mode", "frequency, Hz", "damping ratio"):
        table.add_column(head, justify="left" if head in ("friction", "mode") else "right")
    at_amplitude = f"{1e3 * result.amplitude:g} mm"
    for name, found in (
        (STUCK, result.modes[STUCK]),
        (at_amplitude, result.at_amplitude),
        (SLIDING, result.modes[SLIDING]),
    ):
        for mode in found:
            hertz, ratio = mode.frequency_hz, mode.damping_ratio
            table.add_row(
                name,
                mode.name,
                "–" if hertz is None else f"{hertz:.3f}",
                "–" if ratio is None else f"{ratio:.4f}",
            )
    console = Console()
    console.print(table)
    console.print(summary(result))
    console.print(
        f"Results in {out}: report.html, modes.csv, amplitudes.csv, campbell.csv, sensitivities.csv"
    )
