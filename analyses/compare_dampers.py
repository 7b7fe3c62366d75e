"""When is a massless strut a sufficient model of a damper, and what do tubes as bodies cost?

The machine free_stroke has damper tubes as bodies on bushings. The script runs it, and the same
machine with massless struts, through the cases that [A] shows. Two more variants, with tubes of a
tenth of the mass and with bushings ten times as stiff, show the cause of the difference. The script
prints a table of RMS displacements and differences per region, and the run times. It takes about
one minute.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from analysis_tools.damper_topology import strut_machine

from wm_drake import Case, build_machine, load_machine, load_profile, simulate_many
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.spin import Region
from wm_drake.parameters.unbalance_cases import load_unbalance_cases
from wm_drake.simulation.vibration import relative_error

NAMES = ("2", "5", "29")


def lighter(machine: Machine) -> MachineParameters:
    """Return the machine with tubes of a tenth of their mass.

    The outer tubes keep half of their raised inertia, so that the step need not be too short.
    """
    bodies = {}
    for damper in machine.parameters.telescopic_dampers:
        for part in ("outer", "inner"):
            name = f"damper_{damper}_{part}"
            override = machine.parameters.bodies.get(name)
            inertia = override.inertia.model_dump() if override and override.inertia else None
            mass = 0.1 * machine.drawn.plant.GetBodyByName(name).default_mass()
            bodies[name] = {
                "mass": mass,
                "inertia": inertia and {key: 0.5 * value for key, value in inertia.items()},
            }
    return MachineParameters.model_validate(
        machine.parameters.model_dump(exclude_unset=True) | {"bodies": bodies}
    )


def stiffer(parameters: MachineParameters) -> MachineParameters:
    """Return the machine with bushings that are ten times as stiff."""
    kinds = parameters.model_dump()["bushing_types"]
    stiff = {f"stiffness_{axis}": 10.0 * kinds["connecting"]["stiffness_x"] for axis in "xyz"}
    tree = parameters.model_dump(exclude_unset=True) | {
        "bushing_types": {"connecting": kinds["connecting"] | stiff}
    }
    return MachineParameters.model_validate(tree)


def run(
    parameters: MachineParameters, profile: SpinProfile, step: float | None = None
) -> tuple[np.ndarray, float]:
    """Return the RMS displacements (case, region, sensor-axis) [m], and the time per case [s].

    The cases run as one batch, so the time per case is shorter than that of a single run.
    """
    machine = build_machine(parameters)
    chosen = [case for case in load_unbalance_cases() if case.name in NAMES]
    cases = [Case(case.name, case.load(parameters), profile) for case in chosen]
    simulate_many(machine, cases[:1], measures=["regions"], step=step)  # compiles
    begin = time.perf_counter()
    table = simulate_many(machine, cases, measures=["regions"], step=step)
    wall = (time.perf_counter() - begin) / len(cases)
    return table.region_displacement.values.reshape(len(cases), len(profile.regions), -1), wall


def compared(quick: bool, folder: Path) -> list[str]:
    """Return a table of RMS displacements and differences, one line per region."""
    full = load_machine("free_stroke")
    profile = load_profile("spin_cycle")
    if quick:
        regions = (Region(name="A", begin=0.0, end=1.0), Region(name="B", begin=1.0, end=2.0))
        profile = SpinProfile(time=(0.0, 2.0), speed=(8.0, 16.0), regions=regions)
    strut, strut_wall = run(strut_machine(full, folder), profile)
    tubes, wall = run(full, profile)
    light, _ = run(lighter(build_machine(full)), profile, 6.25e-5)
    stiff, _ = run(stiffer(full), profile, 6.25e-5)
    lines = [
        "cases 2, 5, 29 of [A] Table 9 (400 g at the front; at the rear; both, opposite)",
        "columns 2, 3: largest RMS displacement, mm, with tubes as bodies and with massless struts",
        "columns 4 to 6: difference from tubes as bodies, %, norm over sensors and axes, worst",
        "region   tubes  struts         struts  tubes of a tenth of the mass  "
        "bushings ten times as stiff",
    ]
    for index, region in enumerate(profile.regions):
        sizes = [1e3 * rms[:, index].max() for rms in (tubes, strut)]
        apart = [
            100.0 * relative_error(rms[:, index], tubes[:, index]).max()
            for rms in (strut, light, stiff)
        ]
        lines.append(
            f"{region.name:6} {sizes[0]:7.2f} {sizes[1]:7.2f}  {apart[0]:13.2f}  "
            f"{apart[1]:28.3f}  {apart[2]:27.2f}"
        )
    largest = relative_error(strut.max(axis=1), tubes.max(axis=1)).max()
    lines.append(
        "with struts, the largest displacements of a run (over all regions) differ by at most "
        f"{100 * largest:.1f} %"
    )
    lines.append(
        f"time per case: {wall:.2f} s with tubes, {strut_wall:.2f} s with struts, "
        f"ratio {wall / strut_wall:.1f}"
    )
    return lines


def main() -> None:
    """Print the table and write it to a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="run two seconds instead of a spin cycle"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(tempfile.gettempdir()) / "compare_dampers.txt",
        help="file for the result",
    )
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        text = "\n".join(compared(arguments.quick, Path(folder)))
    arguments.out.write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
