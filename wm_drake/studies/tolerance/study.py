"""The tolerance study: samples of an uncertain machine, contact, Sobol indices, limits."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters.tolerances import Limit, fraction
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures.responses import GAP, Response
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studies.tolerance.rare import RareEvent, subset_simulation
from wm_drake.studies.tolerance.sensitivity import Index, exchanged, sobol_indices
from wm_drake.studies.tolerance.shares import SampleShare, bound_if_none, share_of
from wm_drake.studies.tolerance.variables import UncertainMachine

RunSamples: TypeAlias = Callable[[Iterable[Case], str], xr.Dataset]
"""Function that runs cases and returns their table, given a word for what they are."""

RARE = 1e-3
"""Share of runs with contact below which it is estimated by subset simulation."""

CRUDE, SUBSET = "crude count", "subset simulation"
"""Methods of the probability of contact."""

DEFAULT = ("D", "F", "M", GAP, "amplitude", "mount_force_peak")
"""Responses of a study that names none."""

CONTACTS = "contacts"
"""Measure of `simulate_many` that tells which shapes touch."""


CORRELATED = (
    "Sobol indices divide the variance among independent quantities. Here quantities are "
    "correlated, so the shares would overlap and are not computed. Shapley effects divide it in "
    "this case, too: shapleysobol_knn of the R package 'sensitivity' estimates them from "
    "samples.csv."
)
"""Why correlated quantities have no Sobol indices."""


@dataclass(frozen=True)
class ToleranceSettings:
    """Numbers of samples.

    Attributes:
        samples: Samples of the machine, a power of two.
        sensitivity: Samples of the Sobol indices, a power of two up to `samples`; 0 for none.
        subset: Samples of each level of the subset simulation; 0 for none.
    """

    samples: int = 4096
    sensitivity: int = 512
    subset: int = 1000
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("samples", "sensitivity"):
            value = getattr(self, name)
            if value & (value - 1) or (name == "samples" and value < 16):
                allowed = [16, 1024, 4096, 8192] if name == "samples" else [0, 256, 512, 1024]
                raise input_error(
                    f"{value} is not a power of two, which a Sobol sequence needs; write for "
                    f"example {', '.join(map(str, allowed))}",
                    where=f"--{name}",
                )
        if self.sensitivity > self.samples:
            raise input_error(
                f"{self.sensitivity} is more than the samples, {self.samples}",
                where="--sensitivity",
            )
        if self.subset and (self.subset < 100 or self.subset % 10):
            raise input_error(
                f"{self.subset} is not allowed; allowed are 0 and multiples of 10 from 100",
                where="--subset",
            )


@dataclass(frozen=True)
class Contact:
    """How often the tub group touches the housing.

    Attributes:
        estimate: Probability of contact.
        lower, upper: Ends of its 95 % interval. If nothing touches, upper is the bound of the rule
            of three.
        method: CRUDE or SUBSET; CRUDE if the subset simulation ended without contact.
        crude: Share of the samples.
        pairs: Share of the samples by pair of shapes, the most frequent first; pairs that never
            touch are left out.
        nearest: Number of samples in which each pair has the smallest gap.
        rare: Subset simulation; None if there was none.
        rare_pairs: Share of the contacts that it found by pair, the most frequent first.
    """

    estimate: float
    lower: float
    upper: float
    method: str
    crude: SampleShare
    pairs: dict[str, SampleShare]
    nearest: dict[str, int]
    rare: RareEvent | None
    rare_pairs: dict[str, float]


@dataclass(frozen=True)
class LimitVerdict:
    """Judgement of a limit.

    Attributes:
        key: Name of the measure with its unit.
        number: The limit. [unit of the measure]
        allowed: Allowed share. [0 to 1]
        broken: Share of runs that break it.
        word: "pass" if the whole interval is allowed, "fail" if none of it is, else "undecided".
    """

    limit: Limit
    key: str
    number: float
    allowed: float
    broken: SampleShare
    word: str


@dataclass(frozen=True)
class ToleranceStudy:
    """Result of a tolerance study.

    Attributes:
        chosen: What is measured of each run.
        scores: Scores of the samples. (samples, variables)
        values: Measures of the samples by the names of `measure_key`; NaN where a run failed.
        failed: Reason of each failed run, by number of the sample from 0.
        contact: Contact; None if the SDF has no shapes.
        indices: Sobol indices of each variable, by measure.
        refused: Why there are no Sobol indices of some or all measures; "" if there are all.
        verdicts: Judgements of limits.
        runs: Number of all runs.
    """

    machine: UncertainMachine
    settings: ToleranceSettings
    chosen: tuple[Response, ...]
    scores: FloatArray
    values: pd.DataFrame
    failed: dict[int, str]
    contact: Contact | None
    indices: dict[str, list[Index]]
    refused: str
    verdicts: tuple[LimitVerdict, ...]
    runs: int


def measure_key(response: Response) -> str:
    """Return the name of a measure with its unit, such as smallest_gap_mm."""
    name = "smallest_gap" if response.name == GAP else response.name
    return f"{name}_{response.unit.shown.replace('*', '')}"


def limits_of(
    limits: Iterable[Limit], chosen: Sequence[Response]
) -> list[tuple[Limit, Response, float]]:
    """Return each limit with its response and its number in the unit of the response.

    Raises:
        InputError: a limit names a response that is not measured, or has a wrong unit.
    """
    resolved, problems = [], []
    names = {response.name: response for response in chosen}
    names |= {"smallest_gap": names[GAP]} if GAP in names else {}
    for place, limit in enumerate(limits):
        key = f"limits.{place}"
        response = names.get(limit.quantity)
        if response is None:
            known = ", ".join(list(names)[:12])
            message = (
                f"'{limit.quantity}' is not measured; add it with --response, or use one of "
                f"{known}, ..."
            )
            problems.append(Problem("", f"{key}.quantity", message))
            continue
        try:
            value = response.unit.from_si(response.unit.number(limit.text))
            resolved.append((limit, response, value))
        except ValueError as error:
            problems.append(Problem("", key, str(error)))
    if problems:
        raise InputError(problems)
    return resolved


def run_tolerances(
    machine: UncertainMachine,
    chosen: tuple[Response, ...],
    run: RunSamples,
    settings: ToleranceSettings,
    limits: Sequence[tuple[Limit, Response, float]] = (),
) -> ToleranceStudy:
    """Run a tolerance study.

    Args:
        limits: From `limits_of`.
    """
    trials = _Trials(machine, chosen, run, settings)
    a, b = base_samples(machine.joint.size, settings.samples, settings.seed)
    table = run(machine.cases(a), "samples")
    values = _measures(table, chosen)
    indices, refused, more = trials.indices(a, b, values)
    contact = trials.contact(table)
    rare = contact.rare.evaluations if contact and contact.rare else 0
    return ToleranceStudy(
        machine,
        settings,
        chosen,
        a,
        values,
        _failed(table),
        contact,
        indices,
        refused,
        tuple(judged(values, *limit) for limit in limits),
        settings.samples + more + rare,
    )


def judged(values: pd.DataFrame, limit: Limit, response: Response, number: float) -> LimitVerdict:
    """Return the verdict on a limit. A run that failed breaks every limit.

    Args:
        values: Measures of the samples.
        number: The limit. [unit of the response]
    """
    values_of_limit = values[measure_key(response)].to_numpy()
    kept = values_of_limit >= number if limit.at_least is not None else values_of_limit <= number
    broken, allowed = share_of(np.asarray(~kept)), fraction(limit.allowed_share, "allowed_share")
    word = "pass" if broken.upper <= allowed else "fail" if broken.lower > allowed else "undecided"
    return LimitVerdict(limit, measure_key(response), number, allowed, broken, word)


def _failed(table: xr.Dataset) -> dict[int, str]:
    return {i: str(reason) for i, reason in enumerate(table.diverged.values) if reason}


def _measures(table: xr.Dataset, chosen: Sequence[Response]) -> pd.DataFrame:
    """Return the measures of runs; NaN where a run failed."""
    frame = pd.DataFrame({measure_key(r): r.values(table) for r in chosen})
    frame.loc[list(_failed(table))] = np.nan
    return frame


@dataclass(frozen=True)
class _Trials:
    """Runs of an uncertain machine.

    Attributes:
        machine, chosen, run, settings: As for `run_tolerances`.
    """

    machine: UncertainMachine
    chosen: tuple[Response, ...]
    run: RunSamples
    settings: ToleranceSettings

    def indices(
        self, a: FloatArray, b: FloatArray, values: pd.DataFrame
    ) -> tuple[dict[str, list[Index]], str, int]:
        """Return the Sobol indices by measure, why some are missing, and the number of runs.

        Args:
            a, b: Independent samples. (n, variables)
            values: Measures at `a`.
        """
        count = self.settings.sensitivity
        if not count:
            return {}, "Sobol indices were not requested (--sensitivity 0).", 0
        if self.machine.joint.factor is not None:
            return {}, CORRELATED, 0
        cases = self.machine.cases(exchanged(a[:count], b[:count]), self.settings.samples + 1)
        at_others = _measures(self.run(cases, "sensitivity"), self.chosen)
        estimated = {
            str(name): sobol_indices(
                values[name].to_numpy()[:count], at_others[name].to_numpy(), seed=self.settings.seed
            )
            for name in values
        }
        missing = ", ".join(name for name, indices in estimated.items() if indices is None)
        reason = f"No Sobol indices of {missing}: a run failed, or the measure does not vary."
        known = {name: indices for name, indices in estimated.items() if indices is not None}
        return known, reason if missing else "", len(cases)

    def contact(self, table: xr.Dataset) -> Contact | None:
        """Return how often the tub touches. A run that failed counts as contact."""
        if "contact_gap" not in table or not table.sizes.get("pair", 0):
            return None
        has_failed = table.diverged.values != ""
        touches = (table.smallest_gap.values <= 0.0) | has_failed
        crude = share_of(touches)
        names = [str(name) for name in table.pair.values]
        nearest = pd.Series(table.nearest_pair.values).dropna().astype(int).value_counts()
        rare = None
        if crude.estimate < RARE and self.settings.subset:
            rare = subset_simulation(
                self._gaps,
                self.machine.joint.size,
                samples=self.settings.subset,
                seed=self.settings.seed,
            )
        if rare and rare.probability:
            ends, method = (rare.probability, rare.lower, rare.upper), SUBSET
        else:
            upper = crude.upper if crude.count else bound_if_none(crude.samples)
            ends, method = (crude.estimate, crude.lower, upper), CRUDE
        return Contact(
            *ends,
            method,
            crude,
            touching_pairs(table),
            {names[int(str(i))]: int(count) for i, count in nearest.items()},
            rare,
            self._rare_pairs(rare),
        )

    def _rare_pairs(self, rare: RareEvent | None) -> dict[str, float]:
        """Return the share of the contacts of the subset simulation by pair; its runs are repeated.

        A ledger has these runs, so that they cost nothing.
        """
        if rare is None or not len(rare.failures):
            return {}
        table = self.run(self.machine.cases(rare.failures), "places of contact")
        return {name: share.estimate for name, share in touching_pairs(table).items()}

    def _gaps(self, scores: FloatArray) -> FloatArray:
        """Return the smallest gap at scores; NaN where a run failed. [m]"""
        table = self.run(self.machine.cases(scores), "rare contact")
        gap = np.asarray(table.smallest_gap.values)
        return np.where(table.diverged.values != "", np.nan, gap)


def touching_pairs(table: xr.Dataset) -> dict[str, SampleShare]:
    """Return the share of runs in which each pair touches, the most frequent first.

    Pairs that never touch are left out.
    """
    shares = {
        str(name): share_of(np.isfinite(column))
        for name, column in zip(table.pair.values, table.contact_gap.values.T, strict=True)
    }
    often = sorted((n for n in shares if shares[n].count), key=lambda n: -shares[n].count)
    return {name: shares[name] for name in often}
