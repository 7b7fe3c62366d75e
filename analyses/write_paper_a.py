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
from analysis_tools.validation_page import NOT_COMPARABLE, listed, verdict
from analysis_tools.validation_rows import spin_cycle_rows

from wm_drake import build_machine, load_machine, load_profile
from wm_drake.parameters import MachineParameters, SpinProfile, with_values
from wm_drake.parameters.unbalance_cases import UnbalanceCase, load_unbalance_cases
from wm_drake.rigs import (
    JIG_ARM,
    MATRICES,
    ForceLoop,
    Harmonic,
    bushing_bench,
    damper_bench,
    force_loops,
    measures_of,
)
from wm_drake.studies.rig.study import printed_table
from wm_drake.studies.spin_cycle.study import (
    compiled_runs,
    run_spin_cycle,
)

MM = 1e-3
FIG_16 = 5.0, 0.8
"""Largest axial motion of the bushing: frequency [Hz] and amplitude [mm], [A] Fig. 16."""
ARM_READING = {
    "rotational_stiffness": "75 N m/rad",
    "rotational_damping": "0.005 N m s/rad",
    "friction_torque": "8 N m",
    "full_friction_rate": "0.02 rad/s",
}
"""The other reading of the tilt numbers of [A] Table 3 (docs/misprints.md, A11)."""
CASES = ("2", "5", "11", "20", "29")
"""Cases of a quick run: one at least of each group of Table 9."""
RIG = "`wm-drake rig {} --machine free_stroke --matrix A`"
CYCLE = "`wm-drake study spin-cycle`"
SCRIPT, ARITHMETIC = "this script", "numbers of the table"
HEADS = ["", "[A]", "ours", "verdict", "command"]
GROUPS: dict[str, Callable[[UnbalanceCase], bool]] = {
    "one mass": lambda case: not (case.front and case.rear),
    "two, 0 deg": lambda case: bool(case.front and case.rear) and case.phase == 0.0,
    "two, 90 deg": lambda case: abs(case.phase - np.pi / 2.0) < 1e-6,
    "two, 180 deg": lambda case: abs(case.phase - np.pi) < 1e-6,
}
"""Groups of cases of Table 9, as section 4.2 has them."""


def loop_of(
    machine: MachineParameters, part: str, axis: str, test: tuple[float, float]
) -> ForceLoop:
    """Return the loop of a component in one test: frequency [Hz] and amplitude [mm]."""
    motion = Harmonic(test[0], test[1] * MM)
    if part == "damper":
        return force_loops(damper_bench(machine.damper_types["free_stroke"]), [motion])[0]
    bushing = machine.gasket if part == "gasket" else machine.bushing_types["connecting"]
    assert bushing is not None
    arm = JIG_ARM if axis.startswith("about") else 0.0
    return force_loops(bushing_bench(bushing, axis, arm), [motion])[0]


def stiffness_of(machine: MachineParameters, part: str, axis: str, amplitude: float) -> float:
    """Return the dynamic stiffness of a component at 5 Hz and an amplitude [mm]. [N/m]"""
    return measures_of(loop_of(machine, part, axis, (5.0, amplitude))).dynamic_stiffness


