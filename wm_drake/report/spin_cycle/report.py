"""Report of a spin-cycle study: one self-contained HTML file."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wm_drake.parameters.unbalance_cases import UnbalanceCase
from wm_drake.report.formatting import MM_PER_M, number
from wm_drake.report.page import Picture, picture, render
from wm_drake.report.spin_cycle import tables
from wm_drake.report.spin_cycle.drive import drive_table
from wm_drake.report.spin_cycle.figures import bars_figure, heat_map_figure, profile_figure
from wm_drake.report.spin_cycle.floor import floor_table, floor_warnings
from wm_drake.report.springs import slack_warning
from wm_drake.report.tables import Table, parameter_table
from wm_drake.simulation.records import versions
from wm_drake.simulation.spring_tension import slack_springs
from wm_drake.studies.spin_cycle.study import SpinCycleResult, average_errors, disagreement, largest

SHOWN_MASSES = ((0.4, 0.0, 0.0), (0.0, 0.4, 0.0), (0.4, 0.4, 180.0))
"""Front mass, rear mass and phase of the cases of [A] Figs. 24 to 26. [kg, kg, deg]"""


@dataclass(frozen=True)
class CaseView:
    """Section of the page about one case."""

    anchor: str
    title: str
    picture: Picture
    table: Table


def spin_cycle_report(result: SpinCycleResult, engine: str, command: str = "") -> str:
    """Return the report as text of one self-contained HTML file.

    Args:
        result: Result with at least one case.
        engine: Name of the engine of the runs.
        command: Command line of the study, shown on the page.
    """
    return render(
        "spin_cycle/page.html",
        title=f"Spin cycle of machine {result.parameters.name}",
        about=result.parameters.about,
        summary=summary(result, engine),
        warnings=warnings_of(result),
        profile_picture=_profile_picture(result),
        regions=tables.regions(result),
        worst_picture=_worst_picture(result),
        cases_table=tables.cases(result),
        floor_table=floor_table(result),
        drive_table=drive_table(result),
        cases=[_case_view(result, case) for case in shown_cases(result)],
        facts=_facts(result, engine, command),
        numbers=parameter_table(result.parameters),
    )


def summary(result: SpinCycleResult, engine: str) -> str:
    """Return one paragraph about displacements, gaps, and errors against a measurement."""
    count = len(result.cases)
    sentences = [
        f"{count} unbalance case{'s were' if count > 1 else ' was'} run over the spin profile with "
        f"the {engine} engine."
    ]
    worst = largest(result.displacement)
    if worst:
        sentences.append(
            f"The largest RMS displacement is {number(MM_PER_M * worst.value, 2)} mm. It occurs in "
            f"case {worst.case} ({case_description(_case(result, worst.case))}), in region "
            f"{worst.region}, at sensor {worst.accelerometer}, axis {worst.axis}."
        )
    gaps = result.smallest_gap.dropna("case")
    if gaps.size:
        nearest = str(gaps.case.values[int(np.argmin(gaps.values))])
        sentences.append(
            "The smallest gap between tub and housing is "
            f"{number(MM_PER_M * float(gaps.min()))} mm, in case {nearest} "
            f"({case_description(_case(result, nearest))})."
        )
    apart = float(disagreement(result).max(skipna=True))
    if np.isfinite(apart):
        sentences.append(
            "The RMS displacements computed directly and by integrating the acceleration twice "
            f"differ by at most {number(100 * apart, 2)} % in any region."
        )
    if result.measured is None:
        sentences.append("No measurement was given for comparison.")
    else:
        errors = average_errors(result.displacement, result.measured)
        mean, deviation = (
            number(100.0 * float(value))
            for value in (errors.mean(skipna=True), errors.std(skipna=True))
        )
        sentences.append(
            f"Compared with the measurement, the average error is {mean} %, with a standard "
            f"deviation of {deviation} % over the cases. ([A] reports 20.1 % and 4.1 % for its own "
            "model and machine.)"
        )
    return " ".join(sentences)


def case_description(case: UnbalanceCase) -> str:
    """Return the masses and the phase of a case, for example `400 g at the front`."""
    masses = [
        f"{number(1e3 * mass, 0)} g {where}"
        for mass, where in ((case.front, "at the front"), (case.rear, "at the rear"))
        if mass > 0.0
    ]
    phase = f", {number(float(np.rad2deg(case.phase)), 0)}° apart" if len(masses) == 2 else ""
    return (" and ".join(masses) or "empty drum") + phase


def shown_cases(result: SpinCycleResult) -> list[UnbalanceCase]:
    """Return the cases that the page shows in detail.

    These are the cases of the figures of [A], or the first three if none of them was run, and the
    case with the largest RMS displacement.
    """
    wanted = [
        case
        for masses in SHOWN_MASSES
        for case in result.cases
        if np.allclose((case.front, case.rear, np.rad2deg(case.phase)), masses, atol=1e-6)
    ]
    worst = largest(result.displacement)
    chosen = (wanted or list(result.cases[:3])) + ([_case(result, worst.case)] if worst else [])
    return list({case.name: case for case in chosen}.values())


def warnings_of(result: SpinCycleResult) -> list[str]:
    """Return warnings about divergence, overlap, slack springs, integration, imperfections."""
    found = [
        f"Case {case.name}: {text}. Regions that this run did not complete have no values."
        for case, text in zip(result.cases, result.diverged, strict=True)
        if text
    ]
    touching = [
        str(name)
        for name, gap in zip(
            result.smallest_gap.case.values, result.smallest_gap.values, strict=True
        )
        if gap <= 0.0
    ]
    if touching:
        found.append(
            f"Tub and housing overlap in case {', '.join(touching)}. The model has no contact "
            "forces. In the real machine, tub and housing would collide."
        )
    smallest = result.smallest_tension
    names = map(str, smallest.case.values)
    found += slack_warning({c: slack_springs(smallest.sel(case=c)) for c in names}, "case")
    found += floor_warnings(result)
    apart = float(disagreement(result).max(skipna=True))
    if apart > 0.01:
        found.append(
            "In at least one region, the RMS displacements from integrated acceleration differ by "
            f"{number(100 * apart, 1)} % from the direct ones. The motion there is too small for "
            "the integration, or too fast for a sampling interval of 5 ms."
        )
    faults = result.parameters.imperfections
    if faults.residual_imbalance.mass > 0.0:
        found.append(
            "The drum has a residual imbalance of "
            f"{number(1e3 * faults.residual_imbalance.mass)} g."
        )
    if faults.phase_error != 0.0:
        found.append(
            "The phase between front and rear masses has an error of "
            f"{number(float(np.rad2deg(faults.phase_error)))}°."
        )
    if faults.bearing:
        radial, tilting = 1e-3 * faults.bearing.radial_stiffness, faults.bearing.tilting_stiffness
        found.append(
            "The drum bearing is compliant, so the drum can whirl: the radial stiffness is "
            f"{number(radial, 0)} N/mm and the tilting stiffness {number(tilting, 0)} N m/rad."
        )
    return found


def _case(result: SpinCycleResult, name: str) -> UnbalanceCase:
    return next(case for case in result.cases if case.name == name)


def _profile_picture(result: SpinCycleResult) -> Picture:
    names = ", ".join(region.name for region in result.profile.regions)
    return picture(
        profile_figure(result.profile),
        f"Spin profile with the regions {names}.",
        "Drum speed over time. Shaded areas: regions.",
    )


def _worst_picture(result: SpinCycleResult) -> Picture | None:
    if largest(result.displacement) is None:
        return None
    values, which = tables.worst_of_all(result.displacement)
    shown = result.displacement
    columns = [
        f"{sensor} {axis}" for sensor in shown.accelerometer.values for axis in shown.axis.values
    ]
    notes = [
        [f"case {result.cases[index].name}" if len(result.cases) > 1 else "" for index in row]
        for row in which
    ]
    caption = (
        "Largest RMS displacement of all cases in mm, for each region (rows), sensor and axis "
        "(columns)."
    )
    if len(result.cases) > 1:
        caption += " The case in which it occurs is given below the number."
    figure = heat_map_figure(
        np.where(values < 0.0, np.nan, values), list(map(str, shown.region.values)), columns, notes
    )
    return picture(
        figure, "Heat map of the largest RMS displacement, region by sensor and axis.", caption
    )


def _case_view(result: SpinCycleResult, case: UnbalanceCase) -> CaseView:
    computed, integrated = (
        values.sel(case=case.name) for values in (result.displacement, result.integrated)
    )
    measured = result.measured.sel(case=case.name) if result.measured is not None else None
    if measured is not None and not np.isfinite(measured).any():
        measured = None
    title = f"Case {case.name}: {case_description(case)}"
    caption = (
        "RMS displacement per region. Each row is a sensor, each column an axis. All panels have "
        "the same scale."
    )
    shown = picture(
        bars_figure(computed, integrated, measured),
        f"{title}: RMS displacement per region.",
        caption,
    )
    return CaseView(
        f"case-{re.sub(r'[^A-Za-z0-9_-]', '-', case.name)}",
        title,
        shown,
        tables.displacements(result, case.name),
    )


def _facts(result: SpinCycleResult, engine: str, command: str) -> list[tuple[str, str]]:
    sensors = [
        f"{name} (frame {frame})"
        for name, frame in result.parameters.accelerometer_frames().items()
    ]
    facts = [
        ("Machine", result.parameters.name),
        ("SDF model", Path(result.parameters.model).name),
        ("Engine", engine),
        ("Sensors", f"{', '.join(sensors)}; axes x to the right, y to the rear, z up"),
        (
            "Displacement",
            "from the rest position, with a high-pass filter of 0.5 Hz; RMS over all samples of a "
            "region, one every 5 ms",
        ),
        ("Versions", ", ".join(f"{name} {text}" for name, text in versions().items())),
        ("Command", command),
    ]
    return [(word, text) for word, text in facts if text]
