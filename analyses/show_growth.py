"""How do time and memory of an experiment grow with the number of its runs, here and on a cluster?

Each size runs in a process of its own: gaskets of the reference machine with two loads each, with
D, F and M, and a ledger in a file, on two threads, and on a dask cluster of two processes with one
thread each, whose scheduler has a process of its own. The memory is the largest of the process that
asks for the runs, less what it has before.

    python analyses/show_growth.py --picture docs/pictures/growth.png
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from compare_speed import gasket_machines, linear_machine

import wm_drake as wm
from wm_drake.batch.cluster import cluster_client
from wm_drake.batch.ledger import open_ledger
from wm_drake.report.drawing import matplotlib_of
from wm_drake.report.figure import OURS, QUIET, Axis, Figure, Line, Panel, in_grid
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment

SIZES = (1000, 10_000, 100_000)
WARM = 200
"""Runs before the time begins, which load and compile everything that runs need."""

LOADS = ("middle", "counter")
HERE, CLUSTER = "here, two threads", "cluster of two processes"
PLACES = (HERE, CLUSTER)


@contextmanager
def cluster() -> Iterator[Any]:
    """Yield a client of a cluster of two processes of this computer."""
    from dask.distributed import Client

    dask = [sys.executable, "-m", "dask"]
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        file = Path(folder) / "scheduler.json"
        for words in (("scheduler", "--port", "0"), *[("worker", "--nthreads", "1")] * 2):
            command = [*dask, *words, "--scheduler-file", str(file), "--no-dashboard"]
            process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
            stack.callback(process.wait)
            stack.callback(process.terminate)
        with Client(scheduler_file=str(file), timeout=60.0) as client:
            client.wait_for_workers(2)
            address = client.scheduler.address
        yield stack.enter_context(cluster_client(address))


@contextmanager
def growing(place: str) -> Iterator[Callable[[int], object]]:
    """Yield the function that makes an experiment of some runs at a place."""
    base = linear_machine()
    machine, loads = wm.build_machine(base), tuple(wm.case_of(base, name) for name in LOADS)
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        client = stack.enter_context(cluster()) if place == CLUSTER else None

        def run(count: int) -> object:
            path, points = Path(folder) / f"{count}.sqlite", range(count // len(LOADS))
            with open_ledger(path, {"study": "growth"}) as ledger:
                executor = Executor(ledger, client=client)
                experiment = Experiment(machine, ("extremes",), executor.simulate, loads)
                return experiment.at(points, gasket_machines(len(points)))

        yield run


def peak_mb() -> float:
    """Return the largest memory that this process has had. [MB]"""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def measured(place: str, count: int) -> dict[str, float]:
    """Return times per run [ms] and growth of the memory [MB] of a batch, from a new process."""
    command = [sys.executable, __file__, "--place", place, "--count", str(count)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def measure_here(place: str, count: int) -> None:
    """Print times per run and growth of the memory of a batch in this process."""
    with growing(place) as run:
        run(min(WARM, count // 2))
        before, begin, used = peak_mb(), time.perf_counter(), time.process_time()
        run(count)
        spent, used = time.perf_counter() - begin, time.process_time() - used
    each = 1e3 / count
    print(json.dumps({"ms": each * spent, "cpu_ms": each * used, "mb": peak_mb() - before}))


def figure(sizes: tuple[int, ...], found: dict[str, list[dict[str, float]]]) -> Figure:
    """Return time per run and growth of the memory over the number of runs."""
    panels = []
    for name, label in (("ms", "time per run, ms"), ("mb", "memory of the caller, MB more")):
        marks = tuple(
            Line(sizes, [row[name] for row in rows], color=color, key=place)
            for (place, rows), color in zip(found.items(), (OURS, QUIET), strict=True)
        )
        x, y = Axis(label="runs", is_log=True), Axis(label=label, range=(0.0, None))
        panels.append(Panel(title=label, marks=marks, x=x, y=y))
    return Figure(panels=in_grid(panels, 2), height=280.0)


def main() -> None:
    """Measure all sizes, print the numbers, and draw them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="one small size")
    parser.add_argument("--picture", type=Path, help="PNG to write")
    parser.add_argument("--out", type=Path, help="also write the lines to this file")
    parser.add_argument("--place", choices=PLACES, help=argparse.SUPPRESS)
    parser.add_argument("--count", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.place:
        measure_here(arguments.place, arguments.count)
        return
    sizes = (8,) if arguments.quick else SIZES
    found: dict[str, list[dict[str, float]]] = {place: [] for place in PLACES}
    lines = []
    for place, rows in found.items():
        for count in sizes:
            rows.append(measured(place, count))
            spent, used, more = (rows[-1][name] for name in ("ms", "cpu_ms", "mb"))
            lines.append(
                f"{place}, {count} runs: {spent:.2f} ms a run, {used:.2f} ms of processor time in "
                f"the process that asks, {more:.0f} MB more"
            )
            print(lines[-1], file=sys.stderr)
    text = "\n".join(lines)
    print(text)
    if arguments.out:
        arguments.out.write_text(text + "\n", encoding="utf-8")
    if arguments.picture:
        matplotlib_of(figure(sizes, found)).savefig(arguments.picture, dpi=110)


if __name__ == "__main__":
    main()
