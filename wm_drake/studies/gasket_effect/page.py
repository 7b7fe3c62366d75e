"""Report of the gasket effect: records and envelopes without and with gasket, and differences."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from rich import table as terminal

from wm_drake.report.figure import MEASURED, OURS, QUIET, Axis, Figure, Line, Mark, Panel, Rule
from wm_drake.report.formatting import MISSING, MM_PER_M, number, percent
from wm_drake.report.page import Picture, picture, render, versions_of
from wm_drake.report.spin import tables
from wm_drake.report.spin.comparison import differences, envelopes_picture
from wm_drake.report.spin.report import warnings_of
from wm_drake.report.table import Group, Row, Table, parameter_table
from wm_drake.simulation.displacements import envelopes, filtered_displacement
from wm_drake.studies.gasket_effect.study import (
    LARGE_STEADY,
    SMALL_STEADY,
    WITH,
    WITHOUT,
    GasketEffect,
    GasketEffectResult,
    steady_window,
)
from wm_drake.studies.spin.comparison import difference_table
from wm_drake.studies.spin.study import CaseResult
from wm_drake.studies.study import Facts

SHOWN = 3
"""Number of sensors per load whose records are shown: those with the largest difference."""

ZOOM = 1.5
"""Half of the time interval of the detail of a record. [s]"""


def gasket_effect_page(result: GasketEffectResult, made: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    effect, table, parameters = result.effect, result.table, result.effect.without.parameters
    measures = difference_table(effect.variants)
    first = effect.with_gasket.results[0]
    facts = [
        ("Machine", parameters.name),
        ("About", parameters.about),
        ("Engine", f"{effect.without.engine}, step {1e3 * effect.without.step:g} ms"),
        ("Versions", versions_of(first.record.attrs)),
        ("Command", made.command),
    ]
    return render(
        Path(__file__).with_name("page.html"),
        title=f"Effect of the gasket of machine {parameters.name}",
        about=parameters.about,
        summary=summary(table),
        warnings=[
            *made.warnings,
            *(
                f"{variant.name}: {text}"
                for variant in effect.variants
                for text in warnings_of(variant.result)
            ),
        ],
        amplitudes=amplitudes(table),
        experiment=against_experiment(effect),
        steady=steady(effect, table),
        cases=[
            {
                "anchor": f"load-{index + 1}",
                "title": without.case.name,
                "pictures": _pictures(effect, table, index),
                "table": differences(measures, without.case.name),
            }
            for index, (without, _) in enumerate(effect.pairs)
        ],
        facts=[(word, text) for word, text in facts if text],
        numbers=parameter_table(parameters),
    )


def summary(table: pd.DataFrame) -> str:
    """Return one paragraph on the transient, the experiment and the steady state."""
    sentences = []
    for load, rows in table.groupby("load", sort=False):
        known = rows[np.isfinite(rows["percent"])]
        if known.empty:
            sentences.append(f"Load {load}: a run diverged or is too short.")
            continue
        up, down = (known.loc[known["percent"].agg(f)] for f in ("idxmax", "idxmin"))
        sentences.append(
            f"Load {load}: the gasket changes amplitudes by {percent(down['percent'])} "
            f"({down['sensor']}) to {percent(up['percent'])} ({up['sensor']})."
        )
    measured = table[np.isfinite(table["experiment_percent"]) & np.isfinite(table["percent"])]
    if len(measured):
        same = int((np.sign(measured["percent"]) == np.sign(measured["experiment_percent"])).sum())
        sentences.append(
            f"The sign of the difference is that of the experiment in {same} of {len(measured)} "
            "cases."
        )
    return " ".join(sentences + _steady_sentences(table))


def _steady_sentences(table: pd.DataFrame) -> list[str]:
    """Return what the gasket changes in the steady state; empty if the profile has none.

    Large amplitudes decide whether it matters. Percents of small ones are large, so these are in
    mm.
    """
    changed = table.assign(change_mm=(table["steady_with_mm"] - table["steady_without_mm"]).abs())
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


TERMINAL_HEADS = {
    "without_mm": "with-\nout",
    "with_mm": "with",
    "percent": "differ-\nence, %",
    "experiment_percent": "experi-\nment, %",
    "steady_without_mm": "steady,\nwithout",
    "steady_with_mm": "steady,\nwith",
    "steady_percent": "differ-\nence, %",
}
"""Column heads on the terminal by column of the table of amplitudes."""


def terminal_table(effect: GasketEffect, table: pd.DataFrame) -> terminal.Table:
    """Return the amplitudes for the terminal."""
    name = effect.without.parameters.name
    shown = terminal.Table(title=f"Amplitudes of machine '{name}' without and with gasket, in mm")
    for title in ("load", "sensor"):
        shown.add_column(title)
    kept = [key for key in TERMINAL_HEADS if table[key].notna().any()]
    for key in kept:
        shown.add_column(TERMINAL_HEADS[key], justify="right")
    for row in table.to_dict("records"):
        texts = (f"{row[k]:+.0f}" if "percent" in k else f"{row[k]:.1f}" for k in kept)
        cells = (MISSING if text.endswith("nan") else text for text in texts)
        shown.add_row(row["load"], row["sensor"], *cells)
    return shown


def amplitudes(table: pd.DataFrame) -> Table:
    """Return the amplitudes without and with gasket and their differences, as [B] Table 1."""
    is_measured = bool(np.isfinite(table["experiment_percent"]).any())
    lines = [("", "computed")] + ([("experiment_", "experiment")] if is_measured else [])
    caption = (
        "Amplitudes without and with gasket, and their difference 100 % × (with − without) / "
        "without, [B] Eq. (1) and Table 1."
    )
    if is_measured:
        caption += " Experiment: measured amplitudes that the machine file names."
    return _pair_table(table, lines, caption)


def steady(effect: GasketEffect, table: pd.DataFrame) -> Table | None:
    """Return the amplitudes in the steady state; None if the profile has none."""
    window = steady_window(effect.without.results[0].case.profile)
    if window is None:
        return None
    caption = (
        "Amplitudes at constant speed: mean of the envelope (analytic signal) from "
        f"{window[0]:.1f} to {window[1]:.1f} s, and their difference in percent of that without "
        "gasket."
    )
    return _pair_table(table, [("steady_", "computed")], caption)


def _pair_table(table: pd.DataFrame, lines: list[tuple[str, str]], caption: str) -> Table:
    """Return a table of amplitudes: rows without, with and difference, a column per sensor.

    Args:
        table: Result of `effect_table`.
        lines: Prefix of the columns and name of the source, for each source.
        caption: Caption.
    """
    groups = []
    for load, rows in table.groupby("load", sort=False):
        shown = []
        for prefix, source in lines:
            kind = "ours" if source == "computed" else "measured"
            for name, column in ((WITHOUT, "without_mm"), (WITH, "with_mm")):
                cells = (number(value, 1) for value in rows[prefix + column])
                shown.append(Row((f"{source}, {name}", *cells), kind))
            changes = (percent(value) for value in rows[f"{prefix}percent"])
            other = "difference" if source == "computed" else "difference other"
            shown.append(Row((f"{source}, difference", *changes), other))
        groups.append(Group(str(load), tuple(shown)))
    sensors = list(dict.fromkeys(table["sensor"]))
    header = ("load", "source", *(f"{name}, mm" for name in sensors))
    return Table(caption, header, tuple(groups), text_columns=2)


def against_experiment(effect: GasketEffect) -> Table | None:
    """Return our amplitudes and other models' beside the experiment, as [B] Tables 1 and 2."""
    groups: list[Group] = []
    last = None
    for result in (effect.without, effect.with_gasket):
        if any(result.is_compared(case) for case in result.results):
            last = tables.comparison(result, tables.amplitude_table(result))
            groups += last.groups
    if last is None:
        return None
    return Table(last.caption, last.columns, tuple(groups), text_columns=2)


def _pictures(effect: GasketEffect, table: pd.DataFrame, index: int) -> list[Picture]:
    without, with_gasket = effect.pairs[index]
    load = without.case.name
    shown = [envelopes_picture(effect.variants, index)]
    rows = table[(table["load"] == load) & np.isfinite(table["percent"])]
    ranked = rows.reindex(rows["percent"].abs().sort_values(ascending=False).index)
    sensors = list(ranked["sensor"][:SHOWN])
    if sensors:
        caption = (
            "Displacement in the band 0.5–20 Hz, without and with gasket, at the sensors with the "
            "largest difference ([B] Fig. 3). Left: envelopes and records. Right: the records "
            "around the largest amplitude with gasket."
        )
        figure = records_figure(without, with_gasket, sensors)
        alternative = f"Overlaid records without and with gasket, load {load}: {sensors}."
        shown.append(picture(figure, alternative, caption))
    return [one for one in shown if one is not None]


def records_figure(without: CaseResult, with_gasket: CaseResult, sensors: list[str]) -> Figure:
    """Return the records of both runs over each other, one row per sensor, with a detail."""
    runs = ((WITHOUT, without.record, OURS), (WITH, with_gasket.record, MEASURED))
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
