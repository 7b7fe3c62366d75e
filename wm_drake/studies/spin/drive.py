"""Parts of a spin page about the drive: its measures, and speed and torque over time."""

from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.elements.motor import evaluate_motor, packed_limit
from wm_drake.parameters.drive import motor_of
from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SHARE, SPEED, TIME, Quantity, of_measure
from wm_drake.simulation.drive import CAPTURE_LAG, CAPTURE_TIME, over_revolutions
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.records import profile_of
from wm_drake.studies.answer import Part, Plot
from wm_drake.studies.spin.data import TORQUE
from wm_drake.studies.spin.figures import revolution_starts
from wm_drake.studies.spin.study import CaseResult, SpinRuns


def drive_parts(runs: SpinRuns) -> tuple[Part, Part]:
    """Return pictures of each load with a motor, and the measures of the drive."""
    motor, plots = motor_of(runs.parameters.drive), list[Plot]()
    text = (
        "The drum follows the spin profile exactly, whatever torque that takes. The option "
        "--drive motor shows what a motor with a torque limit does."
    )
    if motor is not None:
        n = motor.belt_ratio
        text = (
            "A motor with a torque limit and a PI speed controller turns the drum by a belt of "
            f"ratio {n:g}. Torques are those at the drum; at the motor's shaft they are {n:g} "
            "times smaller. None of the motor's numbers is published: see their sources in the "
            "table of parameters."
        )
        shown = [case for case in runs.results if case.record.sizes["time"] > 1]
        plots = [_plot(runs, case) for case in shown]
    table = drive_table(runs, is_motor=motor is not None)
    if plots:
        return Part("Speed and torque", plots, text), Part("Drive", (table,))
    return Part("Speed and torque"), Part("Drive", (table,), text)


def drive_in_short(runs: SpinRuns) -> str:
    """Return one sentence about the drive."""
    if motor_of(runs.parameters.drive) is None:
        return "The drum follows the spin profile exactly; the motor torque has no limit."
    return "A motor turns the drum; the spin profile is the speed that its controller wants."


def capture_warnings(runs: SpinRuns) -> list[str]:
    """Return a warning for each case in which the drum is caught below the wanted speed."""
    at = Quantity("", TIME.unit, 1)
    return [
        f"Load {case.title}: caught at {SPEED.text(caught.speed)} from {at.text(caught.begin)} to "
        f"{at.text(caught.end)} with a mean torque of {TORQUE.text(caught.torque)}. The drive is "
        "too weak to pass (Sommerfeld effect), or to lift the unbalance."
        for case in runs.results
        if (caught := case.measures.drive.capture)
    ]


def drive_table(runs: SpinRuns, *, is_motor: bool) -> LabelledTable:
    """Return the measures of the drive for each load."""
    caption = (
        "Torque of the motor on the drum: largest value, and largest average over a revolution "
        "with its speed; largest power; work over the run. Ripple: largest difference between "
        "highest and lowest speed in a revolution, in parts of the mean, from 60 rpm on. Caught: "
        f"mean speed and torque of a drum that stays for {CAPTURE_TIME:g} s or longer more than "
        f"{SHARE.text(CAPTURE_LAG)} below the wanted speed (Sommerfeld effect)."
    )
    data, marked = drive_data(runs.measures), ("is_caught", "alarm")
    return LabelledTable("drive", data, "Drive", caption, marked=marked, is_in_terminal=is_motor)


def drive_data(measures: xr.Dataset) -> xr.Dataset:
    """Return the measures of the drive of a table of measures, and whether the drum is caught."""
    names = [variable.name for variable in MEASURES["drive"].variables if not variable.dims]
    data = measures[names]
    for name in names:
        quantity = of_measure(name)
        words = quantity.words.removesuffix(" of the drive")
        data[name].attrs = quantity.named(words).attributes()
    caught = data.drive_caught_speed
    return data.assign(is_caught=(caught.dims, np.isfinite(caught.values)))


def _plot(runs: SpinRuns, case: CaseResult) -> Plot:
    peak = of_measure("drive_peak_torque").text(case.measures.drive.peak_torque)
    caption = (
        f"Load {case.title}. Upper panel: speed of the drum, and the wanted one (dashed). "
        "Lower panel: torque of the motor on the drum, from the smallest to the largest in each "
        "revolution, its average over a revolution (line), and the limit (dashed)."
    )
    alternative = f"Speed and torque over time, load {case.title}: up to {peak}."
    return Plot(drive_figure(runs, case), alternative, caption)


def drive_figure(runs: SpinRuns, case: CaseResult) -> fig.Figure:
    """Return speed and torque of a drive with a motor over time."""
    record, time = case.record, case.record.time.values
    torque, speed = record.motor_torque.values, record.drum_speed.values
    starts = revolution_starts(record)
    target = SPEED.values(profile_of(record).speed_at(time))
    above: list[fig.Mark] = [
        fig.Line(time, SPEED.values(speed), width=1.4, key="speed of the drum"),
        fig.Line(time, target, color=fig.MARK, width=1.4, dash="dashed", key="wanted"),
    ]
    if caught := case.measures.drive.capture:
        above.insert(0, fig.Span(caught.begin, caught.end, color=fig.MEASURED, opacity=0.12))
        x, y = 0.5 * (caught.begin + caught.end), float(SPEED.values(caught.speed))
        text = f"caught at {SPEED.text(caught.speed)}"
        above.append(fig.Text(x, y, text, color=fig.MEASURED, up="top", shift=(0.0, -8.0)))
    low, high = (side.reduceat(torque, starts) for side in (np.minimum, np.maximum))
    mean = over_revolutions(time, record.drum_angle.values, torque)
    key = "torque, average over a revolution"
    below: list[fig.Mark] = [
        fig.band(time[starts], TORQUE.values(low), TORQUE.values(high), opacity=0.25),
        fig.Line(time, TORQUE.values(mean), key=key),
    ]
    limit = _limit(runs, speed[starts])
    if np.abs(limit).min() < 4.0 * np.abs(torque).max():  # else it would hide the torque
        line = fig.Line(time[starts], TORQUE.values(limit), color=fig.QUIET, key="limit")
        below.append(replace(line, dash="dashed"))
    x_axis = fig.Axis(label=TIME.label, range=(0.0, float(time[-1])))
    panels = [
        fig.Panel(name=q.words, marks=tuple(marks), x=x_axis, y=fig.Axis(label=q.label))
        for q, marks in ((SPEED, above), (TORQUE.named("torque at the drum"), below))
    ]
    return fig.Figure(panels=fig.in_grid(panels, 1, share="x"), height=200.0)


def _limit(runs: SpinRuns, speed: FloatArray) -> FloatArray:
    """Return the torque limit at the drum at speeds of the drum (n,). [N m]"""
    drive = motor_of(runs.parameters.drive)
    assert drive is not None
    packed, of_motor, limit = packed_limit(drive), np.empty(2), np.empty(len(speed))
    for index, rate in enumerate(drive.belt_ratio * speed):
        evaluate_motor(np.array([0.0, rate]), packed, of_motor)
        limit[index] = drive.belt_ratio * of_motor[1]
    return limit
