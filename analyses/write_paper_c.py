"""What does [C] print, statement by statement, and what do its own models give?

The script runs the damper of [C] through its test matrix, fits the Coulomb model to each printed
test, and compares Coulomb, STV and MSTV on the seven cases of section 4.3. It renews
docs/paper-c.md between its marks:

    python analyses/write_paper_c.py --page docs/paper-c.md

[C] prints no measured curve as numbers. The loops of its MSTV model stand for them.
"""

import argparse
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from analysis_tools import validation_page as page
from analysis_tools.coulomb_table import coulomb_fits, mstv_motions, mstv_of_c, printed_table
from analysis_tools.validation_page import NOT_COMPARABLE, listed, verdict
from analysis_tools.validation_rows import coulomb_rows

from wm_drake.parameters.damper_laws import DamperNumbers, StvSpongeDamper
from wm_drake.parameters.types import FloatArray
from wm_drake.rigs import ForceLoop, Harmonic, damper_bench, force_loops, measures_of
from wm_drake.rigs.loops import steady_deformations
from wm_drake.rigs.run import MATRICES, slider_friction_curves

MM = 1e-3
STV = 0.1 * MM
"""Transition velocity of the STV model, [C] section 4.2. [m/s]"""
CASES = {
    "Fig. 13": (10.0, 1.0),
    "Fig. 15": (1.0, 0.3),
    "Fig. 16": (3.0, 0.3),
    "Fig. 17": (6.67, 0.3),
    "Fig. 18": (10.0, 0.3),
    "Fig. 19": (3.0, 1.0),
    "Fig. 20": (6.67, 1.0),
}
"""Frequency [Hz] and amplitude [mm] of each case of sections 4.2 and 4.3; misprint C4."""
TO_MIDDLE, TO_REVERSAL = (1, 3), (0, 2)
"""Quarters of a loop from a reversal to the middle, CD and AB, and the others, BC and DA."""
RIG = "`wm-drake rig damper --component mstv_damper --matrix C`"
SCRIPT = "this script"


def with_stv(velocity: float, **changes: float) -> StvSpongeDamper:
    """Return the damper of [C] with STV friction; Coulomb's at a velocity of 0. [m/s]"""
    shared = {
        name: getattr(mstv_of_c(), name)
        for name in StvSpongeDamper.model_fields
        if name in type(mstv_of_c()).model_fields and name != "law"
    }
    numbers = {**shared, "transition_velocity": velocity, **changes}
    return StvSpongeDamper(law="stv_sponge", **numbers)


def loops_of(damper: DamperNumbers, tests: list[tuple[float, float]]) -> list[ForceLoop]:
    """Return the loops of a damper in tests of given frequency [Hz] and amplitude [mm]."""
    return force_loops(damper_bench(damper), [Harmonic(f, a * MM) for f, a in tests])


def deviation(
    ours: ForceLoop, theirs: ForceLoop, quarters: tuple[int, ...] = (0, 1, 2, 3)
) -> float:
    """Return the RMS difference of two loops by the peak of the second, over some quarters.

    A loop begins at B of [C] Fig. 4, in the middle and upwards; its quarters 0 to 3 are BC, CD, DA
    and AB, each between a reversal (A, C) and the middle (B, D).
    """
    error = np.array_split(ours.force - theirs.force, 4)
    chosen = np.concatenate([error[quarter] for quarter in quarters])
    return float(np.sqrt(np.mean(chosen**2)) / np.max(np.abs(theirs.force)))


@dataclass(frozen=True)
class Runs:
    """Loops of the damper of [C] in its test matrix."""

    damper: DamperNumbers

    @cached_property
    def loops(self) -> dict[tuple[float, float], ForceLoop]:
        """Loop by frequency [Hz] and amplitude [mm]."""
        tests = [(m.frequency, round(m.amplitude / MM, 6)) for m in MATRICES["damper"]["C"]]
        return dict(zip(tests, loops_of(self.damper, tests), strict=True))

    def over_frequency(self, amplitude: float) -> list[ForceLoop]:
        """Return the loops of an amplitude [mm], by rising frequency."""
        return [loop for (_, a), loop in self.loops.items() if a == amplitude]

    def over_amplitude(self, frequency: float) -> list[ForceLoop]:
        """Return the loops of a frequency [Hz], by rising amplitude."""
        return [loop for (f, _), loop in self.loops.items() if f == frequency]

    def sponge_rates(self, amplitude: float) -> FloatArray:
        """Return Y' - X' over a period, at each frequency of the matrix (frequency, time). [m/s]"""
        bench = damper_bench(self.damper)
        omega = np.array([x.motion.angular_frequency for x in self.over_frequency(amplitude)])
        packed = np.tile(bench.packed, (len(omega), 1))
        states = steady_deformations(bench, packed, np.full(len(omega), amplitude * MM), omega)
        step = 2.0 * np.pi / (states.shape[1] - 1)
        return np.asarray(np.gradient(states, step, axis=1) * omega[:, None])


