"""Measures of a record: filtered displacements, envelopes, amplitudes, largest forces, gap."""

import functools
import json
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.packing import aligned
from wm_drake.model.scene import REPLAY_RATE, Gap, Scene
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.cabinet import Cabinet
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.cabinet import Walk, walk
from wm_drake.simulation.drive import DriveMeasures, drive_measures
from wm_drake.simulation.feet import BY_FOOT, REGION_VARIABLES, FootLoads, foot_loads, foot_measures
from wm_drake.simulation.mount_forces import speed_ranges
from wm_drake.simulation.mounts import KINDS, force_measures
from wm_drake.simulation.outputs import point_positions
from wm_drake.simulation.records import Record
from wm_drake.simulation.signals import filter_both_ways, largest_peaks
from wm_drake.simulation.spring_tension import smallest_tensions

BAND_HZ = (0.5, 20.0)
"""Pass band of the displacements ([B] section 2.2)."""

FILTER_ORDER = 4
"""Order of the Butterworth filter ([B] section 2.2).

The filter runs forwards and backwards, so that it shifts no phase.
"""

PADDING = 5.0
"""Length by which displacements are mirrored at both ends before filtering. [s]

It is two and a half periods of the lower band edge. With the padding that scipy chooses, a record
that ends at a resonance would show peaks that are a third too large near its end.
"""

REPLAY_SPAN = 8.0
"""Length of a replay. [s]"""


@dataclass(frozen=True)
class Measures:
    """Measures of one run, in SI units.

    Attributes:
        amplitude: (sensor) largest absolute value of the envelopes. [m]
        critical_speed: (sensor) drum speed at which the amplitude occurs. [rad/s]
        detergent_displacement: (axis) largest absolute displacement from rest of the tub point that
            is nearest to the detergent box; D of [B]. [m]
        gasket_force, gasket_moment: (axis) largest absolute force and moment of the gasket on the
            housing; F and M of [B]. Zero without gasket. [N, N m]
        smallest_gap: Smallest gap between tub group and housing; None if it was not measured.
        mount_force_peak, mount_force_rms, mount_force_dynamic_rms: (mount) largest size, RMS, and
            RMS without the mean of the force of each mount on the cabinet. [N]
        cabinet_force_peak, cabinet_force_rms, cabinet_force_dynamic_rms: (axis) the same of the
            force of all mounts on the cabinet, in W. [N]
        cabinet_moment_peak, cabinet_moment_rms, cabinet_moment_dynamic_rms: (axis) the same of
            their moment about the origin of W. [N m]
        smallest_tension: (spring) smallest tension, 0 if the spring goes slack. [N]
        feet: Measures of the feet of the cabinet by the names in `wm_drake.simulation.feet`, with
            the dimensions foot and region; None if the machine has no cabinet, or for a record of
            version 0.1.
        drive: Torque, power, energy, speed ripple and capture of the drive.
        walk: How the cabinet stands at the end, against where it stood before; None if it is fixed.
    """

    amplitude: xr.DataArray
    critical_speed: xr.DataArray
    detergent_displacement: xr.DataArray
    gasket_force: xr.DataArray
    gasket_moment: xr.DataArray
    smallest_gap: Gap | None
    mount_force_peak: xr.DataArray
    mount_force_rms: xr.DataArray
    mount_force_dynamic_rms: xr.DataArray
    cabinet_force_peak: xr.DataArray
    cabinet_force_rms: xr.DataArray
    cabinet_force_dynamic_rms: xr.DataArray
    cabinet_moment_peak: xr.DataArray
    cabinet_moment_rms: xr.DataArray
    cabinet_moment_dynamic_rms: xr.DataArray
    smallest_tension: xr.DataArray
    feet: xr.Dataset | None
    drive: DriveMeasures
    walk: Walk | None = None


