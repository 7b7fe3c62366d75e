"""Record -> what is measured of it: filtered displacements, envelopes, amplitudes, largest forces, smallest gap."""

import functools
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.signal import butter, find_peaks, sosfiltfilt

from wm_drake.model.scene import REPLAY_RATE, Gap, Scene
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.runs import Record, point_positions

BAND_HZ = (0.5, 20.0)
"""Pass band of the displacements ([B] section 2.2)."""

FILTER_ORDER = 4
"""Order of the Butterworth filter ([B] section 2.2); run forwards and backwards, so that it shifts nothing."""

PADDING = 5.0
"""How far the displacements are mirrored at both ends before filtering: two periods and a half of the lower band edge. A
record that ends at a resonance would flare by a third otherwise. [s]"""

REPLAY_SPAN = 8.0
"""Length of a replay. [s]"""


@dataclass(frozen=True)
class Measures:
    """What is read off a record. SI.

    Attributes:
        amplitude: (sensor) largest absolute value of the envelopes. [m]
        critical_speed: (sensor) drum speed where it occurs. [rad/s]
        detergent_displacement: (axis) largest displacement of the tub point nearest the detergent box from rest, D of [B]. [m]
        gasket_force, gasket_moment: (axis) largest absolute force and moment of the gasket on the housing, F and M of [B];
            zero without gasket. [N, N m]
        smallest_gap: Between tub group and housing; None if not measured.
    """

    amplitude: xr.DataArray
    critical_speed: xr.DataArray
    detergent_displacement: xr.DataArray
    gasket_force: xr.DataArray
    gasket_moment: xr.DataArray
    smallest_gap: Gap | None


def filtered(displacement: FloatArray, period: float) -> FloatArray:
    """Displacements (n, k) in the band 0.5-20 Hz, fourth-order Butterworth, zero phase. [m]

    Fewer samples than the filter needs (of a run that diverged at once) give NaN.

    Args:
        displacement: One column a signal. [m]
        period: Between samples. [s]
    """
    padding = min(round(PADDING / period), len(displacement) - 1)
    if padding <= 6 * FILTER_ORDER + 3:  # what sosfiltfilt itself holds for the least
        return np.full(displacement.shape, np.nan)
    return np.asarray(
        sosfiltfilt(_band_pass(period), displacement, axis=0, padtype="even", padlen=padding)
    )


@functools.cache
def _band_pass(period: float) -> FloatArray:
    return np.asarray(
        butter(FILTER_ORDER, BAND_HZ, btype="bandpass", fs=1.0 / period, output="sos")
    )


def filtered_displacement(record: Record) -> xr.DataArray:
    """Displacements at the sensors (time, sensor) of a record, as `filtered`. [m]"""
    raw = record.displacement
    return raw.copy(data=filtered(raw.values, _period(record)))


def _period(record: Record) -> float:
    """Between samples; any number for fewer than two. [s]"""
    time = record.time.values
    return float(time[1] - time[0]) if len(time) > 1 else 1.0


def power_means(displacement: FloatArray) -> FloatArray:
    """Means of order 20, (mean |d|^20)^(1/20), of signals (n, k): near the largest value, but smooth in all parameters. (k)

    Where another peak becomes the largest, an amplitude has a kink, which searches by slopes stumble on; this has none.
    """
    fourth = np.square(np.square(displacement))
    return np.asarray(np.mean(np.square(np.square(fourth)) * fourth, axis=0) ** (1.0 / 20.0))


