"""Comparison of spin results: machines or variants of one, with the differences of all measures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from wm_drake.errors import input_error
from wm_drake.parameters import MachineParameters
from wm_drake.simulation.measures import MEASURES, Variable
from wm_drake.simulation.measures.as_json import labelled_values
from wm_drake.simulation.measures.registry import tabulated
from wm_drake.studies.spin.study import CaseResult, SpinResult

MOST_VARIANTS = 6
"""Largest number of variants that a figure can tell apart."""


GROUPS = {
    "amplitude": "amplitude",
    "critical_speed": "critical speed",
    "detergent_displacement": "detergent box displacement",
    "smallest_gap": "smallest gap",
    "gasket_force": "gasket force",
    "gasket_moment": "gasket moment",
    "mount_force_peak": "largest mount force",
}
"""Names of the variables in a table of differences, in its order; others have their kind."""

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


def compared_variables() -> dict[str, Variable]:
    """Return the variables of a table of differences by their name there, in its order."""
    known = {v.name: v for measure in MEASURES.values() for v in measure.variables}
    return {title: known[name] for name, title in GROUPS.items()} | {
        variable.kind: variable for variable in tabulated()
    }


def measures_of(case: CaseResult) -> list[MeasureOfCase]:
    """Return every measure of a case; NaN for the forces of a gasket that is not there."""
    has_gasket = case.record.attrs["gasket"] == "yes"
    measured = []
    for title, variable in compared_variables().items():
        for labels, value in labelled_values(case.measures.table, variable):
            if not has_gasket and labels == ("gasket",):
                continue
            number = np.nan if value is None else value
            if variable.name.startswith("gasket_") and not has_gasket:
                number = np.nan
            measured.append(MeasureOfCase(title, " ".join(labels), variable.unit.shown, number))
    return measured


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
    rows, order = [], list(compared_variables())
    for index, case in enumerate(variants[0].result.results):
        of_variants = [
            {(m.group, m.name, m.unit): m.value for m in measures_of(v.result.results[index])}
            for v in variants
        ]
        keys = list(dict.fromkeys(key for values in of_variants for key in values))
        keys.sort(key=lambda key: order.index(key[0]))  # a stable sort
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
    sentences = []
    first = variants[0]
    for variant in variants[1:]:
        for a, b in zip(first.result.results, variant.result.results, strict=True):
            both = f"'{first.name}' and '{variant.name}'"
            if a.case.load != b.case.load:
                sentences.append(f"Load {a.case.name} is not the same in {both}.")
        if first.result.results[0].case.profile != variant.result.results[0].case.profile:
            sentences.append(f"{both} follow different spin profiles.")
    machines = [variant.result.parameters for variant in variants]
    shared = common_sensors(machines)
    for machine in machines:
        unshared = [name for name in machine.sensors if name not in shared]
        if unshared:
            sentences.append(
                f"Not all machines have the sensors {', '.join(unshared)} of '{machine.name}'; the "
                "figures leave them out."
            )
        for name in shared:
            axes = machines[0].sensors[name].axis, machine.sensors[name].axis
            if axes[0] != axes[1]:
                sentences.append(
                    f"Sensor {name} measures along {axes[0]} in '{machines[0].name}' and along "
                    f"{axes[1]} in '{machine.name}'."
                )
    return list(dict.fromkeys(sentences))
