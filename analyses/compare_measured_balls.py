"""Does the ball balancer move as measured on a rotor rig of which everything is published?

The machine `rodrigues_2010` gets the two balls of Rodrigues, Champneys, Friswell and Wilson (2010),
as in `compare_ball_balancer.py`, and goes up and down in the steps of the experiment, with three
washers removed. The mean largest radial displacement of both bearing housings is compared with the
points that the paper measured (rodrigues_2010_fig9.csv). The race damping of the rig is not known,
so the three that the paper computed with are tried. To the middle one are added what the paper says
of its race and does not model: rolling resistance, whose size it does not print, and a runout of 5
um, whose phase it does not print. The level left above the resonances follows for each number of
washers, also for those whose measured curves are not at hand:

    python analyses/compare_measured_balls.py --page docs/rotor-rig.md

`--noise` prints how far measured points scatter from point to point, without a run.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pandas as pd
from compare_ball_balancer import HEAVY, LOAD, STEP, rig
from compare_rotor_rig import errors, quantiles, table

import wm_drake as wm
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.spin import Region
from wm_drake.report.drawing import matplotlib_of
from wm_drake.report.figure import COLOURS, MEASURED, QUIET, Axis, Figure, Line, Panel, Points

Curves: TypeAlias = dict[tuple[str, str], pd.DataFrame]
"""Columns speed_rpm and A_max_mm by race and direction."""

HERE = Path(__file__).parent
MARKS = "<!-- measured balls: begin -->", "<!-- measured balls: end -->"
RANGES = {
    "below the resonances, to 1250 rpm": (300.0, 1250.0),
    "resonances, to 2550 rpm": (1250.0, 2550.0),
    "above, without 3000 to 3600 rpm": (2550.0, 5400.0),
}
BEARING = (3000.0, 3600.0)
"""Resonance of a bearing of the rig, which no rigid model has. [rpm]"""
STILL = (400.0, 700.0), (4000.0, 5000.0)
"""Speeds without a resonance, in which amplitudes follow a cubic. [rpm]"""
RUNOUT = 5e-6
"""Eccentricity of the race, of the paper. [m]"""
ROLLING = 1e-4
"""Rolling resistance. Assumption: a very hard race. With 1e-3, usual for steel, the axis may stay
up to 43 um from the centre of rotation, and 6 um is measured."""
RACES: dict[str, dict[str, float]] = {
    "damping 0.01": {"damping": 0.01},
    "damping 0.1": {"damping": 0.1},
    "damping 1": {"damping": 1.0},
    "0.1, rolling 1e-4": {"damping": 0.1, "rolling_resistance": ROLLING},
    "0.1, rolling 1e-3": {"damping": 0.1, "rolling_resistance": 1e-3},
    "0.1, runout 5 um at the heavy side": {
        "damping": 0.1, "eccentricity": RUNOUT, "eccentricity_phase": HEAVY,
    },
    "0.1, runout 5 um opposite": {
        "damping": 0.1, "eccentricity": RUNOUT, "eccentricity_phase": HEAVY + np.pi,
    },
    "0.1, rolling 1e-4 and runout opposite": {
        "damping": 0.1, "rolling_resistance": ROLLING, "eccentricity": RUNOUT,
        "eccentricity_phase": HEAVY + np.pi,
    },
}  # fmt: skip
"""Numbers of the races that are tried, beside those of the paper. [SI]"""
QUICK = "0.1, rolling 1e-4"


def steps(first: float, last: float, stair: float) -> SpinProfile:
    """Return one run through the steps of the rig: 0.25 s to settle, 0.25 s measured. [rpm]

    It begins with 5 s at the first speed. Balls keep their places from step to step.
    """
    speeds = np.arange(first, last + np.sign(last - first) * 1e-6, np.sign(last - first) * stair)
    points, regions, time = [(0.0, speeds[0])], list[Region](), 5.0
    for speed in speeds:
        time += abs(speed - points[-1][1]) / 1000.0
        points.append((time, speed))
        regions.append(Region(name=f"at_{speed:.0f}", begin=time + 0.25, end=time + 0.5))
        time += 0.5
        points.append((time, speed))
    times, rpm = zip(*points, strict=True)
    radians = tuple(float(value) * np.pi / 30.0 for value in rpm)
    return SpinProfile(time=times, speed=radians, regions=tuple(regions))


def as_on_the_rig(races: Sequence[str], stair: float) -> Curves:
    """Return speed_rpm and A_max_mm at each hold, for each race, up and down."""
    profiles = {"up": steps(320.0, 5310.0, stair), "down": steps(5310.0, 320.0, stair)}
    return swept([(race, way, LOAD, profiles[way]) for race in races for way in profiles])


def swept(runs: Sequence[tuple[str, str, str, SpinProfile]]) -> Curves:
    """Return speed_rpm and A_max_mm at each hold of runs: race, name, load, profile."""
    cases = list[wm.Case]()
    for race, name, load, profile in runs:
        parameters = rig(**RACES[race]).model_copy(update={"output_period": 1e-3})
        cases.append(wm.Case(name, parameters.loads[load], profile, True, parameters))
    machine = wm.build_machine(parameters)
    done = wm.simulate_many(machine, cases, measures=["radial displacements"], step=STEP)
    curves = {}
    for number, (race, name, _, profile) in enumerate(runs):
        regions = profile.regions
        speeds = [profile.speed_at(region.begin) * 30.0 / np.pi for region in regions]
        sizes = 1e3 * done.region_radius.values[number, : len(regions)].mean(axis=-1)
        curves[race, name] = pd.DataFrame({"speed_rpm": speeds, "A_max_mm": sizes})
    return curves


def left_at_full_speed(races: Sequence[str], stair: float) -> str:
    """Return the mean at 4400 to 4600 rpm for each race and number of washers, as a table."""
    profile, washers = steps(2600.0, 4600.0, stair), [f"washers_{n}" for n in range(5)]
    curves = swept([(race, load, load, profile) for race in races for load in washers])
    rows = []
    for race in races:
        means = [
            curve.A_max_mm[curve.speed_rpm.between(4390.0, 4610.0)].mean()
            for curve in (curves[race, load] for load in washers)
        ]
        rows.append([race, *(f"{mean:.4f}" for mean in means)])
    return table(["race", *(f"{n} washers, mm" for n in range(5))], rows)


def noise(measured: pd.DataFrame) -> str:
    """Return level of measured points and their scatter about a cubic over speed, as a table."""
    rows = []
    for way, points in measured.groupby("direction"):
        for ends in STILL:
            inside = points[points.speed_rpm.between(*ends)]
            speed, size = inside.speed_rpm / 1e3, 1e3 * inside.A_max_mm
            missed = size - np.polyval(np.polyfit(speed, size, 3), speed)
            scatter = np.sqrt(np.sum(missed**2) / (len(inside) - 4))
            numbers = size.median(), scatter, size.min()
            span = f"{ends[0]:.0f} to {ends[1]:.0f}"
            rows.append([way, span, str(len(inside)), *(f"{number:.1f}" for number in numbers)])
    heads = ["points", "speed, rpm", "number", "median, um", "scatter, um", "smallest, um"]
    return table(heads, rows)


def rows_of(race: str, way: str, curve: pd.DataFrame, points: pd.DataFrame) -> list[list[str]]:
    """Return a row of the table for each range of speed."""
    rows = []
    for name, ends in RANGES.items():
        inside = points.speed_rpm.between(*ends) & ~points.speed_rpm.between(*BEARING)
        shown = errors(curve, points[inside])
        if len(shown):
            bias = f"{100.0 * np.median(shown):+.0f}"
            rows.append([race, way, name, str(len(shown)), bias, *quantiles(shown)])
    return rows


def levels(curves: Curves, measured: pd.DataFrame) -> str:
    """Return the largest amplitude below 2000 rpm and the mean at 4400 to 4600 rpm, as a table."""
    shown = {f"ours, {race}, {way}": curve for (race, way), curve in curves.items()}
    for way in ("up", "down"):
        shown[f"measured with balls, {way}"] = measured[measured.direction == way]
        shown[f"measured without, {way}"] = measured[measured.direction == f"control_{way}"]
    rows = []
    for name, points in shown.items():
        low = points[points.speed_rpm < 2000.0]
        top = low.loc[low.A_max_mm.idxmax()]
        level = points.A_max_mm[points.speed_rpm.between(4400.0, 4600.0)].mean()
        rows.append([name, f"{top.A_max_mm:.3f}", f"{top.speed_rpm:.0f}", f"{level:.4f}"])
    heads = ["", "largest below 2000 rpm, mm", "at, rpm", "mean at 4400 to 4600 rpm, mm"]
    return table(heads, rows)


def figure(curves: Curves, measured: pd.DataFrame) -> Figure:
    """Return our curves over the measured points, a panel for each direction."""
    panels = []
    for column, way in enumerate(("up", "down")):
        balls, plain = (measured[measured.direction == name] for name in (way, f"control_{way}"))
        marks = [
            Points(
                plain.speed_rpm, plain.A_max_mm, color=QUIET, size=3.0, key="measured, no balls"
            ),
            Points(
                balls.speed_rpm, balls.A_max_mm, color=MEASURED, size=4.0, key="measured, balls"
            ),
        ]
        marks += [
            Line(
                curve.speed_rpm,
                curve.A_max_mm,
                color=COLOURS[number % len(COLOURS)],
                key=f"wm_drake, {race}",
            )
            for number, race in enumerate(dict.fromkeys(race for race, _ in curves))
            for curve in [curves[race, way]]
        ]
        x, y = Axis(label="speed, rpm"), Axis(label="A_max, mm", is_log=True)
        panels.append(Panel(marks=tuple(marks), x=x, y=y, title=way, column=column))
    return Figure(panels=tuple(panels), height=420.0)


def main() -> None:
    """Run up and down, and write the table and the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few holds of one race")
    parser.add_argument("--out", type=Path, help="also write the table to this file")
    parser.add_argument("--page", type=Path, help="renew this page and its picture")
    parser.add_argument("--noise", action="store_true", help="scatter of the measured points")
    arguments = parser.parse_args()
    measured = pd.read_csv(HERE / "rodrigues_2010_fig9.csv", comment="#")
    if arguments.noise:
        print(noise(measured))
        return
    stair, races = (1000.0, [QUICK]) if arguments.quick else (10.0, list(RACES))
    curves = as_on_the_rig(races, stair)
    rows = [
        row
        for (race, way), curve in curves.items()
        for row in rows_of(race, way, curve, measured[measured.direction == way])
    ]
    heads = ["race", "direction", "speeds", "points", "median of ours less measured, %"]
    errors_shown = table([*heads, "median size, %", "nine of ten points within, %"], rows)
    left = left_at_full_speed(races, min(5.0 * stair, 1000.0))
    text = "\n\n".join([levels(curves, measured), left, errors_shown])
    print(text)
    if arguments.out:
        arguments.out.write_text(text + "\n")
    if arguments.page:
        before, _, rest = arguments.page.read_text().partition(MARKS[0])
        after = rest.partition(MARKS[1])[2]
        arguments.page.write_text(f"{before}{MARKS[0]}\n\n{text}\n\n{MARKS[1]}{after}")
        drawing = matplotlib_of(figure(curves, measured))
        drawing.savefig(arguments.page.parent / "pictures" / "rotor_rig_balls.png", dpi=110)


if __name__ == "__main__":
    main()
