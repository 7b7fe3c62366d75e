"""Which damper law do the printed results of the Adams model of [B] choose?

The script fits the free quantities of reference_free.yaml to the targets of calibrate_reference.py,
once with each damper law, from the shipped machine on, by the same number of iterations. Friction
may fall to 5 N. It prints the cost and the errors of each law, and the friction that it finds. With
--out, the evaluations of each law are kept beside that file, and a second call goes on with them.

    python analyses/choose_damper_law.py --out laws.txt
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from analysis_tools import validation_page as page
from analysis_tools.goals import sizes_text
from analysis_tools.ledgers import calibration_identity, kept_in
from calibrate_reference import PLAN, REFERENCE, adams_targets

from wm_drake.batch.ledger import open_ledger
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, machine_path
from wm_drake.parameters.damper_laws import DAMPER_LAWS
from wm_drake.parameters.files import read_yaml, yaml_text
from wm_drake.parameters.vary_file import VaryFile
from wm_drake.report.progress import progress_bar
from wm_drake.studies.calibrate.solutions import Solution
from wm_drake.studies.calibrate.study import calibrate
from wm_drake.studies.experiment import Experiment

FREE = Path(__file__).with_name(f"{REFERENCE}_free.yaml")
KEY = "damper_types.friction"
ITERATIONS = 12
FRICTION = "(5, 90) N"
"""Bounds of the friction."""

VELOCITY = "full_friction_velocity"
OF_SPONGE = {
    "sponge_stiffness": {
        "bounds": "(5, 100) N/mm",
        "prior": "(30, 15) N/mm",
        "source": "[C] measured 176 N/mm on another damper, which is stiff against friction; here "
        "the frame and the bushings of the damper are part of it",
    },
    "sponge_damping": {
        "bounds": "(0.005, 0.3) N*s/mm",
        "prior": "(0.1, 0.04) N*s/mm",
        "source": "[C] 0.09 N s/mm",
    },
    "slider_damping": {
        "bounds": "(0.001, 0.3) N*s/mm",
        "prior": "(0.05, 0.04) N*s/mm",
        "source": "[C] 0.4 N s/mm on another damper; [B] counts dry friction only",
    },
}
"""Numbers of a sponge in series."""


OF_FREE_STROKE = {
    "friction_damping": {
        "bounds": "(0.001, 0.3) N*s/mm",
        "prior": "(0.06, 0.04) N*s/mm",
        "source": "[A] Table 1: 0.06 N s/mm",
    },
    "basic_friction_force": {
        "bounds": "(1, 60) N",
        "prior": "(10, 8) N",
        "source": "[A] Table 1: 10.5 N",
    },
}
"""Numbers of the free-stroke damper alone; its sponge is that of the machine `free_stroke`."""

NUMBERS: dict[str, tuple[str, ...]] = {
    "coulomb": (),
    "stv": ("transition_velocity",),
    "havsin": (VELOCITY,),
    "mstv": tuple(OF_SPONGE),
    "stv_sponge": ("transition_velocity", *OF_SPONGE),
    "free_stroke": (*OF_FREE_STROKE, "basic_full_friction_velocity"),
}
"""Free numbers of each law beside friction and dashpot."""

DASHPOT = {"coulomb", "stv", "havsin"}
"""Laws with a dashpot beside the friction."""


def machine_text(law: str) -> str:
    """Return a machine file that gives the reference machine dampers of another law."""
    numbers: dict[str, Any] = {"law": law, VELOCITY: None}
    numbers |= {name: prior_mean(quantity_of(name)["prior"]) for name in NUMBERS[law]}
    if law not in DASHPOT:
        numbers["damping"] = None
    if law == "free_stroke":
        types = read_yaml(machine_path("free_stroke"))["damper_types"]
        numbers["sponge"] = types["free_stroke"]["sponge"]
    return yaml_text(
        {"extends": REFERENCE, "name": f"reference_{law}", "damper_types": {"friction": numbers}}
    )


def prior_mean(prior: str) -> str:
    """Return the expected value of a prior such as ``(30, 15) N/mm``."""
    numbers, unit = prior[1:].split(")")
    return f"{numbers.split(',')[0]}{unit}"


def quantity_of(name: str) -> dict[str, Any]:
    """Return bounds, prior and source of a number of a damper."""
    known = {**OF_SPONGE, **OF_FREE_STROKE}
    entry = known.get(name) or read_yaml(FREE)["vary"][VELOCITY]
    return {key: entry[key] for key in ("bounds", "prior", "source")}


def free_tree_of(law: str) -> dict[str, Any]:
    """Return the vary file of the reference machine with the numbers of a law, as a tree."""
    tree: dict[str, Any] = read_yaml(FREE)
    quantities = tree["vary"]
    del quantities[VELOCITY]
    if law not in DASHPOT:
        del quantities["damper_damping"]
    quantities["damper_friction"]["bounds"] = FRICTION
    for name in NUMBERS[law]:
        quantities[name] = quantity_of(name) | {"sets": {f"{KEY}.{name}": 1}}
    return tree


def free_of(law: str) -> VaryFile:
    """Return the free quantities of the reference machine with the numbers of a law."""
    return VaryFile.model_validate(free_tree_of(law))


def row_of(law: str, best: Solution) -> dict[str, Any]:
    """Return what a fit with a law comes to."""
    targets = best.targets.responses
    errors = best.response_errors
    row: dict[str, Any] = {"law": law, "cost": round(best.cost)}
    row["amplitudes, %"] = sizes_text(best.errors)
    for kind, unit in (("means", "%"), ("effects", "%"), ("contributions", "points")):
        chosen = [target.kind_of_value == kind for target in targets]
        row[f"{kind}, {unit}"] = sizes_text(errors[chosen])
    names = best.parameter_map.names
    values = dict(zip(names, best.parameter_map.in_units(best.point), strict=True))
    row["friction, N"] = f"{values['damper_friction']:.1f}"
    others = [name for name in (*NUMBERS[law], "damper_damping") if name in values]
    row["others"] = ", ".join(f"{name} {values[name]:.3g}" for name in others)
    row["at bounds"] = best.verdicts().count("bound")
    return row


def main() -> None:
    """Fit with each law and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one law, three quantities, one step")
    parser.add_argument("--out", type=Path, help="also write the result to this file")
    arguments = parser.parse_args()
    laws = list(NUMBERS)[:1] if arguments.quick else list(DAMPER_LAWS)
    plan = replace(PLAN, iterations=1 if arguments.quick else ITERATIONS)
    rows = []
    with tempfile.TemporaryDirectory() as folder, progress_bar(len(laws), "laws") as done:
        for number, law in enumerate(laws, start=1):
            path = Path(folder) / f"{law}.yaml"
            path.write_text(machine_text(law), encoding="utf-8")
            machine, free = build_machine(load_machine(path)), free_of(law)
            targets = adams_targets(load_machine(REFERENCE))
            if arguments.quick:
                few = ("damper_friction", "damper_damping", "motor_mass")
                free = VaryFile(vary={name: free.vary[name] for name in few})
                targets = targets.without("middle", "back", "front")
            identity = calibration_identity(machine, free, targets, plan)
            kept = (arguments.out or path).with_name(f"{law}.sqlite")
            with open_ledger(kept, identity, resume=True) as ledger:
                experiment = Experiment(machine, (), kept_in(ledger))
                found = calibrate(experiment, free, targets, plan)
            rows.append(row_of(law, found.solutions[0]))
            done(number)
    rows.sort(key=lambda row: float(row["cost"]))
    lines = [[str(cell) for cell in row.values()] for row in rows]
    text = page.table_text("Damper laws", list(rows[0]), lines)
    print(text)
    page.write(text, arguments.out, None)


if __name__ == "__main__":
    main()
