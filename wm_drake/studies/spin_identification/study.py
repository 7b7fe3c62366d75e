"""Numbers of a machine from vibrations of the whole of it in a spin cycle, as [A] section 4.2 found those of its Table 8."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import xarray as xr

from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters import MachineParameters, SpinProfile, quantities, with_values
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.unbalance_cases import UnbalanceCase
from wm_drake.parameters.units import Unit
from wm_drake.simulation.cases import Case
from wm_drake.studies.fitting import Fit, FitProblem, Measurement, Progress, Unknown, least_squares
from wm_drake.studies.spin_cycle.study import DIMS, labels_of, runs_of

SPAN = 1.5
"""An unknown without a range of its own is sought between its number divided and multiplied by this."""

PLANTED = (0.8, 1.25)
"""Factors between which a virtual experiment draws the true number of each unknown, by its logarithm."""

KNOWN = 0.02
"""Half a 95 % interval, as a part of the number, up to which an unknown counts as identified."""

JOIN = "+"
"""Between the keys of numbers that are equal, being one unknown."""

TABLE_8 = (
    ("bushing_types.connecting.friction_torque_y",),
    ("bushing_types.connecting.full_friction_rate_y",),
    ("gasket.rotational_stiffness_x", "gasket.rotational_stiffness_z"),
    ("gasket.rotational_stiffness_y",),
    ("gasket.friction_torque_x", "gasket.friction_torque_y", "gasket.friction_torque_z"),
    ("gasket.full_friction_rate_x", "gasket.full_friction_rate_y", "gasket.full_friction_rate_z"),
)
"""What [A] could only get from the whole machine: friction about the axis of its bushings, and all rotations of the gasket."""

DEFAULT_CASES = ("2", "5", "29")
"""Of [A] Table 9: 400 g in front, at the rear, and both opposite, as in its Figs. 24 to 26."""

Regions: TypeAlias = Callable[[Iterable[Case]], xr.Dataset]
"""Runs cases, gives the table that `simulate_many` gives of "regions"."""


@dataclass(frozen=True)
class Sought:
    """An unknown, and the keys of a machine that have its number."""

    keys: tuple[str, ...]
    unknown: Unknown


@dataclass(frozen=True)
class SpinIdentification:
    """Result of an identification.

    Attributes:
        parameters: The machine, as it was before.
        profile, cases: What was run.
        sought: The unknowns.
        fit: What was found.
        measured: RMS displacements (case, region, accelerometer, axis). [m]
        before, after: The same of the machine as it was, and with what was found. [m]
        planted: True numbers of a virtual experiment; None of a real one. [SI]
    """

    parameters: MachineParameters
    profile: SpinProfile
    cases: tuple[UnbalanceCase, ...]
    sought: tuple[Sought, ...]
    fit: Fit
    measured: xr.DataArray
    before: xr.DataArray
    after: xr.DataArray
    planted: FloatArray | None = None

    @property
    def uncertainty(self) -> FloatArray:
        """Half of each unknown's 95 % interval, by its number; infinite where the data do not determine it."""
        halves = [
            0.5 * (e.upper - e.lower) / abs(e.value) if e.value else np.nan
            for e in self.fit.estimates
        ]
        return np.where(np.isfinite(halves), halves, np.inf)

    @property
    def identifiable(self) -> tuple[bool, ...]:
        """Which unknowns the data determine to `KNOWN`."""
        return tuple(bool(half <= KNOWN) for half in self.uncertainty)

    @property
    def recovered(self) -> FloatArray | None:
        """Relative error of each unknown of a virtual experiment."""
        return None if self.planted is None else self.fit.values / self.planted - 1.0


def sought_of(
    parameters: MachineParameters,
    keys: Sequence[str],
    bounds: tuple[float, float] | None = None,
    span: float = SPAN,
) -> Sought:
    """An unknown of a machine, sought by its logarithm.

    Args:
        parameters: The machine; its number is the start.
        keys: Key paths of numbers that are to be equal.
        bounds: Of the search; around the machine's number if None. [SI]
        span: How far around.

    Raises:
        InputError: no such key, no number there, or none that is positive.
    """
    known = {
        key: (value, unit)
        for key, value, unit in quantities(parameters)
        if isinstance(value, float)
    }
    for key in keys:
        if key not in known:
            raise input_error(
                f"no number '{key}' in machine '{parameters.name}'{nearest_names(key, known)}",
                key=key,
            )
    value, unit = known[keys[0]]
    if any(known[key][1] != unit for key in keys):
        raise input_error(f"{', '.join(keys)} have not the same unit", key=keys[0])
    if bounds is None and value <= 0.0:
        raise input_error("is not positive, so its range must be given", key=keys[0])
    lower, upper = bounds or (value / span, value * span)
    start = value if lower <= value <= upper else None
    return Sought(
        tuple(keys), Unknown(JOIN.join(keys), lower, upper, unit, start, logarithmic=lower > 0.0)
    )


def unit_of_key(parameters: MachineParameters, key: str) -> Unit:
    """The unit of a number of a machine; any unit where there is none, which `sought_of` refuses."""
    return next(
        (unit for known, _, unit in quantities(parameters) if known == key), Unit("m", "mm")
    )


