"""Identification of parameters from vibrations of the whole machine in a spin cycle.

[A] section 4.2 identifies the parameters of its Table 8 in this way.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.unbalance_cases import UnbalanceCase
from wm_drake.parameters.units import Share
from wm_drake.parameters.vary import Entry
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.cases import Case
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.fitting.problem import FitProblem, Measurement, Progress
from wm_drake.studies.fitting.search import silent
from wm_drake.studies.fitting.sought import Sought, SoughtNumbers, at_point, sought_in, sought_of
from wm_drake.studies.spin_cycle.measured import DIMS, RMS
from wm_drake.studies.spin_cycle.study import average_errors, labels_of, region_errors, runs_of

PLANTED = (0.8, 1.25)
"""Range of the ratio of true number to machine's number in a virtual experiment."""

AVERAGE_ERROR = Quantity("average error of an RMS displacement", Share(), 1)
RELATIVE_ERROR = Quantity("relative error", Share(), 2)
RESIDUAL = Quantity("residual", Share(), 2)
HALF_WIDTH = Quantity("95 % interval, ±", Share(), 2)

KNOWN = 0.02
"""Largest relative half-width of the 95 % confidence interval of an identified unknown."""

TABLE_8 = (
    ("bushing_types.connecting.friction_torque_y",),
    ("bushing_types.connecting.full_friction_rate_y",),
    ("gasket.rotational_stiffness_x", "gasket.rotational_stiffness_z"),
    ("gasket.rotational_stiffness_y",),
    ("gasket.friction_torque_x", "gasket.friction_torque_y", "gasket.friction_torque_z"),
    ("gasket.full_friction_rate_x", "gasket.full_friction_rate_y", "gasket.full_friction_rate_z"),
)
"""Keys of the numbers that [A] could identify from the whole machine only.

They are the friction about the axis of its bushings and all rotational numbers of the gasket.
"""


def unknowns_of(parameters: MachineParameters, texts: Sequence[str]) -> tuple[Sought, ...]:
    """Return the unknowns of KEYS[=RANGE] texts, or those of [A] Table 8 if there are none.

    Raises:
        InputError: a key or a range is wrong, or the machine does not have the numbers of Table 8.
    """
    if texts:
        return sought_in(parameters, texts)
    if not parameters.bushing_types or parameters.gasket is None:
        raise input_error(
            f"machine '{parameters.name}' does not have the numbers of [A] Table 8; give keys "
            "of this machine",
            where="--unknown",
        )
    return tuple(sought_of(parameters, "+".join(keys), Entry(keys=keys)) for keys in TABLE_8)


def planted_values(sought: Sequence[Sought], seed: int) -> FloatArray:
    """Draw true numbers of a virtual experiment; all differ from the machine's. In SI units."""
    low, high = np.log(PLANTED)
    drawn = np.random.default_rng(seed).uniform(0.3, 1.0, len(sought)) * np.where(
        np.arange(len(sought)) % 2, low, high
    )
    guesses = np.array([s.guess for s in sought])
    lower, upper = np.array([(s.unknown.lower, s.unknown.upper) for s in sought]).T
    return np.clip(guesses * np.exp(drawn), 1.02 * lower, 0.98 * upper)


@dataclass(frozen=True)
class SpinModel:
    """RMS displacements of unbalance cases as a function of the unknowns."""

    experiment: Experiment
    parameters: MachineParameters
    profile: SpinProfile
    cases: tuple[UnbalanceCase, ...]
    sought: tuple[Sought, ...]

    def displacements(self, points: FloatArray) -> FloatArray:
        """Compute the RMS displacements at points.

        Args:
            points: (k, unknowns) in SI units.

        Returns:
            (k, case, region, accelerometer, axis); NaN where a run diverged. [m]
        """
        labels = {"point": range(len(points)), "case": [case.name for case in self.cases]}
        runs = self.experiment.over(labels, self._runs(points))
        return np.asarray(runs.region_displacement.values)

    def _runs(self, points: FloatArray) -> Iterator[Case]:
        for point in points:
            parameters = at_point(self.parameters, self.sought, point)
            for run in runs_of(parameters, self.cases, self.profile):
                yield replace(run, parameters=parameters)


