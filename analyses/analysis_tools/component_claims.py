"""What [A] prints and says of its components (sections 2 and 3), beside its own models."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from analysis_tools.validation_page import NOT_COMPARABLE, listed, verdict
from wm_drake.parameters import MachineParameters, with_values
from wm_drake.parameters.types import FloatArray
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
COUNTS = (
    ("Table 2", "damper", "damper", 12),
    ("Table 4, each direction", "bushing", "bushing --axis x", 12),
    ("Table 5", "bushing about", "bushing --axis about_x", 8),
    ("Table 7, each direction", "gasket", "gasket --axis x", 9),
)
"""Table, key of its test matrix, part and axis, number of tests."""
ARITHMETIC = "numbers of the table"
PICTURES = "pictures", "no numbers", NOT_COMPARABLE, ""
NORMALISED = "normalised", "no measured loop is printed", NOT_COMPARABLE, ""
"""Cells of a statement that is printed as a picture, or in a unit that is not."""


def rig(part: str) -> str:
    """Return the command that runs a part, such as "gasket --axis x", through its tests."""
    return f"`wm-drake rig {part} --machine free_stroke --matrix A`"


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


def test_lines(machine: MachineParameters) -> list[list[str]]:
    """Return lines for section 2: tests and loops of the components."""
    return [
        *_count_lines(),
        *_damper_lines(machine),
        *_bushing_lines(machine),
        *_gasket_lines(machine),
        ["Figs. 5, 8, 9, 12: measured curves", *PICTURES],
    ]


def _count_lines() -> list[list[str]]:
    found = {key: len(MATRICES[key]["A"]) for _, key, _, _ in COUNTS}
    return [
        [f"{table}: tests", str(count), str(found[key]), verdict(found[key] == count), rig(part)]
        for table, key, part, count in COUNTS
    ]


def _damper_lines(machine: MachineParameters) -> list[list[str]]:
    """Return the lines of Fig. 5, whose points A, B, C and D are on a loop of 3 Hz and 10 mm."""
    loop = loop_of(machine, "damper", "", (3.0, 10.0))
    basic = getattr(machine.damper_types["free_stroke"], "basic_friction_force")  # noqa: B009
    force = np.roll(loop.force, 360)[:720]  # from one reversal to the other
    path = np.roll(loop.displacement, 360)[:720]
    free = np.abs(force) <= basic * (1.0 + 1e-9)
    stroke = np.ptp(path[free]) / MM
    last, peak = int(np.flatnonzero(free)[-1]), int(np.argmax(force))
    rises = np.all(np.diff(force[last : peak + 1]) > 0.0)
    peak_is_before = last < peak < len(force) - 1 and force[-1] < force[peak]
    rows = (
        (
            "from A to B the sponge is not deformed (3 Hz, 10 mm: stroke with basic friction "
            "alone)",
            "a free stroke",
            f"{stroke:.1f} mm",
            stroke > 1.0,
        ),
        (
            "from B to C the force rises",
            "rises",
            f"{force[last]:.1f} to {force[peak]:.1f} N",
            rises,
        ),
        (
            "the largest force is at C, before tension turns into compression at D (displacements "
            "there by the amplitude)",
            "C before D",
            f"{path[peak] / (10.0 * MM):.2f}, {path[-1] / (10.0 * MM):.2f}",
            peak_is_before,
        ),
    )
    return [
        [f"2.1, Fig. 5: {words}", printed, ours, verdict(holds), rig("damper")]
        for words, printed, ours, holds in rows
    ]


def _stiffness(
    machine: MachineParameters, part: str, axis: str, amplitudes: Sequence[float]
) -> FloatArray:
    """Return the dynamic stiffness of a component at 5 Hz and amplitudes (n,) [mm]. [N/m]"""
    loops = [loop_of(machine, part, axis, (5.0, amplitude)) for amplitude in amplitudes]
    return np.array([measures_of(loop).dynamic_stiffness for loop in loops])


def _bushing_lines(machine: MachineParameters) -> list[list[str]]:
    radial, axial = (_stiffness(machine, "bushing", axis, (0.1, 0.2, 0.4)) for axis in "xy")
    tilt = _stiffness(machine, "bushing", "about_x", (2.0, 4.0))
    rows = (
        (
            "8: the bushing stiffens axially (0.1, 0.2, 0.4 mm; f_yb is our assumption)",
            "stiffens",
            listed(axial, " N/mm", 1e-3),
            axial[-1] > axial[0],
            "y",
        ),
        (
            "8: it stiffens radially",
            "stiffens",
            listed(radial, " N/mm", 1e-3),
            radial[-1] > 1.01 * radial[0],
            "x",
        ),
        (
            "8: it is stiffer radially than axially (0.4 mm)",
            "stiffer",
            f"{radial[-1] / axial[-1]:.1f} times",
            radial[-1] > axial[-1],
            "x",
        ),
        (
            "9: it stiffens in tilt (2 and 4 mm at the arm)",
            "stiffens",
            listed(tilt, " N/mm", 1e-3),
            tilt[-1] > 1.01 * tilt[0],
            "about_x",
        ),
    )
    return [
        [f"2.2, Fig. {words}", printed, ours, verdict(holds), rig(f"bushing --axis {axis}")]
        for words, printed, ours, holds, axis in rows
    ]


def _gasket_lines(machine: MachineParameters) -> list[list[str]]:
    x, y, z = (_stiffness(machine, "gasket", axis, (5.0,))[0] for axis in "xyz")
    return [
        [
            "2.3, Fig. 12: the gasket is stiffer radially than axially (5 mm)",
            "stiffer",
            f"{x / y:.1f} times",
            verdict(x > y),
            rig("gasket --axis x"),
        ],
        [
            "2.2, 2.3: bushing and gasket are the same along x and z",
            "the same",
            f"differ by {abs(z / x - 1.0):.0e}",
            verdict(np.isclose(x, z)),
            rig("gasket --axis z"),
        ],
    ]


def largest_force(machine: MachineParameters, part: str, axis: str, key: str) -> float:
    """Return the largest force of a component in its tests. [N]"""
    tests = [(test.frequency, test.amplitude / MM) for test in MATRICES[key]["A"]]
    return max(float(np.abs(loop_of(machine, part, axis, test).force).max()) for test in tests)


def tenth_lines(machine: MachineParameters) -> list[list[str]]:
    """Return lines for the statements on a tenth of the largest force, in the unit of force of [A].

    The unit follows from one statement: 0.2 is a tenth of the largest radial force of the gasket.
    """
    radial = largest_force(machine, "gasket", "x", "gasket")
    unit = radial / (10.0 * 0.2)
    axial = float(np.abs(loop_of(machine, "bushing", "y", FIG_16).force).max())
    return [
        [
            f"3.3: 0.2 is a tenth of the largest radial force of the gasket, {radial:.1f} N",
            "normalised",
            f"the unit of force is {unit:.1f} N",
            NOT_COMPARABLE,
            rig("gasket --axis x"),
        ],
        [
            "3.2: 0.3 is a tenth of the largest force of the bushing, which is that for 0.8 mm "
            "axially (Fig. 16; f_yb is chosen so)",
            f"{3.0 * unit:.0f} N",
            f"{axial:.0f} N",
            verdict(abs(axial / (3.0 * unit) - 1.0) < 0.05),
            rig("bushing --axis y"),
        ],
        *_lines_of_tables(machine, unit, radial, axial),
    ]


def _lines_of_tables(
    machine: MachineParameters, unit: float, radial: float, axial: float
) -> list[list[str]]:
    """Return the lines of Tables 2, 4, 5 and 7, whose errors are in a unit of force. [N]"""
    other = with_values(
        machine,
        {
            f"bushing_types.connecting.{name}_{axis}": text
            for name, text in ARM_READING.items()
            for axis in "xz"
        },
    )
    tilt, tilt_of_other = (
        largest_force(of, "bushing", "about_x", "bushing about") for of in (machine, other)
    )
    shipped, reading = "bushing in tilt, as shipped", "other reading (misprints, A11)"
    rows = (
        ("2", "damper", "", "damper", largest_force(machine, "damper", "", "damper"), "damper"),
        ("4", "bushing", "radial", "bushing, radial", axial, "bushing --axis x"),
        (
            "4",
            "bushing",
            "axial",
            "bushing, axial, 0.8 mm as in Fig. 16",
            axial,
            "bushing --axis y",
        ),
        (
            "4",
            "bushing",
            "axial",
            "bushing, axial, 0.4 mm as in the table",
            largest_force(machine, "bushing", "y", "bushing"),
            "bushing --axis y",
        ),
        ("5", "bushing", "rotational", shipped, tilt, "bushing --axis about_x"),
        ("5", "bushing", "rotational", reading, tilt_of_other, "bushing --axis about_x"),
        ("7", "gasket", "radial", "gasket, radial", radial, "gasket --axis x"),
        (
            "7",
            "gasket",
            "axial",
            "gasket, axial",
            largest_force(machine, "gasket", "y", "gasket"),
            "gasket --axis y",
        ),
    )
    table = printed_table()
    rmse = {key: of.rmse.to_numpy() for key, of in table.groupby(["component", "axis"])}
    lines = []
    for number, part, axis, name, force, command in rows:
        errors, limit = rmse[part, axis], 0.1 * force / unit
        within = (part, axis) != ("gasket", "axial")
        holds = errors.max() <= limit if within else errors.min() > limit
        lines.append(
            [
                f"Table {number}: {name}: largest force {force:.3g} N",
                f"errors {'within' if within else 'above'} a tenth",
                f"a tenth is {limit:.3f}, errors {errors.min():.4f} to {errors.max():.4f}",
                verdict(holds),
                rig(command),
            ]
        )
    return lines


def _below(errors: pd.Series, limit: float) -> tuple[str, bool]:
    """Return the largest error in words, and whether it is below a limit."""
    return f"up to {errors.max():.4f}", bool(errors.max() < limit)


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
    rows = (
        (
            "3.1, Table 2: errors at 5 and 7 Hz are larger than at 1 and 3 Hz",
            "larger",
            f"at least {fast.min():.4f}, at most {slow.max():.4f}",
            fast.min() > slow.max(),
        ),
        ("3.2, Table 4: errors within 0.3", "0.3", *_below(bushing, 0.3)),
        (
            "3.3, Table 6: along y about a third of the stiffness and a fifth of the damping "
            "(within 15 %)",
            "0.33, 0.2",
            f"{ratios[0]:.3f}, {ratios[1]:.2f}",
            abs(3.0 * ratios[0] - 1.0) < 0.15 and abs(5.0 * ratios[1] - 1.0) < 0.15,
        ),
        ("3.3, Table 7: radial errors within 0.2", "0.2", *_below(radial, 0.2)),
        (
            "3.3, Table 7: axial errors exceed 0.08 (misprints, A17)",
            "above 0.08",
            f"{axial.min():.4f} to {axial.max():.4f}",
            axial.min() > 0.08,
        ),
    )
    return [
        *(
            [words, printed, ours, verdict(holds), ARITHMETIC]
            for words, printed, ours, holds in rows
        ),
        ["Tables 2, 4, 5, 7: errors of the models", *NORMALISED],
        ["Figs. 14, 16, 17, 19: loops of models and tests", *PICTURES],
    ]
