"""Show the study of rings of balls: the answer in words, curves, tables, CSV and JSON."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters import MachineParameters
from wm_drake.report import figure as fig
from wm_drake.report.formatting import GM_PER_KGM, MM_PER_M, RPM_PER_RAD_S, number, plain
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.table import Column, Table, table_of
from wm_drake.report.terminal import Printed
from wm_drake.studies.balancer.study import (
    SWING,
    AmplitudeCurve,
    Pair,
    Release,
    is_within,
    picked_up_from,
)
from wm_drake.studies.study import Facts, Result

COLUMNS = {
    "mass_kg": Column("mass", "kg", 2),
    "place_mm": Column("place", "mm", 0),
    "unbalance_gm": Column("unbalance", "g\u00a0m", 0),
    "ball_mass_percent": Column("ball mass", "%", 0),
    "damping_percent": Column("race damping", "%", 0),
    "peak_free_mm": Column("largest, free", "mm", 1),
    "peak_locked_mm": Column("largest, locked", "mm", 1),
    "worst_quotient": Column("worst quotient", decimals=1),
    "worst_rpm": Column("at", "rpm", 0),
    "pays_from_rpm": Column("free balls pay from", "rpm", 0),
    "level_free_mm": Column("highest speed, free", "mm", 2),
    "level_locked_mm": Column("highest speed, locked", "mm", 2),
    "release_rpm": Column("released at", "rpm", 0),
    "after_free_mm": Column("largest after it, free", "mm", 1),
    "after_locked_mm": Column("largest after it, locked", "mm", 1),
}
"""Columns of the tables by their names in CSV files."""

MODEL = (
    "Free and locked balls have the same mass; locked ones are evenly spread around the drum and "
    "balance each other. Amplitudes are the largest of all sensors in ranges of 25 rpm of a run-up "
    "from standstill. Free balls pay from the speed on from which their amplitude is smaller up to "
    "the highest speed."
)
"""How the study compares."""


@dataclass(frozen=True)
class BalancerResult(Result):
    """Result of the study.

    Attributes:
        rate, high: Rate of the run-up, and its end. [rad/s^2, rad/s]
        loads: Over unbalance mass and place.
        base: The load of the other runs: the largest mass of `loads` that the balls can balance, in
            the middle of the places.
        rings: Over ball mass and damping, with the load of `base`.
        releases: At different speeds, with the load of `base`.
        plain: Curve of the load of `base` in the machine without rings.
        capacities: Largest first moment of the balls in each plane, by its place. [kg m, m]
        radius: Radius at which the unbalance lies. [m]
    """

    machine: MachineParameters
    rate: float
    high: float
    loads: tuple[Pair, ...]
    base: Pair
    rings: tuple[Pair, ...]
    releases: tuple[Release, ...]
    plain: AmplitudeCurve
    capacities: dict[float, float]
    radius: float
    runs: int

    @property
    def capacity(self) -> float:
        """Return the first moment of all balls, side by side. [kg m]"""
        return sum(self.capacities.values())

    def can_balance(self, pair: Pair) -> bool:
        """Return whether the balls in each plane can cancel the share of a load there."""
        return is_within(self.capacities, pair.mass * self.radius, pair.y)

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return loads, rings, releases, and the curves of the load with which rings are varied."""
        return {
            "loads": loads_frame(self),
            "rings": rings_frame(self),
            "releases": releases_frame(self),
            "curve": curve_frame(self),
        }

    def as_json(self) -> dict[str, Any]:
        """Return the findings for JSON."""
        shown = {
            "machine": self.machine.name,
            "rate_rpm_per_s": RPM_PER_RAD_S * self.rate,
            "highest_speed_rpm": RPM_PER_RAD_S * self.high,
            "capacity_gm": GM_PER_KGM * self.capacity,
            "picked_up_from_rpm": RPM_PER_RAD_S * picked_up_from(self.machine),
            "answer": answer(self),
            "lock_below_rpm": RPM_PER_RAD_S * lock_below(self),
            **{name: frame.to_dict("records") for name, frame in self.tables().items()},
            "runs": self.runs,
        }
        return plain(shown)

    def terminal(self) -> Printed:
        """Yield the answer, then the loads."""
        yield answer(self)
        for word, text in facts_of(self):
            yield f"{word}: {text}"
        yield loads_table(self).terminal("Free and locked balls")

    def page(self, facts: Facts) -> str:
        """Return the page."""
        made = [
            ("Machine", self.machine.name),
            ("Runs", f"{self.runs} in {facts.wall_s:.0f} s"),
            ("Run-up", f"{number(RPM_PER_RAD_S * self.rate, 0)} rpm/s to {_rpm(self.high)}"),
            *facts.rows(),
        ]
        return SectionedPage(
            f"Rings of balls of machine {self.machine.name}",
            answer(self),
            [
                Section("curve", "Over the drum speed", (curve_picture(self),)),
                Section("loads", "Unbalance and its place", (loads_picture(self),)),
                Section("rings", "Mass of the balls and damping", (rings_picture(self),)),
                Section("each", "Each load", tables=(loads_table(self),)),
                Section("each-ring", "Each ball mass and damping", tables=(rings_table(self),)),
                Section("releases", "Release of locked balls", tables=(releases_table(self),)),
            ],
            made,
            self.machine,
            facts.warnings,
            method=MODEL,
            advice=Section("answer", "In short", facts=facts_of(self)),
        ).html()

    def failures(self) -> list[str]:
        """Return a line for each pair with a run that diverged."""
        return [
            f"{_load(pair)}: a run diverged"
            for pair in (*self.loads, *self.rings)
            if not np.isfinite([pair.free.level, pair.locked.level]).all()
        ]


