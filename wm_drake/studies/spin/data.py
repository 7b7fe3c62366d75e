"""Datasets of spin runs: what tables, files, JSON, figures and sentences show. All in SI."""

import numpy as np
import xarray as xr

from wm_drake.parameters import measured_amplitudes
from wm_drake.parameters.measured import BAND, EXPERIMENT
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import shape_name
from wm_drake.report.labelled import rows_of
from wm_drake.report.quantity import CHANGE, MASS, SHARE, SPEED, TIME, Quantity, of_measure
from wm_drake.simulation.mount_forces import mount_forces, rms_table, speed_ranges
from wm_drake.simulation.vibration import sensor_accelerations
from wm_drake.studies.spin.study import CaseResult, SpinRuns, band_text

OURS = "wm_drake"
"""Name of this program in the label `source` of amplitudes."""

MM = Unit("m", "mm")

DISPLACEMENT = Quantity("displacement", MM, 1)
FORCE = Quantity("force", Unit("N", "N"), 1)
MOMENT = Quantity("moment", Unit("N*m", "N*m"), 1)
TORQUE = Quantity("torque", Unit("N*m", "N*m"), 2)
ACCELERATION = Quantity("acceleration", Unit("m/s^2", "m/s^2"), 2)
ANGLE = Quantity("angle", Unit("rad", "deg"), 1)
PLACE = Quantity("place", MM, 0)
DIFFERENCE = CHANGE.named("difference")
"""Relative difference from a reference, [B] Eq. (1); its text has the sign."""


def amplitudes_of(runs: SpinRuns) -> xr.Dataset:
    """Return the amplitudes of each load, measured ones first where a case is compared with them.

    Returns:
        Over `row` and `sensor`: `amplitude` [m]. Labels of rows: load, gasket (yes, no) and source,
        which is `OURS` for a computed one. `band` is the pass band of a computed one.
    """
    quantity, sensors = of_measure("amplitude"), list(runs.parameters.sensors)
    measured = measured_amplitudes(runs.parameters)
    labels, bands, sizes = list[tuple[str, str, str]](), list[str](), list[FloatArray]()
    for case in runs.results:
        name, gasket = case.case.name, case.gasket
        of_case = measured[(measured["load"] == name) & (measured["gasket"] == gasket)]
        for row in of_case.to_dict("records") if runs.is_compared(case) else ():
            labels.append((name, gasket, row["source"]))
            bands.append("")
            of_row = np.array([row[sensor] for sensor in sensors], dtype=float)
            sizes.append(quantity.unit.to_si(of_row))  # a file is in mm
        labels.append((name, gasket, OURS))
        bands.append(band_text(case).replace("–", " to "))
        sizes.append(case.measures.amplitude.sel(sensor=sensors).values)
    columns = dict(zip(("load", "gasket", "source"), zip(*labels, strict=True), strict=True))
    amplitude = quantity.variable(("row", "sensor"), sizes)
    data = rows_of(columns, amplitude=amplitude, **{BAND: ("row", bands)})
    return data.assign_coords(sensor=sensors)


def row_of(data: xr.Dataset, case: CaseResult, source: str) -> xr.Dataset | None:
    """Return the row of a case and source of `amplitudes_of` or `differences_of`; None without."""
    labels = {"load": case.case.name, "gasket": case.gasket, "source": source}
    rows = np.logical_and.reduce([data[name].values == label for name, label in labels.items()])
    if not rows.any():
        return None
    return data.isel(row=int(rows.argmax())).drop_vars(list(labels))


def experiment_of(amplitudes: xr.Dataset, case: CaseResult) -> xr.DataArray | None:
    """Return the measured amplitudes (sensor) of a case; None if there are none. [m]

    Args:
        amplitudes: As of `amplitudes_of`.
    """
    row = row_of(amplitudes, case, EXPERIMENT)
    return None if row is None else row.amplitude


def differences_of(amplitudes: xr.Dataset) -> xr.Dataset:
    """Return the relative differences of amplitudes from the measured ones, [B] Eq. (1).

    Args:
        amplitudes: As of `amplitudes_of`.

    Returns:
        Over `row` and `sensor`: `difference`; over `row`: `mean_absolute`, mean of its absolute
        values. Rows are those of a load and gasket that were measured; labels as of
        `amplitudes_of`.
    """
    keys = list(zip(amplitudes["load"].values, amplitudes.gasket.values, strict=True))
    measured = amplitudes.source.values == EXPERIMENT
    reference = {keys[row]: row for row in np.flatnonzero(measured)[::-1]}
    rows = [row for row, key in enumerate(keys) if key in reference and not measured[row]]
    references = [reference[keys[row]] for row in rows]
    values = amplitudes.amplitude.values
    difference = values[rows] / values[references] - 1.0
    kept = amplitudes.isel(row=rows).drop_vars(["amplitude", BAND])
    mean = SHARE.named("mean absolute difference")
    return kept.assign(
        difference=DIFFERENCE.variable(("row", "sensor"), difference),
        mean_absolute=mean.variable("row", np.abs(difference).mean(axis=1)),
    )


