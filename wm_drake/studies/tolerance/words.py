"""Findings of a tolerance study in words."""

from collections.abc import Mapping, Sequence

import numpy as np

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.tolerances import LAUNDRY
from wm_drake.report.formatting import listed, number, shape_name, significant
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.tolerance.sensitivity import Index
from wm_drake.studies.tolerance.study import (
    CRUDE,
    SUBSET,
    Contact,
    LimitVerdict,
    ToleranceStudy,
    measure_key,
)
from wm_drake.studies.tolerance.variables import UncertainVariable

MOST_NAMED = 3
"""Number of quantities that the summary names."""

LEAST_TOTAL = 0.01
"""Total index below which a quantity is not named."""

WIDE_INTERVAL = 0.2
"""Half width of the interval of a total index above which it is called uncertain."""

_LAUNDRY_WORDS = {
    "mass": "mass of the laundry",
    "angle": "angle of the laundry",
    "y": "axial place of the laundry",
    "radius": "radius of the laundry",
    "second_share": "share of the second lump",
    "second_angle": "angle of the second lump",
    "second_y": "axial place of the second lump",
}


def summary(result: ToleranceStudy) -> list[str]:
    """Return the findings, one sentence each."""
    sentences = ["The SDF has no shapes on both tub and housing, so contact cannot be judged."]
    if result.contact:
        sentences = contact_sentences(result.contact)
    return [*sentences, *_limit_sentences(result.verdicts), *_sensitivity_sentences(result)]


def contact_sentences(contact: Contact) -> list[str]:
    """Return sentences about how often the tub touches, and where."""
    if contact.estimate == 0.0:
        sentences = [
            f"The tub touches the housing in none of {contact.crude.samples} runs, so in at most "
            f"{in_percent(contact.upper)} of all such runs (with 95 % confidence)."
        ]
    else:
        sentences = [f"The tub touches the housing in {probability(contact)}."]
    return sentences + _where(contact)


def probability(contact: Contact) -> str:
    """Return the probability of contact in percent, with its interval and how it is known."""
    if contact.estimate == 0.0:
        return f"0 to {in_percent(contact.upper)} of the runs (95 % confidence; none was seen)"
    how = "estimated by a search for rare contact"
    if contact.method == CRUDE:
        how = f"{contact.crude.count} of {contact.crude.samples} runs"
    ends = f"{in_percent(contact.lower)} to {in_percent(contact.upper)}"
    return f"{in_percent(contact.estimate)} of the runs (95 % interval {ends}; {how})"


def rare_sentences(contact: Contact) -> str:
    """Return how the subset simulation went; nothing if there was none."""
    rare = contact.rare
    if rare is None:
        return ""
    steps = ", ".join(f"{1000.0 * value:.1f}" for value in rare.thresholds)
    text = (
        f"Of {contact.crude.samples} samples {contact.crude.count} touch, too few to count. Subset "
        f"simulation took {rare.evaluations} runs in {len(rare.thresholds) + 1} levels. Each level "
        f"holds the tenth of the runs with the smallest gaps of the level before: at most {steps} "
        "mm"
    )
    if not rare.probability:
        return (
            f"{text}. The smallest gap of the last level is {1000.0 * rare.smallest:.1f} mm; "
            "without contact the simulation gives no probability, and the bound is that of the "
            "samples alone (rule of three)."
        )
    places = ", ".join(
        f"{pair_words(name)} {100.0 * share:.0f} %" for name, share in contact.rare_pairs.items()
    )
    return (
        f"{text}, then contact. Coefficient of variation: {100 * rare.deviation:.0f} %. Contacts "
        f"of the last level: {places}."
    )


def _where(contact: Contact) -> list[str]:
    if contact.method == SUBSET and contact.rare_pairs:
        name, share = next(iter(contact.rare_pairs.items()))
        return [f"{100.0 * share:.0f} % of the runs that touch do so at {pair_words(name)}."]
    if contact.pairs:
        name, counted = next(iter(contact.pairs.items()))
        percent = 100.0 * counted.count / max(1, contact.crude.count)
        return [f"{percent:.0f} % of the runs that touch do so at {pair_words(name)}."]
    if contact.nearest:
        name = next(iter(contact.nearest))
        percent = 100.0 * contact.nearest[name] / contact.crude.samples
        return [f"The smallest gap is at {pair_words(name)} in {percent:.0f} % of the runs."]
    return []


def in_percent(share: float) -> str:
    """Return a share in percent with two significant digits, three from 10 % on."""
    return f"{significant(100.0 * share, 3 if share >= 0.1 else 2)} %"


def pair_words(pair: str) -> str:
    """Return a pair of shapes in words: tub shell and wall left."""
    return " and ".join(shape_name(name) for name in pair.split("|"))


def quantity_words(name: str) -> str:
    """Return the name of an uncertain quantity in words."""
    kind, _, field = name.partition(".")
    if kind == LAUNDRY and field in _LAUNDRY_WORDS:
        return _LAUNDRY_WORDS[field]
    return shape_name(name.replace(".", " "))


def measure_titles(result: ToleranceStudy) -> dict[str, tuple[str, str]]:
    """Return name in words and unit of each measure, by its key such as smallest_gap_mm."""
    return {measure_key(r): (r.title.replace("_", " "), r.unit_text) for r in result.chosen}


def _limit_sentences(verdicts: tuple[LimitVerdict, ...]) -> list[str]:
    if not verdicts:
        return []
    words = [v.word for v in verdicts]
    parts = [f"{words.count(w)} {w}" for w in ("pass", "fail", "undecided") if w in words]
    return [f"Limits: {', '.join(parts)}."]