def lock_below(f: BalancerResult) -> float:
    """Return the speed from which free balls pay with each load that they can balance. [rad/s]

    It is NaN if they do not pay with one of them, or can balance none.
    """
    speeds = [pair.pays_from for pair in f.loads if f.can_balance(pair)]
    return max(speeds) if speeds and np.isfinite(speeds).all() else float("nan")


def answer(f: BalancerResult) -> str:
    """Return the answer in a few sentences."""
    hurt = [pair for pair in f.loads if pair.free.peak > pair.locked.peak]
    pays = [pair for pair in f.loads if pair.free.level < pair.locked.level]
    high, count = _rpm(f.high), len(f.loads)
    base = f.base
    sentences = [
        f"At {high}, free balls lower the amplitude with {len(pays)} of {count} loads: with "
        f"{_load(base)} from {_mm(base.locked.level)} to {_mm(base.free.level)}."
    ]
    if hurt:
        worst = max(hurt, key=lambda pair: pair.free.peak - pair.locked.peak)
        sentences.append(
            f"In the run-up they hurt: with {len(hurt)} of {count} loads the largest amplitude is "
            f"larger, with {_load(worst)} {_mm(worst.free.peak)} in place of "
            f"{_mm(worst.locked.peak)}."
        )
    else:
        sentences.append("In the run-up they make the largest amplitude larger with none of them.")
    speed = lock_below(f)
    if np.isfinite(speed):
        sentences.append(
            f"Lock the balls below {_rpm(speed)} and release them there: from there on free balls "
            "have the smaller amplitude with every load that they can balance."
        )
    else:
        sentences.append("No speed to release them suits every load that they can balance.")
    return " ".join(sentences)


def facts_of(f: BalancerResult) -> list[tuple[str, str]]:
    """Return the rest of the answer as pairs of word and text."""
    worst = max(f.loads, key=lambda pair: pair.worst[0])
    quotient, speed = worst.worst
    rows = [
        ("Worst", f"{number(quotient)} times as much at {_rpm(speed)}, with {_load(worst)}"),
        ("Picked up", _pick_up_text(f)),
        ("Capacity", _capacity_text(f)),
        ("Mass of the balls, damping", _rings_text(f)),
    ]
    if f.releases:
        rows.append(("Release", _release_text(f)))
    change = 100.0 * (f.plain.peak / f.base.locked.peak - 1.0)
    rows.append(
        (
            "Without rings",
            f"largest amplitude {_mm(f.plain.peak)} with {_load(f.base)}, {number(change)} % "
            f"from that of locked balls; at {_rpm(f.high)} {_mm(f.plain.level)}",
        )
    )
    return rows


