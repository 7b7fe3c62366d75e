"""Show the study of balancers: the answer in words, curves and tables."""

from collections.abc import Callable, Mapping

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters
from wm_drake.report import chart
from wm_drake.report import figure as fig
from wm_drake.report.formatting import listed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SPEED, Quantity, shown, text_of
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.balancer.candidates import RESPONSES, WORDS
from wm_drake.studies.balancer.study import (
    AMPLITUDE,
    BALL_MASS,
    DAMPING,
    LEVEL,
    PAYS_FROM,
    PEAK,
    PLACE,
    SWING,
    base_of,
)
from wm_drake.studies.proposal_page import proposal_part, proposal_text

MODEL = (
    "The machine without a balancer, with rings of balls and with rings of liquid runs up with the "
    "same loads; what is fitted may raise no response of the worst load by more than 10 %. Free "
    "and locked balls have the same mass; locked ones are evenly spread around the drum and "
    "balance each other. Amplitudes are the largest of all sensors in ranges of 25 rpm of a run-up "
    "from standstill. Free balls pay from the speed on from which their amplitude is smaller up to "
    "the highest speed."
)
"""How the study compares."""


def balancer_answer(
    parameters: MachineParameters, data: Mapping[str, xr.Dataset], runs: xr.DataArray
) -> Answer:
    """Return the answer of the study.

    Args:
        data: `numbers`, as of `numbers_of` in `wm_drake.studies.balancer.study`; `loads`, as of
            `BalancerTrials.loads` there, with the amplitudes `without_rings` and `liquid` of the
            load with which rings are varied; `rings` and `releases`, as of the methods there;
            `lags` and `proposal`, as of `by_lag` and `candidate_proposal` in
            `wm_drake.studies.balancer.candidates`.
        runs: As of `responses_of` there.
    """
    numbers, loads, rings, releases = (
        data[name] for name in ("numbers", "loads", "rings", "releases")
    )
    base, proposal = base_of(loads), data["proposal"]
    load, curve = load_text(base), base[["free", "locked", "without_rings", "liquid"]]
    parts = (
        Part("Over the drum speed", (curve_plot(base), LabelledTable("curve", curve))),
        Part("Unbalance and its place", (loads_plot(loads),)),
        Part("Mass of the balls and damping", (rings_plot(loads, rings, numbers),)),
        Part("Which balancer to fit", (_candidates_table(runs),)),
        Part("Lag of the liquid", (_lags_table(data["lags"], load),)),
        Part("Each load", (_loads_table(loads),)),
        Part("Each ball mass and damping", (_rings_table(rings, load),)),
        Part(
            "Release of locked balls",
            (_releases_table(releases, load), LabelledTable("numbers", numbers)),
        ),
    )
    return Answer(
        f"Balancers of machine {parameters.name}",
        f"{proposal_text(proposal, MACHINE)} {summary(numbers, loads)}",
        parameters,
        parts,
        (("Run-up", f"{text_of(numbers.rate)} to {text_of(numbers.highest_speed)}"),),
        MODEL,
        short=proposal_part(
            proposal,
            why(runs),
            {name: quantity.words for name, quantity in RESPONSES.items()},
            facts_of(numbers, loads, rings, releases),
            machine=MACHINE,
        ),
        diverged=diverged(loads, rings, releases),
    )


WORSE = ("is_larger_at_highest_speed", "alarm")
"""Mark of a row in which the balls do harm at the highest speed."""


def _loads_table(loads: xr.Dataset) -> LabelledTable:
    return LabelledTable(
        "loads",
        loads.drop_dims("from"),
        "Free and locked balls",
        "Each unbalance with free and with locked balls: largest amplitude of the run-up, largest "
        "quotient of free over locked with its speed, speed from which free balls pay, amplitude "
        "at the highest speed.",
        marked=WORSE,
        is_in_terminal=True,
    )


def _rings_table(rings: xr.Dataset, load: str) -> LabelledTable:
    caption = f"The same with {load}, over ball mass and race damping in parts of the file."
    return LabelledTable("rings", rings, "Rings", caption, marked=WORSE)


