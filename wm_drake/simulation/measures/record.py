"""Record -> measures: a record is a block of one run."""

import functools
import itertools
import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from wm_drake.elements.bushing import AXES
from wm_drake.model.scene import Gap, Scene
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cabinet import Walk, walk
from wm_drake.simulation.drive import DriveMeasures, drive_measures
from wm_drake.simulation.feet import FeetLoaded, FootLoads, foot_loads
from wm_drake.simulation.measures.kind import Measure, Variable
from wm_drake.simulation.measures.registry import MEASURES, measure_named
from wm_drake.simulation.measures.run import Need, Run
from wm_drake.simulation.mount_forces import speed_ranges
from wm_drake.simulation.mount_histories import sum_mounts_history
from wm_drake.simulation.mounts import sums_size
from wm_drake.simulation.records import (
    Record,
    cabinet_in,
    load_of_record,
    profile_of,
    rest_pose_of,
    sample_period,
)
from wm_drake.simulation.spring_tension import smallest_tensions
from wm_drake.simulation.vibration import tub_motion_of

if TYPE_CHECKING:  # slow to import
    import pandas as pd

_VARIABLES: dict[Need, tuple[str, ...]] = {
    "sensors": ("displacement",),
    "tub": ("tub_angle", "tub_acceleration", "accelerometer_point"),
    "mounts": ("mount_force", "cabinet_force", "cabinet_moment"),
    "feet": ("cabinet_force", "cabinet_moment"),
    "springs": ("spring_tension",),
    "stops": ("stop_compression", "stop_closing_velocity"),
}
"""Variables of a record that hold what a measure needs."""


@dataclass(frozen=True)
class Measures:
    """Measures of one run, in SI units.

    The variables of all measures are attributes, such as `amplitude` (sensor) [m],
    `critical_speed` (sensor) [rad/s] and `mount_force_peak` (mount) [N];
    `wm_drake.simulation.measures.MEASURES` describes them. They are NaN if the record does not
    have what they need.

    Attributes:
        table: All variables.
        smallest_gap: Smallest gap between tub group and housing; None if it was not measured.
        drive: Torque, power, energy, speed ripple and capture of the drive.
        walk: How the cabinet stands at the end, against where it stood before; None if it is fixed.
        has_cabinet: Whether the machine has a cabinet, and the record the forces on it.
    """

    table: xr.Dataset
    smallest_gap: Gap | None
    drive: DriveMeasures
    walk: Walk | None
    has_cabinet: bool

    def __getattr__(self, name: str) -> xr.DataArray:
        """Return a variable of a measure."""
        if name.startswith("__") or name not in self.table:
            raise AttributeError(f"there is no measure '{name}'")
        return self.table[name]

    def to_dataframe(self) -> "pd.DataFrame":
        """Return a row for each number: measure, what it is of, value, unit for reading.

        Numbers that the record does not give are left out: the gap without the scene of `measure`,
        forces of feet without a cabinet.

        Example:
            >>> import wm_drake as wm
            >>> table = wm.measure(wm.simulate("reference", "middle")).to_dataframe()
            >>> table.loc[0, ["measure", "of", "unit"]].tolist()
            ['detergent_displacement', 'x', 'mm']
        """
        import pandas as pd  # slow to import

        rows = [
            (variable.name, " ".join(labels), value, variable.unit_text)
            for measure in MEASURES.values()
            for variable in measure.variables
            if variable.name in self.table
            for labels, value in labelled_values(self.table, variable)
            if value is not None
        ]
        return pd.DataFrame(rows, columns=["measure", "of", "value", "unit"])

    def plot(self) -> Any:
        """Return bars of the amplitudes at the sensors, drawn with matplotlib."""
        table = self.to_dataframe()
        return table[table.measure == "amplitude"].plot.bar("of", "value", ylabel="amplitude, mm")

    def _repr_html_(self) -> str:
        """Return the table for a notebook."""
        table = str(self.to_dataframe().to_html(index=False, max_rows=60))
        if self.smallest_gap is None:
            table += "<p>The smallest gap needs wm.measure(record, wm.Scene(parameters)).</p>"
        return table

    @property
    def values(self) -> list[FloatArray]:
        """Return the arrays of all variables, in the order of the table."""
        return [variable.values for variable in self.table.data_vars.values()]

    @property
    def smallest_tension(self) -> xr.DataArray:
        """Return the smallest tension of each spring, 0 if it goes slack. (spring) [N]"""
        return self.table["smallest_spring_tension"]

    @property
    def feet(self) -> xr.Dataset | None:
        """Return the measures of the feet of the cabinet; None without a cabinet.

        For a profile without regions, ranges of drum speed take their place.
        """
        names = [*MEASURES["feet"].names, *MEASURES["feet regions"].names]
        return self.table[names] if self.has_cabinet else None


