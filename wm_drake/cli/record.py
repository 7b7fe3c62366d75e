"""Command `wm-drake record`: look at records of runs and at measurements."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.cli.channels import RecordChannelsOption
from wm_drake.cli.common import (
    JsonOption,
    OutOption,
    OverwriteOption,
    interruptible,
)
from wm_drake.cli.figures import writes_pages
from wm_drake.report.provenance import command_line
from wm_drake.report.terminal import say
from wm_drake.studies.inputs import (
    channels_of,
    existing_file,
)
from wm_drake.studies.result_folder import Run, result_folder

if TYPE_CHECKING:
    from wm_drake.studies.steady.orders import Orders

app = typer.Typer(help="Look at records of runs and at measurements.", no_args_is_help=True)

DEFAULT_OUT = Path("wm-drake-orders")


@app.callback()
def _group() -> None:
    """Look at records of runs and at measurements."""


@app.command("orders")
@writes_pages
def record_orders(
    file: Annotated[
        Path,
        typer.Argument(
            help="netCDF record of the command spin; or CSV, MDF4, TDMS, UFF 58 or MAT with "
            "time_s, speed_rpm and a column for each signal, such as accelerations.",
            metavar="FILE",
        ),
    ],
    highest: Annotated[
        float, typer.Option(help="Highest order of the map.", min=1.0, max=40.0)
    ] = 6.0,
    unit: Annotated[
        str, typer.Option(help="Unit of the signals of a CSV, for tables and axes.")
    ] = "m/s^2",
    channels: RecordChannelsOption = None,
    out: OutOption = DEFAULT_OUT,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Compute waterfall and order map of the signals of a record."""
    from wm_drake.studies.steady.orders import orders_of, read_signals

    signals = read_signals(existing_file(file, "FILE"), unit, channels_of(channels))
    result = orders_of(signals, highest)
    with interruptible(), result_folder(out, Run("record orders", overwrite)) as folder:
        _write(result, folder)
    if as_json:
        typer.echo(json.dumps(_as_json(result)))
    else:
        from wm_drake.report.orders.report import summary

        say(summary(result))
        say(f"Results in {out}: report.html, orders.csv, orders.nc")


def _write(result: "Orders", folder: Path) -> None:
    from wm_drake.report.orders.report import orders_report, orders_table

    orders_table(result).to_csv(folder / "orders.csv", index=False, float_format="%.6g")
    maps = result.orders.assign_coords(signal=result.signals.names)
    maps.name, maps.attrs["units"] = "amplitude", result.signals.unit
    maps.to_netcdf(folder / "orders.nc", engine="h5netcdf")
    (folder / "report.html").write_text(orders_report(result, command_line()), encoding="utf-8")


def _as_json(result: "Orders") -> dict[str, Any]:
    from wm_drake.report.orders.report import orders_table

    table = orders_table(result)
    return {
        "file": result.signals.source,
        "unit": result.signals.unit,
        "signals": result.signals.names,
        "orders": {
            name: [None if value != value else float(value) for value in table[name]]
            for name in table.columns
        },
    }
