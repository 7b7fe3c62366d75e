"""Show the drive study: smallest torque limits, map, estimated unbalance."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.units import Unit
from wm_drake.report import figure as fig
from wm_drake.report.formatting import GM_PER_KGM, MISSING, RPM_PER_RAD_S, number, plain
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.table import Column, Table, line, table_of
from wm_drake.report.terminal import Printed
from wm_drake.studies.drive.study import PASSES, Estimation, Threshold, TorqueMap, motor_with_limit
from wm_drake.studies.study import Facts, Result

rpm = Unit("rad/s", "rpm").from_si

ERRORS = {
    "loads": Column("random loads", decimals=0),
    "mean_planted_gm": Column("mean planted", "g\u00a0m", 1),
    "bias_gm": Column("bias", "g\u00a0m", 1),
    "rms_gm": Column("RMS", "g\u00a0m", 1),
    "p95_gm": Column("95 % below", "g\u00a0m", 1),
}
"""Columns of the table of errors by their names in JSON."""


@dataclass(frozen=True)
class DriveResult(Result):
    """Result of the study: thresholds and map of a profile, estimation with random loads."""

    parameters: MachineParameters
    profile: SpinProfile
    thresholds: tuple[Threshold, ...]
    map: TorqueMap
    estimation: Estimation | None
    runs: int

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return thresholds, map and, with random loads, the estimation."""
        shown = {"thresholds": thresholds_frame(self), "map": map_frame(self)}
        return shown if self.estimation is None else shown | {"estimation": estimation_frame(self)}

    def as_json(self) -> dict[str, Any]:
        """Return the result for JSON."""
        shown = {
            "machine": self.parameters.name,
            "runs": self.runs,
            "thresholds": thresholds_frame(self).to_dict("records"),
            "map": map_frame(self).to_dict("records"),
            "estimation": error_measures(self),
        }
        return plain(shown)

    def terminal(self) -> Printed:
        """Return the smallest torque limits and a summary."""
        title = f"Smallest torque limit of machine '{self.parameters.name}'"
        return [thresholds_table(self).terminal(title), summary(self)]

    def page(self, facts: Facts) -> str:
        """Return the page."""
        made = [
            ("Machine", self.parameters.name),
            ("Runs", f"{self.runs} in {facts.wall_s:.0f} s"),
            ("Duration of a run", f"{self.profile.duration:g} s"),
            *facts.rows(),
        ]
        has_loads = self.estimation is not None
        return SectionedPage(
            f"Drive of machine {self.parameters.name}",
            summary(self),
            [
                Section("map", "Torque limit and unbalance", (map_picture(self),)),
                Section("estimation", "Unbalance seen by the drive", (estimation_picture(self),))
                if has_loads
                else None,
                Section("thresholds", "Smallest torque limit", tables=(thresholds_table(self),)),
                Section("errors", "Errors of the estimation", tables=(errors_table(self),))
                if has_loads
                else None,
            ],
            made,
            self.parameters,
            facts.warnings,
        ).html()


def summary(result: DriveResult) -> str:
    """Return the result in a few sentences."""
    ratio = motor_with_limit(result.parameters)[0].belt_ratio
    passing = [t for t in result.thresholds if np.isfinite(t.passes_from)]
    sentences = []
    if len(passing) < len(result.thresholds):
        names = ", ".join(t.load for t in result.thresholds if not np.isfinite(t.passes_from))
        sentences.append(f"With the torque limit of the machine the drum does not pass: {names}.")
    if passing:
        worst = max(passing, key=lambda t: t.passes_from)
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
    limit, sign = threshold.passes_from, "" if threshold.caught_below else "≤ "
    if not np.isfinite(limit):
        limit, sign = threshold.caught_below, "> "
    caught = MISSING
    if np.isfinite(threshold.caught_speed):
        caught = f"{number(RPM_PER_RAD_S * threshold.caught_speed, 0)} rpm"
    return f"{sign}{number(limit, 3)}", f"{sign}{number(ratio * limit, 2)}", caught


def thresholds_frame(result: DriveResult) -> pd.DataFrame:
    """Return the smallest torque limit of each load, at the motor's shaft and at the drum."""
    ratio = motor_with_limit(result.parameters)[0].belt_ratio
    return pd.DataFrame(
        [
            {
                "load": t.load,
                "caught_below_Nm": t.caught_below,
                "passes_from_Nm": t.passes_from,
                "passes_from_at_drum_Nm": ratio * t.passes_from,
                "caught_rpm": rpm(t.caught_speed),
                "caught_mean_torque_at_drum_Nm": t.caught_torque,
            }
            for t in result.thresholds
        ]
    )


def map_frame(result: DriveResult) -> pd.DataFrame:
    """Return the map over torque limit and unbalance, a row for each run.

    The unbalance is the sum of the sizes of mass times radius, so masses that balance each other
    count.
    """
    torque_map = result.map
    rows = [
        {
            "load": torque_map.load,
            "mass_factor": factor,
            "sum_of_mass_times_radius_gm": GM_PER_KGM * torque_map.unbalance[u],
            "torque_limit_Nm": torque,
            "end_rpm": rpm(float(torque_map.end_speed[u, t])),
            "caught_rpm": rpm(float(torque_map.caught_speed[u, t])),
        }
        for u, factor in enumerate(torque_map.factors)
        for t, torque in enumerate(torque_map.torques)
    ]
    return pd.DataFrame(rows)


