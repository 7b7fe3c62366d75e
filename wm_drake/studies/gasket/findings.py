"""Findings of a screening study as sentences, made from its numbers."""

from collections import Counter

import numpy as np

from wm_drake.report.formatting import CONSEQUENCE, listed, number, percent
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.doe.anova import Term
from wm_drake.studies.doe.coding import LEVELS
from wm_drake.studies.gasket.proposal import NOT_COMPARED, Compared
from wm_drake.studies.gasket.screening import (
    FAR,
    LEADING_INTERACTION_PERCENT,
    LEADING_MAIN_PERCENT,
    LEAST_PREDICTED_R2,
    Label,
    Published,
    Screening,
    Words,
    leading_terms,
    main_effects,
)
from wm_drake.studies.gasket.study import LevelZero
from wm_drake.studies.gasket.surface import Check
from wm_drake.studies.gasket.tables import digits, r2_text

MOST_NAMED = 6
"""Largest number of results that a sentence names."""

SAME_PERCENT = 0.01
"""Difference below which level 0 is called the machine; rounding changes late digits. [%]"""

MODEL_NAMES = {"main": "main effects", "main+2fi": "main effects and two-factor interactions"}
"""Names of the models of the analysis for reading."""


def summary(screening: Screening, words: Words, compared: Compared = NOT_COMPARED) -> list[str]:
    """Return sentences on the study and its results.

    They are about the design, contact, the most influential factors, the quality of the model,
    published results and level 0.
    """
    design, runs = screening.design, screening.design.trials * len(screening.loads)
    sentences = [
        f"{runs} runs: {design.trials} trials of {len(design.factors)} factors ({design.kind}, "
        f"D-efficiency {number(design.efficiency(), 2)} %) with "
        f"{listed([f'load {load}' for load in screening.loads])}."
    ]
    sentences += _contact(screening)
    sentences += _drivers(screening, words)
    sentences.append(_quality(screening, words))
    if compared.published:
        sentences += _against_published(screening, words, compared.published)
    if compared.level_zero is not None:
        sentences.append(level_zero_text(compared.level_zero, words))
    if compared.check is not None:
        sentences.append(about_check(compared.check))
    return sentences


def _against_published(screening: Screening, words: Words, published: Published) -> list[str]:
    """Return sentences on the published results that ours are far from."""
    texts = []
    means = [label for label in screening.tables if published.mean(label) is not None]
    if means:
        far = published.far_means(screening)
        ranked = sorted(far, key=lambda label: -abs(far[label]))
        named = [
            f"{words.response(n)}, load {load} ({percent(far[load, n])})" for load, n in ranked
        ]
        texts.append(
            f"Means beside the published ones: {len(far)} of {len(means)} differ by more than "
            f"{FAR:g} %{_listed(named)}."
        )
    if published.has_terms:
        texts += _against_published_effects(screening, words, published)
        points = published.far_contributions(screening)
        terms = sorted(points, key=lambda key: -abs(points[key]))
        named = [
            f"{words.term(term)} on {words.response(name)}, load {load} "
            f"({number(points[(load, name), term], 0)} points)"
            for (load, name), term in terms
        ]
        texts.append(
            f"Contributions beside the published ones: {len(points)} differ by more than "
            f"{FAR:g} points of percent{_listed(named)}."
        )
    return texts


def _against_published_effects(
    screening: Screening, words: Words, published: Published
) -> list[str]:
    """Return sentences on leading factors, contributions and signs beside the published ones."""
    leaders = published.leaders(screening)
    same = sum(ours == theirs for ours, theirs in leaders.values())
    texts = [f"The most influential factor is the published one in {same} of {len(leaders)} cases."]
    differences = published.differences(screening)
    points = [abs(points) for (_, term), points in differences.items() if ":" not in term]
    if points:
        texts.append(
            f"Contributions of main effects differ from the published ones by "
            f"{number(sum(points) / len(points), 1)} points of percent in the mean and by "
            f"{number(max(points), 0)} points at most."
        )
    other = [
        f"{words.term(term)} on {words.response(name)}, load {load}"
        for (load, name), term in published.other_signs(screening)
    ]
    known = [t for label, t in published.compared_terms(screening) if published.effects(label, t)]
    texts.append(
        f"Effects with another sign than the published ones: {len(other)} of {len(known)}"
        f"{_listed(other)}."
    )
    return texts


def _listed(named: list[str]) -> str:
    """Return the first texts of a list after a colon, and how many more there are."""
    shown = named[:MOST_NAMED]
    more = len(named) - len(shown)
    shown += [f"{more} more"] if more else []
    return f": {listed(shown)}" if shown else ""