def at_point(
    parameters: MachineParameters, sought: Sequence[Sought], values: FloatArray
) -> MachineParameters:
    """The machine with the unknowns' numbers. [SI]"""
    return with_values(
        parameters, {key: float(v) for s, v in zip(sought, values, strict=True) for key in s.keys}
    )


def planted_values(sought: Sequence[Sought], seed: int) -> FloatArray:
    """True numbers of a virtual experiment, none of them the machine's. [SI]"""
    low, high = np.log(PLANTED)
    drawn = np.random.default_rng(seed).uniform(0.3, 1.0, len(sought)) * np.where(
        np.arange(len(sought)) % 2, low, high
    )
    starts = [s.unknown.start or np.sqrt(s.unknown.lower * s.unknown.upper) for s in sought]
    bounds = np.array([(s.unknown.lower, s.unknown.upper) for s in sought])
    return np.clip(np.array(starts) * np.exp(drawn), 1.02 * bounds[:, 0], 0.98 * bounds[:, 1])


@dataclass(frozen=True)
class SpinModel:
    """RMS displacements of the cases as a function of the unknowns; `regions` runs them."""

    parameters: MachineParameters
    profile: SpinProfile
    cases: tuple[UnbalanceCase, ...]
    sought: tuple[Sought, ...]
    regions: Regions

    def displacements(self, points: FloatArray) -> FloatArray:
        """At points (k, unknowns) in SI: (k, case, region, accelerometer, axis); NaN where a run diverged. [m]"""
        labels = labels_of(self.parameters, self.cases, self.profile)
        table = self.regions(self._runs(points))
        return table.region_displacement.values.reshape(
            len(points), *(len(labels[dim]) for dim in DIMS)
        )

    def _runs(self, points: FloatArray) -> Iterator[Case]:
        for point in points:
            parameters = at_point(self.parameters, self.sought, point)
            for run in runs_of(parameters, self.cases, self.profile):
                yield replace(run, parameters=parameters)


def virtual_experiment(
    model: SpinModel, planted: FloatArray, noise: float, seed: int
) -> xr.DataArray:
    """RMS displacements that a machine with the planted numbers would show, each with a relative error of its own.

    Args:
        model: Computes them.
        planted: True numbers of the unknowns. [SI]
        noise: Standard deviation of the errors; a fraction.
        seed: Of the errors.
    """
    exact = model.displacements(planted[None])[0]
    errors = np.random.default_rng(seed).standard_normal(exact.shape)
    return xr.DataArray(
        exact * (1.0 + noise * errors),
        labels_of(model.parameters, model.cases, model.profile),
        DIMS,
    )


def identify_from_spin(
    model: SpinModel,
    measured: xr.DataArray,
    *,
    planted: FloatArray | None = None,
    seed: int = 0,
    progress: Progress = lambda fraction, least: None,
) -> SpinIdentification:
    """Finds the unknowns with which the relative errors [A] Eq. (9) of all regions and cases are least, by root mean square.

    Args:
        model: Of the machine.
        measured: RMS displacements (case, region, accelerometer, axis), NaN where nothing was measured. [m]
        planted: The truth, if this is a virtual experiment. [SI]
        seed: Of the points where the search looks first.
        progress: Called with the fraction done and the least error so far.
    """
    problem = _problem(model, measured)
    fit = least_squares(problem, seed=seed, starts=1, screened=8, progress=progress)
    start = np.array(
        [s.unknown.start or np.sqrt(s.unknown.lower * s.unknown.upper) for s in model.sought]
    )
    before, after = (
        measured.copy(data=values) for values in model.displacements(np.stack([start, fit.values]))
    )
    return SpinIdentification(
        model.parameters,
        model.profile,
        model.cases,
        model.sought,
        fit,
        measured,
        before,
        after,
        planted,
    )


def _problem(model: SpinModel, measured: xr.DataArray) -> FitProblem:
    """Residuals are parts of Eq. (9): each number over the norm of what was measured in its case and region."""
    there = np.isfinite(measured.values)
    sizes = np.sqrt(np.sum(np.where(there, measured.values, 0.0) ** 2, axis=(2, 3), keepdims=True))
    there &= sizes > 0.0
    weights = there / np.where(sizes > 0.0, sizes, 1.0)
    with_data = [k for k in range(len(model.cases)) if there[k].any()]
    if not with_data:
        raise input_error("nothing was measured in the cases of this study")

    def scaled(values: FloatArray) -> list[FloatArray]:
        return [(values[..., k, :, :, :] * weights[k])[..., there[k]] for k in with_data]

    tests = tuple(
        Measurement(f"case {model.cases[k].name}", numbers)
        for k, numbers in zip(with_data, scaled(np.where(there, measured.values, 0.0)), strict=True)
    )
    unknowns = tuple(s.unknown for s in model.sought)
    return FitProblem(
        unknowns, tests, lambda points: np.concatenate(scaled(model.displacements(points)), axis=1)
    )
