"""Faults of a built machine that are legal mathematics but no possible machine."""

from wm_drake.errors import Problem
from wm_drake.model.machine import Setup
from wm_drake.parameters.plausibility import unusual_numbers

_MM_PER_M = 1e3


def unusual_springs(setup: Setup) -> list[Problem]:
    """Return one problem for each spring that would have no positive free length.

    A spring of free length L0 > 0 pulls with t = 0 at length L0 and would have to push at length 0.
    A spring that still pulls when its hooks meet is too soft for the weight that it carries: it has
    to be stretched by more than its own length.

    Args:
        setup: The machine at rest, with preloads.
    """
    return [
        Problem(
            "",
            f"springs.{name}",
            f"is too soft: it carries {spring.preload:.0f} N at a length of "
            f"{_MM_PER_M * spring.rest_length:.0f} mm, so its free length would be negative; is "
            "the unit of its stiffness right?",
        )
        for name, spring in setup.springs.items()
        if spring.preload > 0.0 and spring.free_length is None
    ]


def unusual_values(setup: Setup) -> list[Problem]:
    """Return one problem for each unusual number and each impossible spring of a machine."""
    return [*unusual_numbers(setup.parameters), *unusual_springs(setup)]
