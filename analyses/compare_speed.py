"""How fast are the commands and the batches, and how fast beside another version?

Each task runs in a process of its own, once to compile and then five times, in turn with the same
task of another checkout if one is given. The script prints medians of the time on a clock and of
the processor time, and the median of the ratios of the pairs. On a shared machine the ratios say
more than the times. The other checkout is run by its own `.venv/bin/python` if it has one.

    python analyses/compare_speed.py --against ../wm_drake_before --page docs/performance.md

`--page` renews the rows of the table on the page; rows of other tasks keep their figures and their
dates. `--only` chooses tasks by a part of their name. All tasks take about 40 minutes.
"""

import argparse
import atexit
import datetime
import itertools
import json
import os
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

BEGIN, END = "<!-- speed: begin -->\n", "<!-- speed: end -->"
HEAD = (
    "| task | time, s | processor time, s | ratio | limit | measured |\n|---|---|---|---|---|---|\n"
)
GASKET = {"stiffness_x": 3711.0, "stiffness_y": 3285.7, "stiffness_z": 3711.0, "damping_x": 19.0}
"""Numbers of the gasket that vary. [N/m, N s/m]"""
TURNING = {
    "rotational_stiffness_x": 2.0, "rotational_stiffness_y": 205.6, "rotational_stiffness_z": 2.0,
}  # fmt: skip
"""Constant slopes of the other curves. [N m/rad]"""


def linear_machine() -> Any:
    """Return the reference machine with a gasket of constant stiffnesses, as in [B]'s study."""
    import wm_drake as wm

    reference = wm.load_machine("reference")
    gasket = reference.gasket.model_copy(update=GASKET | TURNING)
    return reference.model_copy(update={"gasket": gasket})


def gasket_machines(count: int) -> Iterator[Any]:
    """Yield machines with random gaskets, 0.5 to 1.5 times the shipped one."""
    import wm_drake as wm

    rng, reference = np.random.default_rng(0), linear_machine()
    for _ in range(count):
        numbers = {f"gasket.{k}": value * rng.uniform(0.5, 1.5) for k, value in GASKET.items()}
        yield wm.with_values(reference, numbers)