def _releases_table(releases: xr.Dataset, load: str) -> LabelledTable:
    return LabelledTable(
        "releases",
        releases,
        "Releases",
        f"Runs with {load} that begin at a speed, with the balls evenly spread, as if they were "
        f"locked before: largest amplitude from {SWING:g} s on, and at the highest speed. The tub "
        "starts at rest; its first swing is left out.",
        marked=("is_larger", "alarm"),
    )


def _candidates_table(runs: xr.DataArray) -> LabelledTable:
    of_candidates = xr.Dataset(
        {
            name: quantity.variable(("load", "candidate"), runs.sel(response=name).values.T)
            for name, quantity in RESPONSES.items()
        },
        {"load": runs["load"].values, "candidate": runs.candidate.values},
    )
    return LabelledTable(
        "candidates",
        of_candidates,
        "Which balancer",
        "Each load without a balancer, with free balls and with liquid.",
        across="candidate",
        words=WORDS,
    )


def _lags_table(lags: xr.Dataset, load: str) -> LabelledTable:
    return LabelledTable(
        "lags",
        lags,
        "Liquid by its lag",
        f"Rings of liquid with {load}, over their lag: how fast baffles and walls stop liquid that "
        "moves against the drum. It is not published for any ring, so these amplitudes are the "
        "range of what the liquid may do.",
    )


MACHINE = "the machine without a balancer"
"""What the candidates are compared with, in words."""


def why(runs: xr.DataArray) -> str:
    """Return both responses of each candidate, of its worst load, in a sentence."""
    texts = []
    for name, quantity in RESPONSES.items():
        worst = runs.sel(response=name).max("load", skipna=False)
        sizes = [
            f"{quantity.text(worst.sel(candidate=one))} with {WORDS[one]}"
            for one in runs.candidate.values.tolist()
        ]
        texts.append(f"{quantity.words}: {listed(sizes)}")
    return f"of the worst load, {'; '.join(texts)}"


def diverged(loads: xr.Dataset, rings: xr.Dataset, releases: xr.Dataset) -> tuple[str, ...]:
    """Return a line for each pair of runs of which one diverged."""
    names: tuple[tuple[xr.Dataset, Callable[[xr.Dataset], str]], ...] = (
        (loads, load_text),
        (rings, _ring),
        (releases, lambda run: f"release at {text_of(run.release)}"),
    )
    return tuple(
        f"{name(run)}: a run diverged"
        for data, name in names
        for run in _runs(data)
        if not np.isfinite([run.level_free.item(), run.level_locked.item()]).all()
    )


def summary(numbers: xr.Dataset, loads: xr.Dataset) -> str:
    """Return the answer in a few sentences."""
    hurt = loads.isel(run=(loads.peak_free > loads.peak_locked).values)
    pays = loads.isel(run=~loads.is_larger_at_highest_speed.values)
    count, base = loads.sizes["run"], base_of(loads)
    sentences = [
        f"At {text_of(numbers.highest_speed)}, free balls lower the amplitude with "
        f"{pays.sizes['run']} of {count} loads: with {load_text(base)} from "
        f"{_size(base.level_locked)} to {_size(base.level_free)}."
    ]
    if hurt.sizes["run"]:
        worst = hurt.isel(run=int(np.nan_to_num(hurt.peak_free - hurt.peak_locked).argmax()))
        sentences.append(
            f"In the run-up they hurt: with {hurt.sizes['run']} of {count} loads the largest "
            f"amplitude is larger, with {load_text(worst)} {_size(worst.peak_free)} in place of "
            f"{_size(worst.peak_locked)}."
        )
    else:
        sentences.append("In the run-up they make the largest amplitude larger with none of them.")
    if numbers.lock_below.notnull():
        sentences.append(
            f"Lock the balls below {text_of(numbers.lock_below)} and release them there: from "
            "there on free balls have the smaller amplitude with every load that they can balance."
        )
    else:
        sentences.append("No speed to release them suits every load that they can balance.")
    return " ".join(sentences)


