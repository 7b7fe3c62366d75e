"""Options that the studies share, and a result folder with a ledger of finished runs."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wm_drake.cli.result_folder import LEDGER, Run, check_is_folder, prepare_folder

if TYPE_CHECKING:
    from wm_drake.batch.ledger import Ledger

RUNS_KEPT = (
    "all runs are kept, so repeat the command to write the results without running them again"
)
"""What is kept if the results of a study cannot be written."""

WorkersOption = Annotated[
    int | None, typer.Option(help="Number of cores. Default: all.", min=1, metavar="N")
]
ResumeOption = Annotated[
    bool, typer.Option("--resume", help="Continue an unfinished study in the same folder.")
]
ProfileOption = Annotated[
    Path | None,
    typer.Option(
        help="Spin profile, YAML or CSV (time_s, speed_rpm). Default: that of the machine.",
        metavar="FILE",
    ),
]


@contextmanager
def study_ledger(
    out: Path, run: Run, identity: Mapping[str, str], resume: bool
) -> "Iterator[Ledger]":
    """Open the ledger of a study in its folder, and create the folder if it does not exist.

    Ctrl-C ends the command with exit code 130 and a message about the runs that are kept. If this
    function created the folder and no run finished, it removes the folder again.
    """
    from wm_drake.batch.ledger import open_ledger

    check_is_folder(out)
    created = not out.exists()
    prepare_folder(out, run)
    kept = 0
    try:
        with open_ledger(out / LEDGER, identity, resume=resume, replace=run.overwrite) as ledger:
            try:
                yield ledger
            finally:
                kept = len(ledger)
    except KeyboardInterrupt:
        typer.echo(
            f"interrupted; {kept} finished runs are kept in {out / LEDGER}; continue with --resume",
            err=True,
        )
        raise typer.Exit(130) from None
    finally:
        if created and not kept:
            for path in (*out.glob(f"{LEDGER}*"), out):
                path.unlink() if path.is_file() else path.rmdir()
