"""Command `wm-drake record`: look at recorded files and at records of runs."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from wm_drake.cli.common import JsonOption
from wm_drake.cli.components import group_of
from wm_drake.report.terminal import Console
from wm_drake.studies.compare.options import COMPARE
from wm_drake.studies.orders.options import ORDERS

app = group_of((COMPARE, ORDERS))


@app.command("channels")
def record_channels(
    file: Annotated[Path, typer.Argument(metavar="FILE")],
    as_json: JsonOption = False,
) -> None:
    """List the channels of a recorded file.

    Each has the name for `--channels`, its unit, samples, sampling rate, span and abscissa.
    """
    from wm_drake.parameters.recorded import read_recording
    from wm_drake.report.formatting import MISSING
    from wm_drake.studies.inputs import existing_file

    described = read_recording(existing_file(file, "FILE")).described()
    if as_json:
        typer.echo(json.dumps({"file": file.name, "channels": described}))
        return
    Console().print(_table(file, described, MISSING))


def _table(file: Path, described: list[dict[str, Any]], missing: str) -> Any:
    from rich.table import Table

    table = Table(title=f"Channels of {file.name}")
    for head, justify in _COLUMNS.items():
        table.add_column(head, justify=justify, overflow="fold")
    for channel in described:
        texts = []
        for head in _COLUMNS:
            value = channel[head]
            text = f"{value:.6g}" if isinstance(value, float) else str(value or "")
            texts.append(text if value is not None and text else missing)
        table.add_row(*texts)
    return table


_COLUMNS: dict[str, Any] = {
    "name": "left",
    "group": "left",
    "unit": "left",
    "samples": "right",
    "missing": "right",
    "rate_hz": "right",
    "begin_s": "right",
    "end_s": "right",
    "abscissa": "left",
    "start": "left",
    "remark": "left",
}
"""Columns of the table, and where their texts stand."""
