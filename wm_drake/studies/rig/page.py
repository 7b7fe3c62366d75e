"""Page and tables of a bench test."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np
import pandas as pd

from wm_drake.report.formatting import MISSING, MM_PER_M, number
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.table import Column, Table, line, table_of
from wm_drake.report.terminal import Printed
from wm_drake.rigs import ForceLoop, RigRun
from wm_drake.rigs.run import stroke_points
from wm_drake.studies.rig.figures import (
    amplitude_text,
    frequency_text,
    friction_law_figure,
    overlaid_figure,
    time_figure,
)
from wm_drake.studies.rig.units import DEG_PER_RAD, units_of
from wm_drake.studies.study import Facts, Result

SAMPLES_KEPT = 4
"""Step between the samples of a loop that are written to its file."""


METHOD = (
    "The driven end moves as A sin(2 π f t). The loop shown is the steady state, in which every "
    "cycle is the same. The force is the force of the actuator on the component, positive in the "
    "direction of the displacement. A positive displacement lengthens a damper."
)


def rig_page(result: "RigResult", facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    run = result.run
    shown = measures_shown(run, result.printed)
    return SectionedPage(
        f"Bench test: {run.title}",
        f"{_summary(run)} {result.effect}".strip(),
        [
            Section("loops", "Loops", tuple(_pictures(run))),
            Section("measures", "Derived quantities", tables=(shown,)),
            Section("parameters", "Parameters", tables=(_numbers(run),)),
        ],
        [("Component", run.title), ("Loops", str(len(run.loops))), *facts.rows()],
        warnings=result.beyond,
        about="Steady-state force loops under harmonic motion, computed with the force laws.",
        method=METHOD,
    ).html()


def masses_table(run: RigRun, massless: RigRun) -> pd.DataFrame:
    """Return the effect of masses on each loop: differences from the loop without masses. [N]"""
    rows = []
    for loop, bare in zip(run.loops, massless.loops, strict=True):
        difference = loop.force - bare.force
        peak, largest = (float(np.max(np.abs(force))) for force in (bare.force, difference))
        rows.append(
            {
                "frequency_hz": loop.motion.frequency,
                "amplitude_mm": MM_PER_M * loop.motion.amplitude,
                "peak_force_without_N": peak,
                "peak_force_N": float(np.max(np.abs(loop.force))),
                "rms_difference_N": float(np.sqrt(np.mean(np.square(difference)))),
                "largest_difference_N": largest,
                "largest_difference_by_peak": largest / peak if peak else float("nan"),
            }
        )
    return pd.DataFrame(rows)


def masses_sentence(run: RigRun, massless: RigRun) -> str:
    """Return a sentence on the loop that masses change most."""
    table = masses_table(run, massless)
    worst = table.iloc[int(np.argmax(table["largest_difference_N"]))]
    return (
        f"The masses change the force by up to {worst['largest_difference_N']:.3g} N, "
        f"{100.0 * worst['largest_difference_by_peak']:.2g} % of the peak without them "
        f"({worst['frequency_hz']:.3g} Hz, {worst['amplitude_mm']:.3g} mm; there "
        f"{worst['rms_difference_N']:.2g} N root mean square)."
    )


def loop_file(loop: ForceLoop) -> str:
    """Return the file name of a loop, made of its frequency and amplitude."""
    return f"loop_{frequency_text(loop)}_{amplitude_text(loop)}.csv".replace(" ", "")


def loop_table(loop: ForceLoop) -> pd.DataFrame:
    """Return a loop as a table that `wm-drake identify` reads, with units in the column heads."""
    units = units_of(loop.rotates)
    columns = {
        "time_s": loop.time,
        f"{units.motion}_{units.unit}": units.factor * loop.displacement,
        f"{units.rate}_{units.unit}_s": units.factor * loop.velocity,
        f"{units.force}_{units.in_heads}": loop.force,
    }
    return pd.DataFrame({head: values[::SAMPLES_KEPT] for head, values in columns.items()})


PrintedErrors: TypeAlias = tuple[Sequence[float], str] | None
"""Errors that [A] prints of the tests, and a sentence on them; None without."""


def measures_table(run: RigRun, printed: PrintedErrors = None) -> pd.DataFrame:
    """Return the quantities derived from each loop, with units in the column names.

    All values are in SI except frequency, amplitude, loss angle and the printed errors of [A].
    """
    rotates = run.bench.rotates
    units, per = units_of(rotates), "Nm{}_per_rad" if rotates else "N{}_per_m"
    frame = pd.DataFrame(
        [
            {
                "frequency_hz": loop.motion.frequency,
                f"amplitude_{units.unit}": units.factor * loop.motion.amplitude,
                f"peak_{units.force}_{units.in_heads}": m.peak_force,
                "energy_per_cycle_J": m.energy_per_cycle,
                f"equivalent_damping_{per.format('s')}": m.equivalent_damping,
                f"dynamic_stiffness_{per.format('')}": m.dynamic_stiffness,
                "loss_angle_deg": DEG_PER_RAD * m.loss_angle,
            }
            for loop, m in zip(run.loops, run.measures, strict=True)
        ]
    )
    return frame.assign(printed_rmse=printed[0]) if printed else frame


def measures_shown(run: RigRun, printed: PrintedErrors = None) -> Table:
    """Return the quantities derived from each loop, in units for reading."""
    caption = (
        "Quantities derived from each loop. Energy: area of the loop. Equivalent damping: "
        "coefficient of the viscous damper that dissipates the same energy per cycle. Dynamic "
        "stiffness and loss angle: amplitude ratio and phase lead of the fundamental of the force "
        "with respect to the motion."
    )
    rotates = run.bench.rotates
    units, length = units_of(rotates), "rad" if rotates else "mm"
    heads: list[Column] = [
        Column("frequency", "Hz"),
        Column("amplitude", units.unit),
        Column(f"peak {units.force}", units.force_unit, 2),
        Column("energy per cycle", "mJ"),
        Column("equivalent damping", f"{units.force_unit} s/{length}", 3),
        Column("dynamic stiffness", f"{units.force_unit}/{length}", 2),
        Column("loss angle", "deg", 1),
    ]
    per = 1.0 if rotates else 1.0 / MM_PER_M
    factors = [1.0, 1.0, 1.0, 1e3, per, per, 1.0]
    if printed:
        caption += f" {printed[1]}"
        heads.append(Column("RMSE in [A]", "", 4))
        factors.append(1.0)
    frame = measures_table(run, printed)
    frame *= factors
    return table_of(frame, caption, dict(zip(frame.columns, heads, strict=True)))


def _numbers(run: RigRun) -> Table:
    groups = tuple(line(key, (value, source or MISSING)) for key, value, source in run.numbers)
    caption = "Parameters of the component."
    return Table(caption, ("key", "value", "source"), groups, text_columns=3)


def _pictures(run: RigRun) -> list[Picture]:
    largest = max(run.loops, key=lambda loop: (loop.motion.amplitude, -loop.motion.frequency))
    which = f"{frequency_text(largest)}, {amplitude_text(largest)}"
    points = stroke_points(run.bench, largest)
    letters = " A to B: free stroke; C: largest force; D: the motion turns." if points else ""
    pictures = [
        picture(
            time_figure(largest, points),
            f"Motion and force over one period, and the loop, at {which}.",
            f"One period at {which}: motion and force over time, and the force over displacement "
            f"and over velocity (form of [A] Figs. 5, 8, 12 and [C] Figs. 4, 5).{letters}",
        )
    ]
    if len(run.loops) > 1:
        pictures += [
            picture(
                overlaid_figure(run.loops, panel=frequency_text, line=amplitude_text, over=over),
                f"Force over {over}, one panel per frequency.",
                f"Force over {over} for all amplitudes, one panel per frequency (form of [C] Fig. "
                "6).",
            )
            for over in ("displacement", "velocity")
        ]
    counts = Counter(map(amplitude_text, run.loops))
    loops = [loop for loop in run.loops if counts[amplitude_text(loop)] > 1]
    if loops and len(set(map(frequency_text, run.loops))) > 1:
        pictures.append(
            picture(
                overlaid_figure(
                    loops, panel=amplitude_text, line=frequency_text, over="displacement"
                ),
                "Force over displacement, one panel per amplitude.",
                "Force over displacement for all frequencies, one panel per amplitude (form of [C] "
                "Figs. 7 and 14).",
            )
        )
    law = friction_law_figure(run)
    if law is not None:
        pictures.append(
            picture(
                law,
                "Friction force over sliding velocity at several deformation rates.",
                "MSTV law: friction force over the sliding velocity of the sponge, at constant "
                "deformation rates (form of [C] Fig. 12).",
            )
        )
    return pictures


def _summary(run: RigRun) -> str:
    units = units_of(run.bench.rotates)
    force, unit = units.force, units.force_unit
    peaks = [m.peak_force for m in run.measures]
    energies = [1e3 * m.energy_per_cycle for m in run.measures]
    if len(run.loops) == 1:
        loop = run.loops[0]
        return (
            f"At {frequency_text(loop)} and {amplitude_text(loop)}, the peak {force} is "
            f"{number(peaks[0], 2)} {unit}, and the energy per cycle is "
            f"{number(energies[0], 2)} mJ."
        )
    first, last = peaks.index(min(peaks)), peaks.index(max(peaks))
    at = [f"{frequency_text(run.loops[k])}, {amplitude_text(run.loops[k])}" for k in (first, last)]
    return (
        f"{len(run.loops)} loops were computed. The peak {force} ranges from "
        f"{number(peaks[first], 2)} {unit} ({at[0]}) to {number(peaks[last], 2)} {unit} ({at[1]}). "
        f"The energy per cycle ranges from {number(min(energies), 2)} to "
        f"{number(max(energies), 2)} mJ."
    )


@dataclass(frozen=True)
class RigResult(Result):
    """Result of a bench test.

    Attributes:
        massless: Its loops without masses; None if it has none.
        beyond: Sentences on tables that the motions leave.
        printed: Errors that [A] prints of these tests, and a sentence on them; None without.
    """

    run: RigRun
    massless: RigRun | None = None
    beyond: Sequence[str] = ()
    printed: tuple[Sequence[float], str] | None = None
    float_format: ClassVar[str] = "%.9g"
    page = rig_page

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return each loop, what is derived from the loops, and the effect of masses."""
        loops = {loop_file(loop).removesuffix(".csv"): loop_table(loop) for loop in self.run.loops}
        shown = {"measures": measures_table(self.run, self.printed), **loops}
        if self.massless is not None:
            shown["masses"] = masses_table(self.run, self.massless)
        return shown

    def as_json(self) -> dict[str, Any]:
        """Return what is derived from the loops for JSON: of one loop, or a list of several."""
        text = measures_table(self.run, self.printed).to_json(orient="records", double_precision=15)
        rows = json.loads(text)
        shown = rows[0] if len(rows) == 1 else {"loops": rows}
        return {"component": self.run.title, **shown}

    def terminal(self) -> Printed:
        """Return what is derived from the loops, and the effect of masses."""
        table = measures_shown(self.run, self.printed).terminal(self.run.title)
        return [table, *([self.effect] if self.effect else [])]

    @property
    def effect(self) -> str:
        """Sentence on the effect of masses; "" without masses."""
        return "" if self.massless is None else masses_sentence(self.run, self.massless)

    def warnings(self) -> Sequence[str]:
        """Return a warning for a table that the motions leave."""
        return self.beyond
