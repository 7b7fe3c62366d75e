"""Report of the drive study: smallest torque limits, map, estimated unbalance."""

import numpy as np
from matplotlib.figure import Figure

from wm_drake.batch import sources_version
from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH, style_axes
from wm_drake.report.formatting import MISSING, RPM_PER_RAD_S, number
from wm_drake.report.page import Picture, picture, render
from wm_drake.report.tables import Group, Row, Table, parameter_table
from wm_drake.studies.drive.study import PASSES, DriveResult, Threshold, motor_with_limit
from wm_drake.studies.drive.tables import error_measures


def drive_report(result: DriveResult, command: str = "", wall_s: float = 0.0) -> str:
    """Return the report as text of one self-contained HTML file.

    Args:
        result: Result of the study.
        command: Command line of the study, shown on the page.
        wall_s: Duration of the study. [s]
    """
    machine = result.parameters
    facts = [
        ("Machine", machine.name),
        ("Runs", f"{result.runs} in {wall_s:.0f} s"),
        ("Duration of a run", f"{result.profile.duration:g} s"),
        ("Sources", sources_version()),
        ("Command", command),
    ]
    return render(
        "drive/page.html",
        title=f"Drive of machine {machine.name}",
        about=machine.about,
        summary=summary(result),
        warnings=[],
        thresholds=thresholds_table(result),
        map=map_picture(result),
        estimation=estimation_picture(result) if result.estimation else None,
        errors=errors_table(result) if result.estimation else None,
        facts=[(word, text) for word, text in facts if text],
        numbers=parameter_table(machine),
    )


def summary(result: DriveResult) -> str:
    """Return the result in a few sentences."""
    ratio = motor_with_limit(result.parameters)[0].belt_ratio
    found = [t for t in result.thresholds if np.isfinite(t.passes_from)]
    sentences = []
    if len(found) < len(result.thresholds):
        names = ", ".join(t.load for t in result.thresholds if not np.isfinite(t.passes_from))
        sentences.append(f"With the torque limit of the machine the drum does not pass: {names}.")
    if found:
        worst = max(found, key=lambda t: t.passes_from)
        sentences.append(
            f"Load {worst.load} needs the strongest motor: {number(worst.passes_from, 3)} N m, "
            f"{number(ratio * worst.passes_from, 2)} N m at the drum."
        )
    if errors := error_measures(result):
        sentences.append(
            f"The unbalance estimated from torque and speed is wrong by {number(errors['rms_gm'])} "
            f"g m (RMS) at a mean of {number(errors['mean_planted_gm'], 0)} g m; 95 % of the "
            f"errors are below {number(errors['p95_gm'])} g m."
        )
    return " ".join(sentences)


def threshold_cells(result: DriveResult, threshold: Threshold) -> tuple[str, str, str]:
    """Return limit at the motor and at the drum, and where the drum is caught just below."""
    ratio = motor_with_limit(result.parameters)[0].belt_ratio
    if np.isfinite(threshold.passes_from):
        limits = (
            f"{'' if threshold.caught_below else '≤ '}{number(threshold.passes_from, 3)}",
            f"{'' if threshold.caught_below else '≤ '}{number(ratio * threshold.passes_from, 2)}",
        )
    else:
        limits = (
            f"> {number(threshold.caught_below, 3)}",
            (f"> {number(ratio * threshold.caught_below, 2)}"),
        )
    caught = MISSING
    if np.isfinite(threshold.caught_speed):
        caught = f"{number(RPM_PER_RAD_S * threshold.caught_speed, 0)} rpm"
    return *limits, caught


def thresholds_table(result: DriveResult) -> Table:
    """Return the smallest torque limit of each load."""
    groups = tuple(Group(t.load, (Row(threshold_cells(result, t)),)) for t in result.thresholds)
    caption = (
        "Smallest torque of the motor with which the drum passes every critical speed, by "
        "bisection to 2 %: it has at least "
        f"{100.0 * PASSES:g} % of the wanted speed at the end of the profile. Where the torque is "
        "a little smaller, the drum stays at the last column's speed: near 0 rpm the motor cannot "
        "lift the unbalance, above that the drum is caught at a resonance. A profile that begins "
        "at the speed at which laundry lies at the wall shows the resonances alone."
    )
    header = ("load", "at the motor, N\u00a0m", "at the drum, N\u00a0m", "caught just below at")
    return Table(caption, header, groups)


