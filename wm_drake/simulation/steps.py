"""Checks of step and integrator of a run; nothing here needs a record."""

from typing import get_args

from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.machine import Integrator


def checked_integrator(parameters: MachineParameters, integrator: str | None) -> Integrator:
    """Return the integrator of the compiled engine, after checking it.

    Args:
        parameters: Machine that supplies the default.
        integrator: Name of the integrator; None for the default.
    """
    name = parameters.integrator if integrator is None else integrator
    for known in get_args(Integrator):
        if name == known:
            return known
    raise input_error(
        f"no integrator '{name}'{nearest_names(name, get_args(Integrator))}", key="integrator"
    )


def checked_step(parameters: MachineParameters, step: float | None) -> float:
    """Return the step size to integrate with, after checking it.

    Args:
        parameters: Machine that supplies the default step size.
        step: Requested step size; None for the default. [s]

    Raises:
        InputError: the output period is not an integer multiple of the step size.
    """
    step, period = parameters.step if step is None else step, parameters.output_period
    if not step > 0.0 or abs(period / step - round(period / step)) > 1e-9 or step > period:
        raise input_error(
            f"{step:g} s does not divide the output period of {period:g} s into equal steps; "
            f"allowed are {period:g} s divided by 1, 2, 3, ...",
            key="step",
        )
    return step