def estimation_frame(result: DriveResult) -> pd.DataFrame:
    """Return planted and estimated unbalance of each random load. [g m]"""
    estimation = result.estimation
    if estimation is None:
        return pd.DataFrame()
    return pd.DataFrame(
        {
            "planted_gm": GM_PER_KGM * estimation.planted,
            "estimated_gm": GM_PER_KGM * estimation.estimated,
            "error_gm": GM_PER_KGM * estimation.errors,
            "from_torque_alone_gm": GM_PER_KGM * estimation.from_torque,
            "from_speed_alone_gm": GM_PER_KGM * estimation.from_speed,
        }
    )


def error_measures(result: DriveResult) -> dict[str, float] | None:
    """Return bias, RMS and 95 % quantile of the error of the estimated unbalance. [g m]"""
    if result.estimation is None:
        return None
    errors = GM_PER_KGM * result.estimation.errors
    return {
        "loads": float(len(errors)),
        "bias_gm": float(np.mean(errors)),
        "rms_gm": float(np.sqrt(np.mean(errors**2))),
        "p95_gm": float(np.quantile(np.abs(errors), 0.95)),
        "mean_planted_gm": float(np.mean(GM_PER_KGM * result.estimation.planted)),
    }


def thresholds_table(result: DriveResult) -> Table:
    """Return the smallest torque limit of each load."""
    groups = tuple(line(t.load, threshold_cells(result, t)) for t in result.thresholds)
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
    grid = result.map
    ratio = motor_with_limit(result.parameters)[0].belt_ratio
    good = grid.end_speed >= PASSES * result.profile.speed[-1]
    torque, unbalance = np.meshgrid(ratio * grid.torques, 1e3 * grid.unbalance)
    key = "does not pass; speed at the end, rpm"
    marks: list[fig.Mark] = [
        fig.Points(torque[good], unbalance[good], size=9.0, key="passes"),
        fig.Points(
            torque[~good], unbalance[~good], symbol="square", color=fig.MEASURED, size=9.0, key=key
        ),
    ]
    speeds = RPM_PER_RAD_S * grid.end_speed[~good]
    for x, y, speed in zip(torque[~good], unbalance[~good], speeds, strict=True):
        above = fig.Text(
            float(x), float(y), f"{speed:.0f}", color=fig.MEASURED, size=11.0, up="bottom"
        )
        marks.append(replace(above, shift=(0.0, 6.0)))
    panel = fig.Panel(
        marks=tuple(marks),
        x=fig.Axis(label="torque limit at the drum, N\u00a0m"),
        y=fig.Axis(label="unbalance, sum of mass times radius, g\u00a0m"),
    )
    figure = fig.Figure(panels=(panel,), height=360.0)
    passed = int(good.sum())
    caption = (
        f"Load {grid.load} with its masses multiplied by {grid.factors[0]:g} to "
        f"{grid.factors[-1]:g}, over the torque limit: where the drum passes and where not."
    )
    return picture(figure, f"{passed} of {good.size} runs pass.", caption)


def errors_table(result: DriveResult) -> Table:
    """Return bias and spread of the estimated unbalance."""
    errors, estimation = error_measures(result), result.estimation
    assert errors is not None
    assert estimation is not None
    caption = (
        f"Error of the unbalance estimated at a constant {RPM_PER_RAD_S * estimation.speed:.0f} "
        "rpm, over loads of two masses at random places. Estimate: parts of motor torque and speed "
        "that go round with the drum, m r = |T - J dw/dt| / g, with the inertia of the empty drum. "
        "What remains: inertia of the load, and a tub that moves."
    )
    return table_of(pd.DataFrame([errors])[list(ERRORS)], caption, ERRORS)


def estimation_picture(result: DriveResult) -> Picture:
    """Return estimated over planted unbalance."""
    estimation = result.estimation
    assert estimation is not None
    planted = 1e3 * estimation.planted
    top = 1.02 * planted.max()
    ripple, torque = "speed ripple alone, J dw/dt", "torque alone"
    marks: tuple[fig.Mark, ...] = (
        fig.Points(
            planted, 1e3 * estimation.from_speed, symbol="triangle-up", color=fig.QUIET, key=ripple
        ),
        fig.Points(
            planted,
            1e3 * estimation.from_torque,
            symbol="triangle-down",
            color=fig.MEASURED,
            key=torque,
        ),
        fig.Points(planted, 1e3 * estimation.estimated, color=fig.OURS, key="both"),
        fig.Line([0.0, top], [0.0, top], color=fig.MARK, key="planted"),
    )
    x, y = (
        fig.Axis(label="planted unbalance, g\u00a0m"),
        fig.Axis(label="estimated unbalance, g\u00a0m"),
    )
    figure = fig.Figure(panels=(fig.Panel(marks=marks, x=x, y=y),), height=340.0)
    caption = (
        "Estimated over planted unbalance. Torque or speed alone see only their share of it, which "
        "depends on the controller."
    )
    return picture(figure, f"{len(planted)} random loads.", caption)
