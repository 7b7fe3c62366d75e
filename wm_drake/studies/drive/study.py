"""How strong a drive must be, and what its torque and speed tell about the unbalance.

Smallest torque limit: bisection on a logarithmic scale of the constant torque at the motor's shaft.
A drive passes if the drum has the wanted speed at the end of the profile. It is assumed that a
stronger drive passes where a weaker one does.

Estimation of the unbalance: at a low constant speed, gravity turns the drum with the torque
-m r g sin(phi + phase) about its axis, once in a revolution. With the inertia J of drum and rotor,

    J w' = T - m r g sin(phi + phase) - friction

so that the parts of order one of torque T and acceleration w' give m r, whatever the controller
does: m r = |T_1 - J w'_1| / g. An appliance knows T from its current and w' from its tacho.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.engines.compiled.step_check import drum_inertia
from wm_drake.errors import input_error
from wm_drake.model.machine import Machine
from wm_drake.parameters import (
    Load,
    MachineParameters,
    MotorDrive,
    SpinProfile,
    Unbalance,
    with_values,
)
from wm_drake.parameters.drive import TorqueLimit, motor_of
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.studies.drive.options import DriveOptions
from wm_drake.studies.inputs import selected_cases
from wm_drake.studies.run import Executor
from wm_drake.studies.study import Result, Task

MEASURES = ("drive",)
"""Measures of `simulate_many` that the study needs."""

PASSES = 0.95
"""Part of the wanted speed that a drum which passes has at the end of the profile, at least."""

RANGE = 100.0
"""Largest limit of the search over the smallest one; the largest is that of the machine."""

PRECISION = 1.02
"""Quotient of the two ends of the interval at which the bisection stops."""

RAMP, HOLD = 10.0, 12.0
"""Durations of run-up and hold of the runs for the estimation. [s]"""

Runs = Callable[[Iterable[Case], str], xr.Dataset]
"""Function that runs cases and returns the table of their measures; the text says what for."""


@dataclass(frozen=True)
class Threshold:
    """Smallest torque limit of a load.

    Attributes:
        load: Name of the load.
        caught_below: Largest limit found at which the drum does not pass; 0 if there is none in the
            range. At the motor's shaft. [N m]
        passes_from: Smallest limit found at which it passes; NaN if not even the largest one does.
            [N m]
        caught_speed, caught_torque: Where it is caught at `caught_below`, torque at the drum; NaN
            if it is not caught. [rad/s, N m]
    """

    load: str
    caught_below: float
    passes_from: float
    caught_speed: float
    caught_torque: float


@dataclass(frozen=True)
class TorqueMap:
    """Whether the drum passes, over torque limit and unbalance.

    Attributes:
        load: Name of the load whose masses are scaled.
        torques: Limits at the motor's shaft. (t,) [N m]
        factors: Factors on the masses. (u,)
        unbalance: Sum of mass times radius of each. (u,) [kg m]
        end_speed: Speed at the end of the profile. (u, t) [rad/s]
        caught_speed: Where it is caught; NaN if it is not. (u, t) [rad/s]
    """

    load: str
    torques: FloatArray
    factors: FloatArray
    unbalance: FloatArray
    end_speed: FloatArray
    caught_speed: FloatArray


@dataclass(frozen=True)
class Estimation:
    """Unbalance estimated from the drive at a low constant speed, against the planted one.

    Attributes:
        speed: Speed of the hold. [rad/s]
        planted: Size of the vector sum of mass times radius of each random load. (n,) [kg m]
        estimated: The same, from torque and speed. (n,) [kg m]
        from_torque, from_speed: The parts T_1 / g and J w'_1 / g alone, in size. (n,) [kg m]
    """

    speed: float
    planted: FloatArray
    estimated: FloatArray
    from_torque: FloatArray
    from_speed: FloatArray

    @property
    def errors(self) -> FloatArray:
        """Return estimated less planted unbalance. (n,) [kg m]"""
        return self.estimated - self.planted


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


def passes(table: xr.Dataset, profile: SpinProfile) -> np.ndarray:
    """Return which runs have the wanted speed at the end of the profile. (run,) bool"""
    return np.asarray(table.drive_end_speed.values >= PASSES * profile.speed[-1])


def find_thresholds(
    parameters: MachineParameters, loads: Sequence[Case], run: Runs
) -> tuple[Threshold, ...]:
    """Return the smallest torque limit of each load by bisection; all loads run side by side."""
    largest = motor_with_limit(parameters)[1].torque
    count, profile = len(loads), loads[0].profile
    low, high = np.full(count, largest / RANGE), np.full(count, largest)
    caught = np.full((count, 2), np.nan)

    def tried(torques: FloatArray, which: Iterable[int], what: str) -> dict[int, bool]:
        numbers = list(which)
        cases = [
            replace(
                loads[i],
                name=f"{loads[i].name} {torques[i]:g}",
                parameters=with_torque(parameters, torques[i]),
            )
            for i in numbers
        ]
        table = run(cases, what)
        good = dict(zip(numbers, passes(table, profile).tolist(), strict=True))
        for row, i in enumerate(numbers):
            if not good[i]:
                caught[i] = (
                    table.drive_caught_speed.values[row],
                    table.drive_caught_torque.values[row],
                )
        return good

    at_most = tried(high, range(count), "largest torque")
    at_least = tried(low, range(count), "smallest torque")
    high = np.where([at_most[i] for i in range(count)], high, np.nan)
    always = np.array([at_least[i] for i in range(count)])
    high, low = np.where(always, low, high), np.where(always, 0.0, low)
    low = np.where(np.isnan(high), largest, low)
    while True:
        open_ends = [i for i in range(count) if low[i] > 0.0 and high[i] > PRECISION * low[i]]
        if not open_ends:
            break
        middle = np.sqrt(low * np.nan_to_num(high))
        good = tried(middle, open_ends, "bisection")
        for i in open_ends:
            (high if good[i] else low)[i] = middle[i]
    return tuple(
        Threshold(case.name, float(low[i]), float(high[i]), *map(float, caught[i]))
        for i, case in enumerate(loads)
    )


def torque_map(
    parameters: MachineParameters,
    case: Case,
    torques: Sequence[float],
    factors: Sequence[float],
    run: Runs,
) -> TorqueMap:
    """Return whether the drum passes over torque limits and factors on the masses of a load."""
    machines = [with_torque(parameters, torque) for torque in torques]
    loads = [scaled(case.load, factor) for factor in factors]
    cases = [
        Case(f"{factor:g} {torque:g}", load, case.profile, case.gasket, machine)
        for factor, load in zip(factors, loads, strict=True)
        for torque, machine in zip(torques, machines, strict=True)
    ]
    table, shape = run(cases, "map"), (len(factors), len(torques))
    return TorqueMap(
        case.name,
        np.array(torques),
        np.array(factors),
        np.array([sum(u.mass * u.radius for u in load.unbalances) for load in loads]),
        table.drive_end_speed.values.reshape(shape),
        table.drive_caught_speed.values.reshape(shape),
    )


def scaled(load: Load, factor: float) -> Load:
    """Return a load with all masses multiplied by a factor."""
    return Load(
        unbalances=tuple(u.model_copy(update={"mass": factor * u.mass}) for u in load.unbalances)
    )


def estimate_unbalance(
    parameters: MachineParameters, speed: float, loads: Sequence[Load], run: Runs, inertia: float
) -> Estimation:
    """Return the unbalance of loads as the drive sees it at a constant speed.

    Args:
        speed: Speed of the hold, reached by a ramp. [rad/s]
        inertia: Inertia of drum and rotor about the axis, without load. [kg m^2]
    """
    profile = SpinProfile(time=(0.0, RAMP, RAMP + HOLD), speed=(0.0, speed, speed))
    cases = [
        Case(f"random {number}", load, profile, parameters=parameters)
        for number, load in enumerate(loads)
    ]
    table, g = run(cases, "estimation"), parameters.gravity
    torque, acceleration = (
        table[f"drive_{name}_order_one"].values @ np.array([1.0, 1.0j])
        for name in ("torque", "acceleration")
    )
    planted = [
        abs(sum(u.mass * u.radius * np.exp(1j * u.phase) for u in load.unbalances))
        for load in loads
    ]
    return Estimation(
        speed,
        np.array(planted),
        np.abs(torque - inertia * acceleration) / g,
        np.abs(torque) / g,
        inertia * np.abs(acceleration) / g,
    )


def random_loads(count: int, seed: int, places: Load) -> list[Load]:
    """Return loads of two masses at random: 0 to 0.5 kg each, any phase, within the drum's depth.

    Args:
        places: Load whose first radius is used.
    """
    rng = np.random.default_rng(seed)
    radius = places.unbalances[0].radius
    return [
        Load(
            unbalances=tuple(
                Unbalance(
                    mass=float(rng.uniform(0.0, 0.5)),
                    radius=radius,
                    y=float(rng.uniform(-0.1, 0.1)),
                    phase=float(rng.uniform(0.0, 2.0 * np.pi)),
                )
                for _ in range(2)
            )
        )
        for _ in range(count)
    ]


class DriveTask(Task):
    """The study with checked options."""

    def __init__(self, options: DriveOptions, machine: Machine) -> None:
        """Check the drive, the loads and the profile."""
        self.options, self.machine = options, machine
        motor_with_limit(machine.parameters)
        self.cases = selected_cases(machine.parameters, options.load, True, options.profile)
        if not self.cases[0].profile.speed[-1] > 0.0:
            raise input_error(
                "the last speed of the profile is 0; allowed is a profile that ends at the speed "
                "that the drum must reach",
                key="profile",
            )

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the runs beside the machine."""
        return {"profile": self.cases[0].profile, "seed": str(self.options.seed)}

    def run(self, executor: Executor) -> Result:
        """Find thresholds, draw the map for the load that needs most, and estimate unbalance."""
        from wm_drake.studies.drive.page import DriveResult

        options, parameters = self.options, self.machine.parameters
        run = partial(executor.simulate, self.machine, MEASURES)
        thresholds = find_thresholds(parameters, self.cases, run)
        needs = [np.nan_to_num(threshold.passes_from, nan=9e9) for threshold in thresholds]
        worst = max(range(len(needs)), key=needs.__getitem__)
        largest = motor_with_limit(parameters)[1].torque
        top = min(needs[worst], largest)
        torques = (top * np.linspace(0.25, 2.0, options.torques)).tolist()
        factors = np.linspace(0.25, 1.5, options.unbalances).tolist()
        grid = torque_map(parameters, self.cases[worst], torques, factors, run)
        estimation = None
        if options.loads:
            inertia = drum_inertia(self.machine.set_up())
            loads = random_loads(options.loads, options.seed, self.cases[0].load)
            speed = options.speed * np.pi / 30.0
            estimation = estimate_unbalance(parameters, speed, loads, run, inertia)
        profile = self.cases[0].profile
        return DriveResult(parameters, profile, thresholds, grid, estimation, executor.runs)