def map_picture(result: DriveResult) -> Picture:
    """Return the map over torque limit and unbalance."""
    found = result.map
    ratio = motor_with_limit(result.parameters)[0].belt_ratio
    figure = Figure(figsize=(WIDTH, 4.6))
    axes = figure.subplots()
    speeds = RPM_PER_RAD_S * found.end_speed
    good = found.end_speed >= PASSES * result.profile.speed[-1]
    for u, unbalance in enumerate(1e3 * found.unbalance):
        for t, torque in enumerate(ratio * found.torques):
            color = OURS if good[u, t] else MEASURED
            axes.plot(torque, unbalance, "o" if good[u, t] else "s", color=color, markersize=7)
            if not good[u, t]:
                axes.annotate(f"{speeds[u, t]:.0f}", (torque, unbalance), (0, 7), ha="center",
                              textcoords="offset points", fontsize=8.5, color=MEASURED)  # fmt: skip
    axes.plot([], [], "o", color=OURS, label="passes")
    axes.plot([], [], "s", color=MEASURED, label="does not pass; speed at the end, rpm")
    axes.margins(0.06, 0.12)
    axes.set_xlabel("torque limit at the drum, N\u00a0m", fontsize=9.5)
    axes.set_ylabel("unbalance, sum of mass times radius, g\u00a0m", fontsize=9.5)
    axes.grid(color=GRID)
    style_axes(axes)
    figure.legend(loc="upper center", ncols=2, frameon=False, fontsize=9.5)
    figure.subplots_adjust(left=0.075, right=0.985, top=0.9, bottom=0.12)
    passed = int(good.sum())
    caption = (
        f"Load {found.load} with its masses multiplied by {found.factors[0]:g} to "
        f"{found.factors[-1]:g}, over the torque limit: where the drum passes and where not."
    )
    return picture(figure, f"{passed} of {good.size} runs pass.", caption)


def errors_table(result: DriveResult) -> Table:
    """Return bias and spread of the estimated unbalance."""
    errors, found = error_measures(result), result.estimation
    assert errors is not None
    assert found is not None
    cells = tuple(number(errors[key]) for key in ("mean_planted_gm", "bias_gm", "rms_gm", "p95_gm"))
    caption = (
        f"Error of the unbalance estimated at a constant {RPM_PER_RAD_S * found.speed:.0f} rpm, "
        "over loads of two masses at random places. Estimate: parts of motor torque and speed that "
        "go round with the drum, m r = |T - J dw/dt| / g, with the inertia of the empty drum. "
        "What remains: inertia of the load, and a tub that moves."
    )
    header = (
        "random loads",
        "mean planted, g\u00a0m",
        "bias, g\u00a0m",
        "RMS, g\u00a0m",
        "95 % below, g\u00a0m",
    )
    return Table(caption, header, (Group(f"{errors['loads']:.0f}", (Row(cells),)),))


def estimation_picture(result: DriveResult) -> Picture:
    """Return estimated over planted unbalance."""
    found = result.estimation
    assert found is not None
    figure = Figure(figsize=(WIDTH, 4.4))
    axes = figure.subplots()
    planted = 1e3 * found.planted
    axes.plot(planted, 1e3 * found.from_speed, "^", color=QUIET, markersize=4,
              label="speed ripple alone, J dw/dt")  # fmt: skip
    axes.plot(planted, 1e3 * found.from_torque, "v", color=MEASURED, markersize=4,
              label="torque alone")  # fmt: skip
    axes.plot(planted, 1e3 * found.estimated, "o", color=OURS, markersize=5, label="both")
    top = 1.02 * planted.max()
    axes.plot([0.0, top], [0.0, top], color=MARK, linewidth=0.8, label="planted")
    axes.set_xlabel("planted unbalance, g\u00a0m", fontsize=9.5)
    axes.set_ylabel("estimated unbalance, g\u00a0m", fontsize=9.5)
    axes.grid(color=GRID)
    style_axes(axes)
    axes.legend(frameon=False, fontsize=9.5)
    figure.subplots_adjust(left=0.075, right=0.985, top=0.97, bottom=0.12)
    caption = (
        "Estimated over planted unbalance. Torque or speed alone see only their share of it, which "
        "depends on the controller."
    )
    return picture(figure, f"{len(planted)} random loads.", caption)
