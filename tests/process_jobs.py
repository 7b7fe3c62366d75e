"""Work of processes that tests start; a process of its own must be able to import it."""

import os
import signal
import time

from wm_drake.errors import input_error
from wm_drake.studies.spin.processes import can_start_processes, map_in_processes


def doubled(item, report):
    """Return twice a number; a string is a fault: a name of a signal, or a wrong key."""
    if item == "SIGKILL":
        os.kill(os.getpid(), signal.SIGKILL)
    if isinstance(item, str):
        raise input_error("not a number", key=item)
    report(0.5)
    time.sleep(item)
    report(1.0)
    return 2 * item


def answer(connection):
    """Send whether this process may start others."""
    connection.send(can_start_processes())


def answer_of_workers(connection):
    """Send what two worker processes of this process compute."""
    connection.send(map_in_processes(doubled, [0.0, 0.1], 2, lambda *report: None))


def answer_of_runs(connection):
    """Send the number of results of two short runs of pydrake, for which two workers are asked."""
    import wm_drake as wm

    parameters = wm.load_machine("reference")
    profile = parameters.profile.model_copy(update={"time": (0.0, 0.02), "speed": (0.0, 60.0)})
    cases = [wm.Case(name, parameters.loads["middle"], profile) for name in "ab"]
    connection.send(len(wm.run_spin(parameters, cases, "drake", workers=2).results))
