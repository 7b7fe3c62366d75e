"""Usual ranges of numbers of a machine or gasket, to find wrong units and slips of the keyboard.

A number outside its range is legal: it is reported as unusual, not refused.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase

from wm_drake.errors import Problem
from wm_drake.parameters.keys import quantities
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.units import Unit


@dataclass(frozen=True)
class UsualRange:
    """Usual range of the numbers whose key path matches a pattern.

    Attributes:
        pattern: Pattern of key paths; `*` stands for any text.
        low, high: Ends of the range, in `unit`.
        unit: Display unit of the numbers (`wm_drake.parameters.units`).
    """

    pattern: str
    low: float
    high: float
    unit: str


RANGES = (
    UsualRange("gravity", 9.7, 9.9, "m/s^2"),
    UsualRange("bodies.*.mass", 0.02, 80.0, "kg"),
    UsualRange("bodies.*.centre_of_mass", -600.0, 600.0, "mm"),
    UsualRange("cabinet.mass", 5.0, 150.0, "kg"),
    UsualRange("cabinet.centre_of_mass", -1000.0, 1000.0, "mm"),
    UsualRange("cabinet.floor", -1500.0, 0.0, "mm"),
    UsualRange("cabinet.friction", 0.05, 1.2, ""),
    UsualRange("cabinet.feet.*", -800.0, 800.0, "mm"),
    UsualRange("frames.*.position", -1500.0, 1500.0, "mm"),
    UsualRange("frames.*.angles", -180.0, 180.0, "deg"),
    UsualRange("spring_types.*.stiffness", 1.0, 60.0, "N/mm"),
    UsualRange("spring_types.*.free_length", 30.0, 600.0, "mm"),
    UsualRange("springs.*.preload", 0.0, 500.0, "N"),
    UsualRange("spring_types.*.displacement", -200.0, 200.0, "mm"),
    UsualRange("spring_types.*.force", -2000.0, 2000.0, "N"),
    UsualRange("damper_types.*friction_force", 0.0, 300.0, "N"),
    UsualRange("damper_types.*sponge_stiffness", 5.0, 1000.0, "N/mm"),
    UsualRange("damper_types.*.sponge.displacement", -100.0, 100.0, "mm"),
    UsualRange("damper_types.*.sponge.force", -2000.0, 2000.0, "N"),
    UsualRange("damper_types.*.end_bushing.stiffness", 0.0, 1e5, "N*mm/rad"),
    UsualRange("damper_types.*.end_bushing.damping", 0.0, 100.0, "N*mm*s/deg"),
    UsualRange("damper_types.*.end_bushing.friction_torque", 0.0, 5000.0, "N*mm"),
    UsualRange("damper_types.*damping", 0.0, 3.0, "N*s/mm"),
    UsualRange("bushing_types.*.stiffness_?", 0.0, 5000.0, "N/mm"),
    UsualRange("*.rotational_stiffness_?", 0.0, 1e7, "N*mm/rad"),
    UsualRange("*.stiffness_?", 0.0, 1000.0, "N/mm"),
    UsualRange("*.rotational_damping_?", 0.0, 2000.0, "N*mm*s/deg"),
    UsualRange("*.damping_?", 0.0, 3.0, "N*s/mm"),
    UsualRange("*.friction_torque_?", 0.0, 50000.0, "N*mm"),
    UsualRange("*.stiffness_?.displacement", -100.0, 100.0, "mm"),
    UsualRange("*.rotational_stiffness_?.angle", -45.0, 45.0, "deg"),
    UsualRange("*unbalances.*.mass", 0.0, 5.0, "kg"),
    UsualRange("*unbalances.*.water.share", 0.3, 0.8, ""),
    UsualRange("*unbalances.*.water.time_constant", 2.0, 300.0, "s"),
    UsualRange("*unbalances.*.water.speed", 0.0, 2000.0, "rpm"),
    UsualRange("imperfections.residual_imbalance.mass", 0.0, 0.5, "kg"),
    UsualRange("meridian.radius", 80.0, 400.0, "mm"),
    UsualRange("meridian.height", 10.0, 250.0, "mm"),
    UsualRange("meridian.thickness", 0.5, 8.0, "mm"),
    UsualRange("*.radius", 0.0, 400.0, "mm"),
    UsualRange("*.y", -400.0, 400.0, "mm"),
    UsualRange("imperfections.phase_error", -45.0, 45.0, "deg"),
    UsualRange("profile.speed", -2000.0, 2000.0, "rpm"),
    UsualRange("profile.time", 0.0, 7200.0, "s"),
)
"""Usual ranges; the first one whose pattern matches a key path holds.

Judgement of this project: the numbers of household and small commercial machines in [A], [B] and
[C], with a factor of about five on both sides. Mechanics alone gives no bounds.
"""


def unusual_numbers(
    parameters: MachineParameters, keys: Iterable[str] | None = None
) -> list[Problem]:
    """Return one problem for each number of a machine outside its usual range.

    Args:
        keys: Key paths of the numbers to check, or of entries of them; all if None.
    """
    remarks = list[Problem]()
    chosen = None if keys is None else {whole for k in keys for whole in (k, k.rpartition(".")[0])}
    for key, value, unit in quantities(parameters):
        if chosen is not None and key not in chosen:
            continue
        remarks += unusual_values(key, value if isinstance(value, tuple) else (value,), unit)
    return _first_of_each_value(remarks)


def unusual_values(key: str, values: Iterable[float], unit: Unit) -> list[Problem]:
    """Return one problem for the first of some numbers that is outside the usual range of a key."""
    usual = usual_range(key)
    if usual is None or usual.unit != unit.shown:
        return []
    # rounding of a converted number must not count as outside
    shown = [float(f"{unit.from_si(number):.9g}") for number in values]
    outside = [number for number in shown if not usual.low <= number <= usual.high]
    return [
        Problem(
            "",
            key,
            f"{number:g} {unit.label} is unusual; usual is {usual.low:g} to {usual.high:g} "
            f"{unit.label}",
        )
        for number in outside[:1]
    ]


def usual_range(key: str) -> UsualRange | None:
    """Return the usual range of the number with a key path; None if there is none."""
    return next((usual for usual in RANGES if fnmatchcase(key, usual.pattern)), None)


def _first_of_each_value(problems: Iterable[Problem]) -> list[Problem]:
    """Return problems without those that differ only in the axis or number of an entry."""
    seen: dict[tuple[str, str], Problem] = {}
    for problem in problems:
        seen.setdefault((re.sub(r"_[xyz]\b|\.\d+", "", problem.key), problem.message), problem)
    return list(seen.values())
