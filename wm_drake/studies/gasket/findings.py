"""Findings of a screening study as sentences, made from its numbers."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import xarray as xr

from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import CONSEQUENCE, listed
from wm_drake.report.quantity import CHANGE, SHARE, Quantity, quantity_of, text_of
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.doe.design import Design
from wm_drake.studies.gasket.screening import (
    CONTRIBUTION,
    FAR,
    LEADING_INTERACTION,
    LEADING_MAIN,
    LEAST_PREDICTED_R2,
    PREDICTED_R2,
    Label,
    at,
    compared_terms,
    has_few_trials,
    is_main,
    labels_of,
    leaders,
    leading,
    mains,
    mean_difference,
    poor,
    sign_differs,
)
from wm_drake.studies.gasket.study import DIFFERENCE
from wm_drake.studies.gasket.words import Words

MOST_NAMED = 6
"""Largest number of results that a sentence names."""

LEAST_REASON = 0.05
"""Smallest share of the variance of the gap with which a changed factor is a reason."""

SAME = 1e-4
"""Difference below which level 0 is called the machine; rounding changes late digits."""

EFFICIENCY = Quantity("D-efficiency", Unit("%", "%"), 2)

MODEL_NAMES = {"main": "main effects", "main+2fi": "main effects and two-factor interactions"}
"""Names of the models of the analysis for reading."""


def answer_text(screening: xr.Dataset, words: Words) -> str:
    """Return the answer in a sentence: the smallest gap of all runs, and what decides it.

    Without a gap among the responses it is the factor that leads most responses.
    """
    label = nearest(screening)
    if label is None:
        shares = screening[["share"]]
        led = Counter(_leader(at(shares, label)) for label in labels_of(shares))
        factor, count = led.most_common(1)[0]
        return (
            f"{_capital(words.factor(factor))} has the largest effect on {count} of {led.total()} "
            "responses of all loads."
        )
    of_gap = at(screening, label)
    return (
        f"{contact_text(screening)} with load {label[0]}, and {words.factor(_leader(of_gap))} has "
        "the largest effect on it."
    )


def nearest(screening: xr.Dataset) -> Label | None:
    """Return the load of the smallest gap, and the gap; None without a gap."""
    if GAP not in screening.response.values:
        return None
    smallest = screening.smallest.sel(response=GAP)
    return str(smallest["load"].values[int(np.argmin(smallest.values))]), GAP


def contact_text(screening: xr.Dataset) -> str:
    """Return in how many runs the tub touches, and the smallest gap of all."""
    smallest = screening.smallest.sel(response=GAP)
    touching = int(screening.overlap.notnull().sum())
    return (
        f"The tub touches the housing in {touching or 'none'} of {screening.overlap.size} runs: "
        f"the smallest gap is {quantity_of(smallest).text(smallest.min())}"
    )


def why_text(
    screening: xr.Dataset, proposal: xr.Dataset, factors: Sequence[str], words: Words
) -> str:
    """Return why factors are changed, in a sentence: their shares, where it matters most.

    This is the gap with the load with which it is smallest as it is, or without a gap the response
    of which they have most.

    Args:
        screening: As of `screening.run_screening`.
        proposal: As of `page.Comparisons`.
        factors: Names of those that it changes.
        words: Words of the study.
    """
    label = nearest(screening)
    if not factors:
        return ""
    of_factors = screening.share.sel(term=factors)
    if label is None:
        label = max(labels_of(screening), key=lambda label: at(of_factors, label).sum().item())
    elif (load := proposal.load_before.sel(response=GAP).item()) in screening["load"].values:
        label = load, GAP
    shares = at(of_factors, label).sortby(-at(of_factors, label))
    large = [share for share in shares if share >= LEAST_REASON]
    small = [share.term.item() for share in shares if not share >= LEAST_REASON]
    of_what = f"of the variance of the {words.response(label[1])} with load {label[0]}"
    texts = []
    if large:
        texts.append(
            f"{listed([f'{one.term.item()} has {SHARE.text(one)}' for one in large])} {of_what}"
        )
    if small:
        verb = "helps" if len(small) == 1 else "help"
        texts.append(f"{listed(small)} {verb} to keep other responses within the limit")
    return f"{'; '.join(texts)}."


def _leader(of_label: xr.Dataset) -> str:
    """Return the factor with the largest main effect on a response."""
    return str(mains(of_label).term.values[0])


def summary(
    screening: xr.Dataset,
    words: Words,
    published: xr.Dataset,
    check: xr.Dataset,
) -> list[str]:
    """Return sentences on the study and its results.

    They are about the design, contact, the most influential factors, the quality of the model,
    published results and runs beside the model.
    """
    design, loads = screening.design, [f"load {load}" for load in screening["load"].values]
    sentences = [
        f"{screening.overlap.size} runs: {design.trials} trials of {len(design.factors)} factors "
        f"({design.kind}, D-efficiency {EFFICIENCY.text(design.efficiency())}) with "
        f"{listed(loads)}."
    ]
    sentences += [f"{contact_text(screening)}."] if nearest(screening) else []
    sentences += _drivers(screening, words)
    sentences.append(_quality(screening, words))
    if published:
        sentences += _against_published(screening, words, published)
    if check:
        sentences.append(about_check(check))
    return sentences


def _against_published(screening: xr.Dataset, words: Words, published: xr.Dataset) -> list[str]:
    """Return sentences on the published results that ours are far from."""
    means = mean_difference(screening, published)
    known = [label for label in labels_of(screening) if at(means, label).notnull()]
    texts = []
    if known:
        far = [label for label in known if abs(at(means, label)) > FAR]
        ranked = sorted(far, key=lambda label: -abs(at(means, label)))
        named = [f"{_of(label, words)} ({CHANGE.text(at(means, label))})" for label in ranked]
        texts.append(
            f"Means beside the published ones: {len(far)} of {len(known)} differ by more than "
            f"{SHARE.text(FAR)}{_listed(named)}."
        )
    compared = compared_terms(published)
    return [*texts, *_against_terms(screening, words, published)] if compared.any() else texts


def _against_terms(screening: xr.Dataset, words: Words, published: xr.Dataset) -> list[str]:
    """Return sentences on leading factors, contributions and signs beside the published ones."""
    lead = leaders(screening, published)
    same = sum(ours == theirs for ours, theirs in lead.values())
    texts = [f"The most influential factor is the published one in {same} of {len(lead)} cases."]
    points = screening.share - published.share
    of_mains = np.abs(points.isel(term=is_main(points.term)))
    if of_mains.notnull().any():
        texts.append(
            "Contributions of main effects differ from the published ones by "
            f"{CONTRIBUTION.text(of_mains.mean())} of the variance in the mean and by "
            f"{SHARE.text(of_mains.max())} at most."
        )
    signs = sign_differs(screening, published)
    other = [
        f"{words.term(term)} on {_of(label, words)}"
        for label in labels_of(screening)
        for term in signs.term.values[at(signs, label).values].tolist()
    ]
    with_effects = int(published.effect.notnull().any(["level", "other_level"]).sum())
    texts.append(
        f"Effects with another sign than the published ones: {len(other)} of {with_effects}"
        f"{_listed(other)}."
    )
    far = [
        (term, label)
        for label in labels_of(points)
        for term in points.term.values[np.abs(at(points, label).values) > FAR].tolist()
    ]
    far.sort(key=lambda place: -abs(at(points, place[1]).sel(term=place[0])))
    named = [
        f"{words.term(t)} on {_of(label, words)} ({CHANGE.text(at(points, label).sel(term=t))})"
        for t, label in far
    ]
    return [
        *texts,
        f"Contributions beside the published ones: {len(far)} differ by more than "
        f"{SHARE.text(FAR)} of the variance{_listed(named)}.",
    ]


def _of(label: Label, words: Words) -> str:
    return f"{words.response(label[1])}, load {label[0]}"


def _listed(named: list[str]) -> str:
    """Return the first texts of a list after a colon, and how many more there are."""
    shown = named[:MOST_NAMED]
    more = len(named) - len(shown)
    shown += [f"{more} more"] if more else []
    return f": {listed(shown)}" if shown else ""


def level_zero_text(zero: xr.Dataset, words: Words, tables: str) -> str:
    """Return a sentence on level 0 and the machine.

    Args:
        zero: As of `study.run_level_zero`.
        words: Words of the study.
        tables: Treatment of stiffness tables.
    """
    linear, label = _largest(zero.linear_difference)
    size = f"up to {DIFFERENCE.text(linear)} ({_of(label, words)})"
    if tables == "linear":
        return (
            "Level 0 of this study is not the machine: its stiffness tables are replaced by the "
            f"slopes of their first 20 %, as in [B], so responses at level 0 differ by {size}. "
            "With --tables scaled, level 0 is the machine."
        )
    scaled, _ = _largest(zero.scaled_difference)
    first = (
        "Level 0 of the study is the machine."
        if scaled < SAME
        else "Level 0 of the study differs from the machine by up to "
        f"{DIFFERENCE.text(scaled)}, because of the bounds of the factors."
    )
    return (
        f"{first} With the slopes of their first 20 % in place of stiffness tables (--tables "
        f"linear, as in [B]), responses at level 0 differ from it by {size}."
    )


def _largest(difference: xr.DataArray) -> tuple[float, Label]:
    """Return the largest size of a difference, and where it is."""
    sizes = abs(difference.fillna(0.0))
    label = max(labels_of(sizes), key=lambda label: at(sizes, label).item())
    return at(sizes, label).item(), label


def _drivers(screening: xr.Dataset, words: Words) -> list[str]:
    """Return a sentence for each of the factors that lead most responses, at most three."""
    led: dict[str, dict[str, list[str]]] = {}
    shares = screening[["share"]]
    for load, name in labels_of(shares):
        first = mains(at(shares, (load, name))).share.isel(term=0)
        if first >= LEADING_MAIN:
            factor = first.term.item()
            led.setdefault(factor, {}).setdefault(load, []).append(words.response(name))
    ranked = sorted(led.items(), key=lambda item: -sum(map(len, item[1].values())))[:3]
    return [
        f"{_capital(words.factor(factor))} is the most influential factor for "
        f"{'; '.join(f'{listed(names)} with load {load}' for load, names in by_load.items())}."
        for factor, by_load in ranked
    ]


def _quality(screening: xr.Dataset, words: Words) -> str:
    design, r2 = screening.design, screening.predicted_r2
    model = f"The model of {MODEL_NAMES[design.model]}"
    if design.is_complete and design.residual_df < 1:
        return f"{model} has a coefficient for each of the trials, so it meets them exactly."
    if design.is_complete:
        left = CONTRIBUTION.text(screening.unexplained.max().fillna(0.0))
        return f"{model} leaves at most {left} of the variance of a response over all combinations."
    known = [label for label in labels_of(screening) if at(r2, label).notnull()]
    if not known:
        return f"{model} cannot be checked with these trials."
    worst = min(known, key=lambda label: at(r2, label).item())
    least = at(r2, worst)
    if least < 0.0:
        return f"{model} predicts {_of(worst, words)}, worse than its mean does (R² below 0)."
    return (
        f"{model} predicts trials that were left out of its fit with R² of at least "
        f"{text_of(least)} ({_of(worst, words)})."
    )


def warnings(screening: xr.Dataset, words: Words) -> list[str]:
    """Return what a reader must know before using the numbers."""
    return [
        *_of_contact(screening),
        *_of_slack(screening),
        *_of_design(screening.design),
        *_of_model(screening, words),
    ]


def _of_contact(screening: xr.Dataset) -> list[str]:
    overlap = screening.overlap.stack(run=("trial", "load")).dropna("run")
    if not overlap.size:
        return []
    worst = overlap.isel(run=int(np.argmin(overlap.values)))
    return [
        f"The tub touches the housing in {overlap.size} of {screening.overlap.size} runs. The "
        f"largest overlap, {quantity_of(overlap).text(-worst)}, is in trial "
        f"{worst.trial.item()}, load {worst['load'].item()}. The model has no contact force: these "
        "runs show only that the tub touches. They are marked in runs.csv, column touches."
    ]


def _of_slack(screening: xr.Dataset) -> list[str]:
    """Return a warning with the number of runs in which each spring goes slack, or none."""
    counts = Counter(
        (spring, str(load))
        for load in screening["load"].values
        for names in filter(None, screening.slack.sel(load=load).values)
        for spring in names.split(", ")
    )
    if not counts:
        return []
    springs = listed([f"{spring} with load {load} ({n})" for (spring, load), n in counts.items()])
    return [
        f"Springs go slack in {np.count_nonzero(screening.slack)} of {screening.slack.size} runs: "
        f"{springs}. {CONSEQUENCE} They are marked in runs.csv, column slack."
    ]


def _of_design(design: Design) -> list[str]:
    if design.residual_df < 1:
        return [
            f"The design has as many trials as coefficients ({design.coefficients}). The "
            "contributions are exact at these levels, but nothing shows how well the model fits "
            "between them."
        ]
    if has_few_trials(design):
        return [
            f"{design.trials} trials for {design.coefficients} coefficients are few "
            f"({design.residual_df} degrees of freedom): contributions and effects are uncertain, "
            f"and {PREDICTED_R2.words} is too pessimistic. Use more trials, or the model main."
        ]
    return []


def _of_model(screening: xr.Dataset, words: Words) -> list[str]:
    labels = poor(screening)
    if not labels:
        return []
    texts = [
        f"{_of(label, words)} ({PREDICTED_R2.number(r2)})"
        for label, r2 in list(labels.items())[:MOST_NAMED]
    ]
    more = len(labels) - len(texts)
    texts += [f"{more} more"] if more else []
    return [
        f"The model predicts these responses poorly, with R² below {LEAST_PREDICTED_R2:g}: "
        f"{listed(texts)}. Their contributions and effects are only indications."
    ]


def load_findings(screening: xr.Dataset, load: str, words: Words) -> list[str]:
    """Return a sentence for each response of a load: the leading terms and their direction."""
    effects = screening[["mean", "share", "effect"]]
    names = screening.response.values.tolist()
    return [_driver_sentence(at(effects, (load, name)), words) for name in names]


def _driver_sentence(of_label: xr.Dataset, words: Words) -> str:
    mean = text_of(of_label["mean"])
    opening = f"{_capital(words.response(of_label.response.item()))}, mean {mean},"
    terms = leading(of_label)
    if not terms:
        return (
            f"{opening} has no leading term: no main effect exceeds {SHARE.text(LEADING_MAIN)} and "
            f"no interaction exceeds {SHARE.text(LEADING_INTERACTION)}."
        )
    of_factors = [_effect_text(of_label, term, words) for term in terms if ":" not in term]
    joint = [
        f"{words.term(term)} ({SHARE.text(of_label.share.sel(term=term))})"
        for term in terms
        if ":" in term
    ]
    interactions = f"interaction{'s' if len(joint) > 1 else ''}"
    together = f"depends on the {interactions} {listed(joint)}" if joint else ""
    return f"{opening} {'; '.join(filter(None, [*of_factors, together]))}."


def _effect_text(of_label: xr.Dataset, factor: str, words: Words) -> str:
    share = SHARE.text(of_label.share.sel(term=factor))
    effect = of_label.effect.sel(term=factor, other_level="")
    (low, middle, high), text = effect.values, quantity_of(effect).text
    name = words.factor(factor)
    if middle < min(low, high) or middle > max(low, high):
        span = text(max(low, middle, high) - min(low, middle, high))
        extreme = "lowest" if middle < min(low, high) else "highest"
        return f"is {extreme} at {words.value(factor, 0)} of {name}, by up to {span} ({share})"
    verb = "rises" if high > low else "falls"
    return f"{verb} by {text(abs(high - low))} as {name} rises from {words.span(factor)} ({share})"


def about_check(check: xr.Dataset) -> str:
    """Return a sentence on how many runs of settings lie inside the interval of the model."""
    inside, known = int(check.is_inside.sum()), int(check.predicted.notnull().sum())
    return f"{inside} of {known} responses lie inside the 95 % interval of the fitted model."


def about_residual(design: Design) -> str:
    """Return an explanation of the residual and of the contributions of a study."""
    lacking = (
        "all interactions, because the model contains main effects only"
        if design.model == "main"
        else "the interactions of three and more factors"
    )
    text = (
        "Every run is a computation that always gives the same numbers, so the residual is not "
        "noise, and p-values are not given. Terms are judged by their contribution: the variance "
        "of the effects of a term over all level combinations, in percent of the total variance. "
    )
    if design.is_complete:
        return text + (
            f"The design has all level combinations. The residual consists of {lacking}. The "
            "contributions are the Sobol indices of the three-level inputs."
        )
    return text + (
        f"The model lacks {lacking}. The residual column is an estimate of their share: the "
        "sum of squares that the fit leaves over its own trials, divided by its degrees of "
        f"freedom. Judge the model by {PREDICTED_R2.words}, which leaves each trial out of the fit "
        "once and predicts it: 1 is perfect, 0 is no better than the mean. Adjusted R² is the "
        "explained part, corrected for the number of coefficients."
    )


def _capital(text: str) -> str:
    """Return a text with a capital first letter, unless it begins with a symbol or a key."""
    first = text.split()[0]
    return text[0].upper() + text[1:] if first.isalpha() and first.islower() else text
