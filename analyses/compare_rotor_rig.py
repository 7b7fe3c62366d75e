"""Does the model move like a rotor rig of which everything is published, with nothing fitted?

The machine `rodrigues_2010` is the rig of Rodrigues, Champneys, Friswell and Wilson (2010). The
script runs it with three washers removed, in three ways: steady (each hold settles for 4 s), and up
and down in the steps of the experiment. It compares the mean largest radial displacement of both
bearing housings with the curve that the paper computed and with the points that it measured
(rodrigues_2010_fig8.csv, rodrigues_2010_fig7.csv), and writes tables and a picture to a page:

    python analyses/compare_rotor_rig.py --page docs/rotor-rig.md
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from compare_ball_balancer import PLANE

import wm_drake as wm
from wm_drake.model.machine import Machine
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.report.drawing import matplotlib_of
from wm_drake.report.figure import (
    MEASURED,
    OURS,
    QUIET,
    Axis,
    Figure,
    Line,
    Mark,
    Panel,
    Points,
    Text,
    in_grid,
)
from wm_drake.report.quantity import shown
from wm_drake.studies.modes.linearisation import SLIDING
from wm_drake.studies.modes.study import MachineModes

HERE = Path(__file__).parent
BASE = -100.0
"""Height at which the drawn supports stand. [mm]"""
ALL_ROUND = np.linspace(0.0, 2.0 * np.pi, 80)
LOAD, HOLDS = "washers_3", 20
COMPUTED, MEASURED_RPM = (1457.5, 1700.0, 1917.5, 2280.0), (1415.0, 1675.0, 1944.0, 2310.0)
MARKS = "<!-- rig: begin -->", "<!-- rig: end -->"


def staircases(first: float, last: float, stair: float, settle: float) -> Iterator[SpinProfile]:
    """Yield profiles of up to `HOLDS` holds each, from a first to a last speed. [rpm, s]"""
    speeds = np.arange(first, last + np.sign(last - first) * 1e-6, np.sign(last - first) * stair)
    for part in np.array_split(speeds, -(-len(speeds) // HOLDS)):
        ramp = {"ramp_to": f"{part[0] - np.sign(last - first) * stair} rpm", "rate": "600 rpm/s"}
        stairs = {
            "stairs_to": f"{part[-1]} rpm",
            "stair": f"{stair} rpm",
            "rate": "1000 rpm/s",
            "settle": f"{settle} s",
            "measure": "0.25 s",
        }
        yield SpinProfile.model_validate({"steps": [ramp, stairs]})


def sweep(machine: Machine, *stairs: float) -> pd.DataFrame:
    """Return the motion at each hold of `staircases`.

    Returns:
        Columns speed_rpm, A_max_mm, and whirl_B1, whirl_B2: 1 for forward, -1 for backward whirl.
    """
    load, rows = machine.parameters.loads[LOAD], []
    for profile in staircases(*stairs):
        record = wm.simulate(machine, wm.Case(LOAD, load, profile))
        radius = wm.measure(record, measures=["radial displacements"]).region_radius.values
        for region, radii in zip(profile.regions, radius, strict=True):
            orbit = record.displacement.sel(time=slice(region.begin, region.end)).values
            speed = float(profile.speed_at(region.begin)) * 30.0 / np.pi
            rows.append([speed, 1e3 * radii.mean(), *(whirl(orbit[:, k : k + 2]) for k in (0, 2))])
    return pd.DataFrame(rows, columns=["speed_rpm", "A_max_mm", "whirl_B1", "whirl_B2"])


def whirl(orbit: FloatArray) -> float:
    """Return the sense in which an orbit (n, 2) turns: 1 from the first axis to the second."""
    x, y = (orbit - orbit.mean(axis=0)).T
    return float(np.sign(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])))


def errors(curve: pd.DataFrame, points: pd.DataFrame) -> FloatArray:
    """Return the relative difference of a curve from points, where the curve reaches. (n,)"""
    inside = points.speed_rpm.between(curve.speed_rpm.min(), curve.speed_rpm.max())
    points, ordered = points[inside], curve.sort_values("speed_rpm")
    ours = np.interp(points.speed_rpm, ordered.speed_rpm, ordered.A_max_mm)
    return np.asarray(ours / points.A_max_mm - 1.0)


def peaks(curve: pd.DataFrame) -> list[float]:
    """Return the speeds of the local maxima of a curve. [rpm]"""
    a = curve.A_max_mm.to_numpy()
    inner = np.flatnonzero((a[1:-1] > a[:-2]) & (a[1:-1] > a[2:])) + 1
    return [float(curve.speed_rpm[k]) for k in inner]


def backward(curve: pd.DataFrame, bearing: str) -> str:
    """Return the ranges of speed with backward whirl at a bearing housing, in words."""
    speeds = curve.speed_rpm[curve[f"whirl_{bearing}"] < 0.0].to_numpy()
    parts = np.split(speeds, np.flatnonzero(np.diff(speeds) > 31.0) + 1) if len(speeds) else []
    return ", ".join(f"{part[0]:.0f} to {part[-1]:.0f}" for part in parts) or "none"


def figure(
    steady: pd.DataFrame, up: pd.DataFrame, paper: pd.DataFrame, measured: pd.DataFrame
) -> Figure:
    """Return the picture: our curves over the published ones."""
    marks = [
        Points(
            part.speed_rpm,
            part.A_max_mm,
            color=color,
            size=4.0,
            symbol=symbol,
            key=f"measured, {way}",
        )
        for way, part in measured.groupby("direction")
        for color, symbol in [(MEASURED, "triangle-up") if way == "up" else (QUIET, "circle")]
    ]
    marks += [
        Line(
            paper.speed_rpm,
            paper.A_max_mm,
            color="#1a1a1a",
            dash="dashed",
            key="computed in the paper",
        ),
        Line(steady.speed_rpm, steady.A_max_mm, color=OURS, width=2.0, key="wm_drake, steady"),
        Line(
            up.speed_rpm, up.A_max_mm, color="#009e73", width=1.0, key="wm_drake, as on the rig, up"
        ),
    ]
    x, y = Axis(label="speed, rpm"), Axis(label="A_max, mm", is_log=True)
    return Figure(panels=(Panel(marks=tuple(marks), x=x, y=y),), height=420.0)


def frames_figure(machine: Machine) -> Figure:
    """Return the rig from the side and from the front, with the frames of the machine file."""
    places = {k: 1e3 * p for k, p in machine.set_up(LOAD).points.accelerometers.items()}
    ring = 1e3 * PLANE
    grey, outline = {"color": QUIET, "width": 1.5}, {"color": OURS, "width": 2.0}
    side: list[Mark] = [
        box(-180.0, 140.0, 8.0, **outline),
        box(ring - 5.0, ring + 5.0, 50.0, **outline),
        Line((-190.0, 150.0), (BASE, BASE), **grey),
        Points((0.0,), (0.0,), color="#1a1a1a", size=7.0),
        label(52.0, 14.0, "To: centre of mass C"),
        label(ring, -56.0, f"balls, y = {ring:g} mm"),
    ]
    for name, place in places.items():
        side += [
            box(place[1] - 7.0, place[1] + 7.0, 20.0, color=MEASURED, width=2.0),
            spring(place[1], -20.0, BASE, is_upright=True),
            label(place[1], 26.0, f"{name}, y = {place[1]:g} mm"),
            label(place[1], BASE - 10.0, f"support_{name[-1]}"),
        ]
    turn = np.linspace(0.25, 1.2, 30)
    front: list[Mark] = [
        *(Line(r * np.sin(ALL_ROUND), r * np.cos(ALL_ROUND), **outline) for r in (8.0, 50.0)),
        Line(60.0 * np.sin(turn), 60.0 * np.cos(turn), color="#1a1a1a", width=1.5),
        Points((60.0 * np.sin(turn[-1]),), (60.0 * np.cos(turn[-1]),), color="#1a1a1a", size=6.0),
        label(62.0, 62.0, "positive speed"),
        spring(0.0, -50.0, BASE, is_upright=True),
        spring(0.0, 50.0, -BASE, is_upright=False),
        label(0.0, BASE - 10.0, "stiffness_z"),
        label(-BASE - 20.0, -14.0, "stiffness_x"),
    ]
    up = Axis(label="z, mm (X of the rig)", range=(-120.0, 80.0))
    axes = [
        (Axis(label="y, mm (axis Z of the rig)", range=(-200.0, 160.0)), up),
        (Axis(label="x, mm (Y of the rig)", range=(-60.0, 140.0)), up),
    ]
    panels = [
        Panel(title=title, marks=tuple(marks), x=x, y=y, is_square=True)
        for title, marks, (x, y) in zip(
            ("from the side", "from the front"), (side, front), axes, strict=True
        )
    ]
    return Figure(panels=in_grid(panels, 2), height=300.0, widths=(1.8, 1.0))


def box(left: float, right: float, reach: float, **look: Any) -> Line:
    """Return a rectangle around the axis, `reach` up and down."""
    x, y = (left, right, right, left, left), (-reach, -reach, reach, reach, -reach)
    return Line(x, y, **look)


def spring(at: float, begin: float, end: float, *, is_upright: bool) -> Line:
    """Return a zigzag from a begin to an end, upright or across."""
    along = np.linspace(begin, end, 12)
    aside = at + 4.0 * np.array([0.0, 0.0, *[1.0, -1.0] * 4, 0.0, 0.0])
    x, y = (aside, along) if is_upright else (along, aside)
    return Line(x, y, color=QUIET, width=1.5)


def label(x: float, y: float, text: str) -> Text:
    """Return a text at a place of a drawing."""
    return Text(x, y, text, size=11.0)


def tables(
    steady: pd.DataFrame, runs: dict[str, pd.DataFrame], paper: pd.DataFrame, measured: pd.DataFrame
) -> str:
    """Return the comparison with the published curve and points as tables in Markdown."""
    ours = [peak for peak in peaks(steady) if peak > 1300.0]
    rows = [
        [f"{computed:.1f}", f"{seen:.0f}", *peak_and_difference(ours, computed, seen)]
        for computed, seen in zip(COMPUTED, MEASURED_RPM, strict=True)
    ]
    heads = "critical speed computed in the paper, rpm", "measured, rpm", "ours, rpm"
    speeds = table([*heads, "against computed, %", "against measured, %"], rows)
    rows = [["steady", "computed in the paper", *quantiles(errors(steady, paper))]]
    for name, curve in {"steady": steady, **runs}.items():
        for way, points in measured.groupby("direction"):
            if name in ("steady", way):
                rows.append([name, f"measured, {way}", *quantiles(errors(curve, points))])
    curves = table(["ours", "against", "median, %", "nine of ten points within, %"], rows)
    level = {
        "ours": np.interp(4500.0, steady.speed_rpm, steady.A_max_mm),
        "paper": np.interp(4500.0, paper.speed_rpm, paper.A_max_mm),
        "measured": measured.A_max_mm[measured.speed_rpm.between(4400.0, 4600.0)].mean(),
    }
    levels = ", ".join(f"{name} {value:.4f} mm" for name, value in level.items())
    senses = [[housing, backward(steady, housing)] for housing in ("B1", "B2")]
    return "\n\n".join(
        [
            speeds,
            curves,
            f"Level at 4500 rpm: {levels}.",
            table(["bearing housing", "backward whirl, rpm"], senses),
        ]
    )


def peak_and_difference(ours: list[float], computed: float, seen: float) -> list[str]:
    """Return our peak nearest to a computed one, and its differences in percent, as texts."""
    if not ours:
        return ["-", "-", "-"]
    peak = min(ours, key=lambda speed: abs(speed - computed))
    return [f"{peak:.0f}", *(f"{100.0 * (peak / other - 1.0):+.2f}" for other in (computed, seen))]


def quantiles(differences: FloatArray) -> list[str]:
    """Return median and 90 % quantile of the sizes of differences, in percent, as texts."""
    return [f"{100.0 * np.quantile(np.abs(differences), part):.1f}" for part in (0.5, 0.9)]


def table(heads: list[str], rows: list[list[str]]) -> str:
    """Return a table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def mapping(machine: Machine, steady: pd.DataFrame, stair: float, settle: float) -> str:
    """Return how much the mapping of the rig to tub and drum changes the curve, as a table."""
    parameters, rows = machine.parameters, []
    supports = ("bushings.support_1", "bushings.support_2")
    changes = {
        "carrier of ten times the mass": {"bodies.tub.mass": 0.0128, "bodies.drum.mass": 1.2672},
        "a quarter of the axial stiffness": {f"{name}.stiffness_y": 2.5e5 for name in supports},
        "a quarter of the stiffness about the shaft": {
            f"{name}.rotational_stiffness_y": 250.0 for name in supports
        },
    }
    for words, values in changes.items():
        changed = sweep(
            wm.build_machine(wm.with_values(parameters, values)), 360.0, 5340.0, stair, settle
        )
        rows.append(
            [words, *quantiles(errors(changed, steady[steady.speed_rpm.isin(changed.speed_rpm)]))]
        )
    return table(["change of the mapping", "median, %", "nine of ten points within, %"], rows)