def gasket_cases(count: int, profile: Any = None) -> Iterator[Any]:
    """Yield two loads for each of count/2 random gaskets."""
    import wm_drake as wm

    for changed in gasket_machines(count // 2):
        for load in ("middle", "counter"):
            yield wm.Case(load, changed.loads[load], profile or changed.profile, parameters=changed)


def one_run(machine_name: str, load: str, engine: str) -> Callable[[], object]:
    """Return a function that runs one case and makes its record."""
    import wm_drake as wm

    machine = wm.build_machine(wm.load_machine(machine_name))
    return lambda: wm.simulate(machine, load, engine)


def batch(count: int, **options: object) -> Callable[[], object]:
    """Return a function that runs many gaskets with the measures D, F and M."""
    import wm_drake as wm

    machine = wm.build_machine(linear_machine())
    chosen = {"measures": ("extremes",)} | options
    return lambda: wm.simulate_many(machine, gasket_cases(count), **chosen)  # type: ignore[arg-type]


def first_call() -> Callable[[], object]:
    """Return a function that compiles everything that a run and a batch need."""
    os.environ["NUMBA_CACHE_DIR"] = tempfile.mkdtemp(dir=".")
    import wm_drake as wm

    machine = wm.build_machine(wm.load_machine("reference"))
    return lambda: (
        wm.simulate(machine, "middle"),
        wm.simulate_many(machine, [wm.case_of(machine.parameters, "middle")]),
    )


def slider_moves(count: int) -> Callable[[], object]:
    """Return a function that moves a slider and returns the times of a middle answer."""
    command = [sys.executable, "-m", "wm_drake", "studio", "--no-browser", "--folder", "."]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    atexit.register(server.terminate)
    address = server.stdout.readline().split()[-1]  # type: ignore[union-attr]
    state = {"machine": "reference", "load": "middle"}

    def post(path: str, **body: object) -> dict[str, Any]:
        request = urllib.request.Request(
            f"{address}api/{path}", json.dumps(body).encode(), {"Content-Type": "application/json"}
        )
        with urllib.request.urlopen(request) as response:
            return dict(json.load(response))

    post("run", page="page", state=state)

    def move() -> tuple[float, float]:
        times = []
        for stiffness in np.linspace(1.6, 6.2, count):
            values = {"gasket.stiffness_x": f"{stiffness:.6f} N/mm"}
            answer = post("run", page="page", state=state | {"values": values})
            times.append((answer["server_s"]["wall"], answer["server_s"]["cpu"]))
        wall, cpu = np.median(times, axis=0)
        return float(wall), float(cpu)

    return move


@dataclass(frozen=True)
class Task:
    """What is timed: a command in a new folder, or a function that this process makes."""

    command: str = ""
    make: Callable[[], Callable[[], object]] | None = None
    is_warm: bool = True  # the function runs once before it is timed
    returns_times: bool = False  # the function times itself
    limit: str = ""  # s, on a clock


STUDY = "--out out --quiet"
TASKS = {
    "`wm-drake --help`": Task("--help"),
    "16 runs, D, F, M": Task(make=lambda: batch(16)),
    "`wm-drake machine show reference`": Task("machine show reference"),
    "first run and batch after installation": Task(make=first_call, is_warm=False, limit="15"),
    "one run of `reference`, 70 s, with its record": Task(
        make=lambda: one_run("reference", "middle", "compiled")
    ),
    "the same, Drake engine": Task(make=lambda: one_run("reference", "middle", "drake")),
    "one run of `free_stroke`, tubes as bodies, 130 s": Task(
        make=lambda: one_run("free_stroke", "front", "compiled")
    ),
    "2000 runs of `reference`, D, F, M": Task(make=lambda: batch(2000)),
    "the same, four derivatives a step": Task(make=lambda: batch(2000, integrator="runge_kutta")),
    "a move of a slider in the studio, median of 100": Task(
        make=lambda: slider_moves(100), returns_times=True, limit="0.1"
    ),
    "`spin`": Task(f"spin {STUDY}"),
    "`study gasket`, 2000 runs": Task(f"study gasket --load middle --load counter {STUDY}"),
    "`study gasket --design full`, 13 122 runs": Task(
        f"study gasket --design full --load middle --load counter {STUDY}"
    ),
    "`study spin-cycle --machine free_stroke`, 33 runs of 130 s": Task(
        f"study spin-cycle --machine free_stroke {STUDY}"
    ),
    "`study spin-cycle --machine reference`, 33 runs of 130 s": Task(
        f"study spin-cycle --machine reference {STUDY}"
    ),
    "`study tolerance laundry_and_parts`, 14 336 runs": Task(
        f"study tolerance laundry_and_parts --samples 1024 --sensitivity 1024 --subset 0 {STUDY}"
    ),
    "`study tolerance laundry`, 16 384 runs": Task(
        f"study tolerance laundry --samples 8192 --sensitivity 1024 --subset 0 {STUDY}"
    ),
    "`study design gasket --evaluations 5000`, 10 112 runs": Task(
        f"study design gasket --evaluations 5000 {STUDY}"
    ),
    "`study modes`": Task(f"study modes {STUDY}"),
    "`study response`": Task(f"study response {STUDY}"),
    "`identify damper`, 60 loops, mstv, stv_sponge, havsin": Task(
        f"identify damper LOOPS --law mstv,stv_sponge,havsin --component mstv_damper {STUDY}",
        limit="60",
    ),
}
QUICK = 2  # tasks


def write_loops(folder: Path) -> str:
    """Write sixty computed loops of the law MSTV, with noise of 1 %; return their paths."""
    from wm_drake.parameters import load_component
    from wm_drake.rigs import Harmonic, damper_bench, force_loops

    frequencies = (1.0, 2.0, 3.0, 5.0, 6.67, 10.0)
    strokes = (0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)
    motions = [Harmonic(f, 1e-3 * a) for f, a in itertools.product(frequencies, strokes)]
    rng, bench = np.random.default_rng(0), damper_bench(load_component("mstv_damper").parameters)
    for number, loop in enumerate(force_loops(bench, motions)):
        noise = 0.01 * np.abs(loop.force).max() * rng.normal(size=len(loop.force))
        columns = np.column_stack([loop.time, 1e3 * loop.displacement, loop.force + noise])
        head = "time_s,displacement_mm,force_N"
        path = folder / f"loop_{number}.csv"
        np.savetxt(path, columns[::4], delimiter=",", header=head, comments="")
    return " ".join(str(path) for path in sorted(folder.glob("loop_*.csv")))


def spent(who: int) -> tuple[float, float]:
    """Return the time on a clock and the processor time of this process or its children. [s]"""
    usage = resource.getrusage(who)
    return time.perf_counter(), usage.ru_utime + usage.ru_stime


def time_function(name: str) -> None:
    """Time the function of a task in this process and print both times."""
    task = TASKS[name]
    work = task.make()  # type: ignore[misc]
    if task.is_warm:
        work()
    begin = spent(resource.RUSAGE_SELF)
    result = work()
    end = spent(resource.RUSAGE_SELF)
    print(*(result if task.returns_times else np.subtract(end, begin)))


def time_task(name: str, checkout: Path, loops: str) -> tuple[float, float]:
    """Run a task with the package of a checkout; return both times. [s]"""
    environment_python = checkout / ".venv" / "bin" / "python"
    python = str(environment_python) if environment_python.exists() else sys.executable
    environment = os.environ | {"PYTHONPATH": str(checkout)}
    task = TASKS[name]
    with tempfile.TemporaryDirectory() as folder:
        if task.make:
            arguments = [str(Path(__file__).resolve()), "--function", name]
        else:
            arguments = ["-m", "wm_drake", *task.command.replace("LOOPS", loops).split()]
        begin = spent(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [python, *arguments],
            cwd=folder,
            env=environment,
            check=True,
            capture_output=True,
            text=True,
        )
        end = spent(resource.RUSAGE_CHILDREN)
    if task.make:
        wall, cpu = map(float, done.stdout.split())
        return wall, cpu
    return end[0] - begin[0], end[1] - begin[1]


def measured_row(name: str, checkouts: list[Path], repeats: int, loops: str) -> str:
    """Return the row of a task: medians of this version, and of the ratios to the other one."""
    times = []
    for number in range(repeats + (repeats > 1)):  # the first round compiles
        pair = [time_task(name, checkout, loops) for checkout in checkouts]
        if number or repeats == 1:
            times.append(pair)
    wall, cpu = (statistics.median(pair[0][i] for pair in times) for i in (0, 1))
    ratio = ""
    if len(checkouts) > 1:
        ratio = f"{statistics.median(pair[0][1] / pair[1][1] for pair in times):.2f}"
    today = datetime.datetime.now(tz=datetime.UTC).date()
    limit = TASKS[name].limit
    return f"| {name} | {wall:.3g} | {cpu:.3g} | {ratio} | {limit} | {today}, median of {repeats} |"


def renewed(page: str, rows: dict[str, str]) -> str:
    """Return a page whose table has these rows; rows of other tasks keep their figures."""
    before, table, after = re.split(f"{BEGIN}(.*?){END}", page, flags=re.DOTALL)
    old = {line.split(" | ")[0].removeprefix("| "): line for line in table.splitlines()[2:]}
    lines = [(old | rows)[name] for name in TASKS if name in old | rows]
    return before + BEGIN + HEAD + "\n".join(lines) + "\n" + END + after


def main() -> None:
    """Time the tasks, print their rows and renew the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="another checkout, timed in turn")
    parser.add_argument("--only", default="", help="part of the names of the tasks")
    parser.add_argument("--page", type=Path, help="page whose table is renewed")
    parser.add_argument("--out", type=Path, help="also write the rows to this file")
    parser.add_argument("--quick", action="store_true", help="once, the two shortest tasks")
    parser.add_argument("--function", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.function:
        time_function(arguments.function)
        return
    checkouts = [Path(__file__).resolve().parents[1]]
    if arguments.against:
        checkouts.append(arguments.against.resolve())
    names = [name for name in TASKS if arguments.only in name]
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        loops = write_loops(Path(folder)) if any("identify" in name for name in names) else ""
        for name in names[:QUICK] if arguments.quick else names:
            rows[name] = measured_row(name, checkouts, 1 if arguments.quick else 5, loops)
            print(rows[name], flush=True)
    if arguments.out:
        arguments.out.write_text("\n".join(rows.values()) + "\n", encoding="utf-8")
    if arguments.page:
        arguments.page.write_text(renewed(arguments.page.read_text(encoding="utf-8"), rows))


if __name__ == "__main__":
    main()
