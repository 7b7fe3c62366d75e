"""Show the study of a spin cycle: displacements, cases, regions, forces on the floor, drive."""

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.unbalance_cases import UnbalanceCase
from wm_drake.parameters.units import Share, Unit
from wm_drake.report.formatting import MISSING, listed, slack_warning
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SPEED, STEP, TIME, Quantity, quantity_of, text_of
from wm_drake.simulation.feet import MARGINS
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.spring_tension import slack_springs
from wm_drake.simulation.vibration import MOST_MISSING
from wm_drake.studies.answer import Answer, Part, Plot, diverged_runs
from wm_drake.studies.spin.drive import drive_data
from wm_drake.studies.spin.study import gap_size
from wm_drake.studies.spin_cycle.figures import bars_figure, heat_map_figure, profile_figure
from wm_drake.studies.spin_cycle.measured import DIMS
from wm_drake.studies.spin_cycle.study import (
    ERROR,
    MASS,
    PHASE,
    average_errors,
    disagreement,
    largest,
    missing_regions,
    region_errors,
)

SHOWN_MASSES = ((0.4, 0.0, 0.0), (0.0, 0.4, 0.0), (0.4, 0.4, np.pi))
"""Front mass, rear mass and phase of the cases of [A] Figs. 24 to 26. [kg, kg, rad]"""

MASSES = ["front", "rear", "phase"]
"""Labels of the cases beside their names."""

LARGE_DISAGREEMENT = 0.01
"""Relative error of integrated displacements from which on a page warns of it."""

INTEGRATED = Quantity("direct vs. integrated", Share(), 2)


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
            Part("Forces on the floor", _feet_tables(parameters, data)),
            Part("Drive", _drive_tables(data)),
            Part(
                "Each case in numbers",
                (
                    LabelledTable(
                        "displacements",
                        by_channel(data.rms.sel(case=chosen)).to_dataset(name="rms"),
                        "Each case in numbers",
                        "RMS displacement of each sensor and axis.",
                        across="channel",
                        is_in_json=False,
                    ),
                    rms_table("rms", data.rms),
                    *([rms_table("measured", data.measured)] if "measured" in data else []),
                    rms_table("rms_from_acceleration", data.rms_from_acceleration),
                    *_files(data),
                ),
            ),
        ),
        (
            ("SDF model", Path(parameters.model).name),
            ("Engine", engine),
            ("Sensors", f"{', '.join(sensors)}; axes x to the right, y to the rear, z up"),
            (
                "Displacement",
                "from the rest position, with a high-pass filter of 0.5 Hz; RMS over all samples "
                f"of a region, one every {period}",
            ),
        ),
        warned=tuple(warnings_of(parameters, data, period)),
        diverged=diverged_runs(data),
    )


def case_description(case: UnbalanceCase) -> str:
    """Return the masses and the phase of a case, for example `400 g at the front`."""
    masses = [
        f"{MASS.text(mass)} {where}"
        for mass, where in ((case.front, "at the front"), (case.rear, "at the rear"))
        if mass > 0.0
    ]
    phase = f", {PHASE.number(case.phase)}° apart" if len(masses) == 2 else ""
    return (" and ".join(masses) or "empty drum") + phase


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


def summary(cases: Sequence[UnbalanceCase], data: xr.Dataset, engine: str) -> str:
    """Return one paragraph about displacements, gaps, and errors against a measurement."""
    about = {case.name: f"case {case.name} ({case_description(case)})" for case in cases}
    sentences = [
        f"{len(cases)} unbalance case{'s were' if len(cases) > 1 else ' was'} run over the spin "
        f"profile with the {engine} engine."
    ]
    worst, gaps = largest(data.rms), data.smallest_gap.dropna("case")
    if worst.notnull():
        sentences.append(
            f"The largest RMS displacement is {text_of(worst)}. It occurs in "
            f"{about[worst.case.item()]}, in region {worst.region.item()}, at sensor "
            f"{worst.accelerometer.item()}, axis {worst.axis.item()}."
        )
    if gaps.size:
        smallest = gaps.isel(case=gaps.argmin("case"))
        sentences.append(
            "The smallest gap between tub and housing is "
            f"{gap_size(smallest.item())}, in {about[smallest.case.item()]}."
        )
    apart = float(disagreement(data).max())
    if np.isfinite(apart):
        sentences.append(
            "The RMS displacements computed directly and by integrating the acceleration twice "
            f"differ by at most {INTEGRATED.text(apart)} in any region."
        )
    return " ".join([*sentences, _about_measurement(data)])


