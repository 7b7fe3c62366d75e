"""What the study of a spin cycle shows: files, JSON, terminal and page."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters.unbalance_cases import UnbalanceCase
from wm_drake.report.formatting import (
    MM_PER_M,
    MS_PER_S,
    gap_size,
    listed,
    number,
    plain,
    slack_warning,
)
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.terminal import Printed
from wm_drake.simulation.measures.as_json import as_json
from wm_drake.simulation.spring_tension import slack_springs
from wm_drake.studies.spin_cycle import tables
from wm_drake.studies.spin_cycle.figures import bars_figure, heat_map_figure, profile_figure
from wm_drake.studies.spin_cycle.measured import rms_table
from wm_drake.studies.spin_cycle.study import (
    SpinCycleResult,
    average_errors,
    disagreement,
    largest,
    mean_and_deviation,
    missing_regions,
    region_errors,
)
from wm_drake.studies.study import Facts, Result

SHOWN_MASSES = ((0.4, 0.0, 0.0), (0.0, 0.4, 0.0), (0.4, 0.4, 180.0))
"""Front mass, rear mass and phase of the cases of [A] Figs. 24 to 26. [kg, kg, deg]"""


@dataclass(frozen=True)
class SpinCycleReport(Result):
    """Result of the study, and the engine of its runs."""

    result: SpinCycleResult
    engine: str

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return RMS displacements, cases and, if measured, feet and drive."""
        result, drive = self.result, tables.drive_frame(self.result)
        shown = {"rms": rms_table(result.displacement), "cases": tables.case_frame(result)}
        if "turn_margin" in result.forces:
            shown["feet"] = tables.feet_frame(result)
        return shown if drive is None else shown | {"drive": drive}

    def write(self, folder: Path) -> None:
        """Write the tables; that of the cases has four digits."""
        super().write(folder)
        table = tables.case_frame(self.result)
        table.to_csv(folder / "cases.csv", index=False, float_format="%.4g")

    def as_json(self) -> dict[str, Any]:
        """Return the result for JSON."""
        result = self.result
        shown = {
            "machine": result.parameters.name,
            "engine": self.engine,
            "regions": [region.name for region in result.profile.regions],
            "sensors": list(map(str, result.displacement.accelerometer.values)),
            "axes": list(map(str, result.displacement.axis.values)),
            "cases": [
                _case_as_json(result, case, diverged)
                for case, diverged in zip(result.cases, result.diverged, strict=True)
            ],
            "disagreement_of_integration": disagreement(result).max("case"),
        }
        if result.measured is not None:
            errors = region_errors(result.displacement, result.measured)
            mean, deviation = mean_and_deviation(errors)
            shown["relative_error"] = {
                "by_region_mean": mean,
                "by_region_deviation": deviation,
                "by_case_average": average_errors(result.displacement, result.measured),
                "missing_regions": missing_regions(result.displacement, result.measured),
            }
        return plain(shown)

    def terminal(self) -> Printed:
        """Return the table of the cases."""
        title = f"Spin cycle of machine '{self.result.parameters.name}'"
        return [tables.cases(self.result).terminal(title)]

    def warnings(self) -> list[str]:
        """Return a warning of the regions that the errors leave out, if there are any."""
        return _missing(self.result)

    def failures(self) -> list[str]:
        """Return a line for each case that diverged."""
        pairs = zip(self.result.cases, self.result.diverged, strict=True)
        return [f"case {case.name}: {text}" for case, text in pairs if text]

    def page(self, facts: Facts) -> str:
        """Return the page: profile, largest displacements, cases, floor and drive."""
        result = self.result
        shown = shown_cases(result)
        titles = {case.name: f"Case {case.name}: {case_description(case)}" for case in shown}
        bars = tuple(_bars(result, case, title) for case, title in titles.items())
        numbers = tuple(tables.displacements(result, case, title) for case, title in titles.items())
        worst = _worst_picture(result)
        remark = "" if worst else "No run completed a region."
        sections = [
            Section("profile", "Spin profile", (_profile_picture(result),)),
            Section("worst", "Largest displacements", worst, text=remark),
            Section("each", "Displacements of each case", bars),
            Section("cases", "Cases", tables=(tables.cases(result),)),
            Section("regions", "Regions", tables=(tables.regions(result),)),
        ]
        for anchor, heading, table in (
            ("floor", "Forces on the floor", tables.floor_table(result)),
            ("drive", "Drive", tables.drive_table(result)),
        ):
            if table:
                sections.append(Section(anchor, heading, tables=(table,)))
        sections.append(Section("numbers", "Each case in numbers", tables=numbers))
        return SectionedPage(
            f"Spin cycle of machine {result.parameters.name}",
            summary(result, self.engine),
            sections,
            _facts(result, self.engine, facts),
            result.parameters,
            [*facts.warnings, *warnings_of(result)],
        ).html()


def _missing(result: SpinCycleResult) -> list[str]:
    if result.measured is None:
        return []
    return tables.missing_warnings(result.displacement, result.measured)


