"""Comparison of spin runs: machines, or one with and without gasket; one table and one picture."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import MachineParameters, SpinProfile, measured_changes, quantities
from wm_drake.parameters.measured import EXPERIMENT
from wm_drake.report import figure as fig
from wm_drake.report.formatting import MISSING, listed
from wm_drake.report.labelled import LabelledTable, rows_of
from wm_drake.report.quantity import CHANGE, SHARE, SPEED, Quantity, of_measure, quantity_of
from wm_drake.report.table import readable
from wm_drake.simulation.displacements import envelopes, smooth_envelope
from wm_drake.simulation.measures.registry import tabulated
from wm_drake.simulation.records import Record
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.spin import figures
from wm_drake.studies.spin.data import (
    DIFFERENCE,
    DISPLACEMENT,
    amplitudes_of,
    experiment_of,
)
from wm_drake.studies.spin.page import Files, spin_answer
from wm_drake.studies.spin.study import GAP, CaseResult, SpinRuns, band_text

Variants: TypeAlias = Mapping[str, SpinRuns]
"""Runs by the names of machines or variants. All have the same loads in the same order."""

COLOURS = (fig.OURS, fig.MEASURED, "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours of the variants: those of Okabe and Ito, which the colour-blind can tell apart."""

MOST_MARKED = 3
"""Largest number of variants whose largest values are written into each panel."""

COMPARED = (
    "amplitude",
    "critical_speed",
    "detergent_displacement",
    "smallest_gap",
    "gasket_force",
    "gasket_moment",
    "mount_force_peak",
)
"""Variables of measures that the table of differences begins with."""

AMPLITUDE, STEADY = "amplitude", "steady amplitude at "
"""Measures in a table of differences; the latter is the mean envelope in the steady state, and its
name ends with the drum speed."""

STEADY_PART = 0.5
"""Part of a stretch of constant speed, at its end, that counts as the steady state.

An assumption: in the first part the motion of the run-up decays. At 400 rpm in [B] it is the last
6.4 of 12.9 s.
"""

LARGE_STEADY = 1e-3
"""Steady amplitude of the reference from which on its relative difference is judged. [m]

An assumption: a part of a smaller one is below what can be seen on a tub.
"""

STEADY_CHANGE = SHARE.named("difference", decimals=1)
STEADY_SIZE = Quantity("difference", DISPLACEMENT.unit, 2)


def comparison_answer(
    variants: Variants, references: Mapping[str, str], files: Mapping[str, Files]
) -> Answer:
    """Return the answer of a comparison.

    Args:
        variants: At least two; see `check_comparable`.
        references: Name of the variant that each variant is compared with; its own name for a
            reference.
        files: What is written beside the usual files, by variant.
    """
    pages = {name: f"report_{files[name].part}.html" for name in variants}
    others = {pages[name]: spin_answer(runs, files=files[name]) for name, runs in variants.items()}
    by_name = {name: runs.parameters for name, runs in variants.items()}
    machines = list(by_name.values())
    data = differences_of(variants, references)
    plot = _plot(variants)
    return Answer(
        _title(variants),
        summary(variants, data),
        machines[0] if all(machine == machines[0] for machine in machines) else None,
        (
            Part("Differences", (*([plot] if plot else []), _table(data), _amplitudes(variants))),
            Part(
                "Parameters that differ",
                remarks=different_parameters(by_name),
                is_folded=True,
            ),
            Part("Full reports", links=[(p, f"Full report of {n}") for n, p in pages.items()]),
        ),
        tuple(
            (name, f"{runs.parameters.about} {runs.engine}, {runs.stepping_text}.".strip())
            for name, runs in variants.items()
        ),
        files={name: content for one in others.values() for name, content in one.files.items()},
        warned=(
            *remarks(variants),
            *(f"{name}: {text}" for name, page in pages.items() for text in others[page].warned),
        ),
        short=Part("Smallest gaps", facts=_gaps(variants)),
        diverged=tuple(
            f"{name}: {text}" for name, runs in variants.items() for text in runs.failures()
        ),
        others=others,
    )


