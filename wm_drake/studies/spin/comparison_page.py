"""Comparison of spin results: overlaid envelopes, tables of differences, and a page of both."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from wm_drake.parameters import quantities
from wm_drake.report.figure import MEASURED, OURS, Figure, Mark
from wm_drake.report.formatting import MISSING, MM_PER_M, listed, number, percent
from wm_drake.report.page import Picture, picture, versions_of
from wm_drake.report.sections import Section, SectionedPage
from wm_drake.report.table import Group, Row, Table, line, readable
from wm_drake.simulation.displacements import envelopes
from wm_drake.studies.spin import effect_page, tables
from wm_drake.studies.spin.comparison import ComparisonResult, Variant, common_sensors, remarks
from wm_drake.studies.spin.figures import experiment_rules
from wm_drake.studies.spin.page import warnings_of
from wm_drake.studies.spin.panels import (
    largest_marks,
    symmetric_limits,
    time_band,
    time_figure,
    time_panel,
)
from wm_drake.studies.spin.study import CaseResult, band_text
from wm_drake.studies.study import Facts

COLOURS = (OURS, MEASURED, "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours of the variants: those of Okabe and Ito, which the colour-blind can tell apart."""

MOST_MARKED = 3
"""Largest number of variants whose largest values are written into each panel."""

DECIMALS = {"mm": 1, "rpm": 0, "N": 1, "N*m": 2}
"""Decimals of a value in a table, by unit; others have two."""


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
    limits = symmetric_limits(max(sizes), max(1, lines))
    panels = []
    for sensor in sensors:
        marks: list[Mark] = []
        for index, (name, band) in enumerate(bands.items()):
            color, record = COLOURS[index], cases[name].record
            lower, upper = (b.sel(sensor=sensor).values for b in (band.lower, band.upper))
            marks.append(time_band((record.time.values, lower, upper), limits[1], name, color))
            if lines:
                farther = np.where(np.abs(lower) > np.abs(upper), lower, upper)
                marks += largest_marks(record, farther, "mm", color, index)
            if name in measured:
                marks += experiment_rules(measured[name][sensor], color)
        panels.append(time_panel(longest, sensor, marks, "displacement, mm", limits))
    return time_figure(panels)


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


def comparison_page(comparison: ComparisonResult, facts: Facts | None = None) -> str:
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


def _pictures(comparison: ComparisonResult, index: int) -> Iterator[Picture | None]:
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
        yield effect_page.records_picture(rows, without, with_gasket)


def _amplitude_sections(comparison: ComparisonResult) -> list[Section]:
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
    steady = effect_page.steady(effect, variants[0].result.results[0])
    effects = (effect_page.amplitudes(effect), *([steady] if steady else []))
    return [Section("gasket", "Effect of the gasket", tables=effects), *sections]


def title(variants: Sequence[Variant]) -> str:
    """Return the title of the page: the machine, if there is only one, and the variants."""
    names, machine = listed([variant.name for variant in variants]), variants[0].result.parameters
    if all(variant.result.parameters.name == machine.name for variant in variants):
        return f"Comparison of machine {machine.name}: {names}"
    return f"Comparison of machines {names}"


def summary(comparison: ComparisonResult) -> str:
    """Return one paragraph: the largest amplitude and the smallest gap of each variant."""
    variants, table = comparison.variants, comparison.differences
    count = len(variants[0].result.results)
    loads = "1 load was" if count == 1 else f"{count} loads were"
    opening = f"{loads} run for each of {len(variants)} machines or variants."
    sentences = [opening, *(_of_variant(variant) for variant in variants)]
    changes = table[(table["measure"] == "amplitude") & np.isfinite(table["percent"])]
    if comparison.effect is not None:
        sentences.append(effect_page.effect_summary(comparison.effect))
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
        step = f"step {1e3 * variant.result.step:g} ms"
        facts.append((variant.name, f"{machine.about} {step.capitalize()}.".strip()))
    versions = versions_of(first.results[0].record.attrs)
    made = replace(made, step=0.0)  # the lines of the variants have it
    return [*facts, ("Engine", first.engine), ("Versions", versions), *made.rows()]
