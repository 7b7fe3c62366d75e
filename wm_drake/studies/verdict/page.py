"""Show the verdict: a page whose first screen is the answer."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from wm_drake.report import figure as fig
from wm_drake.report.formatting import shape_name
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import HIDDEN, SPEED, Quantity, of_measure, shown, text_of
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.proposal_page import LINE, costs_text, proposal_part, proposal_text
from wm_drake.studies.stops import stops_sentence
from wm_drake.studies.tolerance.page import masses_text
from wm_drake.studies.verdict.study import (
    FACTOR,
    SMALLEST_GAP,
    STATES,
    Judged,
    VerdictQuestion,
    proposal,
    smallest,
    words_of,
)

MOST_NAMED = 3
"""Number of quantities that the answer names."""

MOST_DRAWN = 12
"""Number of influences that the figure shows."""

HOW_OTHERS_DIFFER = (
    "'wm-drake spin' runs the loads of the machine only and shows the motion over time. 'wm-drake "
    "study tolerance' draws many more samples of laundry and parts, so that rare contact can be "
    "counted, and leaves the loads of the machine out. 'wm-drake study gasket' varies the gasket "
    "alone. Their smallest gaps differ for this reason."
)
"""How the commands that also show a smallest gap differ."""

LAUNDRY = "random laundry"

MACHINE_FAILS = "No change is proposed: a run of the machine as it is fails."

GAPS, DECIDES, CHANGES = "Smallest gaps", "What decides the gap", "What to change"
"""Headings of parts."""


def verdict_answer(judged: Judged) -> Answer:
    """Return the answer."""
    question, states, tried, laundry, _ = judged
    word = word_of(question, states, laundry)
    return Answer(
        f"Verdict on machine {question.machine.name}",
        answer(question, states, laundry),
        question.machine,
        (
            Part(GAPS, (_gaps_plot(question, states, laundry), *_laundry(laundry))),
            Part("Stops", (stops_table(states),) if "stop_hits" in states else ()),
            Part(DECIDES, influences_shown(question, states, tried)),
            _change_part(judged),
            Part("Each load", (loads_table(question, states),)),
            Part("Other commands with a smallest gap", text=HOW_OTHERS_DIFFER),
        ),
        tuple(_about_laundry(judged)),
        short=_short(judged),
        diverged=() if word == "clear" else (f"verdict: {word}",),
    )


def word_of(question: VerdictQuestion, states: xr.Dataset, laundry: xr.Dataset) -> str:
    """Return the verdict in one or two words."""
    least = min(smallest(states)[0].item(), laundry.smallest_gap[0].item())
    if least > question.clearance:
        return "clear"
    return "touches" if least <= 0.0 else "too near"


def answer(question: VerdictQuestion, states: xr.Dataset, laundry: xr.Dataset) -> str:
    """Return the answer in a sentence or two."""
    base, gap = states.isel(state=0), smallest(states)[0].item()
    at_stops = stops_sentence(base)
    nearest = base.isel(load=int(base.smallest_gap.fillna(-np.inf).argmin("load")))
    load = nearest["load"].item()
    if not np.isfinite(gap):
        return f"No verdict: the run of load {load} failed, which counts as contact."
    size = f"smallest gap {mm(gap)}" if gap > 0.0 else f"overlap of {mm(-gap)}"
    text = f"{size}, between {_pair(nearest)}, with load {load} at {SPEED.text(nearest.gap_speed)}."
    text = " ".join(filter(None, [text, at_stops]))
    if gap <= 0.0:
        return f"The tub touches the housing: {text}"
    gaps = laundry.gap[0].values
    if count := int(np.sum(gaps <= 0.0)):
        return (
            f"The tub touches the housing in {count} of {len(gaps)} runs with random laundry. With "
            f"the loads of the machine it does not: {text}"
        )
    opening = "The tub does not touch the housing"
    if word_of(question, states, laundry) != "clear":
        opening += f", but it comes nearer than {mm(question.clearance)}"
    return f"{opening}: {text}"


def _pair(run: xr.Dataset) -> str:
    """Return the shapes of the smallest gap of a run in words; "" if it has none."""
    number = run.nearest_pair.item()
    if not np.isfinite(number):
        return ""
    return " and ".join(map(shape_name, run["pair"].values[int(number)].split("|")))


def mm(value: float) -> str:
    """Return a length as text, without line breaks; of a failed run, that it failed. [m]"""
    if not np.isfinite(value):
        return "a failed run"
    return SMALLEST_GAP.text(value).replace(" ", "\u00a0")


def _short(judged: Judged) -> Part:
    """Return the part in short: how likely, what decides, what to change, what it costs."""
    question, states, tried, laundry, _ = judged
    made = proposal(question, states)
    rows = [("How likely", laundry_text(question, laundry.isel(state=0)))]
    gap = smallest(states)[0].item()
    if question.clearance and np.isfinite(gap):
        margin = gap - question.clearance
        kept = "more" if margin > 0.0 else "less"
        text = f"{mm(abs(margin))} {kept} than the clearance, {mm(question.clearance)}"
        rows.insert(0, ("Margin", text))
    if tried.sizes["key"]:
        rows.append(("What decides", _influences_text(tried.isel(key=slice(MOST_NAMED)))))
    text = proposal_text(made) if np.isfinite(gap) else MACHINE_FAILS
    rows.append(("What to change", text))
    if made.is_confirmed:
        words = {response.name: response.title for response in question.responses}
        rows.append(("What it costs", costs_text(made, words)))
        rows.append(("How likely then", laundry_text(question, laundry.isel(state=1))))
        rows.append((LINE, made.line_to_copy.item()))
    more = {
        "How likely": GAPS,
        "What decides": DECIDES,
        "What to change": CHANGES,
        "What it costs": CHANGES,
    }
    return Part("In short", facts=rows, more={word: more[word] for word, _ in rows if word in more})


def _change_part(judged: Judged) -> Part:
    """Return the part of the proposal: why, and the responses before and after."""
    question, states, tried, laundry, _ = judged
    words = {response.name: response.title for response in question.responses}
    has_run = np.isfinite(smallest(states)[0].item())
    why = why_text(question, tried) if has_run else MACHINE_FAILS
    part = proposal_part(proposal(question, states), why, words)
    numbers = numbers_of(question, states, word_of(question, states, laundry))
    tables = (*part.shown, LabelledTable("numbers", numbers))
    return Part(CHANGES, tables, why)


def _about_laundry(judged: Judged) -> list[tuple[str, str]]:
    """Return what the laundry is, and how its mass compares with that of the loads."""
    question, states, _, laundry, masses = judged
    loads, machine = states["load"].values.tolist(), question.machine
    rows = [("Laundry", f"{question.laundry}; {laundry.sizes['sample']} samples")]
    if masses and masses[1] < max(machine.loads[name].mass for name in loads):
        text = masses_text(machine, loads, masses)
        rows.append(("Its mass", f"{text} --laundry names a file with other laundry"))
    return rows


def why_text(question: VerdictQuestion, tried: xr.Dataset) -> str:
    """Return why a change is proposed, in a sentence."""
    keys = list(question.changes)
    if keys:
        return f"Smallest gap with each changed alone: {_influences_text(tried.sel(key=keys))}."
    change = FACTOR.text(question.change)
    return f"No change of parts by {change} makes the smallest gap clearly larger within the limit."


def laundry_text(question: VerdictQuestion, laundry: xr.Dataset) -> str:
    """Return probability and smallest gap of the samples."""
    clearance = question.clearance
    what = f"keep less than {mm(clearance)}" if clearance else "touch"
    gap = laundry.smallest_gap.item()
    least = f"smallest gap {mm(gap)}" if np.isfinite(gap) else "a run failed"
    return (
        f"{int(laundry['count']) or 'none'} of {laundry.sizes['sample']} runs with random laundry "
        f"{what}; probability {text_of(laundry.probability)} (95 % interval "
        f"{text_of(laundry.lower)} to {text_of(laundry.upper)}); {least}"
    )


def _influences_text(tried: xr.Dataset) -> str:
    """Return what more and less of numbers do to the gap."""
    each = zip(tried["key"].values.tolist(), smallest(tried).values.tolist(), strict=True)
    return "; ".join(
        f"{words_of(key)} ({mm(less)} with less, {mm(more)} with more)"
        for key, (less, more) in each
    )


def numbers_of(question: VerdictQuestion, states: xr.Dataset, word: str) -> xr.Dataset:
    """Return the verdict, the gap and what is wanted, as single values."""
    gap = smallest(states)[0].item()
    lengths = {
        "clearance": ("clearance", question.clearance),
        "smallest_gap": ("smallest gap of all loads", gap),
        "margin": ("margin", gap - question.clearance),
    }
    return xr.Dataset(
        {
            "verdict": ((), word),
            **{n: SMALLEST_GAP.named(w).variable((), v) for n, (w, v) in lengths.items()},
        }
    )


def loads_table(question: VerdictQuestion, states: xr.Dataset) -> LabelledTable:
    """Return gap, place and speed of each load, before and after the proposed change."""
    base, best = states.isel(state=0, drop=True), states.isel(state=-1)
    runs = [base.isel(load=at) for at in range(base.sizes["load"])]
    gaps = base.smallest_gap.fillna(-np.inf)
    data = xr.Dataset(
        {
            "between": ("load", [_pair(run) for run in runs]),
            "speed": SPEED.named("at").variable("load", base.gap_speed),
            "smallest_gap": SMALLEST_GAP.variable("load", gaps),
        },
        {"load": base["load"].values},
    )
    if states.sizes["state"] > 1:
        changed = SMALLEST_GAP.named(STATES[1])
        data["changed_gap"] = changed.variable("load", best.smallest_gap.fillna(-np.inf))
    return LabelledTable(
        "loads",
        data.assign(is_too_small=gaps.drop_attrs() <= question.clearance),
        "Smallest gap of each load",
        "Smallest gap between the parts that move with the tub and the housing. 0 and below: "
        "contact; the model has no contact forces but those of stops.",
        marked=("is_too_small", "alarm"),
        is_in_terminal=True,
    )


def stops_table(states: xr.Dataset) -> LabelledTable:
    """Return force, hits and velocity at each stop, with each load."""
    base = states.isel(state=0, drop=True)
    force = base.mount_force_peak.sel(mount=[f"elements.{name}" for name in base["stop"].values])
    data = xr.Dataset(
        {
            "force": of_measure("mount_force_peak").variable(("load", "stop"), force),
            "hits": of_measure("stop_hits").variable(("load", "stop"), base.stop_hits),
            "velocity": of_measure("stop_hit_velocity").variable(
                ("load", "stop"), base.stop_hit_velocity
            ),
        },
        {"load": base["load"].values, "stop": base["stop"].values},
    )
    caption = "Largest force, number of hits and largest velocity of a hit, of each stop."
    return LabelledTable("stops", data, "Stops", caption)


def _laundry(laundry: xr.Dataset) -> tuple[LabelledTable, LabelledTable]:
    """Return the samples and their probability of too small a gap; files have them."""
    before = laundry[["gap"]].isel(state=0, drop=True).rename(gap="smallest_gap")
    return (
        LabelledTable("laundry", before, is_in_json=False),
        LabelledTable("laundry_probability", laundry.drop_vars("gap")),
    )


def _gaps_plot(question: VerdictQuestion, states: xr.Dataset, laundry: xr.Dataset) -> Plot:
    """Return the gaps of the loads and of the laundry, before and after the proposed change."""
    styles = dict(zip(STATES[: laundry.sizes["state"]], (fig.OURS, fig.QUIET), strict=False))
    return Plot(
        gaps_figure(question.clearance, states, laundry, styles),
        f"Smallest gaps; the smallest one is {mm(smallest(states)[0].item())}.",
        "Smallest gap of each load of the machine, and of all samples of random laundry. Dashed: "
        "the clearance wanted.",
    )


def gaps_figure(
    clearance_size: float, states: xr.Dataset, laundry: xr.Dataset, styles: Mapping[str, str]
) -> fig.Figure:
    """Return the gaps of the loads and of the laundry, a line for each state.

    Args:
        clearance_size: Gap that must remain. [m]
        states, laundry: Smallest gaps over `state`. [m]
        styles: Colour of each state by its name.
    """
    names = [*states["load"].values.tolist(), LAUNDRY]
    clearance = SMALLEST_GAP.values(clearance_size).item()
    marks: list[fig.Mark] = [fig.Rule(0.0, "y", color=fig.MARK)]
    if clearance:
        marks.append(fig.Rule(clearance, "y", color=fig.MEASURED, dash="dashed"))
    largest = clearance
    apart = min(0.26, 0.8 / len(styles))
    shifts = apart * (0.5 * (len(styles) - 1) - np.arange(len(styles)))
    for state, (key, color) in enumerate(styles.items()):
        of_loads, of_laundry = states.smallest_gap[state].values, laundry.smallest_gap[state].item()
        sizes = np.array([*of_loads, of_laundry])
        gaps = SMALLEST_GAP.values(sizes)
        at = np.arange(len(gaps), dtype=float)[::-1] + shifts[state]
        known = np.isfinite(gaps)
        ends = (np.zeros(known.sum()), at[known]), (gaps[known], at[known])
        marks.append(fig.segments(*ends, color=color, width=4.0))
        marks.append(fig.Points(gaps[known], at[known], color=color, size=9.0, key=key))
        for gap, place in zip(sizes[known].tolist(), at[known].tolist(), strict=True):
            end, text = max(SMALLEST_GAP.values(gap).item(), 0.0), SMALLEST_GAP.text(gap)
            marks.append(fig.Text(end, place, text, across="left", shift=(10.0, 0.0)))
            largest = max(largest, end)
    y = fig.Axis(
        ticks=fig.named(names, np.arange(len(names))[::-1]), has_grid=False, has_line=False
    )
    x = fig.Axis(label=f"{SMALLEST_GAP.label} (0: the parts touch)", range=(None, 1.12 * largest))
    height = 23.0 * max(2, len(styles)) * len(names)
    return fig.Figure(panels=(fig.Panel(marks=tuple(marks), x=x, y=y),), height=height)


def influences_shown(
    question: VerdictQuestion, states: xr.Dataset, tried: xr.Dataset
) -> tuple[Plot, LabelledTable]:
    """Return the smallest gap of all loads with less and more of each part."""
    gaps, keys = smallest(tried), tried["key"].values.tolist()
    sides = {
        side: SMALLEST_GAP.named(f"gap with {side}").variable("key", gaps.sel(side=side))
        for side in ("less", "more")
    }
    drawn = {side: shown(xr.DataArray(column))[:MOST_DRAWN] for side, column in sides.items()}
    at = np.arange(len(drawn["less"]), dtype=float)[::-1]
    change = FACTOR.text(question.change)
    base = SMALLEST_GAP.values(smallest(states)[0]).item()
    less, more = drawn["less"], drawn["more"]
    marks = (
        fig.Rule(base, "y", color=fig.MARK),
        fig.segments((less, at), (more, at), color=fig.QUIET, width=3.0),
        fig.Points(less, at, color=fig.MEASURED, size=9.0, key=f"{change} less"),
        fig.Points(more, at, color=fig.OURS, size=9.0, key=f"{change} more"),
    )
    words = [words_of(key) for key in keys]
    panel = fig.Panel(
        marks=marks,
        x=fig.Axis(label=SMALLEST_GAP.named("smallest gap of all loads").label),
        y=fig.Axis(ticks=fig.named(words[:MOST_DRAWN], at), has_grid=False),
    )
    strongest = _influences_text(tried.isel(key=slice(MOST_NAMED)))
    plot = Plot(
        fig.Figure(panels=(panel,), height=28.0 * len(at) + 30.0),
        f"Influence of the parts. Strongest: {strongest}.",
        f"Smallest gap of all loads if one number of a part is {change} smaller or larger; line: "
        "the machine as it is. Springs, dampers, bushings, gasket and counterweights are tried; a "
        "curve of forces is scaled. influences.csv has all of them.",
    )
    data = xr.Dataset(
        {
            "quantity": ("key", words, Quantity("quantity").attributes()),
            **{f"gap_with_{side}": column for side, column in sides.items()},
            "why_not": ("key", tried.why_not.values, Quantity("why not proposed").attributes()),
        },
        {"key": ("key", keys, {HIDDEN: True})},
    )
    heading = "Changes that were tried, and why they are not proposed"
    caption = (
        f"Smallest gap of all loads with {change} less and more, and why the better side is not "
        "proposed; empty: part of the proposal. --limit, --effort and --only set what a change may "
        "cost and what may change."
    )
    return plot, LabelledTable("influences", data, heading, caption)