def _about_measurement(data: xr.Dataset) -> str:
    if "measured" not in data:
        return "No measurement was given for comparison."
    errors = average_errors(data.rms, data.measured)
    missing = missing_regions(data.rms, data.measured)
    without = f" without {listed(list(missing))}" if missing else ""
    return (
        f"Compared with the measurement{without}, the average error is "
        f"{ERROR.text(errors.mean())}, with a standard deviation of {ERROR.text(errors.std())} "
        "over the cases. ([A] reports 20.1 % and 4.1 % for its own model and machine.)"
    )


def warnings_of(parameters: MachineParameters, data: xr.Dataset, period: str) -> list[str]:
    """Return warnings about divergence, overlap, slack springs, feet, integration, imperfections.

    Args:
        period: Time between samples, as text.
    """
    texts = [
        f"Case {text}. Regions that this run did not complete have no values."
        for text in diverged_runs(data)
    ]
    texts += missing_warnings(data.rms, data.measured) if "measured" in data else []
    touching = data.case.values[data.smallest_gap.values <= 0.0].tolist()
    if touching:
        texts.append(
            f"Tub and housing overlap in case {', '.join(touching)}. The model has no contact "
            "forces. In the real machine, tub and housing would collide."
        )
    tensions = data.smallest_spring_tension
    slack = {name: slack_springs(tensions.sel(case=name)) for name in data.case.values.tolist()}
    texts += slack_warning(slack, "case")
    texts += floor_warnings(parameters, data)
    apart = float(disagreement(data).max())
    if apart > LARGE_DISAGREEMENT:
        texts.append(
            "In at least one region, the RMS displacements from integrated acceleration differ by "
            f"{ERROR.text(apart)} from the direct ones. The motion there is too small for "
            f"the integration, or too fast for a sampling interval of {period}."
        )
    return texts + _imperfections(parameters)


def _imperfections(parameters: MachineParameters) -> list[str]:
    """Return a sentence for each imperfection of a machine."""
    texts, faults = [], parameters.imperfections
    if faults.residual_imbalance.mass > 0.0:
        mass = Quantity("", MASS.unit, 1).text(faults.residual_imbalance.mass)
        texts.append(f"The drum has a residual imbalance of {mass}.")
    if faults.phase_error != 0.0:
        angle = Quantity("", PHASE.unit, 1).number(faults.phase_error)
        texts.append(f"The phase between front and rear masses has an error of {angle}°.")
    if faults.bearing:
        radial = Quantity("", Unit("N/m", "N/mm"), 0).text(faults.bearing.radial_stiffness)
        tilting = Quantity("", Unit("N*m/rad", "N*m/rad"), 0)
        texts.append(
            "The drum bearing is compliant, so the drum can whirl: the radial stiffness is "
            f"{radial} and the tilting stiffness {tilting.text(faults.bearing.tilting_stiffness)}."
        )
    return texts


def missing_warnings(computed: xr.DataArray, measured: xr.DataArray) -> list[str]:
    """Return a warning of the regions that the errors leave out, or none."""
    missing = missing_regions(computed, measured)
    if not missing:
        return []
    parts = [f"{region} in case {', '.join(cases)}" for region, cases in missing.items()]
    return [
        f"The errors leave regions out, which have no measured value or were not completed by the "
        f"run: {'; '.join(parts)}. A record counts for a region if at most "
        f"{Quantity('', Share(), 0).text(MOST_MISSING)} of it is missing at its end."
    ]