def _title(variants: Variants) -> str:
    """Return the title of the page: the machine, if there is only one, and the variants."""
    machines = list(dict.fromkeys(runs.parameters.name for runs in variants.values()))
    if len(machines) == 1:
        return f"Comparison of machine {machines[0]}: {listed(list(variants))}"
    return f"Comparison of machines {listed(list(variants))}"


def _gaps(variants: Variants) -> list[tuple[str, str]]:
    """Return the smallest gap of each variant and load, as pairs of word and text."""
    return [
        (f"{name}, {case.case.name}", case.gap_text)
        for name, runs in variants.items()
        for case in runs.results
        if case.gap_text
    ]


def differences_of(variants: Variants, references: Mapping[str, str]) -> xr.Dataset:
    """Return all measures of each load for each variant, and their changes from its reference.

    Returns:
        A row for each number, with the labels load, measure, of (sensor, axis or mount) and unit.
        Over `row` and `variant`: `value` in the unit of its row, NaN where the variant lacks the
        measure; `change`, [B] Eq. (1) with the absolute reference, NaN for a reference and if that
        is zero; `measured_change` of amplitudes by the gasket, NaN where nothing is compared.
    """
    every = {name: _numbers(runs) for name, runs in variants.items()}
    keys = list(dict.fromkeys(key for numbers in every.values() for key in numbers))
    order = list(dict.fromkeys(key[:2] for key in keys))
    keys.sort(key=lambda key: order.index(key[:2]))  # stable; a mount that the first one lacks
    values = np.array([[numbers.get(key, np.nan) for numbers in every.values()] for key in keys])
    names = list(variants)
    reference = values[:, [names.index(references[name]) for name in names]]
    is_compared = np.array([references[name] != name for name in names]) & (reference != 0.0)
    size = np.where(is_compared, np.abs(reference), np.nan)
    measured = [_measured_changes(variants, references, name) for name in names]
    of_keys = [[changes.get(key[:3], np.nan) for changes in measured] for key in keys]
    dims = ("row", "variant")
    return rows_of(
        dict(zip(("load", "measure", "of", "unit"), zip(*keys, strict=True), strict=True)),
        value=Quantity("value").variable(dims, values),
        change=DIFFERENCE.variable(dims, (values - reference) / size),
        measured_change=CHANGE.named("measured difference").variable(dims, of_keys),
    ).assign_coords(variant=names)


def _numbers(runs: SpinRuns) -> dict[tuple[str, str, str, str], float]:
    """Return numbers in their units for reading, by load, measure, what they are of, and unit."""
    names = [*COMPARED, *(variable.name for variable in tabulated(runs.parameters))]
    numbers = dict[tuple[str, str, str, str], float]()
    for row, case in enumerate(runs.results):
        table = runs.measures.isel(load=row)
        shown = {name.replace("_", " "): table[name] for name in names if name in table}
        if window := steady_window(case.case.profile):
            steady = steady_amplitudes(case.record, window)
            speed = SPEED.text(abs(case.case.profile.speed_at(window[1])))
            shown[f"{STEADY}{speed}"] = of_measure("amplitude").on(steady)
        for words, array in shown.items():
            quantity = quantity_of(array)
            labels = itertools.product(*(map(str, array[dim].values) for dim in array.dims))
            for of, value in zip(labels, quantity.values(array).ravel().tolist(), strict=True):
                if case.has_gasket or of != ("gasket",):
                    numbers[case.case.name, words, " ".join(of), quantity.reading.label] = value
    return numbers


def _measured_changes(
    variants: Variants, references: Mapping[str, str], name: str
) -> dict[tuple[str, str, str], float]:
    """Return the measured changes of amplitudes by the gasket, by load, measure and sensor.

    There are none of a variant that is no machine with its gasket beside the same one without, and
    of cases that are not compared with measurements.
    """
    with_gasket, without = variants[name], variants[references[name]]
    pairs = list(zip(without.results, with_gasket.results, strict=True))
    if not all(other.has_gasket and not one.has_gasket for one, other in pairs):
        return {}
    changes = measured_changes(with_gasket.parameters)
    of_load = changes[changes["source"] == EXPERIMENT].set_index("load")
    return {
        (load, AMPLITUDE, sensor): float(CHANGE.unit.to_si(of_load.loc[load, sensor]))
        for one, other in pairs
        if without.is_compared(one) and with_gasket.is_compared(other)
        if (load := other.case.name) in of_load.index
        for sensor in with_gasket.parameters.sensors
    }


