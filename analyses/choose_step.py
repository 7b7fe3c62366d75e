"""Which step and which integrator keep every peak near its converged value?

Peaks are the amplitudes and the largest displacements, forces and moments of each case. They are
compared with those of the Runge-Kutta scheme at a step of 0.125 ms, for every damper law, with and
without gasket, for a run-up to 400 rpm and for one to 1400 rpm. The script prints a table of errors
for each law and run-up. Laws in telescopic dampers, with tubes as bodies, follow at shorter steps
and are compared with the Runge-Kutta scheme at 0.0625 ms. It takes about fifteen minutes.
"""

import argparse
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake import Case, build_machine, load_machine, simulate_many
from wm_drake.errors import InputError
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.machine import DEFAULT_STEP

CONVERGED_MS = 0.125
WAYS = (
    ("auto", 2.5),
    ("multistep", 1.25),
    ("multistep", 0.5),
    ("runge_kutta", 5.0),
    ("runge_kutta", 2.5),
    ("runge_kutta", 1.25),
)
"""Integrator and step [ms]."""
CONVERGED_TUBES_MS = 0.0625
WAYS_OF_TUBES = (("auto", 0.25), ("midpoint", 0.5), ("midpoint", 0.125), ("runge_kutta", 0.25))
PEAKS = ("amplitude", "detergent_displacement", "gasket_force", "gasket_moment")
BOUND_PERCENT = {True: 0.1, False: 0.3}
"""Largest error of the default step, with and without gasket."""

SPONGE = {"sponge_stiffness": 176e3, "sponge_damping": 90.0, "slider_damping": 400.0}  # [C]
DAMPERS: dict[str, dict[str, object] | None] = {
    "HAVSIN (reference)": None,
    "MSTV": {  # found by a fit to measured amplitudes of [B]
        "law": "mstv",
        "friction_force": 19.02,
        "friction_damping": 0.0,
        "regularisation_velocity": 1e-6,
        "sponge_stiffness": 17.09e3,
        "sponge_damping": 80.84,
        "slider_damping": 45.01,
    },
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
    "STV, full friction from 0.1 m/s": {
        "law": "stv",
        "friction_force": 25.0,
        "transition_velocity": 0.1,
    },
    "STV behind a sponge": {
        "law": "stv_sponge",
        "friction_force": 25.0,
        "transition_velocity": 0.05,
        **SPONGE,
    },
    "Coulomb": {"law": "coulomb", "friction_force": 25.0},
}


def machine_with(damper: dict[str, object] | None) -> MachineParameters:
    """Return the reference machine with other dampers and its own end bushings."""
    reference = load_machine("reference")
    if damper is None:
        return reference
    tree = reference.model_dump()
    bushing = {"end_bushing": tree["damper_types"]["friction"]["end_bushing"]}
    return MachineParameters.model_validate(tree | {"damper_types": {"friction": damper | bushing}})


def machine_with_tubes(damper: dict[str, object] | None) -> MachineParameters:
    """Return the machine with telescopic dampers, with another law; None for the reference's."""
    if damper is None:
        of_reference = load_machine("reference").model_dump()["damper_types"]["friction"]
        damper = {key: value for key, value in of_reference.items() if key != "end_bushing"}
    tree = load_machine("free_stroke").model_dump()
    return MachineParameters.model_validate(tree | {"damper_types": {"free_stroke": damper}})


def cases_of(parameters: MachineParameters, profile: SpinProfile) -> list[Case]:
    """Return a case for each load with gasket, and two without."""
    without = list(parameters.loads)[:2]
    pairs = [*((load, True) for load in parameters.loads), *((load, False) for load in without)]
    return [
        Case(load if gasket else f"{load}, no gasket", parameters.loads[load], profile, gasket)
        for load, gasket in pairs
    ]


def peaks(table: xr.Dataset, run: int, gasket: bool) -> np.ndarray:
    """Return the peaks of a run of a table, one after the other. SI."""
    names = PEAKS if gasket else PEAKS[:2]
    return np.concatenate([table[name].values[run] for name in names])


def errors_percent(
    parameters: MachineParameters,
    profile: SpinProfile,
    ways: tuple[tuple[str, float], ...] = WAYS,
    converged_ms: float = CONVERGED_MS,
) -> pd.DataFrame:
    """Return the largest difference of any peak from its converged value, by way and case. [%]

    A way that the machine does not allow is left out.
    """
    machine = build_machine(parameters)
    cases = cases_of(parameters, profile)
    measures = ("amplitudes", "extremes")
    converged = simulate_many(
        machine, cases, measures=measures, step=1e-3 * converged_ms, integrator="runge_kutta"
    )
    rows = {}
    for integrator, step_ms in ways:
        try:
            table = simulate_many(
                machine, cases, measures=measures, step=1e-3 * step_ms, integrator=integrator
            )
        except InputError as refused:
            print(f"{integrator} at {step_ms:g} ms is left out: {refused}")
            continue
        largest = {}
        for run, case in enumerate(cases):
            ratio = peaks(table, run, case.gasket) / peaks(converged, run, case.gasket)
            largest[case.name] = 100.0 * float(np.abs(ratio - 1.0).max())
        rows[f"{integrator} {step_ms:g} ms"] = largest
    return pd.DataFrame(rows).T


def main() -> None:
    """Print a table of errors for each law and run-up."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="runs of 3 s, one law")
    parser.add_argument("--out", type=Path, help="also write the tables to this file")
    arguments = parser.parse_args()
    warnings.simplefilter("error", RuntimeWarning)
    profiles = {
        "400 rpm": load_machine("reference").profile,
        "1400 rpm": SpinProfile(time=(0.0, 30.0, 40.0), speed=(0.0, 146.6, 146.6)),
    }
    dampers = DAMPERS
    if arguments.quick:
        profiles = {"200 rpm": SpinProfile(time=(0.0, 3.0), speed=(0.0, 21.0))}
        dampers = {"HAVSIN (reference)": None}
    text = []
    for name, damper in dampers.items():
        for speed, profile in profiles.items():
            errors = errors_percent(machine_with(damper), profile)
            text += table_of(f"{name}, up to {speed}", errors)
            errors = errors_percent(
                machine_with_tubes(damper), profile, WAYS_OF_TUBES, CONVERGED_TUBES_MS
            )
            text += table_of(f"{name} in telescopic dampers, up to {speed}", errors)
    text.append(f"default step: {1e3 * DEFAULT_STEP:g} ms")
    print(text[-1])
    if arguments.out:
        arguments.out.write_text("\n".join(text) + "\n")


def table_of(title: str, errors: pd.DataFrame) -> list[str]:
    """Print the errors of a machine [%] and return the lines; the first row is the default."""
    with_gasket = [case for case in errors.columns if "," not in case]
    worst = [errors.iloc[0][with_gasket].max(), errors.iloc[0].max()]
    lines = [
        f"{title}: largest error of any peak, %",
        errors.round(4).to_string(),
        f"default: {worst[0]:.3f} % with gasket (bound {BOUND_PERCENT[True]:g} %), "
        f"{worst[1]:.3f} % of all (bound {BOUND_PERCENT[False]:g} %)",
        "",
    ]
    print("\n".join(lines), flush=True)
    return lines


if __name__ == "__main__":
    main()