def floor_warnings(parameters: MachineParameters, data: xr.Dataset) -> list[str]:
    """Return a warning that names the cases in which the cabinet would slide, turn or tip."""
    if parameters.cabinet is None:
        return []
    margins = np.min([data[name].values for name in MARGINS[1:]], axis=0)
    moving = data.case.values[(margins <= 0.0) & (data.diverged.values == "")].tolist()
    if not moving:
        return []
    if parameters.cabinet_moves:
        return [f"The cabinet slides, turns or lifts a side in case {', '.join(moving)}."]
    return [
        f"The cabinet would slide, turn or tip over in case {', '.join(moving)}. The model keeps "
        "it in its place."
    ]


def profile_plot(profile: SpinProfile) -> Plot:
    """Return the spin profile with its regions."""
    names = ", ".join(region.name for region in profile.regions)
    return Plot(
        profile_figure(profile),
        f"Spin profile with the regions {names}.",
        "Drum speed over time. Shaded areas: regions.",
    )


def by_channel(displacement: xr.DataArray) -> xr.DataArray:
    """Return displacements with one dimension `channel` in place of sensor and axis."""
    names = [
        f"{sensor} {axis}"
        for sensor in displacement.accelerometer.values
        for axis in displacement.axis.values
    ]
    flat = displacement.reset_coords(drop=True).stack(channel=DIMS[2:])
    return flat.drop_vars(["channel", *DIMS[2:]]).assign_coords(channel=names)


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
    figure = bars_figure(of_case.rms, of_case.get("rms_from_acceleration"), measured)
    return Plot(figure, f"{title}: RMS displacement per region.", caption)


def cases_table(data: xr.Dataset) -> LabelledTable:
    """Return the cases with their results; a collision or a slack spring is an alarm."""
    worst = largest(data.rms, DIMS[:1])
    sensor = worst.accelerometer + " " + worst.axis
    tension = data.smallest_spring_tension.min("spring", keep_attrs=True)
    shown = {
        "largest_rms": _named(worst, "largest RMS"),
        "in_region": ("case", np.where(worst.notnull(), worst.region, MISSING)),
        "sensor_axis": ("case", np.where(worst.notnull(), sensor, MISSING)),
        "smallest_gap": data.smallest_gap.variable,
        "smallest_spring_tension": _named(tension, "smallest spring tension"),
        "is_alarm": ("case", (data.smallest_gap.values <= 0.0) | (tension.values == 0.0)),
    }
    caption = (
        "Cases in the order of the input table, with the largest RMS displacement of any sensor "
        "and axis in any region, the smallest gap between tub and housing, and the smallest "
        "tension of any spring; a spring goes slack at 0."
    )
    if "measured" in data:
        shown["average_error"] = ERROR.variable("case", average_errors(data.rms, data.measured))
        caption += (
            " Average error: mean over regions, sensors and axes of |measured − computed| / "
            "measured."
        )
    if data.published_error.notnull().any():
        shown["published_error"] = data.published_error.variable
        caption += (
            " [A] Table 9: average error of the model of [A] against the experiment of [A], with "
            "its own machine."
        )
    labels = {name: data[name] for name in ("case", *MASSES)}
    return LabelledTable(
        "cases",
        xr.Dataset(shown, labels),
        "Cases",
        caption,
        marked=("is_alarm", "alarm"),
        is_in_terminal=True,
    )


def regions_table(profile: SpinProfile, data: xr.Dataset) -> LabelledTable:
    """Return limits and results of each region, and its errors if there is a measurement.

    One column compares RMS displacements computed directly and by integrating the acceleration.
    """
    worst = largest(data.rms, DIMS[1:2])
    at = [(region.begin, region.end) for region in profile.regions]
    shown = {
        "begin": TIME.named("from").variable("region", [begin for begin, _ in at]),
        "end": TIME.named("to").variable("region", [end for _, end in at]),
        "speeds": ("region", [_speeds_text(profile, *ends) for ends in at]),
        "largest_rms": _named(worst, "largest RMS"),
        "in_case": ("region", np.where(worst.notnull(), worst.case, MISSING)),
        "disagreement": INTEGRATED.variable("region", disagreement(data).max("case")),
    }
    caption = (
        "Regions of the spin profile. Direct vs. integrated: difference between the RMS "
        "displacements computed directly and by integrating the acceleration twice, with norms "
        "over all sensors and axes, for the worst case."
    )
    if "measured" in data:
        errors = region_errors(data.rms, data.measured)
        mean = ERROR.named("mean error, [A] Eq. (9)")
        shown["mean_error"] = mean.variable("region", errors.mean("case"))
        # as in [A], of these cases, not an estimate for a population
        deviation = ERROR.named("standard deviation")
        shown["deviation"] = deviation.variable("region", errors.std("case"))
        caption += (
            " Error: |measured − computed| / |measured| with norms over sensors and axes, [A] Eq. "
            "(9); mean and standard deviation over the cases."
        )
    return LabelledTable("regions", xr.Dataset(shown, {"region": data.region}), "Regions", caption)


