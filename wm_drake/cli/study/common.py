"""Options that the studies share, and a result folder with a ledger of finished runs."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wm_drake.cli.progress import progress_bar
from wm_drake.cli.result_folder import LEDGER, Run, check_is_folder, prepare_folder
from wm_drake.errors import InputError, Problem

if TYPE_CHECKING:
    import xarray as xr

    from wm_drake.batch.ledger import Ledger
    from wm_drake.model.machine import Machine
    from wm_drake.parameters import MachineParameters
    from wm_drake.simulation.cases import Case

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
ClusterOption = Annotated[
    str | None,
    typer.Option(
        help="Run on a dask.distributed cluster with the scheduler at this address.",
        metavar="ADDRESS",
    ),
]

SeedOption = Annotated[int, typer.Option(help="Seed of all random numbers.", min=0, metavar="N")]


@contextmanager
def problems_of_file(path: Path) -> Iterator[None]:
    """Add the path of a tolerance or design file to the problems that the block raises."""
    try:
        yield
    except InputError as error:
        raise InputError(
            Problem(": ".join(filter(None, [str(path), p.where])), p.key, p.message)
            for p in error.problems
        ) from None


def study_identity(
    study: str, machine: "MachineParameters", measures: tuple[str, ...], seed: int, **parts: Any
) -> dict[str, str]:
    """Return the properties that distinguish a study from others, for its ledger.

    The number of runs is not among them: a larger study continues a smaller one.

    Args:
        study: Kind of study.
        machine: The machine.
        measures: Measures of `simulate_many`.
        seed: Of all random numbers.
        parts: What else determines the runs, by name.
    """
    from wm_drake.batch import sources_version
    from wm_drake.batch.ledger import key_of

    numbers = machine.model_dump_json(exclude={"name", "about", "sources", "measured"})
    return {
        "study": study,
        "machine": f"{machine.name} {key_of(numbers=numbers)[:8]}",
        **{name: key_of(part=part)[:8] for name, part in parts.items()},
        "measures": ", ".join(measures),
        "seed": str(seed),
        "sources": sources_version(),
    }


@contextmanager
def batch_runner(
    built: "Machine",
    ledger: "Ledger",
    measures: tuple[str, ...],
    workers: int | None,
    cluster: str | None,
) -> "Iterator[Callable[[Iterable[Case], Callable[[int], None]], xr.Dataset]]":
    """Yield the function that runs cases: on the cores of this computer, or on a cluster.

    The function takes cases and what is called with the number of finished ones.
    """
    from wm_drake.batch import simulate_remembered
    from wm_drake.batch.cluster import cluster_client, simulate_on_cluster

    def run(
        simulate: "Callable[..., xr.Dataset]",
        cases: "Iterable[Case]",
        progress: Callable[[int], None],
    ) -> "xr.Dataset":
        return simulate(built, cases, ledger, measures=measures, progress=progress)

    if cluster is None:
        yield partial(run, partial(simulate_remembered, workers=workers))
    else:
        with cluster_client(cluster) as client:
            yield partial(run, partial(simulate_on_cluster, client=client))


def with_progress(
    batch: "Callable[[Iterable[Case], Callable[[int], None]], xr.Dataset]",
) -> "Callable[[Iterable[Case], str], xr.Dataset]":
    """Return the function that runs cases behind a progress bar.

    Args:
        batch: Function of `batch_runner`.

    Returns:
        Function of cases and of the word beside the bar.
    """

    def run(cases: "Iterable[Case]", what: str) -> "xr.Dataset":
        listed = list(cases)
        with progress_bar(len(listed), what) as progress:
            return batch(listed, progress)

    return run


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