def _table(data: xr.Dataset) -> LabelledTable:
    """Return the differences as a table with columns for each variant.

    Args:
        data: As of `differences_of`.
    """
    columns: dict[str, Any] = {}
    for name in data.variant.values.tolist():
        of_variant = data.sel(variant=name, drop=True)
        columns[f"value_{name}"] = Quantity(name).variable("row", of_variant.value)
        for kind, words in (("change", "difference"), ("measured_change", "measured")):
            if of_variant[kind].notnull().any():
                quantity = CHANGE.named(f"{name}, {words}")
                columns[f"{kind}_{name}"] = quantity.variable("row", of_variant[kind])
    return LabelledTable(
        "differences",
        data[["load", "measure", "of", "unit"]].assign(columns),
        "Every measure of each load",
        "Every measure of each load in its unit, and the difference in percent of the same measure "
        "of the variant before, or of the first machine: (value − reference) / |reference|, [B] "
        f"Eq. (1). {MISSING}: this variant does not have the measure. Steady amplitude: mean of "
        "the envelope (analytic signal) in the last half of the stretch at the highest constant "
        "speed. Measured: the difference that the gasket makes in the experiment.",
    )


def _amplitudes(variants: Variants) -> LabelledTable:
    """Return computed and measured amplitudes of all variants, for files and the terminal."""
    every = {name: amplitudes_of(runs) for name, runs in variants.items()}
    of = [
        amplitudes.assign_coords(variant=("row", [name] * amplitudes.sizes["row"]))
        for name, amplitudes in every.items()
    ]
    joined = xr.concat(of, "row", join="outer", combine_attrs="override")
    return LabelledTable("amplitudes", joined, across="sensor", is_in_terminal=True)


def summary(variants: Variants, data: xr.Dataset) -> str:
    """Return one paragraph: largest amplitudes and smallest gaps, and what differs.

    Args:
        data: As of `differences_of`.
    """
    count = len(next(iter(variants.values())).results)
    loads = "1 load was" if count == 1 else f"{count} loads were"
    return " ".join(
        [
            f"{loads} run for each of {len(variants)} machines or variants.",
            *(_of_variant(name, runs) for name, runs in variants.items()),
            *_change_sentences(data),
            *_steady_sentences(data),
        ]
    )


def _of_variant(name: str, runs: SpinRuns) -> str:
    ended = [case for case in runs.results if not case.diverged]
    if not ended:
        return f"Every run of {name} diverged."
    amplitude = max(float(case.measures.amplitude.fillna(0.0).max()) for case in ended)
    text = f"{name}: largest amplitude {DISPLACEMENT.text(amplitude)}"
    gaps = [case.measures.smallest_gap for case in ended]
    distances = [gap.distance for gap in gaps if gap is not None]
    return f"{text}, smallest gap {GAP.text(min(distances))}." if distances else f"{text}."


def _places(data: xr.Dataset, measure: str) -> xr.Dataset:
    """Return the compared numbers of a measure, a `place` for each row and variant."""
    names = data.measure.values.tolist()
    chosen = [name == measure or (measure == STEADY and name.startswith(STEADY)) for name in names]
    of_measure = data.isel(row=chosen).stack(place=("row", "variant"))
    return of_measure.isel(place=np.isfinite(of_measure.change.values))


def _change_sentences(data: xr.Dataset) -> Iterator[str]:
    """Yield how much the amplitudes of each load differ, and whether as in the experiment."""
    places = _places(data, AMPLITUDE)
    for variant in dict.fromkeys(places.variant.values.tolist()):
        of_variant = places.isel(place=places.variant.values == variant)
        for load in dict.fromkeys(of_variant["load"].values.tolist()):
            change = of_variant.change[of_variant["load"].values == load]
            down, up = change[change.values.argmin()], change[change.values.argmax()]
            yield (
                f"Load {load}, {variant}: amplitudes differ by {CHANGE.text(down)} "
                f"({down.of.item()}) to {CHANGE.text(up)} ({up.of.item()})."
            )
    measured = places.isel(place=np.isfinite(places.measured_change.values))
    if measured.sizes["place"]:
        same = int((np.sign(measured.change) == np.sign(measured.measured_change)).sum())
        yield (
            f"The sign of the difference is that of the experiment in {same} of "
            f"{measured.sizes['place']} cases."
        )