def _pick_up_text(f: BalancerResult) -> str:
    """Return from which speed the drum carries the balls round, and what that means."""
    speed = picked_up_from(f.machine)
    if not np.isfinite(speed):
        return "the races have no damping, so no drag carries the balls round"
    text = f"the drum carries the balls round from {_rpm(speed)} (m g R/d)"
    peak = f.base.locked.peak_speed
    if speed < peak:
        return (
            f"{text}, below the resonance at {_rpm(peak)}, where they add to the unbalance; less "
            "damping picks them up later"
        )
    return f"{text}, above the resonance at {_rpm(peak)}"


def _capacity_text(f: BalancerResult) -> str:
    """Return what the balls can balance, and what is beyond it."""
    heaviest = f.capacity / f.radius
    text = f"{number(GM_PER_KGM * f.capacity, 0)} g m, that of {number(heaviest, 2)} kg at the wall"
    beyond = [pair for pair in f.loads if not f.can_balance(pair)]
    if not beyond:
        return f"{text}; no load is beyond it in the plane of a ring"
    levels = [pair.free.level for pair in beyond]
    return (
        f"{text}; beyond it, in the plane of a ring, are {len(beyond)} of {len(f.loads)} loads, of "
        f"which {_mm(min(levels))} to {_mm(max(levels))} remain at {_rpm(f.high)}"
    )


HARMLESS = 1.02
"""Largest amplitude with free balls over that with locked ones, up to which they do not hurt."""


def _rings_text(f: BalancerResult) -> str:
    """Return which variants of the rings pay at the highest speed and do not hurt in the run-up."""
    paying = [pair for pair in f.rings if pair.free.level < pair.locked.level]
    if not paying:
        return "no variant lowers the amplitude at the highest speed"
    calm = min(pair.free.level for pair in paying)
    good = [
        pair
        for pair in paying
        if pair.free.peak <= HARMLESS * pair.locked.peak and pair.free.level <= 2.0 * calm
    ]
    if not good:
        mildest = min(paying, key=lambda pair: pair.free.peak)
        return f"every variant that pays hurts; least {_ring(mildest)}, {_mm(mildest.free.peak)}"
    best = min(good, key=lambda pair: pair.pays_from)
    return (
        f"{len(good)} of {len(f.rings)} variants do not hurt in the run-up and balance the load at "
        f"{_rpm(f.high)}; of them {_ring(best)} pays from {_rpm(best.pays_from)} on, with "
        f"{_mm(best.free.peak)} in the run-up"
    )


def _release_text(f: BalancerResult) -> str:
    """Return the lowest release after which free balls are never worse than locked ones."""
    good = [r.free <= r.locked and r.free_level < r.locked_level for r in f.releases]
    if not good[-1]:
        return "none of the tried releases is without a larger amplitude than that of locked balls"
    bad = [at for at, is_good in enumerate(good) if not is_good]
    first = f.releases[bad[-1] + 1 if bad else 0]
    return (
        f"at {_rpm(first.speed)} or above, in runs that begin there: {_mm(first.free)} at most, "
        f"locked {_mm(first.locked)}"
    )


def _mm(value: float) -> str:
    """Return a length as text; `value` in m."""
    decimals = 1 if value >= 1e-3 else 2
    return f"{number(MM_PER_M * value, decimals)}\u00a0mm"


def _rpm(value: float) -> str:
    """Return a speed as text; `value` in rad/s."""
    return f"{number(RPM_PER_RAD_S * value, 0)}\u00a0rpm"


def _load(pair: Pair) -> str:
    return f"{pair.mass:g} kg at {number(MM_PER_M * pair.y, 0)} mm"


def _ring(pair: Pair) -> str:
    return f"{100.0 * pair.ball_mass:g} % ball mass and {100.0 * pair.damping:g} % damping"


def _numbers(pair: Pair) -> dict[str, float]:
    """Return the numbers of a pair by column."""
    quotient, speed = pair.worst
    pays_from = pair.pays_from
    return {
        "peak_free_mm": MM_PER_M * pair.free.peak,
        "peak_locked_mm": MM_PER_M * pair.locked.peak,
        "worst_quotient": quotient,
        "worst_rpm": RPM_PER_RAD_S * speed,
        "pays_from_rpm": RPM_PER_RAD_S * pays_from if np.isfinite(pays_from) else np.nan,
        "level_free_mm": MM_PER_M * pair.free.level,
        "level_locked_mm": MM_PER_M * pair.locked.level,
    }