def test_lines(machine: MachineParameters) -> list[list[str]]:
    """Return lines for section 2: tests and loops of the components."""
    loop = loop_of(machine, "damper", "", (3.0, 10.0))
    basic = getattr(machine.damper_types["free_stroke"], "basic_friction_force")  # noqa: B009
    rising = np.roll(loop.force, 360)[:720]  # from one reversal to the other
    path = np.roll(loop.displacement, 360)[:720]
    free = np.abs(rising) <= basic * (1.0 + 1e-9)
    stroke = np.ptp(path[free]) / MM
    last = int(np.flatnonzero(free)[-1])
    peak = int(np.argmax(rising))
    lines = [
        [
            f"{name}: tests",
            str(count),
            str(len(MATRICES[key]["A"])),
            verdict(len(MATRICES[key]["A"]) == count),
            RIG.format(part),
        ]
        for name, key, part, count in (
            ("Table 2", "damper", "damper", 12),
            ("Table 4, each direction", "bushing", "bushing --axis x", 12),
            ("Table 5", "bushing about", "bushing --axis about_x", 8),
            ("Table 7, each direction", "gasket", "gasket --axis x", 9),
        )
    ]
    lines += [
        [
            "2.1, Fig. 5: from A to B the sponge is not deformed (3 Hz, 10 mm: stroke with basic "
            "friction alone)",
            "a free stroke",
            f"{stroke:.1f} mm",
            verdict(stroke > 1.0),
            RIG.format("damper"),
        ],
        [
            "2.1, Fig. 5: from B to C the force rises",
            "rises",
            f"{rising[last]:.1f} to {rising[peak]:.1f} N",
            verdict(np.all(np.diff(rising[last : peak + 1]) > 0.0)),
            RIG.format("damper"),
        ],
        [
            "2.1, Fig. 5: the largest force is at C, before tension turns into compression at D "
            "(displacements there by the amplitude)",
            "C before D",
            f"{path[peak] / (10.0 * MM):.2f}, {path[-1] / (10.0 * MM):.2f}",
            verdict(last < peak < len(rising) - 1 and rising[-1] < rising[peak]),
            RIG.format("damper"),
        ],
    ]
    radial, axial = (
        [stiffness_of(machine, "bushing", axis, a) for a in (0.1, 0.2, 0.4)] for axis in "xy"
    )
    gasket = [stiffness_of(machine, "gasket", axis, 5.0) for axis in "xyz"]
    tilt = [stiffness_of(machine, "bushing", "about_x", a) for a in (2.0, 4.0)]
    return [
        *lines,
        [
            "2.2, Fig. 8: the bushing stiffens axially (0.1, 0.2, 0.4 mm; f_yb is our assumption)",
            "stiffens",
            listed(axial, " N/mm", 1e-3),
            verdict(axial[-1] > axial[0]),
            RIG.format("bushing --axis y"),
        ],
        [
            "2.2, Fig. 8: it stiffens radially",
            "stiffens",
            listed(radial, " N/mm", 1e-3),
            verdict(radial[-1] > 1.01 * radial[0]),
            RIG.format("bushing --axis x"),
        ],
        [
            "2.2, Fig. 8: it is stiffer radially than axially (0.4 mm)",
            "stiffer",
            f"{radial[-1] / axial[-1]:.1f} times",
            verdict(radial[-1] > axial[-1]),
            RIG.format("bushing --axis x"),
        ],
        [
            "2.2, Fig. 9: it stiffens in tilt (2 and 4 mm at the arm)",
            "stiffens",
            listed(tilt, " N/mm", 1e-3),
            verdict(tilt[-1] > 1.01 * tilt[0]),
            RIG.format("bushing --axis about_x"),
        ],
        [
            "2.3, Fig. 12: the gasket is stiffer radially than axially (5 mm)",
            "stiffer",
            f"{gasket[0] / gasket[1]:.1f} times",
            verdict(gasket[0] > gasket[1]),
            RIG.format("gasket --axis x"),
        ],
        [
            "2.2, 2.3: bushing and gasket are the same along x and z",
            "the same",
            f"differ by {abs(gasket[2] / gasket[0] - 1.0):.0e}",
            verdict(np.isclose(gasket[0], gasket[2])),
            RIG.format("gasket --axis z"),
        ],
        ["Figs. 5, 8, 9, 12: measured curves", "pictures", "no numbers", NOT_COMPARABLE, ""],
    ]


def largest_force(machine: MachineParameters, part: str, axis: str, key: str) -> float:
    """Return the largest force of a component in its tests. [N]"""
    tests = [(test.frequency, test.amplitude / MM) for test in MATRICES[key]["A"]]
    return max(float(np.abs(loop_of(machine, part, axis, test).force).max()) for test in tests)


