"""When is a massless strut enough for a damper, and what do tubes as bodies cost?

The machine free_stroke, and the same with massless struts in place of the tubes on their bushings, run through the cases that
[A] shows; then tubes of a tenth of the mass, and bushings ten times as stiff, to tell what of the difference comes from which.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from wm_drake import Case, build_machine, load_machine, load_profile, simulate_many
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.spin import Region
from wm_drake.parameters.unbalance_cases import load_unbalance_cases
from wm_drake.simulation.vibration import relative_error
from wm_drake.studies.spin_cycle.damper_topology import strut_machine

NAMES = ("2", "5", "29")


def lighter(machine: Machine) -> MachineParameters:
    """Tubes of a tenth of their mass, the outer ones with half their (raised) inertia, for the sake of the step."""
    bodies = {}
    for damper in machine.parameters.telescopic_dampers:
        for part in ("outer", "inner"):
            name = f"damper_{damper}_{part}"
            override = machine.parameters.bodies.get(name)
            inertia = override.inertia.model_dump() if override and override.inertia else None
            mass = 0.1 * machine.plant.GetBodyByName(name).default_mass()
            bodies[name] = {
                "mass": mass,
                "inertia": inertia and {key: 0.5 * value for key, value in inertia.items()},
            }
    return MachineParameters.model_validate(
        machine.parameters.model_dump(exclude_unset=True) | {"bodies": bodies}
    )


def stiffer(parameters: MachineParameters) -> MachineParameters:
    """Bushings ten times as stiff."""
    kinds = parameters.model_dump()["bushing_types"]
    stiff = {f"stiffness_{axis}": 10.0 * kinds["connecting"]["stiffness_x"] for axis in "xyz"}
    tree = parameters.model_dump(exclude_unset=True) | {
        "bushing_types": {"connecting": kinds["connecting"] | stiff}
    }
    return MachineParameters.model_validate(tree)


def run(
    parameters: MachineParameters, profile: SpinProfile, step: float | None = None
) -> tuple[np.ndarray, float]:
    """RMS displacements (case, region, sensor-axis) [m], and seconds a case beside others."""
    machine = build_machine(parameters)
    chosen = [case for case in load_unbalance_cases() if case.name in NAMES]
    cases = [Case(case.name, case.load(parameters), profile) for case in chosen]
    simulate_many(machine, cases[:1], measures=["regions"], step=step)  # compiles
    begin = time.perf_counter()
    table = simulate_many(machine, cases, measures=["regions"], step=step)
    wall = (time.perf_counter() - begin) / len(cases)
    return table.region_displacement.values.reshape(len(cases), len(profile.regions), -1), wall


def compared(quick: bool, folder: Path) -> list[str]:
    """A table of RMS displacements and differences, a line a region."""
    full = load_machine("free_stroke")
    profile = load_profile("spin_cycle")
    if quick:
        regions = (Region(name="A", begin=0.0, end=1.0), Region(name="B", begin=1.0, end=2.0))
        profile = SpinProfile(time=(0.0, 2.0), speed=(8.0, 16.0), regions=regions)
    strut, strut_wall = run(strut_machine(full, folder), profile)
    tubes, wall = run(full, profile)
    light, _ = run(lighter(build_machine(full)), profile, 6.25e-5)
    stiff, _ = run(stiffer(full), profile, 6.25e-5)
    lines = ["largest RMS displacement, mm, of cases 2, 5, 29 of [A] Table 9 (400 g in front; at the rear; both, opposite),",
             "and by how much others differ from the tubes, %, norm over sensors and axes, worst case",
             "region   tubes  struts   struts differ  tubes of a tenth of the mass  bushings ten times as stiff"]  # fmt: skip
    for index, region in enumerate(profile.regions):
        sizes = [1e3 * rms[:, index].max() for rms in (tubes, strut)]
        apart = [
            100.0 * relative_error(rms[:, index], tubes[:, index]).max()
            for rms in (strut, light, stiff)
        ]
        lines.append(
            f"{region.name:6} {sizes[0]:7.2f} {sizes[1]:7.2f}  {apart[0]:13.2f}  {apart[1]:28.3f}  {apart[2]:27.2f}"
        )
    largest = relative_error(strut.max(axis=1), tubes.max(axis=1)).max()
    lines.append(
        f"largest displacements of a run (any region) differ by at most {100 * largest:.1f} %"
    )
    lines.append(
        f"cost of a case: {wall:.2f} s with tubes, {strut_wall:.2f} s with struts, {wall / strut_wall:.1f} times"
    )
    return lines


def main() -> None:
    """Prints the table, and writes it to a file if asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two seconds instead of a spin cycle")
    parser.add_argument(
        "--out", type=Path, default=Path(tempfile.gettempdir()) / "compare_dampers.txt"
    )
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        text = "\n".join(compared(arguments.quick, Path(folder)))
    arguments.out.write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
