"""Show the study of a spin cycle: displacements, cases, regions, forces on the floor, drive."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.unbalance_cases import UnbalanceCase
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import STEP
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.experiment import failures
from wm_drake.studies.spin_cycle.figures import bars_figure, heat_map_figure, profile_figure
from wm_drake.studies.spin_cycle.findings import case_description, summary, warnings_of
from wm_drake.studies.spin_cycle.measured import DIMS
from wm_drake.studies.spin_cycle.study import compared_of, largest
from wm_drake.studies.spin_cycle.tables import (
    by_channel,
    cases_table,
    drive_tables,
    feet_tables,
    files_of,
    regions_table,
    rms_table,
)

SHOWN_MASSES = ((0.4, 0.0, 0.0), (0.0, 0.4, 0.0), (0.4, 0.4, np.pi))
"""Front mass, rear mass and phase of the cases of [A] Figs. 24 to 26. [kg, kg, rad]"""


def spin_cycle_answer(
    parameters: MachineParameters,
    profile: SpinProfile,
    cases: Sequence[UnbalanceCase],
    data: xr.Dataset,
    engine: str,
) -> Answer:
    """Return the answer of the study.

    Args:
        data: As of `run_spin_cycle` in `wm_drake.studies.spin_cycle.study`, with measured RMS
            displacements as `measured` if there are any.
    """
    titles = {case.name: f"Case {case.name}: {case_description(case)}" for case in cases}
    chosen = shown_cases(cases, data)
    sensors = [
        f"{name} (frame {frame})" for name, frame in parameters.accelerometer_frames().items()
    ]
    period = STEP.text(profile.sample_period(parameters.output_period))
    return Answer(
        f"Spin cycle of machine {parameters.name}",
        summary(cases, data, engine),
        parameters,
        (
            Part("Spin profile", (profile_plot(profile),)),
            _worst(data),
            Part("Displacements of each case", [bars_plot(data, n, titles[n]) for n in chosen]),
            Part("Cases", (cases_table(data),)),
            Part("Regions", (regions_table(profile, data),)),
            Part("Forces on the floor", feet_tables(parameters, data)),
            Part("Drive", drive_tables(data)),
            Part("Each case in numbers", _numbers(data, chosen)),
        ),
        (
            ("SDF model", Path(parameters.model).name),
            ("Sensors", f"{', '.join(sensors)}; axes x to the right, y to the rear, z up"),
            (
                "Displacement",
                "from the rest position, with a high-pass filter of 0.5 Hz; RMS over all samples "
                f"of a region, one every {period}",
            ),
        ),
        warned=tuple(warnings_of(parameters, data, period)),
        diverged=failures(data),
    )


def shown_cases(cases: Sequence[UnbalanceCase], data: xr.Dataset) -> list[str]:
    """Return the names of the cases that the page shows in detail.

    These are the cases of the figures of [A], or the first three if none of them was run, and the
    case with the largest RMS displacement.
    """
    published = [
        case.name
        for masses in SHOWN_MASSES
        for case in cases
        if np.allclose((case.front, case.rear, case.phase), masses, atol=1e-6)
    ]
    worst = largest(data.rms)
    chosen = published or [case.name for case in cases[:3]]
    return list(dict.fromkeys([*chosen, *([worst.case.item()] if worst.notnull() else [])]))


def profile_plot(profile: SpinProfile) -> Plot:
    """Return the spin profile with its regions."""
    names = ", ".join(region.name for region in profile.regions)
    return Plot(
        profile_figure(profile),
        f"Spin profile with the regions {names}.",
        "Drum speed over time. Shaded areas: regions.",
    )


def _worst(data: xr.Dataset) -> Part:
    """Return the largest displacements of all cases; no picture if no run completed a region."""
    if largest(data.rms).isnull():
        return Part("Largest displacements", text="No run completed a region.")
    values, several = largest(data.rms, DIMS[1:]), data.sizes["case"] > 1
    names = by_channel(values.case).values
    caption = (
        "Largest RMS displacement of all cases, for each region (rows), sensor and axis (columns)."
    )
    if several:
        caption += " The case in which it occurs is given below the number."
    notes = [[f"case {name}" if several else "" for name in row] for row in names]
    figure = heat_map_figure(by_channel(values), notes)
    words = "Heat map of the largest RMS displacement, region by sensor and axis."
    return Part("Largest displacements", (Plot(figure, words, caption),))


def bars_plot(data: xr.Dataset, case: str, title: str) -> Plot:
    """Return the RMS displacements of a case per region, beside those measured."""
    of_case = data.sel(case=case)
    measured = of_case.get("measured")
    if measured is not None and not np.isfinite(measured).any():
        measured = None
    caption = (
        f"{title}: RMS displacement per region. Each row is a sensor, each column an axis. All "
        "panels have the same scale."
    )
    computed = of_case.rms if measured is None else compared_of(of_case)
    figure = bars_figure(computed, of_case.get("rms_from_acceleration"), measured)
    return Plot(figure, f"{title}: RMS displacement per region.", caption)


def _numbers(data: xr.Dataset, chosen: Sequence[str]) -> list[LabelledTable]:
    """Return displacements of each sensor, of chosen cases on the page and of all in files."""
    shown = LabelledTable(
        "displacements",
        by_channel(data.rms.sel(case=chosen)).to_dataset(name="rms"),
        "Each case in numbers",
        "RMS displacement of each sensor and axis.",
        across="channel",
        is_in_json=False,
    )
    names = [
        name
        for name in ("rms", "measured", "rms_from_acceleration", "rms_recorded")
        if name in data
    ]
    return [shown, *(rms_table(name, data[name]) for name in names), *files_of(data)]
