"""Steady unbalance response of a machine over the speed of its drum."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.elements.bushing import AXES
from wm_drake.elements.state_map import CARRIER, ELEMENT, STRETCHES, TUB
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.engines.trajectory import COORDINATES, Trajectory
from wm_drake.errors import input_error
from wm_drake.model.build import AnyMachine, machine_of
from wm_drake.model.machine import Setup
from wm_drake.model.scene import Scene
from wm_drake.parameters import Load, SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import SPEED
from wm_drake.simulation.mounts import KINDS, force_measures, mount_names
from wm_drake.simulation.outputs import variables_of
from wm_drake.studies.response.balance import HARMONICS, SAMPLES, HarmonicBalance
from wm_drake.studies.response.continuation import BranchPoint, first_motion, follow
from wm_drake.studies.response.quantities import OF_BRANCH
from wm_drake.studies.response.series import Series
from wm_drake.studies.threads import on_one_thread

MOST_HARMONICS, MOST_SAMPLES = 40, 1024
"""Largest number of harmonics, and of samples of a period."""


def steady_response(
    machine: AnyMachine,
    load: Load | str,
    speeds: Sequence[float] | FloatArray,
    *,
    gasket: bool = True,
    harmonics: int = HARMONICS,
    samples: int = SAMPLES,
    progress: Callable[[float], None] = lambda fraction: None,
) -> xr.Dataset:
    """Return the steady response of a machine to its unbalance, over the speed of its drum.

    The periodic motion is found by harmonic balance and followed around folds.

    Args:
        machine: A built machine, its parameters, or its name or file.
        load: Point masses in the drum, or the name of one of the machine's loads.
        speeds: Rising or falling speeds, at least two. [rad/s]
        gasket: False removes the gasket.
        harmonics: Number of harmonics of the drum's rotation.
        samples: Number of samples of a revolution at which forces are evaluated; more than twice
            the number of harmonics.
        progress: Called with the fraction done.

    Returns:
        Values over `point`, along the branch, with the coordinate `speed` [rad/s]. Behind a fold
        the speed changes the other way. `on_grid` is true at the speeds that were asked for,
        `stable` says whether the motion attracts its neighbours, `multiplier` is the size of the
        largest Floquet multiplier. `amplitude` (sensor) is the largest deviation from the mean of a
        revolution; `detergent_displacement` (axis), `gasket_force`, `gasket_moment` (axis) are
        largest absolute values as in `Measures`; `spring_tension`, `damper_tension` are half the
        range of a revolution; `mount_force_peak`, `mount_force_rms`, `mount_force_dynamic_rms`
        (mount) are largest size, RMS, and RMS without the mean, of the force of a mount on the
        cabinet in a revolution; `smallest_gap` is that between tub and housing in a revolution (0
        or less: they touch; NaN without shapes to measure); `first_harmonic` (coordinate, part) is
        the tub's pose; `damper_spin` (spinning) is the mean rate of telescopic dampers about their
        axes. SI.
        Where a damper spins, the motion is periodic only as long as it turns little: the values
        hold for tubes near the angle at which they are built, and vary as they turn.

    Raises:
        InputError: an argument is wrong, or no periodic motion is found at the first speed.

    Example:
        >>> import wm_drake as wm
        >>> machine = wm.build_machine(wm.load_machine("reference"))
        >>> response = wm.steady_response(machine, "middle", [38.0, 40.0], harmonics=3)
        >>> bool(response.stable.all())
        True
    """
    machine = machine_of(machine)
    setup = machine.set_up(load, gasket=gasket)
    return response_of(setup, speeds, harmonics, samples, progress)


@on_one_thread
def response_of(
    setup: Setup,
    speeds: Sequence[float] | FloatArray,
    harmonics: int = HARMONICS,
    samples: int = SAMPLES,
    progress: Callable[[float], None] = lambda fraction: None,
) -> xr.Dataset:
    """Return the steady response of a machine as it is set up; see `steady_response`."""
    grid = _checked(speeds, harmonics, samples)
    balance = HarmonicBalance(setup, Series(harmonics, samples))
    points = branch_of(balance, setup, grid, progress)
    return _measured(setup, balance, points)


def branch_of(
    balance: HarmonicBalance,
    setup: Setup,
    speeds: FloatArray,
    progress: Callable[[float], None] = lambda fraction: None,
) -> list[BranchPoint]:
    """Return the branch of periodic motions over the speeds."""

    def guesses() -> Iterator[FloatArray]:
        yield balance.rest()
        settled = settled_coefficients(balance, setup, float(speeds[0]))
        if np.all(np.isfinite(settled)):
            yield settled

    return follow(balance, speeds, first_motion(balance, speeds[0], guesses()), progress)


def _checked(speeds: Sequence[float] | FloatArray, harmonics: int, samples: int) -> FloatArray:
    """Return the speeds as an array."""
    grid = np.atleast_1d(np.asarray(speeds, dtype=float))
    steps = np.diff(grid)
    ordered = grid.ndim == 1 and len(grid) > 1 and (np.all(steps > 0.0) or np.all(steps < 0.0))
    if not ordered or not np.all(np.isfinite(grid)) or np.min(grid) <= 0.0:
        raise input_error(
            "needs at least two speeds above 0 that rise or fall all the way", key="speeds"
        )
    if not 1 <= harmonics <= MOST_HARMONICS:
        raise input_error(f"{harmonics} is not between 1 and {MOST_HARMONICS}", key="harmonics")
    if not 2 * harmonics < samples <= MOST_SAMPLES:
        raise input_error(
            f"{samples} is not above {2 * harmonics}, twice the number of harmonics, and up to "
            f"{MOST_SAMPLES}",
            key="samples",
        )
    return grid


def trajectory_of_period(
    balance: HarmonicBalance, coefficients: FloatArray, speed: float, samples: int
) -> Trajectory:
    """Return a revolution of a periodic motion; it has no torque and no accelerations (NaN)."""
    phase = 2.0 * np.pi * np.arange(samples) / samples
    states = balance.states(coefficients, speed, phase)
    parts = balance.derivative.layout.states
    motion, carrier, stretches = (
        np.ascontiguousarray(parts.take(states, kind)) for kind in (TUB, CARRIER, STRETCHES)
    )
    return Trajectory(
        phase / speed,
        motion,
        parts.deformation(states),
        np.full(samples, np.nan),
        np.full((samples, 6), np.nan),
        parts.tubes(states),
        carrier,
        stretches,
        element_states=parts.take(states, ELEMENT),
    )


def _measured(setup: Setup, balance: HarmonicBalance, points: list[BranchPoint]) -> xr.Dataset:
    """Return the dataset of `steady_response`."""
    samples, motions = balance.series.samples, _joined(balance, points)
    variables = variables_of(setup, motions)

    def by_point(name: str) -> FloatArray:
        values = variables[name][1]
        return values.reshape(len(points), samples, *values.shape[1:])

    displacement, forces = by_point("displacement"), by_point("mount_force")
    of_mounts = zip(*(force_measures(revolution) for revolution in forces), strict=True)
    values = {
        "amplitude": np.abs(displacement - displacement.mean(axis=1, keepdims=True)).max(axis=1),
        "detergent_displacement": np.abs(by_point("detergent_displacement")).max(axis=1),
        "gasket_force": _largest_of_gasket(setup, by_point("bushing_force")),
        "gasket_moment": _largest_of_gasket(setup, by_point("bushing_moment")),
        "spring_tension": 0.5 * np.ptp(by_point("spring_tension"), axis=1),
        "damper_tension": 0.5 * np.ptp(by_point("damper_tension"), axis=1),
        **{f"mount_force_{kind}": np.stack(of) for kind, of in zip(KINDS, of_mounts, strict=True)},
        "smallest_gap": _smallest_gaps(setup, motions, len(points)),
        "damper_spin": np.stack([point.spins for point in points]),
        "multiplier": [point.multiplier for point in points],
    }
    harmonic = np.stack([point.coefficients[1:3, :6].T for point in points])
    return xr.Dataset(
        {
            **{
                name: quantity.variable(("point", *dim.split()), values[name])
                for name, (dim, quantity) in OF_BRANCH.items()
            },
            "first_harmonic": (("point", "coordinate", "part"), harmonic, {"units": "rad, m"}),
            "stable": ("point", [point.stable for point in points]),
            "on_grid": ("point", [point.on_grid for point in points]),
        },
        {
            "speed": SPEED.variable("point", [point.speed for point in points]),
            "sensor": list(setup.sensors),
            "axis": list(AXES),
            "spring": list(setup.springs),
            "damper": [*setup.dampers, *setup.telescopes],
            "spinning": np.array([spin.name for spin in balance.kinematics.spins], dtype=object),
            "mount": list(mount_names(setup.parameters)),
            "coordinate": list(COORDINATES),
            "part": ["cosine", "sine"],
        },
        {"harmonics": balance.series.order, "samples": samples},
    )


def _joined(balance: HarmonicBalance, points: list[BranchPoint]) -> Trajectory:
    """Return the revolutions of all points, one after the other."""
    samples = balance.series.samples
    periods = [
        trajectory_of_period(balance, point.coefficients, point.speed, samples) for point in points
    ]
    names = ("time", "state", "deformation", "motor_torque", "acceleration", "tubes", "carrier")
    parts: dict[str, Any] = {
        name: np.concatenate([getattr(period, name) for period in periods])
        for name in (*names, "stretches", "element_states")
    }
    return Trajectory(**parts)


def _smallest_gaps(setup: Setup, motions: Trajectory, count: int) -> FloatArray:
    """Return the smallest gap in each of the revolutions (count,); NaN without shapes. [m]"""
    scene = Scene(setup.parameters)
    gaps = (
        scene.smallest_gap(time, poses, np.asarray(setup.rest_pose))
        for time, poses in zip(
            np.split(motions.time, count), np.split(motions.state[:, :6], count), strict=True
        )
    )
    return np.array([np.nan if gap is None else gap.distance for gap in gaps])


def _largest_of_gasket(setup: Setup, values: FloatArray) -> FloatArray:
    """Return the largest size of a force or moment of the gasket; zeros without one.

    Args:
        values: Those of all bushings. (points, samples, bushings, 3)
    """
    bushings = list(setup.bushings)
    if "gasket" not in bushings:
        return np.zeros((len(values), 3))
    largest: FloatArray = np.abs(values[:, :, bushings.index("gasket")]).max(axis=1)
    return largest


REVOLUTIONS = 60
"""Default number of drum revolutions until the motion has settled."""


def settled_trajectory(
    setup: Setup, speed: float, samples: int, revolutions: int = REVOLUTIONS
) -> Trajectory:
    """Return the last drum revolution of a run at constant speed that starts at rest.

    It is an independent check of harmonic balance, and a first guess without a better one.

    Args:
        speed: Of the drum. [rad/s]

    Returns:
        `samples` samples at equal distances; none if the run diverged.
    """
    period = 2.0 * np.pi / speed
    profile = SpinProfile(time=(0.0, revolutions * period), speed=(speed, speed))
    step = min(setup.parameters.step, period / samples)
    run = run_compiled(setup, profile, step, lambda fraction: None, period / samples)
    kept = slice(-samples - 1, -1) if run.divergence is None else slice(0, 0)
    return run.part(kept)


def settled_coefficients(balance: HarmonicBalance, setup: Setup, speed: float) -> FloatArray:
    """Return the Fourier coefficients of the settled motion; NaN if the run diverged."""
    run = settled_trajectory(setup, speed, balance.series.samples)
    if run.divergence is not None:
        return np.full((balance.series.size, balance.size), np.nan)
    return coefficients_of(balance, run)


def coefficients_of(balance: HarmonicBalance, run: Trajectory) -> FloatArray:
    """Return the Fourier coefficients of a revolution at the samples of a balance."""
    others = {CARRIER: run.carrier, STRETCHES: run.stretches}
    if run.element_states is not None:
        others[ELEMENT] = run.element_states
    layout = balance.derivative.layout
    states = layout.states.joined(run.state, run.deformation, run.tubes, others)
    return np.asarray(balance.series.analysis @ states[:, balance.derivative.free])
