"""Section of a spin page about the drive: torque, power, energy, speed ripple, capture."""

import numpy as np

from wm_drake.elements.motor import evaluate_motor, packed_limit
from wm_drake.parameters.drive import motor_of
from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import MISSING, RPM_PER_RAD_S, number
from wm_drake.report.page import Picture, Section, picture
from wm_drake.report.table import Group, Row, Table
from wm_drake.simulation.drive import CAPTURE_LAG, CAPTURE_TIME, over_revolutions
from wm_drake.simulation.records import profile_of
from wm_drake.studies.spin.figures import revolution_starts
from wm_drake.studies.spin.study import CaseResult, SpinResult


def drive_section(result: SpinResult) -> Section:
    """Return the section: measures, and speed and torque over time of each load with a motor."""
    drive, pictures = motor_of(result.parameters.drive), tuple[Picture, ...]()
    text = (
        "The drum follows the spin profile exactly, whatever torque that takes. The option "
        "--drive motor shows what a motor with a torque limit does."
    )
    if drive is not None:
        n = drive.belt_ratio
        text = (
            "A motor with a torque limit and a PI speed controller turns the drum by a belt of "
            f"ratio {n:g}. Torques are those at the drum; at the motor's shaft they are {n:g} "
            "times smaller. None of the motor's numbers is published: see their sources in the "
            "table of parameters."
        )
        shown = [case for case in result.results if case.record.sizes["time"] > 1]
        pictures = tuple(_picture(result, case) for case in shown)
    return Section("torques", "Drive", pictures, (drive_table(result),), text)


def drive_in_short(result: SpinResult) -> str:
    """Return one sentence about the drive."""
    if motor_of(result.parameters.drive) is None:
        return "The drum follows the spin profile exactly; the motor torque has no limit."
    return "A motor turns the drum; the spin profile is the speed that its controller wants."


def capture_warnings(result: SpinResult) -> list[str]:
    """Return a warning for each case in which the drum is caught below the wanted speed."""
    return [
        f"Load {case.title}: caught at {number(RPM_PER_RAD_S * caught.speed, 0)} rpm "
        f"from {number(caught.begin)} s to {number(caught.end)} s with a mean torque of "
        f"{number(caught.torque, 2)} N m. The drive is too weak to pass (Sommerfeld effect), or to "
        "lift the unbalance."
        for case in result.results
        if (caught := case.measures.drive.capture)
    ]


def drive_table(result: SpinResult) -> Table:
    """Return the measures of the drive for each load."""
    groups = []
    for case in result.results:
        drive = case.measures.drive
        caught = drive.capture
        cells = (
            number(drive.peak_torque),
            number(drive.mean_torque, 2),
            number(RPM_PER_RAD_S * drive.mean_torque_speed, 0),
            number(drive.peak_power, 0),
            number(drive.energy, 0),
            number(100.0 * drive.speed_ripple),
            f"{number(RPM_PER_RAD_S * caught.speed, 0)} rpm, {number(caught.torque, 2)} N\u00a0m"
            if caught
            else MISSING,
        )
        row = Row(cells, "alarm" if caught else "")
        groups.append(Group(case.title, (row,)))
    caption = (
        "Torque of the motor on the drum: largest value, and largest average over a revolution "
        "with its speed; largest power; work over the run. Ripple: largest difference between "
        "highest and lowest speed in a revolution, in parts of the mean, from 60 rpm on. Caught: "
        f"mean speed and torque of a drum that stays for {CAPTURE_TIME:g} s or longer more than "
        f"{100.0 * CAPTURE_LAG:g} % below the wanted speed."
    )
    header = (
        "load",
        "largest torque, N\u00a0m",
        "over a revolution, N\u00a0m",
        "at, rpm",
        "largest power, W",
        "work, J",
        "speed ripple, %",
        "caught at",
    )
    return Table(caption, header, tuple(groups))


def _picture(result: SpinResult, case: CaseResult) -> Picture:
    drive = case.measures.drive
    caption = (
        f"Load {case.title}. Upper panel: speed of the drum, and the wanted one (dashed). "
        "Lower panel: torque of the motor on the drum, from the smallest to the largest in each "
        "revolution, its average over a revolution (line), and the limit (dashed)."
    )
    alternative = (
        f"Speed and torque over time, load {case.title}: up to {number(drive.peak_torque)} N m."
    )
    return picture(drive_figure(result, case), alternative, caption)


def drive_figure(result: SpinResult, case: CaseResult) -> fig.Figure:
    """Return speed and torque of a drive with a motor over time."""
    record, time = case.record, case.record.time.values
    torque, speed = record.motor_torque.values, record.drum_speed.values
    starts = revolution_starts(record)
    target = RPM_PER_RAD_S * np.asarray(profile_of(record).speed_at(time))
    above: list[fig.Mark] = [
        fig.Line(time, RPM_PER_RAD_S * speed, width=1.4, key="speed of the drum"),
        fig.Line(time, target, color=fig.MARK, width=1.4, dash="dashed", key="wanted"),
    ]
    if caught := case.measures.drive.capture:
        above.insert(0, fig.Span(caught.begin, caught.end, color=fig.MEASURED, opacity=0.12))
        x, y = 0.5 * (caught.begin + caught.end), RPM_PER_RAD_S * caught.speed
        text = f"caught at {number(y, 0)} rpm"
        above.append(fig.Text(x, y, text, color=fig.MEASURED, up="top", shift=(0.0, -8.0)))
    low, high = (side.reduceat(torque, starts) for side in (np.minimum, np.maximum))
    mean = over_revolutions(time, record.drum_angle.values, torque)
    key = "torque, average over a revolution"
    below: list[fig.Mark] = [
        fig.band(time[starts], low, high, opacity=0.25),
        fig.Line(time, mean, key=key),
    ]
    limit = _limit(result, speed[starts])
    if np.abs(limit).min() < 4.0 * np.abs(torque).max():  # else it would hide the torque
        below.append(fig.Line(time[starts], limit, color=fig.QUIET, dash="dashed", key="limit"))
    x_axis = fig.Axis(label="time, s", range=(0.0, float(time[-1])))
    labels = {"speed, rpm": above, "torque at the drum, N\u00a0m": below}
    panels = [
        fig.Panel(name=label.split(",")[0], marks=tuple(marks), x=x_axis, y=fig.Axis(label=label))
        for label, marks in labels.items()
    ]
    return fig.Figure(panels=fig.in_grid(panels, 1, share="x"), height=200.0)


def _limit(result: SpinResult, speed: FloatArray) -> FloatArray:
    """Return the torque limit at the drum at speeds of the drum (n,). [N m]"""
    drive = motor_of(result.parameters.drive)
    assert drive is not None
    packed, of_motor, limit = packed_limit(drive), np.empty(2), np.empty(len(speed))
    for index, rate in enumerate(drive.belt_ratio * speed):
        evaluate_motor(np.array([0.0, rate]), packed, of_motor)
        limit[index] = drive.belt_ratio * of_motor[1]
    return limit
