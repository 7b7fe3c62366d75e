"""Show spin runs: the answer, pictures of each load, tables of all measures."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from wm_drake.parameters import quantities
from wm_drake.parameters.measured import measured_notes
from wm_drake.parameters.plausibility import unusual_numbers
from wm_drake.report.formatting import slack_warning
from wm_drake.report.labelled import LabelledTable, rows_of
from wm_drake.report.page import versions_of
from wm_drake.report.quantity import CHANGE, SHARE, SPEED, Quantity
from wm_drake.report.table import readable
from wm_drake.simulation.balance import rings_of
from wm_drake.simulation.displacements import have_one_orbit
from wm_drake.simulation.measures.registry import tabulated
from wm_drake.simulation.records import save_record
from wm_drake.simulation.spring_tension import slack_springs
from wm_drake.studies.answer import Answer, Part, Plot, WritesFile
from wm_drake.studies.modes.page import natural_modes_table
from wm_drake.studies.spin import figures
from wm_drake.studies.spin.data import (
    DISPLACEMENT,
    FORCE,
    MOMENT,
    OURS,
    about_runs,
    amplitudes_of,
    differences_of,
    experiment_of,
    gaps_of,
    loads_of,
    mounts_of,
    of_sensors,
    profiles_of,
    row_of,
)
from wm_drake.studies.spin.drive import capture_warnings, drive_in_short, drive_parts
from wm_drake.studies.spin.floor import floor_parts, floor_warnings
from wm_drake.studies.spin.study import (
    GAP,
    CaseResult,
    ComparedCases,
    SpinRuns,
    band_text,
    write_replay,
)
from wm_drake.studies.spin.vibration import vibration_plots
from wm_drake.studies.stops import stops_sentence

if TYPE_CHECKING:
    from wm_drake.studies.modes.study import NaturalModes

AXES = (
    "Axes: for a person who faces the door, x points to the right, y along the drum axis from "
    "front to rear, and z up. The origin is on the drum axis at drum mid-depth, with the tub at "
    "rest."
)

ONE_VIBRATION = (
    "Mount forces, accelerations and spectra are drawn for this load only, that with the largest "
    "amplitude; the option --detail draws them for every load."
)

MODES = (
    "With load {} in a drum that stands still. The command 'wm-drake study modes' has the mode "
    "shapes, the Campbell diagram, critical speeds and sensitivities; 'wm-drake study response' "
    "has the steady response."
)

VERDICT = (
    "'wm-drake verdict' adds random laundry to these loads, and finds what decides the gap and "
    "what to change."
)
"""How the verdict differs from this page."""


MOMENT_OF_GASKET = Quantity("moment", MOMENT.unit, 2)


@dataclass(frozen=True)
class Files:
    """Which files and pictures of spin runs are written beside the usual ones.

    Attributes:
        replay: A 3D replay for each case.
        detail: Pictures of vibration for every case, not only for the one with the largest
            amplitude.
        records: The record of each case.
        part: Part of the names of files that tells machines apart; "" for a single machine.
    """

    replay: bool = False
    detail: bool = False
    records: bool = True
    part: str = ""

    def replay_of(self, case: CaseResult) -> str:
        """Return the name of the file with the 3D replay of a case; "" if there is none."""
        return f"replay_{self._name_of(case)}.html" if self.replay else ""

    def of_runs(self, runs: SpinRuns) -> dict[str, WritesFile]:
        """Return what writes records and replays, by the names of their files."""
        files: dict[str, WritesFile] = {}
        for case in runs.results:
            if self.records:
                files[f"record_{self._name_of(case)}.nc"] = partial(save_record, case.record)
            if name := self.replay_of(case):
                files[name] = partial(write_replay, runs.parameters, case)
        return files

    def _name_of(self, case: CaseResult) -> str:
        return "_".join(filter(None, [self.part, case.case.name]))


def spin_answer(
    runs: SpinRuns, modes: "NaturalModes | None" = None, files: Files | None = None
) -> Answer:
    """Return the answer of spin runs of one machine.

    Args:
        modes: Natural modes of the machine with the load of the first case; None if it has none or
            they are not shown.
        files: What is written beside the usual files.
    """
    files, amplitudes = files or Files(), amplitudes_of(runs)
    parts = (
        *_case_parts(runs, amplitudes, files),
        *_measure_parts(runs, amplitudes),
        _modes_part(modes),
        _inputs_part(runs),
    )
    times = "; ".join(f"{case.title} {case.wall_s:.1f} s" for case in runs.results)
    return Answer(
        f"Spin run of machine {runs.parameters.name}",
        summary(runs, amplitudes),
        runs.parameters,
        parts,
        (
            ("SDF model", Path(runs.parameters.model).name),
            ("Engine", f"{runs.engine}, {runs.stepping_text}"),
            ("Versions of the runs", versions_of(runs.results[0].record.attrs)),
            ("Computing time", times),
        ),
        f"{AXES} {drive_in_short(runs)}",
        files.of_runs(runs),
        tuple(warnings_of(runs)),
        diverged=runs.failures(),
    )


def _case_parts(runs: SpinRuns, amplitudes: xr.Dataset, files: Files) -> list[Part]:
    """Return a part for each case; that with the largest amplitude has its vibration too."""
    main, parts = max(runs.results, key=lambda case: _peak(case)[0]), []
    for case in runs.results:
        title, file = case.title, files.replay_of(case)
        words = f"3D replay of load {title} around its largest amplitude"
        text = _case_facts(case)
        drawn = (_envelopes_plot(case, amplitudes), _orbits_plot(case), _gasket_plot(case))
        plots = [plot for plot in drawn if plot]
        if (files.detail or case is main) and case.record.sizes["time"] > 1:
            plots += vibration_plots(runs, case)
        if case is main and not files.detail and len(runs.results) > 1:
            text = f"{text} {ONE_VIBRATION}"
        parts.append(Part(f"Load {title}", plots, text, [(file, words)] if file else []))
    return parts


def _measure_parts(runs: SpinRuns, amplitudes: xr.Dataset) -> list[Part]:
    """Return the parts with the measures of all cases."""
    drive, drive_numbers = drive_parts(runs)
    feet, floor = floor_parts(runs)
    balls, remaining = Part("Balls"), Part("Remaining unbalance")
    if rings_of(runs.parameters):
        from wm_drake.studies.spin.balance import balance_parts  # few machines have rings

        balls, remaining = balance_parts(runs)
    gaps = gaps_of(runs)
    plots = [_gaps_plot(gaps)] if gaps.sizes["load"] > 1 else []
    tension = runs.measures[["smallest_spring_tension"]]
    slack = tension.assign(is_slack=(tension.smallest_spring_tension == 0.0).any("spring"))
    return [
        Part("Smallest gaps", plots, VERDICT if plots else ""),
        balls,
        feet,
        drive,
        Part("Amplitudes", amplitude_tables(runs, amplitudes)),
        Part("Sensors", (sensors_table(runs),), is_folded=True),
        Part("Smallest gap", (gaps_table(gaps),)),
        Part("Detergent box and gasket", (largest_table(runs),)),
        Part("Mounts", (_mounts_table(runs),), is_folded=True),
        remaining,
        floor,
        drive_numbers,
        Part(
            "Springs",
            (
                LabelledTable(
                    "springs",
                    slack,
                    "Springs",
                    "Smallest tension of each spring over all samples. A spring that only pulls "
                    "goes slack at 0; a spring that also pushes can fall below.",
                    across="spring",
                    marked=("is_slack", "alarm"),
                    is_in_terminal=True,
                ),
            ),
        ),
        Part("More measures", _more_tables(runs)),
    ]


def _modes_part(modes: "NaturalModes | None") -> Part:
    if modes is None:
        return Part("Natural modes")
    table = replace(natural_modes_table(modes), is_in_terminal=False)
    return Part("Natural modes", (table,), MODES.format(modes.load))


def _inputs_part(runs: SpinRuns) -> Part:
    """Return what was run: loads, spin profiles, and numbers of a case that differ."""
    tables = [
        LabelledTable(
            "loads",
            loads_of(runs),
            "Loads",
            "Loads: point masses in the drum. A mass with phase 0 is at the top when the drum "
            "angle is 0. y is measured from drum mid-depth to the rear.",
        ),
        LabelledTable(
            "profiles",
            profiles_of(runs),
            "Spin profile",
            "Spin profile. The drum speed is linear between these points.",
        ),
        LabelledTable("runs", about_runs(runs)),
    ]
    changed = changed_parameters(runs)
    if changed.sizes["row"]:
        about = "Parameters of loads that differ from those of the machine."
        tables.append(LabelledTable("changed", changed, "Changed parameters", about))
    return Part("What was run", tables, is_folded=True)


def summary(runs: SpinRuns, amplitudes: xr.Dataset) -> str:
    """Return one paragraph about the cases that reached their end."""
    ended = [case for case in runs.results if not case.diverged]
    count, diverged = len(runs.results), len(runs.results) - len(ended)
    cases = "1 case was" if count == 1 else f"{count} cases were"
    speed = SPEED.text(max(case.case.profile.highest_speed for case in runs.results))
    opening = f"{cases} run with the {runs.engine} engine, at drum speeds up to {speed}."
    if not ended:
        return f"{opening} Every run diverged, so there is no result to summarize."
    if diverged:
        excluded = "1 run diverged and is" if diverged == 1 else f"{diverged} runs diverged and are"
        opening += f" {excluded} excluded from this summary."
    main = max(ended, key=lambda case: _peak(case)[0])
    largest = f"The largest amplitude occurs with load {main.title}: {_peak_text(main)}."
    contact = _contact_sentence(ended), stops_sentence(runs.measures)
    sentences = (*contact, opening, largest, _agreement(runs, ended, amplitudes))
    return " ".join(filter(None, sentences))


def _peak(case: CaseResult) -> tuple[float, str, float]:
    """Return the largest amplitude [m], its sensor, and the drum speed there [rad/s].

    The amplitude is 0 if the run was too short for the filter.
    """
    amplitude = case.measures.amplitude.fillna(0.0)
    index = int(np.argmax(amplitude.values))
    speed = float(case.measures.critical_speed.values[index])
    return float(amplitude.values[index]), str(amplitude.sensor.values[index]), speed


def _peak_text(case: CaseResult) -> str:
    size, sensor, speed = _peak(case)
    return f"{DISPLACEMENT.text(size)} at sensor {sensor}, at {SPEED.text(speed)}"


def _contact_sentence(cases: list[CaseResult]) -> str:
    """Return whether the tub touches, the smallest gap and where it is, and that of each load."""
    gaps = [(gap, case) for case in cases if (gap := case.measures.smallest_gap)]
    if not gaps:
        return "The SDF has no shapes on both tub and housing, so contact cannot be judged."
    gap, case = min(gaps, key=lambda pair: pair[0].distance)
    speed = SPEED.text(case.speed_at(gap.time))
    size, does = f"smallest gap {GAP.text(gap.distance)}", "does not touch"
    if gap.distance <= 0.0:
        size, does = f"overlap of {GAP.text(-gap.distance)}", "touches"
    loads = [f"{c.title} {GAP.text(g.distance)}" for g, c in gaps]
    per_load = f" Smallest gap per load: {', '.join(loads)}." if len(gaps) > 1 else ""
    place = f"between {gap.parts}, with load {case.title} at {speed}"
    return f"The tub {does} the housing: {size}, {place}.{per_load}"


def _case_facts(case: CaseResult) -> str:
    facts = "The run is too short for the band-pass filter, so it has no amplitudes."
    if case.has_envelopes:
        facts = f"Largest amplitude: {_peak_text(case)}."
    gap = case.gap_text
    return f"{facts} Smallest gap to the housing: {gap}." if gap else facts


def _agreement(runs: SpinRuns, cases: list[CaseResult], amplitudes: xr.Dataset) -> str:
    """Return how far the computed amplitudes are from measured ones, or why that is not known."""
    changes = differences_of(amplitudes)
    rows = {case.title: row_of(changes, case, OURS) for case in cases}
    of_cases = {title: row.difference for title, row in rows.items() if row is not None}
    if not of_cases:
        return _why_not_compared(runs)
    joined = xr.concat([*of_cases.values()], xr.Variable("case", [*of_cases]))
    places = joined.stack(place=("case", "sensor"))
    compared = places[np.isfinite(places.values)]
    if not compared.size:
        return _why_not_compared(runs)
    worst = compared[int(np.abs(compared.values).argmax())]
    mean = SHARE.text(abs(compared).mean())
    return (
        f"{compared.size} amplitudes can be compared with the experiment. The mean absolute "
        f"difference is {mean}. The largest difference is {CHANGE.text(worst)}, at sensor "
        f"{worst.sensor.item()} with load {worst.case.item()}."
    )


def _why_not_compared(runs: SpinRuns) -> str:
    if not runs.parameters.measured:
        return "The machine file has no measured amplitudes."
    if runs.comparison is ComparedCases.NONE:
        return (
            "There is no comparison with the measured amplitudes of the machine file, because its "
            "numbers were changed."
        )
    if not any(runs.is_compared(case) for case in runs.results):
        return (
            "There is no comparison with the measured amplitudes of the machine file, because they "
            "belong to other loads or to another spin profile."
        )
    return "The machine file has no measured amplitudes for these cases."


def warnings_of(runs: SpinRuns) -> list[str]:
    """Return warnings about unusual numbers, runs that diverged, gaps, springs, feet and drive."""
    unusual = unusual_numbers(runs.parameters)
    return [
        *(f"{problem.key}: {problem.message}." for problem in unusual),
        *(f"Load {text}. The results cover the time before that." for text in runs.failures()),
        *overlap_warnings(runs),
        *slack_warning(
            {c.title: slack_springs(c.measures.smallest_tension) for c in runs.results}, "load"
        ),
        *floor_warnings(runs),
        *capture_warnings(runs),
    ]


def overlap_warnings(runs: SpinRuns) -> list[str]:
    """Return a warning for each load with which tub and housing overlap."""
    gaps = [(case.title, case.measures.smallest_gap) for case in runs.results]
    return [
        f"Load {title}: {gap.parts} overlap by {GAP.text(-gap.distance)}. The model has no "
        "contact forces but those of stops. In the real machine these parts would collide, and the "
        "motion after that is not valid."
        for title, gap in gaps
        if gap is not None and gap.distance <= 0.0
    ]


def amplitude_tables(runs: SpinRuns, amplitudes: xr.Dataset) -> list[LabelledTable]:
    """Return the amplitudes, and their differences from measured ones if there are any.

    Args:
        amplitudes: As of `amplitudes_of`.
    """
    notes = measured_notes(runs.parameters) if any(map(runs.is_compared, runs.results)) else []
    caption = (
        "Amplitude of the displacement at each sensor: the largest absolute value of its envelopes "
        f"in the band {band_text(*runs.results)}."
    )
    tables = [
        LabelledTable(
            "amplitudes",
            amplitudes,
            f"Displacement amplitudes of machine '{runs.parameters.name}'",
            " ".join([caption, *notes]),
            across="sensor",
            is_in_terminal=True,
        )
    ]
    differences = differences_of(amplitudes)
    if differences.sizes["row"]:
        about = "Differences from the experiment: (value − experiment) / experiment, [B] Eq. (1)."
        is_ours = ("row", differences.source.values == OURS)
        tables.append(
            LabelledTable(
                "differences",
                differences.assign(is_ours=is_ours),
                "Differences from the experiment",
                about,
                across="sensor",
                marked=("is_ours", "difference"),
            )
        )
    return tables


def sensors_table(runs: SpinRuns) -> LabelledTable:
    """Return amplitude, critical speed and acceleration of each sensor."""
    return LabelledTable(
        "sensors",
        of_sensors(runs),
        "Sensors",
        "Amplitude of each sensor; critical speed: the drum speed at which its displacement is "
        "largest; acceleration of the tub along its axis: largest absolute value and RMS over the "
        "whole run, without gravity and unfiltered.",
    )


def gaps_table(gaps: xr.Dataset) -> LabelledTable:
    """Return the smallest gap of each case: its width, the two parts, the time and the place."""
    return LabelledTable(
        "gaps",
        gaps,
        "Smallest gap",
        "Smallest gap between the housing and the parts that move with the tub, over all samples. "
        "A negative gap means that the parts overlap. x (to the right), y (to the rear), z (up): "
        "position of the nearest point of the moving part, from drum mid-depth at rest.",
        marked=("touches", "alarm"),
        is_in_terminal=True,
    )


def largest_table(runs: SpinRuns) -> LabelledTable:
    """Return D, F and M of [B] for each case and axis."""
    names = {
        "detergent_displacement": DISPLACEMENT.named("D"),
        "gasket_force": FORCE.named("F"),
        "gasket_moment": MOMENT_OF_GASKET.named("M"),
    }
    data = runs.measures[[*names]]
    for name, quantity in names.items():
        data[name].attrs = quantity.attributes()
    parameters = runs.parameters
    assumed = f" (assumption: frame {parameters.clearance_frame}, as the first sensor)"
    return LabelledTable(
        "largest",
        data,
        "Detergent box and gasket",
        "D: largest displacement, from the rest position, of the tub point nearest to the "
        f"detergent box{'' if parameters.clearance else assumed}. F, M: largest force and moment "
        "of the gasket on the housing. All are the largest absolute values over the whole run, "
        "for each axis.",
    )


def _mounts_table(runs: SpinRuns) -> LabelledTable:
    return LabelledTable(
        "mounts",
        mounts_of(runs),
        "Forces of the mounts",
        "Size of the force of each mount on the cabinet: at rest, largest with its drum speed, and "
        "RMS without the mean in ranges of drum speed or in the regions of the profile.",
        across="range",
    )


def _more_tables(runs: SpinRuns) -> list[LabelledTable]:
    """Return a table of each variable that has no other place on the page."""
    return [
        LabelledTable(
            variable.name,
            runs.measures[[variable.name]],
            variable.kind.capitalize(),
            f"{variable.about[0].upper()}{variable.about[1:]}.",
            across=variable.dims[-1] if variable.dims else "",
            is_in_terminal=True,
        )
        for variable in tabulated(runs.parameters)
    ]


def changed_parameters(runs: SpinRuns) -> xr.Dataset:
    """Return the parameters of cases that differ from those of the machine, as text."""
    common = {key: value for key, value, _ in quantities(runs.parameters)}
    rows = [
        (label, key, readable(value, unit))
        for label, case in zip(runs.labels, runs.results, strict=True)
        for key, value, unit in quantities(case.case.parameters or runs.parameters)
        if case.case.parameters is not None and common.get(key) != value
    ]
    labels = {"load": [load for load, *_ in rows], "key": [key for _, key, _ in rows]}
    return rows_of(labels, value=("row", [text for *_, text in rows]))


def _envelopes_plot(case: CaseResult, amplitudes: xr.Dataset) -> Plot | None:
    if not case.has_envelopes:
        return None
    measured, of_case = experiment_of(amplitudes, case), case.measures.amplitude
    largest = ", ".join(
        f"{name} {DISPLACEMENT.text(of_case.sel(sensor=name))}" for name in of_case.sensor.values
    )
    caption = (
        f"Displacement at each sensor over time, in the band {band_text(case)}. The shaded area "
        "extends from the lower to the upper envelope. The dot marks the largest absolute value; "
        "the top of the panel gives this value and its drum speed. All panels have the same scale."
    )
    if measured is not None:
        caption += " Dashed lines: measured amplitude, on both sides of zero."
    alternative = f"Envelopes of the displacement over time, load {case.title}. Largest: {largest}."
    return Plot(figures.envelopes_figure(case.record, measured), alternative, caption)


def _orbits_plot(case: CaseResult) -> Plot | None:
    if case.record.sizes["time"] < 2:
        return None
    depths = case.record.sensor_point.sel(axis="y")
    ends = float(depths.min()), float(depths.max())
    is_one = have_one_orbit(*ends)
    planes = "plane of the sensors" if is_one else "planes of the foremost and the rearmost sensor"
    caption = (
        f"Path of the drum axis in the {planes}, seen from the front of the machine. Dot and dark "
        "line: the moment of the largest amplitude of all sensors, and the drum revolution around "
        "it. Pale line: the revolutions before and after."
    )
    orbits = "Orbit of the drum axis" if is_one else "Orbits of the drum axis, front and rear"
    alternative = f"{orbits}, around the largest amplitude, load {case.title}."
    return Plot(figures.orbits_figure(case.record, *ends), alternative, caption)


def _gasket_plot(case: CaseResult) -> Plot | None:
    if not case.has_gasket or case.record.sizes["time"] < 2:
        return None
    force, moment = (
        np.asarray(values).max()
        for values in (case.measures.gasket_force, case.measures.gasket_moment)
    )
    caption = (
        "Force (upper row) and moment (lower row) of the gasket on the housing over time. "
        "The shaded area extends from the smallest to the largest value within each drum "
        "revolution. The dot marks the largest absolute value."
    )
    alternative = (
        f"Gasket force and moment over time, load {case.title}. Largest force {FORCE.text(force)}, "
        f"largest moment {MOMENT_OF_GASKET.text(moment)}."
    )
    return Plot(figures.gasket_figure(case.record), alternative, caption)


def _gaps_plot(gaps: xr.Dataset) -> Plot:
    caption = (
        "Smallest gap for each load, the two parts between which it occurs, and the drum speed at "
        "that time."
    )
    words = "Smallest gap between tub and housing per load; the numbers are in the table below."
    return Plot(figures.gaps_figure(gaps), words, caption)