def leading(result: ToleranceStudy) -> tuple[str, list[tuple[UncertainVariable, Index]]]:
    """Return the measure that the summary explains, and its quantities, largest total index first.

    The measure is the smallest gap if there is one, else the first measure.
    """
    keys = {r.name: measure_key(r) for r in result.chosen}
    name = keys.get(GAP, next(iter(keys.values())))
    if name not in result.indices:
        name = next(iter(result.indices), "")
    pairs = zip(result.machine.variables, result.indices.get(name, ()), strict=False)
    return name, sorted(pairs, key=lambda pair: -pair[1].total)


def in_short(result: ToleranceStudy) -> list[tuple[str, str]]:
    """Return the facts below the answer: probability, gap, what decides it, limits."""
    facts = []
    if result.contact:
        facts.append(("Probability of contact", probability(result.contact)))
    gaps = next((v for n, v in result.values.items() if str(n).startswith("smallest_gap")), None)
    if gaps is not None and gaps.notna().any():
        low, median = float(np.quantile(gaps.dropna(), 0.05)), float(np.median(gaps.dropna()))
        facts.append(
            (
                "Smallest gap",
                f"{number(float(gaps.min()))} mm in {len(gaps)} runs; 1 run in 20 is below "
                f"{number(low)} mm, half of them are below {number(median)} mm",
            )
        )
    key, indices = leading(result)
    named = [(v.name, i) for v, i in indices if i.total >= LEAST_TOTAL][:MOST_NAMED]
    if named:
        title, _ = measure_titles(result)[key]
        facts.append((f"What decides the {title}", _listed(named)))
    return facts


def about_loads(result: ToleranceStudy, gaps: Mapping[str, float]) -> str:
    """Return why the loads of a machine give other gaps than the samples.

    Args:
        gaps: Smallest gap by load. [m]
    """
    if not gaps:
        return ""
    listed_gaps = ", ".join(f"{load} {number(1e3 * gap)} mm" for load, gap in gaps.items())
    compared = ""
    masses = result.machine.laundry_masses(result.scores)
    if masses:
        compared = masses_text(result.machine.parameters, list(gaps), masses) + " "
    return (
        f"The samples leave out the loads of the machine file: {listed_gaps}. {compared}The file "
        "of this study says what scatters and why; 'wm-drake verdict' judges both together."
    )


def masses_text(
    parameters: MachineParameters, loads: Sequence[str], masses: tuple[float, float]
) -> str:
    """Return how the masses of loads compare with the laundry of samples.

    Args:
        loads: Names of loads of the machine.
        masses: Smallest and largest mass of the laundry. [kg]
    """
    of_load = {name: parameters.loads[name].mass for name in loads}
    ends = f"{masses[0]:.2g} to {masses[1]:.2g} kg"
    heavier = [f"{load} ({mass:.3g} kg)" for load, mass in of_load.items() if mass > masses[1]]
    if not heavier:
        return f"The laundry of the samples, {ends}, is as heavy as any of these loads."
    verb = "is" if len(heavier) == 1 else "are"
    return f"{listed(heavier)} {verb} heavier than all laundry of the samples, {ends}."


def _sensitivity_sentences(result: ToleranceStudy) -> list[str]:
    key, indices = leading(result)
    if not indices:
        return [result.refused] if result.refused else []
    title, _ = measure_titles(result)[key]
    named = [(v.name, i) for v, i in indices if i.total >= LEAST_TOTAL][:MOST_NAMED]
    sentences = [
        f"Shares of the variance of the {title}, alone and together with others: {_listed(named)}."
    ]
    parts = [(v, i) for v, i in indices if not v.is_of_load]
    strong = [(v.name, i) for v, i in parts if i.total >= LEAST_TOTAL][:MOST_NAMED]
    if strong:
        sentences.append(f"To tighten: {_listed(strong)}.")
    elif parts:
        sentences.append("To tighten: nothing; no part causes as much as 1 % of this variance.")
    else:
        sentences.append("To tighten: nothing; only the load scatters in this file.")
    return sentences


def _listed(named: list[tuple[str, Index]]) -> str:
    return ", ".join(f"{quantity_words(name)} ({number(100 * i.total, 0)} %)" for name, i in named)


def warnings(result: ToleranceStudy) -> list[str]:
    """Return what limits the use of the results."""
    texts = []
    if result.failed:
        number, reason = next(iter(result.failed.items()))
        texts.append(
            f"{len(result.failed)} of {result.settings.samples} runs failed and count as contact "
            f"(sample {number + 1}: {reason})."
        )
    contact = result.contact
    if contact and contact.method == CRUDE and 0 < contact.crude.count < 10:
        texts.append(
            f"Only {contact.crude.count} runs touch; more samples, or --subset, make the interval "
            "narrower."
        )
    if result.refused and result.settings.sensitivity:
        texts.append(result.refused)
    wide = [
        (name, v.name)
        for name, indices in result.indices.items()
        for v, i in zip(result.machine.variables, indices, strict=True)
        if i.total_upper - i.total_lower > 2.0 * WIDE_INTERVAL
    ]
    if wide:
        count = len({name for name, _ in wide})
        texts.append(
            f"Total indices of {count} of {len(result.indices)} measures are uncertain by more "
            f"than ±{WIDE_INTERVAL:g}; more samples (--sensitivity) make them sharper."
        )
    return texts
