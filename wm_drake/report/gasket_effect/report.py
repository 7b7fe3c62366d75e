"""Report of the gasket effect: records and envelopes without and with gasket, and differences."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wm_drake.report.figures import GRID, MEASURED, OURS, QUIET, WIDTH, style_axes
from wm_drake.report.formatting import MM_PER_M, number, percent
from wm_drake.report.page import Picture, picture, render, versions_of
from wm_drake.report.spin import tables
from wm_drake.report.spin.comparison import differences, envelopes_picture
from wm_drake.report.spin.report import warnings_of
from wm_drake.report.tables import Group, Row, Table, parameter_table
from wm_drake.simulation.measures import envelopes, filtered_displacement
from wm_drake.studies.gasket_effect.study import (
    LARGE_STEADY,
    SMALL_STEADY,
    WITH,
    WITHOUT,
    GasketEffect,
    effect_table,
    steady_window,
)
from wm_drake.studies.spin.comparison import difference_table
from wm_drake.studies.spin.study import CaseResult

SHOWN = 3
"""Number of sensors per load whose records are shown: those with the largest difference."""

ZOOM = 1.5
"""Half of the time interval of the detail of a record. [s]"""


def gasket_effect_report(effect: GasketEffect, command: str = "") -> str:
    """Return the report as text of one self-contained HTML file.

    Args:
        effect: Result of the study.
        command: Command line of the study, shown on the page.
    """
    table, parameters = effect_table(effect), effect.without.parameters
    measures = difference_table(effect.variants)
    first = effect.with_gasket.results[0]
    facts = [
        ("Machine", parameters.name),
        ("About", parameters.about),
        ("Engine", f"{effect.without.engine}, step {1e3 * effect.without.step:g} ms"),
        ("Versions", versions_of(first.record.attrs)),
        ("Command", command),
    ]
    return render(
        "gasket_effect/page.html",
        title=f"Effect of the gasket of machine {parameters.name}",
        about=parameters.about,
        summary=summary(table),
        warnings=[
            f"{variant.name}: {text}"
            for variant in effect.variants
            for text in warnings_of(variant.result)
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
    return Table(last.caption, last.header, tuple(groups), text_columns=2)


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
    """Draw the records of both runs over each other, one row per sensor, with a detail."""
    height = 1.9 * len(sensors) + 0.7
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    panels = figure.subplots(
        len(sensors), 2, squeeze=False, sharey="row", gridspec_kw={"width_ratios": (2.2, 1.0)}
    )
    runs = ((WITHOUT, without.record, OURS), (WITH, with_gasket.record, MEASURED))
    signals = {name: MM_PER_M * filtered_displacement(record) for name, record, _ in runs}
    lines = {name: MM_PER_M * envelopes(record) for name, record, _ in runs}
    for row, sensor in zip(panels, sensors, strict=True):
        middle = float(abs(signals[WITH].sel(sensor=sensor)).idxmax("time"))
        for name, _, colour in runs:
            signal, band = signals[name].sel(sensor=sensor), lines[name].sel(sensor=sensor)
            row[0].plot(
                signal.time, signal, color=colour, linewidth=0.3, alpha=0.35, rasterized=True
            )
            for side in ("upper", "lower"):
                label = name if side == "upper" else None
                row[0].plot(
                    band.time[::10], band[side][::10], color=colour, linewidth=1.2, label=label
                )
            near = signal.sel(time=slice(middle - ZOOM, middle + ZOOM))
            row[1].plot(near.time, near, color=colour, linewidth=1.0)
        row[0].set_title(sensor, fontsize=10, loc="left", fontweight="bold", parse_math=False)
        row[0].set_ylabel("mm", fontsize=9)
        for axes in row:
            axes.axhline(0.0, color=QUIET, linewidth=0.6)
            axes.grid(color=GRID)
            style_axes(axes)
    for axes in panels[-1]:
        axes.set_xlabel("time, s", fontsize=9)
    figure.legend(
        *panels[0, 0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=2,
        frameon=False,
        fontsize=9,
    )
    return figure