def _steady_sentences(data: xr.Dataset) -> Iterator[str]:
    """Yield how much steady amplitudes differ: large ones in percent, small ones in mm."""
    places = _places(data, STEADY)
    change = STEADY_CHANGE.variable("place", places.change)
    value = of_measure("amplitude").reading.to_si(places.value.values)
    reference = value / (1.0 + change.values)
    is_large = reference >= LARGE_STEADY
    for kind, sizes, quantity, words in (
        (is_large, np.abs(change.values), STEADY_CHANGE, "of at least"),
        (~is_large, np.abs(value - reference), STEADY_SIZE, "below"),
    ):
        if kind.any():
            at = int(np.where(kind, sizes, -1.0).argmax())
            worst = places.isel(place=at)
            yield (
                f"{worst.measure.item().replace('amplitude', 'amplitudes').capitalize()} {words} "
                f"{DISPLACEMENT.text(LARGE_STEADY)} differ by up to "
                f"{quantity.text(sizes[at])} ({worst.of.item()}, load {worst['load'].item()}: "
                f"{STEADY_SIZE.text(reference[at])}, {worst.variant.item()} "
                f"{STEADY_SIZE.text(value[at])})."
            )


def _plot(variants: Variants) -> Plot | None:
    """Return the overlaid envelopes of each load, or None if no run has any."""
    figure = envelopes_figure(variants)
    if figure is None:
        return None
    cases = [case for runs in variants.values() for case in runs.results if case.has_envelopes]
    caption = (
        f"Displacement at each sensor over time, in the band {band_text(*cases)}. Each shaded area "
        "extends from the lower to the upper envelope. Dots: the largest absolute values, which "
        "the top of the panel gives with their drum speeds if there are up to "
        f"{MOST_MARKED} variants. Dashed lines: measured amplitude, on both sides of zero, in the "
        "colour of what was measured. The drum speed along the top is that of the longest run."
    )
    words = f"Overlaid envelopes of the displacement over time: {', '.join(variants)}."
    return Plot(figure, words, caption)


def envelopes_figure(variants: Variants) -> fig.Figure | None:
    """Return the envelopes of all variants over each other, one panel per load and sensor.

    Sensors that not all machines have are left out, and runs that are too short for the filter.

    Args:
        variants: At most as many as there are colours.
    """
    sensors = common_sensors([runs.parameters for runs in variants.values()])
    panels: list[fig.Panel | None] = []
    for index in range(len(next(iter(variants.values())).results)):
        cases = {
            name: case
            for name, runs in variants.items()
            if (case := runs.results[index]).has_envelopes
        }
        if cases:
            panels += _panels(variants, cases, sensors)
            panels += [None] * (-len(panels) % figures.COLUMNS)
    return figures.time_figure(panels) if panels else None


def _panels(
    variants: Variants, cases: Mapping[str, CaseResult], sensors: Sequence[str]
) -> list[fig.Panel]:
    """Return a panel for each sensor, with the envelopes of the cases of one load."""
    colors = dict(zip(variants, COLOURS, strict=False))
    bands = {name: envelopes(case.record) for name, case in cases.items()}
    longest = max((case.record for case in cases.values()), key=lambda record: record.time[-1])
    measured = _measured(variants, cases)
    sizes = [float(abs(band.sel(sensor=sensors)).to_array().max()) for band in bands.values()]
    sizes += [float(of.sel(sensor=sensors).max()) for of in measured.values()]
    has_texts = len(variants) <= MOST_MARKED
    lines = len(cases) if has_texts else 1
    limits = figures.symmetric_limits(float(DISPLACEMENT.values(max(sizes))), lines)
    panels = []
    for sensor in sensors:
        marks: list[fig.Mark] = []
        for line, (name, band) in enumerate(bands.items()):
            style, of_sensor = (colors[name], line), band.sel(sensor=sensor)
            shown = figures.envelope_marks(cases[name].record, of_sensor, limits[1], name, style)
            marks += shown if has_texts else shown[:1]
            if name in measured:
                rules = figures.experiment_rules(measured[name].sel(sensor=sensor), colors[name])
                marks += rules
        title = f"{next(iter(cases.values())).case.name}, {sensor}"
        panels.append(figures.time_panel(longest, title, marks, DISPLACEMENT.label, limits))
    return panels