PICTURES = "pictures", "no numbers are printed", NOT_COMPARABLE, ""
"""Cells of a statement that is printed as a picture."""


def test_lines(runs: Runs) -> list[list[str]]:
    """Return lines for sections 2 and 4.1: tests, loops, friction."""
    return [
        ["Table 1: tests", "18", str(len(runs.loops)), verdict(len(runs.loops) == 18), RIG],
        *_loop_lines(runs),
        *_trend_lines(runs),
        ["Figs. 4 to 7: measured curves", *PICTURES],
    ]


def _loop_lines(runs: Runs) -> list[list[str]]:
    """Return the lines of section 2.3 on one loop, of 10 Hz and 1 mm."""
    shown = runs.loops[10.0, 1.0]
    rising = shown.force[1080:]  # from A, the lowest point, to B, the middle
    slider = np.abs(shown.velocity - runs.sponge_rates(1.0)[-1, :-1])
    at_c = float(slider[360] / slider.max())
    first, last = shown.force[360], shown.force[1080]
    return [
        [
            "2.3, Fig. 4: the force rises from A to B",
            "rises",
            f"{rising[0]:.1f} to {shown.force[0]:.1f} N",
            verdict(np.all(np.diff(rising) > 0.0)),
            RIG,
        ],
        [
            "2.3, Figs. 4, 5: hysteresis, the force at C and A is not that of a dashpot",
            "not zero",
            f"{first:.1f} and {last:.1f} N",
            verdict(first > 0.0 > last),
            RIG,
        ],
        [
            "2.3: at C the velocity of the sponge becomes zero (share of its largest, below 2 %)",
            "zero",
            f"{100.0 * at_c:.1f} %",
            verdict(at_c < 0.02),
            SCRIPT,
        ],
    ]


def _trend_lines(runs: Runs) -> list[list[str]]:
    """Return the lines of sections 2.3 and 4.1 on trends with amplitude and frequency."""
    energy = [
        np.array([measures_of(loop).energy_per_cycle for loop in runs.over_amplitude(f)])
        for f in (1.0, 3.0, 6.67, 10.0)
    ]
    measured = [measures_of(loop) for loop in runs.over_frequency(1.0)]
    held = slider_friction_curves(damper_bench(runs.damper), (MM, 5 * MM, 25 * MM), np.array([MM]))
    assert held is not None
    words = "the faster the deformation, the smaller the friction"
    trends: list[tuple[str, str, FloatArray, str, float, str]] = [
        (
            "2.3, Fig. 7: a higher frequency makes a stiffer loop (fundamental at 1 mm)",
            "stiffer",
            np.array([of.dynamic_stiffness for of in measured]),
            " N/mm",
            1e-3,
            RIG,
        ),
        (
            "4.1, Fig. 7: forces fall with frequency (peak at 1 mm; misprints, C11)",
            "fall",
            np.array([of.peak_force for of in measured]),
            " N",
            1.0,
            RIG,
        ),
        (
            "4.1: the sponge is deformed faster at a higher frequency (1 mm)",
            "faster",
            np.max(np.abs(runs.sponge_rates(1.0)), axis=1),
            " mm/s",
            1e3,
            SCRIPT,
        ),
        (
            f"4.1, Fig. 12: {words} (slider at 1 mm/s, deformation at 1, 5, 25 mm/s)",
            "smaller",
            np.abs(held[:, 0]),
            " N",
            1.0,
            RIG,
        ),
    ]
    smaller = verdict(all(np.all(np.diff(values) > 0.0) for values in energy))
    lines = [
        [
            "2.3, Fig. 6: a smaller amplitude makes a smaller loop (energy at 10 Hz)",
            "smaller",
            listed(energy[-1], " mJ", 1e3),
            smaller,
            RIG,
        ]
    ]
    for statement, printed, values, unit, factor, command in trends:
        falls = printed in ("fall", "smaller")
        holds = np.all(np.diff(-values if falls else values) > 0.0)
        lines.append([statement, printed, listed(values, unit, factor), verdict(holds), command])
    return lines


@dataclass(frozen=True)
class Models:
    """Loops of the other models in the cases of `CASES`, by test.

    Attributes:
        coulomb, stv: Coulomb and STV friction with the numbers of the damper.
        fitted: Coulomb friction with k1 and c1 of Table 2.
    """

    coulomb: dict[tuple[float, float], ForceLoop]
    stv: dict[tuple[float, float], ForceLoop]
    fitted: dict[tuple[float, float], ForceLoop]


def other_models() -> Models:
    """Return the loops of the other models."""
    tests = list(CASES.values())
    printed = {(row.frequency_hz, row.amplitude_mm): row for row in printed_table().itertuples()}
    stv, coulomb = (
        dict(zip(tests, loops_of(with_stv(velocity), tests), strict=True))
        for velocity in (STV, 0.0)
    )
    fitted = {}
    for test in tests:
        row = printed[test]
        numbers = with_stv(0.0, sponge_stiffness=row.k1 * 1e3, sponge_damping=row.c1 * 1e3)
        fitted[test] = loops_of(numbers, [test])[0]
    return Models(coulomb, stv, fitted)


