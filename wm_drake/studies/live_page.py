"""Block `--live`: the page of `spin` and of `verdict` runs its machine too."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from wm_drake.errors import input_error
from wm_drake.studies.blocks import Extend, PageBlock
from wm_drake.studies.study import option

if TYPE_CHECKING:  # --help does not wait for them
    from wm_drake.parameters import MachineParameters
    from wm_drake.simulation.cases import Case
    from wm_drake.studies.spin.task import SpinTask

LIVE: Any = option(
    False, "Let the page run the machine too: folded, with sliders, without a server."
)


def _of_spin(task: "SpinTask") -> Extend | None:
    """Return the function that adds the page of the machine.

    Raises:
        InputError: several machines or variants are compared.
    """
    options: Any = task.options
    if not options.live:
        return None
    if len(task.planned) > 1:
        raise input_error("needs a single machine and variant", where="--live")
    planned = task.planned[0]
    return _with_page(planned.machine.parameters, planned.cases, options.machine[0], options.sets)


def _of_verdict(task: Any) -> Extend | None:
    """Return the function that adds the page of the loads of the machine.

    Raises:
        InputError: several machines or variants are compared.
    """
    options: Any = task.options
    if not options.live:
        return None
    if options.variant or len(options.machine) > 1:
        raise input_error("needs a single machine and variant", where="--live")
    return _with_page(task.given.parameters, task.cases, options.machine[0], options.sets)


def _with_page(
    parameters: "MachineParameters", cases: "Sequence[Case]", given: str, sets: Sequence[str]
) -> Extend:
    """Return the function that adds a page, which is made before any run."""
    from wm_drake.live.exported import page_of_cases  # most pages have none

    page = page_of_cases(parameters, cases, given, sets)
    return lambda _executor, answer: replace(answer, live=page)


OF_SPIN = PageBlock("live of spin", "spin", _of_spin, {"live": (bool, LIVE)})
OF_VERDICT = PageBlock("live of verdict", "verdict", _of_verdict, {"live": (bool, LIVE)})
