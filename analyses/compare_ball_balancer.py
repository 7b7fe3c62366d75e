"""Does the ball balancer move like that of a rotor rig of which everything is published?

The machine `rodrigues_2010` gets the two balls of Rodrigues, Champneys, Friswell and Wilson (2010)
and runs at constant speeds, with three washers removed and without gravity, which the model of the
paper does not have. The mean of the largest radial displacements of both bearing housings is
compared with the curves that the paper computed for three race dampings (rodrigues_2010_fig13.csv).
Transients are dropped: each run lasts 10 s, or 40 s with the largest damping, of which the last 2 s
count, in four parts; a motion is steady if these agree within 5 %.

    python analyses/compare_ball_balancer.py
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

import wm_drake as wm
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.spin import Region
from wm_drake.parameters.types import FloatArray

HERE = Path(__file__).parent
LOAD, STEP, PART = "washers_3", 1e-4, 0.5
DURATIONS = {0.01: 10.0, 0.1: 10.0, 1.0: 40.0}
MASS, RADIUS, DIAMETER, PLANE = 0.44e-3, 42.8e-3, 4.76e-3, -20e-3
CYLINDRIC = 1700.0 * np.pi / 30.0
"""Critical speed by which the paper divides the race damping. [rad/s]"""
HEAVY = np.deg2rad(224.0)
"""Phase of the static unbalance, Table 2, where both balls lie at the start. [rad]"""
OUTSIDE = ((0.0, 1250.0), (2550.0, 6000.0))
"""Ranges of speed outside the resonances. [rpm]"""
FIRST = 2550.0
"""First speed above the resonances. [rpm]"""


def rig(damping: float, gravity: float = 9.81, **race: float) -> MachineParameters:
    """Return the rig with two balls, at a race damping over m R^2 times the critical speed.

    Args:
        damping: Ratio.
        gravity: [m/s^2]
        race: Other numbers of the ring, such as its eccentricity, in SI.
    """
    apart = 1.001 * np.arcsin(0.5 * DIAMETER / RADIUS)
    ring = {
        "kind": "ball_ring",
        "y": PLANE,
        "balls": 2,
        "ball_mass": MASS,
        "ball_diameter": DIAMETER,
        "race_radius": RADIUS,
        "damping": damping * MASS * RADIUS**2 * CYLINDRIC,
        "race_frequency": 3000.0 * np.pi,
        "start_angles": (HEAVY - apart, HEAVY + apart),
    } | race
    tree = wm.load_machine("rodrigues_2010").model_dump(exclude_unset=True)
    changes = {"elements": {"abb": ring}, "gravity": gravity}
    return MachineParameters.model_validate(tree | changes)


def radii(damping: float, speeds: FloatArray, gravity: float = 0.0) -> FloatArray:
    """Return A_max in each of the last four parts of runs at constant speeds. (n, 4) [mm]

    Args:
        damping, gravity: As for `rig`.
        speeds: (n,) [rpm]
    """
    parameters, end, cases = rig(damping, gravity), DURATIONS[damping], []
    ends = end - PART * np.arange(4.0, -1.0, -1.0)
    parts = tuple(
        Region(name=f"part_{k}", begin=ends[k], end=ends[k + 1]) for k in range(len(ends) - 1)
    )
    for rpm in speeds:
        speed = rpm * np.pi / 30.0
        profile = SpinProfile(time=(0.0, end), speed=(speed, speed), regions=parts)
        cases.append(wm.Case(f"{rpm:g} rpm", parameters.loads[LOAD], profile))
    machine = wm.build_machine(parameters)
    done = wm.simulate_many(machine, cases, measures=["radial displacements"], step=STEP)
    return 1e3 * done.region_radius.values.mean(axis=-1)


def compare(damping: float, speeds: FloatArray) -> pd.DataFrame:
    """Return our radii beside those of the paper: smallest and largest, at each speed."""
    paper, rows = pd.read_csv(HERE / "rodrigues_2010_fig13.csv", comment="#"), []
    paper = paper[paper.race_damping == damping]
    for rpm, ours in zip(speeds, radii(damping, speeds), strict=True):
        theirs = paper.A_max_mm[(paper.speed_rpm - rpm).abs() < 5.0]
        rows.append([rpm, ours.min(), ours.max(), theirs.min(), theirs.max()])
    columns = ["speed_rpm", "ours_min", "ours_max", "paper_min", "paper_max"]
    return pd.DataFrame(rows, columns=columns)


def summary(damping: float, compared: pd.DataFrame) -> str:
    """Return the errors outside the resonances and the agreement inside them, in a line."""
    outside = np.any([compared.speed_rpm.between(*ends) for ends in OUTSIDE], axis=0)
    errors = 100.0 * np.abs(compared.ours_max / compared.paper_max - 1.0)[outside]
    beyond = errors[compared.speed_rpm[outside] != FIRST]
    ours, paper = (
        compared[f"{who}_max"] < 1.05 * compared[f"{who}_min"] for who in ("ours", "paper")
    )
    same = (ours == paper)[~outside]
    return (
        f"race damping {damping:g}: outside the resonances median {errors.median():.1f} %, "
        f"largest {errors.max():.1f} %, without {FIRST:g} rpm {beyond.max():.1f} % ({len(errors)} "
        f"speeds); inside, the same kind of motion "
        f"(steady or not) at {same.sum()} of {len(same)} speeds"
    )


def main() -> None:
    """Compare the three dampings and print a table and a line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two speeds of one damping")
    parser.add_argument("--out", type=Path, help="also write the lines to this file")
    arguments = parser.parse_args()
    step = 2700.0 if arguments.quick else 150.0
    lines = []
    for damping in (0.01,) if arguments.quick else (0.01, 0.1, 1.0):
        compared = compare(damping, np.arange(600.0, 5300.0, step))
        print(compared.round(4).to_string(index=False))
        lines.append(summary(damping, compared))
        print(lines[-1])
    if arguments.out:
        arguments.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