def labelled_values(
    table: xr.Dataset, variable: Variable
) -> list[tuple[tuple[str, ...], float | None]]:
    """Return labels and value of each number of a variable of one run. [unit for reading]

    A value that is NaN is None, because JSON has no NaN.
    """
    values = table[variable.name]
    along = [map(str, table[dim].values) for dim in values.dims]
    numbers = (float(value) for value in values.values.flat)
    return [
        (labels, variable.unit.from_si(number) if number == number else None)
        for labels, number in zip(itertools.product(*along), numbers, strict=True)
    ]


def measure(
    record: Record, scene: Scene | None = None, measures: Iterable[str] | None = None
) -> Measures:
    """Return the measures of a record.

    Args:
        record: Record of a run, from `wm_drake.simulation.runs.simulate`.
        scene: Shapes of the machine. If None, the smallest gap is not computed.
        measures: Names of measures or of their variables, in
            `wm_drake.simulation.measures.MEASURES`; None for those that every run of `spin` has.

    Raises:
        InputError: there is no such measure.

    Example:
        >>> import wm_drake as wm
        >>> record = wm.simulate(wm.build_machine(wm.load_machine("reference")), "middle")
        >>> amplitude = wm.measure(record).amplitude  # m
        >>> round(1e3 * float(amplitude.sel(sensor="Xr")))
        13
    """
    run = RecordedRun(record, scene)
    if measures is None:
        chosen = [measure for measure in MEASURES.values() if measure.is_in_spin]
    else:
        chosen = list(dict.fromkeys(measure_named(name, key="measures") for name in measures))
    variables: dict[str, Any] = {}
    for one in chosen:
        values = one.evaluate([run]) if run.has(one) else [None] * len(one.variables)
        for variable, value in zip(one.variables, values, strict=True):
            if value is None:
                value = np.full((1, *(len(run.labels[dim]) for dim in variable.dims)), np.nan)
            variables[variable.name] = (variable.dims, value[0])
    used = {dim for dims, _ in variables.values() for dim in dims}
    table = xr.Dataset(variables, {dim: run.labels[dim] for dim in run.labels if dim in used})
    drive = drive_measures(run.time, run.drum_angle, run.drum_speed, run.motor_torque, run.profile)
    gap = run.gap if scene else None
    return Measures(table, gap, drive, walk_of(record), run.has_needs(("feet",)))


