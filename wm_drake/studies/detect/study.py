"""The draws, what is true of them, what a controller estimates, and what that decides.

Each draw runs twice with the same load and machine: the hold, and the spin that would follow. The
first half of the draws fits estimators and chooses thresholds; the second half judges them, so that
their intervals are those of loads that neither has seen.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from wm_drake.parameters import Load
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import HIDDEN, MASS, SPEED, Quantity, of_measure
from wm_drake.simulation.cases import Case
from wm_drake.studies.detect.decision import (
    DISTRIBUTIONS,
    MINUTES,
    OF_LOADS,
    NoThresholdError,
    threshold_for,
    verdict_of,
)
from wm_drake.studies.detect.estimators import Estimator, Predict, estimated
from wm_drake.studies.detect.holds import Hold, in_ranges
from wm_drake.studies.detect.measures import ACCELERATIONS_OF_HOLD, GAPS, SIGNALS_OF_HOLD
from wm_drake.studies.detect.signals import ControllerSignal, features_of
from wm_drake.studies.experiment import Experiment

HELD = 0.05
"""Part of the wanted speed by which a drum that holds it may differ from it."""

GAP = of_measure("smallest_gap")
TRUTHS = {
    "mass": MASS.named("mass", decimals=2),
    "moment": Quantity("moment along the drum", Unit("kg*m^2", "g*m^2"), 2),
    "gap": GAP.named("smallest gap of the spin"),
}
"""What is estimated: the mass that alone would have the static unbalance, at the mean radius of the
load; moment of the mass in its direction about mid-depth, positive at the rear; smallest gap."""


def truths_of(load: Load) -> tuple[float, float, float]:
    """Return mass and moment of a load, as of `TRUTHS`, and its unbalance. [kg, kg m^2, kg m]"""
    parts = [(u.mass * u.radius * np.exp(1j * u.phase), u.y, u.mass) for u in load.unbalances]
    static, total = sum(p[0] for p in parts), sum(p[2] for p in parts)
    size, radius = abs(static), sum(abs(p[0]) for p in parts) / total if total else 1.0
    moment = sum(p[0] * p[1] for p in parts) * np.conj(static) / size if size else 0.0
    return float(size / radius), float(np.real(moment)), float(size)


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws with their holds and spins.

    Attributes:
        holds: Holds, one for each speed of detection.
        seen: Measures of the draws in each hold.
        truths: What is true of each draw, by the names of `TRUTHS`; the gap is NaN if the spin
            failed.
        unbalance: Static unbalance, mass times radius. (draws,) [kg m]
        highest: Highest speed up to which the clearance is kept, 0 if none. (draws,) [rad/s]
        clearance: Gap that must remain. [m]
    """

    holds: tuple[Hold, ...]
    seen: tuple[xr.Dataset, ...]
    truths: dict[str, FloatArray]
    unbalance: FloatArray
    highest: FloatArray
    clearance: float
    seed: int

    @property
    def touches(self) -> NDArray[np.bool_]:
        """Return which draws touch, or come too near; a spin that failed does."""
        return ~(self.truths["gap"] > self.clearance)

    @cached_property
    def is_fitted(self) -> NDArray[np.bool_]:
        """Return which draws fit; the others judge."""
        count = len(self.truths["gap"])
        return np.arange(count) < count // 2


def draws_of(
    experiment: Experiment,
    cases: Sequence[Case],
    holds: tuple[Hold, ...],
    clearance: float,
    seed: int,
    *,
    has_accelerometers: bool,
) -> Draws:
    """Run draws: each hold, the spin, and spins that touch once more for the speed at which.

    Args:
        experiment: Runs of the machine.
        cases: Spin of each draw.
        clearance: Gap that must remain. [m]
        has_accelerometers: Whether a signal is that of an accelerometer.
    """
    numbers = range(1, len(cases) + 1)

    def run(
        names: Iterable[str], of: Iterable[Case], labels: Sequence[int], what: str
    ) -> xr.Dataset:
        return replace(experiment, measures=tuple(names)).over({"draw": labels}, of, what)

    of_hold = [SIGNALS_OF_HOLD.name, *([ACCELERATIONS_OF_HOLD.name] * has_accelerometers)]
    seen = tuple(
        run(of_hold, with_profile(cases, hold), numbers, f"holds at {SPEED.text(hold.speed)}")
        for hold in holds
    )
    gaps = run(["gap"], cases, numbers, "spins").smallest_gap.values
    touching = np.flatnonzero(~(gaps > clearance)).tolist()
    ranges, limits = in_ranges(cases[0].profile)
    highest = np.full(len(cases), limits[-1])
    if touching:
        again = (replace(cases[k], profile=ranges) for k in touching)
        by_range = run([GAPS.name], again, touching, "speeds of contact").region_gap.values
        first = np.argmax(by_range <= clearance, axis=1)
        highest[touching] = np.append(0.0, limits)[first]
    mass, moment, unbalance = np.array([truths_of(case.load) for case in cases]).T
    truths = {"mass": mass, "moment": moment, "gap": gaps}
    return Draws(holds, seen, truths, unbalance, highest, clearance, seed)


