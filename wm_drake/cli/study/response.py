"""Command `wm-drake study response`: steady unbalance response over the speed of the drum."""

import json
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
    cases_of,
    command_line,
    interruptible,
    load_parameters,
)
from wm_drake.cli.progress import progress_bars
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.study.common import WorkersOption
from wm_drake.cli.terminal import Console
from wm_drake.errors import input_error

if TYPE_CHECKING:  # importing Drake takes a second, too long for --help
    import xarray as xr

    from wm_drake.model.machine import Machine
    from wm_drake.parameters import Load, MachineParameters
    from wm_drake.parameters.types import FloatArray
    from wm_drake.studies.steady.study import SteadyStudy

DEFAULT_OUT = Path("wm-drake-response")


def response(
    machine: MachineOption = "reference",
    load: Annotated[
        list[str] | None,
        typer.Option(
            help="Load of the machine, or load file. Repeatable. Default: all loads of the "
            "machine.",
            metavar="NAME|FILE",
        ),
    ] = None,
    no_gasket: Annotated[
        bool, typer.Option("--no-gasket", help="Only without gasket. Default: with and without.")
    ] = False,
    low: Annotated[
        str, typer.Option("--from", help="Lowest drum speed.", metavar="SPEED")
    ] = "40 rpm",
    high: Annotated[
        str | None,
        typer.Option(
            "--to",
            help="Highest drum speed. Default: the fastest of the spin profile.",
            metavar="SPEED",
        ),
    ] = None,
    points: Annotated[
        int, typer.Option(help="Number of speeds, at equal distances.", min=2, max=5000)
    ] = 121,
    harmonics: Annotated[
        int, typer.Option(help="Number of harmonics of the drum's rotation.", min=1, max=40)
    ] = 11,
    rate: Annotated[
        list[str] | None,
        typer.Option(
            help="Sweep rate. Repeatable. Default: 1, 2, 5, 10, 20 and 50 rpm/s.",
            metavar="RATE",
        ),
    ] = None,
    no_sweeps: Annotated[bool, typer.Option("--no-sweeps", help="Leave the sweeps out.")] = False,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Compute the steady response to unbalance over the drum speed, by harmonic balance."""
    from wm_drake.studies.steady.study import RATES_RPM_S

    parameters = load_parameters(machine, sets)
    speeds = _speeds(parameters, low, high, points)
    rates = () if no_sweeps else tuple(map(_rate, rate)) if rate else RATES_RPM_S
    loads = [(case.name, case.load) for case in cases_of(parameters, load, True, None)]
    if not loads:
        raise input_error(f"machine '{parameters.name}' has no loads", key="loads")
    built = build_checked(machine, parameters)
    gaskets = (False,) if no_gasket or parameters.gasket is None else (True, False)
    with interruptible(), result_folder(out, Run("study response", overwrite)) as folder:
        study = _run(built, loads, speeds, gaskets, harmonics, rates, workers)
        _write(study, folder)
    if as_json:
        typer.echo(json.dumps(_as_json(study)))
    else:
        _print_table(study, out)


def _speeds(
    parameters: "MachineParameters", low: str, high: str | None, points: int
) -> "FloatArray":
    """Return the speeds that the options select. [rad/s]"""
    import numpy as np

    from wm_drake.cli.components import quantities_of
    from wm_drake.parameters.units import Unit

    speed = Unit("rad/s", "rpm")
    first = quantities_of(low, speed, "--from")[0]
    last = max(parameters.profile.speed) if high is None else quantities_of(high, speed, "--to")[0]
    if not 0.0 < first < last:
        raise input_error(
            f"{speed.from_si(first):g} rpm is not above 0 and below the highest speed, "
            f"{speed.from_si(last):g} rpm",
            where="--from",
        )
    return np.linspace(first, last, points)


def _rate(text: str) -> float:
    """Return a sweep rate. [rpm/s]"""
    from wm_drake.cli.components import quantities_of
    from wm_drake.parameters.units import Unit

    unit = Unit("rad/s^2", "rpm/s")
    rate = unit.from_si(quantities_of(text, unit, "--rate")[0])
    if not 0.1 <= rate <= 1000.0:
        raise input_error(f"'{text}' is not between 0.1 and 1000 rpm/s", where="--rate")
    return rate


def _run(
    built: "Machine",
    loads: "list[tuple[str, Load]]",
    speeds: "FloatArray",
    gaskets: tuple[bool, ...],
    harmonics: int,
    rates: tuple[float, ...],
    workers: int | None,
) -> "SteadyStudy":
    from wm_drake.studies.steady.balance import SAMPLES
    from wm_drake.studies.steady.study import run_steady_study

    with progress_bars(["response"]) as progress:
        return run_steady_study(
            built,
            loads,
            speeds,
            gaskets=gaskets,
            harmonics=harmonics,
            samples=max(SAMPLES, 8 * harmonics),
            rates_rpm_s=rates,
            workers=workers,
            progress=lambda fraction: progress(0, fraction),
        )


def _write(study: "SteadyStudy", folder: Path) -> None:
    from wm_drake.report.response.report import response_report, response_table, sweeps_table

    response_table(study).to_csv(folder / "response.csv", index=False, float_format="%.6g")
    if study.sweeps is not None:
        sweeps_table(study).to_csv(folder / "sweeps.csv", index=False, float_format="%.6g")
    page = response_report(study, command_line())
    (folder / "report.html").write_text(page, encoding="utf-8")


def _as_json(study: "SteadyStudy") -> dict[str, Any]:
    from wm_drake.parameters.units import Unit

    millimetre, rpm = Unit("m", "mm").from_si(1.0), Unit("rad/s", "rpm").from_si(1.0)
    degree = Unit("rad/s", "deg/s").from_si(1.0)

    def columns(values: Any, dim: str, factor: float = 1.0) -> dict[str, list[float]]:
        return {
            str(label): (factor * values.sel({dim: label}).values).tolist()
            for label in values[dim].values
        }

    return {
        "machine": study.parameters.name,
        "harmonics": study.cases[0].response.attrs["harmonics"],
        "cases": [
            {
                "load": case.load,
                "gasket": case.gasket,
                "rpm": (rpm * case.response.speed.values).tolist(),
                "amplitudes_mm": columns(case.response.amplitude, "sensor", millimetre),
                "detergent_box_mm": columns(
                    case.response.detergent_displacement, "axis", millimetre
                ),
                "gasket_force_N": columns(case.response.gasket_force, "axis"),
                "gasket_moment_Nm": columns(case.response.gasket_moment, "axis"),
                "spring_tension_N": columns(case.response.spring_tension, "spring"),
                "damper_tension_N": columns(case.response.damper_tension, "damper"),
                "mount_force_N": _mount_forces(case.response),
                "damper_spin_deg_s": columns(case.response.damper_spin, "spinning", degree),
                "stable": case.response.stable.values.tolist(),
                "wall_s": case.wall_s,
            }
            for case in study.cases
        ],
        "wall_s": study.wall_s,
    }


def _mount_forces(response: "xr.Dataset") -> dict[str, dict[str, list[float]]]:
    """Return peak and RMS of the force of each mount on the cabinet, over the speeds. [N]"""
    from wm_drake.simulation.mounts import KINDS

    return {
        str(mount): {
            kind: response[f"mount_force_{kind}"].sel(mount=mount).values.tolist() for kind in KINDS
        }
        for mount in response.mount.values
    }


def _print_table(study: "SteadyStudy", out: Path) -> None:
    from rich.table import Table

    from wm_drake.parameters.units import Unit
    from wm_drake.report.response.report import summary

    millimetre, rpm = Unit("m", "mm").from_si(1.0), Unit("rad/s", "rpm").from_si(1.0)
    table = Table(title=f"Largest steady amplitudes of machine '{study.parameters.name}', in mm")
    for name in ("load", "gasket"):
        table.add_column(name, overflow="fold")
    for name in study.cases[0].response.sensor.values:
        table.add_column(str(name), justify="right")
    table.add_column("rpm", justify="right")
    for case in study.cases:
        largest = millimetre * case.response.amplitude.values
        speed = rpm * float(case.response.speed.values[int(largest.max(axis=1).argmax())])
        table.add_row(
            case.load,
            "yes" if case.gasket else "no",
            *(f"{value:.1f}" for value in largest.max(axis=0)),
            f"{speed:.0f}",
        )
    console = Console()
    console.print(table)
    console.print(summary(study))
    sweeps = ", sweeps.csv" if study.sweeps is not None else ""
    console.print(f"Results in {out}: report.html, response.csv{sweeps}")