def virtual_experiment(
    model: SpinModel, planted: FloatArray, noise: float, seed: int
) -> xr.DataArray:
    """Simulate an experiment: RMS displacements with the true numbers and random errors.

    Args:
        planted: True numbers of the unknowns, in SI units.
        noise: Relative standard deviation of the error of each value.

    Returns:
        (case, region, accelerometer, axis). [m]
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
    progress: Progress = silent,
) -> tuple[Fit, xr.Dataset]:
    """Identify the unknowns from measured RMS displacements.

    The fit minimizes the root mean square of the relative errors [A] Eq. (9) of all regions and
    cases.

    Args:
        measured: (case, region, accelerometer, axis) RMS displacements; NaN where nothing was
            measured. [m]
        planted: True numbers of a virtual experiment, in SI units.
        progress: Called with the fraction done and the lowest error so far.

    Returns:
        The fit; and over case, region, accelerometer and axis, RMS displacements [m]: `measured`,
        `before` the identification, and `after` it, with the identified numbers; `residual`, after
        less measured, by the norm of what was measured in the case and region. Over `case` alone:
        relative errors, [A] Eq. (9), `error_before` and `error_after`, means over the regions. Over
        no dimension: `average_error_before` and `average_error_after`. Over `unknown`:
        `half_width` of the 95 % interval by the value, infinite if the data do not determine it;
        whether it `is_identified` to within `KNOWN`; in a virtual experiment the relative `error`.

    Raises:
        InputError: nothing was measured in the cases of the study.
    """
    problem = _problem(model, measured)
    fit = identify(problem, seed=seed, starts=1, screened=8, progress=progress)
    start = np.array([s.guess for s in model.sought])
    computed = [
        measured.copy(data=values) for values in model.displacements(np.stack([start, fit.values]))
    ]
    data: dict[str, Any] = {"measured": RMS.variable(DIMS, measured)}
    for name, values in zip(("before", "after"), computed, strict=True):
        error = region_errors(values, measured).mean("region")
        average = average_errors(values, measured).mean()
        data[name] = RMS.named(name).variable(DIMS, values)
        data[f"error_{name}"] = RELATIVE_ERROR.named(name).variable("case", error)
        words = f"{AVERAGE_ERROR.words} {name}"
        data[f"average_error_{name}"] = AVERAGE_ERROR.named(words).variable((), average)
    norms = (measured**2).sum(DIMS[2:]) ** 0.5
    residual = (computed[1] - measured) / norms.where(norms > 0.0)
    data["residual"] = RESIDUAL.variable(DIMS, residual.transpose(*DIMS))
    halves = half_widths(fit)
    data["half_width"] = HALF_WIDTH.variable("unknown", halves)
    data["is_identified"] = ("unknown", halves <= KNOWN)
    if planted is not None:
        data["error"] = RELATIVE_ERROR.named("error").variable(
            "unknown", fit.values / planted - 1.0
        )
    coords = {str(dim): measured[dim].values for dim in DIMS}
    names = [sought.unknown.name for sought in model.sought]
    return fit, xr.Dataset(data, {**coords, "unknown": names})


def half_widths(fit: Fit) -> FloatArray:
    """Return half the 95 % interval of each estimate by its value; infinite without an interval."""
    halves = [
        0.5 * (e.upper - e.lower) / abs(e.value) if e.value else np.nan for e in fit.estimates
    ]
    return np.where(np.isfinite(halves), halves, np.inf)


def identified_machine(model: SpinModel, fit: Fit, *, is_virtual: bool) -> MachineParameters:
    """Return the machine with the identified numbers and the source of each."""
    virtual = "virtual experiment: " if is_virtual else ""
    cases = ", ".join(case.name for case in model.cases)
    source = f"{virtual}identified from spin cycle, cases {cases}"
    return SoughtNumbers(model.parameters, model.sought, "identified").solved(fit, source)


def _problem(model: SpinModel, measured: xr.DataArray) -> FitProblem:
    """Return the fit problem, whose residuals are those of [A] Eq. (9).

    Each value is divided by the norm of the measured values in its case and region. Its error is a
    part of the value, so each has a variance of its own.
    """
    is_measured = np.isfinite(measured.values)
    data = np.where(is_measured, measured.values, 0.0)
    norms = np.sqrt(np.sum(data**2, axis=(2, 3), keepdims=True))
    is_measured &= norms > 0.0
    weights = is_measured / np.where(norms > 0.0, norms, 1.0)
    with_data = [k for k in range(len(model.cases)) if is_measured[k].any()]
    if not with_data:
        raise input_error(
            "nothing was measured in the cases of this study; at least one needs values above 0"
        )

    def scaled(values: FloatArray) -> list[FloatArray]:
        return [(values[..., k, :, :, :] * weights[k])[..., is_measured[k]] for k in with_data]

    tests = tuple(
        Measurement(f"case {model.cases[k].name}", numbers, errors="each")
        for k, numbers in zip(with_data, scaled(data), strict=True)
    )
    unknowns = tuple(s.unknown for s in model.sought)
    return FitProblem(
        unknowns, tests, lambda points: np.concatenate(scaled(model.displacements(points)), axis=1)
    )