class RecordedRun(Run):
    """The run of a record."""

    def __init__(self, record: Record, scene: Scene | None = None) -> None:
        """Hold a record, and the shapes of its machine if they are known."""
        self.record, self._scene = record, scene
        self.profile, self.period = profile_of(record), sample_period(record)
        # a dictionary of arrays is faster than attribute access of a dataset
        self._values = {name: variable.values for name, variable in record.variables.items()}

    def has(self, measure: Measure) -> bool:
        """Return whether the record has what a measure needs."""
        return self.has_needs(measure.needs)

    def has_needs(self, needs: Iterable[Need]) -> bool:
        """Return whether the record has some groups of inputs."""
        return all(
            (need != "shapes" or self._scene is not None)
            and (need != "feet" or self._cabinet is not None)
            and all(name in self._values for name in _VARIABLES.get(need, ()))
            for need in needs
        )

    @functools.cached_property
    def labels(self) -> dict[str, list[str]]:
        """Return the labels along each dimension of a measure."""
        dims = ("sensor", "spring", "mount", "accelerometer", "stop")
        parts = speed_ranges(self.record, self.profile)
        return {
            "axis": list(AXES),
            **{dim: list(self._values.get(dim, ())) for dim in dims},
            "order": ["cosine", "sine"],
            "foot": list(self._cabinet[0].corners) if self._cabinet else [],
            "region": [part.name for part in parts],
            "pair": list(self._scene.pair_names()) if self._scene else [],
        }

    @functools.cached_property
    def _cabinet(self) -> Any:
        return cabinet_in(self.record)

    @property
    def time(self) -> FloatArray:
        return self._values["time"]

    @property
    def drum_angle(self) -> FloatArray:
        return self._values["drum_angle"]

    @property
    def drum_speed(self) -> FloatArray:
        return self._values["drum_speed"]

    @property
    def motor_torque(self) -> FloatArray:
        return self._values["motor_torque"]

    @functools.cached_property
    def largest(self) -> FloatArray:
        force, moment = (self._of_gasket(f"bushing_{kind}") for kind in ("force", "moment"))
        histories = self._values["detergent_displacement"], force, moment
        return np.stack([_largest(history) for history in histories])

    def _of_gasket(self, name: str) -> FloatArray:
        """Return the gasket's part (time, axis) of a history (time, bushing, axis); else zeros."""
        history, places = self._values[name], np.flatnonzero(self._values["bushing"] == "gasket")
        return history[:, places[0]] if len(places) else np.zeros((1, history.shape[2]))

    @property
    def displacement(self) -> FloatArray:
        return self._values["displacement"]

    @functools.cached_property
    def poses(self) -> FloatArray:
        return np.column_stack([self._values["tub_angle"], self._values["tub_position"]])

    @property
    def rest_pose(self) -> FloatArray:
        return rest_pose_of(self.record)

    @property
    def scene(self) -> Scene:
        assert self._scene is not None  # see `has`
        return self._scene

    @property
    def tub_motion(self) -> FloatArray:
        return tub_motion_of(self.record)[0]

    @property
    def tub_acceleration(self) -> FloatArray:
        return tub_motion_of(self.record)[1]

    @property
    def accelerometer_points(self) -> FloatArray:
        return self._values["accelerometer_point"]

    @property
    def gravity(self) -> float:
        return float(json.loads(self.record.attrs["parameters"])["gravity"])

    @functools.cached_property
    def mount_sums(self) -> FloatArray:
        forces = self._values["mount_force"]
        sums = np.zeros(sums_size(forces.shape[1]))
        sum_mounts_history(
            np.ascontiguousarray(forces.reshape(len(forces), -1)),
            np.ascontiguousarray(wrenches_on_cabinet(self.record)),
            sums,
        )
        return sums

    @functools.cached_property
    def feet(self) -> FeetLoaded:
        cabinet, gravity = self._cabinet
        parts = () if self.profile.regions else speed_ranges(self.record, self.profile)
        return FeetLoaded(
            cabinet,
            gravity,
            wrenches_on_cabinet(self.record),
            _floor_forces(self.record),
            tuple(part.samples for part in parts),
        )

    @property
    def smallest_tensions(self) -> FloatArray:
        return smallest_tensions(self._values["spring_tension"])

    @property
    def smallest_elongations(self) -> FloatArray:
        return np.full(self._values["spring_tension"].shape[1], np.nan)  # no record has lengths

    @property
    def approaches(self) -> tuple[FloatArray, FloatArray]:
        return self._values["stop_compression"], self._values["stop_closing_velocity"]

    @property
    def mass_left(self) -> FloatArray:
        if "mass_left" in self._values:
            return np.asarray(self._values["mass_left"].sum(axis=1))
        # a record that was made by hand may not say its load
        is_known = "load_parameters" in self.record.attrs
        mass = load_of_record(self.record).mass if is_known else np.nan
        return np.full(len(self.time), mass)


def wrenches_on_cabinet(record: Record) -> FloatArray:
    """Return moment about the origin of W and force of all mounts on the cabinet (n, 6)."""
    return np.hstack([record.cabinet_moment.values, record.cabinet_force.values])


def walk_of(record: Record) -> Walk | None:
    """Return how far a cabinet that moves has walked; None if it is fixed, or without samples."""
    cabinet = cabinet_in(record)
    if cabinet is None or "foot_slip" not in record or not record.sizes["time"]:
        return None
    return walk(cabinet[0], record.foot_slip.values[-1, :, :2])


def foot_loads_of(record: Record) -> FootLoads:
    """Return loads and margins of the feet over time; the machine of the record has a cabinet."""
    cabinet = cabinet_in(record)
    assert cabinet is not None
    return foot_loads(*cabinet, wrenches_on_cabinet(record), floor_forces=_floor_forces(record))


def _floor_forces(record: Record) -> FloatArray | None:
    """Return the forces of the floor on the feet (n, 4, 3) of a cabinet that moves, else None."""
    return record.floor_force.values if "floor_force" in record else None


def _largest(history: FloatArray) -> FloatArray:
    """Return the largest absolute value over time of each column of a history (time, axis).

    The result is NaN if there are no samples.
    """
    rows = np.ascontiguousarray(history.T)  # numpy reduces contiguous rows faster
    return np.abs(rows).max(axis=1) if len(history) else np.full(len(rows), np.nan)
