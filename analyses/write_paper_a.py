"""What does [A] print, statement by statement, and what do its own models give?

The script runs the components of [A] through its test matrices, checks the arithmetic of its
tables, and compares the spin cycle of the machine `free_stroke` with its sentences. Its three
causes of error are compared by compare_error_causes.py. It renews docs/paper-a.md between its
marks:

    python analyses/write_paper_a.py --page docs/paper-a.md

[A] prints no measured curve and no displacement as numbers.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr
from analysis_tools import validation_page as page
from analysis_tools.component_claims import ARITHMETIC, model_lines, tenth_lines, test_lines
from analysis_tools.ledgers import spin_cycle_runs
from analysis_tools.validation_page import NOT_COMPARABLE, listed, verdict
from analysis_tools.validation_rows import spin_cycle_rows

from wm_drake import build_machine, load_machine, load_profile
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.unbalance_cases import UnbalanceCase, load_unbalance_cases
from wm_drake.studies.spin_cycle.study import (
    run_spin_cycle,
)

CASES = ("2", "5", "11", "20", "29")
"""Cases of a quick run: one at least of each group of Table 9."""
CYCLE = "`wm-drake study spin-cycle`"
HEADS = ["", "[A]", "ours", "verdict", "command"]
GROUPS: dict[str, Callable[[UnbalanceCase], bool]] = {
    "one mass": lambda case: not (case.front and case.rear),
    "two, 0 deg": lambda case: bool(case.front and case.rear) and case.phase == 0.0,
    "two, 90 deg": lambda case: abs(case.phase - np.pi / 2.0) < 1e-6,
    "two, 180 deg": lambda case: abs(case.phase - np.pi) < 1e-6,
}
"""Groups of cases of Table 9, as section 4.2 has them."""


def table_9_lines(cases: list[UnbalanceCase]) -> list[list[str]]:
    """Return lines for Table 9: the arithmetic of its errors."""
    errors = np.array([case.published_error_percent for case in cases], dtype=float)
    of_group = {
        name: errors[[belongs(case) for case in cases]].mean() for name, belongs in GROUPS.items()
    }
    near, far = list(of_group.values())[:2], list(of_group.values())[2:]
    single = sum(map(GROUPS["one mass"], cases))
    return [
        [
            "4.1: cases with one mass and with two",
            "6 and 27",
            f"{single} and {len(cases) - single}",
            verdict(single == 6 and len(cases) == 33),
            CYCLE,
        ],
        [
            "Table 9: mean of the errors",
            "20.11 %",
            f"{errors.mean():.2f} %",
            verdict(abs(errors.mean() - 20.11) < 0.01),
            ARITHMETIC,
        ],
        [
            "Table 9: their standard deviation (of a sample; of a population)",
            "4.10 %",
            f"{errors.std(ddof=1):.2f}; {errors.std():.2f} %",
            verdict(min(abs(errors.std(ddof=1) - 4.1), abs(errors.std() - 4.1)) < 0.01),
            ARITHMETIC,
        ],
        [
            "4.2: one mass and 0 deg have smaller errors than 90 and 180 deg",
            "smaller",
            listed(list(of_group.values()), " %"),
            verdict(max(near) < min(far)),
            ARITHMETIC,
        ],
    ]


def cycle_lines(size: xr.DataArray) -> list[list[str]]:
    """Return lines for section 4.2: what it says in words of cases 2, 5 and 29."""
    words = {"met": verdict(True), "missed": verdict(False)}
    return [
        [
            f"4.2: {row.quantity}",
            row.published,
            row.ours or "",
            words.get(row.verdict.strip("*"), NOT_COMPARABLE),
            f"{CYCLE[:-1]} --case 2 --case 5 --case 29`",
        ]
        for row in spin_cycle_rows(size)
    ]


def displacements(
    machine: MachineParameters, cases: list[UnbalanceCase], profile: SpinProfile
) -> xr.DataArray:
    """Return the RMS displacements of a machine in a spin cycle."""
    return run_spin_cycle(machine, cases, profile, spin_cycle_runs(build_machine(machine))).rms


def main() -> None:
    """Run benches and spin cycles and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="five cases")
    parser.add_argument("--page", type=Path, help="page to renew between its marks")
    parser.add_argument("--out", type=Path, help="also write the text to this file")
    arguments = parser.parse_args()
    machine, every = load_machine("free_stroke"), load_unbalance_cases()
    cases = [case for case in every if case.name in CASES or not arguments.quick]
    cycle = load_profile("spin_cycle")
    perfect = displacements(machine, cases, cycle)
    text = page.origin("python analyses/write_paper_a.py --page docs/paper-a.md", [])
    text += page.table_text("Component tests: section 2", HEADS, test_lines(machine))
    text += page.table_text("Errors of the models: section 3", HEADS, model_lines())
    text += page.table_text("A tenth of the largest force: section 3", HEADS, tenth_lines(machine))
    text += page.table_text("Table 9", HEADS, table_9_lines(every))
    text += page.table_text("Spin cycle in words: section 4.2", HEADS, cycle_lines(perfect))
    print(text)
    page.write(text, arguments.out, arguments.page)


if __name__ == "__main__":
    main()