def with_profile(cases: Iterable[Case], hold: Hold) -> Iterator[Case]:
    """Yield cases with the profile of a hold in place of that of the spin."""
    return (replace(c, name=f"{c.name}, hold", profile=hold.profile) for c in cases)


@dataclass(frozen=True)
class Plan:
    """What a controller reads, and how it estimates.

    Attributes:
        hold: Number of the hold.
        signals: Signals; the threshold of the ripple is one of the first.
        families: Families of features, of `signals.FEATURES`.
        turns: Length of the window.
    """

    hold: int
    signals: tuple[ControllerSignal, ...]
    families: tuple[str, ...]
    turns: int
    estimator: Estimator

    def amplitudes(self, draws: Draws) -> list[FloatArray]:
        """Return the amplitudes of each signal (draws, orders); NaN where the hold failed."""
        hold, data = draws.holds[self.hold], draws.seen[self.hold]
        speed = data.window_speed.values[:, -1]
        is_held = np.abs(speed - hold.speed) <= HELD * hold.speed
        read = (s.amplitudes(hold, data, self.turns, draws.seed) for s in self.signals)
        return [np.where(is_held[:, None], values, np.nan) for values in read]

    def features(self, draws: Draws) -> xr.DataArray:
        """Return the features of each draw."""
        return features_of(self.signals, self.families, self.amplitudes(draws))

    def ripple(self, draws: Draws) -> FloatArray:
        """Return the amplitude of order one of the first signal. (draws,) [SI]"""
        return np.abs(self.amplitudes(draws)[0][:, 0])

    def estimates(self, draws: Draws, name: str) -> tuple[Predict, FloatArray]:
        """Return what the estimator learned of a truth, and its estimates."""
        of = draws.truths[name]
        return estimated(self.estimator, self.features(draws), of, draws.is_fitted)


def monitor_of(plan: Plan, speed: ControllerSignal, draws: Draws, gravity: float) -> FloatArray:
    """Return the impedance of a monitor, and the unbalance that it estimates of each draw.

    The impedance Z fits the weight of the unbalance of the first half, m r g = Z |u|, to the exact
    ripple u of the drum speed.

    Returns:
        (1 + draws,) [N m s/rad, kg m]
    """
    exact = replace(plan, signals=(replace(speed, noise=0.0, resolution=0.0),))
    ripple, weight = exact.ripple(draws), gravity * draws.unbalance
    used = draws.is_fitted & np.isfinite(ripple)
    impedance = np.sum(weight[used] * ripple[used]) / np.sum(ripple[used] ** 2)
    return np.append(impedance, impedance * ripple / gravity)


def errors_of(plan: Plan, draws: Draws) -> xr.Dataset:
    """Return truth and estimate of each draw that judges, over `judged`, by name.

    Returns:
        `NAME` and `NAME_estimated` for the names of `TRUTHS`.
    """
    chosen, columns = ~draws.is_fitted, dict[str, xr.Variable]()
    for name, quantity in TRUTHS.items():
        estimates = plan.estimates(draws, name)[1]
        columns[name] = quantity.variable("judged", draws.truths[name][chosen])
        words = f"estimated {quantity.words}"
        columns[f"{name}_estimated"] = quantity.named(words).variable("judged", estimates[chosen])
    return xr.Dataset(columns, {"judged": np.flatnonzero(chosen) + 1})


