"""What does [B] print, table by table, and what do the shipped machines give?

The script runs the machines over the run-up of [B], and its gasket study with linear tables, and
renews docs/paper-b.md between its marks:

    python analyses/write_paper_b.py --page docs/paper-b.md

The amplitudes of `reference` are compared with half of the printed ones; the page says so.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
import xarray as xr
from analysis_tools import validation_page as page
from analysis_tools.claims import (
    FAILS,
    HOLDS,
    Amplitudes,
    change,
    claims,
    measured_claims,
    numbers,
)
from analysis_tools.gasket_study import LOADS, agreement, screening_of
from analysis_tools.ledgers import calibration_identity, kept_in

from wm_drake import Case, build_machine, load_machine, modes, simulate_many
from wm_drake.batch.ledger import open_ledger
from wm_drake.parameters import (
    MachineParameters,
    SpinProfile,
    measured_amplitudes,
    measured_changes,
    published_results,
)
from wm_drake.parameters.measured import EXPERIMENT
from wm_drake.parameters.vary_file import VaryFile
from wm_drake.report.quantity import quantity_of, shown
from wm_drake.studies.calibrate.study import SearchPlan, calibrate
from wm_drake.studies.calibrate.targets import targets_of
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.gasket.screening import at, labels_of, published_for, sign_differs

REFERENCE = "reference"
MACHINES = (REFERENCE,)
ADAMS_SOURCE = "Adams model of [B]"
DEVIATION = 0.1
FREE_DAMPING = {
    "linear": {
        "bounds": "(0, 0.05) N*s/mm",
        "prior": "(0.0095, 0.1) N*s/mm",
        "sets": {f"gasket.damping_{axis}": 1 for axis in "xyz"},
        "source": "[B] section 3.1.2: region of the search; the prior says nothing",
    },
    "torsional": {
        "bounds": "(0, 200) N*mm*s/deg",
        "prior": "(30, 400) N*mm*s/deg",
        "sets": {f"gasket.rotational_damping_{axis}": 1 for axis in "xyz"},
        "source": "as linear",
    },
}
"""Free quantities of the search of the damping."""
SPONGE = {"sponge", "sponge_stiffness"}
"""Fields of a damper law with a sponge: its curve or its stiffness."""


def amplitudes_of(machine: MachineParameters) -> Amplitudes:
    """Return the amplitudes of a machine in all cases of which some were measured. [mm]"""
    table = measured_amplitudes(machine)
    cases = list(dict.fromkeys(zip(table.load, table.gasket == "yes", strict=True)))
    runs = [Case(name, machine.loads[name], machine.profile, gasket) for name, gasket in cases]
    amplitude = 1e3 * simulate_many(build_machine(machine), runs).amplitude.values
    return {
        case: dict(zip(machine.sensors, map(float, values), strict=True))
        for case, values in zip(cases, amplitude, strict=True)
    }


def amplitude_lines(
    machines: dict[str, MachineParameters], computed: dict[str, Amplitudes]
) -> list[list[str]]:
    """Return a line for each printed amplitude: measured, Adams, and that of each machine."""
    keys = ["load", "gasket", "source"]
    tables = [measured_amplitudes(machine).set_index(keys) for machine in machines.values()]
    lines = []
    for load, gasket, source in tables[0].index:
        for sensor in machines[REFERENCE].sensors:
            cells = [f"{load}, {'with' if gasket == 'yes' else 'without'} gasket, {sensor}", source]
            for amplitudes, table in zip(computed.values(), tables, strict=True):
                theirs = table.loc[(load, gasket, source), sensor]
                ours = amplitudes[load, gasket == "yes"][sensor]
                cells += [f"{theirs:g}", f"{ours:.1f} ({100.0 * (ours / theirs - 1.0):+.0f} %)"]
            lines.append(cells)
    return lines


def change_lines(
    machines: dict[str, MachineParameters], computed: dict[str, Amplitudes]
) -> list[list[str]]:
    """Return the lines of the percentages of Table 1: change of each amplitude by the gasket."""
    table = measured_changes(machines[REFERENCE])
    printed = table[table.source == EXPERIMENT].set_index("load")
    lines = []
    for load in LOADS:
        for sensor in machines[REFERENCE].sensors:
            known = printed.loc[load, sensor]
            values = [change(amplitudes, load, sensor) for amplitudes in computed.values()]
            cells = [
                f"{value:+.0f} %" + (" **sign**" if value * known < 0.0 else "") for value in values
            ]
            lines.append([f"{load}, {sensor}", f"{known:+.1f} %", *cells])
    return lines


def sponge_line(machines: dict[str, MachineParameters]) -> list[str]:
    """Return the line on the sponge of the dampers: whether a machine's law has one."""
    cells = []
    for machine in machines.values():
        laws = {damper.law: damper for damper in machine.damper_types.values()}
        has_sponge = all(SPONGE & type(damper).model_fields.keys() for damper in laws.values())
        cells.append(f"{HOLDS if has_sponge else FAILS}: {', '.join(laws)}")
    words = "3: the model of the dampers considers the friction sponge"
    return [words, "nonlinear, from its reference 27", *cells]