def _case_as_json(result: SpinCycleResult, case: UnbalanceCase, diverged: str) -> dict[str, Any]:
    here = {"case": case.name}
    tension, forces = result.smallest_tension.sel(here), as_json(result.forces.sel(here))
    return {
        "case": case.name,
        "front_kg": case.front,
        "rear_kg": case.rear,
        "phase_deg": float(np.rad2deg(case.phase)),
        "rms_mm": 1e3 * result.displacement.sel(here),
        "rms_from_acceleration_mm": 1e3 * result.integrated.sel(here),
        "smallest_gap_mm": 1e3 * result.smallest_gap.sel(here),
        "smallest_spring_tension_N": dict(
            zip(map(str, tension.spring.values), tension.values, strict=True)
        ),
        **{key: forces.get(key) for key in ("mount_force_N", "feet", "motor")},
        "diverged": diverged or None,
    }


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
            f"{gap_size(float(gaps.min()))}, in case {nearest} "
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
        missing = missing_regions(result.displacement, result.measured)
        without = f" without {listed(list(missing))}" if missing else ""
        sentences.append(
            f"Compared with the measurement{without}, the average error is {mean} %, with a "
            f"standard deviation of {deviation} % over the cases. ([A] reports 20.1 % and 4.1 % "
            "for its own model and machine.)"
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
    published = [
        case
        for masses in SHOWN_MASSES
        for case in result.cases
        if np.allclose((case.front, case.rear, np.rad2deg(case.phase)), masses, atol=1e-6)
    ]
    worst = largest(result.displacement)
    chosen = (published or list(result.cases[:3])) + ([_case(result, worst.case)] if worst else [])
    return list({case.name: case for case in chosen}.values())


def warnings_of(result: SpinCycleResult) -> list[str]:
    """Return warnings about divergence, overlap, slack springs, integration, imperfections."""
    texts = [
        f"Case {case.name}: {text}. Regions that this run did not complete have no values."
        for case, text in zip(result.cases, result.diverged, strict=True)
        if text
    ]
    texts += _missing(result)
    gaps = result.smallest_gap
    touching = list(map(str, gaps.case.values[gaps.values <= 0.0]))
    if touching:
        texts.append(
            f"Tub and housing overlap in case {', '.join(touching)}. The model has no contact "
            "forces. In the real machine, tub and housing would collide."
        )
    smallest = result.smallest_tension
    names = map(str, smallest.case.values)
    texts += slack_warning({c: slack_springs(smallest.sel(case=c)) for c in names}, "case")
    texts += tables.floor_warnings(result)
    apart = float(disagreement(result).max(skipna=True))
    if apart > 0.01:
        texts.append(
            "In at least one region, the RMS displacements from integrated acceleration differ by "
            f"{number(100 * apart, 1)} % from the direct ones. The motion there is too small for "
            f"the integration, or too fast for a sampling interval of {_sample_period(result)}."
        )
    faults = result.parameters.imperfections
    if faults.residual_imbalance.mass > 0.0:
        texts.append(
            "The drum has a residual imbalance of "
            f"{number(1e3 * faults.residual_imbalance.mass)} g."
        )
    if faults.phase_error != 0.0:
        texts.append(
            "The phase between front and rear masses has an error of "
            f"{number(float(np.rad2deg(faults.phase_error)))}°."
        )
    if faults.bearing:
        radial, tilting = 1e-3 * faults.bearing.radial_stiffness, faults.bearing.tilting_stiffness
        texts.append(
            "The drum bearing is compliant, so the drum can whirl: the radial stiffness is "
            f"{number(radial, 0)} N/mm and the tilting stiffness {number(tilting, 0)} N m/rad."
        )
    return texts


def _sample_period(result: SpinCycleResult) -> str:
    """Return the time between the samples of a run."""
    period = result.profile.sample_period(result.parameters.output_period)
    return f"{MS_PER_S * period:g} ms"


def _case(result: SpinCycleResult, name: str) -> UnbalanceCase:
    return next(case for case in result.cases if case.name == name)


def _profile_picture(result: SpinCycleResult) -> Picture:
    names = ", ".join(region.name for region in result.profile.regions)
    return picture(
        profile_figure(result.profile),
        f"Spin profile with the regions {names}.",
        "Drum speed over time. Shaded areas: regions.",
    )


def _worst_picture(result: SpinCycleResult) -> tuple[Picture, ...]:
    """Return the largest displacements of all cases; nothing if no run completed a region."""
    if largest(result.displacement) is None:
        return ()
    values, which = tables.worst_of_all(result.displacement)
    regions = list(map(str, result.displacement.region.values))
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
    values = np.where(values < 0.0, np.nan, values)
    figure = heat_map_figure(values, regions, tables.channels(result.displacement), notes)
    words = "Heat map of the largest RMS displacement, region by sensor and axis."
    return (picture(figure, words, caption),)


def _bars(result: SpinCycleResult, case: str, title: str) -> Picture:
    computed, integrated = (v.sel(case=case) for v in (result.displacement, result.integrated))
    measured = result.measured.sel(case=case) if result.measured is not None else None
    if measured is not None and not np.isfinite(measured).any():
        measured = None
    caption = (
        f"{title}: RMS displacement per region. Each row is a sensor, each column an axis. All "
        "panels have the same scale."
    )
    words = f"{title}: RMS displacement per region."
    return picture(bars_figure(computed, integrated, measured), words, caption)


def _facts(result: SpinCycleResult, engine: str, facts: Facts) -> list[tuple[str, str]]:
    sensors = [
        f"{name} (frame {frame})"
        for name, frame in result.parameters.accelerometer_frames().items()
    ]
    return [
        ("Machine", result.parameters.name),
        ("SDF model", Path(result.parameters.model).name),
        ("Engine", engine),
        ("Sensors", f"{', '.join(sensors)}; axes x to the right, y to the rear, z up"),
        (
            "Displacement",
            "from the rest position, with a high-pass filter of 0.5 Hz; RMS over all samples of a "
            f"region, one every {_sample_period(result)}",
        ),
        *facts.rows(),
    ]
