"""Measures that a page shows, and what it says of each of their numbers."""

import itertools
from typing import Any

from wm_drake.live.parts import words_of
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.simulation.measures import MEASURES, Variable
from wm_drake.simulation.measures.labels import LABELS

FIRST = ("amplitudes", "gap", "extremes", "mounts")
"""Measures that the page shows first, in this order."""

EACH = ("sensor",)
"""Dimensions of which a comparison of variants shows each number; of others it has the largest."""


def shown_measures(parameters: MachineParameters) -> tuple[str, ...]:
    """Return the names of the measures of a machine of which the page shows a variable."""
    shown = [
        one.name
        for one in MEASURES.values()
        if one.applies(parameters) and any(v.studio is not None for v in one.variables)
    ]
    return (*FIRST, *(name for name in shown if name not in FIRST))


def heads_of(
    parameters: MachineParameters, profile: SpinProfile, variable: Variable
) -> list[dict[str, Any]]:
    """Return what a row says of each number of a variable, without its value.

    `touches` says that a value of 0 and below is an alarm.
    """
    along = [LABELS[dim](parameters, profile) for dim in variable.dims]
    unit, heads = variable.unit_text, []
    for labels in itertools.product(*along):
        words = [words_of(label.split(".")) if "." in label else label for label in labels]
        heads.append(
            {
                "title": f"{variable.short_title_of(words)}, {unit}",
                "kind": variable.kind,
                "group": "" if variable.dims in ((), EACH) else f"largest {variable.kind}, {unit}",
                "decimals": variable.studio,
                "sensor": labels[0] if variable.name == "amplitude" else None,
                "touches": variable.name == "smallest_gap",
            }
        )
    return heads


def mount_title(name: str) -> str:
    """Return the title of the force of a mount over time."""
    return f"mount {words_of(name.split('.'))}"


def foot_title(name: str) -> str:
    """Return the title of the normal load of a foot over time."""
    return f"foot {name.replace('_', ' ')}"
