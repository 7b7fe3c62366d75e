"""Show the drive study: smallest torque limits, map."""

from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.report import figure as fig
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SHARE, quantity_of, shown, text_of
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.drive.study import (
    PASSES,
    TORQUE_LIMIT,
    UNBALANCE,
    motor_with_limit,
)


def drive_answer(
    parameters: MachineParameters, profile: SpinProfile, thresholds: xr.Dataset, grid: xr.Dataset
) -> Answer:
    """Return the answer of the study.

    Args:
        thresholds, grid: As of `find_thresholds` and `torque_map` in
            `wm_drake.studies.drive.study`.
    """
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
    return Answer(
        f"Drive of machine {parameters.name}",
        summary(thresholds),
        parameters,
        (torque_map, Part("Smallest torque limit", (limits,))),
        (("Duration of a run", f"{profile.duration:g} s"),),
    )


def summary(thresholds: xr.Dataset) -> str:
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
    return " ".join(sentences)


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
