"""How long does the Drake engine take for a derivative and for a run of the reference machine?

Prints the median of several, with the processor and its load: absolute times mean little on a shared machine.
"""

import argparse
import os
import platform
import statistics
import time
from pathlib import Path

import numpy as np

from wm_drake import build_machine, case_of, load_machine, simulate
from wm_drake.machine import Machine
from wm_drake.parameters import SpinProfile


def processor() -> str:
    """Name of the processor, as well as the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def derivative_us(machine: Machine, count: int) -> float:
    """Median time of one state derivative of the diagram at changing states. [us]"""
    context = machine.set_up(machine.parameters.loads["middle"]).context
    rng = np.random.default_rng(0)
    states = rng.normal(0.0, 0.01, (count, machine.diagram.CreateDefaultContext().num_continuous_states()))
    times = []
    for state in states:
        context.SetContinuousState(state)
        begin = time.perf_counter()
        machine.diagram.EvalTimeDerivatives(context)
        times.append(time.perf_counter() - begin)
    return 1e6 * statistics.median(times)


def main() -> None:
    """Runs the benchmark and prints one line a figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a run of 5 s, twice, instead of 70 s five times")
    parser.add_argument("--out", type=Path, help="also write the lines to this file")
    arguments = parser.parse_args()
    parameters = load_machine("reference")
    machine = build_machine(parameters)
    case = case_of(parameters, "middle")
    if arguments.quick:
        case = type(case)("quick", case.load, SpinProfile(time=(0.0, 5.0), speed=(0.0, 5.0)))
    simulate(machine, case)  # warms up: the laws are compiled or read from their cache
    walls = []
    for _ in range(2 if arguments.quick else 5):
        begin = time.perf_counter()
        simulate(machine, case)
        walls.append(time.perf_counter() - begin)
    duration = case.profile.duration
    lines = [
        f"processor: {processor()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.2f}",
        f"one derivative: {derivative_us(machine, 500 if arguments.quick else 5000):.1f} us (median)",
        f"one run of {duration:g} s: {statistics.median(walls):.2f} s (median of {len(walls)}; "
        f"{min(walls):.2f} to {max(walls):.2f} s)",
    ]
    print("\n".join(lines))
    if arguments.out:
        arguments.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
