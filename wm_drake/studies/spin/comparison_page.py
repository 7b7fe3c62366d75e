"""Comparison of spin results: overlaid envelopes, tables of differences, and a page of both."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pandas as pd

from wm_drake.parameters import quantities
from wm_drake.report.figure import MEASURED, OURS, QUIET, Axis, Figure, Line, Mark, Panel, Rule
from wm_drake.report.formatting import MISSING, MM_PER_M, listed, number, percent, plain
from wm_drake.report.page import Picture, Section, SectionedPage, picture, versions_of
from wm_drake.report.table import Column, Columns, Group, Row, Table, line, readable, table_of
from wm_drake.report.terminal import Printed
from wm_drake.simulation.displacements import envelopes, filtered_displacement
from wm_drake.studies.spin import figures, tables
from wm_drake.studies.spin.comparison import (
    LARGE_STEADY,
    SMALL_STEADY,
    Variant,
    common_sensors,
    remarks,
    steady_window,
)
from wm_drake.studies.spin.page import cases_as_json, slack_springs_warning, spin_page, warnings_of
from wm_drake.studies.spin.study import CaseResult, band_text
from wm_drake.studies.study import PAGE, Facts, Result

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

COLOURS = (OURS, MEASURED, "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours of the variants: those of Okabe and Ito, which the colour-blind can tell apart."""

MOST_MARKED = 3
"""Largest number of variants whose largest values are written into each panel."""

DECIMALS = {"mm": 1, "rpm": 0, "N": 1, "N*m": 2}
"""Decimals of a value in a table, by unit; others have two."""