def _measured(variants: Variants, cases: Mapping[str, CaseResult]) -> dict[str, xr.DataArray]:
    """Return the measured amplitudes of cases by variant; equal ones only once. [m]"""
    different: dict[str, xr.DataArray] = {}
    for name, case in cases.items():
        size = experiment_of(amplitudes_of(variants[name]), case)
        if size is not None and not any(size.equals(other) for other in different.values()):
            different[name] = size
    return different


def check_comparable(machines: Sequence[MachineParameters], where: str) -> None:
    """Raise an InputError if machines cannot be compared on one page.

    Their names must differ and they need at least one sensor of the same name.

    Args:
        where: Option that named the machines, for the message.
    """
    names = [machine.name for machine in machines]
    for name in names:
        if names.count(name) > 1:
            raise input_error(
                f"{names.count(name)} machines have the name '{name}'; give each machine file its "
                "own 'name'",
                where=where,
            )
    if not common_sensors(machines):
        sensors = "; ".join(f"'{m.name}' has {', '.join(m.sensors)}" for m in machines)
        raise input_error(f"the machines have no sensor of the same name: {sensors}", where=where)


def common_sensors(machines: Sequence[MachineParameters]) -> list[str]:
    """Return the names of the sensors that all machines have, in the order of the first one."""
    return [name for name in machines[0].sensors if all(name in m.sensors for m in machines)]


def different_parameters(machines: Mapping[str, MachineParameters]) -> list[str]:
    """Return a sentence for each parameter that differs between the machines."""
    texts = {
        name: {k: readable(value, unit) for k, value, unit in quantities(machine)}
        for name, machine in machines.items()
    }
    keys = dict.fromkeys(key for of_machine in texts.values() for key in of_machine)
    return [
        f"{key}: {', '.join(f'{of.get(key, MISSING)} ({name})' for name, of in texts.items())}"
        for key in keys
        if len({of.get(key) for of in texts.values()}) > 1
    ]


def remarks(variants: Variants) -> list[str]:
    """Return what a reader must know about variants whose conditions differ, as sentences."""
    sentences = []
    (name, first), *others = variants.items()
    for other, runs in others:
        both = f"'{name}' and '{other}'"
        sentences += [
            f"Load {a.case.name} is not the same in {both}."
            for a, b in zip(first.results, runs.results, strict=True)
            if a.case.load != b.case.load
        ]
        if first.results[0].case.profile != runs.results[0].case.profile:
            sentences.append(f"{both} follow different spin profiles.")
    machines = [runs.parameters for runs in variants.values()]
    shared = common_sensors(machines)
    for machine in machines:
        unshared = [name for name in machine.sensors if name not in shared]
        if unshared:
            sentences.append(
                f"Not all machines have the sensors {', '.join(unshared)} of '{machine.name}'; the "
                "figures leave them out."
            )
        for name in shared:
            axes = machines[0].sensors[name].axis, machine.sensors[name].axis
            if axes[0] != axes[1]:
                sentences.append(
                    f"Sensor {name} measures along {axes[0]} in '{machines[0].name}' and along "
                    f"{axes[1]} in '{machine.name}'."
                )
    return list(dict.fromkeys(sentences))


def steady_window(profile: SpinProfile) -> tuple[float, float] | None:
    """Return the time interval of the steady state; None if the profile has none. [s]

    It is the last part of the stretch of constant speed with the highest speed.
    """
    time, speed = np.array(profile.time), np.abs(profile.speed)
    constant = (np.diff(speed) == 0.0) & (speed[1:] > 0.0)
    if not constant.any():
        return None
    first = int(np.argmax(np.where(constant, speed[1:], -1.0)))
    begin, end = float(time[first]), float(time[first + 1])
    return end - STEADY_PART * (end - begin), end


def steady_amplitudes(record: Record, window: tuple[float, float]) -> xr.DataArray:
    """Return the amplitude of each sensor in the steady state: the mean smooth envelope. [m]"""
    return smooth_envelope(record).sel(time=slice(*window)).mean("time")