def resonance_line(machine: MachineParameters) -> list[str]:
    """Return the range of speeds at which the unbalance meets a mode, friction sliding."""
    speeds = modes(build_machine(machine), LOADS[0]).critical_speeds * 30.0 / np.pi
    return [machine.name, f"{speeds.min():.0f} to {speeds.max():.0f} rpm"]


def study_lines(
    screenings: dict[str, xr.Dataset], published: xr.Dataset
) -> tuple[list[list[str]], list[list[str]]]:
    """Return the lines of Tables 4 and 5: what is printed, then that of each machine."""
    sums, terms = [], []
    for label in labels_of(published):
        what, known = ", ".join(label), at(published, label)
        ours = [at(screening, label) for screening in screenings.values()]
        for name, words in (("main", "main effects"), ("interaction", "interactions")):
            cells = [f"{float(shown(of[name])):.1f} %" for of in ours]
            sums.append([f"{what}: {words}", f"{float(shown(known[name])):g} %", *cells])
        unit = quantity_of(known["mean"]).unit.label
        cells = [f"{float(shown(of['mean'])):.3g} {unit}" for of in ours]
        terms.append([f"{what}: mean", f"{float(shown(known['mean'])):g} {unit}", *cells])
        if known.smallest.notnull():
            low, high = (float(shown(known[name])) for name in ("smallest", "largest"))
            cells = [
                f"{float(shown(of.smallest)):.1f} to {float(shown(of.largest)):.1f} {unit}"
                for of in ours
            ]
            terms.append([f"{what}: range", f"{low:g} to {high:g} {unit}", *cells])
        terms += term_lines(what, known, ours)
    return sums, terms


def term_lines(what: str, known: xr.Dataset, ours: list[xr.Dataset]) -> list[list[str]]:
    """Return the lines of the terms of a response: contributions and effects."""
    lines = []
    for term in known.term.values[known.share.notnull().values].tolist():
        cells = [f"{float(shown(of.share.sel(term=term))):.0f} %" for of in ours]
        printed = f"{float(shown(known.share.sel(term=term))):g} %"
        lines.append([f"{what}: {term}", printed, *cells])
        effect, *others = (data.effect.sel(term=term, other_level="") for data in (known, *ours))
        for level in (-1, 0) if effect.notnull().all() else ():
            cells = [
                f"{float(shown(other.sel(level=level))):.2g}"
                + (" **sign**" if level < 0 and sign_differs(of, known).sel(term=term) else "")
                for other, of in zip(others, ours, strict=True)
            ]
            lines.append(
                [f"effect at {level}", f"{float(shown(effect.sel(level=level))):.3g}", *cells]
            )
    return lines


def summary(name: str, screening: xr.Dataset, published: xr.Dataset) -> list[str]:
    """Return the numbers that sum up a machine."""
    found = agreement(screening, published)
    return [
        name,
        f"{found.leaders} of {found.responses}",
        f"{found.points.mean():.1f} / {found.points.max():.0f}",
        f"{found.means.mean():.1f} / {found.means.max():.0f}",
        str(found.other_signs),
    ]


def damping_line(machine: MachineParameters, is_quick: bool) -> list[str]:
    """Return the gasket damping that fits the amplitudes of the Adams model best, all else fixed.

    The search starts at half of the printed values. The standard deviations stand for a model that
    misses amplitudes by their root mean square logarithm at the optimum.
    """
    table = measured_amplitudes(machine)
    rows = table[(table.gasket == "yes") & (table.source == ADAMS_SOURCE)]
    targets = targets_of(machine, rows.assign(source=EXPERIMENT))
    free = VaryFile.model_validate({"vary": FREE_DAMPING})
    built = build_machine(machine)
    plan = SearchPlan(
        starts=1, iterations=1 if is_quick else 0, deviation=DEVIATION, resolution=0.0
    )
    with tempfile.TemporaryDirectory() as folder:
        ledger_path = Path(folder) / "ledger.sqlite"
        with open_ledger(ledger_path, calibration_identity(built, free, targets, plan)) as ledger:
            found = calibrate(Experiment(built, (), kept_in(ledger)), free, targets, plan)
    best, known = found.solutions[0], found.parameter_map
    misses = float(np.sqrt(np.nanmean(np.log1p(best.errors) ** 2)))
    spread = np.sqrt(np.diag(best.fit.linear.covariance(misses / DEVIATION)))
    spread = known.in_units(spread * known.deviation)
    units = (unknown.unit.shown for unknown in known.unknowns)
    values = zip(known.in_units(best.point), spread, units, strict=True)
    cells = [
        f"{value:.3g} ± {float(f'{deviation:.1g}'):g} {unit}" for value, deviation, unit in values
    ]
    return [machine.name, *cells, f"{100.0 * misses:.0f} %"]