def level_zero_text(zero: LevelZero, words: Words) -> str:
    """Return a sentence on level 0 and the machine."""
    (load, name), change = zero.largest("linear")
    where = f"{words.response(name)}, load {load}"
    size = f"up to {number(abs(change), 1)} % ({where})"
    if zero.tables == "linear":
        return (
            "Level 0 of this study is not the machine: its stiffness tables are replaced by the "
            f"slopes of their first 20 %, as in [B], so responses at level 0 differ by {size}. "
            "With --tables scaled, level 0 is the machine."
        )
    (_, _), deviation = zero.largest("scaled")
    is_machine = abs(deviation) < SAME_PERCENT
    first = (
        "Level 0 of the study is the machine."
        if is_machine
        else "Level 0 of the study differs from the machine by up to "
        f"{number(abs(deviation), 1)} %, because of the bounds of the factors."
    )
    return (
        f"{first} With the slopes of their first 20 % in place of stiffness tables (--tables "
        f"linear, as in [B]), responses at level 0 differ from it by {size}."
    )


def _contact(screening: Screening) -> list[str]:
    runs, touching = screening.design.trials * len(screening.loads), screening.responses.touching
    if touching:
        return [
            f"The tub touches the housing in {len(touching)} of {runs} runs, with an overlap of up "
            f"to {digits(-min(touching.values()))} mm."
        ]
    if GAP not in screening.names:
        return []
    least = min(float(v[GAP].min()) for v in screening.responses.values.values())
    return [f"The tub touches the housing in no run; the smallest gap is {digits(least)} mm."]


def _slack(screening: Screening) -> list[str]:
    """Return a warning with the number of runs in which each spring goes slack, or none."""
    counts = Counter(
        (spring, load) for (_, load), names in screening.responses.slack.items() for spring in names
    )
    if not counts:
        return []
    springs = listed([f"{spring} with load {load} ({n})" for (spring, load), n in counts.items()])
    runs = screening.design.trials * len(screening.loads)
    return [
        f"Springs go slack in {len(screening.responses.slack)} of {runs} runs: {springs}. "
        f"{CONSEQUENCE} They are marked in runs.csv, column slack."
    ]


def _drivers(screening: Screening, words: Words) -> list[str]:
    """Return a sentence for each of the factors that lead most responses, at most three."""
    led: dict[str, dict[str, list[str]]] = {}
    for (load, name), table in screening.tables.items():
        first = main_effects(table)[0]
        if first.percent >= LEADING_MAIN_PERCENT:
            led.setdefault(first.name, {}).setdefault(load, []).append(words.response(name))
    ranked = sorted(led.items(), key=lambda item: -sum(map(len, item[1].values())))[:3]
    return [
        f"{_capital(words.factor(factor))} is the most influential factor for "
        f"{'; '.join(f'{listed(names)} with load {load}' for load, names in by_load.items())}."
        for factor, by_load in ranked
    ]


def _quality(screening: Screening, words: Words) -> str:
    model = f"The model of {MODEL_NAMES[screening.design.model]}"
    if screening.is_complete:
        residuals = [t.residual_percent for t in screening.tables.values()]
        left = max((percent for percent in residuals if not np.isnan(percent)), default=0.0)
        if screening.design.residual_df < 1:
            return f"{model} has a coefficient for each of the trials, so it meets them exactly."
        return (
            f"{model} leaves at most {number(left, 1)} % of the variance of a response "
            "over all level combinations."
        )
    every = {label: t.predicted_r2 for label, t in screening.tables.items()}
    known = {label: r2 for label, r2 in every.items() if not np.isnan(r2)}
    if not known:
        return f"{model} cannot be checked with these trials."
    load, name = worst = min(known, key=lambda label: known[label])
    if known[worst] < 0.0:
        return (
            f"{model} predicts {words.response(name)}, load {load}, worse than its mean does "
            "(predicted R² below 0)."
        )
    return (
        f"{model} predicts trials that were left out of its fit with R² of at least "
        f"{r2_text(known[worst])} ({words.response(name)}, load {load})."
    )


