"""How large are the three causes that [A] names for the errors of its model?

[A] section 4.2 explains why the errors of its Table 9 are larger for two masses at 90 and 180
degrees: whirl of the drum in its bearing, residual imbalance of the drum, and an error of the phase
of the masses (at 0 degrees their phase "is straightforward"). Each is put into the machine
`free_stroke` in three sizes, and all three together. The machine with the cause stands for the
experiment, the one without for the model, and the error is that of Table 9. At last, a common error
of all groups, as large as that of [A] for one mass and at 0 degrees, is put in quadrature with an
error of the phase. Spin cycles are kept in a ledger; a second call goes on. The script renews
docs/error-causes.md between its marks:

    python analyses/compare_error_causes.py --page docs/error-causes.md
"""

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from analysis_tools import validation_page as page
from analysis_tools.error_causes import ASKED_FOR, CAUSES, with_cause, without_phase_error
from analysis_tools.spin_profiles import begin_of
from write_paper_a import CASES, GROUPS

from wm_drake import build_machine, load_machine, load_profile
from wm_drake.batch import simulate_many, sources_version
from wm_drake.batch.ledger import Ledger, LedgerEntry, key_of, open_ledger
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.unbalance_cases import UnbalanceCase, load_unbalance_cases
from wm_drake.studies.spin_cycle.study import DIMS, average_errors, labels_of, runs_of

AT_AN_ANGLE = ("two, 90 deg", "two, 180 deg")
"""Groups of cases that have an error of the phase."""


def main() -> None:
    """Run the spin cycles and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="five cases, before 10 s")
    parser.add_argument("--few", action="store_true", help="five cases, one of each group at least")
    parser.add_argument("--only", default="", metavar="WORDS", help="causes with these words")
    parser.add_argument("--skip", metavar="WORDS", help="no causes with these words")
    parser.add_argument("--ledger", type=Path, default=Path("compare_error_causes.sqlite"))
    parser.add_argument("--page", type=Path, help="page to renew between its marks")
    parser.add_argument("--out", type=Path, help="also write the text to this file")
    arguments = parser.parse_args()
    few = arguments.quick or arguments.few
    machine, profile = load_machine("free_stroke"), load_profile("spin_cycle")
    cases = [c for c in load_unbalance_cases() if c.name in CASES or not few]
    profile = begin_of(profile) if arguments.quick else profile
    identity = {"study": "causes of error", "sources": sources_version()}
    with open_ledger(arguments.ledger, identity, resume=True) as ledger:
        found = partial(_displacement, ledger, cases=cases, profile=profile)
        perfect = found(machine)

        def error_of(imperfections: dict[str, Any]) -> xr.DataArray:
            return 100.0 * average_errors(perfect, found(with_cause(machine, imperfections)))

        causes = [name for name in CAUSES if arguments.only in name]
        causes = [name for name in causes if not arguments.skip or arguments.skip not in name]
        errors = {name: _errors(CAUSES[name], error_of, cases) for name in causes}
    published = _published(cases)
    common = float(np.mean([published[name] for name in GROUPS if name not in AT_AN_ANGLE]))
    for size in [size for size in ASKED_FOR if f"phase error, {size}" in causes]:
        errors[f"a common error of {common:.1f} % in quadrature with a phase error of {size}"] = {
            group: float(np.hypot(common, np.nan_to_num(error)))
            for group, error in errors[f"phase error, {size}"].items()
        }
    lines = [[name, *map(_percent, of_group.values())] for name, of_group in errors.items()]
    command = "python analyses/compare_error_causes.py --page docs/error-causes.md"
    command += f' --skip "{arguments.skip}"' if arguments.skip else ""
    text = page.origin(command, [])
    text += page.table_text(
        "Error of a model without the cause",
        ["cause, size", *GROUPS],
        [["**[A] Table 9: error of its model**", *map(_percent, published.values())], *lines],
    )
    print(text)
    page.write(text, arguments.out, arguments.page)


def _displacement(
    ledger: Ledger, machine: MachineParameters, cases: list[UnbalanceCase], profile: SpinProfile
) -> xr.DataArray:
    """Return the RMS displacements of a spin cycle, from the ledger if it has them."""
    imperfections = machine.imperfections
    key = key_of(imperfections=imperfections, cases=[c.name for c in cases], profile=profile)
    if key not in ledger:
        table = simulate_many(
            build_machine(machine), runs_of(machine, cases, profile), measures=("regions",)
        )
        ledger.put_all({key: LedgerEntry({"rms": table.region_displacement.values})})
        print(f"{len(ledger)} spin cycles", file=sys.stderr, flush=True)
    return xr.DataArray(ledger.get(key).values["rms"], labels_of(machine, cases, profile), DIMS)


def _published(cases: list[UnbalanceCase]) -> dict[str, float]:
    """Return the mean error of each group in [A] Table 9. [%]"""
    return {
        group: float(np.mean([case.published_error_percent for case in cases if belongs(case)]))
        for group, belongs in GROUPS.items()
    }


def _errors(
    cause: dict[str, Any],
    error_of: Callable[[dict[str, Any]], xr.DataArray],
    cases: list[UnbalanceCase],
) -> dict[str, float]:
    """Return the mean error of each group; NaN without a cause. [%]

    An error of the phase acts in the groups at an angle only.
    """
    found = {}
    for group, belongs in GROUPS.items():
        causes = cause if group in AT_AN_ANGLE else without_phase_error(cause)
        names = [case.name for case in cases if belongs(case)]
        found[group] = float(error_of(causes).sel(case=names).mean()) if causes else np.nan
    return found


def _percent(error: float) -> str:
    return "none" if np.isnan(error) else f"{error:.1f} %"


if __name__ == "__main__":
    main()
