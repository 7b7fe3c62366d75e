"""Command `wm-drake study gasket-damping`: fit the gasket damping to measured displacements."""

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
    check_buildable,
    command_line,
    existing_file,
    interruptible,
    load_parameters,
    warn_of_phase_error,
)
from wm_drake.cli.result_folder import Run, result_folder
from wm_drake.cli.terminal import say
from wm_drake.errors import input_error

if TYPE_CHECKING:
    from wm_drake.parameters import MachineParameters
    from wm_drake.parameters.types import FloatArray
    from wm_drake.studies.gasket_damping.study import Damping, Measured

DEFAULT_OUT = Path("wm-drake-gasket-damping")


def gasket_damping(
    machine: MachineOption = "reference",
    record: Annotated[
        list[str] | None,
        typer.Option(
            help="Measured displacements of a load: CSV with time_s, Xr, Yr, ... in mm, or netCDF "
            "record of the command spin. Repeatable. Default: the records of a virtual experiment.",
            metavar="LOAD=FILE",
        ),
    ] = None,
    planted_linear: Annotated[
        str, typer.Option(help="Linear damping C_L of the virtual experiment.")
    ] = "0.0287 N s/mm",
    planted_torsional: Annotated[
        str, typer.Option(help="Torsional damping C_T of the virtual experiment.")
    ] = "87 N mm s/deg",
    seed: Annotated[
        int, typer.Option(help="Seed of the noise of the virtual experiment.", min=0)
    ] = 0,
    mesh: Annotated[
        float,
        typer.Option(
            help="Spacing at which the grid search ends, in percent of the region (0 to 0.05 "
            "N s/mm, 0 to 200 N mm s/deg).",
            min=1e-3,
            max=25.0,
            metavar="PERCENT",
        ),
    ] = 0.1,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    sets: SetOption = None,
) -> None:
    """Find the gasket damping for which computed and measured envelopes agree best."""
    from wm_drake.studies.gasket_damping.study import identify_damping

    parameters = load_parameters(machine, sets)
    check_buildable(machine, parameters)
    warn_of_phase_error(parameters)
    run = Run("study gasket-damping", overwrite)
    with interruptible(), result_folder(out, run) as folder:
        truth = None
        if record:
            measured: Measured = _read(parameters, record)
        else:
            truth = _planted(parameters, planted_linear, planted_torsional)
            measured = _virtual(parameters, truth, seed)
        result = identify_damping(parameters, measured, truth, mesh / 100.0)
        _write(result, parameters, folder)
    if as_json:
        typer.echo(json.dumps(_as_json(result)))
    else:
        _print_result(result, out)


def _read(parameters: "MachineParameters", entries: list[str]) -> "Measured":
    import xarray as xr

    from wm_drake.parameters.csv_files import finite_numbers, read_csv
    from wm_drake.simulation.records import read_measured
    from wm_drake.studies.gasket_damping.study import MM_PER_M, as_measured

    measured = {}
    sensors = list(parameters.sensors)
    for entry in entries:
        load, equals, name = (part.strip() for part in entry.partition("="))
        if not equals or load not in parameters.loads:
            raise input_error(
                f"'{entry}' does not have the form LOAD=FILE with a load of the machine "
                f"({', '.join(parameters.loads)})",
                where="--record",
            )
        path = existing_file(Path(name), "--record")
        if path.suffix.lower() == ".csv":
            table = read_csv(path, ["time_s", *sensors])
            numbers = finite_numbers(table, path)
            record = xr.DataArray(
                numbers[:, 1:] / MM_PER_M,
                {"time": numbers[:, 0], "sensor": sensors},
                ["time", "sensor"],
            )
        else:
            wanted = {"time": ("time",), "displacement": ("time", "sensor")}
            record = read_measured(path, wanted).displacement
        measured[load] = as_measured(record, sensors, name)
    return measured


def _planted(parameters: "MachineParameters", linear: str, torsional: str) -> "FloatArray":
    import numpy as np

    from wm_drake.parameters import with_values

    if parameters.gasket is None:
        raise input_error(f"machine '{parameters.name}' has no gasket", key="gasket")
    changed = with_values(
        parameters, {"gasket.damping_x": linear, "gasket.rotational_damping_x": torsional}
    )
    assert changed.gasket is not None
    return np.array([changed.gasket.damping_x, changed.gasket.rotational_damping_x])


def _virtual(parameters: "MachineParameters", truth: "FloatArray", seed: int) -> "Measured":
    from wm_drake.studies.gasket_damping.study import LOADS, virtual_experiment

    for name in LOADS:
        if name not in parameters.loads:
            raise input_error(
                f"machine '{parameters.name}' has no load '{name}', which the virtual experiment "
                "needs",
                key="loads",
            )
    say(
        "No measured records were given. The Drake engine runs a virtual experiment with other "
        "damping values and noise.",
        err=True,
    )
    return virtual_experiment(parameters, truth, seed)


def _write(result: "Damping", parameters: "MachineParameters", folder: Path) -> None:
    from wm_drake.report.gasket_damping.report import gasket_damping_report, points_table

    points_table(result).to_csv(folder / "objective.csv", index=False, float_format="%.9g")
    command = command_line()
    (folder / "report.html").write_text(
        gasket_damping_report(result, parameters, command), encoding="utf-8"
    )


def _as_json(result: "Damping") -> dict[str, Any]:
    from wm_drake.report.gasket_damping.report import in_units_of_paper

    def found(search: Any) -> dict[str, Any]:
        linear, torsional = in_units_of_paper(search.best)
        return {
            "C_L": linear,
            "C_T": torsional,
            "objective_mm": search.value,
            "evaluations": search.evaluations,
        }

    truth = (
        None
        if result.truth is None
        else dict(zip(("C_L", "C_T"), in_units_of_paper(result.truth), strict=True))
    )
    interval = None
    if result.interval is not None:
        ends = (in_units_of_paper(end) for end in (result.interval.low, result.interval.high))
        interval = dict(zip(("C_L", "C_T"), map(list, zip(*ends, strict=True)), strict=True))
    return {
        "units": {"C_L": "N s/mm", "C_T": "N mm s/deg"},
        "virtual_experiment": result.truth is not None,
        "planted": truth,
        "best": found(result.better)
        | {"search": "grid" if result.better is result.grid else "scipy"},
        "searches_agree": result.searches_agree,
        "grid": found(result.grid)
        | {
            "rounds": len(result.grid.rounds),
            "mesh_percent": 100.0 * result.grid.rounds[-1].spacing,
        },
        "scipy": found(result.scipy),
        "interval_95": interval,
    }


def _print_result(result: "Damping", out: Path) -> None:
    from wm_drake.report.gasket_damping.report import summary

    say(summary(result))
    say(f"Results in {out}: report.html, objective.csv")