def facts_of(
    numbers: xr.Dataset, loads: xr.Dataset, rings: xr.Dataset, releases: xr.Dataset
) -> list[tuple[str, str]]:
    """Return the rest of the answer as pairs of word and text."""
    worst = loads.isel(run=int(loads.worst_quotient.fillna(-1.0).values.argmax()))
    base, peak = base_of(loads), numbers.peak_without_rings
    change = Quantity("", BALL_MASS.unit, 1).text(peak / base.peak_locked - 1.0)
    return [
        (
            "Worst",
            f"{text_of(worst.worst_quotient)} times as much at {text_of(worst.worst)}, with "
            f"{load_text(worst)}",
        ),
        ("Picked up", _pick_up_text(numbers, loads)),
        ("Capacity", _capacity_text(numbers, loads)),
        ("Mass of the balls, damping", _rings_text(rings, numbers)),
        ("Release", _release_text(releases)),
        (
            "Without rings",
            f"largest amplitude {text_of(peak)} with {load_text(base)}, {change} from that of "
            f"locked balls; at {text_of(numbers.highest_speed)} "
            f"{text_of(numbers.level_without_rings)}",
        ),
    ]


def _pick_up_text(numbers: xr.Dataset, loads: xr.Dataset) -> str:
    """Return from which speed the drum carries the balls round, and what that means."""
    speed = numbers.picked_up_from
    if not np.isfinite(speed):
        return "the races have no damping, so no drag carries the balls round"
    text = f"the drum carries the balls round from {text_of(speed)} (m g R/d)"
    peak = _speed_of_peak(base_of(loads).locked)
    if speed < peak:
        return (
            f"{text}, below the resonance at {SPEED.text(peak)}, where they add to the unbalance; "
            "less damping picks them up later"
        )
    return f"{text}, above the resonance at {SPEED.text(peak)}"


def _capacity_text(numbers: xr.Dataset, loads: xr.Dataset) -> str:
    """Return what the balls can balance, and what is beyond it."""
    text = f"{text_of(numbers.capacity)}, that of {text_of(numbers.heaviest)} at the wall"
    beyond = loads.isel(run=~loads.is_within_capacity.values)
    if not beyond.sizes["run"]:
        return f"{text}; no load is beyond it in the plane of a ring"
    levels = beyond.level_free
    return (
        f"{text}; beyond it, in the plane of a ring, are {beyond.sizes['run']} of "
        f"{loads.sizes['run']} loads, of which {_size(levels.min())} to {_size(levels.max())} "
        f"remain at {text_of(numbers.highest_speed)}"
    )


HARMLESS = 1.02
"""Largest amplitude with free balls over that with locked ones, up to which they do not hurt."""


def _rings_text(rings: xr.Dataset, numbers: xr.Dataset) -> str:
    """Return which variants of the rings pay at the highest speed and do not hurt in the run-up."""
    paying = rings.isel(run=~rings.is_larger_at_highest_speed.values)
    if not paying.sizes["run"]:
        return "no variant lowers the amplitude at the highest speed"
    good = paying.isel(
        run=(
            (paying.peak_free <= HARMLESS * paying.peak_locked)
            & (paying.level_free <= 2.0 * paying.level_free.min())
        ).values
    )
    if not good.sizes["run"]:
        mildest = paying.isel(run=int(paying.peak_free.values.argmin()))
        return f"every variant that pays hurts; least {_ring(mildest)}, {_size(mildest.peak_free)}"
    best = good.isel(run=int(good.pays_from.fillna(np.inf).values.argmin()))
    return (
        f"{good.sizes['run']} of {rings.sizes['run']} variants do not hurt in the run-up and "
        f"balance the load at {text_of(numbers.highest_speed)}; of them {_ring(best)} pays from "
        f"{text_of(best.pays_from)} on, with {_size(best.peak_free)} in the run-up"
    )


def _release_text(releases: xr.Dataset) -> str:
    """Return the lowest release after which free balls are never worse than locked ones."""
    good = ~releases.is_larger & (releases.level_free < releases.level_locked)
    bad = np.flatnonzero(~good)
    first = bad[-1] + 1 if len(bad) else 0
    if first == releases.sizes["run"]:
        return "none of the tried releases is without a larger amplitude than that of locked balls"
    release = releases.isel(run=first)
    return (
        f"at {text_of(release.release)} or above, in runs that begin there: "
        f"{_size(release.after_free)} at most, locked {_size(release.after_locked)}"
    )


def _size(amplitude: xr.DataArray) -> str:
    """Return an amplitude as text, with the digits of a sentence."""
    return AMPLITUDE.text(amplitude)