def case_lines(runs: Runs, models: Models) -> list[list[str]]:
    """Return lines for the seven cases: deviations from the loops of [C]."""
    cases = []
    for figure, test in CASES.items():
        true, stv = runs.loops[test], models.stv[test]
        values = (
            deviation(models.coulomb[test], true),
            deviation(models.fitted[test], true),
            deviation(stv, true),
            deviation(stv, true, TO_MIDDLE),
            deviation(stv, true, TO_REVERSAL),
        )
        cases.append([f"{figure}: {test[0]:g} Hz, {test[1]:g} mm", *(f"{v:.3f}" for v in values)])
    return cases


def sentence_lines(runs: Runs, models: Models) -> list[list[str]]:
    """Return lines for the sentences of sections 3.3 to 4.3."""
    of_stv = {test: deviation(models.stv[test], runs.loops[test]) for test in models.stv}
    worst = max(deviation(models.fitted[test], runs.loops[test]) for test in models.fitted)
    near_coulomb = loops_of(with_stv(1e-3 * STV), list(models.coulomb))
    limit = max(map(deviation, near_coulomb, models.coulomb.values()))
    shown = models.stv[10.0, 1.0], runs.loops[10.0, 1.0]
    ratio = deviation(*shown, TO_MIDDLE) / deviation(*shown, TO_REVERSAL)
    pairs = [(of_stv[f, 0.3], of_stv[f, 1.0]) for f in (3.0, 6.67, 10.0)]
    rows = (
        (
            "3.3: the fitted Coulomb model (Table 2) has an error of more than 10 % in some case",
            "not accurate",
            f"up to {worst:.2f}",
            verdict(worst > 0.1),
        ),
        (
            "3.4: STV at a velocity of zero is Coulomb (0.0001 mm/s)",
            "the same",
            f"differs by {limit:.1e}",
            verdict(limit < 0.01),
        ),
        (
            "4.2, Fig. 13: the error of STV lies in AB and CD (that there by that in BC and DA)",
            "above 1",
            f"{ratio:.1f}",
            verdict(ratio > 1.0),
        ),
        (
            "4.3, Figs. 15 to 18: STV has a larger error than MSTV (STV beside MSTV)",
            "larger than MSTV",
            listed([of_stv[f, 0.3] for f in (1.0, 3.0, 6.67, 10.0)], ""),
            NOT_COMPARABLE,
        ),
        (
            "4.3: at 0.3 mm STV deviates more than at 1 mm (3, 6.67, 10 Hz; misprints, C5)",
            "more",
            "; ".join(f"{a:.2f} against {b:.2f}" for a, b in pairs),
            verdict(all(a > b for a, b in pairs)),
        ),
    )
    return [
        *([*row, SCRIPT] for row in rows),
        ["4.2, 4.3: MSTV agrees with the tests, less so in BC and DA", *PICTURES],
        ["Fig. 14: loops of MSTV are very similar to Fig. 7", *PICTURES],
    ]


def fit_lines(damper: DamperNumbers, quick: bool) -> list[list[str]]:
    """Return lines for Table 2: the Coulomb model fitted to loops of the MSTV model."""
    table = printed_table()
    if quick:
        table = table.iloc[[0, -1]]
    motions = [Harmonic(row.frequency_hz, row.amplitude_mm * MM) for row in table.itertuples()]
    f_max, damping = getattr(damper, "friction_force"), getattr(damper, "slider_damping")  # noqa: B009
    fits = coulomb_fits(mstv_motions(damper, motions), f_max, damping)
    return [
        [
            r.quantity,
            r.published,
            r.ours,
            r.verdict,
            "`python analyses/fit_coulomb_to_mstv.py --f-max 45`",
        ]
        for r in coulomb_rows(fits)
    ]


def main() -> None:
    """Run the benches and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="two of the 12 fits of Table 2")
    parser.add_argument("--page", type=Path, help="page to renew between its marks")
    parser.add_argument("--out", type=Path, help="also write the text to this file")
    arguments = parser.parse_args()
    runs = Runs(mstv_of_c())
    models = other_models()
    cases, sentences = case_lines(runs, models), sentence_lines(runs, models)
    heads = ["", "[C]", "ours", "verdict", "command"]
    text = page.origin("python analyses/write_paper_c.py --page docs/paper-c.md", [])
    text += page.table_text("Tests and friction: sections 2 and 4.1", heads, test_lines(runs))
    text += page.table_text(
        "Seven cases of sections 4.2 and 4.3",
        ["", "Coulomb", "Coulomb, Table 2", "STV", "STV in AB, CD", "STV in BC, DA"],
        cases,
    )
    text += page.table_text("Models in words: sections 3.3 to 4.3", heads, sentences)
    text += page.table_text("Table 2: Coulomb fits", heads, fit_lines(runs.damper, arguments.quick))
    print(text)
    page.write(text, arguments.out, arguments.page)


if __name__ == "__main__":
    main()
