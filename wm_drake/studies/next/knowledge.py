"""What is known of the numbers of a machine: a machine for each point of independent scores.

The scores u are independent and standard normal; u = 0 is the machine in the middle of what is
known. Truncated, skewed and correlated quantities follow from them (Gaussian copula), so the rest
of the study knows one form only: a prior of zero mean and unit covariance.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wm_drake.errors import InputError, input_error, problems_at
from wm_drake.model.build import build_machine
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, apply, located
from wm_drake.parameters.csv_files import finite_numbers, read_csv, read_header
from wm_drake.parameters.free import FreeFile, load_free
from wm_drake.parameters.types import FloatArray
from wm_drake.studies.calibrate.parameter_map import ParameterMap, parameter_map_of
from wm_drake.studies.inputs import existing_file
from wm_drake.studies.tolerance.distributions import Joint, normal
from wm_drake.studies.tolerance.variables import UncertainMachine


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


def of_tolerances(machine: Machine, uncertain: UncertainMachine, about: str) -> Knowledge:
    """Return what a tolerance file says; its laundry is drawn at each run and not measured.

    Args:
        machine: Built machine with the parts of `uncertain`.

    Raises:
        InputError: nothing but laundry scatters.
    """
    kept = [k for k, variable in enumerate(uncertain.variables) if not variable.is_of_load]
    if not kept:
        raise input_error(
            "only the laundry scatters, which no measurement makes sure; allowed is a file with "
            "quantities of the machine, such as unmeasured",
            where="--tolerances",
        )
    variations = [uncertain.variables[k].variation for k in kept]
    factor = uncertain.joint.factor
    if factor is not None:
        correlation = factor @ factor.T
        factor = np.asarray(np.linalg.cholesky(correlation[np.ix_(kept, kept)]))
    joint = Joint(tuple(uncertain.joint.marginals[k] for k in kept), factor)

    def machine_of(values: FloatArray) -> MachineParameters:
        return apply(uncertain.parameters, variations, values.tolist())

    names = tuple(variation.name for variation in variations)
    return Knowledge(machine, names, joint.values, machine_of, about)


def of_free_file(machine: Machine, path: Path) -> Knowledge:
    """Return what the priors of a free file say, each truncated at its bounds."""
    parameters = _map(machine, path)
    joint = Joint(
        tuple(
            normal(mean, deviation, low, high)
            for mean, deviation, low, high in zip(
                parameters.expected,
                parameters.deviation,
                parameters.lower,
                parameters.upper,
                strict=True,
            )
        )
    )

    return _of_map(parameters, joint.values, f"priors of {path.name}")


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

    return _of_map(parameters, values, "posterior of a calibration")


def of_calibration_folder(machine: Machine, free: Path, folder: Path) -> Knowledge:
    """Return what the results of `wm-drake calibrate` in a folder say.

    Args:
        free: Free file of the calibration.

    Raises:
        InputError: the folder has no such results, or other quantities than the free file.
    """
    parameters = _map(machine, free)
    estimates, of_pairs = (folder / f"{name}.csv" for name in ("estimates", "correlations"))
    with problems_at("--calibrated"):
        table = read_csv(estimates, read_header(existing_file(estimates, "")))
        columns = {"unknown", "value", "deviation"}
        if not columns <= set(table) or table["unknown"].tolist() != parameters.names:
            raise input_error(
                f"'{folder}' does not have the quantities of {free.name}; allowed is the folder of "
                "a calibration with this free file"
            )
        labels = [unknown.unit.label for unknown in parameters.unknowns]
        if "unit" in table and table["unit"].fillna("").tolist() != labels:
            raise input_error(
                f"the values in '{folder}' have other units than the free file; allowed are those "
                "of a calibration with --units si"
            )
        numbers = finite_numbers(table[["value", "deviation"]], estimates)
        pairs = read_csv(existing_file(of_pairs, ""), ["unknown", *parameters.names])
        correlation = finite_numbers(pairs[parameters.names], of_pairs)
    units = np.array([unknown.unit.from_si(1.0) for unknown in parameters.unknowns])
    point, deviation = (column / units for column in numbers.T)
    covariance = correlation * np.outer(deviation, deviation)
    return of_calibration(parameters, point, covariance)


def _of_map(
    parameters: ParameterMap, values: Callable[[FloatArray], FloatArray], about: str
) -> Knowledge:
    """Return what is known of the quantities of a free file."""
    machine, names = build_machine(parameters.base), tuple(parameters.names)
    return Knowledge(machine, names, values, parameters.parameters_at, about)


def _map(machine: Machine, path: Path) -> ParameterMap:
    free: FreeFile = load_free(existing_file(path, "--free"))
    try:
        return parameter_map_of(machine, free)
    except InputError as error:
        raise located(error, path) from None
