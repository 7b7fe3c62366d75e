"""Does the ball balancer move like that of a rotor rig of which everything is published?

The machine `rodrigues_2010` gets the two balls of Rodrigues, Champneys, Friswell and Wilson (2010)
and runs at constant speeds, with three washers removed. The mean of the largest radial
displacements of both bearing housings is compared with the curves that the paper computed for three
race dampings (rodrigues_2010_fig13.csv). Transients are dropped: each run lasts 10 s, of which the
last 2 s count, in four parts; a motion is steady if these agree within 5 %.

    python analyses/compare_ball_balancer.py
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

import wm_drake as wm
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.types import FloatArray

HERE = Path(__file__).parent
LOAD, STEP, PART, DURATION = "washers_3", 1e-4, 1000, 10.0
MASS, RADIUS, DIAMETER, PLANE = 0.44e-3, 42.8e-3, 4.76e-3, -20e-3
CYLINDRIC = 1700.0 * np.pi / 30.0
"""Critical speed by which the paper divides the race damping. [rad/s]"""
HEAVY = np.deg2rad(224.0)
"""Phase of the static unbalance, Table 2, where both balls lie at the start. [rad]"""
OUTSIDE = ((0.0, 1250.0), (2550.0, 6000.0))
"""Ranges of speed outside the resonances. [rpm]"""


def rig(damping: float) -> MachineParameters:
    """Return the rig with two balls, at a race damping over m R^2 times the critical speed."""
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
    }
    tree = wm.load_machine("rodrigues_2010").model_dump(exclude_unset=True)
    return MachineParameters.model_validate(tree | {"elements": {"abb": ring}})


def radii(parameters: MachineParameters, rpm: float) -> FloatArray:
    """Return A_max in each of the last four parts of a run at a constant speed. (4,) [mm]"""
    speed = rpm * np.pi / 30.0
    profile = SpinProfile(time=(0.0, DURATION), speed=(speed, speed))
    case = wm.Case(LOAD, parameters.loads[LOAD], profile)
    record = wm.simulate(wm.build_machine(parameters), case, step=STEP)
    parts = record.displacement.values[-4 * PART :].reshape(4, PART, 2, 2)
    return 1e3 * np.hypot(*np.moveaxis(parts, -1, 0)).max(axis=1).mean(axis=1)


def compare(damping: float, speeds: FloatArray) -> pd.DataFrame:
    """Return our radii beside those of the paper: smallest and largest, at each speed."""
    paper, rows = pd.read_csv(HERE / "rodrigues_2010_fig13.csv", comment="#"), []
    paper, parameters = paper[paper.race_damping == damping], rig(damping)
    for rpm in speeds:
        theirs = paper.A_max_mm[(paper.speed_rpm - rpm).abs() < 5.0]
        ours = radii(parameters, rpm)
        rows.append([rpm, ours.min(), ours.max(), theirs.min(), theirs.max()])
    columns = ["speed_rpm", "ours_min", "ours_max", "paper_min", "paper_max"]
    return pd.DataFrame(rows, columns=columns)


def summary(damping: float, compared: pd.DataFrame) -> str:
    """Return the errors outside the resonances and the agreement inside them, in a line."""
    outside = np.any([compared.speed_rpm.between(*ends) for ends in OUTSIDE], axis=0)
    errors = 100.0 * np.abs(compared.ours_max / compared.paper_max - 1.0)[outside]
    ours, paper = (
        compared[f"{who}_max"] < 1.05 * compared[f"{who}_min"] for who in ("ours", "paper")
    )
    same = (ours == paper)[~outside]
    return (
        f"race damping {damping:g}: outside the resonances median {errors.median():.1f} %, "
        f"largest {errors.max():.1f} % ({len(errors)} speeds); inside, the same kind of motion "
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
