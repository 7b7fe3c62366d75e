"""Show what to measure next: the answer, its interval after each step, and the candidates."""

from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.report import figure as fig
from wm_drake.report.formatting import listed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SHARE, quantity_of
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.next.study import (
    NEAR_LINEAR,
    Model,
    least_gain,
    pairs_of,
    sequence_of,
    singles_of,
    steps_of,
)
from wm_drake.studies.proposal_page import LINE

MOST_NAMED = 4
"""Largest number of measurements that the answer names as not worth making."""

BLOCK = "What to measure next"
"""Heading of the block on the page of another study."""

GREEDY = (
    "The sequence is greedy: each step takes what then helps most. Two measurements that help only "
    "together are found by the pairs, which are all tried."
)


def next_answer(model: Model, budget: int, about: str) -> Answer:
    """Return the answer.

    Args:
        budget: Number of measurements of the sequence.
        about: Description of the file of candidates.
    """
    singles, steps = singles_of(model), steps_of(model, sequence_of(model, budget))
    pairs = pairs_of(model)
    machine = model.question.knowledge.machine.parameters
    return Answer(
        f"What to measure next of machine {machine.name}",
        f"{answer_text(steps)} {worthless_text(singles, steps)}".strip(),
        machine,
        (
            Part("Interval after each step", (*_plots(steps), _steps(steps)), GREEDY),
            Part("Candidates", (_singles(singles),)),
            Part("Pairs", (_pairs(pairs),), _pairs_text(pairs, steps)),
        ),
        (
            ("What is known", model.question.knowledge.about),
            ("Uncertain quantities", str(len(model.question.knowledge.names))),
            ("Candidates", about),
        ),
        short=Part("In short", facts=_facts(model)),
    )


def next_part(model: Model, budget: int, command: str) -> Part:
    """Return the block for the page of another study.

    Args:
        budget: Number of measurements that it names.
        command: Command of the whole study.
    """
    steps = steps_of(model, sequence_of(model, budget))
    table = replace(_steps(steps), name="next_steps", is_in_terminal=False)
    return Part(BLOCK, (table,), answer_text(steps), facts=[(LINE, command)])


def answer_text(steps: xr.Dataset) -> str:
    """Return each answer, the measurements, and each answer after them, in words."""
    names = steps.answer.values.tolist()
    words = steps.words.values.tolist()[1:]
    now = " ".join(f"{_now(steps.sel(answer=name))}." for name in names)
    if not words:
        return f"{now} No measurement of the file certainly narrows it."
    first, *others = words
    then = [_then(steps.sel(answer=name), len(names) > 1) for name in names]
    taken = f"{first}, then {listed(others)}" if others else first
    return f"{now} {taken[:1].upper()}{taken[1:]}: {listed(then)}."


def _now(one: xr.Dataset) -> str:
    quantity, value = quantity_of(one.value), one.value[0]
    name = quantity.words[:1].upper() + quantity.words[1:]
    return f"{name} {quantity.text(value)}, 95 % {_interval(one, 0)}"


def _then(one: xr.Dataset, is_named: bool) -> str:
    name = f"{quantity_of(one.value).words} " if is_named else ""
    return f"{name}95 % {_interval(one, -1)}"


def _interval(one: xr.Dataset, step: int) -> str:
    quantity = quantity_of(one.value)
    return f"{quantity.number(one.low[step])} to {quantity.text(one.high[step])}"


def worthless_text(singles: xr.Dataset, steps: xr.Dataset) -> str:
    """Return which measurements are not worth making; "" if all are.

    Of gains that come from drawn machines, those below twice their error are named. One that helps
    only after others, as a step, is not.
    """
    is_sampled = bool(singles.error.any())
    useless = (singles.gain < least_gain(singles.error)) & ~singles.candidate.isin(steps.words)
    words = singles.candidate.values[useless.values].tolist()
    words = list(dict.fromkeys(text.partition(" (±")[0] for text in words))
    if not words:
        return ""
    more = len(words) - MOST_NAMED
    named = ", ".join(words if more <= 0 else [*words[:MOST_NAMED], f"{more} more"])
    if is_sampled:
        return f"No gain that can be told from the scatter of the drawn machines: {named}."
    return f"Not worth measuring: {named}."


