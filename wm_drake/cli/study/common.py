"""What studies share: options, and a folder with a ledger that survives interruptions."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.errors import input_error

if TYPE_CHECKING:
    from wm_drake.batch.ledger import Ledger

LEDGER = "ledger.sqlite"
"""Name of the ledger in a study's folder."""

WorkersOption = Annotated[
    int | None, typer.Option(help="Cores to use; all by default.", min=1, metavar="N")
]
ResumeOption = Annotated[
    bool, typer.Option("--resume", help="Go on with an unfinished study in the same folder.")
]
ProfileOption = Annotated[
    Path | None, typer.Option(help="Spin profile, YAML or CSV (time_s,speed_rpm).", metavar="FILE")
]


@contextmanager
def study_ledger(out: Path, identity: Mapping[str, str], resume: bool) -> "Iterator[Ledger]":
    """The ledger of the study in a folder, which is made if it is not there.

    Ctrl-C ends the command with code 130 and says what is kept. A folder that was made here and holds no result is removed
    again.
    """
    from wm_drake.batch.ledger import open_ledger

    if out.exists() and not out.is_dir():
        raise input_error("is a file, needs to be a folder", where=str(out))
    made = not out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise input_error(f"cannot be written to: {error.strerror}", where=str(out)) from None
    kept = 0
    try:
        with open_ledger(out / LEDGER, identity, resume=resume) as ledger:
            try:
                yield ledger
            finally:
                kept = len(ledger)
    except KeyboardInterrupt:
        typer.echo(
            f"interrupted; {kept} finished runs are kept in {out / LEDGER}: go on with --resume",
            err=True,
        )
        raise typer.Exit(130) from None
    finally:
        if made and not kept:
            for path in (*out.glob(f"{LEDGER}*"), out):
                path.unlink() if path.is_file() else path.rmdir()
