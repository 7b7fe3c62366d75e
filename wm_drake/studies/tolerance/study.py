"""The tolerance study: samples of an uncertain machine, contact, Sobol indices, limits."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr

from wm_drake.errors import InputError, Problem, input_error
from wm_drake.parameters.limits import Limit, fraction
from wm_drake.parameters.types import FloatArray
from wm_drake.report.formatting import shape_name, significant
from wm_drake.report.quantity import SHARE, Quantity, of_measure
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures.responses import GAP, Response
from wm_drake.studies.experiment import Experiment, responses
from wm_drake.studies.tolerance.distributions import base_samples
from wm_drake.studies.tolerance.rare import RareEvent, subset_simulation
from wm_drake.studies.tolerance.sensitivity import exchanged, sobol_indices
from wm_drake.studies.tolerance.shares import (
    PERCENTILES,
    SampleShare,
    bound_if_none,
    percentile_of,
    share_of,
)
from wm_drake.studies.tolerance.variables import UncertainMachine, quantity_of

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


SMALLEST_GAP = "smallest_gap"
"""Name of the smallest gap among the measures."""

PLACES = ("nearest_pair", "contact_gap")
"""Variables of the table of runs that tell where the tub touches."""

OF_RUNS = SHARE.named("share", form=lambda value: significant(value, 3 if value >= 10.0 else 2))
"""Share of runs, with two significant digits, three from 10 % on."""
OF_LIMIT = SHARE.named("share", form=lambda value: significant(value, 3))
COUNT = Quantity("runs", decimals=0)
INDEX = Quantity("index", decimals=2)
GAP_SIZE = of_measure("smallest_gap")


def name_of(response: Response) -> str:
    """Return the name of a measure in the datasets."""
    return SMALLEST_GAP if response.name == GAP else response.name


def limits_of(
    limits: Iterable[Limit], chosen: Sequence[Response]
) -> list[tuple[Limit, Response, float]]:
    """Return each limit with its response and its number. [SI]

    Raises:
        InputError: a limit names a response that is not measured, or has a wrong unit.
    """
    resolved, problems = [], []
    names = {response.name: response for response in chosen}
    names |= {SMALLEST_GAP: names[GAP]} if GAP in names else {}
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
            resolved.append((limit, response, response.unit.number(limit.text)))
        except ValueError as error:
            problems.append(Problem("", key, str(error)))
    if problems:
        raise InputError(problems)
    return resolved


@dataclass(frozen=True)
class ToleranceTrials:
    """Runs of an uncertain machine.

    Attributes:
        chosen: What is measured of each run.
        about: Description in the vary file.
    """

    uncertain: UncertainMachine
    chosen: tuple[Response, ...]
    experiment: Experiment
    settings: ToleranceSettings
    about: str = ""

    @cached_property
    def scores(self) -> tuple[FloatArray, FloatArray]:
        """Independent scores A of the samples, and B for the Sobol indices. (samples, size)"""
        size = self.uncertain.joint.size
        return base_samples(size, self.settings.samples, self.settings.seed)

    @property
    def gaps(self) -> Experiment:
        """Return the same runs with gaps and contacts only, which take less time to measure."""
        return replace(self.experiment, measures=(GAP, CONTACTS))

    def runs(self, experiment: Experiment, scores: FloatArray, what: str) -> xr.Dataset:
        """Return the measures of samples over `sample`, numbers from 1; NaN if a run failed.

        Args:
            experiment: `experiment` or `gaps`.
            scores: (n, size)
            what: Word beside the progress bar.
        """
        labels = {"sample": range(1, len(scores) + 1)}
        return experiment.over(labels, self.uncertain.cases(scores), what)

    def samples(self) -> xr.Dataset:
        """Run the samples.

        Returns:
            Over `sample`: the uncertain quantities and the chosen measures by their names,
            `failed`, the reason if the run failed; with shapes `nearest_pair`, and over `pair` too
            `contact_gap`, NaN where a pair does not touch. SI.
        """
        data = self.runs(self.experiment, self.scores[0], "samples")
        values = self.uncertain.joint.values(self.scores[0])
        pairs = zip(self.uncertain.variables, values.T, strict=True)
        drawn = {v.name: quantity_of(v).variable("sample", column) for v, column in pairs}
        places = data[[name for name in PLACES if name in data]]
        return places.assign(drawn).assign(self.measures(data)).assign(failed=data.diverged)

    def measures(self, data: xr.Dataset) -> dict[str, xr.DataArray]:
        """Return the chosen measures of runs by their names."""
        named = responses(data, self.chosen)
        return {name_of(response): named[response.name] for response in self.chosen}

    def indices(self, samples: xr.Dataset) -> xr.Dataset:
        """Return the Sobol indices of each measure.

        Args:
            samples: As of `samples`.

        Returns:
            Over `measure` and `quantity`: `first`, the share of the variance that the quantity
            causes alone, `total`, alone and together with others, and the ends of their 95 %
            intervals, `first_lower` and so on; without those that `why_missing` tells.
        """
        count, (a, b) = self.settings.sensitivity, self.scores
        if not count or self.uncertain.joint.factor is not None:
            return xr.Dataset()
        names = [variable.name for variable in self.uncertain.variables]
        scores = exchanged(a[:count], b[:count]).reshape(len(names) + 1, count, -1)
        # runs of one sample follow each other: those that differ in the laundry share a machine
        cases = self.uncertain.cases(scores.swapaxes(0, 1).reshape(-1, len(names)), len(a) + 1)
        labels = {"sample": range(count), "exchanged": ["all", *names]}
        data = self.measures(self.experiment.over(labels, cases, "sensitivity"))
        estimated = {}
        for name, at_others in data.items():
            at_a = samples[name].values[:count]
            indices = sobol_indices(at_a, at_others.values.T.ravel(), seed=self.settings.seed)
            if indices is not None:
                estimated[name] = indices
        return xr.Dataset(
            {
                part: INDEX.named(words).variable(
                    ("measure", "quantity"), [of[part] for of in estimated.values()]
                )
                for part, words in INDICES.items()
                if estimated
            },
            {"measure": list(estimated), "quantity": names},
        )

    def why_missing(self, indices: xr.Dataset) -> str:
        """Return why Sobol indices of some or all measures are missing; "" if none is."""
        if not self.settings.sensitivity:
            return "Sobol indices were not requested (--sensitivity 0)."
        if self.uncertain.joint.factor is not None:
            return CORRELATED
        names = [name_of(response) for response in self.chosen]
        missing = ", ".join(name for name in names if name not in indices["measure"].values)
        if not missing:
            return ""
        return f"No Sobol indices of {missing}: a run failed, or the measure does not vary."

    def contact(self, samples: xr.Dataset) -> xr.Dataset:
        """Return how often the tub touches. A run that failed counts as contact.

        Args:
            samples: As of `samples`.

        Returns:
            Over no dimension: `probability` of contact with the ends of its 95 % interval,
            `probability_lower` and `probability_upper`, which is the bound of the rule of three if
            nothing touches; `method`, `CRUDE` or `SUBSET`; `touching`, number of such samples.
            Over `pair`, the most frequent first: as of `pairs_of`. With a subset simulation: over
            `level`, its `threshold` [m]; `rare_runs`, `rare_smallest` gap of the last level [m],
            `rare_deviation`, the coefficient of variation, and over `pair` `rare_touches`, share of
            its contacts. `samples`: their number. Empty without shapes.
        """
        if not samples.sizes.get("pair", 0):
            return xr.Dataset()
        has_failed = samples.failed.values != ""
        crude = share_of((samples.smallest_gap.values <= 0.0) | has_failed)
        ends, method = crude_ends(crude), CRUDE
        more: Mapping[str, xr.Variable] = {}
        if crude.estimate < RARE and self.settings.subset:
            settings, size = self.settings, self.uncertain.joint.size
            rare = subset_simulation(self._gaps, size, samples=settings.subset, seed=settings.seed)
            more = self._of_rare(rare, samples["pair"].values)
            if rare.probability:
                ends, method = (rare.probability, rare.lower, rare.upper), SUBSET
        named = {
            "probability": ("probability of contact", ends[0]),
            "probability_lower": ("95 % from", ends[1]),
            "probability_upper": ("to", ends[2]),
        }
        pairs = xr.Dataset(
            {
                **{name: OF_RUNS.named(w).variable((), v) for name, (w, v) in named.items()},
                "method": ((), method),
                "touching": COUNT.named("samples that touch").variable((), crude.count),
                **pairs_of(samples),
                **more,
                "samples": COUNT.named("samples").variable((), samples.sizes["sample"]),
            },
            {"pair": samples["pair"].values},
        )
        seen = pairs.touches + pairs.nearest + pairs.get("rare_touches", 0.0) > 0.0
        order = np.lexsort((-pairs.nearest.values, -pairs.touches.values))
        return pairs.isel(pair=order[seen.values[order]])

    def gaps_of_loads(self) -> xr.DataArray:
        """Return the smallest gap of each load of the machine over `load`. [m]"""
        loads, profile = self.uncertain.parameters.loads, self.uncertain.case.profile
        cases = (Case(name, load, profile) for name, load in loads.items())
        gaps = self.gaps.over({"load": list(loads)}, cases, "loads").smallest_gap
        return GAP_SIZE.on(gaps)

    def _gaps(self, scores: FloatArray) -> FloatArray:
        """Return the smallest gap at scores; NaN where a run failed. [m]"""
        return np.asarray(self.runs(self.gaps, scores, "rare contact").smallest_gap.values)

    def _of_rare(self, rare: RareEvent, pairs: FloatArray) -> Mapping[str, xr.Variable]:
        """Return what `contact` has of a subset simulation.

        The runs that touch are repeated for the places of contact. A ledger has these runs, so that
        they cost nothing.
        """
        touches = np.zeros(len(pairs))
        if len(rare.failures):
            data = self.runs(self.gaps, rare.failures, "places of contact")
            touches = np.isfinite(data.contact_gap.values).mean(axis=0)
        words = "share of the contacts of the last level"
        return {
            "threshold": GAP_SIZE.named("threshold").variable("level", rare.thresholds),
            "rare_runs": COUNT.named("runs of the subset simulation").variable(
                (), rare.evaluations
            ),
            "rare_smallest": GAP_SIZE.variable((), rare.smallest),
            "rare_deviation": SHARE.named("coefficient of variation").variable((), rare.deviation),
            "rare_touches": SHARE.named(words).variable("pair", touches),
        }


INDICES = {
    "first": "first order",
    "first_lower": "first order, from",
    "first_upper": "first order, to",
    "total": "total",
    "total_lower": "total, from",
    "total_upper": "total, to",
}
"""Words of the Sobol indices and of the ends of their intervals."""


def crude_ends(share: SampleShare) -> tuple[float, float, float]:
    """Return a share with the ends of its interval; if it is 0, the end of the rule of three."""
    upper = share.upper if share.count else bound_if_none(share.samples)
    return share.estimate, share.lower, upper


def pairs_of(samples: xr.Dataset) -> dict[str, xr.Variable]:
    """Return over `pair` how often each pair of shapes touches and is the nearest one.

    Returns:
        `moving` and `fixed`, names of the shapes; `touches` and the ends of its 95 % interval,
        `lower` and `upper`, NaN if it never touches; `nearest`.
    """
    shares = [share_of(np.isfinite(column)) for column in samples.contact_gap.values.T]
    ends = [(s.lower, s.upper) if s.count else (np.nan, np.nan) for s in shares]
    lower, upper = np.array(ends).T
    number = samples.nearest_pair.values
    counts = np.bincount(number[np.isfinite(number)].astype(int), minlength=len(shares))
    moving, fixed = zip(*(name.split("|") for name in samples["pair"].values.tolist()), strict=True)
    numbers = {
        "touches": ("touch", [share.estimate for share in shares]),
        "lower": ("95 % from", lower),
        "upper": ("to", upper),
        "nearest": ("nearest", counts / len(number)),
    }
    texts = {"moving": ("moves with the tub", moving), "fixed": ("housing", fixed)}
    return {
        **{
            name: xr.Variable("pair", list(map(shape_name, of)), Quantity(words).attributes())
            for name, (words, of) in texts.items()
        },
        **{
            name: OF_RUNS.named(w).variable("pair", values) for name, (w, values) in numbers.items()
        },
    }


def statistics_of(measures: xr.Dataset) -> xr.Dataset:
    """Return mean, deviation and percentiles of measures, without runs that failed.

    Returns:
        The measures over `statistic`: `mean`, `deviation`, and percentiles such as `p5` with the
        ends of their 95 % intervals, `p5_lower` and `p5_upper`.
    """
    columns: dict[str, xr.Variable] = {}
    names: list[str] = []
    for name, column in measures.items():
        good = column.values[np.isfinite(column.values)]
        numbers = {"mean": np.mean(good), "deviation": np.std(good)}
        for percent in PERCENTILES:
            of = percentile_of(good, percent)
            ends = {"": of.value, "_lower": of.lower, "_upper": of.upper}
            numbers |= {f"p{percent}{end}": value for end, value in ends.items()}
        names = list(numbers)
        columns[str(name)] = xr.Variable("statistic", list(numbers.values()), column.attrs)
    return xr.Dataset(columns, {"statistic": names})


LIMIT_COLUMNS = ("quantity", "limit", "verdict", "allowed", "breaks", "lower", "upper")


def judged(measures: xr.Dataset, limits: Sequence[tuple[Limit, Response, float]]) -> xr.Dataset:
    """Return the verdict on each limit. A run that failed breaks every limit.

    Args:
        measures: Measures over the samples; NaN where a run failed.
        limits: As of `limits_of`.

    Returns:
        Over `row`: `quantity`, `limit`, `allowed` share, share that `breaks` it with the ends of
        its 95 % interval, `lower` and `upper`, and `verdict`: "pass" if the whole interval is
        allowed, "fail" if none of it is, else "undecided".
    """
    rows = []
    for limit, response, number in limits:
        values = measures[name_of(response)].values
        allowed = fraction(limit.allowed_share, "allowed_share")
        side = "at least" if limit.at_least is not None else "at most"
        kept = values >= number if limit.at_least is not None else values <= number
        broken = share_of(~kept)
        word = (
            "pass" if broken.upper <= allowed else "fail" if broken.lower > allowed else "undecided"
        )
        words = (limit.quantity, f"{side} {response.unit.reading(number)}", word)
        rows.append((*words, allowed, broken.estimate, broken.lower, broken.upper))
    if not rows:
        return xr.Dataset()
    columns = dict(zip(LIMIT_COLUMNS, zip(*rows, strict=True), strict=True))
    heads = {"allowed": "allowed", "breaks": "break it", "lower": "95 % from", "upper": "to"}
    return xr.Dataset(
        {
            **{name: ("row", list(columns[name])) for name in ("quantity", "limit")},
            **{n: OF_LIMIT.named(w).variable("row", columns[n]) for n, w in heads.items()},
            "verdict": ("row", list(columns["verdict"])),
        }
    )


def laundry_masses(samples: xr.Dataset) -> tuple[float, float] | None:
    """Return the smallest and largest mass of the laundry of samples [kg]; None without it."""
    if "laundry.mass" not in samples:
        return None
    masses = samples["laundry.mass"]
    return float(masses.min()), float(masses.max())
