"""The report of a spin run: one HTML file that needs nothing else."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from wm_drake.model.scene import Gap
from wm_drake.report import tables
from wm_drake.report.figures import envelopes_figure, gaps_figure, gasket_figure, orbits_figure
from wm_drake.report.page import Picture, picture, render, versions_of
from wm_drake.report.tables import Table, amplitude_table
from wm_drake.report.wording import (
    MM_PER_M,
    RPM_PER_RAD_S,
    case_title,
    has_gasket,
    number,
    percent,
    shape_name,
    speed_rpm,
)
from wm_drake.studies.spin.study import CaseResult, SpinResult

__all__ = ["amplitude_table", "spin_report"]


@dataclass(frozen=True)
class CaseView:
    """What the page shows of one case; `facts` are short sentences above its figures."""

    anchor: str
    title: str
    facts: str
    pictures: tuple[Picture, ...]
    changed: Table | None


def spin_report(result: SpinResult, command: str = "") -> str:
    """The report as text of one HTML file, with style and figures inside.

    Args:
        result: At least one case.
        command: The command line that made it, to be shown.

    Raises:
        InputError: a file of measured amplitudes cannot be used.
    """
    table = amplitude_table(result)
    return render(
        "spin/page.html",
        title=f"Spin run of machine {result.parameters.name}",
        about=result.parameters.about,
        summary=summary(result, table),
        warnings=warnings_of(result),
        comparison=tables.comparison(result, table),
        largest_values=tables.largest_values(result),
        critical_speeds=tables.critical_speeds(result),
        smallest_gaps=tables.smallest_gaps(result),
        gaps_picture=_gaps_picture(result),
        cases=[_case_view(result, index, table) for index in range(len(result.results))],
        facts=facts_of_run(result, command),
        loads=tables.loads(result),
        profiles=tables.profiles(result),
        numbers=tables.parameter_table(result.parameters),
    )


def summary(result: SpinResult, table: pd.DataFrame) -> str:
    """One paragraph, made from the numbers of the cases that came to their end."""
    ended = [case for case in result.results if not case.record.attrs["diverged"]]
    count = len(result.results)
    runs = "1 case was" if count == 1 else f"{count} cases were"
    speed = number(RPM_PER_RAD_S * max(max(case.case.profile.speed) for case in result.results), 0)
    opening = f"{runs} run, at drum speeds up to {speed} rpm, with the {result.engine} engine."
    if not ended:
        return f"{opening} None came to its end, so there is nothing to sum up."
    if len(ended) < count:
        opening += f" {count - len(ended)} diverged and {'is' if count - len(ended) == 1 else 'are'} left out of this paragraph."
    return " ".join(
        filter(None, [opening, _largest_motion(ended), _nearest(ended), _agreement(ended, table)])
    )


def _largest_motion(cases: list[CaseResult]) -> str:
    case = max(cases, key=lambda case: _peak(case)[0])
    size, sensor, speed = _peak(case)
    return f"The tub moves most with load {case_title(case)}: {number(size)} mm at sensor {sensor}, at {number(speed, 0)} rpm."


def _peak(case: CaseResult) -> tuple[float, str, float]:
    """Largest amplitude [mm], its sensor, and the drum speed there [rpm]; 0 where the run was too short for the filter."""
    amplitude = case.measures.amplitude.fillna(0.0)
    index = int(np.argmax(amplitude.values))
    speed = float(case.measures.critical_speed.values[index])
    return (
        MM_PER_M * float(amplitude.values[index]),
        str(amplitude.sensor.values[index]),
        RPM_PER_RAD_S * speed,
    )


def _nearest(cases: list[CaseResult]) -> str:
    found = [(case.measures.smallest_gap, case) for case in cases if case.measures.smallest_gap]
    if not found:
        return ""
    gap, case = min(found, key=lambda pair: pair[0].distance)
    return f"The smallest gap to the housing occurs with load {case_title(case)}: {_gap_words(case, gap)}."


def _gap_words(case: CaseResult, gap: Gap) -> str:
    speed = number(speed_rpm(case, gap.time), 0)
    return f"{number(MM_PER_M * gap.distance)} mm between {shape_name(gap.moving)} and {shape_name(gap.fixed)}, at {speed} rpm"


def _case_facts(case: CaseResult) -> str:
    size, sensor, speed = _peak(case)
    facts = "The run is too short for the filter: it has no amplitudes."
    if _has_envelopes(case):
        facts = f"Largest motion: {number(size)} mm at sensor {sensor}, at {number(speed, 0)} rpm."
    gap = case.measures.smallest_gap
    return f"{facts} Smallest gap to the housing: {_gap_words(case, gap)}." if gap else facts


def _agreement(cases: list[CaseResult], table: pd.DataFrame) -> str:
    changes = [
        change
        for case in cases
        for change in tables.differences(table, case)
        if np.isfinite(change.percent)
    ]
    if not changes:
        return "The machine file has no measured amplitudes of these cases to compare with."
    mean = float(np.mean([abs(change.percent) for change in changes]))
    worst = max(changes, key=lambda change: abs(change.percent))
    return (
        f"Against the experiment, {len(changes)} amplitudes can be compared: they differ by {number(mean, 0)} % in the mean "
        f"of absolute values and by {percent(worst.percent)} at most: sensor {worst.sensor}, load {worst.case}."
    )


def warnings_of(result: SpinResult) -> list[str]:
    """What a reader must know before trusting the numbers: runs that diverged, parts that overlap, another profile."""
    found = []
    for case in result.results:
        gap, title = case.measures.smallest_gap, case_title(case)
        if case.record.attrs["diverged"]:
            found.append(
                f"Load {title}: {case.record.attrs['diverged']}. Its numbers below are those up to then."
            )
        if gap is not None and gap.distance <= 0.0:
            parts = f"{shape_name(gap.moving)} and {shape_name(gap.fixed)}"
            found.append(
                f"Load {title}: {parts} overlap by {number(-MM_PER_M * gap.distance)} mm. The model has no contact: the real "
                "machine would strike there, and what follows is not to be trusted."
            )
        if case.case.profile != result.parameters.profile:
            found.append(
                f"Load {title}: the spin profile is not the machine file's, to which measured amplitudes belong."
            )
    return found


def facts_of_run(result: SpinResult, command: str) -> list[tuple[str, str]]:
    """What was run and by what, as pairs of word and text."""
    attrs = result.results[0].record.attrs
    times = [f"{case_title(case)} {number(case.wall_s)} s" for case in result.results]
    facts = [
        ("Machine", result.parameters.name),
        ("About", result.parameters.about),
        ("SDF model", Path(result.parameters.model).name),
        ("Engine", f"{result.engine}, step {1e3 * result.step:g} ms"),
        ("Versions", versions_of(attrs)),
        ("Computing time", "; ".join(times)),
        ("Command", command),
    ]
    return [(word, text) for word, text in facts if text]


def _case_view(result: SpinResult, index: int, table: pd.DataFrame) -> CaseView:
    case = result.results[index]
    pictures = (_envelopes_picture(case, table), _orbits_picture(case), _gasket_picture(case))
    shown = tuple(picture for picture in pictures if picture is not None)
    return CaseView(
        f"case-{index + 1}",
        case_title(case),
        _case_facts(case),
        shown,
        tables.changed_numbers(result, case),
    )


def _has_envelopes(case: CaseResult) -> bool:
    return not bool(case.measures.amplitude.isnull().any())


def _envelopes_picture(case: CaseResult, table: pd.DataFrame) -> Picture | None:
    if not _has_envelopes(case):
        return None
    measured = tables.experiment_mm(table, case)
    amplitude = case.measures.amplitude
    largest = ", ".join(
        f"{name} {number(MM_PER_M * float(amplitude.sel(sensor=name)))} mm"
        for name in amplitude.sensor.values
    )
    caption = (
        "Displacement at each sensor over the run, band 0.5–20 Hz. The band reaches from the lower to the upper envelope; the "
        "dot is where it is widest from zero, with its drum speed written above. All panels have the same scale."
    )
    if measured is not None:
        caption += " Dashed: measured amplitude, on both sides of zero."
    alternative = (
        f"Envelopes of the displacement over time, load {case_title(case)}. Largest: {largest}."
    )
    return picture(envelopes_figure(case.record, measured), alternative, caption)


def _orbits_picture(case: CaseResult) -> Picture | None:
    if case.record.sizes["time"] < 2:
        return None
    depths = case.record.sensor_point.sel(axis="y")
    caption = (
        "Path of the drum axis, seen from the front of the machine, in the planes of the foremost and the rearmost sensor. "
        "Strong line: the drum revolution in which the axis is farthest from rest; pale line: those before and after it."
    )
    alternative = f"Orbits of the drum axis, front and rear, around the largest motion, load {case_title(case)}."
    return picture(
        orbits_figure(case.record, float(depths.min()), float(depths.max())), alternative, caption
    )


def _gasket_picture(case: CaseResult) -> Picture | None:
    if not has_gasket(case) or case.record.sizes["time"] < 2:
        return None
    force, moment = (
        np.asarray(values) for values in (case.measures.gasket_force, case.measures.gasket_moment)
    )
    caption = (
        "Force (upper row, N) and moment (lower row, N m) of the gasket on the housing. The band reaches from the smallest to "
        "the largest value within each drum revolution; the dot is the largest absolute value."
    )
    alternative = (
        f"Gasket force and moment over time, load {case_title(case)}. Largest force {number(float(force.max()))} N, largest "
        f"moment {number(float(moment.max()), 2)} N m."
    )
    return picture(gasket_figure(case.record), alternative, caption)


def _gaps_picture(result: SpinResult) -> Picture | None:
    cases = [case for case in result.results if case.measures.smallest_gap]
    if len(cases) < 2:
        return None
    caption = "Smallest gap of each load, the two parts between which it occurs, and the drum speed at that moment."
    return picture(
        gaps_figure(cases),
        "Smallest gap between tub and housing per load; the numbers are in the table above.",
        caption,
    )
