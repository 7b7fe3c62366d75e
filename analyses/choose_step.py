"""Which integration step keeps every peak within 0.05 % of the converged value?

Peaks are the amplitudes and the largest displacements, forces and moments of each case. They are
compared with those at a step of 0.125 ms, for dampers with smooth friction and with friction that
has corners. The script prints one table of errors per kind of damper, and the longest step within
the limit. It takes about two minutes.
"""

import argparse
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

from wm_drake import Case, build_machine, load_machine, measure, simulate
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.machine import DEFAULT_STEP
from wm_drake.simulation.runs import DivergenceWarning

STEPS_MS = (5.0, 2.5, 1.25, 0.5)
CONVERGED_MS = 0.125
BOUND_PERCENT = 0.05
PEAKS = ("amplitude", "detergent_displacement", "gasket_force", "gasket_moment")
DAMPERS = {
    "MSTV (reference)": None,
    "HAVSIN, full friction from 0.1 m/s": {
        "law": "havsin",
        "friction_force": 25.0,
        "full_friction_velocity": 0.1,
    },
    "free stroke": {  # stroke and curve are assumptions, of the size that [A] describes
        "law": "free_stroke",
        "friction_force": 25.0,
        "friction_damping": 60.0,
        "basic_friction_force": 5.0,
        "basic_full_friction_velocity": 0.09,
        "sponge": {
            "displacement": (-0.02, -0.01, -0.004, 0.004, 0.01, 0.02),  # m
            "force": (-120.0, -40.0, 0.0, 0.0, 40.0, 120.0),  # N
        },
    },
}


def machine_with(damper: dict[str, object] | None) -> MachineParameters:
    """Return the reference machine with other dampers and its own end bushings."""
    reference = load_machine("reference")
    if damper is None:
        return reference
    tree = reference.model_dump()
    bushing = {"end_bushing": tree["damper_types"]["friction"]["end_bushing"]}
    return MachineParameters.model_validate(tree | {"damper_types": {"friction": damper | bushing}})


def errors_percent(
    parameters: MachineParameters, profile: SpinProfile, steps_ms: tuple[float, ...]
) -> pd.DataFrame:
    """Return the largest difference of any peak from its converged value, by step and load. [%]"""
    machine = build_machine(parameters)
    rows = []
    for load, gasket in [
        *((load, True) for load in parameters.loads),
        ("middle", False),
        ("counter", False),
    ]:
        case = Case(load, parameters.loads[load], profile, gasket)
        peaks = {}
        for step in (*steps_ms, CONVERGED_MS):
            measures = measure(simulate(machine, case, step=1e-3 * step))
            peaks[step] = np.concatenate(
                [getattr(measures, peak) for peak in PEAKS[: 4 if gasket else 2]]
            )
        for step in steps_ms:
            error = 100.0 * np.abs(peaks[step] / peaks[CONVERGED_MS] - 1.0)
            name = load if gasket else f"{load}, no gasket"
            rows.append({"step, ms": step, "load": name, "largest error, %": error.max()})
    return pd.DataFrame(rows)


def main() -> None:
    """Print a table of errors for each kind of damper, and the default step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="runs of 15 s and two steps only")
    parser.add_argument("--out", type=Path, help="also write the tables to this file")
    arguments = parser.parse_args()
    warnings.simplefilter("error", DivergenceWarning)
    profile = load_machine("reference").profile
    steps = STEPS_MS
    if arguments.quick:
        profile, steps = SpinProfile(time=(0.0, 15.0), speed=(0.0, 24.0)), (5.0, 2.5)
    text = []
    for name, damper in DAMPERS.items():
        table = errors_percent(machine_with(damper), profile, steps)
        worst = table.pivot_table(
            index="step, ms", columns="load", values="largest error, %"
        ).sort_index(ascending=False)
        with_gasket = worst[[load for load in worst.columns if "," not in load]].max(axis=1)
        good = [step for step in steps if with_gasket[step] <= BOUND_PERCENT]
        text += [f"{name}: largest error of any peak, %", worst.round(4).to_string()]
        longest = max(good, default=float("nan"))
        text += [f"longest step within {BOUND_PERCENT} % with gasket: {longest:g} ms", ""]
        print("\n".join(text[-4:]), flush=True)
    text.append(f"default step: {1e3 * DEFAULT_STEP:g} ms")
    print(text[-1])
    if arguments.out:
        arguments.out.write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    main()
