"""How fast are the engines, and how does the time of a batch grow with the number of its runs?

Prints medians of several runs after a warm-up, with the processor and its load. On a shared machine
absolute times mean little; compare ratios of one session. Also prints whether the lanes of the
compiled engine use the vector units.
"""

import argparse
import os
import platform
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np
from scipy.integrate import solve_ivp

from wm_drake import (
    Case,
    Scene,
    build_machine,
    load_machine,
    measure,
    simulate,
    simulate_many,
    with_values,
)
from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.derivative import StateDerivative
from wm_drake.engines.compiled.integration import integrate_lanes
from wm_drake.engines.compiled.packing import initial_state
from wm_drake.model.machine import Machine
from wm_drake.parameters import (
    GASKET_FACTORS,
    SpinProfile,
    at_levels,
    levels_of,
    load_factors,
    quantities,
)

GASKET = tuple(
    f"gasket.{name}"
    for name in ("damping", "rotational_damping", "stiffness", "rotational_stiffness")
)
FIRST_CALL = """
import time, wm_drake as wm
machine = wm.build_machine(wm.load_machine("reference"))
begin = time.perf_counter(); wm.simulate(machine, "middle"); print(time.perf_counter() - begin)
case = wm.case_of(machine.parameters, "middle")
begin = time.perf_counter(); wm.simulate_many(machine, [case]); print(time.perf_counter() - begin)
"""


@dataclass(frozen=True)
class Size:
    """The extent of the benchmark."""

    profile: SpinProfile
    repeats: int
    drake_repeats: int
    many: tuple[int, ...]


def median_s(work: Callable[[], object], repeats: int) -> float:
    """Return the median time of a piece of work. [s]"""
    walls = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        walls.append(time.perf_counter() - begin)
    return statistics.median(walls)


def processor() -> str:
    """Return the name of the processor as the system reports it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def gasket_cases(machine: Machine, profile: SpinProfile, count: int) -> Iterator[Case]:
    """Yield two loads for each of count/2 random gaskets.

    Their stiffness and damping are 0.5 to 1.5 times the nominal ones.
    """
    rng = np.random.default_rng(0)
    nominal = [
        (key, value)
        for key, value, _ in quantities(machine.parameters)
        if key.startswith(GASKET)
        and not key.endswith(("displacement", "angle"))  # abscissas of tables stay
    ]
    for _ in range(count // 2):
        numbers = {}
        for key, value in nominal:
            times = rng.uniform(0.5, 1.5)
            numbers[key] = (
                tuple(times * part for part in value) if isinstance(value, tuple) else times * value
            )
        changed = with_values(machine.parameters, numbers)
        for load in ("middle", "counter"):
            yield Case(load, changed.loads[load], profile, parameters=changed)


def one_run(machine: Machine, size: Size) -> Iterator[str]:
    """Time both engines on one run, and scipy's LSODA on the compiled time derivative."""
    case, scene = (
        Case("middle", machine.parameters.loads["middle"], size.profile),
        Scene(machine.parameters),
    )
    run = {
        "compiled": lambda: simulate(machine, case),
        "runge_kutta": lambda: simulate(machine, case, integrator="runge_kutta"),
        "drake": lambda: simulate(machine, case, "drake"),
    }
    record = run["compiled"]()
    measure(record, scene)
    measured = median_s(lambda: measure(run["compiled"](), scene), size.repeats)
    run["runge_kutta"]()
    compiled, runge_kutta = (
        median_s(run[name], size.repeats) for name in ("compiled", "runge_kutta")
    )
    drake = median_s(run["drake"], size.drake_repeats)
    lsoda = median_s(lambda: by_lsoda(machine, case), size.drake_repeats)
    yield (
        f"one run of {case.profile.duration:g} s: {1e3 * compiled:.0f} ms compiled, "
        f"{1e3 * measured:.0f} ms with all measures"
    )
    yield (
        f"the same with four derivatives a step: {1e3 * runge_kutta:.0f} ms, "
        f"{runge_kutta / compiled:.2f} times as long"
    )
    yield f"the same, Drake engine: {drake:.2f} s, {drake / compiled:.0f} times as long"
    yield (
        f"the same, LSODA (rtol 1e-6) on the compiled time derivative: {lsoda:.2f} s, "
        f"{lsoda / compiled:.0f} times as long"
    )


def by_lsoda(machine: Machine, case: Case) -> None:
    """Integrate the motion with scipy's stiff integrator, one piece of the profile at a time."""
    setup = machine.set_up(case.load)
    derivative, x = StateDerivative(setup), initial_state(setup, case.profile)

    def rate(_: float, x: np.ndarray, acceleration: float) -> np.ndarray:
        return derivative(x, acceleration)

    corners = case.profile.time
    for begin, end, acceleration in zip(
        corners, corners[1:], case.profile.acceleration(), strict=False
    ):
        samples = np.arange(begin, end, 5e-3)
        options = {"method": "LSODA", "rtol": 1e-6, "atol": 1e-9, "max_step": 0.02}
        x = solve_ivp(
            rate, (begin, end), x, t_eval=np.append(samples, end), args=(acceleration,), **options
        ).y[:, -1]