def critical_sentence(found: MachineModes) -> str:
    """Return the critical speeds of the Campbell diagram as a sentence."""
    speeds = found.critical_speeds * 30.0 / np.pi
    across = ", ".join(f"{speed:.0f}" for speed in speeds if speed < 5000.0)
    return f"Critical speeds of the linearised machine (order 1 meets a mode): {across} rpm."


def campbell_figure(found: MachineModes) -> Figure:
    """Return natural frequencies over the speed, with the published critical speeds on order 1."""
    diagram = found.over_speed.sel(linearisation=SLIDING)
    rpm = shown(diagram.speed)
    frequency = diagram.frequency.dropna("curve", how="all")
    # the carrier along and about the shaft: above
    inside = frequency.isel(curve=(frequency[0] < 100.0).values)
    marks = [Line(rpm, one, color=OURS, width=2.0, key="wm_drake") for one in shown(inside).T]
    marks.append(Line(rpm, rpm / 60.0, color=QUIET, dash="dashed", key="order 1"))
    published = (
        (COMPUTED, "#1a1a1a", "circle", "critical speed computed in the paper"),
        (MEASURED_RPM, MEASURED, "triangle-up", "critical speed measured"),
    )
    marks += [
        Points(speeds, np.array(speeds) / 60.0, color=color, symbol=symbol, size=8.0, key=key)
        for speeds, color, symbol, key in published
    ]
    x = Axis(label="speed, rpm", range=(0.0, 5400.0))
    y = Axis(label="natural frequency, Hz", range=(0.0, 60.0))
    return Figure(panels=(Panel(marks=tuple(marks), x=x, y=y),), height=420.0)


