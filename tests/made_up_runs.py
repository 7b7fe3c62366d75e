"""Experiments whose runs are a function of known answer, in place of simulations."""

from types import SimpleNamespace

import numpy as np

from wm_drake.studies.experiment import Experiment


def made_up(run, parameters=None, loads=()):
    """Return an experiment of which a function of the cases gives the table of runs.

    Args:
        run: Function; no run has failed if its table does not say so.
        parameters: Those of the machine.
        loads: Case of each load.
    """

    def simulate(_machine, _measures, cases, _what):
        table = run(list(cases))
        if "diverged" in table:
            return table
        none = np.full(table.sizes["run"], "", dtype=object)
        return table.assign(diverged=("run", none))

    return Experiment(SimpleNamespace(parameters=parameters), (), simulate, tuple(loads))
