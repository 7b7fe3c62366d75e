"""Show recordings beside the model: the agreement in a sentence, pictures, and tables."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.parameters.units import Unit
from wm_drake.report import chart
from wm_drake.report import figure as fig
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SHARE, SPEED, TIME, Quantity, quantity_of, shown, text_of
from wm_drake.simulation.displacements import band_of
from wm_drake.simulation.netcdf import netcdf_bytes
from wm_drake.studies.answer import Answer, Part, Plot, pictures_first
from wm_drake.studies.compare.agreement import agreement_of
from wm_drake.studies.compare.pairs import QUANTITIES, Pair
from wm_drake.studies.compare.signals import places_of, repeats_of
from wm_drake.studies.compare.study import (
    CONFIDENCE,
    LEAST_TOLERANCE,
    SINGLE_TOLERANCE,
    amplitudes_of,
    clocks_of,
    integrated_of,
    order_one_of,
    orders_of,
    regions_of,
    sensors_of,
)
from wm_drake.studies.health import health_part

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def compare_answer(
    parameters: MachineParameters,
    pairs: Sequence[Pair],
    sensors: Mapping[str, RecordedSensor],
    gaps: xr.Dataset | None,
    details: Sequence[tuple[str, str]],
) -> Answer:
    """Return the answer of the comparison.

    Args:
        pairs: Recordings on the times of their runs.
        sensors: Sensors of all recordings.
        gaps: As of `gaps_of` in `wm_drake.studies.compare.gaps`.
        details: How the runs were made, as pairs of word and text.
    """
    places = places_of([pair.run for pair in pairs])
    repeats = repeats_of(pairs, places)
    quantities = [q for q in QUANTITIES if any(s.quantity == q for s in sensors.values())]
    amplitudes = {q: amplitudes_of(repeats, sensors, q) for q in quantities}
    agreement = agreement_of([*amplitudes.values()], places)
    parts: list[Part] = []
    for quantity, of_quantity in amplitudes.items():
        parts += _parts_of(repeats, of_quantity, quantity, len(pairs))
    if gaps is not None:
        parts.append(_gaps(gaps))
    if any(sensor.quantity == "acceleration" for sensor in sensors.values()):
        parts.append(_integrated(integrated_of(repeats, sensors, pairs)))
    findings = {pair.recording.path.name: pair.recording.findings for pair in pairs}
    parts += [_clocks(pairs), health_part(findings), _declared(sensors)]
    low, high = band_of(pairs[0].run)
    records = ", ".join(pair.recording.path.name for pair in pairs)
    return Answer(
        f"{parameters.name}: recorded and computed",
        summary(agreement, len(pairs)),
        parameters,
        pictures_first(parts),
        (("Records", records), *details, ("Pass band", f"{low:g} to {high:.3g} Hz")),
        METHOD,
        files={"signals.nc": netcdf_bytes(_signals(pairs, sensors))},
    )


METHOD = (
    "The model predicts what each recorder would have written: displacement, velocity or specific "
    "force (with gravity) at the point of the sensor, along its axis, behind its AC coupling and "
    "low-pass. Nothing measured is corrected. Measured and predicted signals pass the same filters "
    "with the same gaps. An amplitude is the smooth envelope of the filtered signal, the magnitude "
    "of its analytic signal, as in fits to records; noise hardly changes it."
)


def within_text(count: int) -> str:
    """Return the words of what a difference is compared with."""
    if count == 1:
        return f"{SHARE.text(SINGLE_TOLERANCE)} of the one record"
    word = NUMBERS[count] if count < len(NUMBERS) else str(count)
    return f"the scatter of {word} repeats"


def tolerance_text(count: int) -> str:
    """Return what a difference is compared with, as a sentence."""
    least = f"{SHARE.text(LEAST_TOLERANCE)} of the largest amplitude of the sensor"
    if count == 1:
        return (
            f"Tolerance: without repeats no scatter is known, so {SHARE.text(SINGLE_TOLERANCE)} of "
            f"the measured amplitude count, and at least {least} (both are assumptions)."
        )
    return (
        f"Tolerance: a further repeat lies within it with {SHARE.text(CONFIDENCE)} probability; at "
        f"least {least} (an assumption)."
    )


def summary(agreement: xr.Dataset, count: int) -> str:
    """Return one sentence on where all sensors agree, and on the largest difference elsewhere."""
    within, worst = within_text(count), _worst_text(agreement)
    names = ("first_place", "from_place", "to_place", "last_place")
    first, begin, end, last = (agreement[name].item() for name in names)
    words = {name: text_of(agreement[name]) for name in names}
    if np.isnan(begin):
        most = f"; most of all, {worst}" if worst else ""
        return f"Outside {within} from {words['first_place']} to {words['last_place']}{most}."
    above, below = ("above", "below")
    if quantity_of(agreement.at) is not SPEED:
        above, below = "after", "before"
    where, rest = f"from {words['from_place']} to {words['to_place']}", "elsewhere"
    if end == last and begin > first:
        where, rest = f"{above} {words['from_place']}", below
    elif begin == first and end < last:
        where, rest = f"{below} {words['to_place']}", above
    return f"Within {within} {where}{f'; {rest}, {worst}' if worst else ''}."


def _worst_text(agreement: xr.Dataset) -> str:
    """Return sensor, size and place of the largest difference; "" if there is none."""
    if not agreement.sensor.item():
        return ""
    part = agreement.difference.item()
    where = "the resonance of " if agreement.is_peak.item() else ""
    side = "low" if part < 0.0 else "high"
    size = SHARE.text(abs(part))
    return f"{agreement.sensor.item()} {size} {side} at {where}{text_of(agreement.at)}"


def _parts_of(repeats: xr.Dataset, amplitudes: xr.Dataset, quantity: str, count: int) -> list[Part]:
    """Return the sections about the sensors of a quantity."""
    return [
        _amplitudes_part(repeats, amplitudes, quantity, count),
        _orders_part(repeats, amplitudes.sensor.values.tolist(), quantity),
        _regions_part(repeats, amplitudes.sensor.values.tolist(), quantity),
    ]


def _amplitudes_part(
    repeats: xr.Dataset, amplitudes: xr.Dataset, quantity: str, count: int
) -> Part:
    tolerance = tolerance_text(count)
    sensors = LabelledTable(
        f"sensors_{quantity}",
        sensors_of(repeats, amplitudes, quantity),
        f"Sensors of {quantity}",
        "Largest amplitudes and their difference, [B] Eq. (1); distance of the envelopes over the "
        "whole run, [B] Eq. (2), by the size of the measured ones; correlation of order 1; share "
        f"of the places that agree. {tolerance}",
        is_in_terminal=True,
    )
    each = LabelledTable(f"amplitudes_{quantity}", amplitudes)
    shown = (_amplitudes(amplitudes, count), _residuals(amplitudes, tolerance), sensors, each)
    return Part(f"{quantity.capitalize()}: measured and computed", shown)


def _orders_part(repeats: xr.Dataset, names: Sequence[str], quantity: str) -> Part:
    one = order_one_of(repeats, names, quantity)
    orders = LabelledTable(
        f"orders_{quantity}",
        orders_of(repeats, names, quantity),
        "Orders",
        "Largest amplitude of some orders over the whole run; a dash where the samples do not "
        "resolve the order.",
    )
    each = LabelledTable(f"order_one_{quantity}", one, is_in_json=False)
    return Part(f"Order 1 of {quantity}", (_order_one(one), _phases(one), each, orders))


def _regions_part(repeats: xr.Dataset, names: Sequence[str], quantity: str) -> Part:
    regions = regions_of(repeats, names, quantity)
    errors = LabelledTable(
        f"errors_{quantity}",
        regions[["error"]],
        "Errors in the regions",
        "RMS within the pass band, with norms over the sensors: |measured − computed| / "
        "|measured|, [A] Eq. (9).",
        is_in_terminal=True,
    )
    rms = LabelledTable(
        f"rms_{quantity}",
        regions[["measured", "computed"]],
        "RMS of each sensor",
        "RMS within the pass band in each region of the profile; without regions in the profile, "
        "in ranges of drum speed.",
    )
    return Part(f"RMS of {quantity} in the regions", (errors, rms))


RECORDED, COMPUTED = "recorded", "computed"


LINES: Mapping[str, Mapping[str, Any]] = {
    "measured": {"color": fig.MEASURED, "width": 2.4, "key": RECORDED},
    "computed": {"color": fig.OURS, "key": COMPUTED},
}
"""Style of the lines of what was measured and computed."""

ZERO = fig.Rule(0.0, color=fig.MARK)


def _panels(
    data: xr.Dataset,
    drawn: chart.Drawn,
    below: Callable[[xr.Dataset], Sequence[fig.Mark]] = lambda of: (),
) -> fig.Figure:
    """Return a figure with a panel for each sensor over the places.

    Args:
        drawn: Variables, as for `chart.panel`.
        below: Function that returns other marks of one sensor, below them.
    """
    y = {"label": quantity_of(data[next(iter(drawn))]).unit_text}
    panels = []
    for name in data.sensor.values.tolist():
        of = data.sel(sensor=name)
        panel = chart.between(below(of), chart.panel(of, "place", drawn, y=y))
        panels.append(replace(panel, title=name))
    columns = 2 if len(panels) in (2, 4) else 3
    return fig.Figure(panels=fig.in_grid(panels, columns, share="x"), height=210.0)


def _band(of: xr.Dataset, low: xr.DataArray, high: xr.DataArray, **style: Any) -> fig.Area:
    """Return the band between two variables of a sensor, where they are known."""
    known = np.isfinite(low.values)
    return fig.band(*(shown(ends)[known] for ends in (of.place, low, high)), **style)


def _amplitudes(amplitudes: xr.Dataset, count: int) -> Plot:
    style = {"color": fig.MEASURED, "opacity": 0.35, "key": RECORDED}
    lines, of_repeats = LINES, "one record"
    if count > 1:
        lines = {**LINES, "measured": {**LINES["measured"], "width": 1.2}}
        of_repeats = f"mean and range of {count} repeats"

    def band(of: xr.Dataset) -> list[fig.Mark]:
        return [_band(of, of.measured_least, of.measured_most, **style)] if count > 1 else []

    return Plot(
        _panels(amplitudes, lines, band),
        "Measured and computed amplitudes of each sensor.",
        f"Amplitude within the pass band: its smooth envelope. Recorded: {of_repeats}.",
    )


def _residuals(amplitudes: xr.Dataset, tolerance: str) -> Plot:
    shares = amplitudes.assign(allowed=amplitudes.tolerance / amplitudes.measured.max("place"))
    quantity = quantity_of(amplitudes.difference)

    def below(of: xr.Dataset) -> list[fig.Mark]:
        low, high = (quantity.on(side * of.allowed) for side in (-1.0, 1.0))
        return [_band(of, low, high, color=fig.QUIET, key="tolerance"), ZERO]

    line = {"difference": {"color": fig.OURS, "key": "computed less recorded"}}
    return Plot(
        _panels(shares, line, below),
        "Difference of the amplitudes of each sensor.",
        "Computed less recorded amplitude, by the largest recorded one of the sensor. " + tolerance,
    )


def _order_one(one: xr.Dataset) -> Plot:
    return Plot(
        _panels(one, LINES),
        "Amplitude of order 1 of each sensor.",
        "Amplitude of order 1, which turns with the unbalance.",
    )


def _phases(one: xr.Dataset) -> Plot:
    return Plot(
        _panels(one, {"phase": {"kind": fig.Points, "size": 4.0}}, lambda of: [ZERO]),
        "Phase difference of order 1 of each sensor.",
        "Phase of order 1, recorded less computed. The angle of the drum at the start, the same "
        "for all sensors, is taken out.",
    )


def _integrated(data: xr.Dataset) -> Part:
    table = LabelledTable(
        "integrated",
        data,
        "Displacement by integration",
        "RMS within the pass band of the accelerations, integrated twice: recorded, and predicted "
        "in the same way, so gravity along axes that tilt is in both. Last column: what the noise "
        "of the sensor alone would give; its power grows with 1/f^4 towards low frequencies.",
    )
    return Part("Displacement by integration", (table,), is_folded=True)


def _gaps(gaps: xr.Dataset) -> Part:
    table = LabelledTable(
        "gaps",
        gaps,
        "Smallest gaps",
        "Smallest distance between tub and housing. The recorded pose is that of the model, moved "
        "so that the displacement sensors measure what was recorded; a motion that none of them "
        "tells is that of the model.",
        is_in_terminal=True,
    )
    return Part("Smallest gaps", (table,))


def _clocks(pairs: Sequence[Pair]) -> Part:
    data = clocks_of(pairs)
    table = LabelledTable(
        "clocks",
        data,
        "Clocks of the records",
        "Time of the run at time 0 of a record, by what it was aligned, and how much slower its "
        "clock runs; ± are standard deviations.",
    )
    return Part("Clocks", (_speeds(pairs), table))


def _speeds(pairs: Sequence[Pair]) -> Plot:
    """Return the speed of the model, and the recorded ones on its time."""
    run = pairs[0].run
    marks: list[fig.Mark] = []
    for pair, color in zip(pairs, fig.COLOURS[1:] * len(pairs), strict=False):
        if pair.speed is not None:
            at = pair.alignment.of_run(pair.recording.channels.time)
            step = max(1, len(at) // MOST_POINTS)
            x, y = TIME.values(at[::step]), SPEED.values(pair.speed[::step])
            marks.append(fig.Line(x, y, color=color, width=2.4, key=pair.recording.path.name))
    time, speed = run.time.values, run.drum_speed.values
    step = max(1, len(time) // MOST_POINTS)
    model = fig.Line(
        TIME.values(time[::step]), SPEED.values(speed[::step]), color=fig.OURS, key="model"
    )
    panel = fig.Panel(
        marks=(*marks, model), x=fig.Axis(label=TIME.label), y=fig.Axis(label=SPEED.label)
    )
    return Plot(
        fig.Figure(panels=(panel,), height=240.0),
        "Drum speed of the model and of the records.",
        "Drum speed of the model, and recorded ones on its time.",
    )


MOST_POINTS = 1000
"""Largest number of points of a line of a drum speed."""


def _declared(sensors: Mapping[str, RecordedSensor]) -> Part:
    """Return the sensors as they are declared."""
    columns: dict[str, list[str]] = {"measures": [], "at": [], "axis": [], "recorder": []}
    for sensor in sensors.values():
        gravity = sensor.quantity == "acceleration" and f", gravity {sensor.gravity}"
        columns["measures"].append(f"{sensor.quantity}{gravity or ''}")
        place = "" if sensor.point is None else LENGTH.unit.text(sensor.point)
        columns["at"].append(sensor.frame or place)
        tilted = any(sensor.tilt) and f", tilted by {TILT.unit.text(sensor.tilt)}"
        body = "tub" if sensor.turns_with_tub else "housing"
        columns["axis"].append(f"{sensor.axis} of the {body}{tilted or ''}")
        filters = [
            sensor.ac_coupling is not None and f"AC {sensor.ac_coupling:g} Hz",
            sensor.low_pass is not None and f"low-pass {sensor.low_pass:g} Hz",
            sensor.gain != 1.0 and f"gain {sensor.gain:g}",
            sensor.polarity == "negative" and "negative",
        ]
        columns["recorder"].append(", ".join(text for text in filters if text) or "no filter")
    data = xr.Dataset(
        {name: ("sensor", texts) for name, texts in columns.items()}, {"sensor": [*sensors]}
    )
    table = LabelledTable("declared", data, "Sensors as declared", "What the model predicts.")
    return Part("Sensors as declared", (table,), is_folded=True)


LENGTH, TILT = Quantity("", Unit("m", "mm")), Quantity("", Unit("rad", "deg"))


def _signals(pairs: Sequence[Pair], sensors: Mapping[str, RecordedSensor]) -> xr.Dataset:
    """Return measured and predicted signals on the time of the runs, in SI, for a file."""
    data, coords = {}, {"sensor": [*sensors]}
    for number, pair in enumerate(pairs, 1):
        dims = (f"time_{number}", "sensor")
        data[f"measured_{number}"] = (dims, pair.measured)
        data[f"predicted_{number}"] = (dims, pair.predicted)
        coords[dims[0]] = pair.run.time.values
    units = [sensor.signal_unit.si for sensor in sensors.values()]
    names = [pair.recording.path.name for pair in pairs]
    return xr.Dataset(data, {**coords, "unit": ("sensor", units)}, {"records": names})
