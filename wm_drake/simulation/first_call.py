"""The first run after an installation compiles in two processes; this module is the second one.

A run compiles the laws of the mounts with its set-up, the integration, and then what reads its
samples. The second process begins with what needs no set-up. Then it compiles the integration
before a batch, and before a single run what reads samples, which takes as long as the integration.
Files of compiled code take it from process to process, and neither compiles what the other does
(`wm_drake.compiler.claims`). Nothing is lost if the second one ends early.
"""

import atexit
import contextlib
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np

from wm_drake.compiler.compilation import CACHE_FOLDER, READ_ONLY_FOLDER
from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.linear import is_followed
from wm_drake.engines.compiled.midpoint import TUBES
from wm_drake.engines.compiled.packing import initial_state, pack
from wm_drake.engines.compiled.run import advance_of, one_run
from wm_drake.engines.compiled.samples import trajectory_of
from wm_drake.engines.compiled.stepping import Stepping
from wm_drake.engines.schedule import schedule_of
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Setup
from wm_drake.parameters import Load, MachineParameters, SpinProfile
from wm_drake.simulation.band import pass_band
from wm_drake.simulation.cases import Case
from wm_drake.simulation.displacements import amplitudes, filtered
from wm_drake.simulation.measures import measure
from wm_drake.simulation.records import as_record

STANDSTILL = SpinProfile(time=(0.0, 10.0), speed=(0.0, 0.0))
"""Long enough for the filter of the displacements."""


def compile_in_two_processes(parameters: MachineParameters, *, batch: bool = False) -> None:
    """Start the second process, once for each folder of compiled code.

    Args:
        parameters: The machine that is about to run.
        batch: Whether many runs follow whose samples are not kept.
    """
    started = Path(CACHE_FOLDER, "second_process")
    if READ_ONLY_FOLDER or not CACHE_FOLDER or (os.cpu_count() or 1) < 2:
        return
    try:
        machine = pickle.dumps((parameters, batch))
        started.open("x").close()
        second = subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except (OSError, pickle.PicklingError, AttributeError):
        return  # it was started before or cannot start, or a type of the machine is in a script
    atexit.register(_end, second, started)
    assert second.stdin is not None
    with contextlib.suppress(OSError), second.stdin:
        second.stdin.write(machine)


def _end(second: "subprocess.Popen[bytes]", started: Path) -> None:
    """End the second process if it still runs; the next run starts it again."""
    if second.poll() is None:
        second.terminate()
        started.unlink(missing_ok=True)


def compile_meanwhile(parameters: MachineParameters, *, batch: bool) -> None:
    """Compile what needs no set-up, then the integration or what reads samples.

    Arguments as for `compile_in_two_processes`.
    """
    period = parameters.output_period
    is_followed(np.zeros((WIDTH, 1, 1)), np.zeros(1, dtype=int), 1.0)
    at_rest = np.zeros((round(STANDSTILL.duration / period), 1))
    amplitudes(filtered(at_rest, period, pass_band(parameters.profile, period)))
    setup = build_machine(parameters).set_up()
    (compile_integration if batch else compile_readers)(setup)


def compile_readers(setup: Setup) -> None:
    """Compile what makes a record of samples and measures it, with samples at rest."""
    p, layout = pack(setup)
    period = setup.parameters.output_period
    schedule = schedule_of(STANDSTILL, period, period, layout.control_period)
    at_rest = np.pad(initial_state(setup, STANDSTILL), (0, layout.states.begins.rates))
    samples = np.tile(at_rest, (len(schedule.time), 1))
    trajectory = trajectory_of(samples, schedule, p, layout)
    measure(as_record(setup, Case("at rest", Load(unbalances=()), STANDSTILL), trajectory))


def compile_integration(setup: Setup) -> None:
    """Compile the loop of the integrator that the machine most likely takes."""
    period, count = setup.parameters.output_period, len(setup.telescopes)
    tubes = np.zeros((count, 2 * TUBES, 2 * TUBES))
    stepping = Stepping("midpoint" if count else "multistep", period, tubes)
    how = stepping.integrator, stepping.relaxation
    schedule, layout, lanes = one_run(setup, STANDSTILL, period, period, *how)
    advance_of(schedule, stepping.one_derivative(schedule), layout, lanes)(0, 0)


if __name__ == "__main__":
    machine, is_batch = pickle.load(sys.stdin.buffer)
    compile_meanwhile(machine, batch=is_batch)