def many_runs(machine: Machine, size: Size) -> Iterator[str]:
    """Time batches of different numbers of runs, and read the peak memory of the process.

    The largest batch of each kind but 10 000 runs is repeated with four derivatives a step.
    """
    parameters = machine.parameters
    constant = build_machine(
        at_levels(parameters, levels_of(parameters, load_factors(GASKET_FACTORS)), [0] * 8)
    )
    alone, both = ("extremes",), ("extremes", "amplitudes")
    for what, kind, measures, counts in (
        ("D, F, M, stiffness constant as in the study", constant, alone, size.many),
        ("D, F, M and amplitudes, stiffness constant", constant, both, size.many[-2:-1]),
        ("D, F, M, tables of stiffness", machine, alone, size.many[-2:-1]),
    ):
        for count in counts:
            begin = time.perf_counter()
            simulate_many(kind, gasket_cases(kind, size.profile, count), measures=measures)
            wall = time.perf_counter() - begin
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
            yield (
                f"{count} runs with {what}: {wall:.2f} s, {1e3 * wall / count:.2f} ms each; "
                f"{memory:.0f} MB at most so far"
            )
        count = size.many[-2]
        spent = {
            name: cpu_s(kind, gasket_cases(kind, size.profile, count), measures, name)
            for name in ("auto", "runge_kutta")
        }
        yield (
            f"{count} runs with {what}, processor time: {1e3 * spent['auto'] / count:.2f} ms each; "
            f"with four derivatives a step {spent['runge_kutta'] / spent['auto']:.2f} times as long"
        )


def cpu_s(
    machine: Machine, cases: Iterator[Case], measures: tuple[str, ...], integrator: str
) -> float:
    """Return the processor time of a batch with an integrator. [s]"""
    begin = time.process_time()
    simulate_many(machine, cases, measures=measures, integrator=integrator)
    return time.process_time() - begin


def assembly() -> str:
    """Count the vector instructions in the compiled kernel, from a copy compiled here."""
    fresh = numba.njit(error_model="numpy", nogil=True, fastmath={"contract", "nsz"})(
        integrate_lanes.py_func
    )
    fresh.compile(integrate_lanes.signatures[0])
    text = fresh.inspect_asm(fresh.signatures[0])
    arithmetic = re.findall(
        r"^\s+v?(?:add|sub|mul|div|sqrt|fn?m(?:add|sub)\d+)(pd|sd)\s(.*)$", text, re.MULTILINE
    )
    wide = {
        name: sum(f"%{name}" in operands for kind, operands in arithmetic if kind == "pd")
        for name in ("zmm", "ymm", "xmm")
    }
    counts = ", ".join(f"{count} on {name}" for name, count in wide.items())
    scalar = sum(kind == "sd" for kind, _ in arithmetic)
    return f"{WIDTH} lanes compiled to arithmetic: {counts}, {scalar} on one number"


def first_calls() -> Iterator[str]:
    """Time the first run with an empty cache, and the first run of a process with a filled one."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": folder}
        for what in ("nothing compiled yet", "compiled before"):
            command = [sys.executable, "-c", FIRST_CALL]
            told = subprocess.run(
                command, env=environment, capture_output=True, text=True, check=True
            ).stdout.split()
            yield (
                f"first run of a process, {what}: simulate {float(told[0]):.1f} s, "
                f"then simulate_many {float(told[1]):.1f} s"
            )


def main() -> None:
    """Run the benchmark and print one line for each result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="runs of 2 s instead of 70 s, a few dozen of them"
    )
    parser.add_argument("--out", type=Path, help="also write the lines to this file")
    arguments = parser.parse_args()
    machine = build_machine(load_machine("reference"))
    size = Size(machine.parameters.profile, 15, 3, (100, 1000, 2000, 10_000))
    if arguments.quick:
        size = Size(SpinProfile(time=(0.0, 2.0), speed=(0.0, 9.0)), 3, 1, (16, 32))
    simulate_many(
        machine, gasket_cases(machine, size.profile, 2)
    )  # warm-up: compile, or read from the cache
    lines = [f"processor: {processor()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.2f}"]
    print(lines[0])
    parts = [one_run(machine, size), many_runs(machine, size)]
    if not arguments.quick:
        parts += [iter([assembly()]), first_calls()]
    for part in parts:
        for line in part:
            print(line, flush=True)
            lines.append(line)
    if arguments.out:
        arguments.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