@dataclass(frozen=True)
class SpinComparisonResult(Result):
    """Results of several machines, or of runs with and without gasket.

    Attributes:
        variants: At least two; see `check_comparable`.
        differences: Result of `difference_table`.
        effect: Effect of the gasket on the amplitudes, result of `effects`; None if
            the variants are not the same machines with and without gasket.
    """

    variants: tuple[Variant, ...]
    differences: pd.DataFrame
    effect: pd.DataFrame | None = None

    float_formats: ClassVar[Mapping[str, str]] = {"amplitudes": "%.4f"}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return amplitudes, differences of all measures, and the effect of the gasket."""
        amplitudes = [
            tables.banded_amplitudes(v.result).assign(variant=v.name) for v in self.variants
        ]
        joined = pd.concat(amplitudes, ignore_index=True)
        shown = {"amplitudes": joined[["variant", *joined.columns.drop("variant")]]}
        effect = {} if self.effect is None else {"effect": self.effect}
        return shown | {"differences": self.differences} | effect

    def as_json(self) -> dict[str, Any]:
        """Return the measures of each variant, and their differences."""
        first = self.variants[0].result
        cases = [cases_as_json(variant.result) for variant in self.variants]
        tree: dict[str, Any] = {
            "engine": first.engine,
            "variants": [
                {"name": v.name, "machine": v.result.parameters.name, "cases": of_variant}
                for v, of_variant in zip(self.variants, cases, strict=True)
            ],
            "differences": self.differences.to_dict("records"),
        }
        if self.effect is not None:
            tree["effect"] = self.effect.to_dict("records")
            tree["steady_window_s"] = steady_window(first.results[0].case.profile)
        return dict(plain(tree))  # JSON has no NaN

    def terminal(self) -> Printed:
        """Return the amplitudes, the effect of the gasket, and the smallest gaps."""
        amplitudes = self.tables()["amplitudes"]
        gaps = [
            f"{variant.name}, {case.case.name}: smallest gap {text}"
            for variant in self.variants
            for case in variant.result.results
            if (text := case.gap_text)
        ]
        title = "Displacement amplitudes, in mm"
        shown: list[Any] = [tables.amplitude_lines(title, amplitudes), *gaps]
        if self.effect is None:
            return shown
        return [*shown, terminal_table(self.effect), effect_summary(self.effect)]

    def page(self, facts: Facts) -> str:
        """Return the page of the comparison."""
        return comparison_page(self, facts)

    def pages(self, facts: Facts) -> dict[str, str]:
        """Return the page of the comparison and that of each variant."""
        of_variants = {v.page: spin_page(v.result, facts) for v in self.variants}
        return {PAGE: self.page(facts)} | of_variants

    def write(self, folder: Path) -> None:
        """Write the tables and the files of the cases."""
        super().write(folder)
        for variant in self.variants:
            variant.result.write_cases(folder)

    def warnings(self) -> list[str]:
        """Return warnings of the variants."""
        return [
            f"{v.name}: {text}" for v in self.variants for text in slack_springs_warning(v.result)
        ]

    def failures(self) -> list[str]:
        """Return a line for each case that diverged."""
        return [f"{v.name}: {text}" for v in self.variants for text in v.result.failures()]


def overlaid_envelopes_figure(
    cases: Mapping[str, CaseResult], measured_mm: Mapping[str, Mapping[str, float]] | None = None
) -> Figure:
    """Return the envelopes of several runs over each other, one panel per sensor.

    Sensors that not all runs have are left out. The drum speed along the top is that of the longest
    run.

    Args:
        cases: By name of the variant, at most as many as there are colours; records that are long
            enough for the filter.
        measured_mm: By name of the variant, measured amplitude A by sensor, drawn as dashed lines
            at +-A in the colour of the variant. [mm]
    """
    bands = {name: envelopes(case.record) * MM_PER_M for name, case in cases.items()}
    longest = max((case.record for case in cases.values()), key=lambda record: record.time[-1])
    sensors = [
        str(name)
        for name in longest.sensor.values
        if all(name in band.sensor for band in bands.values())
    ]
    measured = measured_mm or {}
    lines = len(cases) if len(cases) <= MOST_MARKED else 0
    sizes = [float(abs(band.sel(sensor=sensors)).to_array().max()) for band in bands.values()]
    sizes += [of_variant[sensor] for of_variant in measured.values() for sensor in sensors]
    limits = figures.symmetric_limits(max(sizes), max(1, lines))
    panels = []
    for sensor in sensors:
        marks: list[Mark] = []
        for index, (name, band) in enumerate(bands.items()):
            color, record = COLOURS[index], cases[name].record
            lower, upper = (b.sel(sensor=sensor).values for b in (band.lower, band.upper))
            marks.append(
                figures.time_band((record.time.values, lower, upper), limits[1], name, color)
            )
            if lines:
                farther = np.where(np.abs(lower) > np.abs(upper), lower, upper)
                marks += figures.largest_marks(record, farther, "mm", color, index)
            if name in measured:
                marks += figures.experiment_rules(measured[name][sensor], color)
        panels.append(figures.time_panel(longest, sensor, marks, "displacement, mm", limits))
    return figures.time_figure(panels)


def differences(table: pd.DataFrame, load: str) -> Table:
    """Return the differences of all measures of one load as a table for a page."""
    rows = table[table["load"] == load]
    reference = rows["reference"].iloc[0]
    names = list(dict.fromkeys(rows["variant"]))
    header = ["measure", "where", "unit", reference]
    for name in names:
        header += [name, "difference", "%"]
    groups = []
    for measure, of_measure in rows.groupby("measure", sort=False):
        lines = []
        for (label, unit), of_label in of_measure.groupby(["name", "unit"], sort=False):
            decimals = DECIMALS.get(str(unit), 2)
            cells = [str(label), str(unit).replace("*", " ")]
            cells.append(number(of_label["reference_value"].iloc[0], decimals))
            for _, row in of_label.iterrows():
                cells += [number(row["value"], decimals), signed(row["difference"], decimals)]
                cells.append(percent(row["percent"]).removesuffix(" %"))
            lines.append(Row(tuple(cells)))
        groups.append(Group(str(measure), tuple(lines)))
    caption = (
        f"Every measure of load {load}. Difference: value − value of '{reference}', absolute and "
        f"in percent of the latter. {MISSING}: this variant does not have the measure."
    )
    return Table(caption, tuple(header), tuple(groups), text_columns=3)


def signed(value: float, decimals: int) -> str:
    """Return a difference as text with its sign; zero has none."""
    text = number(value, decimals)
    return f"+{text}" if float(np.round(value, decimals)) > 0.0 else text


def amplitudes(variants: Sequence[Variant], table: pd.DataFrame) -> Table:
    """Return the amplitudes of all variants, load by load, with the differences in percent."""
    sensors = common_sensors([variant.result.parameters for variant in variants])
    groups = []
    for index, case in enumerate(variants[0].result.results):
        rows = []
        for variant in variants:
            sizes = variant.result.results[index].measures.amplitude.sel(sensor=sensors)
            values = (number(MM_PER_M * float(size)) for size in sizes)
            rows.append(Row((variant.name, *values), "ours"))
        of_load = table[(table["load"] == case.case.name) & (table["measure"] == "amplitude")]
        for variant in variants[1:]:
            of_variant = of_load[of_load["variant"] == variant.name].set_index("name")["percent"]
            heading = f"{variant.name} vs. {variants[0].name}"
            rows.append(
                Row((heading, *(percent(of_variant[name]) for name in sensors)), "difference")
            )
        groups.append(Group(case.case.name, tuple(rows)))
    cases = (case for variant in variants for case in variant.result.results)
    caption = (
        "Amplitude of the displacement at each sensor: the largest absolute value of its envelopes "
        f"in the band {band_text(*cases)}. Differences are in percent of '{variants[0].name}'."
    )
    header = ("load", "machine or variant", *(f"{name}, mm" for name in sensors))
    return Table(caption, header, tuple(groups), text_columns=2)


def different_parameters(variants: Sequence[Variant]) -> Table | None:
    """Return the parameters that differ between the machines; None if there are none."""
    of_machines = [
        {key: readable(value, unit) for key, value, unit in quantities(variant.result.parameters)}
        for variant in variants
    ]
    keys = dict.fromkeys(key for of_machine in of_machines for key in of_machine)
    groups = []
    for key in keys:
        values = [of_machine.get(key, MISSING) for of_machine in of_machines]
        if len(set(values)) > 1:
            groups.append(line(key, values))
    if not groups:
        return None
    caption = (
        f"Parameters of the machine files that differ. {MISSING}: this machine does not have it."
    )
    header = ("key", *(variant.name for variant in variants))
    return Table(caption, header, tuple(groups), text_columns=1 + len(variants))


def envelopes_picture(variants: Sequence[Variant], index: int) -> Picture | None:
    """Return the overlaid envelopes of the case with an index, or None if no run has any.

    Runs that are too short for the filter are left out.
    """
    cases = {
        variant.name: variant.result.results[index]
        for variant in variants
        if not variant.result.results[index].measures.amplitude.isnull().any()
    }
    if not cases:
        return None
    measured = _measured_mm([variant for variant in variants if variant.name in cases], index)
    load = variants[0].result.results[index].case.name
    caption = (
        f"Displacement at each sensor over time, in the band {band_text(*cases.values())}. Each "
        "shaded area extends from the lower to the upper envelope."
    )
    if len(cases) <= MOST_MARKED:
        caption += (
            " Dots: the largest absolute values; the top of the panel gives them with their drum "
            "speeds."
        )
    profiles = {name: case.case.profile for name, case in cases.items()}
    if len(set(map(str, profiles.values()))) > 1:
        longest = max(profiles, key=lambda name: profiles[name].duration)
        caption += f" The drum speed along the top is that of {longest}."
    if measured:
        caption += (
            " Dashed lines: measured amplitude, on both sides of zero, in the colour of the "
            "machine or variant that was measured."
        )
    alternative = (
        f"Overlaid envelopes of the displacement over time, load {load}: {', '.join(cases)}."
    )
    return picture(overlaid_envelopes_figure(cases, measured), alternative, caption)


def _measured_mm(variants: Sequence[Variant], index: int) -> dict[str, dict[str, float]]:
    """Return the measured amplitudes of a case by variant and sensor; equal ones only once. [mm]"""
    different: dict[str, dict[str, float]] = {}
    for variant in variants:
        table = tables.amplitude_table(variant.result)
        measured = tables.experiment_mm(table, variant.result.results[index])
        if measured is not None and measured not in different.values():
            different[variant.name] = measured
    return different


def comparison_page(comparison: SpinComparisonResult, facts: Facts | None = None) -> str:
    """Return the comparison as text of one self-contained HTML file."""
    variants, table, made = comparison.variants, comparison.differences, facts or Facts()
    machines = [variant.result.parameters for variant in variants]
    of_each = [
        Section(
            f"case-{index + 1}",
            f"Load {case.case.name}",
            tuple(filter(None, _pictures(comparison, index))),
            text=_gap_facts(variants, index),
        )
        for index, case in enumerate(variants[0].result.results)
    ]
    loads = tuple(differences(table, name) for name in table["load"].unique())
    pages = [(variant.page, f"Full report of {variant.name}") for variant in variants]
    different = different_parameters(variants)
    return SectionedPage(
        title(variants),
        summary(comparison),
        [
            *of_each,
            *_amplitude_sections(comparison),
            Section("loads", "Each load", tables=loads),
            Section("pages", "Full reports", links=pages),
        ],
        facts_of_comparison(variants, made),
        machines[0] if all(machine == machines[0] for machine in machines) else None,
        [
            *made.warnings,
            *remarks(variants),
            *(f"{v.name}: {text}" for v in variants for text in warnings_of(v.result)),
        ],
        tables=(different,) if different else (),
    ).html()


def _pictures(comparison: SpinComparisonResult, index: int) -> Iterator[Picture | None]:
    """Yield overlaid envelopes of a case, and records with and without gasket of each machine."""
    variants, effect = comparison.variants, comparison.effect
    yield envelopes_picture(variants, index)
    if effect is None:
        return
    for first in range(0, len(variants), 2):
        with_gasket, without = (v.result.results[index] for v in variants[first : first + 2])
        rows = effect
        if "machine" in effect:
            rows = effect[effect["machine"] == variants[first].result.parameters.name]
        yield records_picture(rows, without, with_gasket)


def _amplitude_sections(comparison: SpinComparisonResult) -> list[Section]:
    """Return the amplitudes of all variants, and the effect of the gasket if that is compared."""
    variants, effect = comparison.variants, comparison.effect
    shown = (amplitudes(variants, comparison.differences),)
    of_variants = [(v.result, tables.amplitude_table(v.result)) for v in variants]
    against = tuple(
        tables.comparison(result, table)
        for result, table in of_variants
        if any(tables.experiment_mm(table, case) for case in result.results)
    )
    sections = [
        Section("amplitudes", "Amplitudes", tables=shown),
        Section("experiment", "Against the experiment", tables=against),
    ]
    if effect is None:
        return sections
    steady = steady_table(effect, variants[0].result.results[0])
    effects = (effect_amplitudes(effect), *([steady] if steady else []))
    return [Section("gasket", "Effect of the gasket", tables=effects), *sections]


def title(variants: Sequence[Variant]) -> str:
    """Return the title of the page: the machine, if there is only one, and the variants."""
    names, machine = listed([variant.name for variant in variants]), variants[0].result.parameters
    if all(variant.result.parameters.name == machine.name for variant in variants):
        return f"Comparison of machine {machine.name}: {names}"
    return f"Comparison of machines {names}"


def summary(comparison: SpinComparisonResult) -> str:
    """Return one paragraph: the largest amplitude and the smallest gap of each variant."""
    variants, table = comparison.variants, comparison.differences
    count = len(variants[0].result.results)
    loads = "1 load was" if count == 1 else f"{count} loads were"
    opening = f"{loads} run for each of {len(variants)} machines or variants."
    sentences = [opening, *(_of_variant(variant) for variant in variants)]
    changes = table[(table["measure"] == "amplitude") & np.isfinite(table["percent"])]
    if comparison.effect is not None:
        sentences.append(effect_summary(comparison.effect))
    elif len(changes):
        largest = changes.loc[changes["percent"].abs().idxmax()]
        sentences.append(
            f"The largest change of an amplitude is {percent(largest['percent'])}, at sensor "
            f"{largest['name']} with load {largest['load']}: {number(largest['reference_value'])} "
            f"mm ({largest['reference']}), {number(largest['value'])} mm ({largest['variant']})."
        )
    return " ".join(sentences)


def _of_variant(variant: Variant) -> str:
    ended = [case for case in variant.result.results if not case.record.attrs["diverged"]]
    if not ended:
        return f"Every run of {variant.name} diverged."
    amplitude = max(float(case.measures.amplitude.fillna(0.0).max()) for case in ended)
    text = f"{variant.name}: largest amplitude {number(MM_PER_M * amplitude)} mm"
    gaps = [case.measures.smallest_gap for case in ended]
    distances = [gap.distance for gap in gaps if gap is not None]
    return (
        f"{text}, smallest gap {number(MM_PER_M * min(distances))} mm." if distances else f"{text}."
    )


def _gap_facts(variants: Sequence[Variant], index: int) -> str:
    """Return the smallest gaps of the case with an index, as one sentence; empty without gaps."""
    texts = [
        f"{variant.name} {text}"
        for variant in variants
        if (text := variant.result.results[index].gap_text)
    ]
    return f"Smallest gap to the housing: {'; '.join(texts)}." if texts else ""


def facts_of_comparison(variants: Sequence[Variant], made: Facts) -> list[tuple[str, str]]:
    """Return what was run and with which software, as pairs of heading and text."""
    first = variants[0].result
    facts = []
    for variant in variants:
        machine = variant.result.parameters
        how = variant.result.stepping_text
        facts.append((variant.name, f"{machine.about} Integration: {how}.".strip()))
    versions = versions_of(first.results[0].record.attrs)
    made = replace(made, step=0.0)  # the lines of the variants have it
    return [*facts, ("Engine", first.engine), ("Versions", versions), *made.rows()]


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


def effect_amplitudes(effect: pd.DataFrame) -> Table:
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


def steady_table(effect: pd.DataFrame, case: CaseResult) -> Table | None:
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
