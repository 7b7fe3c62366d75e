"""What is known of the numbers of a machine: a machine for each point of independent scores.

The scores u are independent and standard normal; u = 0 is the machine in the middle of what is
known. Truncated, skewed and correlated quantities follow from them (Gaussian copula), so the rest
of the study knows one form only: a prior of zero mean and unit covariance.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wm_drake.errors import input_error, problems_at
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.csv_files import finite_numbers, read_csv, read_header
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.vary_file import VARY_FILES, load_vary
from wm_drake.studies.calibrate.parameter_map import ParameterMap, read_parameter_map
from wm_drake.studies.inputs import existing_file
from wm_drake.studies.tolerance.variables import joint_of
from wm_drake.studies.vary import in_vary_file, varying_of


@dataclass(frozen=True)
class Knowledge:
    """Uncertain numbers of a machine.

    Attributes:
        machine: Built machine with the elements of all that `machine_of` returns.
        names: Names of the quantities, one for each score.
        values: Function of scores (k, p) with the values of the quantities (k, p). [SI]
        machine_of: Function of values (p,) with the machine that has them. It raises an InputError
            if they are no machine.
        about: Where this knowledge comes from, in words.
    """

    machine: Machine
    names: tuple[str, ...]
    values: Callable[[FloatArray], FloatArray]
    machine_of: Callable[[FloatArray], MachineParameters]
    about: str


def of_file(machine: Machine, name: str) -> Knowledge:
    """Return what the distributions of a vary file say.

    Laundry and loads are drawn at each run and not measured, so they are left out.

    Args:
        machine: The built machine.
        name: Name of a shipped file, or path of one.

    Raises:
        InputError: nothing but laundry varies, or a number has no distribution.
    """
    path, file = VARY_FILES.path(name), load_vary(name)
    entries = file.entries(without=("loads.", "laundry."))
    if not entries:
        raise input_error(
            "only the laundry varies, which no measurement makes sure; allowed is a file with "
            "numbers of the machine, such as unmeasured",
            where="--vary",
        )
    with in_vary_file(path, file):
        varying = varying_of(machine, entries, file.known)
        joint = joint_of(varying, file.correlations)
    built = build_machine(varying.machine)
    return Knowledge(built, varying.names, joint.values, varying.machine_at, path.stem)


def of_calibration(
    parameters: ParameterMap, point: FloatArray, covariance: FloatArray
) -> Knowledge:
    """Return what a calibration says: a normal distribution about its best machine.

    Args:
        point: Values of the quantities. (p,) [SI]
        covariance: Their covariance. (p, p) [SI]
    """
    deviation = np.sqrt(np.diag(covariance))
    sizes, directions = np.linalg.eigh(covariance / np.outer(deviation, deviation))
    # numbers from a file are rounded, so that an eigenvalue of 0 may be a little below
    root = deviation[:, None] * directions * np.sqrt(np.maximum(sizes, 0.0))

    def values(scores: FloatArray) -> FloatArray:
        return np.clip(point + scores @ root.T, parameters.lower, parameters.upper)

    machine, names = build_machine(parameters.base), tuple(parameters.names)
    about = "posterior of a calibration"
    return Knowledge(machine, names, values, parameters.parameters_at, about)


def of_calibration_folder(machine: Machine, name: str, folder: Path) -> Knowledge:
    """Return what the results of `wm-drake calibrate` in a folder say of the machine.

    A fit to records also has unknowns of the recorder. The distribution of the others alone is the
    normal one with their part of the covariance.

    Args:
        name: Name or path of the vary file of the calibration.

    Raises:
        InputError: the folder has no such results, or other numbers than the file.
    """
    path = VARY_FILES.path(name)
    parameters = read_parameter_map(machine, path, load_vary(name))
    estimates, of_pairs = (folder / f"{name}.csv" for name in ("estimates", "correlations"))
    with problems_at("--calibrated"):
        table = read_csv(estimates, read_header(existing_file(estimates, "")))
        columns, names = {"unknown", "value", "deviation"}, parameters.names
        unknowns = table["unknown"].tolist() if columns <= set(table) else []
        if not set(names) <= set(unknowns):
            raise input_error(
                f"'{folder}' does not have the quantities of {path.name}; allowed is the folder of "
                "a calibration with this file"
            )
        rows = [unknowns.index(name) for name in names]
        table = table.iloc[rows]
        labels = [unknown.unit.label for unknown in parameters.unknowns]
        if "unit" in table and table["unit"].fillna("").tolist() != labels:
            raise input_error(
                f"the values in '{folder}' have other units than the file; allowed are those "
                "of a calibration with --units si"
            )
        numbers = finite_numbers(table[["value", "deviation"]], estimates)
        pairs = read_csv(existing_file(of_pairs, ""), ["unknown", *unknowns])
        correlation = finite_numbers(pairs[names], of_pairs)[rows]
    units = np.array([unknown.unit.from_si(1.0) for unknown in parameters.unknowns])
    point, deviation = (column / units for column in numbers.T)
    covariance = correlation * np.outer(deviation, deviation)
    return of_calibration(parameters, point, covariance)