def loads_frame(f: BalancerResult) -> pd.DataFrame:
    """Return the numbers of each load."""
    return pd.DataFrame(
        [
            {
                "mass_kg": pair.mass,
                "place_mm": MM_PER_M * pair.y,
                "unbalance_gm": GM_PER_KGM * pair.mass * f.radius,
                **_numbers(pair),
            }
            for pair in f.loads
        ]
    )


def rings_frame(f: BalancerResult) -> pd.DataFrame:
    """Return the numbers of each ball mass and damping."""
    return pd.DataFrame(
        [
            {
                "ball_mass_percent": 100.0 * pair.ball_mass,
                "damping_percent": 100.0 * pair.damping,
                **_numbers(pair),
            }
            for pair in f.rings
        ]
    )


def releases_frame(f: BalancerResult) -> pd.DataFrame:
    """Return the amplitudes after each release."""
    return pd.DataFrame(
        [
            {
                "release_rpm": RPM_PER_RAD_S * r.speed,
                "after_free_mm": MM_PER_M * r.free,
                "after_locked_mm": MM_PER_M * r.locked,
                "level_free_mm": MM_PER_M * r.free_level,
                "level_locked_mm": MM_PER_M * r.locked_level,
            }
            for r in f.releases
        ]
    )


def curve_frame(f: BalancerResult) -> pd.DataFrame:
    """Return amplitude over speed of the load with which rings are varied."""
    return pd.DataFrame(
        {
            "from_rpm": RPM_PER_RAD_S * f.base.free.speeds,
            "free_mm": MM_PER_M * f.base.free.amplitudes,
            "locked_mm": MM_PER_M * f.base.locked.amplitudes,
            "without_rings_mm": MM_PER_M * f.plain.amplitudes,
        }
    )


def loads_table(f: BalancerResult) -> Table:
    """Return the numbers of each load."""
    caption = (
        "Each unbalance with free and with locked balls: largest amplitude of the run-up, largest "
        "quotient of free over locked with its speed, speed from which free balls pay, amplitude "
        "at the highest speed."
    )
    return table_of(loads_frame(f), caption, COLUMNS, _alarms(f.loads))


def rings_table(f: BalancerResult) -> Table:
    """Return the numbers of each ball mass and damping."""
    caption = f"The same with {_load(f.base)}, over ball mass and race damping in parts of the file"
    return table_of(rings_frame(f), f"{caption}.", COLUMNS, _alarms(f.rings))


def releases_table(f: BalancerResult) -> Table:
    """Return the amplitudes after each release."""
    caption = (
        f"Runs with {_load(f.base)} that begin at a speed, with the balls evenly spread, as if "
        f"they were locked before: largest amplitude from {SWING:g} s on, and at the highest "
        "speed. The tub starts at rest; its first swing is left out."
    )
    kinds = ["alarm" if r.free > r.locked else "" for r in f.releases]
    return table_of(releases_frame(f), caption, COLUMNS, kinds)


def _alarms(pairs: Sequence[Pair]) -> list[str]:
    return ["alarm" if not pair.free.level < pair.locked.level else "" for pair in pairs]


def curve_picture(f: BalancerResult) -> Picture:
    """Return amplitude over speed of the load with which rings are varied."""
    marks: list[fig.Mark] = []
    for name, curve, color in (
        ("free balls", f.base.free, fig.OURS),
        ("locked balls", f.base.locked, fig.MEASURED),
    ):
        marks.append(_line(curve, color=color, key=name))
    marks.append(_line(f.plain, color=fig.QUIET, key="without rings", dash="dashed"))
    if np.isfinite(f.base.pays_from):
        at = RPM_PER_RAD_S * f.base.pays_from
        marks.append(
            fig.Rule(at, "y", dash="dotted", color=fig.QUIET, key="free balls pay from here")
        )
    panel = fig.Panel(
        marks=tuple(marks),
        x=fig.Axis(label="drum speed, rpm"),
        y=fig.Axis(label="amplitude, mm", is_log=True),
    )
    caption = (
        f"Largest amplitude of all sensors in ranges of 25 rpm of the run-up, with {_load(f.base)}."
    )
    free, held = f.base.free, f.base.locked
    words = (
        f"Free balls: largest amplitude {_mm(free.peak)} at {_rpm(free.peak_speed)}; locked "
        f"balls: {_mm(held.peak)} at {_rpm(held.peak_speed)}."
    )
    return picture(fig.Figure(panels=(panel,), height=340.0), words, caption)


