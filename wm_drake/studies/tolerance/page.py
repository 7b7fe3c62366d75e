"""Show the tolerance study: how often the tub touches, distributions, causes, limits."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.limits import Limit
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import MISSING, listed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SHARE, Quantity, quantity_of, text_of
from wm_drake.simulation.measures.responses import Response
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.tolerance.figures import distributions_figure, gap_figure, sobol_figure
from wm_drake.studies.tolerance.study import (
    CRUDE,
    GAP_SIZE,
    SMALLEST_GAP,
    SUBSET,
    ToleranceTrials,
    judged,
    laundry_masses,
    name_of,
    statistics_of,
)
from wm_drake.studies.tolerance.variables import distribution_text

MOST_PANELS = 9
"""Largest number of distributions in one figure."""

MOST_NAMED = 3
"""Number of quantities that the summary names."""

LEAST_TOTAL = 0.01
"""Total index below which a quantity is not named."""

WIDE_INTERVAL = 0.2
"""Half width of the interval of a total index above which it is called uncertain."""

FEW = 10
"""Number of runs with contact below which its interval is wide."""

STATISTICS = ("mean", "deviation", "p5", "p50", "p95")
"""Statistics of a measure on the page; the file of the intervals has all."""

WORDS = {
    "p5": "5 %", "p50": "median", "p95": "95 %", "p5_lower": "5 %, from", "p5_upper": "to",
    "p50_lower": "median, from", "p50_upper": "to", "p95_lower": "95 %, from", "p95_upper": "to",
}  # fmt: skip


def tolerance_answer(
    trials: ToleranceTrials,
    samples: xr.Dataset,
    indices: xr.Dataset,
    contact: xr.Dataset,
    limits: Sequence[tuple[Limit, Response, float]],
) -> Answer:
    """Return the answer of the study.

    Args:
        samples, indices, contact, limits: As of `ToleranceTrials` and `limits_of` in
            `wm_drake.studies.tolerance.study`.
    """
    kept = judged(samples, limits)
    measures = samples[[name_of(response) for response in trials.chosen]]
    machine, settings = trials.uncertain.parameters, trials.settings
    count = int(np.sum(samples.failed.values != ""))
    return Answer(
        f"Tolerances of machine {machine.name}",
        " ".join(summary(trials, indices, contact, kept)),
        machine,
        (
            *_distributions(trials, samples, measures, limits, contact),
            _causes(trials, indices),
            Part("Limits", _limits(trials, kept)),
            _contact(contact),
            Part("Distributions in numbers", _statistics(measures)),
            Part("Sobol indices", _indices(trials, indices)),
            Part("Quantities", (_quantities(trials),)),
        ),
        (
            ("Tolerances", trials.about),
            ("Samples", f"{settings.samples}, scrambled Sobol sequence, seed {settings.seed}"),
            ("Duration of a run", f"{trials.uncertain.case.profile.duration:g} s"),
        ),
        warned=tuple(warnings(trials, samples, indices, contact)),
        short=Part("In short", facts=facts_of(trials, samples, indices, contact)),
        diverged=(f"{count} of {settings.samples} runs failed",) if count else (),
    )


def summary(
    trials: ToleranceTrials, indices: xr.Dataset, contact: xr.Dataset, limits: xr.Dataset
) -> list[str]:
    """Return the findings, one sentence each."""
    sentences = ["The SDF has no shapes on both tub and housing, so contact cannot be judged."]
    if contact:
        sentences = contact_sentences(contact)
    words = limits.verdict.values.tolist() if limits else []
    parts = [f"{words.count(w)} {w}" for w in ("pass", "fail", "undecided") if w in words]
    judged = [f"Limits: {', '.join(parts)}."] if parts else []
    return [*sentences, *judged, *_sensitivity_sentences(trials, indices)]


def contact_sentences(contact: xr.Dataset) -> list[str]:
    """Return sentences about how often the tub touches, and where."""
    if contact.probability == 0.0:
        sentence = (
            f"The tub touches the housing in none of {text_of(contact.samples)} runs, so in at "
            f"most {text_of(contact.probability_upper)} of all such runs (with 95 % confidence)."
        )
    else:
        sentence = f"The tub touches the housing in {probability(contact)}."
    return [sentence, *_where(contact)]


def probability(contact: xr.Dataset) -> str:
    """Return the probability of contact in percent, with its interval and how it is known."""
    if contact.probability == 0.0:
        upper = text_of(contact.probability_upper)
        return f"0 to {upper} of the runs (95 % confidence; none was seen)"
    how = "estimated by a search for rare contact"
    if contact.method == CRUDE:
        how = f"{text_of(contact.touching)} of {text_of(contact.samples)} runs"
    ends = f"{text_of(contact.probability_lower)} to {text_of(contact.probability_upper)}"
    return f"{text_of(contact.probability)} of the runs (95 % interval {ends}; {how})"


def _where(contact: xr.Dataset) -> list[str]:
    """Return a sentence on the place of contact, or of the smallest gap without contact."""
    if contact.method == SUBSET and contact.rare_touches.any():
        share, begin = contact.rare_touches, "of the runs that touch do so"
    elif contact.touches.any():
        share = contact.touches * contact.samples / contact.touching
        begin = "of the runs that touch do so"
    else:
        share, begin = contact.nearest, "of the runs have the smallest gap"
    if not share.any():
        return []
    at = int(share.argmax("pair"))
    return [f"{SHARE.text(share[at])} {begin} at {pair_words(contact.isel(pair=at))}."]


def pair_words(pair: xr.Dataset) -> str:
    """Return a pair of shapes in words: tub shell and wall left."""
    return f"{pair.moving.item()} and {pair.fixed.item()}"


def rare_sentences(contact: xr.Dataset) -> str:
    """Return how the subset simulation went; nothing if there was none."""
    if "threshold" not in contact:
        return ""
    steps = ", ".join(map(GAP_SIZE.text, contact.threshold.values))
    text = (
        f"Of {text_of(contact.samples)} samples {text_of(contact.touching)} touch, too few to "
        f"count. Subset simulation took {text_of(contact.rare_runs)} runs in "
        f"{contact.sizes['level'] + 1} levels. Each level holds the tenth of the runs with the "
        f"smallest gaps of the level before: at most {steps}"
    )
    if not np.isfinite(contact.rare_deviation):
        return (
            f"{text}. The smallest gap of the last level is {text_of(contact.rare_smallest)}; "
            "without contact the simulation gives no probability, and the bound is that of the "
            "samples alone (rule of three)."
        )
    touching = contact.isel(pair=np.argsort(-contact.rare_touches.values, kind="stable"))
    pairs = (touching.isel(pair=at) for at in range(int((touching.rare_touches > 0.0).sum())))
    places = ", ".join(f"{pair_words(pair)} {text_of(pair.rare_touches)}" for pair in pairs)
    return (
        f"{text}, then contact. Coefficient of variation: {text_of(contact.rare_deviation)}. "
        f"Contacts of the last level: {places}."
    )


def leading(indices: xr.Dataset) -> xr.Dataset | None:
    """Return the indices of the measure that the summary explains, the largest total first.

    The measure is the smallest gap if there is one, else the first measure; None without indices.
    """
    if not indices.sizes.get("measure", 0):
        return None
    names = indices["measure"].values.tolist()
    of = indices.sel(measure=SMALLEST_GAP if SMALLEST_GAP in names else names[0])
    return of.isel(quantity=np.argsort(-of.total.values, kind="stable"))


def _sensitivity_sentences(trials: ToleranceTrials, indices: xr.Dataset) -> list[str]:
    of = leading(indices)
    if of is None:
        reason = trials.why_missing(indices)
        return [reason] if reason else []
    parts = [v.name for v in trials.uncertain.variables if not v.is_of_load]
    tightened = _named(trials, of.sel(quantity=of["quantity"].isin(parts)))
    what = "nothing; only the load scatters in this file"
    if parts:
        what = tightened or "nothing; no part causes as much as 1 % of this variance"
    return [
        f"Shares of the variance of the {_title(trials, of)}, alone and together with others: "
        f"{_named(trials, of)}.",
        f"To tighten: {what}.",
    ]


def _named(trials: ToleranceTrials, of: xr.Dataset) -> str:
    """Return the quantities with the largest total indices, and these; "" if all are small."""
    words = trials.uncertain.words
    of = of.isel(quantity=of.total.values >= LEAST_TOTAL).isel(quantity=slice(MOST_NAMED))
    pairs = zip(of["quantity"].values.tolist(), of.total.values, strict=True)
    return ", ".join(f"{words[name]} ({SHARE.text(total)})" for name, total in pairs)


def _title(trials: ToleranceTrials, of: xr.Dataset) -> str:
    """Return the words of the measure of some indices."""
    return _titles(trials)[of["measure"].item()]


def _titles(trials: ToleranceTrials) -> dict[str, str]:
    """Return the words of the measures by their names."""
    return {name_of(response): response.title.replace("_", " ") for response in trials.chosen}


def facts_of(
    trials: ToleranceTrials, samples: xr.Dataset, indices: xr.Dataset, contact: xr.Dataset
) -> list[tuple[str, str]]:
    """Return the facts below the answer: probability, gap, what decides it, loads."""
    facts, count = [], trials.settings.samples
    if contact:
        facts.append(("Probability of contact", probability(contact)))
    if SMALLEST_GAP in samples and samples.smallest_gap.notnull().any():
        gaps = samples.smallest_gap
        low, median = (GAP_SIZE.text(gaps.quantile(share)) for share in (0.05, 0.5))
        facts.append((
            "Smallest gap",
            f"{GAP_SIZE.text(gaps.min())} in {count} runs; 1 run in 20 is below {low}, half of "
            f"them are below {median}",
        ))  # fmt: skip
    of = leading(indices)
    if of is not None and _named(trials, of):
        facts.append((f"What decides the {_title(trials, of)}", _named(trials, of)))
    if "gap_of_load" in contact:
        gaps = contact.gap_of_load.dropna("load")
        facts.append(("Loads of the machine", about_loads(trials, samples, gaps)))
    return facts


def about_loads(trials: ToleranceTrials, samples: xr.Dataset, gaps: xr.DataArray) -> str:
    """Return why the loads of a machine give other gaps than the samples.

    Args:
        gaps: Smallest gap over `load`. [m]
    """
    loads = gaps["load"].values.tolist()
    each = ", ".join(f"{load} {GAP_SIZE.text(gap)}" for load, gap in zip(loads, gaps, strict=True))
    masses, compared = laundry_masses(samples), ""
    if masses:
        compared = masses_text(trials.uncertain.parameters, loads, masses) + " "
    return (
        f"The samples leave out the loads of the machine file: {each}. {compared}The file of this "
        "study says what scatters and why; 'wm-drake verdict' judges both together."
    )


LAUNDRY = Quantity("mass of the laundry", Unit("kg", "kg"), form="{:.3g}".format)


def masses_text(
    parameters: MachineParameters, loads: Sequence[str], masses: tuple[float, float]
) -> str:
    """Return how the masses of loads compare with the laundry of samples.

    Args:
        loads: Names of loads of the machine.
        masses: Smallest and largest mass of the laundry. [kg]
    """
    of_load = {name: parameters.loads[name].mass for name in loads}
    ends = f"{LAUNDRY.number(masses[0])} to {LAUNDRY.text(masses[1])}"
    heavier = [
        f"{load} ({LAUNDRY.text(mass)})" for load, mass in of_load.items() if mass > masses[1]
    ]
    if not heavier:
        return f"The laundry of the samples, {ends}, is as heavy as any of these loads."
    verb = "is" if len(heavier) == 1 else "are"
    return f"{listed(heavier)} {verb} heavier than all laundry of the samples, {ends}."


def warnings(
    trials: ToleranceTrials, samples: xr.Dataset, indices: xr.Dataset, contact: xr.Dataset
) -> list[str]:
    """Return what limits the use of the results."""
    texts, failed = [], samples.isel(sample=samples.failed.values != "")
    if failed.sizes["sample"]:
        first = failed.isel(sample=0)
        texts.append(
            f"{failed.sizes['sample']} of {trials.settings.samples} runs failed and count as "
            f"contact (sample {first['sample'].item()}: {first.failed.item()})."
        )
    if contact and contact.method == CRUDE and 0 < contact.touching < FEW:
        texts.append(
            f"Only {text_of(contact.touching)} runs touch; more samples, or --subset, make the "
            "interval narrower."
        )
    if trials.settings.sensitivity and (reason := trials.why_missing(indices)):
        texts.append(reason)
    if indices:
        wide = (indices.total_upper - indices.total_lower > 2.0 * WIDE_INTERVAL).any("quantity")
        if wide.any():
            texts.append(
                f"Total indices of {int(wide.sum())} of {wide.size} measures are uncertain by more "
                f"than ±{WIDE_INTERVAL:g}; more samples (--sensitivity) make them sharper."
            )
    return texts


def _distributions(
    trials: ToleranceTrials,
    samples: xr.Dataset,
    measures: xr.Dataset,
    limits: Sequence[tuple[Limit, Response, float]],
    contact: xr.Dataset,
) -> tuple[Part, Part]:
    """Return the smallest gap beside the loads of the machine, and the other measures."""
    numbers, pictures = dict[str, list[float]](), []
    for _, response, number in limits:
        numbers.setdefault(name_of(response), []).append(number)
    gap: list[Plot | LabelledTable] = []
    if SMALLEST_GAP in measures and measures.smallest_gap.notnull().sum() > 1:
        caption = (
            "Share of the runs whose smallest gap between tub and housing is below a value; 0 and "
            "below: contact. Shaded: 95 % band for the whole curve. Points: loads of the machine "
            "file, at any height."
        )
        figure = gap_figure(
            measures.smallest_gap, numbers.get(SMALLEST_GAP, ()), contact.get("gap_of_load")
        )
        gap.append(Plot(figure, f"Distribution of the smallest gap. {caption}", caption))
    if "gap_of_load" in contact:
        gap.append(LabelledTable("loads", contact[["gap_of_load"]]))
    names = [str(name) for name in measures if name != SMALLEST_GAP]
    caption = (
        "Distribution functions of the measures: share of the runs below a value. Shaded: 95 % "
        "band for the whole curve (Dvoretzky, Kiefer, Wolfowitz). Dashed: limits."
    )
    for first in range(0, len(names), MOST_PANELS):
        panels = measures[names[first : first + MOST_PANELS]]
        words = "; ".join(quantity_of(column).label for column in panels.values())
        figure = distributions_figure(panels, numbers)
        pictures.append(Plot(figure, f"Distribution functions of {words}.", caption))
    drawn = [variable.name for variable in trials.uncertain.variables]
    table = LabelledTable("samples", samples[[*drawn, *measures, "failed"]], is_in_json=False)
    return Part("Smallest gap", gap), Part("Distributions", [*pictures, table])


def _causes(trials: ToleranceTrials, indices: xr.Dataset) -> Part:
    """Return the indices of the leading measure as a picture."""
    of, plots = leading(indices), []
    if of is not None:
        caption = (
            f"Sobol indices of the {_title(trials, of)}. Bars: estimates, lines: 95 % bootstrap "
            "intervals. A total index above the first-order index is an effect together with "
            "other quantities."
        )
        words = trials.uncertain.words
        names = [words[name] for name in of["quantity"].values.tolist()]
        each = zip(names, of.total, strict=True)
        texts = ", ".join(f"{name} {text_of(total)}" for name, total in each)
        plots = [Plot(sobol_figure(of, names), f"Total indices: {texts}.", caption)]
    return Part("What causes the scatter", plots, trials.why_missing(indices))


def _limits(trials: ToleranceTrials, limits: xr.Dataset) -> tuple[LabelledTable, ...]:
    """Return the verdict on each limit; nothing without limits."""
    if not limits:
        return ()
    caption = (
        "Limits: share of the runs that break each one. The verdict is pass if the whole 95 % "
        "interval is allowed, fail if none of it is, else undecided: more samples decide it."
    )
    data = limits.assign(is_broken=limits.verdict == "fail")
    words = {r.name: _titles(trials)[name_of(r)] for r in trials.chosen} | _titles(trials)
    return (
        LabelledTable(
            "limits",
            data,
            "Limits",
            caption,
            marked=("is_broken", "alarm"),
            words=words,
            is_in_terminal=True,
        ),
    )


def _contact(contact: xr.Dataset) -> Part:
    """Return how often each pair of shapes touches and is nearest, and the rare contacts."""
    if not contact:
        return Part("Contact")
    caption = (
        "Contact by pair of shapes among the samples. A run may touch at several places. Nearest: "
        "share of the runs in which the pair has the smallest gap. Intervals: 95 %, Clopper and "
        "Pearson."
    )
    names = ("moving", "fixed", "touches", "lower", "upper", "nearest")
    of = ("probability", "probability_lower", "probability_upper", "method", "touching")
    tables = [
        LabelledTable("contact", contact[[*names]].drop_vars("pair"), "Contact", caption),
        LabelledTable("contact_probability", contact[[*of]]),
    ]
    return Part("Contact", tables, rare_sentences(contact))


def _statistics(measures: xr.Dataset) -> tuple[LabelledTable, ...]:
    """Return statistics of the measures, and the intervals of the percentiles."""
    statistics = statistics_of(measures)
    each = {str(name): quantity_of(array) for name, array in statistics.items()}
    dims = ("quantity", "statistic")
    values = Quantity("").of_each("quantity", each, dims, list(statistics.values()))
    lines = xr.Dataset({"value": values}, {"quantity": list(each), **statistics.coords})
    ends = [name for name in statistics["statistic"].values if name not in ("mean", "deviation")]
    about = "Percentiles with 95 % intervals of order statistics."
    texts = {
        "measures": ([*STATISTICS], "Measures of the samples", "Measures over all samples."),
        "percentiles": (ends, "Percentiles", about),
    }
    return tuple(
        LabelledTable(
            name,
            lines.sel(statistic=chosen),
            heading,
            caption,
            "statistic",
            words=WORDS | {key: quantity.words for key, quantity in each.items()},
            is_in_terminal=name == "measures",
        )
        for name, (chosen, heading, caption) in texts.items()
    )


def _indices(trials: ToleranceTrials, indices: xr.Dataset) -> tuple[LabelledTable, ...]:
    """Return the Sobol indices; on the page the total ones, a column for each quantity."""
    if not indices:
        return ()
    words = trials.uncertain.words | _titles(trials)
    caption = (
        "Total Sobol indices of all measures. First-order indices and 95 % intervals are in "
        "sobol.csv."
    )
    totals = indices[["total"]]
    return (
        LabelledTable("sobol", indices),
        LabelledTable("total_indices", totals, "Total indices", caption, "quantity", words=words),
    )


def _quantities(trials: ToleranceTrials) -> LabelledTable:
    """Return what scatters."""
    variables = trials.uncertain.variables
    texts = {
        "what": list(trials.uncertain.words.values()),
        "keys": [", ".join(v.keys) or v.name for v in variables],
        "distribution": [distribution_text(v) for v in variables],
        "source": [v.entry.source or MISSING for v in variables],
    }
    return LabelledTable(
        "quantities",
        xr.Dataset({name: ("quantity", column) for name, column in texts.items()}),
        "Quantities",
        "What scatters. Percents are of the machine's number.",
    )
