"""Does the ball balancer move as measured on a rotor rig of which everything is published?

The machine `rodrigues_2010` gets the two balls of Rodrigues, Champneys, Friswell and Wilson (2010),
as in `compare_ball_balancer.py`, and goes up and down in the steps of the experiment, with three
washers removed. The mean largest radial displacement of both bearing housings is compared with the
points that the paper measured (rodrigues_2010_fig9.csv). The race damping of the rig is not known,
so two of the three that the paper computed with are tried:

    python analyses/compare_measured_balls.py --page docs/rotor-rig.md
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from compare_ball_balancer import LOAD, STEP, rig
from compare_rotor_rig import errors, quantiles, staircases, table

import wm_drake as wm
from wm_drake.report.drawing import matplotlib_of
from wm_drake.report.figure import COLOURS, MEASURED, QUIET, Axis, Figure, Line, Panel, Points

HERE = Path(__file__).parent
MARKS = "<!-- measured balls: begin -->", "<!-- measured balls: end -->"
RANGES = {
    "below the resonances, to 1250 rpm": (300.0, 1250.0),
    "resonances, to 2550 rpm": (1250.0, 2550.0),
    "above, without 3000 to 3600 rpm": (2550.0, 5400.0),
}
BEARING = (3000.0, 3600.0)
"""Resonance of a bearing of the rig, which no rigid model has. [rpm]"""


def as_on_the_rig(damping: float, first: float, last: float, stair: float) -> pd.DataFrame:
    """Return speed_rpm and A_max_mm at holds from a first to a last speed. [rpm]"""
    parameters = rig(damping)
    profiles = list(staircases(first, last, stair, 0.25))
    cases = [wm.Case(f"{n}", parameters.loads[LOAD], p) for n, p in enumerate(profiles)]
    done = wm.simulate_many(
        wm.build_machine(parameters), cases, measures=["radial displacements"], step=STEP
    )
    speeds = [p.speed_at(region.begin) for p in profiles for region in p.regions]
    sizes = 1e3 * done.region_radius.values.mean(axis=-1).ravel()
    return pd.DataFrame({"speed_rpm": np.array(speeds) * 30.0 / np.pi, "A_max_mm": sizes})


def rows_of(damping: float, way: str, curve: pd.DataFrame, points: pd.DataFrame) -> list[list[str]]:
    """Return a row of the table for each range of speed."""
    rows = []
    for name, ends in RANGES.items():
        inside = points.speed_rpm.between(*ends) & ~points.speed_rpm.between(*BEARING)
        shown = errors(curve, points[inside])
        if len(shown):
            bias = f"{100.0 * np.median(shown):+.0f}"
            rows.append([f"{damping:g}", way, name, str(len(shown)), bias, *quantiles(shown)])
    return rows


def figure(curves: dict[tuple[float, str], pd.DataFrame], measured: pd.DataFrame) -> Figure:
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
                color=COLOURS[2 * number],
                key=f"wm_drake, race damping {damping:g}",
            )
            for number, damping in enumerate(dict.fromkeys(damping for damping, _ in curves))
            for curve in [curves[damping, way]]
        ]
        x, y = Axis(label="speed, rpm"), Axis(label="A_max, mm", is_log=True)
        panels.append(Panel(marks=tuple(marks), x=x, y=y, title=way, column=column))
    return Figure(panels=tuple(panels), height=420.0)


def main() -> None:
    """Run up and down, and write the table and the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few holds of one damping")
    parser.add_argument("--out", type=Path, help="also write the table to this file")
    parser.add_argument("--page", type=Path, help="renew this page and its picture")
    arguments = parser.parse_args()
    measured = pd.read_csv(HERE / "rodrigues_2010_fig9.csv", comment="#")
    stair, dampings = (1000.0, (0.1,)) if arguments.quick else (10.0, (0.01, 0.1))
    ways = {"up": (320.0, 5310.0), "down": (5310.0, 320.0)}  # 500 holds, in parts of 20
    curves = {
        (damping, way): as_on_the_rig(damping, *ends, stair)
        for damping in dampings
        for way, ends in ways.items()
    }
    rows = [
        row
        for (damping, way), curve in curves.items()
        for row in rows_of(damping, way, curve, measured[measured.direction == way])
    ]
    heads = ["race damping", "direction", "speeds", "points", "median of ours less measured, %"]
    text = table([*heads, "median size, %", "nine of ten points within, %"], rows)
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