def summary_of(errors: xr.Dataset) -> xr.Dataset:
    """Return bias, RMS and 95 % limit of the errors, and the scatter of the truths.

    Args:
        errors: As of `errors_of`.

    Returns:
        Over `estimate`: `scatter`, `bias`, `rms` and `p95`.
    """
    rows = []
    for name in TRUTHS:
        error = (errors[f"{name}_estimated"] - errors[name]).values
        error = error[np.isfinite(error)]
        truth = errors[name].values
        rows.append(
            (
                np.nanstd(truth),
                error.mean(),
                np.sqrt(np.mean(error**2)),
                np.quantile(abs(error), 0.95),
            )
        )
    heads = {
        "scatter": "scatter of the loads",
        "bias": "bias",
        "rms": "RMS error",
        "p95": "95 % below",
    }
    names = [quantity.words for quantity in TRUTHS.values()]
    each = dict(zip(names, TRUTHS.values(), strict=True))
    return xr.Dataset(
        {
            key: Quantity(words).of_each("estimate", each, "estimate", column)
            for (key, words), column in zip(heads.items(), zip(*rows, strict=True), strict=True)
        },
        {"estimate": names},
    )


def choices_of(
    plan: Plan, draws: Draws, more: Sequence[ControllerSignal], turns: Sequence[int]
) -> dict[str, Plan]:
    """Return the estimate and what could be better, by words.

    Args:
        more: Signals that may be added.
    """
    base = "the same signals"
    exact = tuple(replace(s, noise=0.0, resolution=0.0) for s in plan.signals)
    choices = {base: plan, f"{base} without noise": replace(plan, signals=exact)}
    for signal in more:
        words = f"{base} and {signal.quantity.words}"
        choices[words] = replace(plan, signals=(*plan.signals, signal))
    choices |= {f"{base}, {n} turns": replace(plan, turns=n) for n in turns if n != plan.turns}
    for number, hold in enumerate(draws.holds):
        if number != plan.hold and plan.turns in hold.windows:
            choices[f"{base} at {SPEED.text(hold.speed)}"] = replace(plan, hold=number)
    return choices


def ranked(choices: dict[str, Plan], draws: Draws, risk: float, retry: float) -> xr.Dataset:
    """Return what each choice costs at the tolerated risk, the cheapest one first.

    Each half of the draws judges what the other one fitted; thresholds are of the estimated gap.

    Args:
        choices: As of `choices_of`; the first one is what the others are compared with.
        retry: Duration of a distribution. [s]

    Returns:
        Over `choice`: `rms` error of the gap [m], `spins`, share of loads that spin at once, with
        `spins_lower` and `spins_upper`, `distributions`, `minutes` and `saved` minutes per wash;
        NaN where no threshold reaches the risk.
    """
    rows = [_both_ways(plan, draws, risk) for plan in choices.values()]
    rms, share, lower, upper = np.array(rows).T
    with np.errstate(divide="ignore"):
        expected = 1.0 / share
    minutes = expected * retry / 60.0
    columns = {
        "rms": GAP.named("RMS error of the gap", decimals=2).variable("choice", rms),
        "spins": OF_LOADS.named("spin at once").variable("choice", share),
        "spins_lower": OF_LOADS.named("95 % from").variable("choice", lower),
        "spins_upper": OF_LOADS.named("to").variable("choice", upper),
        "distributions": DISTRIBUTIONS.variable("choice", expected),
        "minutes": MINUTES.named("minutes per wash", decimals=2).variable("choice", minutes),
        "saved": MINUTES.named("saved", decimals=2).variable("choice", minutes[0] - minutes),
    }
    columns["distributions"].attrs[HIDDEN] = True
    order = np.lexsort((rms, np.nan_to_num(minutes, nan=np.inf)))
    return xr.Dataset(columns, {"choice": list(choices)}).isel(choice=order)


def _both_ways(plan: Plan, draws: Draws, risk: float) -> tuple[float, float, float, float]:
    """Return RMS error of the gap, share that spins and its interval, from both halves."""
    errors, spins = list[FloatArray](), list[NDArray[np.bool_]]()
    features, gap, touches = plan.features(draws), draws.truths["gap"], draws.touches
    try:
        for fitted in (draws.is_fitted, ~draws.is_fitted):
            estimates = estimated(plan.estimator, features, gap, fitted)[1]
            threshold = threshold_for(-estimates[fitted], touches[fitted], risk)
            errors.append((estimates - gap)[~fitted])
            spins.append(-estimates[~fitted] <= threshold)
    except NoThresholdError:
        spins = []
    rms = float(np.sqrt(np.nanmean(np.concatenate(errors) ** 2))) if errors else np.nan
    if not spins:
        return rms, np.nan, np.nan, np.nan
    none = np.zeros(len(gap), dtype=bool)
    share = verdict_of(np.where(np.concatenate(spins), 0.0, 1.0), none, 0.5).spins
    return rms, share.estimate, share.lower, share.upper