def _speeds_text(profile: SpinProfile, begin: float, end: float) -> str:
    """Return the drum speeds at the corners of a profile between two times."""
    inner = (time for time in profile.time if begin < time < end)
    speeds = map(SPEED.number, profile.speed_at([begin, *inner, end]))
    return f"{' – '.join(text for text, _ in itertools.groupby(speeds))} {SPEED.unit_text}"


def _named(array: xr.DataArray, words: str) -> xr.Variable:
    """Return the variable of an array with other words."""
    variable = array.variable.copy()
    variable.attrs = quantity_of(array).named(words).attributes()
    return variable


def rms_table(name: str, displacement: xr.DataArray) -> LabelledTable:
    """Return RMS displacements in the form of files with measured ones, see `read_rms`."""
    data = displacement.reset_coords(drop=True).rename(accelerometer="sensor")
    return LabelledTable(name, data.to_dataset(name="rms"))


def _files(data: xr.Dataset) -> list[LabelledTable]:
    """Return what only files have: forces of the mounts, and tension of each spring."""
    mounts = [*MEASURES["mounts"].names]
    plain = data.reset_coords(MASSES, drop=True)
    return [
        LabelledTable("mounts", plain[mounts]),
        LabelledTable("springs", plain[["smallest_spring_tension"]]),
    ]


def _feet_tables(parameters: MachineParameters, data: xr.Dataset) -> list[LabelledTable]:
    """Return the smallest loads and margins of each case and region; none without a cabinet."""
    if parameters.cabinet is None:
        return []
    plain = data.reset_coords(MASSES, drop=True)
    margins = plain[[*MARGINS]]
    margins["turn_margin_smallest_in"] = plain.region_turn_margin.fillna(np.inf).idxmin("region")
    margins["moves"] = margins[[*MARGINS]].to_array().min("variable") <= 0.0
    which, below = "which the model keeps in its place", "Below 0 the cabinet would slide, turn"
    if parameters.cabinet_moves:
        which, below = "which moves on them", "At 0 the cabinet slides or turns, or is about to"
    caption = (
        f"Feet of the rigid cabinet, {which}: smallest normal load of any foot; horizontal force "
        "that friction can still take; vertical moment that friction can still take beside it, "
        "and the region where this is smallest; moment that still keeps the cabinet down. "
        f"{below} or tip. feet_regions.csv has each region."
    )
    table = LabelledTable(
        "feet", margins, "Forces on the floor", caption, marked=("moves", "alarm")
    )
    return [table, LabelledTable("feet_regions", plain[[*MEASURES["feet regions"].names]])]


def _drive_tables(data: xr.Dataset) -> list[LabelledTable]:
    """Return the measures of the drive of each case; none without a motor."""
    if "drive_peak_torque" not in data:
        return []
    caption = (
        "Drive: largest torque on the drum; largest torque averaged over a revolution, and the "
        "speed there; largest power; work over the run; speed ripple, the largest coefficient of "
        "fluctuation in a revolution; speed at the end; speed and mean torque at which the drum "
        "stays below the wanted speed (Sommerfeld effect)."
    )
    of_drive = drive_data(data.reset_coords(MASSES, drop=True))
    return [LabelledTable("drive", of_drive, "Drive", caption, marked=("is_caught", "alarm"))]
