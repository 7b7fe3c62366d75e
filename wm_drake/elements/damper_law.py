"""Damper laws as packed numbers: number of the law, then its own numbers in the order of its class.

All of this follows from the registry `wm_drake.parameters.damper_laws.DAMPER_LAWS`.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from wm_drake.compiler.elementary import whole_number
from wm_drake.compiler.packed import PackedLayout, PackedPart, generated
from wm_drake.elements.layouts import layout_of, packed_fields
from wm_drake.parameters.damper_laws import DAMPER_LAWS, DamperLaw, DamperNumbers
from wm_drake.parameters.types import FloatArray

_BY_NUMBER = {law.number: law for law in DAMPER_LAWS.values()}
_LAYOUTS = {
    law.number: layout_of(f"{law.parameters.__name__}Numbers", law.parameters, law.fields)
    for law in DAMPER_LAWS.values()
}


_FRICTION = ("friction_force", "basic_friction_force")
"""Fields of a law that hold the force of its dry friction."""


def packed_damper_law(damper: DamperNumbers) -> FloatArray:
    """Return the packed law of a damper of a machine file."""
    number = DAMPER_LAWS[damper.law].number
    return np.concatenate([[number], packed_fields(_LAYOUTS[number], damper)])


def law_of(packed: FloatArray, at: int = 0) -> DamperLaw:
    """Return the registered law whose packed numbers begin at an index."""
    return _BY_NUMBER[whole_number(packed[at])]


def law_numbers(packed: FloatArray) -> Any:
    """Return the own numbers of a packed law as a named tuple."""
    return _LAYOUTS[law_of(packed).number].unpack(packed, 1)


def law_structure(packed: FloatArray, at: int = 0) -> list[int]:
    """Return number of a packed law and points of its tables, which are equal in a batch."""
    number = law_of(packed, at).number
    return [number, *_LAYOUTS[number].structure(packed, at + 1)]


def frictionless_law(packed: FloatArray) -> FloatArray:
    """Return the packed law of a damper whose friction is saturated: the force of it is constant.

    A small motion on top of steady sliding has no friction, only the dashpots. Friction that grows
    with the velocity of the slider is a dashpot beside that of the slider, if the law has one.
    """
    layout = _LAYOUTS[law_of(packed).number]
    numbers = law_numbers(packed)
    changed = {name: 0.0 for name in _FRICTION if name in numbers._fields}
    if {"friction_damping", "slider_damping"} <= set(numbers._fields):
        changed["slider_damping"] = numbers.slider_damping + numbers.friction_damping
        changed["friction_damping"] = 0.0
    return np.concatenate([packed[:1], layout.replaced(packed[1:], **changed)])


def _choice(
    name: str, arguments: tuple[str, ...], functions: Mapping[int, Any], result: str
) -> Any:
    """Return the law (*arguments, p, at) that evaluates the law function of the number at p[at].

    Args:
        name: Name of the law.
        arguments: Arguments before `p` and `at`; a law function takes those that it names.
        functions: Law function of each number; its other arguments are fields of its layout.
        result: What is returned of a law without the argument `deformation`, of its result `{}`.
    """
    names: dict[str, Any] = {"whole_number": whole_number}
    lines = [f"def {name}({', '.join(arguments)}, p, at):", "    number = whole_number(p[at])"]
    for position, (number, function) in enumerate(functions.items()):
        layout: PackedLayout = _LAYOUTS[number]
        names[f"law_{number}"], names[f"read_{number}"] = function, layout.read
        needed = DamperLaw.arguments(function)
        given = [arg if arg in arguments else f"numbers_{number}.{arg}" for arg in needed]
        call = f"law_{number}({', '.join(given)})"
        call = call if "deformation" in needed else result.format(call)
        last = position == len(functions) - 1
        indent = "    " if last else "        "
        lines += [] if last else [f"    if number == {number}:"]
        lines += [f"{indent}numbers_{number} = read_{number}(p, at + 1)", f"{indent}return {call}"]
    return generated(name, "\n".join(lines) + "\n", names)


damper_response = _choice(
    "damper_response",
    ("rate", "deformation"),
    {law.number: law.response for law in DAMPER_LAWS.values()},
    result="{}, 0.0 * rate",
)
"""Law (rate, deformation, p, at) that returns tension and deformation rate of a damper of any law.

rate: rate of elongation [m/s]; deformation: that of the sponge, any number for a law without one
[m]; p, at: array that holds the packed law, and where it begins. Returns tension, > 0 pulls the
ends together [N], and deformation rate, 0 without a sponge [m/s]."""

sponge_with_mass = _choice(
    "sponge_with_mass",
    ("deformation", "rate", "slider_velocity", "step", "mass"),
    {law.number: law.sponge_with_mass for law in DAMPER_LAWS.values() if law.sponge_with_mass},
    result="{}",
)
"""Law (deformation, rate, slider_velocity, step, mass, p, at) that takes a step of a sponge with
mass, of a law that has one on the bench; returns tension and velocity of the slider at the end of
the step. [m, m/s, m/s, s, kg -> N, m/s]"""

LAW = PackedPart(None, law_structure, inside=lambda p, at: (_LAYOUTS[law_of(p, at).number], at + 1))
"""Kind of a field that holds a packed damper law; the last of a layout."""