def _speed_of_peak(curve: xr.DataArray) -> float:
    """Return the begin of the range of speed with the largest amplitude of a curve. [rad/s]"""
    return float(curve["from"][int(curve.values.argmax())])


def _runs(data: xr.Dataset) -> list[xr.Dataset]:
    return [data.isel(run=run) for run in range(data.sizes["run"])]


def load_text(load: xr.Dataset) -> str:
    """Return a load in words: mass and place."""
    return f"{text_of(load.mass)} at {text_of(load.place)}"


def _ring(ring: xr.Dataset) -> str:
    return f"{text_of(ring.ball_mass)} ball mass and {text_of(ring.damping)} damping"


def curve_plot(base: xr.Dataset) -> Plot:
    """Return amplitude over speed of the load with which rings are varied."""
    styles = {
        "free": {"key": "free balls"},
        "locked": {"key": "locked balls", "color": fig.MEASURED},
        "without_rings": {"key": "without rings", "color": fig.QUIET, "dash": "dashed"},
        "liquid": {"key": "liquid", "color": fig.COLOURS[2]},
    }
    pays: list[fig.Mark] = []
    if base.pays_from.notnull():
        at, key = shown(base.pays_from).item(), "free balls pay from here"
        pays.append(fig.Rule(at, "y", dash="dotted", color=fig.QUIET, key=key))
    x, y = {"label": SPEED.label}, {"label": AMPLITUDE.label, "is_log": True}
    panel = chart.between((), chart.panel(base, "from", styles, x=x, y=y), *pays)
    peaks = [
        f"{_size(base[f'peak_{name}'])} at {SPEED.text(_speed_of_peak(base[name]))}"
        for name in ("free", "locked")
    ]
    return Plot(
        fig.Figure(panels=(panel,), height=340.0),
        f"Free balls: largest amplitude {peaks[0]}; locked balls: {peaks[1]}.",
        "Largest amplitude of all sensors in ranges of 25 rpm of the run-up, with "
        f"{load_text(base)}.",
    )


def loads_plot(loads: xr.Dataset) -> Plot:
    """Return both amplitudes over the place of the unbalance, a line for each mass."""
    x = {"label": PLACE.named("place of the unbalance along the drum").label}
    panels = [
        chart.panel(
            loads,
            "place",
            {f"{name}_free": {}, f"{name}_locked": {"dash": "dashed"}},
            by="mass",
            key=lambda of, line: f"{text_of(of.mass[0])}, {line.split('_')[1]}",
            symbol="circle",
            x=x,
            y={"label": quantity.label, "is_log": quantity is LEVEL},
        )
        for name, quantity in (("peak", PEAK), ("level", LEVEL))
    ]
    hurt = int((loads.peak_free > loads.peak_locked).sum())
    return Plot(
        fig.Figure(panels=fig.in_grid(panels, 2), height=320.0),
        f"Free balls make the largest amplitude larger with {hurt} of {loads.sizes['run']} loads.",
        "Over the place of the unbalance, to the rear from mid-depth of the drum. Where a full "
        "line is above the dashed one of its colour, free balls hurt.",
    )


def rings_plot(loads: xr.Dataset, rings: xr.Dataset, numbers: xr.Dataset) -> Plot:
    """Return both amplitudes and the speed of release over damping, a line for each ball mass."""
    shown_rings = rings.where(np.isfinite(rings[["peak_free", "level_free", "pays_from"]]))
    panels = [
        chart.panel(
            shown_rings.assign({name: rings[name] for name in ("ball_mass", "damping")}),
            "damping",
            [name],
            by="ball_mass",
            key=lambda of, _: f"ball mass {text_of(of.ball_mass[0])}",
            symbol="circle",
            x={"label": DAMPING.label, "is_log": True},
            y={"label": quantity.label, "is_log": quantity is LEVEL},
        )
        for name, quantity in (("peak_free", PEAK), ("level_free", LEVEL), ("pays_from", PAYS_FROM))
    ]
    return Plot(
        fig.Figure(panels=fig.in_grid(panels, 3), height=300.0),
        _rings_text(rings, numbers),
        f"With {load_text(base_of(loads))}, over the damping of the races and the mass of the "
        "balls, in parts of the machine file. A point is missing where free balls do not pay.",
    )
