"""What is verified, fitted, predicted and missed, beside the published numbers?

The script runs the shipped machines as they are: the machine `reference` over the run-up of [B]
(amplitudes, effect of the gasket, steady state, grand means of the gasket study with linear tables
as in [B]), the machine `free_stroke` over the spin cycle of [A], and Coulomb fits to loops of the
MSTV damper of [C]. It renews verification, validation and prediction on a page:

    python analyses/write_validation.py --page docs/validation.md --fitted-means

Explanations of results that are missed are in validation_reasons.yaml, the tests of the
verification in verification.yaml. Tables held out of the calibration take an hour:
`calibrate_reference.py --predict` wrote them. The script takes about two minutes; with --tests,
which runs the tests except those marked `hours`, three to five more.
"""

import argparse
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pandas as pd
from analysis_tools import validation_page as page
from analysis_tools import validation_rows as rows
from analysis_tools.coulomb_table import coulomb_fits, mstv_motions, mstv_of_c, printed_table
from analysis_tools.gasket_study import ORTHOGONAL, screening_of
from analysis_tools.ledgers import spin_cycle_runs
from ruamel.yaml import YAML

from wm_drake import Case, build_machine, load_machine, load_profile
from wm_drake.parameters import MachineParameters, published_results
from wm_drake.parameters.files import read_yaml
from wm_drake.parameters.unbalance_cases import load_unbalance_cases
from wm_drake.rigs import Harmonic
from wm_drake.studies.spin.comparison import differences_of
from wm_drake.studies.spin.study import run_spin
from wm_drake.studies.spin_cycle.study import run_spin_cycle

HERE = Path(__file__).parent
REASONS, VERIFICATION = HERE / "validation_reasons.yaml", HERE / "verification.yaml"
HELD_OUT, HELD_OUT_STUDY = (HERE / f"reference_held_out{end}.csv" for end in ("", "_study"))
QUICK = 150  # trials with --quick
SHOWN_BY_A = ("2", "5", "29")  # cases of [A] Table 9 that [A] describes


def coulomb(quick: bool) -> pd.DataFrame:
    """Return the Coulomb fits at the tests of [C] Table 2, for f_max of the shipped damper."""
    table = printed_table()
    if quick:
        table = table[table.frequency_hz.isin([1.0, 10.0]) & (table.amplitude_mm == 1.0)]
    damper = mstv_of_c()
    tests = [Harmonic(row.frequency_hz, 1e-3 * row.amplitude_mm) for row in table.itertuples()]
    motions = mstv_motions(damper, tests)
    return coulomb_fits(motions, damper.friction_force, damper.slider_damping)


def compared(reference: MachineParameters, quick: bool, means_kind: str) -> list[rows.Row]:
    """Return a row for each published number; with --quick, without the spin cycle."""
    cases = [Case(name, load, reference.profile) for name, load in reference.loads.items()]
    both = {
        name: run_spin(reference, [replace(case, gasket=gasket) for case in cases])
        for name, gasket in (("without", False), ("with", True))
    }
    amplitudes = pd.concat([rows.amplitude_table(runs) for runs in both.values()])
    table = rows.amplitude_rows(amplitudes)
    table += rows.held_out_table_rows(pd.read_csv(HELD_OUT), pd.read_csv(HELD_OUT_STUDY))
    table += rows.effect_rows(differences_of(both, dict.fromkeys(both, "without")))
    published = published_results(reference.published)
    screening = screening_of(reference, QUICK if quick else ORTHOGONAL)
    table += rows.mean_rows(screening, published, means_kind)
    if not quick:
        chosen = [case for case in load_unbalance_cases() if case.name in SHOWN_BY_A]
        free = load_machine("free_stroke")
        runs = spin_cycle_runs(build_machine(free))
        cycle = run_spin_cycle(free, chosen, load_profile("spin_cycle"), runs)
        table += rows.spin_cycle_rows(cycle.rms)
    return table + rows.coulomb_rows(coulomb(quick))


def run_tests(groups: dict[str, list[dict[str, Any]]]) -> dict[str, tuple[int, int]]:
    """Run the tests of the verification; return how many ran and failed, by their name."""
    names = [name for group in groups.values() for row in group for name in row.get("tests", ())]
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        subprocess.run(
            [
                sys.executable,
                "-m",
                "pytest",
                "-q",
                "-m",
                "not hours",
                f"--junitxml={report}",
                *names,
            ],
            cwd=HERE.parent,
            check=False,
            stdout=sys.stderr,
        )
        cases = list(ElementTree.parse(report).iter("testcase"))
    outcomes = {}
    for name in names:
        path, _, function = name.partition("::")
        module = path.removesuffix(".py").replace("/", ".")
        of_name = [
            case
            for case in cases
            if f"{case.get('classname')}.".startswith(f"{module}.")  # perhaps with a class behind
            and (not function or str(case.get("name")).split("[")[0] == function)
            and case.find("skipped") is None
        ]
        failed = sum(
            case.find("failure") is not None or case.find("error") is not None for case in of_name
        )
        outcomes[name] = len(of_name), failed
    return outcomes


def main() -> None:
    """Run the machines and write the pages."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="150 trials, no spin cycle, two loops")
    parser.add_argument("--tests", action="store_true", help="run the tests of the verification")
    parser.add_argument(
        "--fitted-means",
        action="store_true",
        help="the grand means of [B] Table 5 were targets of the calibration",
    )
    parser.add_argument("--page", type=Path, help="page to renew between its marks")
    parser.add_argument("--out", type=Path, help="also write the text to this file")
    arguments = parser.parse_args()
    reference = load_machine("reference")
    means_kind = rows.FITTED if arguments.fitted_means else rows.PREDICTED
    table = compared(reference, arguments.quick, means_kind)
    command = "python analyses/write_validation.py --page docs/validation.md"
    command += " --fitted-means" if arguments.fitted_means else ""
    command += " --tests" if arguments.tests else ""
    notes = [
        f"Machine `{reference.name}` ({reference.about}), machine `free_stroke`, component "
        "`mstv_damper`.",
        f"Gasket study: {QUICK if arguments.quick else ORTHOGONAL} trials, tables linear.",
    ]
    reasons = {str(key): str(text) for key, text in read_yaml(REASONS).items()}
    groups = YAML(typ="safe").load(VERIFICATION)
    text = page.origin(command, notes)
    text += page.verified(groups, run_tests(groups) if arguments.tests else {})
    text += page.compared(table, rows.FITTED, reasons)
    text += page.compared(table, rows.PREDICTED, reasons)
    print(text)
    page.write(text, arguments.out, arguments.page)


if __name__ == "__main__":
    main()