def main() -> None:
    """Run the sweeps and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few holds, which settle for 0.3 s")
    parser.add_argument("--out", type=Path, help="also write the tables to this file")
    parser.add_argument("--page", type=Path, help="renew this page and its picture")
    arguments = parser.parse_args()
    machine = wm.build_machine(wm.load_machine("rodrigues_2010"))
    paper = pd.read_csv(HERE / "rodrigues_2010_fig8.csv", comment="#")
    measured = pd.read_csv(HERE / "rodrigues_2010_fig7.csv", comment="#")
    stair, settle, step = (1000.0, 0.3, 1000.0) if arguments.quick else (30.0, 4.0, 10.0)
    steady = sweep(machine, 360.0, 5360.0, stair, settle)
    changes = mapping(machine, steady, 10.0 * stair if not arguments.quick else stair, settle)
    if not arguments.quick:
        fine = sweep(machine, 1400.0, 2400.0, 5.0, settle)
        steady = pd.concat([steady, fine]).sort_values("speed_rpm", ignore_index=True)
    runs = {
        "up": sweep(machine, 310.0, 5310.0, step, 0.25),
        "down": sweep(machine, 5310.0, 310.0, step, 0.25),
    }
    found = wm.modes(machine, LOAD)
    text = "\n\n".join([tables(steady, runs, paper, measured), critical_sentence(found), changes])
    print(text)
    if arguments.out:
        arguments.out.write_text(text + "\n")
    if arguments.page:
        before, _, rest = arguments.page.read_text().partition(MARKS[0])
        after = rest.partition(MARKS[1])[2]
        arguments.page.write_text(f"{before}{MARKS[0]}\n\n{text}\n\n{MARKS[1]}{after}")
        pictures = {
            "rotor_rig_frames.png": frames_figure(machine),
            "rotor_rig.png": figure(steady, runs["up"], paper, measured),
            "rotor_rig_campbell.png": campbell_figure(found),
        }
        for name, picture in pictures.items():
            matplotlib_of(picture).savefig(arguments.page.parent / "pictures" / name, dpi=110)


if __name__ == "__main__":
    main()
