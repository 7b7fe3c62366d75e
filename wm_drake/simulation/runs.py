"""simulate(machine, case) -> Record: run one case with the engine of choice."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from wm_drake.engines import DEFAULT_ENGINE
from wm_drake.engines.compiled.packing import pack
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.engines.compiled.stepping import choose_stepping
from wm_drake.engines.drake import PEAKS_WITHIN, run_drake, run_drake_accurately
from wm_drake.engines.trajectory import Trajectory
from wm_drake.errors import check_known, input_error
from wm_drake.model.build import AnyMachine, machine_of
from wm_drake.model.machine import Machine
from wm_drake.parameters.machine import Integrator
from wm_drake.simulation.cases import Case, case_of, notice_jumping_friction
from wm_drake.simulation.convergence import COMPARED, Accuracy, Attempt, attributes_of, judged
from wm_drake.simulation.first_call import compile_in_two_processes
from wm_drake.simulation.measures import measure
from wm_drake.simulation.records import Record, as_record
from wm_drake.simulation.steps import checked_integrator, checked_step

Engine: TypeAlias = Callable[..., Trajectory]
"""Arguments: machine at rest, profile, step [s], progress called with the fraction done."""

ENGINES: dict[str, Engine] = {
    "compiled": run_compiled,
    "drake": run_drake,
    "drake-accurate": run_drake_accurately,
}


class DivergenceWarning(UserWarning):
    """A run diverged and stopped early; attrs["diverged"] of its record gives time and reason."""


def simulate(
    machine: AnyMachine,
    case: Case | str,
    engine: str = DEFAULT_ENGINE,
    *,
    step: float | None = None,
    integrator: str | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> Record:
    """Simulate one case of a machine and return its record.

    Args:
        machine: A built machine, its parameters, or its name or file.
        case: The case to run, or the name of one of the machine's loads.
        engine: Name of an engine in `ENGINES`.
        step: Largest step; the output period of the machine must be an integer multiple of it. If
            None, that of the machine. A run that is not accurate with it has shorter ones; its
            attrs["step_s"], ["error"] and ["converged"] say which and how accurate. [s]
        integrator: Integrator of the compiled engine, "auto", "multistep", "midpoint" or
            "runge_kutta"; None for that of the machine. With "auto" the steps may be shorter.
        progress: Called from time to time with the fraction done.

    Returns:
        The record, sampled at the output period; it starts at time 0 in the rest pose. If the run
        diverges, the record ends there, attrs["diverged"] gives the reason, and a
        DivergenceWarning is issued.

        A record is an xarray Dataset. A notebook shows it with its variables and units. Each
        variable has `plot`, and `to_pandas` or `to_dataframe`. The Dataset has no plot of its own,
        since its variables have different units. Its table would have a row for each combination
        of all labels; choose variables first.

    Raises:
        InputError: the load or the engine is unknown, the step size does not divide the output
            period, or the machine cannot be set up with the parameters of the case.

    Example:
        >>> import wm_drake as wm
        >>> record = wm.simulate("reference", "middle")
        >>> record.displacement.dims, float(record.time[-1])
        (('time', 'sensor'), 70.0)
        >>> lines = record.displacement.plot.line(x="time")  # a line for each sensor
        >>> curve = record.mount_force.sel(mount="gasket", axis="x").plot()
        >>> record.displacement.to_pandas().columns.tolist()
        ['Xr', 'Yr', 'Zr', 'Xf', 'Yf', 'Zf']
        >>> record[["drum_speed", "motor_torque"]].to_dataframe().shape
        (14001, 2)
    """
    machine = machine_of(machine)
    check_known(engine, ENGINES, f"no engine '{engine}'", key="engine")
    if engine == DEFAULT_ENGINE:
        compile_in_two_processes(machine.parameters)
    step = checked_step(machine.parameters, step)
    if isinstance(case, str):
        case = case_of(machine.parameters, case)
    chosen = checked_integrator(machine.parameters, integrator)
    if integrator is not None and engine != DEFAULT_ENGINE:
        raise input_error(f"is of the compiled engine, not of '{engine}'", key="integrator")
    if engine == DEFAULT_ENGINE:  # the other one controls its error
        record = _accurate(machine, case, step, chosen, progress)
    else:
        setup = machine.set_up(case.load, parameters=case.parameters, gasket=case.gasket)
        trajectory = ENGINES[engine](setup, case.profile, step, progress)
        accuracy = Accuracy(PEAKS_WITHIN[engine], 1.0, step, 0.0)
        how = {"engine": engine} | attributes_of(accuracy)
        record = as_record(setup, case, trajectory).assign_attrs(how)
    if record.attrs["diverged"]:
        warnings.warn(record.attrs["diverged"], DivergenceWarning, stacklevel=2)
    return record


def _accurate(
    machine: Machine,
    case: Case,
    step: float,
    integrator: Integrator,
    progress: Callable[[float], None],
) -> Record:
    """Return the record of a run of the compiled engine, repeated until it is accurate."""
    numbers: dict[str, Any] = {"parameters": case.parameters, "gasket": case.gasket}
    setup, before, halvings = machine.set_up(**numbers), None, 0
    parameters = setup.parameters
    notice_jumping_friction(parameters)
    stepping = choose_stepping(setup, *pack(setup), case.profile, step, integrator)
    setup = machine.set_up(case.load, context=setup.context, **numbers)
    period = case.profile.sample_period(parameters.output_period)
    while True:
        trajectory = run_compiled(
            setup, case.profile, stepping.step, progress, period, stepping.integrator,
            stepping.relaxation if stepping.integrator == "midpoint" else None
        )  # fmt: skip
        assert trajectory.estimates is not None  # the compiled engine estimates its errors
        record = as_record(setup, case, trajectory)
        attempt = Attempt(trajectory.estimates, stepping.step, halvings, record.attrs["diverged"])
        if before or not attempt.holds(parameters.accuracy):
            attempt = replace(attempt, **_compared(record))
        accuracy, finer = judged(attempt, before, parameters.accuracy)
        if finer is None:
            how = {"engine": DEFAULT_ENGINE, "integrator": stepping.integrator}
            return record.assign_attrs(how | attributes_of(accuracy))
        before, halvings = attempt, halvings + finer.step
        stepping, period = stepping.halved(finer.step), period / 2**finer.period


def _compared(record: Record) -> dict[str, Any]:
    """Return the measures of a record that are compared, and its largest displacement."""
    table = measure(record, measures=COMPARED).table
    values = {str(name): variable.values for name, variable in table.items()}
    return {"values": values, "size": float(np.abs(record.detergent_displacement).max())}
