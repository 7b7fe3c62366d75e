"""Key paths with `*`: one line of a file that stands for the numbers of all parts of a machine."""

import re
from collections.abc import Iterator

from wm_drake.model.bodies import with_sdf_values
from wm_drake.model.machine import Machine
from wm_drake.model.sdf_names import sdf_names
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.elements import CurveTable
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.variation import value_at

ANY = "*"
"""Stands for any characters of one part of a key path."""

OF_BODIES = ("mass", "centre_of_mass", "inertia")


def keys_like(machine: Machine, pattern: str) -> tuple[str, ...]:
    """Return the key paths of the numbers of a machine and of its SDF that a pattern names.

    Args:
        pattern: Key path, in which * stands for any characters of one part, as in
            `bodies.*.mass`. One without * is returned as it is.
    """
    if ANY not in pattern:
        return (pattern,)
    form = re.compile(".*".join(map(re.escape, pattern.split(ANY))).replace(".*", "[^.]*"))
    links = sdf_names(machine.plant).links
    of_sdf = [f"bodies.{link}.{part}" for link in links for part in OF_BODIES]
    full = with_sdf_values(machine.drawn.plant, machine.parameters, of_sdf)
    return tuple(dict.fromkeys(key for key in _keys(full) if form.fullmatch(key)))


def _keys(parameters: MachineParameters) -> Iterator[str]:
    """Yield the key path of each number, table of forces, vector and entry of a vector."""
    for key, value, _ in quantities(parameters):
        parent = key.rpartition(".")[0]
        if isinstance(value, tuple) and isinstance(value_at(parameters, parent), CurveTable):
            yield parent
            continue
        yield key
        if isinstance(value, tuple):
            yield from (f"{key}.{index}" for index in range(len(value)))