def tenth_lines(machine: MachineParameters) -> list[list[str]]:
    """Return lines for the statements on a tenth of the largest force, in the unit of force of [A].

    The unit follows from one statement: 0.2 is a tenth of the largest radial force of the gasket.
    """
    table = printed_table()
    rmse = {key: rows.rmse.to_numpy() for key, rows in table.groupby(["component", "axis"])}
    radial = largest_force(machine, "gasket", "x", "gasket")
    unit = radial / (10.0 * 0.2)
    keys = {
        f"bushing_types.connecting.{name}_{a}": text
        for name, text in ARM_READING.items()
        for a in "xz"
    }
    other = with_values(machine, keys)
    at_arm = [largest_force(of, "bushing", "about_x", "bushing about") for of in (machine, other)]
    axial = float(np.abs(loop_of(machine, "bushing", "y", FIG_16).force).max())
    statements = (
        (
            "Table 2: damper",
            rmse["damper", ""],
            largest_force(machine, "damper", "", "damper"),
            True,
            "damper",
        ),
        ("Table 4: bushing, radial", rmse["bushing", "radial"], axial, True, "bushing --axis x"),
        ("Table 4: bushing, axial", rmse["bushing", "axial"], axial, True, "bushing --axis y"),
        (
            "Table 5: bushing in tilt, as shipped",
            rmse["bushing", "rotational"],
            at_arm[0],
            True,
            "bushing --axis about_x",
        ),
        (
            "Table 5: other reading (misprints, A11)",
            rmse["bushing", "rotational"],
            at_arm[1],
            True,
            "bushing --axis about_x",
        ),
        ("Table 7: gasket, radial", rmse["gasket", "radial"], radial, True, "gasket --axis x"),
        (
            "Table 7: gasket, axial",
            rmse["gasket", "axial"],
            largest_force(machine, "gasket", "y", "gasket"),
            False,
            "gasket --axis y",
        ),
    )
    lines = []
    for name, errors, force, within, command in statements:
        limit = 0.1 * force / unit
        holds = errors.max() <= limit if within else errors.min() > limit
        lines.append(
            [
                f"{name}: largest force {force:.3g} N",
                f"errors {'within' if within else 'above'} a tenth",
                f"a tenth is {limit:.3f}, errors {errors.min():.4f} to {errors.max():.4f}",
                verdict(holds),
                RIG.format(command),
            ]
        )
    return [
        [
            f"3.3: 0.2 is a tenth of the largest radial force of the gasket, {radial:.1f} N",
            "normalised",
            f"the unit of force is {unit:.1f} N",
            NOT_COMPARABLE,
            RIG.format("gasket --axis x"),
        ],
        [
            "3.2: 0.3 is a tenth of the largest force of the bushing, which is that for 0.8 mm "
            "axially (Fig. 16; f_yb is chosen so)",
            f"{3.0 * unit:.0f} N",
            f"{axial:.0f} N",
            verdict(abs(axial / (3.0 * unit) - 1.0) < 0.05),
            RIG.format("bushing --axis y"),
        ],
        *lines,
    ]


def model_lines() -> list[list[str]]:
    """Return lines for section 3: what the text says of the errors in its tables."""
    table = printed_table()
    rmse = dict(list(table.groupby(["component", "axis"])))
    damper = rmse["damper", ""]
    slow, fast = (
        damper.rmse[damper.frequency_hz.isin(rates)].to_numpy() for rates in ((1, 3), (5, 7))
    )
    bushing = table.rmse[(table.component == "bushing") & (table.axis != "rotational")]
    radial, axial = (rmse["gasket", axis].rmse for axis in ("radial", "axial"))
    ratios = 3.0 / 8.0, 0.01 / 0.05
    return [
        [
            "3.1, Table 2: errors at 5 and 7 Hz are larger than at 1 and 3 Hz",
            "larger",
            f"at least {fast.min():.4f}, at most {slow.max():.4f}",
            verdict(fast.min() > slow.max()),
            ARITHMETIC,
        ],
        [
            "3.2, Table 4: errors within 0.3",
            "0.3",
            f"up to {bushing.max():.4f}",
            verdict(bushing.max() < 0.3),
            ARITHMETIC,
        ],
        [
            "3.3, Table 6: along y about a third of the stiffness and a fifth of the damping "
            "(within 15 %)",
            "0.33, 0.2",
            f"{ratios[0]:.3f}, {ratios[1]:.2f}",
            verdict(abs(3.0 * ratios[0] - 1.0) < 0.15 and abs(5.0 * ratios[1] - 1.0) < 0.15),
            ARITHMETIC,
        ],
        [
            "3.3, Table 7: radial errors within 0.2",
            "0.2",
            f"up to {radial.max():.4f}",
            verdict(radial.max() < 0.2),
            ARITHMETIC,
        ],
        [
            "3.3, Table 7: axial errors exceed 0.08 (misprints, A17)",
            "above 0.08",
            f"{axial.min():.4f} to {axial.max():.4f}",
            verdict(axial.min() > 0.08),
            ARITHMETIC,
        ],
        [
            "Tables 2, 4, 5, 7: errors of the models",
            "normalised",
            "no measured loop is printed",
            NOT_COMPARABLE,
            "",
        ],
        [
            "Figs. 14, 16, 17, 19: loops of models and tests",
            "pictures",
            "no numbers",
            NOT_COMPARABLE,
            "",
        ],
    ]


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
    return run_spin_cycle(machine, cases, profile, compiled_runs(build_machine(machine))).rms


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