def filtered(displacement: FloatArray, period: float) -> FloatArray:
    """Return displacements filtered to the band 0.5-20 Hz, without phase shift.

    The filter is a Butterworth filter of fourth order.

    Args:
        displacement: (n, k) one column per signal. [m]
        period: Time between samples. [s]

    Returns:
        (n, k) filtered displacements. [m] NaN if there are fewer samples than the filter needs, for
        example because the run diverged at once.
    """
    rows, columns = displacement.shape
    groups = -(-columns // WIDTH)
    lanes = aligned(rows * groups * WIDTH)
    side_by_side = lanes.reshape(rows, groups * WIDTH)
    side_by_side[:, :columns] = displacement
    return filtered_lanes(side_by_side, groups, period)[:, :columns].copy()


def filtered_lanes(
    signals: FloatArray,
    groups: int,
    period: float,
    array: Callable[[str, int], FloatArray] = lambda name, size: aligned(size * WIDTH),
) -> FloatArray:
    """Return the first groups of `WIDTH` signals of an array, as from `filtered`.

    Args:
        signals: (n, >= groups * WIDTH), contiguous; the number of columns is a multiple of `WIDTH`.
            [m]
        groups: Number of groups to filter.
        period: Time between samples. [s]
        array: Function that returns an array of lanes, given a name and a size. A caller that
            filters often can use the same memory again.
    """
    rows, columns = signals.shape
    padding = min(round(PADDING / period), rows - 1)
    if padding <= 6 * FILTER_ORDER + 3:  # the padding that sosfiltfilt chooses by default
        return np.full((rows, groups * WIDTH), np.nan)
    answer, work = array("filtered", rows * groups), array("filter", rows + 2 * padding)
    shape = (rows, groups, columns // WIDTH)
    filter_both_ways(signals.ravel(), shape, *_band_pass(period), padding, work, answer)
    return answer.reshape(rows, groups * WIDTH)


@functools.cache
def _band_pass(period: float) -> tuple[FloatArray, FloatArray]:
    """Return the sections of the filter, and their states at a constant signal, flat."""
    from scipy.signal import butter, sosfilt_zi  # slow to import: measures that filter

    sections = butter(FILTER_ORDER, BAND_HZ, btype="bandpass", fs=1.0 / period, output="sos")
    return sections.ravel(), sosfilt_zi(sections).ravel()


def filtered_displacement(record: Record) -> xr.DataArray:
    """Return the displacements (time, sensor) of a record, filtered to 0.5-20 Hz. [m]

    Example:
        >>> import wm_drake as wm
        >>> record = wm.simulate(wm.build_machine(wm.load_machine("reference")), "middle")
        >>> wm.filtered_displacement(record).dims
        ('time', 'sensor')
    """
    raw = record.displacement
    return raw.copy(data=filtered(raw.values, _period(record)))


def _period(record: Record) -> float:
    """Return the time between the samples of a record; 1 if it has fewer than two samples. [s]"""
    time = record.time.values
    return float(time[1] - time[0]) if len(time) > 1 else 1.0


def power_means(displacement: FloatArray) -> FloatArray:
    """Return the power mean of order 20, (mean |d|^20)^(1/20), of each signal.

    The power mean is close to the largest absolute value but is a smooth function of all
    parameters. The largest value itself is not: it has a kink where another peak becomes the
    largest one, and searches that use slopes fail there.

    Args:
        displacement: (n, k) one column per signal.

    Returns:
        (k,) in the unit of the signals.
    """
    fourth = np.square(np.square(displacement))
    return np.asarray(np.mean(np.square(np.square(fourth)) * fourth, axis=0) ** (1.0 / 20.0))


def amplitudes(displacement: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Return the largest absolute value of the envelopes of each signal, and where it occurs.

    An envelope is a straight line from peak to peak, so its largest value is at a peak.

    Args:
        displacement: (n, k) one column per signal.

    Returns:
        The largest value in the unit of the signals and the index of its sample, each (k,). A
        signal that is empty or starts with NaN gives NaN and 0.
    """
    sizes = np.empty(displacement.shape[1])
    samples = np.empty(displacement.shape[1], dtype=np.int64)
    largest_peaks(np.ascontiguousarray(displacement), sizes, samples)
    return sizes, samples


def moment_of_largest_amplitude(record: Record) -> int:
    """Return the sample at which the largest amplitude of all sensors occurs.

    Report, orbit and replay show this moment. In a record that is too short for the filter, it is
    the sample of the largest displacement.
    """
    size, samples = amplitudes(filtered_displacement(record).values)
    if np.isnan(size).all():
        return int(abs(record.displacement).max("sensor").argmax("time"))
    return int(samples[np.nanargmax(size)])


def envelopes(record: Record) -> xr.Dataset:
    """Return the upper and lower envelope (time, sensor) of the filtered displacements. [m]

    An envelope consists of straight lines from peak to peak.

    Example:
        >>> import wm_drake as wm
        >>> record = wm.simulate(wm.build_machine(wm.load_machine("reference")), "middle")
        >>> envelope = wm.envelopes(record)
        >>> bool((envelope.upper >= envelope.lower).all())
        True
    """
    displacement = filtered_displacement(record)
    time = displacement.time.values
    upper = np.stack([peak_line(time, column) for column in displacement.values.T], axis=1)
    lower = np.stack([-peak_line(time, -column) for column in displacement.values.T], axis=1)
    return xr.Dataset(
        {"upper": displacement.copy(data=upper), "lower": displacement.copy(data=lower)}
    )


def peak_line(time: FloatArray, signal: FloatArray) -> FloatArray:
    """Return the line through the local maxima of a signal.

    The line is constant before the first maximum and after the last one. A signal without a local
    maximum is returned unchanged.
    """
    from scipy.signal import find_peaks  # slow to import: envelopes

    peaks = find_peaks(signal)[0]
    return np.interp(time, time[peaks], signal[peaks]) if len(peaks) else signal


def smooth_envelope(record: Record) -> xr.DataArray:
    """Return the smooth envelope (time, sensor) of the filtered displacements. [m]

    It is the magnitude of the analytic signal d + i H(d), with the Hilbert transform H; the lower
    envelope is its negative. Unlike a line from peak to peak it is a smooth function of all
    parameters: a line jumps where a small peak appears. The record is mirrored at both ends,
    because the transform continues it periodically.
    """
    from scipy.signal import hilbert  # slow to import: envelopes

    displacement = filtered_displacement(record)
    values = displacement.values
    padding = min(round(PADDING / _period(record)), len(values) - 1)
    if padding < 1:
        return displacement.copy(data=np.abs(values))
    mirrored = np.pad(values, ((padding, padding), (0, 0)), mode="reflect")
    return displacement.copy(data=np.abs(hilbert(mirrored, axis=0))[padding:-padding])


def percent_difference(value: xr.DataArray, reference: xr.DataArray) -> xr.DataArray:
    """Return the difference 100 (value - reference) / reference; [B] Eq. (1). [%]"""
    return 100.0 * (value - reference) / reference


def axis_motion(record: Record, y: float) -> FloatArray:
    """Return the path (n, 3) in W of the point of the drum axis at depth y in T, for orbits. [m]"""
    pose = np.column_stack([record.tub_angle.values, record.tub_position.values])
    return point_positions(pose, np.array([[0.0, y, 0.0]]))[:, 0]


def largest_motion(record: Record, largest: int | None = None) -> tuple[FloatArray, FloatArray]:
    """Return the motion around the largest amplitude of a record, sampled for a replay.

    Args:
        record: The record.
        largest: `moment_of_largest_amplitude` if it is known already.

    Returns:
        Times (n,) and positions of the plant (n, >= 7): roll, pitch, yaw, x, y, z of the tub and
        the drum angle; then, for each damper tube that is a body, roll, pitch, yaw, x, y, z of the
        outer tube and the extension of the damper. [s; rad, m]
    """
    largest = moment_of_largest_amplitude(record) if largest is None else largest
    middle = float(record.time[largest])
    tubes = [f"tube_{part}" for part in ("angle", "position", "extension") if "tube" in record.dims]
    moving = record[["tub_angle", "tub_position", "drum_angle", *tubes]]
    stretch = moving.sel(time=slice(middle - REPLAY_SPAN / 2, middle + REPLAY_SPAN / 2))
    period = (
        float(record.time[1] - record.time[0]) if record.sizes["time"] > 1 else 1.0 / REPLAY_RATE
    )
    frames = stretch.isel(time=slice(None, None, max(1, round(1.0 / (REPLAY_RATE * period)))))
    parts = [frames.tub_angle.values, frames.tub_position.values, frames.drum_angle.values]
    for tube in frames.tube.values if "tube" in frames.dims else ():
        one = frames.sel(tube=tube)
        parts += [one.tube_angle.values, one.tube_position.values, one.tube_extension.values]
    return frames.time.values, np.column_stack(parts)


def measure(record: Record, scene: Scene | None = None) -> Measures:
    """Return the measures of a record.

    Args:
        record: Record of a run, from `wm_drake.simulation.runs.simulate`.
        scene: Shapes of the machine. If None, the smallest gap is not computed.

    Example:
        >>> import wm_drake as wm
        >>> record = wm.simulate(wm.build_machine(wm.load_machine("reference")), "middle")
        >>> amplitude = wm.measure(record).amplitude  # m
        >>> round(1e3 * float(amplitude.sel(sensor="Xr")))
        23
    """
    # a dictionary of arrays is faster than attribute access of a dataset
    values = {name: variable.values for name, variable in record.variables.items()}
    size, samples = amplitudes(filtered(values["displacement"], _period(record)))
    speed = values["drum_speed"][samples] if record.sizes["time"] else size
    pose = np.column_stack([values["tub_angle"], values["tub_position"]])
    gap = (
        scene.smallest_gap(values["time"], pose, np.asarray(record.attrs["rest_pose"]))
        if scene
        else None
    )
    by_sensor, by_axis = record.coords["sensor"].coords, record.coords["axis"].coords
    force, moment = (
        _gasket_history(values["bushing"], values[f"bushing_{kind}"])
        for kind in ("force", "moment")
    )
    return Measures(
        amplitude=xr.DataArray(size, by_sensor),
        critical_speed=xr.DataArray(np.where(np.isnan(size), np.nan, speed), by_sensor),
        detergent_displacement=xr.DataArray(_largest(values["detergent_displacement"]), by_axis),
        gasket_force=xr.DataArray(_largest(force), by_axis),
        gasket_moment=xr.DataArray(_largest(moment), by_axis),
        smallest_gap=gap,
        **_forces_on_cabinet(record),
        smallest_tension=xr.DataArray(
            smallest_tensions(values["spring_tension"]), record.coords["spring"].coords
        ),
        feet=feet_of(record),
        drive=drive_measures(
            values["time"],
            values["drum_angle"],
            values["drum_speed"],
            values["motor_torque"],
            profile_of(record),
        ),
        walk=walk_of(record),
    )


def profile_of(record: Record) -> SpinProfile:
    """Return the spin profile of the run of a record."""
    return SpinProfile.model_validate_json(record.attrs["profile"])


def cabinet_in(record: Record) -> tuple[Cabinet, float] | None:
    """Return cabinet and gravity [m/s^2] of the machine of a record; None without a cabinet."""
    parameters = json.loads(record.attrs.get("parameters", "{}"))
    if not parameters.get("cabinet"):
        return None
    return Cabinet.model_validate(parameters["cabinet"]), float(parameters["gravity"])


def wrenches_on_cabinet(record: Record) -> FloatArray:
    """Return moment about the origin of W and force of all mounts on the cabinet (n, 6)."""
    return np.hstack([record.cabinet_moment.values, record.cabinet_force.values])


def feet_of(record: Record) -> xr.Dataset | None:
    """Return the measures of the feet of the cabinet; None if the machine has no cabinet.

    For a profile without regions, ranges of drum speed take their place.
    """
    found = cabinet_in(record)
    if found is None or "cabinet_force" not in record:
        return None
    profile = profile_of(record)
    parts = speed_ranges(record, profile)
    values = foot_measures(
        *found,
        wrenches_on_cabinet(record),
        profile,
        _period(record),
        floor_forces=_floor_forces(record),
        ranges=[part.samples for part in parts],
    )
    labels = {"foot": list(found[0].corners), "region": [part.name for part in parts]}
    dims = dict.fromkeys(REGION_VARIABLES, "region") | dict.fromkeys(BY_FOOT, "foot")
    return xr.Dataset({n: ([dims[n]] if n in dims else [], v) for n, v in values.items()}, labels)


def walk_of(record: Record) -> Walk | None:
    """Return how far a cabinet that moves has walked; None if it is fixed, or without samples."""
    found = cabinet_in(record)
    if found is None or "foot_slip" not in record or not record.sizes["time"]:
        return None
    return walk(found[0], record.foot_slip.values[-1, :, :2])


def foot_loads_of(record: Record) -> FootLoads:
    """Return loads and margins of the feet over time; the machine of the record has a cabinet."""
    found = cabinet_in(record)
    assert found is not None
    return foot_loads(*found, wrenches_on_cabinet(record), floor_forces=_floor_forces(record))


def _floor_forces(record: Record) -> FloatArray | None:
    """Return the forces of the floor on the feet (n, 4, 3) of a cabinet that moves, else None."""
    return record.floor_force.values if "floor_force" in record else None


def _forces_on_cabinet(record: Record) -> dict[str, xr.DataArray]:
    """Return the measures of the forces of the mounts, by the names of the `Measures`.

    A record of version 0.1 has no such forces: then there are no mounts, and the others are NaN.
    """
    found = {}
    for name in ("mount_force", "cabinet_force", "cabinet_moment"):
        dim = "mount" if name == "mount_force" else "axis"
        labels = np.asarray(record[dim].values if dim in record.dims else [])
        history = record[name].values if name in record else np.empty((0, len(labels)))
        for kind, value in zip(KINDS, force_measures(history), strict=True):
            found[f"{name}_{kind}"] = xr.DataArray(value, {dim: labels}, [dim])
    return found


def _largest(history: FloatArray) -> FloatArray:
    """Return the largest absolute value over time of each column of a history (time, axis).

    The result is NaN if there are no samples.
    """
    rows = np.ascontiguousarray(history.T)  # numpy reduces contiguous rows faster
    return np.abs(rows).max(axis=1) if len(history) else np.full(len(rows), np.nan)


def _gasket_history(bushings: FloatArray, history: FloatArray) -> FloatArray:
    """Return the gasket's part (time, axis) of a history (time, bushing, axis); else zeros."""
    found = np.flatnonzero(bushings == "gasket")
    return history[:, found[0]] if len(found) else np.zeros((1, history.shape[2]))
