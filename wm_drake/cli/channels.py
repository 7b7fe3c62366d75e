"""Option `--channels`: names that files of measurements have for what a command reads."""

from typing import Annotated

import typer

RecordChannelsOption = Annotated[
    str | None,
    typer.Option(
        "--channels",
        help="Names in the files: 'S1_x=Acc 1,S1_y=Acc 2' (also time, and speed in a record).",
        metavar="WORD=NAME,...",
    ),
]