def study_text(machines: dict[str, MachineParameters], trials: int) -> tuple[str, str]:
    """Return the summary of the gasket studies, and Tables 4 and 5 with section 4."""
    screenings = {name: screening_of(machine, trials) for name, machine in machines.items()}
    first = screenings[MACHINES[0]]
    published = published_for(published_results(machines[MACHINES[0]].published), first)
    of_each = [summary(name, s, published) for name, s in screenings.items()]
    curved = screening_of(machines[REFERENCE], trials, "scaled")
    of_each.append(summary(f"{REFERENCE}, its stiffening curves scaled", curved, published))
    heads = [
        "machine",
        "same leading factor",
        "contributions: mean / largest difference, points",
        "means: mean / largest difference, %",
        "effects with another sign",
    ]
    sums, terms = study_lines(screenings, published)
    said = [[words, *cells] for words, cells in claims(screenings)]
    heads_of_both = ["", "printed", *MACHINES]
    text = page.table_text("Table 4: variance explained", heads_of_both, sums)
    contributions = "Table 5 and Fig. 10: means, ranges, contributions"
    text += page.table_text(contributions, heads_of_both, terms)
    text += page.table_text("Section 4 in words", ["", *MACHINES], said)
    text += page.table_text("Section 4 in numbers", heads_of_both, numbers(screenings, published))
    return page.table_text("Summary", heads, of_each), text


def amplitude_text(machines: dict[str, MachineParameters], is_quick: bool) -> str:
    """Return Tables 1 to 3, resonances, and the damping that the amplitudes give."""
    pairs = [text for name in MACHINES for text in (f"{name}: printed, mm", "ours, mm")]
    computed = {name: amplitudes_of(machine) for name, machine in machines.items()}
    text = page.table_text(
        "Tables 1 to 3: amplitudes", ["", "source", *pairs], amplitude_lines(machines, computed)
    )
    text += page.table_text(
        "Table 1: change of the amplitude by the gasket",
        ["", "printed", *MACHINES],
        change_lines(machines, computed),
    )
    text += page.table_text(
        "Sections 2.2 to 3.2 in words",
        ["", "printed", *MACHINES],
        [*measured_claims(computed), sponge_line(machines)],
    )
    text += page.table_text(
        "Section 2.2: resonances, printed 100 to 300 rpm",
        ["machine", "unbalance meets a mode at"],
        [resonance_line(machine) for machine in machines.values()],
    )
    return text + page.table_text(
        "Section 3.1.2: damping from the amplitudes alone",
        ["machine", "C_L (printed 0.019)", "C_T (printed 60)", "RMS difference of the amplitudes"],
        [damping_line(machine, is_quick) for machine in machines.values()],
    )


def main() -> None:
    """Run the machines and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="150 trials, runs of 2 s")
    parser.add_argument("--page", type=Path, help="page to renew between its marks")
    parser.add_argument("--out", type=Path, help="also write the text to this file")
    arguments = parser.parse_args()
    trials = 150 if arguments.quick else 243
    machines = {name: load_machine(name) for name in MACHINES}
    if arguments.quick:
        begin = SpinProfile(time=(0.0, 2.0), speed=(0.0, 15.0))
        machines = {name: m.model_copy(update={"profile": begin}) for name, m in machines.items()}
    short, study = study_text(machines, trials)
    origin = page.origin(
        "python analyses/write_paper_b.py --page docs/paper-b.md",
        [
            f"Tables 4 and 5: `wm-drake study gasket --design orthogonal --trials {trials} "
            "--tables linear`, as in [B], where nothing else is said."
        ],
    )
    text = origin + short + amplitude_text(machines, arguments.quick) + study
    print(text)
    page.write(text, arguments.out, arguments.page)


if __name__ == "__main__":
    main()
