"""How strong a drive must be.

Smallest torque limit: bisection on a logarithmic scale of the constant torque at the motor's shaft.
A drive passes if the drum has the wanted speed at the end of the profile. It is assumed that a
stronger drive passes where a weaker one does.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import (
    Load,
    MachineParameters,
    MotorDrive,
    SpinProfile,
    with_values,
)
from wm_drake.parameters.drive import TorqueLimit, motor_of
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import SPEED, Quantity
from wm_drake.simulation.cases import Case
from wm_drake.studies.experiment import Experiment

MEASURES = ("drive",)
"""Measures of `simulate_many` that the study needs."""

PASSES = 0.95
"""Part of the wanted speed that a drum which passes has at the end of the profile, at least."""

RANGE = 100.0
"""Largest limit of the search over the smallest one; the largest is that of the machine."""

PRECISION = 1.02
"""Quotient of the two ends of the interval at which the bisection stops."""

TORQUE, MOMENT = Unit("N*m", "N*m"), Unit("kg*m", "g*m")

CAUGHT_BELOW = Quantity("does not pass with, at the motor", TORQUE, 3)
PASSES_FROM = Quantity("passes with, at the motor", TORQUE, 3)
CAUGHT_SPEED = Quantity("stays at", SPEED.unit, 0)
CAUGHT_TORQUE = Quantity("mean torque there, at the drum", TORQUE, 2)
FACTOR = Quantity("mass factor")
TORQUE_LIMIT = Quantity("torque limit at the motor", TORQUE, 3)
END_SPEED = Quantity("speed at the end", SPEED.unit, 0)
UNBALANCE = Quantity("unbalance, sum of mass times radius", MOMENT, 1)


def motor_with_limit(parameters: MachineParameters) -> tuple[MotorDrive, TorqueLimit]:
    """Return the motor of a machine and its torque limit.

    Raises:
        InputError: the drive has no motor, or the limit is a table.
    """
    drive = motor_of(parameters.drive)
    if drive is None:
        raise input_error(
            f"machine '{parameters.name}' has a prescribed speed; allowed is a drive with kind: "
            "motor, such as that of the shipped machine 'motor'",
            key="drive.kind",
        )
    if not isinstance(drive.torque_limit, TorqueLimit):
        raise input_error(
            "is a table; the study varies a constant torque: give torque, and power if it falls "
            "with the speed",
            key="drive.torque_limit",
        )
    return drive, drive.torque_limit


def with_torque(parameters: MachineParameters, torque: float) -> MachineParameters:
    """Return a machine whose motor has another largest torque. [N m at the shaft]"""
    return with_values(parameters, {"drive.torque_limit.torque": float(torque)})


def passes(runs: xr.Dataset, profile: SpinProfile) -> np.ndarray:
    """Return which runs have the wanted speed at the end of the profile. Bool"""
    return np.asarray(runs.drive_end_speed.values >= PASSES * profile.speed[-1])


def find_thresholds(experiment: Experiment) -> xr.Dataset:
    """Return the smallest torque limit of each load by bisection; all loads run side by side.

    Returns:
        Over `load`: `caught_below`, largest limit found at which the drum does not pass, 0 if there
        is none in the range; `passes_from`, smallest limit found at which it passes, NaN if not
        even the largest one does [N m at the motor's shaft]; `caught_speed` [rad/s] and
        `caught_mean_torque_at_drum` [N m], where it is caught at `caught_below`, NaN if it is not.
    """
    parameters, loads = experiment.machine.parameters, experiment.loads
    motor, limit = motor_with_limit(parameters)
    largest = limit.torque
    count, profile = len(loads), loads[0].profile
    low, high = np.full(count, largest / RANGE), np.full(count, largest)
    caught = np.full((count, 2), np.nan)

    def tried(torques: FloatArray, which: Sequence[int], what: str) -> np.ndarray:
        cases = (
            replace(
                loads[i],
                name=f"{loads[i].name} {torques[i]:g}",
                parameters=with_torque(parameters, torques[i]),
            )
            for i in which
        )
        runs = experiment.over({"load": [loads[i].name for i in which]}, cases, what)
        good = passes(runs, profile)
        places = np.stack([runs.drive_caught_speed, runs.drive_caught_torque], axis=1)
        caught[np.array(which)[~good]] = places[~good]
        return good

    at_most = tried(high, range(count), "largest torque")
    always = tried(low, range(count), "smallest torque")
    high = np.where(at_most, high, np.nan)
    high, low = np.where(always, low, high), np.where(always, 0.0, low)
    low = np.where(np.isnan(high), largest, low)
    while (open_ends := np.flatnonzero((low > 0.0) & (high > PRECISION * low))).size:
        middle = np.sqrt(low * np.nan_to_num(high))
        good = tried(middle, open_ends.tolist(), "bisection")
        high[open_ends[good]] = middle[open_ends[good]]
        low[open_ends[~good]] = middle[open_ends[~good]]
    return xr.Dataset(
        {
            "caught_below": CAUGHT_BELOW.variable("load", low),
            "passes_from": PASSES_FROM.variable("load", high),
            "passes_from_at_drum": PASSES_FROM.named("passes with, at the drum").variable(
                "load", motor.belt_ratio * high
            ),
            "caught": CAUGHT_SPEED.variable("load", caught[:, 0]),
            "caught_mean_torque_at_drum": CAUGHT_TORQUE.hidden("load", caught[:, 1]),
        },
        {"load": [case.name for case in loads]},
    )


def torque_map(
    experiment: Experiment, case: Case, torques: Sequence[float], factors: Sequence[float]
) -> xr.Dataset:
    """Return where the drum passes, over torque limits and factors on the masses of a load.

    Returns:
        Over `mass_factor` and `torque_limit` (at the motor's shaft) [N m]: `end`, speed at the
        end of the profile, `caught`, where the drum is caught, NaN if it is not [rad/s], and
        `sum_of_mass_times_radius` of the load [kg m].
    """
    machines = [with_torque(experiment.machine.parameters, torque) for torque in torques]
    loads = [scaled(case.load, factor) for factor in factors]
    cases = (
        Case(f"{factor:g} {torque:g}", load, case.profile, case.gasket, machine)
        for factor, load in zip(factors, loads, strict=True)
        for torque, machine in zip(torques, machines, strict=True)
    )
    runs = experiment.over({"mass_factor": factors, "torque_limit": torques}, cases, "map")
    unbalance = [sum(u.mass * u.radius for u in load.unbalances) for load in loads]
    return xr.Dataset(
        {
            "sum_of_mass_times_radius": UNBALANCE.variable("mass_factor", unbalance),
            "end": END_SPEED.variable(runs.drive_end_speed.dims, runs.drive_end_speed),
            "caught": CAUGHT_SPEED.variable(runs.drive_end_speed.dims, runs.drive_caught_speed),
        },
        {
            "load": case.name,
            "mass_factor": FACTOR.variable("mass_factor", factors),
            "torque_limit": TORQUE_LIMIT.variable("torque_limit", torques),
        },
    )


def scaled(load: Load, factor: float) -> Load:
    """Return a load with all masses multiplied by a factor."""
    return Load(
        unbalances=tuple(u.model_copy(update={"mass": factor * u.mass}) for u in load.unbalances)
    )
