"""Comparison of spin results: machines or variants of one, with the differences of all measures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wm_drake.errors import input_error
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.units import Unit
from wm_drake.simulation.mount_forces import mount_forces
from wm_drake.studies.spin.study import CaseResult, SpinResult

MOST_VARIANTS = 6
"""Largest number of variants that a figure can tell apart."""


GROUPS = (
    "amplitude",
    "critical speed",
    "detergent box displacement",
    "smallest gap",
    "gasket force",
    "gasket moment",
    "largest mount force",
)
"""Groups of measures in the order of a table of differences."""

DIFFERENCE_COLUMNS = [
    "load",
    "measure",
    "name",
    "unit",
    "reference",
    "variant",
    "reference_value",
    "value",
    "difference",
    "percent",
]
"""Columns of `difference_table`."""


@dataclass(frozen=True)
class Variant:
    """One of the results that are compared: a machine, with or without gasket.

    Attributes:
        name: Name in figures and tables.
        result: Its spin result. All variants of a comparison have the same loads in the same order.
    """

    name: str
    result: SpinResult


@dataclass(frozen=True)
class MeasureOfCase:
    """One measure of one case, in the unit in which it is shown.

    Attributes:
        group: What is measured, such as "amplitude".
        name: Sensor, axis or mount; empty if there is only one.
        unit: Unit of the value.
        value: NaN if the case does not have this measure.
    """

    group: str
    name: str
    unit: str
    value: float


def measures_of(case: CaseResult) -> list[MeasureOfCase]:
    """Return every measure of a case."""
    measures, has_gasket = case.measures, case.record.attrs["gasket"] == "yes"
    by_label = (
        ("amplitude", measures.amplitude, Unit("m", "mm"), True),
        ("critical speed", measures.critical_speed, Unit("rad/s", "rpm"), True),
        ("detergent box displacement", measures.detergent_displacement, Unit("m", "mm"), True),
        ("gasket force", measures.gasket_force, Unit("N", "N"), has_gasket),
        ("gasket moment", measures.gasket_moment, Unit("N*m", "N*m"), has_gasket),
    )
    found = [
        MeasureOfCase(
            group, str(label), unit.shown, unit.from_si(float(value)) if there else np.nan
        )
        for group, values, unit, there in by_label
        for label, value in zip(values[values.dims[0]].values, map(float, values), strict=True)
    ]
    gap = measures.smallest_gap
    millimetre = Unit("m", "mm")
    distance = millimetre.from_si(gap.distance) if gap else np.nan
    found.append(MeasureOfCase("smallest gap", "", "mm", distance))
    found += [
        MeasureOfCase("largest mount force", force.name, "N", force.peak)
        for force in mount_forces(case.record)
    ]
    return found


def difference_table(variants: Sequence[Variant]) -> pd.DataFrame:
    """Return the differences of all measures between each variant and the first one.

    Args:
        variants: At least two; see `check_comparable`.

    Returns:
        Columns load, measure, name, unit, reference and variant (names of variants),
        reference_value, value, difference (value - reference_value) and percent (of the absolute
        reference value; NaN if that is zero). Values are NaN where a variant lacks the measure, for
        example a gasket force without gasket. A measure that only some variants have, such as the
        force of a mount, has a row for each variant.
    """
    rows = []
    for index, case in enumerate(variants[0].result.results):
        of_variants = [
            {(m.group, m.name, m.unit): m.value for m in measures_of(v.result.results[index])}
            for v in variants
        ]
        keys = list(dict.fromkeys(key for values in of_variants for key in values))
        keys.sort(key=lambda key: GROUPS.index(key[0]))  # a stable sort
        for key in keys:
            reference = of_variants[0].get(key, np.nan)
            for variant, values in zip(variants[1:], of_variants[1:], strict=True):
                value = values.get(key, np.nan)
                percent = 100.0 * (value - reference) / abs(reference) if reference else np.nan
                names = (case.case.name, *key, variants[0].name, variant.name)
                rows.append((*names, reference, value, value - reference, percent))
    return pd.DataFrame(rows, columns=DIFFERENCE_COLUMNS)


def check_comparable(machines: Sequence[MachineParameters], where: str) -> None:
    """Raise an InputError if machines cannot be compared on one page.

    Their names must differ and they need at least one sensor of the same name.

    Args:
        machines: The machines.
        where: Option that named the machines, for the message.
    """
    names = [machine.name for machine in machines]
    for name in names:
        if names.count(name) > 1:
            raise input_error(
                f"{names.count(name)} machines have the name '{name}'; give each machine file its "
                "own 'name'",
                where=where,
            )
    if not common_sensors(machines):
        sensors = "; ".join(f"'{m.name}' has {', '.join(m.sensors)}" for m in machines)
        raise input_error(f"the machines have no sensor of the same name: {sensors}", where=where)


def common_sensors(machines: Sequence[MachineParameters]) -> list[str]:
    """Return the names of the sensors that all machines have, in the order of the first one."""
    return [name for name in machines[0].sensors if all(name in m.sensors for m in machines)]


def remarks(variants: Sequence[Variant]) -> list[str]:
    """Return what a reader must know about variants whose conditions differ, as sentences."""
    found = []
    first = variants[0]
    for variant in variants[1:]:
        for a, b in zip(first.result.results, variant.result.results, strict=True):
            both = f"'{first.name}' and '{variant.name}'"
            if a.case.load != b.case.load:
                found.append(f"Load {a.case.name} is not the same in {both}.")
        if first.result.results[0].case.profile != variant.result.results[0].case.profile:
            found.append(f"{both} follow different spin profiles.")
    machines = [variant.result.parameters for variant in variants]
    shared = common_sensors(machines)
    for machine in machines:
        alone = [name for name in machine.sensors if name not in shared]
        if alone:
            found.append(
                f"Not all machines have the sensors {', '.join(alone)} of '{machine.name}'; the "
                "figures leave them out."
            )
        for name in shared:
            axes = machines[0].sensors[name].axis, machine.sensors[name].axis
            if axes[0] != axes[1]:
                found.append(
                    f"Sensor {name} measures along {axes[0]} in '{machines[0].name}' and along "
                    f"{axes[1]} in '{machine.name}'."
                )
    return list(dict.fromkeys(found))