def _line(curve: AmplitudeCurve, **style: Any) -> fig.Line:
    return fig.Line(RPM_PER_RAD_S * curve.speeds, MM_PER_M * curve.amplitudes, **style)


QUANTITIES: tuple[tuple[str, Callable[[AmplitudeCurve], float]], ...] = (
    ("largest amplitude of the run-up, mm", lambda curve: curve.peak),
    ("amplitude at the highest speed, mm", lambda curve: curve.level),
)
"""Panels of the pictures over loads and rings."""


def loads_picture(f: BalancerResult) -> Picture:
    """Return both amplitudes over the place of the unbalance, a line for each mass."""
    panels = []
    for label, value in QUANTITIES:
        marks: list[fig.Mark] = []
        for index, mass in enumerate(dict.fromkeys(pair.mass for pair in f.loads)):
            of_mass = [pair for pair in f.loads if pair.mass == mass]
            places = [MM_PER_M * pair.y for pair in of_mass]
            color = fig.COLOURS[index % len(fig.COLOURS)]
            styles: tuple[tuple[str, fig.Dash], ...] = (("free", ""), ("locked", "dashed"))
            for name, dash in styles:
                sizes = [MM_PER_M * value(getattr(pair, name)) for pair in of_mass]
                key = f"{mass:g} kg, {name}"
                marks.append(
                    fig.Line(places, sizes, color=color, dash=dash, symbol="circle", key=key)
                )
        x = fig.Axis(label="place of the unbalance along the drum, mm")
        y = fig.Axis(label=label, is_log=label == QUANTITIES[1][0])
        panels.append(fig.Panel(marks=tuple(marks), x=x, y=y))
    caption = (
        "Over the place of the unbalance, to the rear from mid-depth of the drum. Where a full "
        "line is above the dashed one of its colour, free balls hurt."
    )
    hurt = sum(pair.free.peak > pair.locked.peak for pair in f.loads)
    words = f"Free balls make the largest amplitude larger with {hurt} of {len(f.loads)} loads."
    return picture(fig.Figure(panels=fig.in_grid(panels, 2), height=320.0), words, caption)


def rings_picture(f: BalancerResult) -> Picture:
    """Return both amplitudes and the speed of release over damping, a line for each ball mass."""
    panels = []
    masses = list(dict.fromkeys(pair.ball_mass for pair in f.rings))
    values: list[tuple[str, Callable[[Pair], float]]] = [
        (label, lambda pair, value=value: MM_PER_M * value(pair.free))  # type: ignore[misc]
        for label, value in QUANTITIES
    ]
    values.append(("free balls pay from, rpm", lambda pair: RPM_PER_RAD_S * pair.pays_from))
    for label, read in values:
        marks: list[fig.Mark] = []
        for index, mass in enumerate(masses):
            of_mass = [pair for pair in f.rings if pair.ball_mass == mass]
            x = [100.0 * pair.damping for pair in of_mass]
            y = np.array([read(pair) for pair in of_mass])
            y[~np.isfinite(y)] = np.nan
            color, key = fig.COLOURS[index % len(fig.COLOURS)], f"ball mass {100.0 * mass:g} %"
            marks.append(fig.Line(x, y, color=color, symbol="circle", key=key))
        y_axis = fig.Axis(label=label, is_log=label == QUANTITIES[1][0])
        x_axis = fig.Axis(label="race damping, %", is_log=True)
        panels.append(fig.Panel(marks=tuple(marks), x=x_axis, y=y_axis))
    caption = (
        f"With {_load(f.base)}, over the damping of the races and the mass of the balls, in parts "
        "of the machine file. A point is missing where free balls do not pay."
    )
    return picture(fig.Figure(panels=fig.in_grid(panels, 3), height=300.0), _rings_text(f), caption)