def of_sensors(runs: SpinRuns) -> xr.Dataset:
    """Return amplitude, critical speed, and largest and RMS acceleration over load and sensor."""
    data = runs.measures[["amplitude", "critical_speed"]]
    shape = data.amplitude.shape
    largest, rms = np.full(shape, np.nan), np.full(shape, np.nan)
    for row, case in enumerate(runs.results):
        if case.record.sizes["time"]:
            of_case = sensor_accelerations(case.record, runs.sensors_of(case))
            values = of_case.reindex(sensor=data.sensor).values
            largest[row] = np.abs(values).max(axis=0)
            rms[row] = np.sqrt(np.mean(values**2, axis=0))
    return data.assign(
        largest_acceleration=ACCELERATION.named("largest acceleration").variable(
            ("load", "sensor"), largest
        ),
        rms_acceleration=ACCELERATION.named("RMS acceleration").variable(("load", "sensor"), rms),
    )


def gaps_of(runs: SpinRuns) -> xr.Dataset:
    """Return the smallest gap of each load that has one: parts, size, speed, time and place."""
    every = zip(runs.labels, runs.results, strict=True)
    known = [(name, case, gap) for name, case in every if (gap := case.measures.smallest_gap)]
    gaps = [gap for _, _, gap in known]
    size = of_measure("smallest_gap").variable("load", [gap.distance for gap in gaps])
    speeds = [case.speed_at(gap.time) for _, case, gap in known]
    points = np.array([gap.point for gap in gaps]).reshape(-1, 3)
    places = {
        axis: PLACE.named(axis).variable("load", column)
        for axis, column in zip("xyz", points.T, strict=True)
    }
    return xr.Dataset(
        {
            "moving_part": ("load", [shape_name(gap.moving) for gap in gaps]),
            "part_of_the_housing": ("load", [shape_name(gap.fixed) for gap in gaps]),
            "smallest_gap": size,
            "speed": SPEED.variable("load", speeds),
            "time": TIME.variable("load", [gap.time for gap in gaps]),
            **places,
            "touches": ("load", [gap.distance <= 0.0 for gap in gaps]),
        },
        {"load": [label for label, _, _ in known]},
    )


def mounts_of(runs: SpinRuns) -> xr.Dataset:
    """Return forces of mounts on the cabinet.

    Returns:
        A row for each load and mount: force at rest, peak with its drum speed, and measures of the
        whole run; also over `range`: RMS without the mean in parts of the run, NaN in those of
        another profile.
    """
    every = [_mounts_of(label, case) for label, case in zip(runs.labels, runs.results, strict=True)]
    filled = [one for one in every if one.sizes["row"]]
    return xr.concat(filled, "row", join="outer") if filled else every[0]


def _mounts_of(label: str, case: CaseResult) -> xr.Dataset:
    ranges = speed_ranges(case.record, case.case.profile)
    # rings of balls act on the drum
    forces = [force for force in mount_forces(case.record) if force.peak > 0.0]
    at = [case.speed_at(float(case.record.time[force.peak_index])) for force in forces]
    names = [force.name for force in forces]
    data = rows_of(
        {"load": [label] * len(forces), "mount": names},
        at_rest=FORCE.named("at rest").variable("row", [force.at_rest for force in forces]),
        peak=FORCE.named("largest").variable("row", [force.peak for force in forces]),
        speed=SPEED.named("at").variable("row", at),
        dynamic_rms=FORCE.named("RMS").variable(("row", "range"), rms_table(forces, ranges)),
    )
    return data.assign_coords(range=[part.name for part in ranges])


def loads_of(runs: SpinRuns) -> xr.Dataset:
    """Return the point masses of each load, a row each; an empty drum has none."""
    masses = [
        (label, mass)
        for label, case in zip(runs.labels, runs.results, strict=True)
        for mass in case.case.load.unbalances
    ]
    every = [mass for _, mass in masses]
    return rows_of(
        {"load": [label for label, _ in masses]},
        mass=MASS.named("mass", decimals=3).variable("row", [mass.mass for mass in every]),
        radius=DISPLACEMENT.named("radius").variable("row", [mass.radius for mass in every]),
        y=DISPLACEMENT.named("y").variable("row", [mass.y for mass in every]),
        phase=ANGLE.named("phase").variable("row", [mass.phase for mass in every]),
    )


def profiles_of(runs: SpinRuns) -> xr.Dataset:
    """Return the corner points of the spin profile of each load; equal profiles once."""
    profiles: dict[tuple[tuple[float, ...], tuple[float, ...]], list[str]] = {}
    for label, case in zip(runs.labels, runs.results, strict=True):
        profile = case.case.profile
        profiles.setdefault((profile.time, profile.speed), []).append(label)
    names = ["all loads" if len(profiles) == 1 else "; ".join(of) for of in profiles.values()]
    rows = [
        (name, time, speed)
        for name, points in zip(names, profiles, strict=True)
        for time, speed in zip(*points, strict=True)
    ]
    return rows_of(
        {"load": [name for name, _, _ in rows]},
        time=TIME.variable("row", [time for _, time, _ in rows]),
        speed=SPEED.variable("row", [speed for *_, speed in rows]),
    )


def about_runs(runs: SpinRuns) -> xr.Dataset:
    """Return what a reader must know of each run beside its measures, over `load`."""
    cases = runs.results
    seconds = Quantity("computing time", TIME.unit, 2)
    return xr.Dataset(
        {
            "gasket": ("load", [case.gasket for case in cases]),
            "engine": ("load", [runs.engine] * len(cases)),
            "band": ("load", [band_text(case).replace("–", " to ") for case in cases]),
            "diverged": ("load", [case.diverged for case in cases]),
            "wall": seconds.variable("load", [case.wall_s for case in cases]),
        },
        {"load": runs.labels},
    )