def _facts(model: Model) -> list[tuple[str, str]]:
    names = [response.name for response in model.question.answers]
    parts = zip(names, model.explained.tolist(), strict=True)
    explained = listed([f"{SHARE.text(part)} of the variance of {name}" for name, part in parts])
    how = (
        "so the intervals are those of the linear model, with the worst of all loads"
        if model.is_linear
        else f"which is less than {SHARE.text(NEAR_LINEAR)}: the intervals follow from how well "
        "the linear model estimates the answers of the drawn machines from their data; a fit can "
        "reach narrower ones, and more machines (--samples) show smaller gains"
    )
    return [
        ("Linear model", f"explains {explained} over {len(model.drawn)} drawn machines, {how}"),
    ]


def _steps(steps: xr.Dataset) -> LabelledTable:
    return LabelledTable(
        "steps",
        steps.assign(words=("step", ["what is known now", *steps.words.values[1:]])),
        "Interval after each step",
        "Value of the machine in the middle of what is known, and 95 % interval after each "
        "measurement, if it comes out as expected.",
        is_in_terminal=True,
    )


def _singles(singles: xr.Dataset) -> LabelledTable:
    return LabelledTable(
        "candidates",
        singles,
        "Candidates",
        "Each measurement alone: half the width of the 95 % interval after it, by how much it is "
        "narrower, with the standard error of drawn machines, the part of the variance that "
        "remains, and the gain per cost.",
        across="answer",
    )


def _pairs(pairs: xr.Dataset) -> LabelledTable:
    caption = "The best of all pairs of measurements."
    return LabelledTable("pairs", pairs, "Pairs", caption)


def _pairs_text(pairs: xr.Dataset, steps: xr.Dataset) -> str:
    """Return how the first two steps compare with the best pair."""
    greedy = steps.words.values[1:3].tolist()
    if not pairs.sizes["pair"] or len(greedy) < 2:
        return ""
    best = pairs.isel(pair=0)
    pair = [best["first"].item(), best["second"].item()]
    if set(pair) == set(greedy):
        return "The first two steps are the best of all pairs."
    return f"The best pair is {listed(pair)}; the first two steps are another one."


def _plots(steps: xr.Dataset) -> list[Plot]:
    return [_plot(steps.sel(answer=name)) for name in steps.answer.values.tolist()]


def _plot(one: xr.Dataset) -> Plot:
    """Return the interval of an answer after each step."""
    quantity, places = quantity_of(one.value), np.arange(one.sizes["step"])[::-1].astype(float)
    low, high, value = (quantity.values(one[name]) for name in ("low", "high", "value"))
    marks: list[fig.Mark] = [fig.segments((low, places), (high, places), width=5.0)]
    marks.append(fig.Points(value, places, size=9.0))
    for step, place in enumerate(places.tolist()):
        text = f"{_interval(one, step)}"
        marks.append(fig.Text(float(high[step]), place, text, across="left", shift=(10.0, 0.0)))
    if one.answer.item() == GAP:
        marks.append(fig.Rule(0.0, "y", color=fig.MARK))
    names = ["now", *(f"{k}. {w}" for k, w in enumerate(one.words.values[1:].tolist(), start=1))]
    reach = float(high.max() - low.min())
    x = fig.Axis(label=quantity.label, range=(None, float(high.max()) + 0.35 * reach))
    rows = (-0.5, len(names) - 0.5)
    y = fig.Axis(ticks=fig.named(names, places), range=rows, has_grid=False, has_line=False)
    figure = fig.Figure(panels=(fig.Panel(marks=tuple(marks), x=x, y=y),), height=44.0 * len(names))
    return Plot(
        figure,
        f"95 % interval of the {quantity.words}: {_interval(one, 0)} now, "
        f"{_interval(one, -1)} at the end.",
        "95 % interval after each measurement. Dot: the machine in the middle of what is known.",
    )
