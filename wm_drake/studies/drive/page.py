"""Show the drive study: smallest torque limits, map, estimated unbalance."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.report import chart
from wm_drake.report import figure as fig
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SHARE, SPEED, quantity_of, shown, text_of
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.drive.study import (
    PASSES,
    TORQUE_LIMIT,
    UNBALANCE,
    estimation_errors,
    motor_with_limit,
)


def drive_answer(
    parameters: MachineParameters,
    profile: SpinProfile,
    data: Mapping[str, xr.Dataset],
    speed: float,
) -> Answer:
    """Return the answer of the study.

    Args:
        data: `thresholds`, `map` and, if there is one, `estimation`, as of `find_thresholds`,
            `torque_map` and `estimate_unbalance` in `wm_drake.studies.drive.study`.
        speed: Speed of the estimation. [rad/s]
    """
    thresholds, grid, estimation = data["thresholds"], data["map"], data.get("estimation")
    ratio = motor_with_limit(parameters)[0].belt_ratio
    passed = grid.end.values >= PASSES * profile.speed[-1]
    torque_map = Part(
        "Torque limit and unbalance",
        (map_plot(grid, passed, ratio), LabelledTable("map", grid)),
    )
    limits = LabelledTable(
        "thresholds",
        thresholds,
        f"Smallest torque limit of machine '{parameters.name}'",
        "Smallest torque of the motor with which the drum passes every critical speed, by "
        f"bisection to 2 %: it has at least {SHARE.text(PASSES)} of the wanted speed at the end of "
        "the profile. 0: it passes with the smallest torque tried. A dash: it does not pass with "
        "the torque of the machine. Where the torque is a little smaller than needed, the drum "
        "stays at the speed of the last column: near 0 rpm the motor cannot lift the unbalance, "
        "above that the drum is caught at a resonance. A profile that begins at the speed at which "
        "laundry lies at the wall shows the resonances alone.",
        is_in_terminal=True,
    )
    errors = None if estimation is None else estimation_errors(estimation)
    parts = [torque_map, Part("Smallest torque limit", (limits,))]
    if estimation is not None and errors is not None:
        table = LabelledTable("errors", errors, "Errors of the estimation", _about(speed))
        parts[1:1] = [
            Part(
                "Unbalance seen by the drive",
                (estimation_plot(estimation), LabelledTable("estimation", estimation)),
            )
        ]
        parts.append(Part("Errors of the estimation", (table,)))
    return Answer(
        f"Drive of machine {parameters.name}",
        summary(thresholds, errors),
        parameters,
        tuple(parts),
        (("Duration of a run", f"{profile.duration:g} s"),),
    )


def summary(thresholds: xr.Dataset, errors: xr.Dataset | None) -> str:
    """Return the answer in a few sentences."""
    needs = thresholds.passes_from
    sentences = []
    if needs.isnull().any():
        names = ", ".join(map(str, thresholds["load"].values[needs.isnull()]))
        sentences.append(f"With the torque limit of the machine the drum does not pass: {names}.")
    if needs.notnull().any():
        worst = thresholds.isel(load=needs.argmax("load"))
        sentences.append(
            f"Load {worst['load'].item()} needs the strongest motor: {text_of(worst.passes_from)}, "
            f"{text_of(worst.passes_from_at_drum)} at the drum."
        )
    if errors is not None:
        sentences.append(
            f"The unbalance estimated from torque and speed is wrong by {text_of(errors.rms)} "
            f"(RMS) at a mean of {text_of(errors.mean_planted)}; 95 % of the errors are below "
            f"{text_of(errors.p95)}."
        )
    return " ".join(sentences)


def _about(speed: float) -> str:
    return (
        f"Error of the unbalance estimated at a constant {SPEED.text(speed)}, "
        "over loads of two masses at random places. Estimate: parts of motor torque and speed "
        "that go round with the drum, m r = |T - J dw/dt| / g, with the inertia of the empty drum. "
        "What remains: inertia of the load, and a tub that moves."
    )


def map_plot(grid: xr.Dataset, passed: np.ndarray, ratio: float) -> Plot:
    """Return the map over torque limit at the drum and unbalance.

    Args:
        grid: As of `torque_map`.
        passed: Whether each run passes. (mass factors, torque limits)
        ratio: Ratio of the belt.
    """
    torque, unbalance = np.meshgrid(
        ratio * shown(grid.torque_limit), shown(grid.sum_of_mass_times_radius)
    )
    missed = ~passed
    key = f"does not pass; {quantity_of(grid.end).label}"
    marks: list[fig.Mark] = [
        fig.Points(torque[passed], unbalance[passed], size=9.0, key="passes"),
        fig.Points(
            torque[missed], unbalance[missed], symbol="square", color=fig.MEASURED, size=9.0,
            key=key,
        ),
    ]  # fmt: skip
    for x, y, speed in zip(torque[missed], unbalance[missed], grid.end.values[missed], strict=True):
        text = quantity_of(grid.end).number(speed)
        above = fig.Text(float(x), float(y), text, color=fig.MEASURED, size=11.0, up="bottom")
        marks.append(replace(above, shift=(0.0, 6.0)))
    panel = fig.Panel(
        marks=tuple(marks),
        x=fig.Axis(label=TORQUE_LIMIT.named("torque limit at the drum").label),
        y=fig.Axis(label=UNBALANCE.label),
    )
    factors = grid.mass_factor.values
    return Plot(
        fig.Figure(panels=(panel,), height=360.0),
        f"{int(passed.sum())} of {passed.size} runs pass.",
        f"Load {grid['load'].item()} with its masses multiplied by {factors[0]:g} to "
        f"{factors[-1]:g}, over the torque limit: where the drum passes and where not.",
    )


def estimation_plot(estimation: xr.Dataset) -> Plot:
    """Return estimated over planted unbalance."""
    drawn = {
        "from_speed_alone": {"key": "speed ripple alone, J dw/dt", "symbol": "triangle-up"},
        "from_torque_alone": {"key": "torque alone", "symbol": "triangle-down"},
        "estimated": {"key": "both", "color": fig.OURS},
    }
    drawn["from_speed_alone"]["color"] = fig.QUIET
    drawn["from_torque_alone"]["color"] = fig.MEASURED
    ends = [0.0, 1.02 * shown(estimation.planted).max()]
    line = fig.Line(ends, ends, color=fig.MARK, key="planted")
    y = {"label": quantity_of(estimation.estimated).label}
    panel = chart.panel(estimation, "planted", drawn, kind=fig.Points, y=y)
    return Plot(
        fig.Figure(panels=(chart.between((), panel, line),), height=340.0),
        f"{estimation.sizes['random_load']} random loads.",
        "Estimated over planted unbalance. Torque or speed alone see only their share of it, which "
        "depends on the controller.",
    )
