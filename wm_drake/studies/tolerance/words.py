"""Findings of a tolerance study in words."""

from wm_drake.parameters.tolerances import LAUNDRY
from wm_drake.report.formatting import number, shape_name
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.tolerance.sensitivity import Index
from wm_drake.studies.tolerance.study import (
    CRUDE,
    SUBSET,
    Contact,
    ToleranceResult,
    Verdict,
    measure_key,
)
from wm_drake.studies.tolerance.variables import Variable

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


def summary(result: ToleranceResult) -> list[str]:
    """Return the findings, one sentence each."""
    sentences = ["The SDF has no shapes on both tub and housing, so contact cannot be judged."]
    if result.contact:
        sentences = contact_sentences(result.contact)
    return [*sentences, *_limit_sentences(result.verdicts), *_sensitivity_sentences(result)]


def contact_sentences(contact: Contact) -> list[str]:
    """Return sentences about how often the tub touches, and where."""
    if contact.estimate == 0.0:
        sentences = [
            f"None of {contact.crude.samples} runs touches, so with 95 % confidence at most "
            f"{in_a_million(contact.upper)} in a million do (rule of three).",
            *_unreached(contact),
        ]
    else:
        ends = f"{in_a_million(contact.lower)} to {in_a_million(contact.upper)}"
        how = contact.method
        if how == CRUDE:
            how = f"{contact.crude.count} of {contact.crude.samples} runs"
        sentences = [
            f"{in_a_million(contact.estimate)} in a million runs touch (95 % interval {ends}; "
            f"{how})."
        ]
    return sentences + _where(contact)


def _unreached(contact: Contact) -> list[str]:
    """Return what a subset simulation that ended without contact reached."""
    rare = contact.rare
    if rare is None:
        return []
    return [
        f"Subset simulation followed the smallest gap down to {1e3 * rare.smallest:.1f} mm in "
        f"{len(rare.thresholds) + 1} levels and {rare.evaluations} runs, and ended without "
        "contact; it gives no probability."
    ]


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
        return f"{text}. The smallest gap of the last level is {1000.0 * rare.smallest:.1f} mm."
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


def in_a_million(share: float) -> str:
    """Return a share as number in a million, with two or three digits and thin spaces."""
    parts = 1e6 * share
    if parts < 1.0:
        return f"{parts:.2g}"
    digits = len(str(int(parts)))
    rounded = round(parts, 3 - digits) if digits > 3 else round(parts)
    return f"{int(rounded):,}".replace(",", "\u202f")


def pair_words(pair: str) -> str:
    """Return a pair of shapes in words: tub shell and wall left."""
    return " and ".join(shape_name(name) for name in pair.split("|"))


def quantity_words(name: str) -> str:
    """Return the name of an uncertain quantity in words."""
    kind, _, field = name.partition(".")
    if kind == LAUNDRY and field in _LAUNDRY_WORDS:
        return _LAUNDRY_WORDS[field]
    return shape_name(name.replace(".", " "))


def measure_titles(result: ToleranceResult) -> dict[str, tuple[str, str]]:
    """Return name in words and unit of each measure, by its key such as smallest_gap_mm."""
    return {measure_key(r): (r.title.replace("_", " "), r.unit_text) for r in result.chosen}


def _limit_sentences(verdicts: tuple[Verdict, ...]) -> list[str]:
    if not verdicts:
        return []
    words = [v.word for v in verdicts]
    parts = [f"{words.count(w)} {w}" for w in ("pass", "fail", "undecided") if w in words]
    return [f"Limits: {', '.join(parts)}."]


def leading(result: ToleranceResult) -> tuple[str, list[tuple[Variable, Index]]]:
    """Return the measure that the summary explains, and its quantities, largest total index first.

    The measure is the smallest gap if there is one, else the first measure.
    """
    keys = {r.name: measure_key(r) for r in result.chosen}
    name = keys.get(GAP, next(iter(keys.values())))
    if name not in result.indices:
        name = next(iter(result.indices), "")
    pairs = zip(result.machine.variables, result.indices.get(name, ()), strict=False)
    return name, sorted(pairs, key=lambda pair: -pair[1].total)


def _sensitivity_sentences(result: ToleranceResult) -> list[str]:
    key, indices = leading(result)
    if not indices:
        return [result.refused] if result.refused else []
    title, _ = measure_titles(result)[key]
    named = [(v.name, i) for v, i in indices if i.total >= LEAST_TOTAL][:MOST_NAMED]
    sentences = [
        f"Shares of the variance of the {title}, alone and together with others: {_listed(named)}."
    ]
    parts = [(v, i) for v, i in indices if not v.is_laundry]
    strong = [(v.name, i) for v, i in parts if i.total >= LEAST_TOTAL][:MOST_NAMED]
    if strong:
        sentences.append(f"To tighten: {_listed(strong)}.")
    elif parts:
        sentences.append("To tighten: nothing; no part causes as much as 1 % of this variance.")
    else:
        sentences.append("To tighten: nothing; only the laundry scatters in this file.")
    return sentences


def _listed(named: list[tuple[str, Index]]) -> str:
    return ", ".join(f"{quantity_words(name)} ({number(100 * i.total, 0)} %)" for name, i in named)


def warnings(result: ToleranceResult) -> list[str]:
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
