"""Findings of a screening study as sentences, made from its numbers."""

from collections import Counter

import numpy as np

from wm_drake.report.formatting import number
from wm_drake.report.gasket.tables import digits, term_title
from wm_drake.studies.doe.anova import Term
from wm_drake.studies.gasket.screening import (
    LEADING_INTERACTION_PERCENT,
    LEADING_MAIN_PERCENT,
    Label,
    Screening,
    leading_terms,
    main_effects,
)

CONFLICT_PERCENT = 5.0
"""Smallest contribution with which a factor counts in a conflict between two responses."""

MODEL_NAMES = {"main": "main effects", "main+2fi": "main effects and two-factor interactions"}
"""Names of the models of the analysis for reading."""


def summary(screening: Screening) -> str:
    """Return one paragraph about the design and the most influential factors."""
    design, runs = screening.design, screening.design.trials * len(screening.loads)
    mains = [table.main_percent for table in screening.tables.values()]
    residuals = [table.residual_percent for table in screening.tables.values()]
    drivers = Counter(main_effects(table)[0].name for table in screening.tables.values())
    ranked = ", ".join(f"{name} ({count})" for name, count in drivers.most_common())
    return (
        f"{runs} runs: {design.trials} trials of {len(design.factors)} factors ({design.kind}, "
        f"D-efficiency {number(design.efficiency(), 2)} %) with "
        f"{_joined([f'load {load}' for load in screening.loads])}. Main effects explain "
        f"{number(np.nanmin(mains), 0)} to {number(np.nanmax(mains), 0)} % of the variance of the "
        f"{len(mains)} responses. The model of {MODEL_NAMES[design.model]} leaves at most "
        f"{number(np.nanmax(residuals), 1)} % of the variance of a response unexplained. The most "
        "influential factors, each with the number of responses on which it has the largest "
        f"effect, are: {ranked}."
    )


def findings(screening: Screening) -> list[str]:
    """Return the conflicts between displacement and force or moment, over all loads."""
    return [text for load in screening.loads for text in conflicts(screening, load)] or [
        "There is no conflict: no factor that contributes "
        f"{CONFLICT_PERCENT:g} % or more to a displacement and to a force or moment of the same "
        "load changes them in opposite directions."
    ]


def load_findings(screening: Screening, load: str) -> list[str]:
    """Return a sentence for each response of a load: the leading terms and their direction."""
    return [_driver_sentence(screening, (load, name)) for name in screening.names]


def _driver_sentence(screening: Screening, label: Label) -> str:
    table, unit = screening.tables[label], screening.responses.units[label[1]]
    opening = f"{label[1]} (mean {digits(table.constant)} {unit})"
    terms = leading_terms(table)
    if not terms:
        return (
            f"{opening} has no leading term: no main effect exceeds {LEADING_MAIN_PERCENT:g} % and "
            f"no interaction exceeds {LEADING_INTERACTION_PERCENT:g} %."
        )
    mains = [_effect_text(term, unit) for term in terms if len(term.factors) == 1]
    joint = [
        f"{term_title(term.name)} ({number(term.percent, 0)} %)"
        for term in terms
        if len(term.factors) > 1
    ]
    interactions = f"interaction{'s' if len(joint) > 1 else ''}"
    together = f"depends on the {interactions} {_joined(joint)}" if joint else ""
    return f"{opening} {'; '.join(filter(None, [*mains, together]))}."


def _effect_text(term: Term, unit: str) -> str:
    share = f"{number(term.percent, 0)} %"
    low, middle, high = (term.effects[(level,)] for level in (-1, 0, 1))
    if middle < min(low, high) or middle > max(low, high):
        span = digits(max(low, middle, high) - min(low, middle, high))
        extreme = "lowest" if middle < min(low, high) else "highest"
        return f"is {extreme} at level 0 of {term.name}, by up to {span} {unit} ({share})"
    verb = "rises" if high > low else "falls"
    return (
        f"{verb} by {digits(abs(high - low))} {unit} from level −1 to +1 of {term.name} ({share})"
    )


def direction(term: Term) -> int:
    """Return 1 if the response rises with the factor, -1 if it falls."""
    return 1 if term.effects[(1,)] > term.effects[(-1,)] else -1


def conflicts(screening: Screening, load: str) -> list[str]:
    """Return a sentence for each factor that lowers a displacement but raises a force or moment."""
    changes: dict[str, dict[int, list[str]]] = {}
    for name in screening.names:
        for term in main_effects(screening.tables[load, name]):
            if term.percent >= CONFLICT_PERCENT:
                changes.setdefault(term.name, {}).setdefault(direction(term), []).append(name)
    texts = []
    for factor in screening.design.factors:
        rising, falling = (changes.get(factor, {}).get(sign, []) for sign in (1, -1))
        for down, up, verb in ((falling, rising, "raising"), (rising, falling, "lowering")):
            lowered = [name for name in down if name.startswith("D")]
            raised = [name for name in up if not name.startswith("D")]
            if lowered and raised:
                texts.append(
                    f"Load {load}: {verb} {factor} lowers {_joined(lowered)} but raises "
                    f"{_joined(raised)}."
                )
    return texts


def about_residual(screening: Screening) -> str:
    """Return an explanation of the residual and of the contributions of this study."""
    if screening.design.model == "main":
        rest = "all interactions, because the model contains main effects only"
    else:
        rest = "the interactions of three and more factors"
    text = (
        "Every run is a computation that always gives the same numbers, so the residual is not "
        f"noise. It consists of {rest}. p-values would only measure this lack of fit and are not "
        "given. Terms are judged by their contribution: the variance of the effects of a term over "
        "all level combinations, in percent of the total variance."
    )
    if screening.design.kind == "full":
        text += (
            " For the full factorial, the contributions are the Sobol indices of the three-level "
            "inputs."
        )
    return text


def _joined(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
