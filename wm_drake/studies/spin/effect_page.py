"""Effect of the gasket on the page of a comparison: amplitudes, steady state, records."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from wm_drake.report.figure import MEASURED, OURS, QUIET, Axis, Figure, Line, Mark, Panel, Rule
from wm_drake.report.formatting import MM_PER_M, number, percent
from wm_drake.report.page import Picture, picture
from wm_drake.report.table import Column, Columns, Group, Row, Table, table_of
from wm_drake.simulation.displacements import envelopes, filtered_displacement
from wm_drake.studies.spin.gasket_effect import LARGE_STEADY, SMALL_STEADY, steady_window
from wm_drake.studies.spin.study import CaseResult, band_text

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

WITHOUT, WITH = "without gasket", "with gasket"
"""Names of the two runs of a pair; differences are in percent of the first."""

SHOWN = 3
"""Number of sensors per load whose records are shown: those with the largest difference."""

ZOOM = 1.5
"""Half of the time interval of the detail of a record. [s]"""

COLUMNS = {
    "without_mm": Column("without", "mm", 1),
    "with_mm": Column("with", "mm", 1),
    "percent": Column("difference", "%", 0),
    "experiment_percent": Column("experiment", "%", 0),
    "steady_without_mm": Column("steady, without", "mm", 1),
    "steady_with_mm": Column("steady, with", "mm", 1),
    "steady_percent": Column("difference", "%", 0),
}
"""Columns of the effect of the gasket on the terminal."""


def terminal_table(effect: pd.DataFrame) -> "TerminalTable":
    """Return the effect of the gasket for the terminal, without columns that have no number."""
    kept = [key for key in COLUMNS if effect[key].notna().any()]
    words = [name for name in ("machine", "load", "sensor") if name in effect]
    title = "Amplitudes without and with gasket"
    return table_of(effect[[*words, *kept]], columns=COLUMNS).terminal(title)


def effect_summary(effect: pd.DataFrame) -> str:
    """Return one paragraph on the transient, the experiment and the steady state."""
    sentences = []
    for load, rows in _by_load(effect):
        known = rows[np.isfinite(rows["percent"])]
        if known.empty:
            sentences.append(f"Load {load}: a run diverged or is too short.")
            continue
        up, down = (known.loc[known["percent"].agg(f)] for f in ("idxmax", "idxmin"))
        sentences.append(
            f"Load {load}: the gasket changes amplitudes by {percent(down['percent'])} "
            f"({down['sensor']}) to {percent(up['percent'])} ({up['sensor']})."
        )
    measured = effect[np.isfinite(effect["experiment_percent"]) & np.isfinite(effect["percent"])]
    if len(measured):
        same = int((np.sign(measured["percent"]) == np.sign(measured["experiment_percent"])).sum())
        sentences.append(
            f"The sign of the difference is that of the experiment in {same} of {len(measured)} "
            "cases."
        )
    return " ".join(sentences + _steady_sentences(effect))


def _by_load(effect: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """Return the rows of each load, with its name; of several machines with theirs too."""
    words = [name for name in ("machine", "load") if name in effect]
    return [(", ".join(map(str, key)), rows) for key, rows in effect.groupby(words, sort=False)]


def _steady_sentences(effect: pd.DataFrame) -> list[str]:
    """Return what the gasket changes in the steady state; empty if the profile has none.

    Large amplitudes decide whether it matters. Percents of small ones are large, so these are in
    mm.
    """
    changed = effect.assign(
        change_mm=(effect["steady_with_mm"] - effect["steady_without_mm"]).abs()
    )
    known = changed[np.isfinite(changed["change_mm"])]
    is_large = known["steady_without_mm"] >= LARGE_STEADY
    large, small = known[is_large], known[~is_large]
    sentences = []
    if len(large):
        worst = large.loc[large["steady_percent"].abs().idxmax()]
        size = abs(worst["steady_percent"])
        matters = "matters little" if size <= SMALL_STEADY else "still matters"
        sentences.append(
            f"In the steady state the gasket {matters}: amplitudes of at least {LARGE_STEADY:g} mm "
            f"without gasket differ by up to {number(size, 1)} % ({_both_steady(worst)})."
        )
    if len(small):
        worst = small.loc[small["change_mm"].idxmax()]
        which = "Smaller ones" if len(large) else "Steady amplitudes"
        below = "" if len(large) else f", all below {LARGE_STEADY:g} mm without gasket,"
        sentences.append(
            f"{which}{below} differ by up to {number(worst['change_mm'], 2)} mm "
            f"({_both_steady(worst)})."
        )
    return sentences


def _both_steady(row: pd.Series) -> str:
    """Return sensor, load and both steady amplitudes of a row as text."""
    return (
        f"{row['sensor']}, load {row['load']}: {number(row['steady_without_mm'], 2)} mm without, "
        f"{number(row['steady_with_mm'], 2)} mm with gasket"
    )


def amplitudes(effect: pd.DataFrame) -> Table:
    """Return the amplitudes without and with gasket and their differences, as [B] Table 1."""
    is_measured = bool(np.isfinite(effect["experiment_percent"]).any())
    lines = [("", "computed")] + ([("experiment_", "experiment")] if is_measured else [])
    caption = (
        "Amplitudes without and with gasket, and their difference 100 % × (with − without) / "
        "without, [B] Eq. (1) and Table 1."
    )
    if is_measured:
        caption += " Experiment: measured amplitudes that the machine file names."
    return _pair_table(effect, lines, caption)


def steady(effect: pd.DataFrame, case: CaseResult) -> Table | None:
    """Return the amplitudes in the steady state; None if the profile of the case has none."""
    window = steady_window(case.case.profile)
    if window is None:
        return None
    caption = (
        "Amplitudes at constant speed: mean of the envelope (analytic signal) from "
        f"{window[0]:.1f} to {window[1]:.1f} s, and their difference in percent of that without "
        "gasket."
    )
    return _pair_table(effect, [("steady_", "computed")], caption)


def _pair_table(effect: pd.DataFrame, lines: list[tuple[str, str]], caption: str) -> Table:
    """Return a table of amplitudes: rows without, with and difference, a column per sensor.

    Args:
        lines: Prefix of the columns and name of the source, for each source.
    """
    groups = []
    for load, rows in _by_load(effect):
        shown = []
        for prefix, source in lines:
            kind = "ours" if source == "computed" else "measured"
            for name, column in ((WITHOUT, "without_mm"), (WITH, "with_mm")):
                shown.append(Row((f"{source}, {name}", *rows[prefix + column]), kind))
            changes = (percent(value) for value in rows[f"{prefix}percent"])
            other = "difference" if source == "computed" else "difference other"
            shown.append(Row((f"{source}, difference", *changes), other))
        groups.append(Group(load, tuple(shown)))
    sensors = (Column(name, "mm", 1) for name in dict.fromkeys(effect["sensor"]))
    header: Columns = ("load", "source", *sensors)
    return Table(caption, header, tuple(groups), text_columns=2)


def records_picture(
    effect: pd.DataFrame, without: CaseResult, with_gasket: CaseResult
) -> Picture | None:
    """Return the records of both runs of a case at the sensors with the largest difference.

    Returns:
        The picture; None if a run diverged or is too short.
    """
    load = without.case.name
    rows = effect[(effect["load"] == load) & np.isfinite(effect["percent"])]
    ranked = rows.reindex(rows["percent"].abs().sort_values(ascending=False).index)
    sensors = list(ranked["sensor"][:SHOWN])
    if not sensors:
        return None
    caption = (
        f"Displacement in the band {band_text(without)}, without and with gasket, at the sensors "
        "with the largest difference ([B] Fig. 3). Left: envelopes and records. Right: the records "
        "around the largest amplitude with gasket."
    )
    alternative = f"Overlaid records without and with gasket, load {load}: {sensors}."
    return picture(records_figure(without, with_gasket, sensors), alternative, caption)


def records_figure(without: CaseResult, with_gasket: CaseResult, sensors: list[str]) -> Figure:
    """Return the records of both runs over each other, one row per sensor, with a detail."""
    runs = ((WITH, with_gasket.record, OURS), (WITHOUT, without.record, MEASURED))
    signals = {name: MM_PER_M * filtered_displacement(record) for name, record, _ in runs}
    lines = {name: MM_PER_M * envelopes(record) for name, record, _ in runs}
    panels = []
    for row, sensor in enumerate(sensors):
        middle = float(abs(signals[WITH].sel(sensor=sensor)).idxmax("time"))
        whole: list[Mark] = [Rule(0.0, color=QUIET)]
        detail: list[Mark] = [Rule(0.0, color=QUIET)]
        for name, _, color in runs:
            signal, envelope = signals[name].sel(sensor=sensor), lines[name].sel(sensor=sensor)
            record = Line(signal.time.values, signal.values, color=color, opacity=0.35, key=name)
            whole.append(replace(record, width=0.5))
            time = envelope.time.values[::10]
            sides = (envelope.upper.values[::10], envelope.lower.values[::10])
            whole += [Line(time, side, color=color, key=name) for side in sides]
            near = signal.sel(time=slice(middle - ZOOM, middle + ZOOM))
            detail.append(Line(near.time.values, near.values, color=color, key=name))
        is_last = row == len(sensors) - 1
        x, y = Axis(label="time, s" if is_last else ""), Axis(label="mm", scale=str(row))
        panels.append(Panel(title=sensor, marks=tuple(whole), x=x, y=y, row=row))
        y = replace(y, label="", has_numbers=False)
        panels.append(Panel(marks=tuple(detail), x=x, y=y, row=row, column=1))
    return Figure(panels=tuple(panels), height=130.0, widths=(2.2, 1.0))
