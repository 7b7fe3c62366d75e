"""What a screening study found, in words made from its numbers."""

from collections import Counter

import numpy as np

from wm_drake.report.gasket.tables import digits, term_title
from wm_drake.report.wording import number
from wm_drake.studies.doe.anova import Term
from wm_drake.studies.gasket.screening import Label, Screening, leading_terms, main_effects

CONFLICT_PERCENT = 5.0
"""A factor with this contribution to both of two responses, and opposite directions, is a conflict between them."""


def summary(screening: Screening) -> str:
    """One paragraph."""
    design, runs = screening.design, screening.design.trials * len(screening.loads)
    mains = [table.main_percent for table in screening.tables.values()]
    rests = [table.residual_percent for table in screening.tables.values()]
    drivers = Counter(main_effects(table)[0].name for table in screening.tables.values())
    ranked = ", ".join(f"{name} ({count})" for name, count in drivers.most_common())
    return (
        f"{runs} runs: {design.trials} trials of {len(design.factors)} factors ({design.kind}, D-efficiency "
        f"{number(design.efficiency(), 2)} %) with {_listed([f'load {load}' for load in screening.loads])}. Main "
        f"effects explain "
        f"{number(np.nanmin(mains), 0)} to {number(np.nanmax(mains), 0)} % of the variance of the {len(mains)} responses; "
        f"{number(np.nanmax(rests), 1)} % at most is left to what the model of {design.model} cannot say. "
        f"The factor that drives a response most is, with the number of responses: {ranked}."
    )


def findings(screening: Screening) -> list[str]:
    """What holds across loads: how to lower displacement, and what that costs in moment and force."""
    return [text for load in screening.loads for text in conflicts(screening, load)] or [
        "No factor that matters for a displacement pulls a force or moment the other way."
    ]


def load_findings(screening: Screening, load: str) -> list[str]:
    """A sentence per response: what drives it, and which way to turn it to lower the response."""
    return [_driver_sentence(screening, (load, name)) for name in screening.names]


def _driver_sentence(screening: Screening, label: Label) -> str:
    table, unit = screening.tables[label], screening.responses.units[label[1]]
    opening = f"{label[1]}, {digits(table.constant)} {unit} in the mean,"
    terms = leading_terms(table)
    if not terms:
        return f"{opening} is driven by no single term."
    mains = [_turn(term, unit) for term in terms if len(term.factors) == 1]
    joint = [
        f"{term_title(term.name)} ({number(term.percent, 0)} %)"
        for term in terms
        if len(term.factors) > 1
    ]
    together = f"depends on {_listed(joint)} jointly" if joint else ""
    return f"{opening} {'; '.join(filter(None, [*mains, together]))}."


def _turn(term: Term, unit: str) -> str:
    share = f"{number(term.percent, 0)} %"
    low, middle, high = (term.effects[(level,)] for level in (-1, 0, 1))
    if middle < min(low, high) or middle > max(low, high):
        span = digits(max(low, middle, high) - min(low, middle, high))
        return f"is {'lowest' if middle < min(low, high) else 'highest'} at level 0 of {term.name}, by {span} {unit} ({share})"
    verb = "rises" if high > low else "falls"
    return (
        f"{verb} by {digits(abs(high - low))} {unit} from level −1 to +1 of {term.name} ({share})"
    )


def direction(term: Term) -> int:
    """1 if the response rises with the factor, -1 if it falls."""
    return 1 if term.effects[(1,)] > term.effects[(-1,)] else -1


def conflicts(screening: Screening, load: str) -> list[str]:
    """Factors that lower a displacement while they raise a moment or force of the same load."""
    wants: dict[str, dict[int, list[str]]] = {}
    for name in screening.names:
        for term in main_effects(screening.tables[load, name]):
            if term.percent >= CONFLICT_PERCENT:
                wants.setdefault(term.name, {}).setdefault(direction(term), []).append(name)
    texts = []
    for factor in screening.design.factors:
        rising, falling = (wants.get(factor, {}).get(sign, []) for sign in (1, -1))
        for down, up, verb in ((falling, rising, "raising"), (rising, falling, "lowering")):
            gained, paid = (
                [n for n in down if n.startswith("D")],
                [n for n in up if not n.startswith("D")],
            )
            if gained and paid:
                texts.append(
                    f"Load {load}: {verb} {factor} lowers {_listed(gained)} but raises {_listed(paid)}."
                )
    return texts


def about_residual(screening: Screening) -> str:
    """What the residual is here."""
    text = (
        "Every run is computed and gives the same numbers each time, so the residual is no noise: it is "
        "interactions of three and "
        "more factors. p-values would only rank that lack of fit and are not given; terms are judged by contributions, which "
        "are the variance of a term's effects over all level combinations, in percent of the whole."
    )
    if screening.design.model == "main":
        text = text.replace(
            "interactions of three and more factors",
            "all interactions, which the model of main effects leaves out",
        )
    if screening.design.kind == "full":
        text += " On the full factorial these are the Sobol indices of the three-level inputs."
    return text


def _listed(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
