"""Tables of a study of a spin cycle: cases, regions, displacements, feet, drive."""

import itertools

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.report.formatting import MISSING
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SPEED, TIME, quantity_of
from wm_drake.simulation.feet import MARGINS
from wm_drake.simulation.measures import MEASURES
from wm_drake.studies.spin.drive import drive_data
from wm_drake.studies.spin_cycle.measured import DIMS
from wm_drake.studies.spin_cycle.study import (
    ERROR,
    INTEGRATED,
    average_errors,
    compared_of,
    disagreement,
    largest,
    region_errors,
)

MASSES = ["front", "rear", "phase"]
"""Labels of the cases beside their names."""


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
        shown["average_error"] = ERROR.variable(
            "case", average_errors(compared_of(data), data.measured)
        )
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
        errors = region_errors(compared_of(data), data.measured)
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


def files_of(data: xr.Dataset) -> list[LabelledTable]:
    """Return what only files have: forces of the mounts, and tension of each spring."""
    mounts = [*MEASURES["mounts"].names]
    plain = data.reset_coords(MASSES, drop=True)
    return [
        LabelledTable("mounts", plain[mounts]),
        LabelledTable("springs", plain[["smallest_spring_tension"]]),
    ]


def feet_tables(parameters: MachineParameters, data: xr.Dataset) -> list[LabelledTable]:
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


def drive_tables(data: xr.Dataset) -> list[LabelledTable]:
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


def by_channel(displacement: xr.DataArray) -> xr.DataArray:
    """Return displacements with one dimension `channel` in place of sensor and axis."""
    names = [
        f"{sensor} {axis}"
        for sensor in displacement.accelerometer.values
        for axis in displacement.axis.values
    ]
    flat = displacement.reset_coords(drop=True).stack(channel=DIMS[2:])
    return flat.drop_vars(["channel", *DIMS[2:]]).assign_coords(channel=names)