def amplitudes(displacement: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Largest absolute value of the envelopes of signals (n, k), and the samples where it occurs, each (k,).

    An envelope runs straight from peak to peak, so its largest value is at one of them.
    """
    sizes, samples = (
        np.full(displacement.shape[1], np.nan),
        np.zeros(displacement.shape[1], dtype=np.int64),
    )
    for column, signal in enumerate(displacement.T):
        signal = np.ascontiguousarray(signal)
        if not len(signal) or np.isnan(signal[0]):
            continue
        sides = (find_peaks(signal)[0], find_peaks(-signal)[0])
        nodes = np.concatenate([side if len(side) else np.arange(len(signal)) for side in sides])
        samples[column] = nodes[np.argmax(np.abs(signal[nodes]))]
        sizes[column] = abs(signal[samples[column]])
    return sizes, samples


def envelopes(record: Record) -> xr.Dataset:
    """Upper and lower envelope (time, sensor) of the filtered displacements: straight lines from peak to peak. [m]"""
    displacement = filtered_displacement(record)
    time = displacement.time.values
    upper = np.stack([peak_line(time, column) for column in displacement.values.T], axis=1)
    lower = np.stack([-peak_line(time, -column) for column in displacement.values.T], axis=1)
    return xr.Dataset(
        {"upper": displacement.copy(data=upper), "lower": displacement.copy(data=lower)}
    )


def peak_line(time: FloatArray, signal: FloatArray) -> FloatArray:
    """Line through the local maxima of a signal; the first and last are held to the ends."""
    peaks = find_peaks(signal)[0]
    return np.interp(time, time[peaks], signal[peaks]) if len(peaks) else signal


def percent_difference(value: xr.DataArray, reference: xr.DataArray) -> xr.DataArray:
    """100 (value - reference) / reference; [B] Eq. (1). [%]"""
    return 100.0 * (value - reference) / reference


def axis_motion(record: Record, y: float) -> FloatArray:
    """Path in W of the point of the drum axis at depth y, for orbits. (n, 3) [m]"""
    pose = np.column_stack([record.tub_angle.values, record.tub_position.values])
    return point_positions(pose, np.array([[0.0, y, 0.0]]))[:, 0]


def largest_motion(record: Record) -> tuple[FloatArray, FloatArray]:
    """The stretch of a record around its largest displacement, thinned out for a replay.

    Returns:
        Times (n,) [s] and positions of the plant (n, 7 or more): roll, pitch, yaw, x, y, z, drum angle; of damper tubes, if
        they are bodies, roll to z and the extension. [rad, m]
    """
    size = abs(record.displacement).max("sensor")
    moment = float(record.time[int(size.argmax("time"))])
    stretch = record.sel(time=slice(moment - REPLAY_SPAN / 2, moment + REPLAY_SPAN / 2))
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
    """Reads the measures off a record.

    Args:
        record: From `wm_drake.simulation.runs.simulate`.
        scene: The machine's shapes, for the smallest gap; it is left out if None.
    """
    values = {
        name: variable.values for name, variable in record.variables.items()
    }  # attributes of a dataset take longer
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
        _of_gasket(values["bushing"], values[f"bushing_{kind}"]) for kind in ("force", "moment")
    )
    return Measures(
        amplitude=xr.DataArray(size, by_sensor),
        critical_speed=xr.DataArray(np.where(np.isnan(size), np.nan, speed), by_sensor),
        detergent_displacement=xr.DataArray(_largest(values["detergent_displacement"]), by_axis),
        gasket_force=xr.DataArray(_largest(force), by_axis),
        gasket_moment=xr.DataArray(_largest(moment), by_axis),
        smallest_gap=gap,
    )


def _largest(history: FloatArray) -> FloatArray:
    """Largest absolute value over time (time, axis) along each axis; NaN of no samples."""
    rows = np.ascontiguousarray(history.T)  # numpy is slow along the long side of a narrow table
    return np.abs(rows).max(axis=1) if len(history) else np.full(len(rows), np.nan)


def _of_gasket(bushings: FloatArray, history: FloatArray) -> FloatArray:
    """The part (time, axis) of (time, bushing, axis) that is the gasket's; zero without one."""
    found = np.flatnonzero(bushings == "gasket")
    return history[:, found[0]] if len(found) else np.zeros((1, history.shape[2]))
