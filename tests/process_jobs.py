"""Work of processes that tests start; a process of its own must be able to import it."""

import os
import signal

from wm_drake.errors import input_error


def begin(*chosen):
    """Begin a worker that needs no machine."""


def doubled(number, item):
    """Return twice a number with its place; a string is a fault: a signal, or a wrong key."""
    if item == "SIGKILL":
        os.kill(os.getpid(), signal.SIGKILL)
    if item == "exit":
        os._exit(1)
    if isinstance(item, str):
        raise input_error("not a number", key=item)
    return [(number, 2 * item)]


def answer_of_runs(connection):
    """Send the number of results of two short runs of pydrake, for which two workers are asked."""
    import wm_drake as wm

    parameters = wm.load_machine("reference")
    profile = parameters.profile.model_copy(update={"time": (0.0, 0.02), "speed": (0.0, 60.0)})
    cases = [wm.Case(name, parameters.loads["middle"], profile) for name in "ab"]
    connection.send(len(wm.run_spin(parameters, cases, "drake", workers=2).results))