def warnings(screening: Screening, words: Words) -> list[str]:
    """Return what a reader must know before using the numbers."""
    sentences = []
    if screening.responses.touching:
        (trial, load), gap = min(screening.responses.touching.items(), key=lambda item: item[1])
        sentences.append(
            f"{_contact(screening)[0]} The largest overlap, {digits(-gap)} mm, is in trial "
            f"{trial + 1}, load {load}. The model has no contact force: these runs show only that "
            "the tub touches. They are marked in runs.csv, column touches."
        )
    sentences += _slack(screening)
    design = screening.design
    coefficients = design.trials - design.residual_df
    if design.residual_df < 1:
        sentences.append(
            f"The design has as many trials as coefficients ({coefficients}). The contributions "
            "are exact at these levels, but nothing shows how well the model fits between them."
        )
    elif screening.has_few_trials:
        sentences.append(
            f"{design.trials} trials for {coefficients} coefficients are few "
            f"({design.residual_df} degrees of freedom): contributions and effects are uncertain, "
            "and predicted R² is too pessimistic. Use more trials, or the model main."
        )
    poor = screening.poor()
    if poor:
        texts = [
            f"{words.response(name)}, load {load} ({r2_text(r2)})"
            for (load, name), r2 in list(poor.items())[:6]
        ]
        if len(poor) > 6:
            texts.append(f"{len(poor) - 6} more")
        sentences.append(
            f"The model predicts these responses poorly, with R² below {LEAST_PREDICTED_R2:g}: "
            f"{listed(texts)}. Their contributions and effects are only indications."
        )
    return sentences


def load_findings(screening: Screening, load: str, words: Words) -> list[str]:
    """Return a sentence for each response of a load: the leading terms and their direction."""
    return [_driver_sentence(screening, (load, name), words) for name in screening.names]


def _driver_sentence(screening: Screening, label: Label, words: Words) -> str:
    table, unit = screening.tables[label], screening.responses.units[label[1]]
    opening = f"{_capital(words.response(label[1]))}, mean {digits(table.constant)} {unit},"
    terms = leading_terms(table)
    if not terms:
        return (
            f"{opening} has no leading term: no main effect exceeds {LEADING_MAIN_PERCENT:g} % and "
            f"no interaction exceeds {LEADING_INTERACTION_PERCENT:g} %."
        )
    mains = [_effect_text(term, unit, words) for term in terms if len(term.factors) == 1]
    joint = [
        f"{words.term(term.name)} ({number(term.percent, 0)} %)"
        for term in terms
        if len(term.factors) > 1
    ]
    interactions = f"interaction{'s' if len(joint) > 1 else ''}"
    together = f"depends on the {interactions} {listed(joint)}" if joint else ""
    return f"{opening} {'; '.join(filter(None, [*mains, together]))}."


def _effect_text(term: Term, unit: str, words: Words) -> str:
    share = f"{number(term.percent, 0)} %"
    low, middle, high = (term.effects[(level,)] for level in LEVELS)
    name = words.factor(term.name)
    if middle < min(low, high) or middle > max(low, high):
        span = digits(max(low, middle, high) - min(low, middle, high))
        extreme = "lowest" if middle < min(low, high) else "highest"
        return (
            f"is {extreme} at {words.value(term.name, 0)} of {name}, by up to {span} {unit} "
            f"({share})"
        )
    verb = "rises" if high > low else "falls"
    return (
        f"{verb} by {digits(abs(high - low))} {unit} as {name} rises from "
        f"{words.span(term.name)} ({share})"
    )


def about_check(check: Check) -> str:
    """Return a sentence on how many runs of `--check` lie inside the interval of the model."""
    table = check.frame()
    inside = int(table["is_inside"].sum())
    text = (
        f"{inside} of {len(table)} responses of the checked settings lie inside the 95 % interval"
    )
    return f"{text} of the fitted model."


def about_residual(screening: Screening) -> str:
    """Return an explanation of the residual and of the contributions of this study."""
    lacking = (
        "all interactions, because the model contains main effects only"
        if screening.design.model == "main"
        else "the interactions of three and more factors"
    )
    text = (
        "Every run is a computation that always gives the same numbers, so the residual is not "
        "noise, and p-values are not given. Terms are judged by their contribution: the variance "
        "of the effects of a term over all level combinations, in percent of the total variance. "
    )
    if screening.is_complete:
        text += (
            f"The design has all level combinations. The residual consists of {lacking}. The "
            "contributions are the Sobol indices of the three-level inputs."
        )
    else:
        text += (
            f"The model lacks {lacking}. The residual column is an estimate of their share: the "
            "sum of squares that the fit leaves over its own trials, divided by its degrees of "
            "freedom. Judge the model by predicted R², which leaves each trial out of the fit once "
            "and predicts it: 1 is perfect, 0 is no better than the mean. Adjusted R² is the "
            "explained part, corrected for the number of coefficients."
        )
    return text


def _capital(text: str) -> str:
    """Return a text with a capital first letter, unless it begins with a symbol or a key."""
    first = text.split()[0]
    return text[0].upper() + text[1:] if first.isalpha() and first.islower() else text
