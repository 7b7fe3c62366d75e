"""Findings of a tolerance study in words."""

from wm_drake.report.formatting import shape_name
from wm_drake.studies.gasket.responses import GAP
from wm_drake.studies.tolerance.sensitivity import Index
from wm_drake.studies.tolerance.study import (
    CRUDE,
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


def summary(result: ToleranceResult) -> list[str]:
    """Return the findings, one sentence each."""
    found = contact_sentences(result.contact) if result.contact else []
    if not result.contact:
        found = ["The SDF has no shapes on both tub and housing, so contact cannot be judged."]
    found += _limit_sentences(result.verdicts)
    return found + _sensitivity_sentences(result)


def contact_sentences(contact: Contact) -> list[str]:
    """Return sentences about how often the tub touches, and where."""
    if contact.estimate == 0.0:
        first = (
            f"No run touches; the upper end of the 95 % interval is {in_a_million(contact.upper)} "
            f"in a million ({contact.method})."
        )
    else:
        ends = f"{in_a_million(contact.lower)} to {in_a_million(contact.upper)}"
        first = (
            f"{in_a_million(contact.estimate)} in a million runs touch (95 % interval {ends}; "
            f"{contact.method})."
        )
    if contact.pairs:
        name, share = next(iter(contact.pairs.items()))
        percent = 100.0 * share.count / max(1, contact.crude.count)
        where = f"{percent:.0f} % of the runs that touch do so at {pair_words(name)}."
    elif contact.nearest:
        name = next(iter(contact.nearest))
        percent = 100.0 * contact.nearest[name] / contact.crude.samples
        where = f"The smallest gap is at {pair_words(name)} in {percent:.0f} % of the runs."
    else:
        return [first]
    return [first, where]


def in_a_million(share: float) -> str:
    """Return a share as number in a million, with two or three digits and thin spaces."""
    number = 1e6 * share
    if number < 1.0:
        return f"{number:.2g}"
    digits = len(str(int(number)))
    rounded = round(number, 3 - digits) if digits > 3 else round(number)
    return f"{int(rounded):,}".replace(",", "\u202f")


def pair_words(pair: str) -> str:
    """Return a pair of shapes in words: tub shell and wall left."""
    return " and ".join(shape_name(name) for name in pair.split("|"))


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
    name, found = leading(result)
    if not found:
        return [result.refused] if result.refused else []
    parts = [(v.name, i) for v, i in found if not v.is_laundry and i.total >= LEAST_TOTAL][
        :MOST_NAMED
    ]
    all_named = [(v.name, i) for v, i in found if i.total >= LEAST_TOTAL][:MOST_NAMED]
    sentences = [f"Most of the scatter of {name} comes from {_listed(all_named)}."]
    if parts:
        sentences.append(f"To tighten: {_listed(parts)}.")
    elif any(not v.is_laundry for v, _ in found):
        sentences.append("No tolerance of a part matters as much as 1 % of this scatter.")
    return sentences


def _listed(named: list[tuple[str, Index]]) -> str:
    return ", ".join(f"{name} (total index {index.total:.2f})" for name, index in named)


def warnings(result: ToleranceResult) -> list[str]:
    """Return what limits the use of the results."""
    found = []
    if result.failed:
        number, reason = next(iter(result.failed.items()))
        found.append(
            f"{len(result.failed)} of {result.settings.samples} runs failed and count as contact "
            f"(sample {number + 1}: {reason})."
        )
    contact = result.contact
    if contact and contact.method == CRUDE and 0 < contact.crude.count < 10:
        found.append(
            f"Only {contact.crude.count} runs touch; more samples, or --subset, make the interval "
            "narrower."
        )
    if result.refused and result.settings.sensitivity:
        found.append(result.refused)
    wide = [
        (name, v.name)
        for name, indices in result.indices.items()
        for v, i in zip(result.machine.variables, indices, strict=True)
        if i.total_upper - i.total_lower > 2.0 * WIDE_INTERVAL
    ]
    if wide:
        count = len({name for name, _ in wide})
        found.append(
            f"Total indices of {count} of {len(result.indices)} measures are uncertain by more "
            f"than ±{WIDE_INTERVAL:g}; more samples (--sensitivity) make them sharper."
        )
    return found
